//! The live list and its counters against what a bus analyser would count: here by hand, from the recorded telegrams.

use std::collections::BTreeMap;

use isodp::observation::Observation;
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::run::run;
use isodp::study::scenario::Scenario;
use isodp::study::summary::{StationSummary, Summary};
use isodp::time::{Span, Time};

use crate::cli::Room;
use crate::support::{Run, shipped};

/// Four encoders and a dead one. 3 loses a reply, and later twelve cycles of them; 4 loses its supply for a while; 5 is
/// parameterised wrongly for a while; 6 has no trouble; 7 never says anything and its master does not know it.
const TROUBLED: &str = r#"
[run]
cycles = 600
[bus]
rate = "12 Mbit/s"
[master]
address = 2
t_dp = "2 ms"
t_i = "125 us"
t_o = "1 ms"
gc_jitter = { kind = "uniform", half_width = "300 ns" }
[[slave]]
addresses = "3..6"
device = "posital-ocd-dpb1b"
[[slave]]
address = 7
device = "posital-ocd-dpb1b"
silent = true
[[disturbance]]
kind = "lost-telegrams"
from = 3
service = "data-exchange"
cycle = 150
for = 1
[[disturbance]]
kind = "lost-telegrams"
from = 3
service = "data-exchange"
cycle = 250
for = 12
[[event]]
cycle = 200
do = "power-off"
slave = 4
[[event]]
cycle = 300
do = "power-on"
slave = 4
[[event]]
cycle = 200
do = "set-prm"
octets = [[43, 15]]
slave = 5
[[event]]
cycle = 400
do = "set-prm"
slave = 5
"#;

const MASTER: u8 = 2;

fn troubled() -> Scenario {
    Scenario::parse("troubled", "troubled.toml", TROUBLED, &[]).unwrap_or_else(|error| panic!("{error}"))
}
fn summary(scenario: &Scenario) -> Summary {
    run::<NearQueue<NetworkEvent>>(scenario, None, |_| ()).expect("a run without files").summary
}

/// What an analyser writes beside one station.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
struct Analysed {
    lost: u64,
    syncs: u64,
    repeats: u64,
    most: u64,
    illegal: u64,
    diagnoses: u64,
    /// Set_Prm came and no Data_Exchange since.
    prepared: bool,
    /// Data_Exchange came and no Set_Prm since.
    exchanges: bool,
    /// It may be lost: Set_Prm or Get_Cfg will tell, or Data_Exchange that it is not.
    suspect: bool,
    /// FCB and FCV of the last request of each master.
    fcb: BTreeMap<u8, u8>,
    /// DSAP of the own master's last request of DP-V0, and how it was answered.
    asked: Option<(Option<u8>, Answered)>,
    here: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Answered {
    Not,
    Well,
    /// RS and its like.
    Refused,
}

/// DA, SA, FC and DSAP of a data telegram, read by hand.
fn header(octets: &[u8]) -> Option<(u8, u8, u8, Option<u8>)> {
    let (rest, data) = match octets {
        [0x68, _, _, _, rest @ ..] => (rest, true),
        [0x10, rest @ ..] => (rest, false),
        _ => return None,
    };
    let [da, sa, fc, first, ..] = *rest else { return None };
    Some((da & 0x7F, sa & 0x7F, fc, (data && da & 0x80 != 0).then_some(first)))
}

/// Whether a request says nothing of data exchange: MS1, MS2 and its resource manager.
fn is_acyclic(dsap: Option<u8>) -> bool {
    dsap.is_some_and(|sap| sap <= 51)
}

impl Analysed {
    fn repeat(&mut self) {
        self.repeats += 1;
        self.here += 1;
        self.most = self.most.max(self.here);
    }
    fn request(&mut self, by: u8, fc: u8) {
        // FCV = 1 and the same FCB: the telegram again.
        if self.fcb.insert(by, fc & 0x30) == Some(fc & 0x30) && fc & 0x10 != 0 {
            self.repeat();
        }
    }
    /// A request of the master that exchanges data with it.
    fn own_request(&mut self, dsap: Option<u8>) {
        match dsap {
            None => {
                self.syncs += u64::from(self.prepared);
                // A diagnosis between two Data_Exchanges, and nothing else.
                (self.prepared, self.suspect, self.exchanges) = (false, false, true);
            }
            Some(59 | 61) => {
                self.prepared |= dsap == Some(61);
                self.lost += u64::from(self.suspect);
                (self.suspect, self.exchanges) = (false, false);
            }
            // After data it is the master who wants to start anew.
            Some(60)
                if self.exchanges
                    && self.asked.is_some_and(|(before, answered)| before.is_none() && answered != Answered::Well) =>
            {
                self.suspect = true;
            }
            Some(_) => {}
        }
        self.asked = Some((dsap, Answered::Not));
    }
    /// Its answer to a request of DP-V0 by any master, `own` or not.
    fn reply(&mut self, own: bool, dsap: Option<u8>, octets: &[u8]) {
        let status = header(octets).map_or(0, |(_, _, fc, _)| fc & 0x0F);
        let answered = if matches!(status, 0 | 8 | 10) { Answered::Well } else { Answered::Refused };
        self.illegal += u64::from(answered == Answered::Refused && dsap.is_some());
        if answered == Answered::Well && dsap == Some(60) {
            self.diagnoses += 1;
            // Prm_Fault, Cfg_Fault, Not_Supported, Station_Not_Ready; Stat_Diag, Prm_Req.
            self.suspect |= own && self.exchanges && (octets[9] & 0x56 != 0 || octets[10] & 0x03 != 0);
        }
        if own {
            self.asked = Some((dsap, answered));
        }
    }
}

/// Tokens that came one after the other with nothing in between.
#[derive(Clone, Copy, Default)]
struct Tokens {
    to: u8,
    from: u8,
    times: u32,
}

/// Counts what is on the line. `owners` are the masters by their slaves, `master` is whose cycles count.
fn analyse(run: &Run, master: u8, owners: &BTreeMap<u8, u8>) -> BTreeMap<u8, Analysed> {
    let mut stations = BTreeMap::<u8, Analysed>::new();
    let (mut last, mut tokens, mut holder) = (None, Tokens::default(), None);
    // Slaves of a dead master lose nothing when it starts them anew.
    let died = |stations: &mut BTreeMap<u8, Analysed>, dead: u8| {
        for (slave, _) in owners.iter().filter(|(_, owner)| **owner == dead) {
            stations.entry(*slave).or_default().exchanges = false;
        }
    };
    let mut silent_since = Time::ZERO;
    for (start, end, sender, octets) in &run.telegrams {
        let sender = sender.get();
        // No master that lives is silent for longer than the longest T_DP.
        if *start - silent_since > Span::from_ms(32) {
            died(&mut stations, sender);
        }
        silent_since = *end;
        // The third token was not taken.
        if tokens.times == 3 && sender != tokens.to {
            stations.entry(tokens.to).or_default().lost += 1;
            died(&mut stations, tokens.to);
        }
        if let [0xDC, to, from] = octets[..] {
            // Claimed after silence.
            if let Some(dead) = holder.filter(|&holder| to == from && holder != from) {
                died(&mut stations, dead);
            }
            holder = Some(to);
            let again = (tokens.to, tokens.from) == (to, from) && to != from;
            tokens = Tokens { to, from, times: if again && tokens.times < 3 { tokens.times + 1 } else { 1 } };
            if tokens.times > 1 {
                stations.entry(to).or_default().repeat();
            }
            last = None;
            continue;
        }
        tokens = Tokens::default();
        match header(octets) {
            Some((da, sa, fc, dsap)) if fc & 0x40 != 0 => {
                last = None;
                // SYNCH: Control_Command 00, Group_Select 80.
                if da == 127 && sa == master && octets[9..11] == [0x00, 0x80] {
                    for station in stations.values_mut() {
                        station.here = 0;
                    }
                } else if da != 127 && fc & 0x0F != 9 {
                    let (station, own) = (stations.entry(da).or_default(), owners.get(&da) == Some(&sa));
                    station.request(sa, fc);
                    if own && !is_acyclic(dsap) {
                        station.own_request(dsap);
                    }
                    last = (!is_acyclic(dsap)).then_some((da, own, dsap));
                }
            }
            _ => match last {
                Some((slave, own, dsap)) if slave == sender => {
                    stations.entry(sender).or_default().reply(own, dsap, octets);
                }
                _ => {}
            },
        }
    }
    for station in stations.values_mut() {
        station.lost += u64::from(station.suspect);
    }
    stations
}

/// The master of each slave.
fn owners(scenario: &Scenario) -> BTreeMap<u8, u8> {
    scenario.slaves.iter().map(|slave| (slave.address.get(), slave.master.get())).collect()
}

fn figures(station: &StationSummary) -> [u64; 6] {
    let &StationSummary { lost, syncs, repeats, repeats_max_per_cycle, illegal_responses, diagnoses, .. } = station;
    [lost, syncs, repeats, repeats_max_per_cycle, illegal_responses, diagnoses]
}

#[test]
fn the_counters_are_those_of_an_analyser() {
    let scenario = troubled();
    let list = summary(&scenario).live_list;
    let analysed = analyse(&Run::of(&scenario), MASTER, &owners(&scenario));
    for station in list.iter().filter(|station| station.address != MASTER) {
        let Analysed { lost, syncs, repeats, most, illegal, diagnoses, .. } = analysed[&station.address];
        let counted = [lost, syncs, repeats, most, illegal, diagnoses];
        assert_eq!(figures(station), counted, "slave {}", station.address);
    }
    let seen: Vec<_> = list.iter().map(|station| (station.address, station.seen.text())).collect();
    let expected = [(2, "master"), (3, "lost"), (4, "lost"), (5, "parameter fault"), (6, "data exchange")];
    assert_eq!(seen, expected, "the silent one is nowhere");
    let of = |address: usize| figures(&list[address - 2]);
    // Repeats: one in cycle 150, one in the first cycle of twelve; a station that is not operational is asked once.
    assert_eq!(of(3)[..5], [1, 2, 2, 1, 0]);
    assert_eq!(of(4)[..5], [1, 2, 1, 1, 0]);
    // It is started anew twice, which its master wants: no loss. Its Chk_Cfg is refused again and again.
    assert_eq!(of(5)[..4], [0, 2, 0, 0]);
    assert!(of(5)[4] > 10 && of(5)[5] > of(5)[4], "{:?}", of(5));
    assert_eq!(of(6), [0, 1, 0, 0, 0, 2], "before its parameters, and when it is ready");
}

#[test]
fn cycle_times_are_those_between_the_synchs() {
    let scenario = troubled();
    let timing = summary(&scenario).timing;
    let run = Run::of(&scenario);
    let synch = |octets: &[u8]| octets.len() == 13 && octets[7] == 58 && octets[9..11] == [0x00, 0x80];
    let starts: Vec<Time> =
        run.telegrams.iter().filter(|(.., octets)| synch(octets)).map(|&(_, end, ..)| end).collect();
    // The run ends with the start of a cycle that is not its own.
    let times: Vec<Span> = starts[..600].windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = Span::from_ticks(times.iter().map(|time| time.ticks()).sum::<i64>() / times.len() as i64);
    let counted = [times.iter().min().copied(), Some(mean), times.iter().max().copied()];
    assert_eq!([timing.cycle_min, timing.cycle_mean, timing.cycle_max], counted);
    assert!(timing.cycle_max > Some(Span::from_us(2_000)) && timing.cycle_min < Some(Span::from_us(2_000)));
}

#[test]
fn the_page_and_the_file_show_the_same() {
    let room = Room::new();
    room.write("troubled.toml", TROUBLED);
    let page = room.runs(&["run", "troubled.toml"]);
    let list = std::fs::read_to_string(room.path("out/troubled/live-list.txt")).expect("a live list");
    assert_eq!(list.lines().count(), 1 + 5);
    // A title, a line each for slaves 3, 4 and 5; the columns of the page are as wide as its own cells.
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    for line in list.lines().filter(|line| !line.contains("master") && !line.contains("data exchange")) {
        assert!(page.lines().any(|other| words(other) == words(line)), "{line} is not in\n{page}");
    }
    assert!(page.contains("live list: 5 stations, lost 2, syncs 7, repeats 3,"), "{page}");
}

/// The same for every shipped scenario. Of a master whose own telegrams never get onto the line an analyser sees less.
#[test]
fn the_counters_of_every_shipped_scenario_are_those_of_an_analyser() {
    let (mut trouble, mut compared, mut several) = (0, 0, Vec::new());
    for name in shipped() {
        let scenario = crate::support::scenario(&name, &[]);
        let (list, run) = (summary(&scenario).live_list, Run::of(&scenario));
        let masters: Vec<u8> =
            list.iter().filter(|station| station.seen.text() == "master").map(|station| station.address).collect();
        let disturbed = |what: &Observation| matches!(what, Observation::Disturbed { .. });
        let unseen = run.observations.iter().any(|(_, who, what)| masters.contains(&who.get()) && disturbed(what));
        let analysed = analyse(&run, scenario.master.address.get(), &owners(&scenario));
        if masters.len() > 1 {
            several.push(name.clone());
        }
        for station in &list {
            let of = analysed.get(&station.address).cloned().unwrap_or_default();
            let Analysed { lost, syncs, repeats, most, illegal, diagnoses, .. } = of;
            let here = figures(station);
            if unseen {
                assert!(lost <= here[0] && repeats <= here[2], "{name}: {station:?}");
                assert_eq!([here[1], here[4], here[5]], [syncs, illegal, diagnoses], "{name}: {station:?}");
            } else {
                assert_eq!(here, [lost, syncs, repeats, most, illegal, diagnoses], "{name}: {station:?}");
                compared += 1;
            }
            trouble += lost + repeats + illegal;
        }
    }
    assert!(trouble > 100 && compared > 50, "{trouble} {compared}");
    for name in ["class2-beside", "gap-entry", "lost-token", "two-masters"] {
        assert!(several.iter().any(|other| other == name), "{name} has one master only");
    }
}

/// A tool asks for what a slave has and what it has not, loses an answer, and is switched off: repeats, diagnoses and
/// illegal responses of every master count, and tokens that nobody took.
#[test]
fn what_a_tool_asks_counts_too() {
    let text = TROUBLED.replace("[[slave]]\naddress = 7", TOOL);
    let scenario = Scenario::parse("tool", "tool.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let list = summary(&scenario).live_list;
    let analysed = analyse(&Run::of(&scenario), MASTER, &owners(&scenario));
    for station in &list {
        let Analysed { lost, syncs, repeats, most, illegal, diagnoses, .. } =
            analysed.get(&station.address).cloned().unwrap_or_default();
        assert_eq!(figures(station), [lost, syncs, repeats, most, illegal, diagnoses], "{}", station.address);
    }
    let of = |address| list.iter().find(|station| station.address == address).map(figures).expect("a station");
    assert_eq!(of(9)[..3], [1, 0, 2], "two more tokens to the tool, then it is out of the ring");
    let without = summary(&troubled()).live_list[3];
    assert_eq!(without.address, 5);
    assert!(of(5)[4] > without.illegal_responses + 10, "RS to the tool: {:?}", of(5));
    assert!(of(6)[2] > 0 && of(6)[5] > 20, "the tool's repeats and diagnoses: {:?}", of(6));
}

/// Diagnosis of slave 6 over and over, and the inputs of slave 5, which has none while its parameters are wrong; for some cycles its answers are lost; the tool loses its supply.
const TOOL: &str = r#"[[class2]]
address = 9
[[class2.job]]
service = "diagnosis"
slave = 6
start = "50 ms"
period = "10 ms"
[[class2.job]]
service = "rd-inp"
slave = 5
start = "50 ms"
period = "10 ms"
[[disturbance]]
kind = "lost-telegrams"
from = 6
service = "any"
cycle = 150
for = 6
[[event]]
cycle = 550
do = "power-off"
station = 9
[[slave]]
address = 7"#;

/// Requests to slave 3 are lost for longer than its watchdog, but not long enough for the master to give it up.
#[test]
fn a_slave_that_its_watchdog_released_says_rs_and_is_lost() {
    let sets = [("master.watchdog", "10 ms"), ("master.lost_after", "100")];
    let sets = sets.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let text = TROUBLED.replace("from = 3\n", "to = 3\n");
    let scenario = Scenario::parse("troubled", "troubled.toml", &text, &sets).unwrap_or_else(|error| panic!("{error}"));
    let list = summary(&scenario).live_list;
    assert_eq!((list[1].address, list[1].seen.text()), (3, "lost"));
    // A request that never gets onto the line is repeated all the same, which an analyser cannot know.
    assert_eq!(figures(&list[1])[..5], [1, 2, 2, 1, 0]);
    let refused = |octets: &[u8]| header(octets).is_some_and(|(da, sa, fc, _)| (da, sa, fc) == (MASTER, 3, 0x03));
    let run = Run::of(&scenario);
    assert_eq!(run.telegrams.iter().filter(|(.., octets)| refused(octets)).count(), 1, "one RS");
    assert_eq!(analyse(&run, MASTER, &owners(&scenario))[&3].lost, 1);
}

/// Where nothing is disturbed and nobody is told anything, every slave is brought in once and stays.
#[test]
fn networks_without_trouble_have_nothing_to_show() {
    for name in ["reference", "fast-cycle", "slow-bus", "gc-jitter", "multi-turn-motion"] {
        let list = summary(&crate::support::scenario(name, &[("run.duration", "400 ms")])).live_list;
        assert!(list.len() > 1, "{name}");
        for station in list.iter().filter(|station| station.seen.text() != "master") {
            assert!(!station.is_remarkable() && station.syncs == 1, "{name}: {station:?}");
        }
    }
}
