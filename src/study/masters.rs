//! Masters: the figures of every active station, in a network that has more than one of them.
//!
//! | observed by a master | counts as |
//! |---|---|
//! | `CycleStart` | a cycle since the one before, unless it was `Offline` in between |
//! | `ExchangeDone` | T_DX; of a free-running master with all token visits that its poll cycle took |
//! | `TokenReceived` | a token visit; T_RR from the second one in a row on |
//! | `TokenClaimed` | a claim: the token was lost, but for the first one of a run |
//! | `MasterMode` | its mode |

use serde::Serialize;

use super::count::{Counts, Rotation};
use super::export::decimal::us_or_null;
use super::layout::{Layout, MasterLayout};
use super::live_list::CycleTimes;
use super::report::aligned;
use crate::observation::{MasterClass, MasterMode, Observation};
use crate::time::{Span, Time};
use crate::wire::Address;

/// What is counted for one master.
#[derive(Clone, PartialEq, Debug)]
pub struct MasterCounts {
    /// The master.
    pub address: Address,
    /// Its mode at the end; of a class 2 master always `Offline`, since it has none.
    pub mode: MasterMode,
    /// From one of its cycle starts to the next, in true time.
    pub cycle_times: CycleTimes,
    /// Longest T_DX; none while no slave exchanged data with it.
    pub t_dx_max: Option<Span>,
    /// T_RR.
    pub rotation: Rotation,
    /// How often it got the token from another station.
    pub visits: u64,
    /// How often it claimed the token after silence.
    pub claims: u64,
    /// When the cycle under way began.
    began: Option<Time>,
    /// The cycle before, of which it is not known yet whether the run ends with it.
    over: Option<Span>,
}

impl MasterCounts {
    /// Nothing counted yet.
    pub(super) fn new(layout: &MasterLayout) -> Self {
        Self {
            address: layout.address,
            mode: MasterMode::Offline,
            cycle_times: CycleTimes::default(),
            t_dx_max: None,
            rotation: Rotation::default(),
            visits: 0,
            claims: 0,
            began: None,
            over: None,
        }
    }
    /// Whether any master's figures change with this.
    pub(super) const fn concerns(what: &Observation) -> bool {
        matches!(
            what,
            Observation::CycleStart { .. }
                | Observation::ExchangeDone { .. }
                | Observation::TokenReceived { .. }
                | Observation::TokenClaimed
                | Observation::MasterMode { .. }
        )
    }
    /// Counts what this master observed at `at`.
    pub(super) fn observe(&mut self, at: Time, what: &Observation) {
        match *what {
            Observation::CycleStart { .. } => {
                self.close();
                self.over = self.began.replace(at).map(|before| at - before);
            }
            Observation::ExchangeDone { t_dx, .. } if t_dx > Span::ZERO => {
                self.t_dx_max = self.t_dx_max.max(Some(t_dx));
            }
            Observation::TokenReceived { t_rr, .. } => {
                self.visits += 1;
                if t_rr > Span::ZERO {
                    self.rotation.add(t_rr);
                }
            }
            Observation::TokenClaimed => self.claims += 1,
            Observation::MasterMode { to, .. } => {
                self.mode = to;
                if to == MasterMode::Offline {
                    self.close();
                    self.began = None;
                }
            }
            _ => {}
        }
    }
    fn close(&mut self) {
        if let Some(time) = self.over.take() {
            self.cycle_times.add(time);
        }
    }
    /// The run is over at `end`. A cycle that only begins at the end belongs to it no more, nor does the one before.
    pub(super) fn finish(&mut self, end: Time) {
        if self.began.is_none_or(|began| began < end) {
            self.close();
        }
    }
}

/// One master in the summary of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct MasterSummary {
    /// Its address.
    pub address: u8,
    /// `class 1` or `class 2`.
    pub class: &'static str,
    /// Its mode at the end; none of class 2.
    pub mode: Option<&'static str>,
    /// Slaves in its list.
    pub slaves: usize,
    /// How often one of them was brought into data exchange.
    pub syncs: u64,
    /// How often one of them left data exchange against its will.
    pub lost: u64,
    /// Shortest cycle; none before the second one and of class 2.
    #[serde(rename = "cycle_time_min_us", serialize_with = "us_or_null")]
    pub cycle_min: Option<Span>,
    /// Mean cycle.
    #[serde(rename = "cycle_time_mean_us", serialize_with = "us_or_null")]
    pub cycle_mean: Option<Span>,
    /// Longest cycle.
    #[serde(rename = "cycle_time_max_us", serialize_with = "us_or_null")]
    pub cycle_max: Option<Span>,
    /// Longest T_DX.
    #[serde(rename = "t_dx_max_us", serialize_with = "us_or_null")]
    pub t_dx_max: Option<Span>,
    /// How often it got the token.
    pub token_visits: u64,
    /// How often it claimed the token after silence.
    pub tokens_claimed: u64,
    /// Shortest token rotation time T_RR.
    #[serde(rename = "rotation_min_us", serialize_with = "us_or_null")]
    pub rotation_min: Option<Span>,
    /// Mean token rotation time.
    #[serde(rename = "rotation_mean_us", serialize_with = "us_or_null")]
    pub rotation_mean: Option<Span>,
    /// Longest token rotation time.
    #[serde(rename = "rotation_max_us", serialize_with = "us_or_null")]
    pub rotation_max: Option<Span>,
}

impl MasterSummary {
    /// Every master, in address order; nobody where there is one only.
    pub fn all(counts: &Counts, layout: &Layout) -> Vec<Self> {
        layout.masters().iter().zip(&counts.masters).map(|(layout, master)| Self::of(counts, layout, master)).collect()
    }
    fn of(counts: &Counts, layout: &MasterLayout, master: &MasterCounts) -> Self {
        let stations = || layout.slaves.iter().map(|&slave| counts.live_list.at(slave));
        let (cycles, rotation) = (&master.cycle_times, &master.rotation);
        let cycle = |time| (cycles.count > 0).then_some(time);
        let round = |time| (rotation.count > 0).then_some(time);
        Self {
            address: master.address.get(),
            class: layout.class.text(),
            mode: (layout.class == MasterClass::One).then_some(master.mode.text()),
            slaves: layout.slaves.len(),
            syncs: stations().map(|station| station.syncs).sum(),
            lost: stations().map(|station| station.lost).sum(),
            cycle_min: cycle(cycles.min),
            cycle_mean: cycles.mean(),
            cycle_max: cycle(cycles.max),
            t_dx_max: master.t_dx_max,
            token_visits: master.visits,
            tokens_claimed: master.claims,
            rotation_min: round(rotation.min),
            rotation_mean: rotation.mean(),
            rotation_max: round(rotation.max),
        }
    }
    /// The cells of the report, below [`HEADER`].
    fn cells(&self) -> Vec<String> {
        let span = |span: Option<Span>| span.map_or_else(|| "-".to_owned(), |span| span.to_string());
        vec![
            self.address.to_string(),
            self.class.to_owned(),
            self.mode.unwrap_or("-").to_owned(),
            if self.lost > 0 { format!("{}, lost {}", self.slaves, self.lost) } else { self.slaves.to_string() },
            span(self.cycle_mean),
            span(self.cycle_max),
            span(self.t_dx_max),
            self.token_visits.to_string(),
            span(self.rotation_mean),
            span(self.rotation_max),
        ]
    }
}

/// Titles over [`MasterSummary::cells`].
const HEADER: &[&str] =
    &["master", "class", "mode", "slaves", "cycle mean", "max", "T_DX max", "tokens", "T_RR mean", "max"];

/// The masters for the report, a line each below their titles.
pub(super) fn table(masters: &[MasterSummary]) -> Vec<String> {
    aligned(HEADER, &[1, 2, 3], &masters.iter().map(MasterSummary::cells).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample::{self, address};
    use crate::time::Local;

    fn start() -> Observation {
        Observation::CycleStart { cycle: 0, nominal: Local::ZERO }
    }
    fn mode(to: MasterMode) -> Observation {
        Observation::MasterMode { from: MasterMode::Offline, to }
    }
    fn token(us: i64) -> Observation {
        Observation::TokenReceived { t_rr: Span::from_us(us), t_th: Span::ZERO }
    }
    fn t_dx(us: i64) -> Observation {
        Observation::ExchangeDone { t_dx: Span::from_us(us), retries: 0 }
    }
    /// What a master of class 1 counted of `course`, a run of `end` \[µs\].
    fn counted(course: &[(i64, Observation)], end: i64) -> MasterCounts {
        let layout = MasterLayout { address: address(9), class: MasterClass::One, slaves: vec![] };
        let (mut counts, at) = (MasterCounts::new(&layout), |us| Time::ZERO + Span::from_us(us));
        for (us, what) in course {
            counts.observe(at(*us), what);
        }
        counts.finish(at(end));
        counts
    }

    #[test]
    fn a_cycle_ends_with_the_next_one_and_not_with_the_supply() {
        let course = [
            (100, mode(MasterMode::Clear)),
            (100, start()),
            (1_100, start()),
            (2_300, start()),
            (2_900, mode(MasterMode::Offline)),
            (9_000, mode(MasterMode::Operate)),
            (9_000, start()),
            (9_900, start()),
        ];
        let all = counted(&course, 10_000);
        let times = |counts: &MasterCounts| {
            (counts.cycle_times.count, counts.cycle_times.min, counts.cycle_times.mean(), counts.cycle_times.max)
        };
        let us = Span::from_us;
        assert_eq!(times(&all), (3, us(900), Some(Span::from_ticks(3_100 * 12_000 / 3)), us(1_200)));
        assert_eq!(all.mode, MasterMode::Operate);
        assert_eq!(times(&counted(&course, 9_900)), (2, us(1_000), Some(us(1_100)), us(1_200)), "the last one is none");
    }

    #[test]
    fn tokens_and_t_dx_are_taken_as_they_come() {
        let all =
            counted(&[(1, token(0)), (2, token(700)), (3, token(900)), (4, t_dx(0)), (5, t_dx(40)), (6, t_dx(30))], 7);
        assert_eq!((all.visits, all.rotation.count, all.rotation.mean()), (3, 2, Some(Span::from_us(800))));
        assert_eq!(all.t_dx_max, Some(Span::from_us(40)));
        assert_eq!(counted(&[(4, t_dx(0))], 7).t_dx_max, None, "no slave exchanges data");
    }

    #[test]
    fn every_master_has_a_line_with_the_slaves_that_are_its_own() {
        let master = |number, class, slaves: &[u8]| MasterLayout {
            address: address(number),
            class,
            slaves: slaves.iter().map(|&slave| address(slave)).collect(),
        };
        let layout = sample::layout().with_masters(vec![
            master(9, MasterClass::Two, &[]),
            master(1, MasterClass::One, &[3]),
            master(2, MasterClass::One, &[5]),
        ]);
        let mut counts = Counts::new(&layout);
        let at = |us| Time::ZERO + Span::from_us(us);
        for (us, by, what) in [
            (1, 2, mode(MasterMode::Clear)),
            (2, 2, Observation::Lost { slave: address(5) }),
            (1, 2, Observation::TokenClaimed),
            (3, 2, start()),
            (1_003, 2, start()),
            (1_100, 9, token(0)),
            (1_600, 3, token(5)),
        ] {
            counts.station(at(us), address(by), &what);
        }
        counts.finish(at(2_000));
        let all = MasterSummary::all(&counts, &layout);
        let of = |number: usize| (all[number].address, all[number].mode, all[number].lost, all[number].token_visits);
        let [offline, clear] = [Some("Offline"), Some("Clear")];
        assert_eq!([of(0), of(1), of(2)], [(1, offline, 0, 0), (2, clear, 1, 0), (9, None, 0, 1)]);
        let expected = "\
master  class    mode     slaves     cycle mean   max  T_DX max  tokens  T_RR mean  max
     1  class 1  Offline  1                   -     -         -       0          -    -
     2  class 1  Clear    1, lost 1        1 ms  1 ms         -       0          -    -
     9  class 2  -        0                   -     -         -       1          -    -";
        assert_eq!(table(&all).join("\n"), expected);
        assert_eq!([0, 1, 2].map(|number: usize| all[number].tokens_claimed), [0, 1, 0]);
        let json = serde_json::to_value(all[1]).unwrap();
        assert_eq!((json["cycle_time_mean_us"].as_f64(), json["rotation_max_us"].is_null()), (Some(1_000.0), true));
    }
}
