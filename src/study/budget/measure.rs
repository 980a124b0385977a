//! Measure: one run of a variant of the scenario, of which only the error of each clock recovery is kept.

use crate::device::node::Node;
use crate::device::pll::PllSettings;
use crate::observation::{ClockVerdict, Observation, PllState};
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::NearQueue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::study::build;
use crate::study::event_budget::{EventBudget, NoHeadway};
use crate::study::histogram::Histogram;
use crate::study::scenario::{Scenario, Slave};
use crate::time::{Local, Span, Time};
use crate::wire::Address;

/// Cycles after each lock that do not count. Model: what the first SYNCH left of an offset shrinks by the factor 0.88 per
/// cycle with the default gains, to less than a thousandth in 64 cycles.
pub const SETTLING: u64 = 64;
/// Largest error that has a place in the histogram. Model: a quarter of the longest T_DP (32 ms), beyond which no window
/// reaches.
const LIMIT: Span = Span::from_ms(8);

/// The errors of one slave in one variant.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Measured {
    /// Cycles that count.
    pub cycles: u64,
    /// Largest magnitude of the PLL error e.
    pub worst: Span,
    /// What 99.9 % of the magnitudes do not exceed, to three significant digits.
    pub p99_9: Span,
    /// What the largest error would be for a prediction that follows the master's jitter-free grid exactly: the largest
    /// distance of the captured arrival from its mean, counted from that grid.
    pub direct: Span,
}

/// Half width of the window of `slave` once it is locked.
pub fn window(scenario: &Scenario, slave: &Slave) -> Span {
    let settings = PllSettings::new(scenario.master.t_dp, slave.times.t_pll_w, slave.times.t_pll_d);
    slave.options.pll.on(settings).final_window()
}

/// The slaves with a clock, in address order.
pub fn clocked(scenario: &Scenario) -> impl Iterator<Item = &Slave> {
    scenario.configured().filter(|slave| scenario.is_clocked(slave))
}

/// Runs `scenario`: what each slave with a clock makes of it, in address order.
///
/// # Errors
/// The run makes no headway.
pub fn measure(scenario: &Scenario) -> Result<Vec<Measured>, NoHeadway> {
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(scenario);
    let mut errors = Errors::of(scenario);
    EventBudget::of(scenario).run(&mut network, scenario, &mut errors, |_| ())?;
    Ok(errors.watches.iter().map(Watch::measured).collect())
}

/// Reads the run.
struct Errors {
    master: Address,
    /// The jitter-free instant of the latest SYNCH.
    grid: Option<Time>,
    watches: Vec<Watch>,
}

/// One slave.
struct Watch {
    slave: Address,
    quantum: Span,
    locked: bool,
    /// Verdicts since the lock.
    since: u64,
    errors: Histogram,
    /// Captured arrival minus grid, smallest and largest \[ticks\], and the sum of all.
    direct: (i64, i64),
    sum: i128,
}

impl Watch {
    fn of(slave: &Slave) -> Self {
        Self {
            slave: slave.address,
            quantum: slave.options.pll.quantum,
            locked: false,
            since: 0,
            errors: Histogram::new(LIMIT, false),
            direct: (i64::MAX, i64::MIN),
            sum: 0,
        }
    }
    /// A verdict with error `error` about a SYNCH `late` behind the grid.
    fn judged(&mut self, error: Span, late: Span) {
        self.since += 1;
        if self.since > SETTLING {
            self.errors.record(error.abs());
            let ticks = late.ticks();
            self.direct = (self.direct.0.min(ticks), self.direct.1.max(ticks));
            self.sum += i128::from(ticks);
        }
    }
    fn measured(&self) -> Measured {
        let cycles = self.errors.count();
        let (Some(worst), Some(p99_9)) = (self.errors.max(), self.errors.percentile(99.9)) else {
            return Measured::default();
        };
        let mean = self.sum.div_euclid(i128::from(cycles)) as i64;
        let direct = (self.direct.1 - mean).max(mean - self.direct.0);
        Measured { cycles, worst, p99_9, direct: Span::from_ticks(direct) }
    }
}

impl Errors {
    fn of(scenario: &Scenario) -> Self {
        Self { master: scenario.master.address, grid: None, watches: clocked(scenario).map(Watch::of).collect() }
    }
}

impl Recorder for Errors {
    fn telegram(&mut self, _: &Transmission<'_>) {}

    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match *what {
            Observation::CycleStart { nominal, .. } if stamp.station == self.master => {
                self.grid = Some(stamp.crystal.to_true(nominal));
            }
            Observation::Pll { to, .. } => {
                if let Ok(index) = self.watches.binary_search_by_key(&stamp.station, |watch| watch.slave) {
                    (self.watches[index].locked, self.watches[index].since) = (to == PllState::Locked, 0);
                }
            }
            Observation::Clock { verdict: ClockVerdict::Hit | ClockVerdict::Outside, error, .. } => {
                let Some(grid) = self.grid else { return };
                let Ok(index) = self.watches.binary_search_by_key(&stamp.station, |watch| watch.slave) else { return };
                let watch = &mut self.watches[index];
                if watch.locked {
                    // As the slave's timer reads it (Model: D14).
                    let arrival = stamp.crystal.to_local(stamp.at).since_zero().div_floor(watch.quantum);
                    let late = Local::ZERO + watch.quantum * arrival - stamp.crystal.to_local(grid);
                    watch.judged(error, late);
                }
            }
            _ => {}
        }
    }
}
