//! What goes wrong in masters and their applications: orders at the beginning and at the end of each burst.

use crate::dp::handler::Patch;
use crate::dp::master::Overlong;
use crate::time::Span;

/// What a disturbance orders of masters, or of the masters of slaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OrderFault {
    /// The sign of life for these slaves stops, and counts again at the end.
    HoldLife,
    /// The sign of life for these slaves goes on from this value, 0..=15, at each beginning.
    JumpLife(u8),
    /// One value of the sign of life for these slaves is sent for twice as long, at each beginning.
    RepeatLife,
    /// These masters keep each token so much longer.
    HoldToken(Span),
    /// These masters write a record in every cycle, whether it fits or not.
    Overlong(Overlong),
    /// These slaves are started anew with a changed Set_Prm, and with the good one at the end.
    WrongPrm(Patch),
}

impl OrderFault {
    /// Whether the end of a disturbance takes back what another one of this kind may still want.
    pub fn holds_with(&self, other: &Self) -> bool {
        matches!(
            (self, other),
            (Self::HoldLife, Self::HoldLife)
                | (Self::HoldToken(_), Self::HoldToken(_))
                | (Self::Overlong(_), Self::Overlong(_))
                | (Self::WrongPrm(_), Self::WrongPrm(_))
        )
    }
}
