//! Wire: octets to telegrams and PDUs, and back. No state, no time, no allocation.
//!
//! [`Telegram`] is one telegram of the line with everything that a receiver checks already checked, [`Frame`] holds the
//! octets of one. The other modules read and write what a data unit carries: [`prm`] and [`config`] during start-up,
//! [`diag`], [`link_status`] and [`control`] beside the cycle, [`drive`] in each cycle, [`acyclic`] and [`parameter`] in what is left of it.
//!
//! # Guarantees
//! - No octets make a parser panic: what a remote station sends is data.
//! - What a parser accepts and its emitter writes again is the same octets. Exceptions: SD3 leaves as SD2, a `Set_Prm` of
//!   7 octets as one of 10, the padding of a parameter value as 0, a diagnosis without its extended blocks.
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

/// A word of named bits: for each bit a constant, a question and the standard's name.
macro_rules! bits {
    ($(#[$outer:meta])* pub struct $type:ident: $int:ty {
        $($(#[$doc:meta])* $get:ident $name:ident = $bit:literal, $text:literal;)*
    }) => {
        $(#[$outer])*
        ///
        /// Bits without a name are kept as they came. Shown as the names of the bits that are set.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
        pub struct $type(pub $int);

        impl $type {
            $($(#[$doc])* pub const $name: Self = Self(1 << $bit);)*
            /// All bits that have a name.
            pub const NAMED: Self = Self(0 $(| 1 << $bit)*);

            $($(#[$doc])* pub const fn $get(self) -> bool { self.has(Self::$name) })*
            /// Whether all of `bits` are set.
            pub const fn has(self, bits: Self) -> bool {
                self.0 & bits.0 == bits.0
            }
            /// The same with `bits` set or cleared.
            #[must_use]
            pub const fn with(self, bits: Self, on: bool) -> Self {
                if on { Self(self.0 | bits.0) } else { Self(self.0 & !bits.0) }
            }
            /// The bits that are set and have no name.
            pub const fn unnamed(self) -> $int {
                self.0 & !Self::NAMED.0
            }
        }
        impl core::ops::BitOr for $type {
            type Output = Self;
            fn bitor(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }
        }
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                let mut gap = "";
                for (bit, name) in [$((Self::$name, $text),)*] {
                    if self.has(bit) {
                        write!(f, "{gap}{name}")?;
                        gap = ", ";
                    }
                }
                if gap.is_empty() { f.write_str("none") } else { Ok(()) }
            }
        }
    };
}

/// The rules of a data unit and the error that names the octet which breaks one.
macro_rules! rules {
    ($(#[$outer:meta])* pub struct $error:ident, pub enum $rule:ident { $($name:ident = $text:literal;)* }) => {
        /// What is asked of the octets; each reads as the second half of a sentence.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
        pub enum $rule { $(#[doc = $text] $name,)* }

        $(#[$outer])*
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
        pub struct $error {
            /// Number of the first octet concerned, counted from 1 as the manuals do.
            pub octet: usize,
            /// The rule it breaks.
            pub rule: $rule,
            /// The value found there.
            pub value: u32,
        }
        impl $error {
            pub(crate) fn new(octet: usize, rule: $rule, value: impl Into<u32>) -> Self {
                Self { octet, rule, value: value.into() }
            }
        }
        impl core::fmt::Display for $error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                let rule = match self.rule { $($rule::$name => $text,)* };
                write!(f, "octet {} is {}, but {rule}", self.octet, self.value)
            }
        }
        impl core::error::Error for $error {}
    };
}

pub mod acyclic;
pub mod config;
pub mod control;
pub mod diag;
pub mod drive;
pub mod header;
pub mod link_status;
pub mod parameter;
pub mod prm;
pub mod telegram;
#[cfg(test)]
mod vectors;
pub mod words;

pub use header::{Address, Fcb, FrameControl, Header, Sap, Service, StationType, Status};
pub use telegram::{Frame, MAX_DU, MAX_FRAME, Telegram, TelegramError};

/// Writes octets one after another; `None` once they do not fit.
struct Writer<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl<'a> Writer<'a> {
    fn new(out: &'a mut [u8]) -> Self {
        Self { out, len: 0 }
    }
    fn put(&mut self, octets: &[u8]) -> Option<()> {
        let end = self.len + octets.len();
        self.out.get_mut(self.len..end)?.copy_from_slice(octets);
        self.len = end;
        Some(())
    }
    /// Octets behind an octet that counts them.
    fn put_counted(&mut self, octets: &[u8]) -> Option<()> {
        self.put(&[u8::try_from(octets.len()).ok()?])?;
        self.put(octets)
    }
}
