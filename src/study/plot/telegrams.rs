//! Telegrams: the last complete bus cycle as it was on the line, in two buffers of fixed size.

use crate::observation::Observation;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::Time;
use crate::wire::{Address, FrameControl, Header, Sap, Service, Telegram};

/// Most telegrams of a cycle that are kept: 122 slaves, each asked and answering four times, and some more.
const CAPACITY: usize = 1_024;
/// Stations with an address of their own.
const STATIONS: usize = 127;
/// Control_Command and Group_Select of SYNCH (Model: D5).
const SYNCH: [u8; 2] = [0x00, 0x80];

/// What a telegram is for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Kind {
    Synch,
    Request,
    Reply,
    DxbReply,
    Acyclic,
    Gap,
    Token,
    /// Data_Exchange of another master.
    OtherRequest,
    OtherReply,
    /// Anything else of another master but GAP polls: of class 2 its reads, writes and parameters.
    OtherAcyclic,
    OtherAnswer,
    /// The token that another master passes on.
    OtherToken,
    Unreadable,
}

impl Kind {
    /// The same of another master than the one whose cycle it is.
    const fn of_other(self, asks: bool) -> Self {
        match self {
            Self::Request => Self::OtherRequest,
            Self::Reply | Self::DxbReply => Self::OtherReply,
            Self::Acyclic | Self::Synch if asks => Self::OtherAcyclic,
            Self::Acyclic | Self::Synch => Self::OtherAnswer,
            Self::Token => Self::OtherToken,
            kind => kind,
        }
    }
}

/// One telegram on the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bar {
    pub(super) start: Time,
    pub(super) end: Time,
    pub(super) kind: Kind,
    /// Whether the station that has the token sent it.
    pub(super) asks: bool,
    /// The slave that it is for or from; the polled address of a GAP poll; who gets a token, unless it stays.
    pub(super) slave: Option<Address>,
    /// The master that has the token, if it is another one than the one whose cycle it is.
    pub(super) other: Option<Address>,
}

/// One bus cycle.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    pub(super) number: Option<u64>,
    /// The last bit of SYNCH.
    pub(super) t0: Option<Time>,
    /// First bit of the next SYNCH and the next t0.
    pub(super) next: Option<(Time, Time)>,
    pub(super) bars: Vec<Bar>,
    /// Telegrams that found no room.
    pub(super) dropped: u64,
    t_o: [Option<Time>; STATIONS],
    latch: [Option<(Time, bool)>; STATIONS],
}

impl Cycle {
    fn new() -> Self {
        Self {
            number: None,
            t0: None,
            next: None,
            bars: Vec::with_capacity(CAPACITY),
            dropped: 0,
            t_o: [None; STATIONS],
            latch: [None; STATIONS],
        }
    }
    /// A cycle that nobody has seen, from `t0` to the first and the last bit of the next SYNCH.
    pub(super) fn planned(t0: Time, next: (Time, Time)) -> Self {
        Self { t0: Some(t0), next: Some(next), ..Self::new() }
    }
    /// T_O of a slave and its latch by a locked clock.
    pub(super) fn plan_slave(&mut self, slave: Address, t_o: Time, latch: Time) {
        let station = usize::from(slave.get()).min(STATIONS - 1);
        (self.t_o[station], self.latch[station]) = (Some(t_o), Some((latch, true)));
    }
    fn clear(&mut self) {
        (self.number, self.t0, self.next, self.dropped) = (None, None, None, 0);
        self.bars.clear();
        self.t_o = [None; STATIONS];
        self.latch = [None; STATIONS];
    }
    pub(super) fn push(&mut self, bar: Bar) {
        if self.bars.len() < CAPACITY {
            self.bars.push(bar);
        } else {
            self.dropped += 1;
        }
    }
    /// How much there is to see: data exchange first, what other masters ask second, GAP third.
    fn rank(&self) -> (bool, bool, bool) {
        let has = |kind: Kind| self.bars.iter().any(|bar| bar.kind == kind);
        let others = has(Kind::OtherRequest) || has(Kind::OtherAcyclic);
        (has(Kind::Reply) || has(Kind::DxbReply), others, has(Kind::Gap))
    }
    /// T_O of a slave.
    pub(super) fn t_o(&self, slave: Address) -> Option<Time> {
        *self.t_o.get(usize::from(slave.get()))?
    }
    /// Latch of a slave, and whether it was at T_I of a locked clock.
    pub(super) fn latch(&self, slave: Address) -> Option<(Time, bool)> {
        *self.latch.get(usize::from(slave.get()))?
    }
}

/// Cycles at the beginning that are all looked at.
const FIRST: u64 = 512;
/// From then on so many in a row are looked at, [`ROW`] out of [`PERIOD`]: a GAP poll is among them, and a long run does not
/// read each of its telegrams once more.
const ROW: u64 = 64;
/// See [`ROW`].
const PERIOD: u64 = 4_096;

const fn is_looked_at(cycle: u64) -> bool {
    cycle < FIRST || cycle % PERIOD < ROW
}

/// Keeps the telegrams, T_O and latch instants of the latest complete cycle of one master with data exchange, requests of
/// other masters and a GAP poll; else of the latest that has most of these, in this order. Not all cycles of a long run are
/// looked at.
#[derive(Clone, Debug)]
pub struct BusCycle {
    /// Whose cycles.
    master: Address,
    /// Whether this cycle is looked at.
    looks: bool,
    current: Cycle,
    kept: Cycle,
    /// What the last request was for, and for whom.
    asked: (Kind, Option<Address>),
    /// Who sent the last request or token, if it was another master.
    other: Option<Address>,
    /// SYNCH, told of ahead of its start: it belongs to the cycle that its last bit begins.
    coming: Option<Bar>,
}

impl BusCycle {
    /// Nothing kept yet of the cycles of `master`.
    pub fn new(master: Address) -> Self {
        let asked = (Kind::Unreadable, None);
        Self { master, looks: true, current: Cycle::new(), kept: Cycle::new(), asked, other: None, coming: None }
    }

    /// The kept cycle.
    pub(super) fn cycle(&self) -> Option<&Cycle> {
        self.kept.next.map(|_| &self.kept)
    }

    /// A cycle begins at `t0`, which is the end of the one before. What was not seen from its beginning is not kept: the
    /// first cycle of a row is listened to only, for who asks whom.
    fn begin(&mut self, cycle: u64, t0: Time) {
        let looked = core::mem::replace(&mut self.looks, is_looked_at(cycle));
        // Without its SYNCH on the line the cycle begins all the same.
        let synch = self.coming.take();
        if !looked {
            return self.current.clear();
        }
        self.next(synch.map_or(t0, |synch| synch.start), t0);
        self.current.bars.extend(synch);
        self.current.number = Some(cycle);
    }

    /// The current cycle ends with the first bit of the next SYNCH at `start`, the next one begins at `t0`.
    fn next(&mut self, start: Time, t0: Time) {
        if self.current.t0.is_some() {
            self.current.next = Some((start, t0));
            if self.kept.next.is_none() || self.current.rank() >= self.kept.rank() {
                core::mem::swap(&mut self.current, &mut self.kept);
            }
        }
        self.current.clear();
        self.current.t0 = Some(t0);
    }

    /// What a telegram is: its kind, whether the token holder sent it, the slave.
    fn classify(&mut self, telegram: &Transmission<'_>) -> (Kind, bool, Option<Address>) {
        match Telegram::parse(telegram.octets) {
            Err(_) => (Kind::Unreadable, false, None),
            Ok(Telegram::Token { da, sa }) => (Kind::Token, true, (da != sa).then_some(da)),
            Ok(Telegram::ShortAck) => (self.asked.0, false, Some(telegram.sender)),
            Ok(Telegram::Data { header, du }) => match header.fc {
                FrameControl::Response { .. } => (self.answer(&header), false, Some(telegram.sender)),
                FrameControl::Request { service, .. } => {
                    let kind = request(&header, service, du);
                    let slave = (!header.da.is_broadcast()).then_some(header.da);
                    self.asked = (if kind == Kind::Request { Kind::Reply } else { kind }, slave);
                    (kind, true, slave)
                }
            },
        }
    }
    fn answer(&self, header: &Header) -> Kind {
        if header.da.is_broadcast() { Kind::DxbReply } else { self.asked.0 }
    }
}

fn request(header: &Header, service: Service, du: &[u8]) -> Kind {
    match (service, header.dsap) {
        (Service::FdlStatus, _) => Kind::Gap,
        (Service::SrdHigh | Service::Msrd, None) => Kind::Request,
        (Service::SdnHigh, Some(Sap::GLOBAL_CONTROL)) if du == SYNCH => Kind::Synch,
        _ => Kind::Acyclic,
    }
}

impl Recorder for BusCycle {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if !self.looks {
            return;
        }
        let (kind, asks, slave) = self.classify(telegram);
        if asks {
            self.other = (telegram.sender != self.master).then_some(telegram.sender);
        }
        let other = self.other.filter(|_| kind != Kind::Unreadable);
        let kind = if other.is_some() { kind.of_other(asks) } else { kind };
        let bar = Bar { start: telegram.start, end: telegram.end, kind, asks, slave, other };
        if kind == Kind::Synch {
            self.coming = Some(bar);
        } else {
            self.current.push(bar);
        }
    }

    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        let station = usize::from(stamp.station.get()).min(STATIONS - 1);
        match what {
            Observation::CycleStart { cycle, .. } if stamp.station == self.master => self.begin(*cycle, stamp.at),
            _ if !self.looks => {}
            Observation::SetPoint { .. } => self.current.t_o[station] = Some(stamp.at),
            Observation::Latch { locked, .. } => self.current.latch[station] = Some((stamp.at, *locked)),
            _ => {}
        }
    }
}
