//! Compare: what moved from one run to another, and where the two parted.
//!
//! The run before is a [`Baseline`](super::baseline::Baseline), or a second scenario that is run too. Figures are laid side by side with their
//! tolerances. If the fingerprints differ, the first difference is looked for in the way that tells most:
//!
//! | the run before | how the first difference is found | both values |
//! |---|---|---|
//! | a second scenario | both in lockstep | all |
//! | a baseline whose scenario gives its fingerprint today | the same, with the scenario that it keeps | all |
//! | a baseline of another program, or one whose other files are gone | its [`Trail`](super::baseline::Trail) | as far as it keeps them |

pub mod command;
mod moved;
mod page;
mod parted;
mod tolerance;

pub use moved::{Moved, Said, Verdict, side_by_side};
pub use parted::Parted;
pub use tolerance::{Limit, ToleranceError, Tolerances};

use super::figure::{Figure, FigureError, Value};

/// Checks that each tolerance is of some figure of these runs, and can be.
///
/// # Errors
/// A name that fits no figure, or a limit of another kind.
pub(super) fn known(tolerances: &Tolerances, runs: &[&[(String, Option<Value>)]]) -> Result<(), FigureError> {
    for (name, limit) in tolerances.iter() {
        let named = || runs.iter().copied().flatten().filter(|(figure, _)| tolerance::fits(name, figure));
        if named().next().is_none() {
            // Whoever names a figure has the nearest name; a pattern has none.
            let message = match Figure::named(name) {
                Err(error) if !name.contains('*') => return Err(error),
                _ => format!("no figure of these runs is called \"{name}\""),
            };
            return Err(FigureError {
                message,
                help: "isodp figures FILE lists all names; * stands for anything".into(),
            });
        }
        let fitting =
            |(figure, _): &(String, Option<Value>)| Figure::named(figure).is_ok_and(|figure| limit.fits(figure.unit()));
        if !named().any(fitting) {
            let message = format!("{name}: {limit} is no tolerance of this kind of figure");
            let help = "write 5%, a time as 100ns for times, a number as 3 for counts, steps and shares".into();
            return Err(FigureError { message, help });
        }
    }
    Ok(())
}
