//! Happening: one telegram or one observation of a run, as one line that two runs can be compared by.

use std::fmt;
use std::mem::discriminant;

use crate::observation::Observation;
use crate::sim::record::{Stamp, Transmission};
use crate::time::{Local, Span, Time};
use crate::wire::words::Words;
use crate::wire::{Sap, Telegram};

/// Control_Command and Group_Select of SYNCH (Model: D5).
const SYNCH: [u8; 2] = [0x00, 0x80];

/// Something that a station did or saw, with the cycle that it belongs to.
#[derive(Clone, PartialEq, Debug)]
pub struct Happening {
    /// The cycle; none before the first. SYNCH belongs to the cycle that it begins.
    pub cycle: Option<u64>,
    /// First bit of a telegram at its sender, or when something was observed, in true time.
    pub at: Time,
    /// What.
    pub what: What,
}

/// What a station did or saw.
#[derive(Clone, PartialEq, Debug)]
pub enum What {
    /// It sent a telegram.
    Telegram {
        /// Its octets.
        octets: Vec<u8>,
        /// From the first bit to the last, in true time: a crystal shows here first.
        length: Span,
    },
    /// It observed this. Instants that it reads from its own crystal are turned into true ones, since two crystals that
    /// show different times are no difference.
    Observation(Observation),
    /// What a file says of either.
    Told(String),
}

impl Happening {
    /// A telegram in `cycle`.
    pub fn of_telegram(cycle: Option<u64>, telegram: &Transmission<'_>) -> Self {
        let what = What::Telegram { octets: telegram.octets.to_vec(), length: telegram.end - telegram.start };
        let begun = if is_synch(telegram.octets) { Some(cycle.map_or(0, |cycle| cycle + 1)) } else { cycle };
        Self { cycle: begun, at: telegram.start, what }
    }
    /// An observation in `cycle`.
    pub fn of_observation(cycle: Option<u64>, stamp: &Stamp<'_>, what: &Observation) -> Self {
        let what = match *what {
            Observation::CycleStart { cycle, nominal } => {
                let nominal = Local::from_ticks(stamp.crystal.to_true(nominal).ticks());
                Observation::CycleStart { cycle, nominal }
            }
            what => what,
        };
        Self { cycle, at: stamp.at, what: What::Observation(what) }
    }
    /// Whether this is a SYNCH.
    pub fn is_synch(&self) -> bool {
        match &self.what {
            What::Telegram { octets, .. } => is_synch(octets),
            What::Observation(_) => false,
            What::Told(text) => text.starts_with("to 127: SYNCH "),
        }
    }
    /// Whether both are the same at the same instant.
    pub fn agrees_with(&self, other: &Self) -> bool {
        self.at == other.at && self.what == other.what
    }
}

impl What {
    /// Whether both are of one kind: two telegrams, the same observation with other values, the same text.
    pub fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Telegram { .. }, Self::Telegram { .. }) => true,
            (Self::Observation(one), Self::Observation(other)) => discriminant(one) == discriminant(other),
            (Self::Told(one), Self::Told(other)) => one == other,
            _ => false,
        }
    }
}

/// Whether a telegram is a SYNCH.
pub(in crate::study) fn is_synch(octets: &[u8]) -> bool {
    match Telegram::parse(octets) {
        Ok(Telegram::Data { header, du }) => header.dsap == Some(Sap::GLOBAL_CONTROL) && *du == SYNCH,
        _ => false,
    }
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Telegram { octets, length } => {
                match Telegram::parse(octets) {
                    Ok(Telegram::Data { header, .. }) => write!(f, "to {}: ", header.da)?,
                    Ok(Telegram::Token { da, .. }) => write!(f, "to {da}: ")?,
                    Ok(Telegram::ShortAck) | Err(_) => {}
                }
                match Telegram::parse(octets) {
                    Ok(telegram) => Words::of(telegram).fmt(f)?,
                    Err(error) => write!(f, "unreadable: {error}")?,
                }
                f.write_str(" |")?;
                octets.iter().try_for_each(|octet| write!(f, " {octet:02X}"))?;
                write!(f, " [{} ticks]", length.ticks())
            }
            Self::Observation(what) => {
                what.fmt(f)?;
                finer(f, what)
            }
            Self::Told(text) => f.write_str(text),
        }
    }
}

/// What the usual line of an observation leaves out or rounds, and what makes a difference here.
fn finer(f: &mut fmt::Formatter<'_>, what: &Observation) -> fmt::Result {
    match what {
        Observation::CycleStart { nominal, .. } => write!(f, ", aimed at {} ticks", nominal.ticks()),
        Observation::Clock { error, period, window, .. } => {
            write!(f, ", period {period} [{} {} {} ticks]", error.ticks(), period.ticks(), window.ticks())
        }
        Observation::Latch { inputs, .. } => {
            write!(f, ", ZSW2 {:04X}, G1_ZSW {:04X}, G1_XIST2 {}", inputs.zsw2, inputs.g1_zsw, inputs.xist2)
        }
        Observation::ExchangeDone { t_dx: span, .. }
        | Observation::ClockLate { by: span }
        | Observation::AcyclicDone { took: span, .. } => write!(f, " [{} ticks]", span.ticks()),
        Observation::CycleSpare { acyclic: one, spare: other }
        | Observation::TokenReceived { t_rr: one, t_th: other } => {
            write!(f, " [{} {} ticks]", one.ticks(), other.ticks())
        }
        _ => Ok(()),
    }
}

/// Instant and text in one line.
impl fmt::Display for Happening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.9} s  {}", self.at.since_zero().as_s(), self.what)
    }
}
