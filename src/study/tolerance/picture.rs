//! Picture: what of an outcome is drawn.

use super::outcome::Outcome;
use crate::study::plot::tolerance::{Band, Chance, Mark, Point, Tolerance};
use crate::study::statistics::bisection::Answer;

/// Draws the picture.
///
/// # Errors
/// What the library says.
pub(super) fn draw(outcome: &Outcome) -> Result<String, String> {
    let scale = &outcome.scale;
    let demand = &outcome.demand;
    let point = |tried: &super::outcome::Tried| Point {
        x: scale.value(tried.number),
        share: tried.share(),
        bounds: tried.probability(demand.confidence).map(|known| known.bounds()),
        mark: match (&tried.refused, tried.holds(), tried.tested.proven) {
            (Some(_), ..) => Mark::Refused,
            (None, true, _) => Mark::Holds,
            (None, false, true) => Mark::Fails,
            (None, false, false) => Mark::Unproven,
        },
    };
    let text = |number: i64| scale.text(number);
    let band = match outcome.answer {
        Answer::Band { holds, fails } => Some(Band {
            ends: (scale.value(holds), scale.value(fails)),
            words: format!("the limit is between {} and {}", text(holds), text(fails)),
        }),
        Answer::Everywhere | Answer::Nowhere => None,
    };
    let unit = if scale.unit().is_empty() { String::new() } else { format!(" [{}]", scale.unit()) };
    Tolerance {
        title: outcome.question(),
        answer: outcome.words(),
        expected: outcome.expected.join(", "),
        x: format!("{}{unit}", outcome.key),
        points: outcome.curve.iter().map(point).collect(),
        band,
        chance: outcome.is_drawn().then(|| Chance {
            good_enough: demand.good_enough,
            too_much: demand.too_much,
            confidence: demand.confidence.to_string(),
        }),
        footer: format!("isodp | scenario {}, seeds from {}, {} runs", outcome.scenario, outcome.seed, outcome.runs()),
    }
    .draw()
}
