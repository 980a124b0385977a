//! Page: what the command says on screen.

use super::outcome::{Outcome, Tried, Why};
use crate::study::report::{aligned, number};
use crate::study::statistics::bisection::Answer;
use crate::study::verdict;

/// The page of `outcome`.
pub(super) fn of(outcome: &Outcome) -> String {
    let mut lines = vec![outcome.question(), outcome.words(), String::new()];
    lines.extend(settings(outcome));
    lines.push(String::new());
    lines.extend(curve(outcome));
    lines.extend(inversions(outcome));
    if let Some(tried) = outcome.failing() {
        lines.push(String::new());
        lines.extend(failing(outcome, tried));
    }
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// A search that was stopped.
pub(super) fn stopped(values: usize, runs: u64) -> String {
    let (values, runs) = (number(values, "value"), number(runs, "run"));
    format!("stopped after {values}, {runs}; nothing is written, and the same call begins again\n")
}

/// A share in percent without noise in its digits.
fn percent(share: f64) -> String {
    let text = format!("{:.6}", share * 100.0);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

fn settings(outcome: &Outcome) -> Vec<String> {
    let (demand, scale) = (&outcome.demand, &outcome.scale);
    let grid = if scale.resolution() > 0.0 {
        format!("to {} of the value, on a grid of {}", percent(scale.resolution()), scale.step())
    } else {
        format!("in steps of {}", scale.step())
    };
    let mut lines = vec![format!("expected   {}", outcome.expected.join(", ")), format!("values     {grid}")];
    if outcome.is_own {
        lines.push(format!("begins     at {}, the scenario's own value", scale.ends().0));
    }
    let sets: Vec<_> = outcome.sets.iter().map(|(key, value)| format!("{key}={value}")).collect();
    if !sets.is_empty() {
        lines.push(format!("changed    {}", sets.join(", ")));
    }
    if outcome.is_drawn() {
        let mut drawn: Vec<&str> = outcome.curve.iter().flat_map(|tried| tried.drawn.iter().copied()).collect();
        drawn.sort_unstable();
        drawn.dedup();
        lines.push(format!(
            "drawn      {}; every value has the seeds {}, {}, ...",
            drawn.join(", "),
            outcome.seed,
            outcome.seed.wrapping_add(1)
        ));
        lines.push(format!(
            "test       a value holds where at most {} of its runs fail, and does not where {} and more do; in between",
            percent(demand.good_enough),
            percent(demand.too_much)
        ));
        lines.push(format!(
            "           either may come out; each verdict is right in {} of all cases; unproven after {} fails",
            demand.confidence,
            number(demand.limit, "run")
        ));
    }
    if outcome.curve.iter().any(|tried| !tried.is_drawn() && tried.refused.is_none()) {
        let whole = if outcome.is_drawn() { " of such a value" } else { "" };
        lines.push(format!(
            "one run    decides where nothing is drawn{whole} but where the clocks begin; --limit N makes up to N runs"
        ));
    }
    lines.push(format!("runs       {} of {}", outcome.runs(), number(outcome.curve.len(), "value")));
    lines
}

fn curve(outcome: &Outcome) -> Vec<String> {
    let confidence = outcome.demand.confidence;
    let low = format!("at {confidence} from");
    let header = [outcome.key.as_str(), "runs", "failed", "share", &low, "to", "verdict"];
    let dash = || "-".to_owned();
    let row = |tried: &Tried| {
        let bounds = tried.probability(confidence).map(|known| known.bounds());
        let share = |share: f64| format!("{:.1} %", share * 100.0);
        let mut verdict = tried.verdict().to_owned();
        if !tried.tested.proven {
            verdict += ", unproven";
        }
        if tried.broke_off > 0 {
            verdict = format!("{verdict}, {} broke off", number(tried.broke_off, "run"));
        }
        vec![
            outcome.scale.text(tried.number),
            tried.tested.runs.to_string(),
            tried.tested.failures.to_string(),
            tried.share().map_or_else(dash, share),
            bounds.map_or_else(dash, |(low, _)| share(low)),
            bounds.map_or_else(dash, |(_, high)| share(high)),
            verdict,
        ]
    };
    aligned(&header, &[6], &outcome.curve.iter().map(row).collect::<Vec<_>>())
}

fn inversions(outcome: &Outcome) -> Vec<String> {
    if outcome.inversions.is_empty() {
        return Vec::new();
    }
    let mut lines =
        vec![String::new(), "not monotone: the answer is the safe one, before the first value that fails".to_owned()];
    lines.extend(outcome.inversions.iter().map(|one| {
        let text = |number| outcome.scale.text(number);
        format!("  {} fails, and {} holds again", text(one.fails), text(one.holds))
    }));
    lines
}

/// The nearest value that does not hold: its rule, or its first failing run.
fn failing(outcome: &Outcome, tried: &Tried) -> Vec<String> {
    let value = outcome.scale.text(tried.number);
    if let Some((key, fault)) = &tried.refused {
        let key = if key.is_empty() { String::new() } else { format!("{key}: ") };
        let mut lines = vec![format!("{value} is refused: {key}{}", fault.message)];
        for (title, text) in [("rule", &fault.rule), ("help", &fault.help)] {
            if !text.is_empty() {
                lines.push(format!("  {title}: {text}"));
            }
        }
        if outcome.scale.resolution() > 0.0 && outcome.answer != Answer::Nowhere {
            lines.push("  where a rule asks for a grid, --step keeps to it".to_owned());
        }
        return lines;
    }
    let Some(run) = &tried.failing else { return Vec::new() };
    let mut lines = vec![format!(
        "first failing run at {value}: number {}, seed {}, cycle {}",
        run.repetition, run.seed, run.cycle
    )];
    match &run.why {
        Why::Broken(broken) => lines.extend(verdict::page::lines(broken).into_iter().take(broken.len() + 1)),
        Why::BrokeOff(failure) => lines.push(format!("broke off: {}", failure.reason)),
    }
    lines.push(format!("  {}", run.replay));
    lines
}
