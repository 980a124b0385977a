//! What goes wrong: disturbances, each with a name, a window of time and what it does.
//!
//! A disturbance changes octets and instants on the line, or orders something of a station's surroundings; it never
//! reaches into a machine. What it draws belongs to its name, so that one more leaves the others' draws as they are.

pub mod line;
pub mod window;

use crate::sim::fault::line::{LineFault, OnLine};
use crate::sim::fault::window::Window;
use crate::time::Time;
use crate::wire::Address;

/// One disturbance of a scenario.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Disturbance {
    /// What people call it; its draws hang on it.
    pub name: String,
    /// When it acts.
    pub window: Window,
    /// What it does.
    pub what: What,
}

/// What a disturbance does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum What {
    /// It decides what becomes of telegrams.
    Line(LineFault),
}

/// All disturbances of a network at work.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    line: Vec<OnLine>,
}

impl Faults {
    /// The disturbances of a run, in the order of the scenario.
    pub fn new(disturbances: &[Disturbance]) -> Self {
        let mut faults = Self::default();
        for (number, Disturbance { window, what, .. }) in disturbances.iter().enumerate() {
            let number = number as u16;
            match what {
                What::Line(fault) => faults.line.push(OnLine { number, window: *window, fault: *fault }),
            }
        }
        faults
    }

    /// Number of the disturbance that loses this telegram, if one does. `clock` marks SYNCH; `cycle` is the running
    /// cycle, for SYNCH the one it begins.
    pub fn loses(&self, (now, cycle): (Time, u64), sender: Address, clock: bool, octets: &[u8]) -> Option<u16> {
        let lost = |line: &&OnLine| line.window.contains(now, cycle) && line.fault.loses(sender, clock, octets);
        self.line.iter().find(lost).map(|line| line.number)
    }
}
