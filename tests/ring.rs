//! Masters that are not alone: the token ring in whole networks, free-running masters, and the scenarios about them.

use isodp::observation::{ClockVerdict, MasterMode, Observation, Phase, RingExit, SlaveState};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::scenario::Scenario;
use isodp::study::{build, run};
use isodp::time::{BitRate, Span, Tbit, Time};
use isodp::wire::Address;
use isodp::wire::prm::{BlockType, SetPrm};

use crate::support::{Run, address, scenario};

/// The scenarios with their tests.
pub(crate) const TESTS: &[(&str, fn())] =
    &[("two-masters", two_masters), ("lost-token", lost_token), ("gap-entry", gap_entry)];

const T_ID1: u32 = 76;
/// The longest message of these networks: a GAP poll that nobody answers.
const LONGEST: u32 = 66 + 1_000 + T_ID1;

fn bits(bits: u32) -> Span {
    BitRate::M12.span(Tbit(bits))
}
fn ms(ms: i64) -> Time {
    Time::ZERO + Span::from_ms(ms)
}
/// What one station observed, with its instants.
fn seen(run: &Run, station: u8) -> impl Iterator<Item = (Time, &Observation)> {
    let all = run.observations.iter().filter(move |(_, by, _)| *by == address(station));
    all.map(|(at, _, what)| (*at, what))
}
/// When one station observed just this.
fn instants(run: &Run, station: u8, what: &Observation) -> Vec<Time> {
    seen(run, station).filter(|(_, seen)| *seen == what).map(|(at, _)| at).collect()
}
fn collisions(run: &Run) -> usize {
    run.observations.iter().filter(|(.., what)| matches!(what, Observation::Collision { .. })).count()
}
/// By how much SYNCH was late, each time.
fn late(run: &Run) -> Vec<Span> {
    let by = |what: &Observation| if let Observation::ClockLate { by } = *what { Some(by) } else { None };
    seen(run, 2).filter_map(|(_, what)| by(what)).collect()
}
fn faults(run: &Run) -> Vec<u16> {
    let code = |what: &Observation| if let Observation::Fault { code } = *what { Some(code) } else { None };
    run.observations.iter().filter_map(|(.., what)| code(what)).collect()
}
/// The longest silence of the line between these instants.
fn longest_silence(run: &Run, from: Time, to: Time) -> Span {
    let telegrams: Vec<_> = run.telegrams.iter().filter(|(start, ..)| (from..to).contains(start)).collect();
    telegrams.windows(2).map(|pair| pair[1].0 - pair[0].1).max().expect("telegrams")
}
/// Holding times of a free-running master: T_TH when the token came, and until it went on.
fn visits(run: &Run, station: u8) -> Vec<(Span, Span)> {
    let mut visits = Vec::new();
    let mut came: Option<(Time, Span)> = None;
    let mut tokens =
        run.telegrams.iter().filter(|(.., sender, octets)| *sender == address(station) && octets[0] == 0xDC);
    for (at, what) in seen(run, station) {
        if let Observation::TokenReceived { t_th, .. } = *what {
            came = Some((at, t_th));
        }
        let Some((came, t_th)) = came.take() else { continue };
        if let Some((start, ..)) = tokens.find(|(start, ..)| *start > came) {
            visits.push((t_th, *start - came));
        }
    }
    visits
}

#[test]
fn two_masters() {
    let run = Run::of(&scenario("two-masters", &[]));
    assert_eq!((collisions(&run), faults(&run)), (0, vec![]));
    let late = late(&run);
    assert!(late.len() == 3 && late.iter().all(|&by| by > Span::from_us(1)), "outside of the window: {late:?}");
    assert!(late.iter().max() < Some(&Span::from_ns(51_300)), "{late:?}");
    for slave in 4..=6 {
        assert_eq!(run.counts_of(slave).clock_failures, 3, "slave {slave}");
        assert_eq!(run.counts_of(slave).phase, Phase::Operation, "slave {slave}");
    }
    // Every visit of the other master ends with the message that it began within T_TH.
    let visits = visits(&run, 12);
    assert!(visits.len() > 900);
    for (t_th, held) in &visits {
        assert!(*held <= (*t_th).max(Span::ZERO) + bits(LONGEST + 2 * T_ID1), "T_TH {t_th}, held for {held}");
    }
    let used_up = visits.iter().filter(|(t_th, held)| held > t_th).count();
    assert!(used_up > 100, "T_TH ends many a visit: {used_up}");
    // A thing of the other master's is no figure of this one.
    assert_eq!(run.cycles.len(), 1_000);
    assert_eq!(run.counts.as_ref().map(|counts| counts.slaves.len()), Some(3));
    let counts = &run.counts.as_ref().expect("counts").network;
    assert_eq!((counts.late_clocks, counts.missed_clocks), (3, 0));
    assert_eq!(Some(&counts.latest_clock), late.iter().max());
    assert!(counts.rotation.count > 990 && counts.rotation.min < counts.rotation.max);
    let outcome = run::run::<NearQueue<NetworkEvent>>(&scenario("two-masters", &[]), None, |_| ()).expect("no files");
    let json = serde_json::to_value(&outcome.summary).expect("a summary");
    assert_eq!(json["ring"]["late_clocks"], 3);
    let mean = json["ring"]["rotation_mean_us"].as_f64().expect("a number");
    assert!((mean - 1_000.0).abs() < 2.0, "the token comes round once in every T_DP: {mean}");
    let alone = run::run::<NearQueue<NetworkEvent>>(&scenario("gc-loss", &[]), None, |_| ()).expect("no files");
    assert!(alone.summary.ring.is_none(), "a station alone has no rotation");
}

/// The figures of each master against what is taken here from its observations and from the tokens on the line.
#[test]
fn every_master_has_its_own_figures() {
    for name in ["two-masters", "gap-entry", "lost-token", "class2-beside"] {
        let (run, scenario) = (Run::of(&scenario(name, &[])), scenario(name, &[]));
        let outcome = run::run::<NearQueue<NetworkEvent>>(&scenario, None, |_| ()).expect("no files");
        let masters = &outcome.summary.masters;
        assert!(masters.len() > 1, "{name}");
        for master in masters {
            let number = master.address;
            let tokens = run.telegrams.iter().filter(|(.., octets)| octets[0] == 0xDC && octets[1] == number);
            let tokens = tokens.filter(|(.., sender, _)| sender.get() != number).count() as u64;
            // The first token of a newcomer that it does not take yet, and those that a dead one does not hear.
            assert!((master.token_visits..master.token_visits + 5).contains(&tokens), "{name}: {tokens} to {number}");
            let mut starts: Vec<Vec<Time>> = vec![Vec::new()];
            for (at, what) in seen(&run, number) {
                match what {
                    Observation::CycleStart { .. } => starts.last_mut().expect("a run").push(at),
                    Observation::MasterMode { to: MasterMode::Offline, .. } => starts.push(Vec::new()),
                    _ => {}
                }
            }
            let ended = run.counts.as_ref().map(|counts| Time::ZERO + counts.network.duration);
            starts.last_mut().expect("a run").retain(|&start| Some(start) != ended);
            let cycles: Vec<Span> =
                starts.iter().flat_map(|starts| starts.windows(2).map(|pair| pair[1] - pair[0])).collect();
            let ends = (cycles.iter().min().copied(), cycles.iter().max().copied());
            assert_eq!((master.cycle_min, master.cycle_max), ends, "{name}: {number}");
            assert_eq!(master.class == "class 2", cycles.is_empty(), "{name}: {number}");
        }
    }
}

/// Every late SYNCH is in the distribution, and nothing else; a master alone has none.
#[test]
fn the_delay_of_synch_is_a_distribution() {
    for (name, t_tr) in [("two-masters", "21000 tbit"), ("two-masters", "300000 tbit"), ("gap-entry", "21000 tbit")] {
        let scenario = scenario(name, &[("bus.t_tr", t_tr)]);
        let mut late = late(&Run::of(&scenario));
        late.sort_unstable();
        let summary = run::run::<NearQueue<NetworkEvent>>(&scenario, None, |_| ()).expect("no files").summary;
        let delay = summary.distribution("synch_delay").expect("masters share the token");
        // The SYNCH that begins a cycle after the end of the run is no longer counted.
        assert!((late.len().saturating_sub(1)..=late.len()).contains(&(delay.count as usize)), "{name} {t_tr}");
        if late.len() == delay.count as usize {
            let ends = (late.first().copied(), late.last().copied());
            assert_eq!((delay.min, delay.max), ends, "{name} {t_tr}");
        }
    }
    let alone = run::run::<NearQueue<NetworkEvent>>(&scenario("gc-loss", &[]), None, |_| ()).expect("no files").summary;
    assert!(alone.distribution("synch_delay").is_none() && alone.masters.is_empty());
}

#[test]
fn a_longer_t_tr_or_more_polls_make_the_delay_of_synch_a_fault() {
    for set in [("bus.t_tr", "22000 tbit"), ("bus.gap_factor", "1"), ("bus.t_tr", "300000 tbit")] {
        let run = Run::of(&scenario("two-masters", &[set]));
        assert!(late(&run).len() > 300, "{set:?}");
        assert_eq!(faults(&run), [0x0F04; 3], "{set:?}: one for each encoder, the clock does not lock again");
        assert_eq!(collisions(&run), 0, "{set:?}");
        let missed = run.counts.as_ref().map(|counts| counts.network.missed_clocks);
        assert_eq!(missed > Some(0), set.1 == "300000 tbit", "{set:?}: {missed:?} missed");
    }
}

#[test]
fn the_grid_goes_on_where_cycles_are_missed() {
    let run = Run::of(&scenario("two-masters", &[("bus.t_tr", "300000 tbit")]));
    let nominal =
        |what: &Observation| if let Observation::CycleStart { nominal, .. } = *what { Some(nominal) } else { None };
    let starts: Vec<_> = seen(&run, 2).filter_map(|(_, what)| nominal(what)).collect();
    let t_dp = Span::from_ms(1);
    assert!(starts.windows(2).all(|pair| (pair[1] - pair[0]).is_multiple_of(t_dp)), "every aim is on the grid");
    let left_out: i64 = starts.windows(2).map(|pair| (pair[1] - pair[0]).div_floor(t_dp) - 1).sum();
    assert_eq!(Some(left_out as u64), run.counts.as_ref().map(|counts| counts.network.missed_clocks));
    assert!(late(&run).iter().all(|&by| by < t_dp), "what is later is missed");
}

#[test]
fn lost_token() {
    let run = Run::of(&scenario("lost-token", &[]));
    assert_eq!((collisions(&run), late(&run)), (0, vec![]));
    let claims = instants(&run, 3, &Observation::TokenClaimed);
    let [claimed] = claims[..] else { panic!("{claims:?}") };
    // The claim is seen T_ID1 after the second of two tokens; before the first one the line was silent for T_TO.
    let first = claimed - bits(2 * (33 + T_ID1));
    let last = run.telegrams.iter().map(|(_, end, ..)| *end).filter(|end| *end <= first).max().expect("a telegram");
    assert_eq!(first - last, bits(12 * 1_000), "T_TO of address 3");
    assert!((ms(300)..ms(300) + Span::from_us(100)).contains(&last), "an answer to the master that died: {last:?}");
    // The other master's slave stays.
    let left =
        seen(&run, 20).any(|(_, what)| matches!(what, Observation::SlaveState { from: SlaveState::DataExch, .. }));
    assert!(!left, "slave 20 has its master all the time");
    // The master is back.
    let entered = instants(&run, 2, &Observation::RingEntered);
    assert!(entered.len() == 1 && (ms(600)..ms(620)).contains(&entered[0]), "{entered:?}");
    assert!(
        instants(&run, 3, &Observation::TokenRetry { to: address(2) }).is_empty(),
        "its first token is seen to be taken"
    );
    for slave in 4..=6 {
        assert_eq!(run.counts_of(slave).phase, Phase::Operation, "slave {slave}");
    }
    let modes: Vec<_> = seen(&run, 2)
        .filter_map(
            |(at, what)| if let Observation::MasterMode { to, .. } = *what { Some((at >= ms(600), to)) } else { None },
        )
        .collect();
    let [clear, operate, offline] = [MasterMode::Clear, MasterMode::Operate, MasterMode::Offline];
    assert_eq!(modes, [(false, clear), (false, operate), (true, offline), (true, clear), (true, operate)]);
    // Its cycles are counted on.
    let numbers: Vec<_> = run.cycles.iter().map(|row| row.cycle).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1));
}

#[test]
fn gap_entry() {
    let run = Run::of(&scenario("gap-entry", &[]));
    assert_eq!((collisions(&run), late(&run), faults(&run)), (0, vec![], vec![]));
    let entered = instants(&run, 9, &Observation::RingEntered);
    assert_eq!(entered.len(), 2);
    for (entered, on) in entered.iter().zip([ms(200), ms(700)]) {
        let joined = instants(&run, 2, &Observation::StationJoined { station: address(9) });
        let joined = *joined.iter().find(|&&at| at > on).expect("it is found");
        assert!(joined - on > Span::from_ms(2), "two rotations are heard before");
        assert!(*entered > joined && *entered - joined < Span::from_ms(2), "the token follows");
    }
    assert_eq!(instants(&run, 2, &Observation::TokenRetry { to: address(9) }).len(), 2, "three attempts");
    assert_eq!(instants(&run, 2, &Observation::StationLost { station: address(9) }).len(), 1);
    assert_eq!(instants(&run, 2, &Observation::TokenClaimed).len(), 1, "at power on");
    assert!(instants(&run, 9, &Observation::TokenClaimed).is_empty());
    for slave in 4..=6 {
        let operating: Vec<_> = run.slave(slave).skip_while(|row| row.phase != Phase::Operation).collect();
        assert!(operating.len() > 900 && operating.iter().all(|row| row.phase == Phase::Operation));
        assert!(run.row(slave, 68).phase == Phase::Operation);
    }
    // Nobody could have claimed the token: address 0 would after 6 T_SL.
    assert!(longest_silence(&run, ms(10), ms(1_000)) < bits(6_000));
}

/// With a long T_DP the master holds the token in silence for long, and no station claims it.
#[test]
fn a_long_cycle_is_no_silence_for_others() {
    for t_dp in ["8 ms", "32 ms"] {
        let set = [("master.t_dp", t_dp), ("master.t_o", "4 ms"), ("master.watchdog", "1 s"), ("run.duration", "2 s")];
        let run = Run::of(&scenario("gap-entry", &set));
        assert_eq!((collisions(&run), late(&run)), (0, vec![]), "T_DP {t_dp}");
        assert!(instants(&run, 9, &Observation::TokenClaimed).is_empty(), "T_DP {t_dp}");
        assert_eq!(instants(&run, 9, &Observation::RingEntered).len(), 2, "T_DP {t_dp}");
        assert!(longest_silence(&run, ms(10), ms(2_000)) < bits(6_000), "T_DP {t_dp}");
        assert!(instants(&run, 9, &Observation::RingLeft { why: RingExit::Skipped }).is_empty(), "T_DP {t_dp}");
    }
}

// ----- free-running masters

fn parse(text: &str) -> Result<Scenario, String> {
    Scenario::parse("ring", "ring.toml", text, &[]).map_err(|error| error.to_string())
}
/// A free-running master with two encoders, 300 cycles; with these keys more in `[master]`, and these tables.
fn free(master: &str, more: &str) -> String {
    format!(
        "[run]\ncycles = 300\n[bus]\nrate = \"12 Mbit/s\"\nhsa = 20\n[master]\naddress = 2\nisochronous = false\n{master}\n\
         [[slave]]\naddresses = \"4, 5\"\ndevice = \"posital-ocd-dpb1b\"\n{more}\n"
    )
}
fn run_free(master: &str, more: &str) -> Run {
    Run::of(&parse(&free(master, more)).unwrap_or_else(|error| panic!("{error}")))
}

/// T_TH is over at the end of most poll cycles: the GAP has a token of its own then, and finds who comes later.
#[test]
fn a_station_is_let_in_however_little_t_tr_leaves() {
    let text = r#"
        [run]
        duration = "700 ms"
        [bus]
        rate = "1.5 Mbit/s"
        hsa = 31
        gap_factor = 5
        t_tr = "5000 tbit"
        [master]
        address = 5
        isochronous = false
        [[slave]]
        addresses = "12, 15, 26"
        device = "posital-ocd-dpb1b"
        [[class1]]
        address = 21
        [[slave]]
        addresses = "17, 25, 27, 28, 31"
        master = 21
        device = "posital-ocd-dpb1b"
        [[class2]]
        address = 4
        powered_at = "300 ms"
    "#;
    let run = Run::of(&parse(text).unwrap_or_else(|error| panic!("{error}")));
    let entered = instants(&run, 4, &Observation::RingEntered);
    assert!(entered.len() == 1 && entered[0] < ms(600), "{entered:?}");
}

/// T_TR leaves each master time for its Data_Exchange and hardly more: a start-up gets a token of its own in the end.
#[test]
fn a_slave_starts_up_again_however_little_t_tr_leaves() {
    let text = r#"
        [run]
        duration = "1 s"
        [bus]
        rate = "1.5 Mbit/s"
        hsa = 31
        gap_factor = 1
        t_tr = "5156 tbit"
        [master]
        address = 5
        isochronous = false
        [[slave]]
        address = 12
        device = "scancon-sag-dpb1b"
        [[slave]]
        addresses = "15, 26"
        device = "posital-ocd-dpb1b"
        [[class1]]
        address = 21
        least_cycle = "1 ms"
        [[slave]]
        addresses = "17, 27, 28, 31"
        master = 21
        device = "posital-ocd-dpb1b"
        [[slave]]
        address = 25
        master = 21
        device = "simodrive-sensor-isochron"
        [[event]]
        at = "150 ms"
        do = "power-off"
        slave = 28
        [[event]]
        at = "200 ms"
        do = "power-on"
        slave = 28
    "#;
    let run = Run::of(&parse(text).unwrap_or_else(|error| panic!("{error}")));
    let joins = |what: &Observation| matches!(what, Observation::SlaveState { to: SlaveState::DataExch, .. });
    let joined: Vec<_> = seen(&run, 28).filter(|(_, what)| joins(what)).map(|(at, _)| at).collect();
    let [first, again] = joined[..] else { panic!("{joined:?}") };
    assert!(first < ms(150), "{first:?}");
    assert!(ms(200) < again && again < ms(300), "four services, each after at most nine rotations: {again:?}");
}

#[test]
fn a_free_running_master_polls_as_fast_as_it_can() {
    let text = free("", "").replace("[[slave]]", "[[slave]]\nmin_slave_interval = \"1 us\"");
    let run = Run::of(&parse(&text).unwrap_or_else(|error| panic!("{error}")));
    assert_eq!((run.cycles.len(), collisions(&run)), (300, 0));
    // Two of 143 + 30 + 231 and T_ID1 between them; then the token.
    let settled = run.cycles.iter().filter(|row| row.cycle >= 100);
    assert!(settled.clone().all(|row| row.t_dx == Some(bits(2 * 404 + T_ID1))), "T_DX");
    let shortest = settled.clone().filter_map(|row| row.t_dp).min();
    assert_eq!(shortest, Some(bits(2 * (404 + T_ID1) + 33 + T_ID1)), "and the token");
    // The start of a cycle is the first bit of its first request, and where it is aimed at.
    for row in settled {
        assert_eq!(row.gc_jitter, Span::ZERO);
        assert!(run.telegrams.iter().any(|(start, _, sender, octets)| {
            (*start, *sender) == (row.t0, address(2)) && octets[0] == 0x68 && octets[4] == 4
        }));
    }
    let synch =
        run.telegrams.iter().filter(|(.., octets)| octets.get(7..11) == Some(&[0x3A, 0x3E, 0x00, 0x80])).count();
    assert_eq!(synch, 0, "there is no SYNCH");
    for slave in [4, 5] {
        assert_eq!(run.counts_of(slave).state, SlaveState::DataExch);
        assert_eq!(run.counts_of(slave).faults.len(), 0, "without isochronous parameters nothing is missing");
    }
}

#[test]
fn a_least_cycle_time_keeps_it_from_polling_faster() {
    for us in [500, 2_000] {
        let run = run_free(&format!("least_cycle = \"{us} us\""), "");
        let cycles = run.cycles.iter().filter_map(|row| row.t_dp);
        assert_eq!(cycles.min(), Some(Span::from_us(us)));
    }
    let slow = "[[slave]]\naddress = 9\ndevice = \"posital-ocd-dpb1b\"\nmin_slave_interval = \"700 us\"\n";
    let run = run_free("", slow);
    let asked: Vec<_> = run
        .telegrams
        .iter()
        .filter(|(.., octets)| octets.len() == 13 && octets[4] == 9)
        .map(|telegram| telegram.0)
        .collect();
    assert!(asked.len() > 200 && asked.windows(2).all(|pair| pair[1] - pair[0] >= Span::from_us(700)));
}

#[test]
fn orders_and_runs_are_bound_to_its_cycles() {
    let run = run_free("", "[[event]]\ncycle = 150\ndo = \"clear\"\n[[event]]\ncycle = 200\ndo = \"operate\"\n");
    let modes: Vec<_> = run.events_of(2).filter(|row| matches!(row.what, Observation::MasterMode { .. })).collect();
    let cycles: Vec<_> = modes.iter().skip(1).map(|row| row.cycle).collect();
    assert_eq!(cycles[cycles.len() - 2..], [150, 200]);
}

#[test]
fn its_slaves_get_no_isochronous_parameters() {
    let scenario = parse(&free("", "")).expect("a good scenario");
    let du = build::set_prm(&scenario, &scenario.slaves[0]);
    let prm = SetPrm::parse(&du).expect("a good Set_Prm");
    assert!(!prm.dpv1.isom_req() && prm.group == 0);
    assert!(prm.blocks().all(|block| block.expect("a block").kind != BlockType::IsoM));
    let planned = 2 * (143 + 800 + 231 + T_ID1) + (66 + 1_000 + T_ID1) + (33 + T_ID1);
    assert_eq!(
        scenario.master.t_dp,
        bits(planned),
        "Data_Exchange with the longest T_SDR, GAP, token, each with T_ID1"
    );
}

#[test]
fn keys_of_isochronous_mode_are_refused_without_it() {
    for key in [
        "t_dp = \"1 ms\"",
        "t_i = \"125 us\"",
        "t_o = \"1 ms\"",
        "t_pll_w = \"1 us\"",
        "t_pll_d = \"1 us\"",
        "gc_jitter = { kind = \"none\" }",
    ] {
        let error = parse(&free(key, "")).expect_err(key);
        assert!(
            error.contains("without SYNCH this key has no meaning") && error.contains("isochronous mode"),
            "{error}"
        );
    }
    let own = "[[slave]]\naddress = 9\ndevice = \"posital-ocd-dpb1b\"\nt_i = \"125 us\"\n";
    assert!(parse(&free("", own)).expect_err("t_i").contains("without SYNCH"));
    let text = free("", "")
        .replace("isochronous = false", "t_dp = \"1 ms\"\nt_i = \"125 us\"\nt_o = \"500 us\"\nleast_cycle = \"1 ms\"");
    assert!(parse(&text).expect_err("least_cycle").contains("no least cycle time"));
}

#[test]
fn stations_of_several_masters_are_checked() {
    for (more, part) in [
        ("[[class1]]\naddress = 2\n", "the master and a class 1 master have the address 2"),
        ("[[class1]]\naddress = 4\n", "a slave and a class 1 master have the address 4"),
        (
            "[[class1]]\naddress = 3\n[[class1]]\naddress = 3\n",
            "a class 1 master and a class 1 master have the address 3",
        ),
        ("[[class1]]\naddress = 30\n", "above hsa"),
        ("[[slave]]\naddress = 9\nmaster = 7\ndevice = \"posital-ocd-dpb1b\"\n", "there is none at 7"),
        ("[[event]]\nat = \"1 ms\"\ndo = \"power-off\"\nstation = 8\n", "there is no station 8"),
        ("[[event]]\nat = \"1 ms\"\ndo = \"acknowledge\"\nslave = 2\n", "there is no slave 2"),
    ] {
        let error = parse(&free("", more)).expect_err(more);
        assert!(error.contains(part), "{more}: {error}");
    }
    let short = free("", "").replace("hsa = 20", "hsa = 20\nt_tr = \"255 tbit\"");
    assert!(parse(&short).expect_err("t_tr").contains("256 <= T_TR"));
}

/// Three free-running masters share the line: T_TR limits each rotation, and nobody is left out.
#[test]
fn free_running_masters_share_the_line() {
    let master = |address: u8| {
        format!(
            "[[class1]]\naddress = {address}\n\
             [[slave]]\naddresses = \"{address}1..{address}9\"\nmaster = {address}\ndevice = \"posital-ocd-dpb1b\"\n"
        )
    };
    let more = [master(1), master(3)].concat();
    let text = free("", &more).replace("hsa = 20", "hsa = 40\nt_tr = \"5000 tbit\"");
    let run = Run::of(&parse(&text).unwrap_or_else(|error| panic!("{error}")));
    assert_eq!((collisions(&run), run.cycles.len()), (0, 300));
    for slave in (11..=19).chain(31..=39).chain([4, 5]) {
        let states = seen(&run, slave).filter_map(|(_, what)| match what {
            Observation::SlaveState { to, .. } => Some(*to),
            _ => None,
        });
        assert_eq!(states.last(), Some(SlaveState::DataExch), "slave {slave}");
    }
    for station in [1, 2, 3] {
        let late = |t_rr: Span| t_rr > bits(5_000 + 3 * (LONGEST + 33 + 2 * T_ID1));
        let rotations = seen(&run, station).filter_map(|(_, what)| match what {
            Observation::TokenReceived { t_rr, .. } => Some(*t_rr),
            _ => None,
        });
        let settled: Vec<_> = rotations.skip(50).collect();
        assert!(
            settled.len() > 100 && !settled.iter().any(|&t_rr| late(t_rr)),
            "{station}: {:?}",
            settled.iter().max()
        );
    }
}

#[test]
fn a_master_that_restarts_tells_its_application_that_the_slaves_left() {
    let more = "[[event]]\nat = \"40 ms\"\ndo = \"power-off\"\nstation = 2\n[[event]]\nat = \"60 ms\"\ndo = \"power-on\"\nstation = 2\n";
    let text = free("", more).replace("cycles = 300", "duration = \"200 ms\"");
    let run = Run::of(&parse(&text).unwrap_or_else(|error| panic!("{error}")));
    let said =
        run.telegrams.iter().filter(|(start, _, sender, _)| *sender == address(2) && (ms(41)..ms(60)).contains(start));
    assert_eq!(said.count(), 0, "without supply it says nothing");
    let joined = |slave: Address| {
        let enters = run.events_of(2).filter(move |row| {
            matches!(row.what, Observation::Handler { slave: of, to, .. }
            if of == slave && to == isodp::observation::HandlerState::DataExchange)
        });
        enters.count()
    };
    assert_eq!([4, 5].map(|slave| joined(address(slave))), [2, 2], "each joins, and joins again");
    let numbers: Vec<_> = run.cycles.iter().map(|row| row.cycle).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "numbers go on");
}

/// SYNCH is on its way long before it leaves: a master without supply sends it no more.
#[test]
fn a_master_without_supply_sends_no_synch() {
    let text = "[run]\nduration = \"300 ms\"\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\nt_i = \"125 us\"\n\
                t_o = \"500 us\"\n[[slave]]\naddress = 4\ndevice = \"posital-ocd-dpb1b\"\n\
                [[event]]\nat = \"100 ms\"\ndo = \"power-off\"\nstation = 2\n\
                [[event]]\nat = \"100100 us\"\ndo = \"power-on\"\nstation = 2\n";
    let run = Run::of(&parse(text).unwrap_or_else(|error| panic!("{error}")));
    let clock = |(at, what): (Time, &Observation)| match *what {
        Observation::Clock { verdict, .. } if at > ms(100) => Some(verdict),
        _ => None,
    };
    assert_eq!(seen(&run, 4).find_map(clock), Some(ClockVerdict::Missing));
    let starts = seen(&run, 2).filter(|(_, what)| matches!(what, Observation::CycleStart { .. })).count();
    assert_eq!(starts, run.cycles.len());
    let numbers: Vec<_> = run.cycles.iter().map(|row| row.cycle).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "no cycle without SYNCH is counted");
    assert_eq!(run.counts_of(4).phase, Phase::Operation, "and it is back");
}

/// Slaves that must not be asked often never make a master wait with the token in its hand.
#[test]
fn a_slow_slave_does_not_hold_the_token_up() {
    let more = "[[slave]]\naddress = 9\ndevice = \"posital-ocd-dpb1b\"\nmin_slave_interval = \"5 ms\"\n\
                [[class1]]\naddress = 3\n[[slave]]\naddress = 12\nmaster = 3\ndevice = \"posital-ocd-dpb1b\"\n";
    let run = run_free("", more);
    let retries = run.observations.iter().filter(|(.., what)| matches!(what, Observation::TokenRetry { .. })).count();
    assert_eq!((retries, collisions(&run)), (0, 0));
    let faster = run.cycles.iter().filter_map(|row| row.t_dp).filter(|&t_dp| t_dp < Span::from_ms(5)).count();
    assert!(faster < 60, "once slave 9 takes part: {faster}");
}

/// With active spare the token goes round as long as T_TR fits before SYNCH, and never makes it late.
#[test]
fn active_spare_lets_the_token_go_round_while_t_tr_fits() {
    let rotations = |active: &str| {
        let run = Run::of(&scenario("gap-entry", &[("master.active_spare", active), ("bus.t_tr", "3000 tbit")]));
        assert_eq!((collisions(&run), late(&run)), (0, vec![]), "active spare {active}");
        let settled = ms(400)..ms(480);
        let came: Vec<_> = seen(&run, 2)
            .filter(|(at, what)| settled.contains(at) && matches!(what, Observation::TokenReceived { .. }))
            .map(|(at, _)| at)
            .collect();
        let starts: Vec<_> = run.cycles.iter().map(|row| row.t0).filter(|t0| settled.contains(t0)).collect();
        for pair in starts.windows(2).filter(|_| active == "true") {
            let last = came.iter().filter(|&&at| pair[0] < at && at < pair[1]).max().expect("a token in every cycle");
            assert!(pair[1] - *last < bits(3_000 + 143 + 2 * T_ID1), "else it would go round once more");
        }
        (came.len(), starts.len())
    };
    let ((passive, cycles), (active, _)) = (rotations("false"), rotations("true"));
    assert!(passive.abs_diff(cycles) <= 1, "once in every cycle: {passive} in {cycles}");
    assert!(active > 3 * cycles, "and more: {active} in {cycles}");
}

#[test]
fn a_master_may_be_switched_on_later() {
    let run = run_free("powered_at = \"5 ms\"", "");
    let first = run.telegrams.iter().map(|(start, ..)| *start).min().expect("telegrams");
    assert_eq!(first - ms(5), bits(10 * 1_000), "T_TO of address 2 after its supply came on");
}
