//! JSON: what was found, for other programs.

use serde_json::{Value, json};

use super::outcome::{Outcome, Tried, Why};
use super::table::why;
use crate::study::statistics::bisection::Answer;

/// Everything as JSON; values are numbers in the unit that is named.
pub(super) fn text(outcome: &Outcome) -> String {
    let Outcome { scale, demand, .. } = outcome;
    let value = |number: i64| scale.value(number);
    let (answer, holds, fails) = match outcome.answer {
        Answer::Band { holds, fails } => ("band", Some(value(holds)), Some(value(fails))),
        Answer::Everywhere => ("everywhere", Some(value(scale.last())), None),
        Answer::Nowhere => ("nowhere", None, Some(value(0))),
    };
    let inversions: Vec<_> = (outcome.inversions.iter())
        .map(|one| json!({ "fails": value(one.fails), "holds": value(one.holds) }))
        .collect();
    let all = json!({
        "scenario": outcome.scenario,
        "question": outcome.question(),
        "key": outcome.key,
        "unit": scale.unit(),
        "from": value(0),
        "from_scenario": outcome.is_own,
        "to": value(scale.last()),
        "step": scale.step().to_string(),
        "resolution": (scale.resolution() > 0.0).then(|| scale.resolution()),
        "seed": outcome.seed,
        "set": outcome.sets.iter().map(|(key, value)| (key.clone(), json!(value))).collect::<serde_json::Map<_, _>>(),
        "expected": outcome.expected,
        "confidence": demand.confidence.value(),
        "good_enough": demand.good_enough,
        "too_much": demand.too_much,
        "limit": demand.limit,
        "answer": answer,
        "holds": holds,
        "fails": fails,
        "words": outcome.words(),
        "runs": outcome.runs(),
        "inversions": inversions,
        "curve": outcome.curve.iter().map(|tried| point(outcome, tried)).collect::<Vec<_>>(),
    });
    format!("{all:#}\n")
}

fn point(outcome: &Outcome, tried: &Tried) -> Value {
    let bounds = tried.probability(outcome.demand.confidence).map(|known| known.bounds());
    let failing = tried.failing.as_ref().map(|run| {
        let broken = match &run.why {
            Why::Broken(broken) => json!(broken),
            Why::BrokeOff(_) => json!([]),
        };
        json!({
            "repetition": run.repetition,
            "seed": run.seed,
            "cycle": run.cycle,
            "broken": broken,
            "replay": run.replay,
        })
    });
    json!({
        "value": outcome.scale.value(tried.number),
        "text": outcome.scale.text(tried.number),
        "verdict": tried.verdict(),
        "proven": tried.tested.proven,
        "drawn": tried.drawn,
        "runs": tried.tested.runs,
        "failures": tried.tested.failures,
        "broke_off": tried.broke_off,
        "share": tried.share(),
        "low": bounds.map(|(low, _)| low),
        "high": bounds.map(|(_, high)| high),
        "why": why(tried),
        "first_failing": failing,
    })
}
