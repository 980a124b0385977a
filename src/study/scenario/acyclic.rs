//! The times of acyclic services, as GSD files count them.

use super::error::Fault;
use super::section::quantity;
use super::tree::Node;
use crate::study::quantity::span;
use crate::time::Span;

/// The step of these times in a GSD file.
const STEP: Span = Span::from_ms(10);
/// The longest: two octets of steps.
const LONGEST: Span = Span::from_ms(10 * 65_535);

/// A response timeout.
pub(super) fn timeout(node: &Node) -> Result<Span, Fault> {
    match quantity("10 s", |text| span(text, None))(node)? {
        time if time <= Span::ZERO || time > LONGEST || !time.is_multiple_of(STEP) => {
            Err(Fault::new(format!("{time} is no response timeout"))
                .rule(
                    "GSD files count C1_Response_Timeout and C2_Response_Timeout in steps of 10 ms, 1 to 65535 of them",
                )
                .help("for example \"10 s\", or \"10 ms\" at least"))
        }
        time => Ok(time),
    }
}
