//! Live list: every station that was seen or looked for, with the counters that a bus analyser shows beside it.

use super::layout::Layout;
use crate::observation::{AcyclicService, GapAnswer, HandlerState, Observation};
use crate::time::Span;
use crate::wire::Address;
use crate::wire::diag::DiagStatus;

/// What a station was seen as at worst. An analyser keeps this in a colour until its user clears it; a start-up that goes
/// on is no fault, so getting further takes the place of what was before.
///
/// Later values take the place of earlier ones. Model: a fault in parameters or configuration outweighs a loss, since it
/// does not go away on its own.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Seen {
    /// The master asks for it and it never answered.
    Missing,
    /// It answers and never exchanged data: a slave without master, or one that is only starting up.
    Present,
    /// It exchanges data with its master and never did worse.
    Exchanging,
    /// It left data exchange against its master's will at least once ([`Observation::Lost`]).
    Lost,
    /// It reported Cfg_Fault or Not_Supported at least once.
    CfgFault,
    /// It reported Prm_Fault at least once.
    PrmFault,
    /// An active station: a master, in the ring or not.
    Master,
}

impl Seen {
    /// The words for reports.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Present => "no data exchange",
            Self::Exchanging => "data exchange",
            Self::Lost => "lost",
            Self::CfgFault => "configuration fault",
            Self::PrmFault => "parameter fault",
            Self::Master => "master",
        }
    }
    /// Whether a user should look at this station.
    pub const fn is_bad(self) -> bool {
        !matches!(self, Self::Exchanging | Self::Master)
    }
}

/// The counters of one address, as all masters count them: what an analyser beside them counts on the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Station {
    /// The worst it was seen as; none while nobody saw it or asked for it.
    pub seen: Option<Seen>,
    /// Lost: how often it left data exchange against its master's will. A start anew that the master wants is none. Of a
    /// master: how often it did not take the token and left the ring.
    pub lost: u64,
    /// Syncs: how often it was brought into data exchange, the first time included. An analyser counts the start-ups that
    /// end with a Data_Exchange.
    pub syncs: u64,
    /// Repeats: requests to it that were sent again, in all services and by all masters (FCB unchanged on the line), and
    /// tokens to it that were sent again. Of the latter an analyser shows the same token twice, and no other telegram in
    /// between. It does not see a request that a scenario loses before it gets onto the line, and misses its repeat.
    pub repeats: u64,
    /// Most repeats in one cycle of the master whose figures are taken, from SYNCH to SYNCH.
    pub most_repeats: u64,
    /// Illegal responses: answers to any master that do not fit their request, RS to a service of DP-V0 among them. RS to
    /// a Data_Exchange is how a slave says that it is free, and counts as lost; RS in MS1 and MS2 is how it says that the
    /// SAP is closed; octets that are no telegram count as a repeat.
    pub illegal: u64,
    /// Diagnoses read: Slave_Diag answered with a diagnosis to any master, whether it said something new or not.
    pub diagnoses: u64,
    /// Number of the cycle that [`Station::here`] is of.
    cycle: u64,
    /// Repeats in that cycle.
    here: u64,
}

impl Station {
    fn saw(&mut self, seen: Seen) {
        self.seen = self.seen.max(Some(seen));
    }
    fn repeat(&mut self, cycle: u64) {
        if self.cycle != cycle {
            (self.cycle, self.here) = (cycle, 0);
        }
        self.here += 1;
        self.repeats += 1;
        self.most_repeats = self.most_repeats.max(self.here);
    }
}

/// The stations of a run, by address.
#[derive(Clone, PartialEq, Debug)]
pub struct LiveList {
    stations: Vec<Station>,
    /// Whose cycles count.
    master: Address,
    /// Cycles begun.
    cycles: u64,
}

impl LiveList {
    /// Nobody is seen yet; the slaves of the layout are looked for.
    pub fn new(layout: &Layout) -> Self {
        let mut list = Self { stations: vec![Station::default(); 128], master: layout.master, cycles: 0 };
        for slave in layout.slaves() {
            list.station(slave.address).saw(Seen::Missing);
        }
        list
    }
    fn station(&mut self, address: Address) -> &mut Station {
        &mut self.stations[usize::from(address.get())]
    }
    /// The counters of one address.
    pub fn at(&self, address: Address) -> &Station {
        &self.stations[usize::from(address.get())]
    }
    /// Everybody who was seen or looked for, in the order of addresses.
    pub fn stations(&self) -> impl Iterator<Item = (u8, &Station)> {
        (0..).zip(&self.stations).filter(|(_, station)| station.seen.is_some())
    }

    /// Takes what `observer` observed.
    pub(super) fn observe(&mut self, observer: Address, what: &Observation) {
        let cycle = self.cycles;
        match *what {
            Observation::CycleStart { .. } if observer == self.master => self.cycles += 1,
            Observation::TokenClaimed | Observation::RingEntered => self.station(observer).saw(Seen::Master),
            Observation::StationJoined { station } => self.station(station).saw(Seen::Master),
            Observation::StationLost { station } => {
                let station = self.station(station);
                station.lost += 1;
                station.saw(Seen::Master);
            }
            Observation::Retry { slave: station } | Observation::TokenRetry { to: station } => {
                self.station(station).repeat(cycle);
            }
            Observation::IllegalAnswer { slave } => self.station(slave).illegal += 1,
            Observation::Lost { slave } => {
                let station = self.station(slave);
                station.lost += 1;
                station.saw(Seen::Lost);
            }
            Observation::DiagnosisRead { slave }
            | Observation::AcyclicData { slave, service: AcyclicService::Diagnosis, .. } => {
                let station = self.station(slave);
                station.diagnoses += 1;
                station.saw(Seen::Present);
            }
            Observation::Diagnosis { slave, status } => self.diagnosis(slave, status),
            Observation::Handler { slave, to: HandlerState::DataExchange, .. } => {
                let station = self.station(slave);
                station.syncs += 1;
                station.saw(Seen::Exchanging);
            }
            Observation::Gap { address, answer } => self.gap(address, answer),
            _ => {}
        }
    }
    fn diagnosis(&mut self, slave: Address, [a, b, c]: [u8; 3]) {
        let status = DiagStatus(u32::from_be_bytes([0, a, b, c]));
        if status.prm_fault() {
            self.station(slave).saw(Seen::PrmFault);
        } else if status.cfg_fault() || status.not_supported() {
            self.station(slave).saw(Seen::CfgFault);
        }
    }
    fn gap(&mut self, address: Address, answer: GapAnswer) {
        match answer {
            GapAnswer::Absent => {}
            GapAnswer::Slave => self.station(address).saw(Seen::Present),
            GapAnswer::NotReady | GapAnswer::Ready | GapAnswer::InRing => self.station(address).saw(Seen::Master),
        }
    }
}

/// Cycle times: true time from one cycle's start at the master to the next one's.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct CycleTimes {
    /// How many.
    pub count: u64,
    /// Shortest.
    pub min: Span,
    /// Longest.
    pub max: Span,
    sum: Span,
}

impl CycleTimes {
    pub(super) fn add(&mut self, time: Span) {
        (self.min, self.max) = if self.count == 0 { (time, time) } else { (self.min.min(time), self.max.max(time)) };
        self.sum += time;
        self.count += 1;
    }
    /// Mean, rounded down to a tick; none before the second cycle.
    pub fn mean(&self) -> Option<Span> {
        (self.count > 0).then(|| Span::from_ticks(self.sum.ticks() / self.count as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample::{self, address};

    const MASTER: u8 = 1;

    fn list(observations: &[Observation]) -> LiveList {
        let mut list = LiveList::new(&sample::layout());
        for what in observations {
            list.observe(address(MASTER), what);
        }
        list
    }
    fn seen(list: &LiveList) -> Vec<(u8, Seen)> {
        list.stations().filter_map(|(address, station)| Some((address, station.seen?))).collect()
    }

    #[test]
    fn who_is_looked_for_is_missing_until_it_answers() {
        assert_eq!(seen(&list(&[])), [(3, Seen::Missing), (5, Seen::Missing)]);
        let found = list(&[Observation::TokenClaimed, Observation::DiagnosisRead { slave: address(5) }]);
        assert_eq!(seen(&found), [(1, Seen::Master), (3, Seen::Missing), (5, Seen::Present)]);
    }

    #[test]
    fn a_gap_poll_finds_strangers() {
        let gap = |number, answer| Observation::Gap { address: address(number), answer };
        let found = list(&[
            gap(3, GapAnswer::Slave),
            gap(4, GapAnswer::Absent),
            gap(9, GapAnswer::Slave),
            gap(20, GapAnswer::NotReady),
            gap(21, GapAnswer::Ready),
            gap(22, GapAnswer::InRing),
        ]);
        let master = |number| (number, Seen::Master);
        let slaves = [(3, Seen::Present), (5, Seen::Missing), (9, Seen::Present)];
        assert_eq!(seen(&found), [&slaves[..], &[master(20), master(21), master(22)]].concat());
    }

    #[test]
    fn the_worst_is_kept_whatever_comes_later() {
        let slave = address(3);
        let joined = Observation::Handler { slave, from: HandlerState::AwaitReady, to: HandlerState::DataExchange };
        let diagnosis = |octet| Observation::Diagnosis { slave, status: [octet, 0x05, 0x00] };
        let (wants, lost) = (diagnosis(0x02), Observation::Lost { slave });
        for (course, worst) in [
            (&[wants][..], Seen::Missing),
            (&[wants, joined], Seen::Exchanging),
            (&[joined, lost, joined], Seen::Lost),
            (&[diagnosis(0x06), joined, lost], Seen::CfgFault),
            (&[diagnosis(0x12), joined], Seen::CfgFault),
            (&[diagnosis(0x42), diagnosis(0x06), joined, lost], Seen::PrmFault),
        ] {
            assert_eq!(list(course).at(slave).seen, Some(worst), "{course:?}");
        }
    }

    #[test]
    fn repeats_are_counted_by_cycle_and_all_together() {
        let cycle = |cycle| Observation::CycleStart { cycle, nominal: crate::time::Local::ZERO };
        let retry = |slave| Observation::Retry { slave: address(slave) };
        let list = list(&[cycle(0), retry(3), retry(5), retry(3), cycle(1), retry(3), cycle(2), cycle(3), retry(5)]);
        let of = |number| (list.at(address(number)).repeats, list.at(address(number)).most_repeats);
        assert_eq!((of(3), of(5)), ((3, 2), (2, 1)));
    }

    #[test]
    fn every_master_counts() {
        let (slave, tool, other) = (address(3), address(7), address(9));
        let mut list = LiveList::new(&sample::layout());
        let read = |service| Observation::AcyclicData { slave, service, record: None, len: 6, head: [0; 8] };
        for (by, what) in [
            (MASTER, Observation::DiagnosisRead { slave }),
            (7, read(AcyclicService::Diagnosis)),
            (7, read(AcyclicService::Inputs)),
            (7, Observation::Retry { slave }),
            (7, Observation::IllegalAnswer { slave }),
            (9, Observation::TokenRetry { to: tool }),
            (9, Observation::CycleStart { cycle: 0, nominal: crate::time::Local::ZERO }),
            (9, Observation::TokenRetry { to: tool }),
            (9, Observation::StationLost { station: tool }),
        ] {
            list.observe(address(by), &what);
        }
        let of = |at: Address| (list.at(at).repeats, list.at(at).illegal, list.at(at).diagnoses, list.at(at).lost);
        assert_eq!((of(slave), of(tool), of(other)), ((1, 1, 2, 0), (2, 0, 0, 1), (0, 0, 0, 0)));
        assert_eq!(list.at(tool).most_repeats, 2, "the other master's cycle ends none");
    }

    #[test]
    fn cycle_times_have_ends_and_a_middle() {
        let mut times = CycleTimes::default();
        assert_eq!(times.mean(), None);
        for us in [1_002, 999, 1_000] {
            times.add(Span::from_us(us));
        }
        assert_eq!((times.count, times.min, times.max), (3, Span::from_us(999), Span::from_us(1_002)));
        assert_eq!(times.mean(), Some(Span::from_ticks((3_001 * 12_000) / 3)));
    }
}
