//! What a slave-cycle of the whole network costs, against the straight loop of the same arithmetic and octets.
//!
//! ```text
//! cargo bench --bench network             medians [ns per slave-cycle] and their ratio
//! cargo bench --bench network -- --test   one short round, only to see that it runs
//! cargo bench --bench network -- --count network 8 400
//!                                         nothing but 400 cycles of the network of 8 encoders, for `benches/guard`;
//!                                         instead of a number also a scenario file
//! ```
//!
//! | column | what runs |
//! |---|---|
//! | network | events, bus, stations; rows and histograms of every cycle |
//! | loop | the straight loop with octets, see [`straight`] |
//! | ratio | network over loop |
//! | bare | the network with nobody who reads it |
//! | prints | the network with its fingerprints instead of histograms |
//! | flight | the network with rows, histograms and the flight recorder, which finds nothing |
//!
//! Every network is in operation before the time is taken, and the loop's results are compared with the network's.

mod straight;

use isodp::device::node::Node;
use isodp::sim::fingerprint::Fingerprints;
use isodp::sim::motion::Shaft;
use isodp::sim::network::{Network, Until};
use isodp::sim::record::Recorder;
use isodp::study::flight::FlightRecorder;
use isodp::study::histogram::Histograms;
use isodp::study::metric::{Metrics, Shafts};
use isodp::study::run;
use isodp::study::scenario::{Flight, Scenario};
use isodp::time::Time;
use isodp::wire::Address;
use straight::effort::Effort;
use straight::{check, encoders};

/// The shafts of a scenario's encoders with their counts per revolution, in address order.
struct Speeds {
    first: u8,
    shafts: Vec<(Shaft, f64)>,
}
impl Speeds {
    fn of(scenario: &Scenario) -> Self {
        let shaft = |motion| Shaft::new(motion).expect("a checked motion");
        let shafts = scenario.slaves.iter().map(|slave| (shaft(&slave.motion), slave.device.steps_per_rev.into()));
        Self { first: scenario.slaves[0].address.get(), shafts: shafts.collect() }
    }
}
impl Shafts for Speeds {
    fn speed(&self, slave: Address, at: Time) -> f64 {
        let (shaft, counts) = &self.shafts[usize::from(slave.get() - self.first)];
        shaft.speed(at) * counts
    }
}

/// A network in operation with what reads it.
struct Watched<R> {
    network: Network<Node>,
    recorder: R,
}
impl<R: Recorder> Watched<R> {
    fn new(scenario: &Scenario, recorder: R) -> Self {
        Self { network: encoders::started(scenario).0, recorder }
    }
    fn run(&mut self, cycles: u64) {
        let until = Until::Cycle(self.network.cycles() + cycles - 1);
        self.network.run(until, u64::MAX, &mut self.recorder);
    }
}

/// Runs so many cycles. callgrind collects what is inside of it, so it is never a part of its caller.
#[inline(never)]
fn counted(cycles: u64, mut run: impl FnMut(u64)) {
    run(cycles);
}

/// One contender in operation, then so many cycles of it, once.
///
/// # Panics
/// If the contender is none of `network`, `bare`, `prints` and `loop`.
fn count(contender: &str, encoders: &str, cycles: u64) {
    let scenario = encoders.parse().map_or_else(
        |_| Scenario::load(encoders.as_ref(), &[]).unwrap_or_else(|error| panic!("{error}")),
        encoders::scenario,
    );
    match contender {
        "network" => {
            let layout = run::layout(&scenario);
            let metrics = Metrics::new(layout.clone(), Speeds::of(&scenario), Histograms::new(&layout));
            let mut full = Watched::new(&scenario, metrics);
            counted(cycles, |cycles| full.run(cycles));
        }
        "bare" => {
            let mut bare = Watched::new(&scenario, ());
            counted(cycles, |cycles| bare.run(cycles));
        }
        "prints" => {
            let mut prints = Watched::new(&scenario, Fingerprints::new(scenario.master.address));
            counted(cycles, |cycles| prints.run(cycles));
        }
        "loop" => {
            let (network, start) = encoders::started(&scenario);
            let mut straight = check::caught_up::<true>(&scenario, &network, &start);
            counted(cycles, |cycles| straight.run(cycles, &mut ()));
        }
        _ => panic!("{contender} is none of network, bare, prints and loop"),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [flag, contender, encoders, cycles] = &arguments[..]
        && flag == "--count"
    {
        return count(contender, encoders, cycles.parse().expect("a number of cycles"));
    }
    let effort = Effort::of_arguments();
    println!("encoders      T_DP   network [ns]   loop [ns]   ratio   bare [ns]   prints [ns]   flight [ns]");
    for number in [1, 8, 32, 122] {
        check::same_results(number, effort.compared);
        let scenario = encoders::scenario(number);
        let (network, start) = encoders::started(&scenario);
        let mut straight = check::caught_up::<true>(&scenario, &network, &start);
        let layout = run::layout(&scenario);
        let metrics = Metrics::new(layout.clone(), Speeds::of(&scenario), Histograms::new(&layout));
        let again = Metrics::new(layout.clone(), Speeds::of(&scenario), Histograms::new(&layout));
        let recorder = FlightRecorder::new(&scenario, &Flight::default());
        let mut flight = Watched::new(&scenario, (again, recorder));
        let mut full = Watched { network, recorder: metrics };
        let mut bare = Watched::new(&scenario, ());
        let mut prints = Watched::new(&scenario, Fingerprints::new(scenario.master.address));
        let [full, straight, bare, prints, flight] = effort.medians(
            number,
            [
                &mut |cycles| full.run(cycles),
                &mut |cycles| straight.run(cycles, &mut ()),
                &mut |cycles| bare.run(cycles),
                &mut |cycles| prints.run(cycles),
                &mut |cycles| flight.run(cycles),
            ],
        );
        let (t_dp, ratio) = (scenario.master.t_dp.to_string(), full / straight);
        println!(
            "{number:>8}  {t_dp:>8}   {full:>12.1}   {straight:>9.1}   {ratio:>5.2}   {bare:>9.1}   {prints:>11.1}   {flight:>11.1}"
        );
    }
}
