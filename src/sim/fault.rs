//! What goes wrong: disturbances, each with a name, a window of time and what it does.
//!
//! A disturbance changes octets and instants on the line, or orders something of a station's surroundings; it never
//! reaches into a machine. What it draws belongs to its name, so that one more leaves the others' draws as they are.

pub mod damage;
pub mod line;
pub mod manner;
pub mod which;
pub mod window;

use crate::sim::fault::line::{Line, LineFault};
use crate::sim::fault::window::Window;
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
    /// Those of the line.
    pub line: Line,
}

impl Faults {
    /// The disturbances of a run with `seed` among `stations`, in the order of the scenario.
    pub fn new(disturbances: &[Disturbance], seed: u64, stations: &[Address]) -> Self {
        let mut faults = Self::default();
        for (number, Disturbance { name, window, what }) in disturbances.iter().enumerate() {
            let number = number as u16;
            match what {
                What::Line(fault) => faults.line.add((number, name, *window), *fault, (seed, stations)),
            }
        }
        faults
    }
}
