//! Every bit rate of the line, with SYNCH and without.

use isodp::fdl::params::BusParams;
use isodp::observation::{Observation, Phase, SlaveState};
use isodp::study::plan::rules::warnings;
use isodp::study::plan::{TOKEN, message_cycle};
use isodp::study::scenario::Scenario;
use isodp::time::{BitRate, Span, Tbit};

use crate::support::{Run, scenario};

pub(crate) const TESTS: &[(&str, fn())] = &[("free-running", free_running)];

/// Octets of telegram 81, there and back.
const OCTETS: (usize, usize) = (4, 12);
/// T_SDR of the encoders where nothing else is said, before MaxTsdr and min_TSDR bound it (Model: D2).
const T_SDR: Tbit = Tbit(30);

/// Felser's message cycle for one master, 300 t_bit and 11 for each octet, less T_SYN, which it counts beside T_ID1 that
/// has it in it, and for this T_SDR and T_ID1 instead of his 32 and 37 (Model: D4).
fn felser(octets: usize, t_sdr: Tbit, t_id1: Tbit) -> u32 {
    300 - 33 + 11 * octets as u32 - 32 - 37 + t_sdr.0 + t_id1.0
}

#[test]
fn free_running() {
    let network = scenario("free-running", &[]);
    let run = Run::of(&network);
    assert!(run.faults_of(3).is_empty());
    for slave in 3..=5 {
        assert_eq!(run.phases_of(slave), [], "no isochronous parameters, no phase but the first");
        let last = run.row(slave, 400);
        assert_eq!((last.state, last.phase), (SlaveState::DataExch, Phase::Configuration));
    }
    let bit = BitRate::K500.bit();
    let cycle = 3 * felser(16, T_SDR, Tbit(37)) + 33 + 37;
    assert_eq!(cycle, 1_393);
    let gap = 66 + 200 + 37;
    let lengths: Vec<u32> = run
        .cycles
        .windows(2)
        .filter(|pair| pair[0].cycle >= 100)
        .map(|pair| ((pair[1].t0 - pair[0].t0) + Span::from_ticks(bit.ticks() / 2)).div_floor(bit) as u32)
        .collect();
    // The mode is told now and then, a Global_Control and T_ID2 in place of T_ID1 (Model: D5).
    let told = 143 + 100;
    let made_of =
        |bits: u32| [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().find(|(g, t)| bits == cycle + g * gap + t * told);
    let parts: Vec<_> = lengths.iter().map(|&bits| made_of(bits).unwrap_or_else(|| panic!("{bits} t_bit"))).collect();
    let polls: Vec<_> = (0..parts.len()).filter(|&at| parts[at].0 == 1).collect();
    assert!(polls.len() >= 39 && polls.windows(2).all(|pair| pair[1] - pair[0] == 10), "one in ten: {polls:?}");
    let positions: std::collections::BTreeSet<_> = run.slave(3).map(|row| row.xist1).collect();
    assert!(positions.len() > 100, "it turns: {}", positions.len());
}

fn one(rate: BitRate, master: &str) -> Scenario {
    let text = format!(
        "[run]\nseed = 1\ncycles = 300\n[bus]\nrate = \"{rate}\"\n[master]\naddress = 2\nget_cfg = false\n{master}\n\
         [[slave]]\naddresses = \"3..4\"\ndevice = \"posital-ocd-dpb1b\"\n"
    );
    Scenario::parse("rates", "rates.toml", &text, &[]).unwrap_or_else(|error| panic!("{rate}: {error}"))
}

/// The rates of RS 485; 31.25 kbit/s is of another line.
fn cable_rates() -> impl Iterator<Item = BitRate> {
    BitRate::ALL.iter().copied().filter(|&rate| rate != BitRate::K31_25)
}

#[test]
fn without_synch_every_rate_has_the_cycle_of_its_bus_parameters() {
    for rate in cable_rates() {
        let run = Run::of(&one(rate, "isochronous = false"));
        let bus = BusParams::profile(rate);
        let t_mc = message_cycle(&bus, OCTETS.0, OCTETS.1, T_SDR);
        assert_eq!(t_mc.0, felser(OCTETS.0 + OCTETS.1, T_SDR, bus.t_id1()), "{rate}");
        let cycle = bus.span(Tbit(2 * t_mc.0 + TOKEN.0 + bus.t_id1().0));
        // What may come in a cycle besides: a GAP poll without answer, and the mode.
        let (gap, told) = (bus.span(Tbit(66 + bus.t_sl.0 + bus.t_id1().0)), bus.span(Tbit(143 + bus.t_id2().0)));
        // Min_Slave_Interval holds the fastest line back (EN 50170-2: from poll cycle to poll cycle).
        let all = [cycle, cycle + gap, cycle + told, cycle + gap + told].map(|length| length.max(Span::from_us(100)));
        let lengths: Vec<Span> = run.cycles.windows(2).map(|pair| pair[1].t0 - pair[0].t0).collect();
        let started = &lengths[50..];
        assert!(started.contains(&all[0]), "{rate}: {} in {started:?}", all[0]);
        for length in started {
            assert!(all.contains(length), "{rate}: {length}");
        }
    }
}

/// The slowest rates have no T_DP of at most 32 ms that holds two encoders; the others below 1.5 Mbit/s run with a warning.
#[test]
fn isochronous_mode_runs_at_every_rate_that_a_cycle_of_32_ms_allows() {
    let mut ran = Vec::new();
    for rate in cable_rates().filter(|&rate| rate >= BitRate::K93_75) {
        let network = one(rate, "t_dp = \"32 ms\"\nt_i = \"125 us\"\nt_o = \"28 ms\"\nwatchdog = \"2 s\"");
        assert_eq!(
            warnings(&network).iter().any(|text| text.contains(&rate.to_string())),
            rate < BitRate::M1_5,
            "{rate}"
        );
        let run = Run::of(&network);
        assert!(run.faults_of(3).is_empty(), "{rate}");
        assert_eq!(run.phases_of(3).last().map(|phase| phase.0), Some(Phase::Operation), "{rate}");
        let late = |what: &Observation| matches!(what, Observation::ClockLate { .. });
        assert!(!run.events_of(2).any(|row| late(&row.what)), "{rate}");
        ran.push(rate);
    }
    assert_eq!(ran.len(), 7);
    let text = "[run]\ncycles = 1\n[bus]\nrate = \"9.6 kbit/s\"\n[master]\naddress = 2\nt_dp = \"32 ms\"\nt_i = \"125 us\"\n\
                t_o = \"28 ms\"\nwatchdog = \"2 s\"\n[[slave]]\naddress = 3\ndevice = \"posital-ocd-dpb1b\"\n";
    let error = Scenario::parse("slow", "slow.toml", text, &[]).expect_err("49 ms do not fit into 32").to_string();
    assert!(error.contains("cannot hold the cycle of 1 slaves"), "{error}");
}
