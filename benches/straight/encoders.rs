//! Networks of encoders of any number, and what their start-up settles.

use std::fmt::Write as _;

use isodp::device::node::Node;
use isodp::observation::{ClockVerdict, HandlerState, Observation, Phase};
use isodp::sim::crystal::Crystal;
use isodp::sim::network::{Network, Until};
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::plan::Plan;
use isodp::study::scenario::Scenario;
use isodp::time::{Local, Span};
use isodp::wire::{Address, Fcb, FrameControl};

/// Address of the master; the encoders follow it.
const MASTER: u8 = 2;
/// Cycles after which every network has long started up.
const ENOUGH: u64 = 20_000;

/// Most encoders of a segment: with two repeaters it has 32 loads.
const PER_SEGMENT: u8 = 30;

/// The segments of so many encoders, one behind the other with repeaters between them, and the encoders on them.
fn wiring(encoders: u8) -> String {
    let segments = encoders.div_ceil(PER_SEGMENT);
    let mut text = String::new();
    for number in 0..segments {
        let first = MASTER + 1 + number * PER_SEGMENT;
        let last = (first + PER_SEGMENT - 1).min(MASTER + encoders);
        let _ = write!(
            text,
            r#"
            [[segment]]
            name = "{number}"
            cable = "20 m"
            [[slave]]
            addresses = "{first}..{last}"
            segment = "{number}"
            device = "posital-ocd-dpb1b"
            crystal = {{ within = "50 ppm" }}
            motion = {{ kind = "speed", speed = "1500 rpm" }}
            "#
        );
        if number > 0 {
            let _ = write!(text, "[[repeater]]\nfrom = \"{}\"\nto = \"{number}\"\n", number - 1);
        }
    }
    text
}

/// A network of so many encoders, 1 to 122, with these times. The watchdog is longer than the start-up of all of them,
/// in which each is asked only once in so many cycles.
fn timed(encoders: u8, t_dp: Span, t_o: Span) -> Scenario {
    let wiring = wiring(encoders);
    let text = format!(
        r#"
        [run]
        cycles = 1_000
        [bus]
        rate = "12 Mbit/s"
        [master]
        address = {MASTER}
        segment = "0"
        t_dp = "{t_dp}"
        t_i = "125 us"
        t_o = "{t_o}"
        t_pll_w = "1 us"
        watchdog = "10 s"
        gc_jitter = {{ kind = "bounded-normal", sigma = "100 ns", bound = "400 ns" }}
        crystal = {{ within = "50 ppm" }}
        {wiring}
        "#
    );
    Scenario::parse("encoders", "encoders", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// A network of so many encoders, 1 to 122, in the shortest T_DP that the planner allows.
pub(crate) fn scenario(encoders: u8) -> Scenario {
    let roomy = timed(encoders, Span::from_ms(32), Span::from_us(31_500));
    let (plan, slave) = (Plan::of(&roomy), &roomy.slaves[0]);
    let t_o = plan.t_o_min(&slave.device);
    let t_dp = t_o + slave.times.t_i + slave.device.gap_min(slave.functions);
    let t_dp = t_dp.ceil_to(slave.device.dp_grid()).max(plan.t_dp_min(&slave.device));
    timed(encoders, t_dp, t_o)
}

/// What the start-up of one station settled.
#[derive(Clone, Default)]
pub(crate) struct Station {
    crystal: Option<Crystal>,
    /// FCB of its first Data_Exchange.
    fcb: Option<Fcb>,
    /// First cycle with a Data_Exchange.
    pub(crate) joined: u64,
    /// Cycle of the first SYNCH that its clock recovery took, in its first attempt.
    clock: Option<u64>,
}
impl Station {
    /// Its crystal.
    pub(crate) fn crystal(&self) -> &Crystal {
        self.crystal.as_ref().expect("a station that was seen")
    }
    /// Cycle of the first SYNCH that its clock recovery took.
    pub(crate) fn clock(&self) -> u64 {
        self.clock.expect("a slave whose clock recovery has started")
    }
    /// FCB of its first Data_Exchange.
    pub(crate) fn fcb(&self) -> Fcb {
        self.fcb.expect("a slave that exchanges data")
    }
}

/// What the start-up of a network settled: draws of the scenario, and in which cycle who joined.
pub(crate) struct StartUp {
    stations: Vec<Station>,
    cycle: u64,
    first: Option<Local>,
}
impl StartUp {
    /// One station's part.
    pub(crate) fn station(&self, address: Address) -> &Station {
        &self.stations[usize::from(address.get())]
    }
    /// Grid point of cycle 0, by the master's crystal.
    pub(crate) fn first(&self) -> Local {
        self.first.expect("a cycle")
    }
}

impl Recorder for StartUp {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        // Addresses without an extension: Data_Exchange.
        let &[0x68, _, _, _, da @ 0..0x80, _, fc, ..] = telegram.octets else { return };
        if let (MASTER, Ok(FrameControl::Request { fcb, .. })) = (telegram.sender.get(), FrameControl::from_octet(fc)) {
            self.stations[usize::from(da)].fcb.get_or_insert(fcb);
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        let station = &mut self.stations[usize::from(stamp.station.get())];
        station.crystal.get_or_insert_with(|| stamp.crystal.clone());
        match *what {
            Observation::CycleStart { cycle, nominal } => {
                self.cycle = cycle;
                self.first.get_or_insert(nominal);
            }
            Observation::Clock { verdict: ClockVerdict::First, .. } => {
                station.clock.get_or_insert(self.cycle);
            }
            Observation::Handler { slave, to: HandlerState::DataExchange, .. } => {
                self.stations[usize::from(slave.get())].joined = self.cycle + 1;
            }
            _ => {}
        }
    }
}

/// The network of a scenario in operation: each slave is in cyclic operation, and the last cycle has just begun.
pub(crate) fn started(scenario: &Scenario) -> (Network<Node>, StartUp) {
    let mut network = build::network(scenario);
    let mut start = StartUp { stations: vec![Station::default(); 128], cycle: 0, first: None };
    let operates = |network: &Network<Node>, slave: Address| match network.station(slave) {
        Some(Node::Encoder(encoder)) => encoder.phase() == Phase::Operation,
        Some(Node::Drive(drive)) => drive.phase() == Phase::Operation,
        _ => false,
    };
    while !scenario.slaves.iter().all(|slave| operates(&network, slave.address)) {
        assert!(network.cycles() < ENOUGH, "the network does not start up");
        let until = Until::Cycle(network.cycles() + 100);
        network.run(until, u64::MAX, &mut start);
    }
    (network, start)
}
