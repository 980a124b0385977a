//! Wire: octets to telegrams and PDUs, and back. No state, no time, no allocation.
//!
//! [`Telegram`] is one telegram of the line with everything that a receiver checks already checked, [`Frame`] holds the
//! octets of one. The other modules read and write what a data unit carries: [`prm`] and [`config`] during start-up,
//! [`diag`] and [`control`] beside the cycle, [`drive`] in each cycle, [`acyclic`] in what is left of it.
//!
//! # Guarantees
//! - No octets make a parser panic: what a remote station sends is data.
//! - What a parser accepts and its emitter writes again is the same octets, except SD3, which leaves as SD2.
//! - All integers in data units are big-endian.

/// An enum of code numbers with their names in the standard's words: one line per code.
macro_rules! codes {
    ($(#[$outer:meta])* pub enum $type:ident: $int:ty { $($(#[$doc:meta])* $name:ident = $code:literal, $text:literal;)* }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
        pub enum $type { $($(#[$doc])* $name,)* }

        impl $type {
            /// Every value, in the order of the declaration.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The value with this code number, `None` for a number that is not assigned.
            pub const fn from_code(code: $int) -> Option<Self> {
                Some(match code { $($code => Self::$name,)* _ => return None })
            }
            /// The code number on the wire.
            pub const fn code(self) -> $int {
                match self { $(Self::$name => $code,)* }
            }
            /// The name in the standard's words.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

pub mod header;
pub mod telegram;

pub use header::{Address, Fcb, FrameControl, Header, Sap, Service, StationType, Status};
pub use telegram::{Frame, MAX_DU, MAX_FRAME, Telegram, TelegramError};
