//! The straight loop and the network give the same results, bit for bit.
//!
//! Compared are, for some hundred cycles after the start-up: the octets and the last bit's true instant of each SYNCH,
//! Data_Exchange request and reply, each clock error, both signs of life at each T_O, each latch's true instant and
//! words, and all histograms but `spare`, which the loop finds without GAP polls and without the repeated Operate.

use super::encoders::{self, StartUp};
use super::{Straight, Witness};
use isodp::device::node::Node;
use isodp::observation::{ClockVerdict, Observation};
use isodp::sim::network::{Network, Until};
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::histogram::{Histogram, Histograms, Subject};
use isodp::study::metric::Metrics;
use isodp::study::run;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};
use isodp::wire::Address;
use isodp::wire::drive::Inputs81;

/// One result.
#[derive(Clone, PartialEq, Debug)]
enum Seen {
    Telegram(Time, Vec<u8>),
    Clock(Span),
    SetPoint(u8, u8),
    Latch(Time, u16, u16, u32, u32),
}

/// The results of each station, in their order.
struct Results {
    stations: Vec<Vec<Seen>>,
    /// A cycle before the first that counts is still under way.
    waits: bool,
}

impl Results {
    fn new(waits: bool) -> Self {
        Self { stations: vec![Vec::new(); 128], waits }
    }
    fn see(&mut self, station: Address, seen: Seen) {
        if !self.waits {
            self.stations[usize::from(station.get())].push(seen);
        }
    }
    fn of(&self, station: Address) -> &[Seen] {
        &self.stations[usize::from(station.get())]
    }
}

impl Witness for Results {
    fn telegram(&mut self, sender: Address, end: Time, octets: &[u8]) {
        self.see(sender, Seen::Telegram(end, octets.to_vec()));
    }
    fn clock(&mut self, slave: Address, error: Span) {
        self.see(slave, Seen::Clock(error));
    }
    fn set_point(&mut self, slave: Address, mls: u8, sls: u8) {
        self.see(slave, Seen::SetPoint(mls, sls));
    }
    fn latch(&mut self, slave: Address, at: Time, inputs: &Inputs81) {
        self.see(slave, Seen::Latch(at, inputs.zsw2.0, inputs.g1_zsw.0, inputs.xist1, inputs.xist2));
    }
}

/// SYNCH and Data_Exchange, the telegrams that the loop has too.
fn is_cyclic(octets: &[u8]) -> bool {
    match octets {
        [0x68, _, _, _, 0xFF, _, _, _, _, 0x00, groups, ..] => *groups == 0x80,
        [0x68, _, _, _, da, ..] => *da < 0x80,
        _ => false,
    }
}

impl Recorder for Results {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if is_cyclic(telegram.octets) {
            self.see(telegram.sender, Seen::Telegram(telegram.end, telegram.octets.to_vec()));
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match *what {
            Observation::CycleStart { .. } => self.waits = false,
            Observation::Clock { verdict, error, .. } => {
                assert_eq!(verdict, ClockVerdict::Hit, "the clock of {} is not in operation", stamp.station);
                self.see(stamp.station, Seen::Clock(error));
            }
            Observation::SetPoint { mls, sls, .. } => self.see(stamp.station, Seen::SetPoint(mls, sls)),
            Observation::Latch { inputs, .. } => {
                let seen = Seen::Latch(stamp.at, inputs.zsw2, inputs.g1_zsw, inputs.xist1, inputs.xist2);
                self.see(stamp.station, seen);
            }
            _ => {}
        }
    }
}

/// Panics unless `all` begins with everything in `part`.
fn assert_starts_alike<'a>(
    station: Address,
    mut all: impl Iterator<Item = &'a Seen>,
    part: impl Iterator<Item = &'a Seen>,
) {
    for (number, seen) in part.enumerate() {
        assert_eq!(all.next(), Some(seen), "result {number} of station {station}");
    }
}

/// Everything that two histograms of the same values have in common.
fn assert_same(what: &str, loops: &Histogram, networks: &Histogram) {
    let sides = |histogram: &Histogram| (histogram.positive(), histogram.negative());
    let sums = |h: &Histogram| (h.count(), h.min(), h.max(), h.mean(), h.below(), h.above());
    assert_eq!(sums(loops), sums(networks), "{what}: the loop against the network");
    assert_eq!(sides(loops), sides(networks), "{what}: the loop against the network");
}

fn assert_same_histograms<const OCTETS: bool>(straight: &Straight<OCTETS>, histograms: &Histograms) {
    let network = |name| histograms.get(name, Subject::Network).expect("a quantity of the network");
    let records = straight.records();
    let of_loop = [
        ("latch_skew", &records.latch_skew),
        ("gc_jitter", &records.gc_jitter),
        ("t_dp_deviation", &records.t_dp_deviation),
        ("t_dx", &records.t_dx),
    ];
    for (name, histogram) in of_loop {
        assert_same(name, histogram, network(name));
    }
    assert_eq!(records.spare.count(), network("spare").count());
    for (address, latch_offset, pll_error) in straight.slaves() {
        for (name, histogram) in [("latch_offset", latch_offset), ("pll_error", pll_error)] {
            let networks = histograms.get(name, Subject::Slave(address)).expect("a quantity of a slave");
            assert_same(&format!("{name} of {address}"), histogram, networks);
        }
    }
}

/// The loop after as many cycles as the network has, the running one included.
pub(crate) fn caught_up<const OCTETS: bool>(
    scenario: &Scenario,
    network: &Network<Node>,
    start: &StartUp,
) -> Straight<OCTETS> {
    let mut straight = Straight::new(scenario, start);
    straight.run(network.cycles(), &mut ());
    straight.reset();
    straight
}

/// Compares so many cycles of networks of so many encoders.
///
/// # Panics
/// With the first difference.
pub(crate) fn same_results(encoders: u8, cycles: u64) {
    let scenario = encoders::scenario(encoders);
    let (mut network, start) = encoders::started(&scenario);
    let mut with = caught_up::<true>(&scenario, &network, &start);
    let mut without = caught_up::<false>(&scenario, &network, &start);

    let layout = run::layout(&scenario);
    let metrics = Metrics::new(layout.clone(), |_, _| 0.0, Histograms::new(&layout));
    let mut recorder = (metrics, Results::new(true));
    let end = network.cycles() + cycles;
    network.run(Until::Cycle(end), u64::MAX, &mut recorder);
    let (metrics, networks) = recorder;

    let [mut loops, mut values] = [Results::new(false), Results::new(false)];
    with.run(cycles, &mut loops);
    without.run(cycles, &mut values);
    for slave in scenario.slaves.iter().map(|slave| slave.address) {
        assert_starts_alike(slave, networks.of(slave).iter(), loops.of(slave).iter());
        let spoken = loops.of(slave).iter().filter(|seen| !matches!(seen, Seen::Telegram(..)));
        assert_starts_alike(slave, spoken, values.of(slave).iter());
    }
    // SYNCH goes on the line before its cycle begins: the network has shown that of the first cycle already.
    let master = scenario.master.address;
    assert_starts_alike(master, networks.of(master).iter(), loops.of(master)[1..].iter());
    assert_same_histograms(&with, metrics.sink());
    assert_same_histograms(&without, metrics.sink());
    assert_eq!(with.received, without.received, "what the master received, with and without octets");
}
