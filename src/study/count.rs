//! Counts: what happened how often in a run, and how long things took.

use std::collections::BTreeMap;

use super::acyclic::AcyclicCounts;
use super::layout::Layout;
use super::live_list::{CycleTimes, LiveList};
use super::masters::MasterCounts;
use crate::observation::{ClockVerdict, Disturbance, Leds, LinkState, Observation, Phase, PllState, SlaveState};
use crate::time::{Span, Time};
use crate::wire::Address;

/// Everything that is counted in one run.
#[derive(Clone, PartialEq, Debug)]
pub struct Counts {
    /// What concerns all stations.
    pub network: NetworkCounts,
    /// Per slave, in address order.
    pub slaves: Vec<SlaveCounts>,
    /// Per link, in the order of the layout.
    pub links: Vec<LinkCounts>,
    /// Acyclic services, by the class of the master.
    pub acyclic: AcyclicCounts,
    /// Per address, as a bus analyser counts.
    pub live_list: LiveList,
    /// Per master, in the order of the layout; nobody where there is one only.
    pub masters: Vec<MasterCounts>,
}

/// What is counted for the network as a whole.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct NetworkCounts {
    /// True length of the run; zero until it is over.
    pub duration: Span,
    /// Cycles that began.
    pub cycles: u64,
    /// How long they took.
    pub cycle_times: CycleTimes,
    /// Requests that the master repeated.
    pub retries: u64,
    /// Requests that stayed without answer after all retries.
    pub no_answers: u64,
    /// Times that slaves asked for Slave_Diag during data exchange (DH).
    pub diagnoses: u64,
    /// Times that the master went back to Clear on its own.
    pub auto_clears: u64,
    /// SYNCHs that could not be sent when planned.
    pub late_clocks: u64,
    /// The latest of them.
    pub latest_clock: Span,
    /// SYNCHs that were left out because the token was away or the bus in use.
    pub missed_clocks: u64,
    /// How long the token took to come round to the master.
    pub rotation: Rotation,
    /// Tokens claimed after silence, the first one of a run included.
    pub tokens_claimed: u64,
    /// Telegrams that overlapped with another one.
    pub collisions: u64,
    /// Telegrams that the scenario disturbed.
    pub disturbed: u64,
    /// Observations that belong into the log of events.
    pub events: u64,
    /// Largest latch skew in counts \[steps\]; none if there was no skew.
    pub skew_counts: Option<f64>,
    /// When a master's mode changed last; none if none did.
    pub last_mode: Option<Moment>,
}

/// T_RR, the time from token to token, of a master in a ring.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Rotation {
    /// Rotations.
    pub count: u64,
    /// The shortest; zero without rotations.
    pub min: Span,
    /// The longest.
    pub max: Span,
    total: Span,
}

impl Rotation {
    pub(super) fn add(&mut self, t_rr: Span) {
        self.min = if self.count == 0 { t_rr } else { self.min.min(t_rr) };
        self.max = self.max.max(t_rr);
        self.total += t_rr;
        self.count += 1;
    }
    /// The mean; none without rotations.
    pub fn mean(&self) -> Option<Span> {
        (self.count > 0).then(|| Span::from_ticks(self.total.ticks() / self.count as i64))
    }
}

/// When something happened.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Moment {
    /// The true instant.
    pub at: Time,
    /// The cycle that had begun last, 0 before the first.
    pub cycle: u64,
}

impl Moment {
    /// `at`, when `cycles` had begun.
    const fn new(at: Time, cycles: u64) -> Self {
        Self { at, cycle: cycles.saturating_sub(1) }
    }
}

/// What is counted for one slave.
#[derive(Clone, PartialEq, Debug)]
pub struct SlaveCounts {
    /// The slave.
    pub address: Address,
    /// DP state at the end.
    pub state: SlaveState,
    /// Start-up phase at the end.
    pub phase: Phase,
    /// State of the clock recovery at the end.
    pub pll: PllState,
    /// What the LEDs show at the end.
    pub leds: Leds,
    /// How often each fault was latched, by its code in `G1_XIST2`.
    pub faults: BTreeMap<u16, u64>,
    /// Faults that were acknowledged.
    pub acknowledgements: u64,
    /// Clock failures: SYNCH outside the window or missing.
    pub clock_failures: u64,
    /// How the clock recovery locked for the first time; none if it did not.
    pub lock: Option<Lock>,
    /// How often the clock recovery locked again.
    pub resynchronisations: u64,
    /// True time in each start-up phase, by [`Phase`] number, from the beginning of the run to its end.
    pub phases: [Span; Phase::ALL.len()],
    /// Requests to this slave that the master repeated.
    pub retries: u64,
    /// Requests to this slave without answer after all retries.
    pub no_answers: u64,
    /// Times that this slave asked for Slave_Diag during data exchange (DH).
    pub diagnoses: u64,
    /// When the first fault was latched.
    pub first_fault: Option<Moment>,
    /// When the last fault was latched.
    pub last_fault: Option<Moment>,
    /// When cyclic operation was reached for the first time.
    pub first_operation: Option<Moment>,
    /// When the DP state, the start-up phase or the state of the clock recovery changed last; going without supply is a
    /// change too.
    pub last_change: Option<Moment>,
    /// The first SYNCH that the clock recovery took, as true instant and number of begun cycles.
    first: Option<(Time, u64)>,
    /// When the present phase was entered.
    since: Time,
}

/// What is counted for one slave-to-slave link.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LinkCounts {
    /// Valid receptions.
    pub valid: u64,
    /// How often nothing came for the watchdog time (Model: D27).
    pub lost: u64,
    /// Data of another length than parameterised.
    pub length_errors: u64,
    /// Longest true time between two valid receptions; none before the second.
    pub longest_gap: Option<Span>,
    /// The last valid reception.
    last: Option<Time>,
}

impl LinkCounts {
    /// Counts what the subscriber observed of this link at `at`.
    pub(super) fn observe(&mut self, at: Time, what: &Observation) {
        match *what {
            Observation::Subscribed { .. } => {
                self.valid += 1;
                let gap = self.last.replace(at).map(|last| at - last);
                self.longest_gap = self.longest_gap.max(gap);
            }
            Observation::WrongLength { .. } => self.length_errors += 1,
            Observation::Link { to: LinkState::Lost, .. } => self.lost += 1,
            _ => {}
        }
    }
}

/// Whether a slave is in another DP state, start-up phase or state of its clock recovery after this.
fn changes_state(what: &Observation) -> bool {
    match *what {
        Observation::SlaveState { from, to, .. } => from != to,
        Observation::Phase { from, to } => from != to,
        Observation::Pll { from, to } => from != to,
        Observation::Power { on: false } => true,
        _ => false,
    }
}

/// From the first SYNCH that a slave's clock recovery took to its lock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Lock {
    /// Cycles that began in between.
    pub cycles: u64,
    /// True time in between.
    pub span: Span,
}

impl Counts {
    /// Nothing counted yet.
    pub fn new(layout: &Layout) -> Self {
        let slaves = layout.slaves().iter().map(|slave| SlaveCounts::new(slave.address)).collect();
        Self {
            network: NetworkCounts::default(),
            slaves,
            links: vec![LinkCounts::default(); layout.links().len()],
            acyclic: AcyclicCounts::default(),
            live_list: LiveList::new(layout),
            masters: layout.masters().iter().map(MasterCounts::new).collect(),
        }
    }

    /// Counts what the master observed; `index` finds a slave.
    pub(super) fn master(&mut self, what: &Observation, layout: &Layout) {
        let slave = |address| layout.slave(address);
        match *what {
            Observation::CycleStart { .. } => self.network.cycles += 1,
            Observation::ClockLate { by } => {
                self.network.late_clocks += 1;
                self.network.latest_clock = self.network.latest_clock.max(by);
            }
            Observation::SynchMissed { cycles } => self.network.missed_clocks += cycles,
            Observation::TokenReceived { t_rr, .. } if t_rr > Span::ZERO => self.network.rotation.add(t_rr),
            Observation::AutoClear { .. } => self.network.auto_clears += 1,
            Observation::DiagnosisDue { slave: address } => {
                self.network.diagnoses += 1;
                if let Some(index) = slave(address) {
                    self.slaves[index].diagnoses += 1;
                }
            }
            Observation::TokenClaimed => self.network.tokens_claimed += 1,
            Observation::Retry { slave: address } => {
                self.network.retries += 1;
                if let Some(index) = slave(address) {
                    self.slaves[index].retries += 1;
                }
            }
            Observation::NoAnswer { slave: address } => {
                self.network.no_answers += 1;
                if let Some(index) = slave(address) {
                    self.slaves[index].no_answers += 1;
                }
            }
            _ => {}
        }
    }

    /// Counts what any station, `observer`, observed at `at`; whether it is an event is counted by the caller.
    pub(super) fn station(&mut self, at: Time, observer: Address, what: &Observation) {
        self.live_list.observe(observer, what);
        if !self.masters.is_empty()
            && MasterCounts::concerns(what)
            && let Some(master) = self.masters.iter_mut().find(|master| master.address == observer)
        {
            master.observe(at, what);
        }
        match what {
            Observation::Collision { .. } => self.network.collisions += 1,
            Observation::Disturbed { how: Disturbance::Begins | Disturbance::Ends, .. } => {}
            Observation::Disturbed { .. } => self.network.disturbed += 1,
            Observation::MasterMode { from, to } if from != to => {
                self.network.last_mode = Some(Moment::new(at, self.network.cycles));
            }
            _ => {}
        }
        self.acyclic.station(what);
    }

    /// The run is over at `end`: closes what is still open.
    pub(super) fn finish(&mut self, end: Time) {
        self.network.duration = end.since_zero();
        self.masters.iter_mut().for_each(|master| master.finish(end));
        for slave in &mut self.slaves {
            slave.phases[slave.phase as usize] += end - slave.since;
            slave.since = end;
        }
    }
}

impl SlaveCounts {
    fn new(address: Address) -> Self {
        Self {
            address,
            state: SlaveState::PowerOn,
            phase: Phase::Configuration,
            pll: PllState::Idle,
            leds: Leds::NoSupply,
            faults: BTreeMap::new(),
            acknowledgements: 0,
            clock_failures: 0,
            lock: None,
            resynchronisations: 0,
            phases: [Span::ZERO; Phase::ALL.len()],
            retries: 0,
            no_answers: 0,
            diagnoses: 0,
            first_fault: None,
            last_fault: None,
            first_operation: None,
            last_change: None,
            first: None,
            since: Time::ZERO,
        }
    }

    /// Counts what this slave observed at `at`, `cycles` after the beginning.
    pub(super) fn observe(&mut self, at: Time, cycles: u64, what: &Observation) {
        let now = Moment::new(at, cycles);
        if changes_state(what) {
            self.last_change = Some(now);
        }
        match *what {
            Observation::SlaveState { to, .. } => self.state = to,
            Observation::Phase { to, .. } => {
                self.phase(at, to);
                if to == Phase::Operation {
                    self.first_operation.get_or_insert(now);
                }
            }
            Observation::Leds { to, .. } => self.leds = to,
            Observation::Power { on: false } => {
                self.phase(at, Phase::Configuration);
                (self.state, self.pll, self.leds) = (SlaveState::PowerOn, PllState::Idle, Leds::NoSupply);
            }
            Observation::Clock { verdict: ClockVerdict::First, .. } => {
                self.first.get_or_insert((at, cycles));
            }
            Observation::Clock { verdict: ClockVerdict::Outside | ClockVerdict::Missing, .. } => {
                self.clock_failures += 1;
            }
            Observation::Pll { to, .. } => self.pll(at, cycles, to),
            Observation::Fault { code } => {
                *self.faults.entry(code).or_insert(0) += 1;
                self.first_fault.get_or_insert(now);
                self.last_fault = Some(now);
            }
            Observation::Acknowledged { .. } => self.acknowledgements += 1,
            _ => {}
        }
    }

    /// What a slave without supply left is seen only when it is back: the time counts for the phase it was taken for.
    fn phase(&mut self, at: Time, to: Phase) {
        self.phases[self.phase as usize] += at - self.since;
        (self.phase, self.since) = (to, at);
    }

    fn pll(&mut self, at: Time, cycles: u64, to: PllState) {
        self.pll = to;
        if to != PllState::Locked {
            return;
        }
        match (self.lock, self.first) {
            (Some(_), _) => self.resynchronisations += 1,
            (None, first) => {
                let (since, begun) = first.unwrap_or((at, cycles));
                self.lock = Some(Lock { cycles: cycles - begun, span: at - since });
            }
        }
    }

    /// All faults, whatever their code.
    pub fn fault_count(&self) -> u64 {
        self.faults.values().sum()
    }
}
