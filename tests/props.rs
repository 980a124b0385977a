//! Any legal network: it starts up, it recovers, it is the same twice, and it never panics.
//!
//! The draws are the same in every run. `PROPTEST_CASES=1000 PROPTEST_RNG_SEED=7` looks further.

use std::env;
use std::fmt::Write as _;

use isodp::observation::{Observation, Phase, SlaveState};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::plan::Plan;
use isodp::study::scenario::Scenario;
use isodp::time::Span;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::support::Run;

/// Grid of all times here.
const GRID: Span = Span::from_us(125);

pub(crate) fn config(cases: u32) -> ProptestConfig {
    let default = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    let cases = if env::var_os("PROPTEST_CASES").is_some() { default.cases } else { cases };
    let drawn = env::var_os("PROPTEST_RNG_SEED").is_some();
    ProptestConfig { cases, rng_seed: if drawn { default.rng_seed } else { RngSeed::Fixed(1) }, ..default }
}

/// What is drawn of one slave.
#[derive(Clone, Debug)]
struct Unit {
    /// Addresses left free before this one.
    gap: u8,
    device: &'static str,
    crystal_ppm: i16,
    t_pll_w_us: u8,
    motion: &'static str,
    powered_at_ms: u16,
    clock_tolerance: u8,
    max_life_failures: u8,
    functions: bool,
}

/// What is drawn of a network. Its times follow from its plan.
#[derive(Clone, Debug)]
struct Net {
    seed: u64,
    rate: &'static str,
    cable_m: u16,
    slaves: Vec<Unit>,
    drive: bool,
    t_mapc: u8,
    jitter: &'static str,
    accumulate: bool,
    /// Steps of the grid more than needed: to T_O, of T_I, to the end.
    slack: (u8, u8, u8),
    dx_retries: u8,
    lost_after: u8,
    clear_for: u8,
    get_cfg: bool,
    gap_factor: u8,
    watchdog_ms: u16,
    life_start: u8,
}

const DEVICES: &[&str] = &["posital-ocd-dpb1b", "scancon-sag-dpb1b", "simodrive-sensor-isochron"];
const MOTIONS: &[&str] = &[
    "{ kind = \"standstill\", at = \"90 deg\" }",
    "{ kind = \"speed\", speed = \"-6000 rpm\", start = \"4095.9 rev\" }",
    "{ kind = \"sine\", amplitude = \"3 rev\", period = \"50 ms\", centre = \"0 rev\" }",
    "{ kind = \"table\", table = [[\"0 s\", \"0 rev\"], [\"100 ms\", \"50 rev\"], [\"1 s\", \"-1 rev\"]] }",
];
const JITTERS: &[&str] = &[
    "kind = \"none\"",
    "kind = \"uniform\", half_width = \"150 ns\"",
    "kind = \"normal\", sigma = \"30 ns\"",
    "kind = \"bounded-normal\", sigma = \"50 ns\", bound = \"150 ns\"",
];

prop_compose! {
    fn unit()(
        gap in 0u8..10,
        device in prop::sample::select(DEVICES),
        crystal_ppm in -200i16..=200,
        t_pll_w_us in 1u8..=20,
        motion in prop::sample::select(MOTIONS),
        powered_at_ms in prop_oneof![Just(0u16), 0u16..200],
        clock_tolerance in 1u8..4,
        max_life_failures in 1u8..4,
        functions in any::<bool>(),
    ) -> Unit {
        Unit { gap, device, crystal_ppm, t_pll_w_us, motion, powered_at_ms, clock_tolerance, max_life_failures, functions }
    }
}
prop_compose! {
    fn bus()(
        seed in any::<u64>(),
        rate in prop::sample::select(&["1.5 Mbit/s", "3 Mbit/s", "6 Mbit/s", "12 Mbit/s"][..]),
        cable_m in 0u16..200,
        slack in (0u8..4, 0u8..3, prop_oneof![0u8..8, any::<u8>()]),
        gap_factor in 1u8..20,
    ) -> (u64, &'static str, u16, (u8, u8, u8), u8) {
        (seed, rate, cable_m, slack, gap_factor)
    }
}
prop_compose! {
    fn net()(
        (seed, rate, cable_m, slack, gap_factor) in bus(),
        slaves in prop::collection::vec(unit(), 1..=5),
        drive in any::<bool>(),
        t_mapc in prop_oneof![Just(1u8), 1u8..=14],
        jitter in prop::sample::select(JITTERS),
        accumulate in any::<bool>(),
        (dx_retries, lost_after, clear_for) in (0u8..4, 1u8..20, 0u8..30),
        get_cfg in any::<bool>(),
        watchdog_ms in prop::sample::select(&[40u16, 50, 100, 200, 1_000][..]),
        life_start in 1u8..=15,
    ) -> Net {
        Net {
            seed, rate, cable_m, slaves, drive, t_mapc, jitter, accumulate, slack, dx_retries, lost_after, clear_for, get_cfg,
            gap_factor, watchdog_ms, life_start,
        }
    }
}

impl Net {
    fn addresses(&self) -> Vec<u8> {
        let mut next = 2;
        let place = |unit: &Unit| {
            next += 1 + unit.gap;
            next
        };
        self.slaves.iter().map(place).collect()
    }
    fn drive_address(&self) -> Option<u8> {
        self.drive.then(|| self.addresses().last().map_or(3, |last| last + 1))
    }
    /// Cycles after which every slave has had the time to start up: its configuration takes one cycle per service and
    /// slave, the clock some 40, either sign of life 16 steps of T_MAPC and as many again.
    fn start(&self) -> u64 {
        let powered = self.slaves.iter().map(|unit| u64::from(unit.powered_at_ms)).max().unwrap_or(0);
        powered * 2 + 300 + 60 * u64::from(self.t_mapc) + 20 * self.slaves.len() as u64 + u64::from(self.clear_for)
    }
    /// The scenario file with these times.
    fn text(&self, t_i: Span, t_o: Span, t_dp: Span, cycles: u64) -> String {
        let mut text = format!(
            "[run]\nseed = {}\ncycles = {cycles}\n[bus]\nrate = \"{}\"\ncable = \"{} m\"\ngap_factor = {}\n[master]\n\
             address = 2\nt_dp = \"{t_dp}\"\nt_i = \"{t_i}\"\nt_o = \"{t_o}\"\nt_mapc = {}\ngc_jitter = {{ {}, accumulate = {} }}\n\
             dx_retries = {}\nlost_after = {}\nclear_for = {}\nget_cfg = {}\nwatchdog = \"{} ms\"\nlife_start = {}\n",
            self.seed,
            self.rate,
            self.cable_m,
            self.gap_factor,
            self.t_mapc,
            self.jitter,
            self.accumulate,
            self.dx_retries,
            self.lost_after,
            self.clear_for,
            self.get_cfg,
            self.watchdog_ms,
            self.life_start
        );
        for (address, unit) in self.addresses().iter().zip(&self.slaves) {
            let _ = write!(
                text,
                "[[slave]]\naddress = {address}\ndevice = \"{}\"\ncrystal = \"{} ppm\"\nt_pll_w = \"{} us\"\nmotion = {}\n\
                 powered_at = \"{} ms\"\nclock_tolerance = {}\nmax_life_failures = {}\nfunctions = {}\n",
                unit.device,
                unit.crystal_ppm,
                unit.t_pll_w_us,
                unit.motion,
                unit.powered_at_ms,
                unit.clock_tolerance,
                unit.max_life_failures,
                unit.functions
            );
        }
        if let Some(drive) = self.drive_address() {
            let _ = write!(text, "[[slave]]\naddress = {drive}\ndevice = \"subscriber-drive\"\n");
            for publisher in self.addresses() {
                let _ = write!(text, "[[link]]\npublisher = {publisher}\nsubscriber = {drive}\n");
            }
        }
        text
    }
    /// The same with the shortest legal times and the drawn slack, for this many cycles.
    fn scenario(&self, cycles: u64, more: &str) -> Scenario {
        let parse = |text: &str| Scenario::parse("drawn", "drawn.toml", text, &[]);
        let t_i = Span::from_us(375) + GRID * i64::from(self.slack.1);
        let roomy = self.text(t_i, Span::from_ms(25), Span::from_ms(32), cycles);
        let plan = Plan::of(&parse(&roomy).unwrap_or_else(|error| panic!("{error}\n{roomy}")));
        let t_o = plan.t_o_min(&isodp::device::profile::PROFILES[0]) + GRID * i64::from(self.slack.0);
        let shortest = (t_o + Span::from_us(375) + t_i).max((plan.content() + Span::from_us(2)).ceil_to(GRID));
        let mut t_dp = (shortest + GRID * i64::from(self.slack.2)).min(Span::from_ms(32));
        loop {
            let text = self.text(t_i, t_o, t_dp, cycles) + more;
            match parse(&text) {
                Ok(scenario) => return scenario,
                // A slave that starts up needs more time for its Set_Prm than a cycle for all of them.
                Err(error) if error.to_string().contains("no time to start up") => t_dp += GRID,
                Err(error) => panic!("{error}\n{text}"),
            }
        }
    }
}

/// What every run keeps to, disturbed or not.
fn sane(scenario: &Scenario, run: &Run) -> Result<(), TestCaseError> {
    for cycle in &run.cycles {
        prop_assert!(cycle.spare.is_none_or(|spare| spare >= Span::ZERO), "cycle {}: {:?}", cycle.cycle, cycle.spare);
        prop_assert!(cycle.t_dp.is_none_or(|t_dp| t_dp > Span::ZERO), "cycle {}: {:?}", cycle.cycle, cycle.t_dp);
    }
    prop_assert!(run.telegrams.windows(2).all(|pair| pair[0].0 <= pair[1].1), "telegrams in the order of time");
    prop_assert!(run.observations.windows(2).all(|pair| pair[0].0 <= pair[1].0), "observations in the order of time");
    let again = Run::of(scenario);
    prop_assert_eq!(run.fingerprint, again.fingerprint);
    let heap = Run::on::<HeapQueue<NetworkEvent>>(scenario);
    prop_assert_eq!(run.fingerprint, heap.fingerprint);
    prop_assert_eq!(&run.stations, &heap.stations);
    Ok(())
}

/// The last rows of all slaves but `without`: every one exchanges data in phase 5.
fn operating(run: &Run, without: &[u8]) -> Result<(), TestCaseError> {
    let last = run.cycles.last().expect("cycles").cycle;
    for row in run.slaves.iter().filter(|row| row.cycle == last && !without.contains(&row.slave.get())) {
        prop_assert_eq!((row.state, row.phase), (SlaveState::DataExch, Phase::Operation), "slave {}", row.slave);
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(40))]

    #[test]
    fn an_undisturbed_network_starts_up_without_a_fault(net in net()) {
        let scenario = net.scenario(net.start(), "");
        let run = Run::on::<NearQueue<NetworkEvent>>(&scenario);
        sane(&scenario, &run)?;
        operating(&run, &[])?;
        let counts = run.counts.as_ref().expect("counts");
        prop_assert_eq!(counts.network.cycles, net.start());
        prop_assert_eq!((counts.network.collisions, counts.network.late_clocks), (0, 0));
        for slave in &counts.slaves {
            prop_assert_eq!((slave.fault_count(), slave.resynchronisations), (0, 0), "slave {}", slave.address);
        }
        // The plan counts by perfect crystals; two are 400 ppm apart at most.
        let planned = Plan::of(&scenario).t_dx;
        let limit = planned + Span::from_ticks(planned.ticks() / 2_500);
        for cycle in &run.cycles {
            prop_assert!(cycle.t_dx.is_none_or(|t_dx| t_dx <= limit), "{:?} of at most {limit}", cycle.t_dx);
        }
    }
}

/// So many cycles in a row, once or again and again.
#[derive(Clone, Copy, Debug)]
struct Bursts {
    count: u64,
    every: Option<u64>,
}
impl std::fmt::Display for Bursts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "for = {}", self.count)?;
        self.every.map_or(Ok(()), |every| writeln!(f, "every = {every}"))
    }
}

/// One thing that happens to a network.
#[derive(Clone, Debug)]
enum Blow {
    /// An order to these slaves, by index.
    Order { cycle: u64, action: &'static str, slave: Option<usize> },
    /// The same at an instant.
    Timed { at_ms: u64, action: &'static str, slave: Option<usize> },
    /// Clocks get lost.
    MissingClocks { from: u64, bursts: Bursts },
    /// Other telegrams get lost.
    Lost { from: Option<usize>, to: Option<usize>, master: bool, data: bool, cycle: u64, bursts: Bursts },
}

const ORDERS: &[&str] = &[
    "do = \"acknowledge\"",
    "do = \"hold-life-sign\"",
    "do = \"hold-life-sign\"\nfor = 3",
    "do = \"hold-life-sign\"\nfor = 30",
    "do = \"release-life-sign\"",
    "do = \"jump-life-sign\"\nto = 9",
    "do = \"jump-life-sign\"\nto = 0",
    "do = \"control-word\"\nvalue = 0x4000",
    "do = \"control-word\"\nvalue = 0x2000",
    "do = \"control-word\"\nvalue = 0xFFFF",
    "do = \"read-parameter\"\nparameter = 979\nelements = 10",
    "do = \"change-parameter\"\nparameter = 918\nvalue = 7",
    "do = \"set-prm\"\nlength = 3",
    "do = \"chk-cfg\"\nlength = 1",
    "do = \"power-off\"",
    "do = \"power-off\"",
    "do = \"power-on\"",
    "do = \"power-on\"",
    "do = \"clear\"",
    "do = \"operate\"",
];
/// Cycles in which blows begin.
const BLOWS: u64 = 600;
/// Longest stretch of a disturbance (cycles).
const LONGEST: u64 = 60;

/// A blow; one of those that never end only if `endless`.
fn blow(endless: bool) -> impl Strategy<Value = Blow> {
    let slave = || prop::option::of(0usize..6);
    let bursts = move || {
        let every = move |(count, more): (u64, u64)| Bursts { count, every: endless.then_some(count + more) };
        (prop_oneof![1u64..4, 1..=LONGEST], 0u64..200).prop_map(every)
    };
    prop_oneof![
        (0..BLOWS, prop::sample::select(ORDERS), slave()).prop_map(|(cycle, action, slave)| Blow::Order {
            cycle,
            action,
            slave
        }),
        (0..BLOWS / 2, prop::sample::select(ORDERS), slave()).prop_map(|(at_ms, action, slave)| Blow::Timed {
            at_ms,
            action,
            slave
        }),
        (0..BLOWS, bursts()).prop_map(|(from, bursts)| Blow::MissingClocks { from, bursts }),
        (slave(), slave(), any::<[bool; 2]>(), 0..BLOWS, bursts())
            .prop_map(|(from, to, [master, data], cycle, bursts)| Blow::Lost { from, to, master, data, cycle, bursts }),
    ]
}

/// The tables of `blows` for the slaves at `addresses`.
fn tables(blows: &[Blow], addresses: &[u8]) -> String {
    let mut text = String::new();
    let address = |index: usize| addresses[index % addresses.len()];
    let order = |action: &str, slave: Option<usize>| match slave {
        _ if action.contains("clear") || action.contains("operate") => action.to_owned(),
        Some(slave) => format!("{action}\nslave = {}", address(slave)),
        None => format!("{action}\nslaves = \"all\""),
    };
    for blow in blows {
        let _ = match blow {
            Blow::Order { cycle, action, slave } => {
                write!(text, "[[event]]\ncycle = {cycle}\n{}\n", order(action, *slave))
            }
            Blow::Timed { at_ms, action, slave } => {
                write!(text, "[[event]]\nat = \"{at_ms} ms\"\n{}\n", order(action, *slave))
            }
            Blow::MissingClocks { from, bursts } => {
                write!(text, "[[disturbance]]\nkind = \"missing-clocks\"\ncycle = {from}\n{bursts}")
            }
            Blow::Lost { from, to, master, data, cycle, bursts } => {
                let from = if *master { Some(2) } else { from.map(address) };
                let from = from.map_or_else(String::new, |from| format!("from = {from}\n"));
                let to = to.map_or_else(String::new, |to| format!("to = {}\n", address(to)));
                let service = if *data { "data-exchange" } else { "any" };
                write!(
                    text,
                    "[[disturbance]]\nkind = \"lost-telegrams\"\n{from}{to}service = \"{service}\"\ncycle = {cycle}\n{bursts}"
                )
            }
        };
    }
    text
}

/// Undoes every order that lasts, so that only what cannot recover by itself stays away.
fn amends(cycle: u64) -> String {
    let all = "slaves = \"all\"\n";
    let order = |(action, more): (&str, &str)| format!("[[event]]\ncycle = {cycle}\ndo = \"{action}\"\n{more}");
    [
        ("power-on", all),
        ("release-life-sign", all),
        ("control-word", "value = 0\nslaves = \"all\"\n"),
        ("set-prm", all),
        ("chk-cfg", all),
        ("acknowledge", all),
        ("operate", ""),
    ]
    .map(order)
    .concat()
}

proptest! {
    #![proptest_config(config(40))]

    #[test]
    fn a_network_recovers_from_every_blow(net in net(), blows in prop::collection::vec(blow(false), 1..6)) {
        let mut addresses = net.addresses();
        addresses.extend(net.drive_address());
        let over = net.start().max(BLOWS) + LONGEST;
        let end = over + net.start() + 400;
        let scenario = net.scenario(end, &(tables(&blows, &addresses) + &amends(over)));
        let run = Run::on::<NearQueue<NetworkEvent>>(&scenario);
        sane(&scenario, &run)?;
        operating(&run, &[])?;
        let faults = run.observations.iter().filter(|(_, _, what)| matches!(what, Observation::Fault { .. }));
        prop_assert!(faults.clone().all(|(at, ..)| *at < run.cycles[end as usize - 100].t0), "a fault at the end");
    }
    /// Whatever goes wrong without end, the run ends and is the same twice.
    #[test]
    fn nothing_that_lasts_breaks_the_run(net in net(), blows in prop::collection::vec(blow(true), 1..6)) {
        let mut addresses = net.addresses();
        addresses.extend(net.drive_address());
        let scenario = net.scenario(BLOWS * 2, &tables(&blows, &addresses));
        let run = Run::on::<NearQueue<NetworkEvent>>(&scenario);
        sane(&scenario, &run)?;
        prop_assert_eq!(run.counts.as_ref().map(|counts| counts.network.cycles), Some(BLOWS * 2));
    }
}
