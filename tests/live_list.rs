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
from_cycle = 150
[[disturbance]]
kind = "lost-telegrams"
from = 3
service = "data-exchange"
from_cycle = 250
count = 12
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

/// What an analyser writes beside one slave.
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
    /// FCB and FCV of the last request.
    fcb: Option<u8>,
    /// DSAP of the last request of DP-V0, and how it was answered.
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

impl Analysed {
    fn request(&mut self, fc: u8, dsap: Option<u8>) {
        // FCV = 1 and the same FCB: the telegram again.
        if fc & 0x10 != 0 && self.fcb == Some(fc & 0x30) {
            self.repeats += 1;
            self.here += 1;
            self.most = self.most.max(self.here);
        }
        self.fcb = Some(fc & 0x30);
        if dsap == Some(51) {
            return; // MS1 says nothing of data exchange.
        }
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
    fn reply(&mut self, octets: &[u8]) {
        let Some((dsap, _)) = self.asked else { return };
        let status = header(octets).map_or(0, |(_, _, fc, _)| fc & 0x0F);
        let answered = if matches!(status, 0 | 8 | 10) { Answered::Well } else { Answered::Refused };
        self.illegal += u64::from(answered == Answered::Refused && dsap.is_some());
        if answered == Answered::Well && dsap == Some(60) {
            self.diagnoses += 1;
            // Prm_Fault, Cfg_Fault, Not_Supported, Station_Not_Ready; Stat_Diag, Prm_Req.
            self.suspect |= self.exchanges && (octets[9] & 0x56 != 0 || octets[10] & 0x03 != 0);
        }
        self.asked = Some((dsap, answered));
    }
}

/// Counts what is on the line.
fn analyse(run: &Run, master: u8) -> BTreeMap<u8, Analysed> {
    let mut slaves = BTreeMap::<u8, Analysed>::new();
    let mut last = None;
    for (.., sender, octets) in &run.telegrams {
        let sender = sender.get();
        if sender == master {
            last = None;
            match header(octets) {
                // SYNCH: Control_Command 00, Group_Select 80.
                Some((127, ..)) if octets[9..11] == [0x00, 0x80] => {
                    for slave in slaves.values_mut() {
                        slave.here = 0;
                    }
                }
                Some((da, _, fc, dsap)) if da != 127 && fc & 0x0F != 9 => {
                    slaves.entry(da).or_default().request(fc, dsap);
                    last = (dsap != Some(51)).then_some(da);
                }
                _ => {}
            }
        } else if last == Some(sender) {
            slaves.entry(sender).or_default().reply(octets);
        }
    }
    for slave in slaves.values_mut() {
        slave.lost += u64::from(slave.suspect);
    }
    slaves
}

fn figures(station: &StationSummary) -> [u64; 6] {
    let &StationSummary { lost, syncs, repeats, repeats_max_per_cycle, illegal_responses, diagnoses, .. } = station;
    [lost, syncs, repeats, repeats_max_per_cycle, illegal_responses, diagnoses]
}

#[test]
fn the_counters_are_those_of_an_analyser() {
    let scenario = troubled();
    let list = summary(&scenario).live_list;
    let analysed = analyse(&Run::of(&scenario), MASTER);
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
    let (mut trouble, mut compared) = (0, 0);
    for name in shipped() {
        let scenario = crate::support::scenario(&name, &[]);
        let (list, run) = (summary(&scenario).live_list, Run::of(&scenario));
        let master = scenario.master.address.get();
        if run.telegrams.iter().any(|(.., octets)| matches!(**octets, [0xDC, _, sender] if sender != master)) {
            continue; // Several masters count together.
        }
        let disturbed = |what: &Observation| matches!(what, Observation::Disturbed { .. });
        let unseen = run.observations.iter().any(|(_, who, what)| who.get() == master && disturbed(what));
        let analysed = analyse(&run, master);
        for station in list.iter().filter(|station| station.seen.text() != "master") {
            let Analysed { lost, syncs, repeats, most, illegal, diagnoses, .. } = analysed[&station.address];
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
}

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
    assert_eq!(analyse(&run, MASTER)[&3].lost, 1);
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
