//! First faults: where each slave latched each of its faults first, for who wants to look at it again.

use super::row::{EventRow, Sink};
use crate::observation::Observation;
use crate::time::Time;
use crate::wire::Address;

/// A fault of a slave where it was latched first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FirstFault {
    /// The slave.
    pub slave: Address,
    /// The code (manual 5.3).
    pub code: u16,
    /// In which cycle.
    pub cycle: u64,
    /// True time.
    pub at: Time,
    /// How often the slave latched it in the whole run.
    pub count: u64,
}

/// The first fault of each slave and code, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct FirstFaults(Vec<FirstFault>);

impl FirstFaults {
    /// All of them.
    pub fn all(&self) -> &[FirstFault] {
        &self.0
    }
}

impl Sink for FirstFaults {
    fn event(&mut self, row: &EventRow) {
        let Observation::Fault { code } = row.what else { return };
        match self.0.iter_mut().find(|known| (known.slave, known.code) == (row.station, code)) {
            Some(known) => known.count += 1,
            None => self.0.push(FirstFault { slave: row.station, code, cycle: row.cycle, at: row.at, count: 1 }),
        }
    }
}
