//! Attempt: one run that may break off without harm to whoever does many.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::journal::Failure;
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;
use crate::study::figure::{Figure, Figures};
use crate::study::histogram::Histograms;
use crate::study::measure::measure;
use crate::study::pool::Pools;
use crate::study::scenario::Scenario;

thread_local! {
    static AT_WORK: Cell<bool> = const { Cell::new(false) };
}

/// Whether a run is under way on this thread. What a panic of it says goes into its record, and need not be told twice.
pub fn is_at_work() -> bool {
    AT_WORK.get()
}

/// Runs `scenario` for the figures `wanted` and expected and for `pools`, in the memory of `used`, if there is any, as long
/// as `go_on` says yes; none if it did not.
///
/// # Errors
/// The run makes no headway, or the model breaks off.
pub(in crate::study) fn attempt(
    (wanted, pools): (&[Figure], &mut Pools),
    scenario: &Scenario,
    used: Option<Histograms>,
    go_on: impl Fn() -> bool,
) -> Result<Option<Figures>, Failure> {
    let mut cycle = 0;
    AT_WORK.set(true);
    // What the run has touched is thrown away where it fails.
    let measured = catch_unwind(AssertUnwindSafe(|| {
        measure::<NearQueue<NetworkEvent>>((wanted, pools), scenario, used, |progress| {
            cycle = progress.cycles.saturating_sub(1);
            go_on()
        })
    }));
    AT_WORK.set(false);
    match measured {
        Ok(Ok(figures)) => Ok(figures),
        Ok(Err(no_headway)) => Err(Failure { reason: no_headway.to_string(), cycle }),
        Err(panic) => Err(Failure { reason: words(&*panic), cycle }),
    }
}

/// What a panic says.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the model broke off: {}", text.unwrap_or("without a word"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_panic_says_is_kept() {
        assert_eq!(words(&"why"), "the model broke off: why");
        assert_eq!(words(&"why".to_owned()), "the model broke off: why");
        assert_eq!(words(&3), "the model broke off: without a word");
    }
}
