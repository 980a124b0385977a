//! Whole networks: exact telegrams of a diagnosis in operation, the watchdog, intervals, a master that starts over.

use isodp::device::node::{Command, Node};
use isodp::device::profile::Profile;
use isodp::observation::{AcyclicFailure, HandlerState, LifeState, MasterMode, Observation, SlaveCause, SlaveState};
use isodp::sim::network::{Act, Network, NetworkEvent, Until, When};
use isodp::sim::queue::NearQueue;
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};
use isodp::wire::Address;

use crate::support::{Run, address};

/// Encoders 3 and 4 that know Sync and Freeze, in groups 1 and 2, T_DP 1 ms.
fn network(cycles: u64, master: &str, slave: &str, events: &str) -> Scenario {
    let text = format!(
        "[run]\ncycles = {cycles}\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"1 ms\"\n\
         t_i = \"125 us\"\nt_o = \"500 us\"\n{master}\n[[slave]]\naddress = 3\ngroups = [1]\n\
         device = \"simodrive-sensor-isochron\"\n{slave}\n[[slave]]\naddress = 4\ngroups = [2]\n\
         device = \"simodrive-sensor-isochron\"\nsync = true\nfreeze = true\n{events}\n"
    );
    Scenario::parse("network", "network.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}
fn event(cycle: u64, what: &str) -> String {
    format!("[[event]]\ncycle = {cycle}\ndo = {what}\n")
}
fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02X}")).collect::<Vec<_>>().join(" ")
}
/// Telegrams of one cycle between the master and slave 4.
fn talk(run: &Run, cycle: u64) -> Vec<String> {
    let telegrams = run.telegrams_in(cycle).filter(|(.., octets)| match octets[..] {
        [0x68, _, _, _, da, sa, ..] => [da & 0x7F, sa & 0x7F].contains(&4),
        _ => false,
    });
    telegrams.map(|(.., octets)| hex(octets)).collect()
}

/// Freeze for group 2: DH, then Slave_Diag, then DL, one FCB through all of them.
#[test]
fn a_diagnosis_in_operation_telegram_by_telegram() {
    let events = event(100, "\"freeze\"\ngroups = [2]");
    let run = Run::of(&network(110, "", "", &events));
    let command = run.telegrams_in(100).any(|(.., octets)| hex(octets) == "68 07 07 68 FF 82 46 3A 3E 08 02 49 16");
    assert!(command, "Freeze for group 2");
    let cycles: Vec<_> = (100..104).map(|cycle| talk(&run, cycle)).collect();
    // FC of requests and answers, and what is asked.
    let fc = |text: &str| text.split(' ').nth(6).expect("an FC").to_owned();
    let fcs: Vec<_> = cycles.iter().flatten().map(|text| fc(text)).collect();
    let start = if fcs[0] == "5D" { ["5D", "7D"] } else { ["7D", "5D"] };
    assert_eq!(fcs, [start[0], "08", start[1], "0A", start[0], "08", start[1], "08"]);
    let request =
        if start[0] == "5D" { "68 05 05 68 84 82 5D 3C 3E DD 16" } else { "68 05 05 68 84 82 7D 3C 3E FD 16" };
    assert_eq!(cycles[2], [request, "68 0B 0B 68 82 84 08 3E 3C 00 1C 00 02 80 F9 1F 16"]);
    let inputs = |cycle: usize| cycles[cycle][1].split(' ').skip(7).take(12).collect::<Vec<_>>();
    assert_eq!((inputs(1), inputs(3)), (inputs(0), inputs(0)), "held");
}

/// A device whose diagnosis may be longer than its Data_Exchange is read in the acyclic part, and goes on exchanging.
#[test]
fn a_long_diagnosis_takes_no_place_in_the_isochronous_part() {
    let mut scenario = network(110, "", "", &event(100, "\"freeze\"\ngroups = [2]"));
    let slave = &mut scenario.slaves[1];
    slave.device = Profile { max_diag: 62, ..Profile::clone(&slave.device) }.into();
    let run = Run::of(&scenario);
    let fcs = |cycle| -> Vec<String> {
        talk(&run, cycle).iter().map(|text| text.split(' ').nth(6).expect("an FC").to_owned()).collect()
    };
    // DH in the reply of cycle 101, Slave_Diag at once behind the last Data_Exchange, DL from there on.
    let answers = |cycle| fcs(cycle).into_iter().skip(1).step_by(2).collect::<Vec<_>>();
    assert_eq!([100, 101, 102].map(answers), [vec!["08"], vec!["0A", "08"], vec!["08"]]);
    assert!(talk(&run, 101)[3].ends_with("00 1C 00 02 80 F9 1F 16"));
    let t_dx = |cycle: usize| run.cycles[cycle].t_dx.expect("slaves exchange data");
    assert!((99..108).all(|cycle| t_dx(cycle) == t_dx(99)));
    assert!(run.slave(4).filter(|row| row.cycle > 90).all(|row| row.life_counter == 0), "no sign of life is missed");
}

/// What the two slaves are asked for in Set_Prm: octets 1 and 7.
#[test]
fn groups_and_requests_are_in_set_prm() {
    let scenario = network(1, "", "freeze = true", "");
    let prm: Vec<_> = scenario.slaves.iter().map(|slave| build::set_prm(&scenario, slave)).collect();
    assert_eq!([prm[0][0], prm[0][6], prm[1][0], prm[1][6]], [0x98, 0x81, 0xB8, 0x82]);
}

/// Commands of one cycle go out in their order, each with the mode; what does not fit waits.
#[test]
fn commands_in_clear_say_clear_too() {
    let text: String = ["clear", "sync", "freeze", "unsync"].map(|what| event(50, &format!("\"{what}\""))).concat();
    let run = Run::of(&network(60, "", "", &text));
    let controls: Vec<_> = (50..52)
        .flat_map(|cycle| run.telegrams_in(cycle))
        .filter(|(.., octets)| octets.len() == 13 && octets[7..9] == [0x3A, 0x3E] && octets[9..11] != [0x00, 0x80])
        .map(|(.., octets)| [octets[9], octets[10]])
        .collect();
    assert_eq!(controls, [[0x02, 0x00], [0x22, 0x00], [0x0A, 0x00], [0x12, 0x00]]);
}

#[test]
fn a_slave_without_its_master_gives_up_after_its_watchdog() {
    let lost = "[[disturbance]]\nkind = \"lost-telegrams\"\nto = 4\ncycle = 100\nfor = 150\n";
    let sync = event(90, "\"sync\"\ngroups = [2]");
    let run = Run::of(&network(400, "watchdog = \"100 ms\"", "", &[&sync, lost].concat()));
    let left = run.events_of(4).find_map(|row| match row.what {
        Observation::SlaveState { from: SlaveState::DataExch, to, cause } => Some((row.at, to, cause)),
        _ => None,
    });
    let (at, to, cause) = left.expect("it gives up");
    assert_eq!((to, cause), (SlaveState::WaitPrm, SlaveCause::Watchdog));
    let late = at - run.cycles[99].t0 - Span::from_ms(100);
    assert!(late > Span::ZERO && late < Span::from_us(200), "{late}");
    // Back in data exchange it has no mode of before: outputs act at once.
    assert_eq!(run.counts_of(4).state, SlaveState::DataExch);
    let signs: Vec<_> = (390..396).map(|cycle| run.row(4, cycle).mls).collect();
    assert!(signs.windows(2).all(|pair| pair[1] == pair[0] % 15 + 1), "{signs:?}");
}

/// A slave whose interval is T_DP is never asked sooner, though SYNCH strays; one that is quick is.
#[test]
fn no_slave_is_asked_sooner_than_its_interval() {
    let jitter = "gc_jitter = { kind = \"uniform\", half_width = \"400 ns\" }";
    let run = Run::of(&network(200, jitter, "min_slave_interval = \"1 ms\"", ""));
    let asked = |slave: u8| -> Vec<Time> {
        let requests = run
            .telegrams
            .iter()
            .filter(|(.., sender, octets)| *sender == address(2) && octets.len() == 13 && octets[4] == slave);
        requests.map(|&(start, ..)| start).collect()
    };
    let shortest = |slave| asked(slave).windows(2).map(|pair| pair[1] - pair[0]).min().expect("requests");
    assert!(shortest(3) >= Span::from_ms(1) && shortest(3) < Span::from_us(1_001), "{}", shortest(3));
    assert!(asked(3).len() > 150);
}

/// Everything that the master and the slaves observe.
#[derive(Default)]
struct Seen(Vec<(Time, Address, Observation)>);
impl Recorder for Seen {
    fn telegram(&mut self, _telegram: &Transmission<'_>) {}
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        self.0.push((stamp.at, stamp.station, *what));
    }
}

/// The master's supply goes off for 50 ms: its application learns that the slaves left and starts them anew.
#[test]
fn a_master_that_starts_over_takes_its_slaves_for_gone() {
    let read = event(100, "\"read-parameter\"\nslave = 4\nparameter = 979\nelements = 6");
    let scenario = network(101, "", "", &read);
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(&scenario);
    let master = address(2);
    let ms = |ms| Time::ZERO + Span::from_ms(ms);
    // The job begun in cycle 100 is under way when the supply goes.
    network.order(When::Time(ms(104)), master, Act::<Command>::PowerOff);
    network.order(When::Time(ms(150)), master, Act::PowerOn);
    let mut seen = Seen::default();
    assert!(network.run(Until::Time(ms(400)), 1_000_000, &mut seen));
    let of_master: Vec<_> = seen.0.iter().filter(|(at, station, _)| *station == master && *at >= ms(150)).collect();
    let has = |wanted: &dyn Fn(&Observation) -> bool| of_master.iter().any(|(.., what)| wanted(what));
    for number in [3, 4] {
        let left = |what: &Observation| matches!(*what, Observation::Handler { slave, from: HandlerState::DataExchange, .. } if slave == address(number));
        let life = |what: &Observation| matches!(*what, Observation::SlaveLife { slave, to: LifeState::Waiting, tripped: false, .. } if slave == address(number));
        assert!(has(&left) && has(&life), "slave {number}");
    }
    assert!(has(&|what| matches!(what, Observation::AcyclicFailed { why: AcyclicFailure::Left, .. })));
    assert!(has(&|what| matches!(what, Observation::MasterMode { to: MasterMode::Operate, .. })));
    let joined = of_master
        .iter()
        .filter(|(.., what)| matches!(what, Observation::Handler { to: HandlerState::DataExchange, .. }));
    assert_eq!(joined.count(), 2, "both again");
}
