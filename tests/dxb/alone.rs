//! A subscriber alone, telegram by telegram, without isochronous mode: its links are watched all the same. Nothing but
//! the links has a clock here; the master is as quick as the test.

use isodp::device::drive::{Drive, Subscriber};
use isodp::device::profile;
use isodp::device::unit::UnitSettings;
use isodp::fdl::{Heard, Input, Order, Outbox, Station, Timer};
use isodp::observation::{LinkState, Observation, SlaveState};
use isodp::time::{BitRate, Local, Span, Tbit};
use isodp::wire::diag::Diagnosis;
use isodp::wire::link_status::LinkStatus;
use isodp::wire::prm::{DpV1Status, DxbLink, DxbSubscription, PrmBuilder, SetPrm, StationStatus};
use isodp::wire::{Address, Fcb, Frame, FrameControl, Header, Sap, Service, StationType, Status, Telegram};

use proptest::collection::vec;
use proptest::prelude::*;

use crate::support::address;

const MASTER: u8 = 2;
const DRIVE: u8 = 10;
/// The watchdog of [`prm`], which is the monitoring time of the links (Model: D27).
const WATCHDOG: Span = Span::from_ms(200);
const TICK: Span = Span::from_ticks(1);
const CFG: [u8; 6] = [0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x00];

const fn link(publisher: u8, length: u8, offset: u8, sample: u8) -> DxbLink {
    DxbLink { publisher, length, offset, sample }
}

/// Set_Prm with a watchdog of 200 ms and these tables, not isochronous.
fn prm(links: &[DxbLink], subscriptions: &[DxbSubscription]) -> Vec<u8> {
    let prm = SetPrm {
        status: StationStatus::LOCK | StationStatus::WD_ON,
        wd_fact_1: 20,
        wd_fact_2: 1,
        min_tsdr: 11,
        ident: 0xF0D0,
        group: 0,
        dpv1: DpV1Status::DPV1_ENABLE | DpV1Status::FAIL_SAFE | DpV1Status::PRM_STRUCTURE,
        blocks: &[],
    };
    let builder = PrmBuilder::new(&prm).expect("a beginning");
    let builder = if links.is_empty() { builder } else { builder.dxb_links(links).expect("room") };
    let builder =
        if subscriptions.is_empty() { builder } else { builder.dxb_subscriptions(subscriptions).expect("room") };
    builder.octets().to_vec()
}

/// The drive, and what firmware would bring along.
struct Bench {
    drive: Drive,
    now: Local,
    /// When [`Timer::Links`] is due.
    due: Option<Local>,
    seen: Vec<Observation>,
    out: Outbox,
}

impl Bench {
    fn new() -> Self {
        let profile = profile::find("subscriber-drive").expect("a known device");
        let settings = UnitSettings::new(address(DRIVE), BitRate::M12, Tbit(30));
        let drive = Drive::new(profile, settings, Subscriber::new(profile, address(DRIVE)));
        let mut bench = Self { drive, now: Local::ZERO, due: None, seen: Vec::new(), out: Outbox::new() };
        bench.step(Input::PowerOn);
        bench
    }
    /// A drive in data exchange with this Set_Prm.
    fn exchanging(prm: &[u8]) -> Self {
        let mut bench = Self::new();
        bench.srd(Sap::SET_PRM, prm);
        bench.srd(Sap::CHK_CFG, &CFG);
        assert_eq!(bench.drive.slave().state(), SlaveState::DataExch);
        bench
    }
    fn step(&mut self, input: Input<'_, core::convert::Infallible>) {
        self.out.clear();
        self.drive.step(self.now, input, &mut self.out);
        for (_, order) in self.out.orders().filter(|&(which, _)| which == Timer::Links as usize) {
            self.due = if let Order::At(at) = order { Some(at) } else { None };
        }
        self.seen.extend(self.out.observations().copied());
    }
    fn advance(&mut self, span: Span) {
        let to = self.now + span;
        while let Some(at) = self.due.filter(|&at| at <= to) {
            (self.now, self.due) = (at, None);
            self.step(Input::Deadline { timer: Timer::Links, busy: false });
        }
        self.now = to;
    }
    fn telegram(&mut self, header: &Header, du: &[u8]) -> Option<(Status, Vec<u8>)> {
        let mut frame = Frame::new();
        frame.set_data(header, du).expect("a telegram");
        self.step(Input::Telegram(Heard { octets: frame.octets(), sample: 0 }));
        let (_, reply) = self.out.sending()?;
        match reply.telegram().expect("a telegram") {
            Telegram::Data { header, du } => match header.fc {
                FrameControl::Response { status, .. } => Some((status, du.to_vec())),
                FrameControl::Request { .. } => panic!("a slave asks for nothing"),
            },
            _ => None,
        }
    }
    fn srd(&mut self, sap: Sap, du: &[u8]) -> Option<(Status, Vec<u8>)> {
        let header = Header::request(address(DRIVE), address(MASTER), Service::SrdHigh, Fcb::First);
        self.telegram(&header.with_saps(sap, Sap::MASTER_MS0), du)
    }
    fn diag(&mut self) -> Vec<u8> {
        self.srd(Sap::SLAVE_DIAG, &[]).expect("a diagnosis").1
    }
    fn exchange(&mut self) -> (Status, Vec<u8>) {
        let header = Header::request(address(DRIVE), address(MASTER), Service::SrdHigh, Fcb::First);
        self.telegram(&header, &[0; 4]).expect("a reply")
    }
    /// A publisher's reply to all.
    fn publish(&mut self, publisher: u8, du: &[u8]) {
        let fc = FrameControl::Response { station: StationType::Slave, status: Status::Dl };
        let header = Header { da: Address::BROADCAST, sa: address(publisher), dsap: None, ssap: None, fc };
        assert_eq!(self.telegram(&header, du), None, "nobody answers a publisher");
    }
    fn status(&self, publisher: u8) -> u8 {
        self.drive.function().status(address(publisher)).expect("a link").0
    }
    /// The changes of links since the last call.
    fn changes(&mut self) -> Vec<(u8, LinkState)> {
        let change = |what| match what {
            Observation::Link { publisher, to, .. } => Some((publisher.get(), to)),
            _ => None,
        };
        core::mem::take(&mut self.seen).into_iter().filter_map(change).collect()
    }
}

/// What happens to a link in a row.
#[derive(Clone, Copy, Debug)]
enum Event {
    Valid,
    Wrong,
    /// Nothing for the watchdog time.
    Silence,
}

/// The table of `device::drive`: every state with every event, with the octet of the status and what is told.
#[test]
fn states_of_a_link() {
    use Event::{Silence, Valid, Wrong};
    let states: [&[Event]; 3] = [&[], &[Valid], &[Wrong]];
    let table = [
        [(Valid, 0x81, false), (Wrong, 0x40, true), (Silence, 0x00, true)],
        [(Valid, 0x81, false), (Wrong, 0x41, true), (Silence, 0x01, true)],
        [(Valid, 0x81, false), (Wrong, 0x40, true), (Silence, 0x00, true)],
    ];
    for (before, row) in states.into_iter().zip(table) {
        for (event, status, told) in row {
            let mut bench = Bench::exchanging(&prm(&[link(3, 12, 4, 4)], &[]));
            for event in before.iter().chain(&[event]) {
                match event {
                    Valid => bench.publish(3, &[1; 12]),
                    Wrong => bench.publish(3, &[2; 11]),
                    Silence => bench.advance(WATCHDOG),
                }
            }
            assert_eq!(bench.status(3), status, "{before:?}, then {event:?}");
            let diag = bench.diag();
            let blocks: &[u8] = if told { &[6, 0x83, 0, 0, 3, status] } else { &[] };
            assert_eq!(diag[6..], *blocks, "{before:?}, then {event:?}");
            assert_eq!(diag[0], if told { 0x08 } else { 0x00 }, "Ext_Diag: {before:?}, then {event:?}");
        }
    }
}

#[test]
fn a_link_is_lost_after_the_watchdog_time_and_not_a_tick_before() {
    let mut bench = Bench::exchanging(&prm(&[link(3, 12, 4, 4), link(4, 12, 4, 4)], &[]));
    bench.advance(Span::from_ms(50));
    bench.publish(3, &[3; 12]);
    bench.publish(4, &[4; 12]);
    assert_eq!(bench.changes(), [(3, LinkState::Active), (4, LinkState::Active)]);
    // Slave 4 goes on, slave 3 falls silent.
    for _ in 0..199 {
        bench.advance(Span::from_ms(1));
        bench.publish(4, &[4; 12]);
    }
    bench.advance(Span::from_ms(1) - TICK);
    assert_eq!((bench.changes(), bench.exchange().0), (vec![], Status::Dl));
    bench.advance(TICK);
    assert_eq!(bench.changes(), [(3, LinkState::Lost)]);
    // The value stays, and the reply says that there is news until the master has read it.
    assert_eq!(bench.exchange(), (Status::Dh, [[0; 4], [3; 4], [0; 4]].concat()));
    assert_eq!(bench.exchange().0, Status::Dh);
    assert_eq!(bench.diag(), [0x08, 0x0C, 0x00, MASTER, 0xF0, 0xD0, 8, 0x83, 0, 0, 3, 0x01, 4, 0x81]);
    assert_eq!(bench.exchange().0, Status::Dl);
    bench.publish(4, &[4; 12]);
    assert_eq!(bench.exchange().0, Status::Dl, "what works is no news");

    bench.publish(3, &[5; 12]);
    assert_eq!(bench.changes(), [(3, LinkState::Active)]);
    assert_eq!(bench.exchange(), (Status::Dh, [[0; 4], [5; 4], [0; 4]].concat()));
    assert_eq!(bench.diag(), [0x00, 0x0C, 0x00, MASTER, 0xF0, 0xD0]);
    assert_eq!(bench.exchange().0, Status::Dl);
    bench.advance(WATCHDOG);
    assert_eq!(bench.changes(), [(3, LinkState::Lost), (4, LinkState::Lost)], "it is watched again");
}

#[test]
fn every_link_has_its_own_time() {
    let links: Vec<_> = (20..49).map(|publisher| link(publisher, 12, 0, 1)).collect();
    let mut bench = Bench::exchanging(&prm(&links, &[]));
    for publisher in 20..49 {
        bench.advance(Span::from_ms(3));
        bench.publish(publisher, &[publisher; 12]);
    }
    bench.changes();
    bench.advance(WATCHDOG - Span::from_ms(3) * 28 - TICK);
    assert_eq!(bench.changes(), []);
    bench.advance(TICK);
    assert_eq!(bench.changes(), [(20, LinkState::Lost)]);
    for publisher in 21..49 {
        bench.advance(Span::from_ms(3) - TICK);
        assert_eq!(bench.changes(), []);
        bench.advance(TICK);
        assert_eq!(bench.changes(), [(publisher, LinkState::Lost)]);
    }
    let diag = bench.diag();
    assert_eq!((diag.len(), diag[6]), (6 + 62, 62), "29 links fit");
    assert_eq!(Diagnosis::parse(&diag).expect("a diagnosis").blocks().count(), 1);
}

#[test]
fn a_publisher_that_never_came_is_told_after_the_watchdog_time() {
    let mut bench = Bench::exchanging(&prm(&[link(3, 12, 4, 4)], &[]));
    bench.advance(WATCHDOG - TICK);
    assert_eq!((bench.exchange().0, bench.diag().len()), (Status::Dl, 6), "publishers start up too");
    bench.advance(TICK);
    assert_eq!((bench.exchange().0, bench.diag()[6..].to_vec()), (Status::Dh, vec![6, 0x83, 0, 0, 3, 0x00]));
    assert_eq!(bench.changes(), [], "lost it was before");
}

#[test]
fn samples_of_both_tables_go_to_their_places() {
    let long: Vec<u8> = (1..=244).collect();
    let to = |link, slot, destination| DxbSubscription { link, slot, destination };
    let mut bench = Bench::exchanging(&prm(
        &[link(3, 12, 4, 4), link(4, 244, 240, 4), link(3, 12, 0, 2)],
        &[to(link(3, 12, 10, 2), 1, 242), to(link(4, 244, 0, 244), 2, 0), to(link(5, 1, 0, 1), 1, 0)],
    ));
    let areas = |bench: &Bench| {
        let function = bench.drive.function();
        let slot = |slot| function.slot_data(slot).expect("a slot").to_vec();
        (function.link_data().to_vec(), slot(1), slot(2))
    };
    assert_eq!(areas(&bench), (vec![0; 10], vec![0; 244], vec![0; 244]));
    assert_eq!(bench.drive.filter().publishers, 1 << 3 | 1 << 4 | 1 << 5);
    bench.publish(3, &[10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21]);
    bench.publish(4, &long);
    bench.publish(5, &[99]);
    let link_table = vec![14, 15, 16, 17, 241, 242, 243, 244, 10, 11];
    let mut slot_1 = vec![0; 244];
    (slot_1[0], slot_1[242], slot_1[243]) = (99, 20, 21);
    assert_eq!(areas(&bench), (link_table, slot_1, long));
    assert_eq!(bench.drive.function().slot_data(3), None);
    // The position followed is the first sample of the first publisher.
    assert_eq!(bench.exchange().1[4..8], [14, 15, 16, 17]);
    let before = areas(&bench);
    for wrong in [&[0xEE; 11][..], &[0xEE; 13], &[0xEE; 244], &[]] {
        bench.publish(3, wrong);
        assert_eq!((bench.status(3), areas(&bench)), (0x41, before.clone()), "{} octets", wrong.len());
    }
    bench.publish(7, &[0xEE; 12]);
    assert_eq!(areas(&bench), before, "a stranger");
}

#[test]
fn each_change_of_a_bad_link_is_news() {
    let mut bench = Bench::exchanging(&prm(&[link(3, 12, 4, 4), link(4, 12, 4, 4)], &[]));
    let error = LinkStatus::ERROR.0;
    bench.publish(3, &[0; 5]);
    assert_eq!((bench.exchange().0, bench.diag()[10..].to_vec()), (Status::Dh, vec![3, error, 4, 0]));
    bench.publish(3, &[0; 6]);
    assert_eq!(bench.exchange().0, Status::Dl, "the same again");
    bench.publish(4, &[0; 12]);
    assert_eq!((bench.exchange().0, bench.diag()[10..].to_vec()), (Status::Dh, vec![3, error, 4, 0x81]));
    bench.publish(3, &[0; 12]);
    assert_eq!((bench.exchange().0, bench.diag().len()), (Status::Dh, 6));
    bench.publish(3, &[0; 12]);
    bench.publish(4, &[0; 12]);
    assert_eq!(bench.exchange().0, Status::Dl);
    let wrong = |what: &&Observation| matches!(what, Observation::WrongLength { .. });
    assert_eq!(bench.seen.iter().filter(wrong).count(), 2);
}

#[test]
fn leaving_data_exchange_ends_all_links() {
    let mut bench = Bench::exchanging(&prm(&[link(3, 12, 4, 4)], &[]));
    bench.publish(3, &[7; 12]);
    bench.advance(WATCHDOG);
    assert_eq!(bench.status(3), LinkStatus::DATA_EXISTED.0);
    bench.srd(Sap::SET_PRM, &prm(&[link(4, 12, 4, 4)], &[]));
    assert_eq!((bench.due, bench.drive.filter().publishers), (None, 1 << 4));
    assert_eq!((bench.drive.function().status(address(3)), bench.status(4)), (None, 0));
    assert_eq!(bench.diag().len(), 6);
    assert_eq!(bench.drive.function().link_data(), [0; 4]);
    bench.srd(Sap::CHK_CFG, &CFG);
    bench.advance(WATCHDOG);
    assert_eq!(bench.diag()[10..], [4, 0x00]);
    // Unlock.
    let mut unlock = prm(&[], &[]);
    unlock[0] = 0x40;
    bench.srd(Sap::SET_PRM, &unlock);
    assert_eq!((bench.due, bench.drive.filter().publishers, bench.diag().len()), (None, 0, 6));
}

#[test]
fn a_drive_without_configuration_listens_to_nobody() {
    let mut bench = Bench::new();
    bench.srd(Sap::SET_PRM, &prm(&[link(3, 12, 4, 4)], &[]));
    assert_eq!(bench.drive.filter().publishers, 1 << 3);
    bench.srd(Sap::CHK_CFG, &[0xC3]);
    assert_eq!((bench.drive.slave().state(), bench.drive.filter().publishers), (SlaveState::WaitPrm, 0));
}

proptest! {
    /// Whatever the tables say, a drive refuses them or copies within its areas.
    #[test]
    fn no_table_makes_a_drive_panic(
        entries in vec((2..6u8, 1..20u8, 0..8u8, 0..4u8, any::<u8>(), 0..12u8), 0..6),
        links in 0..6usize,
        noise in vec(any::<u8>(), 0..40),
        lengths in vec((2..6u8, 0..20usize), 0..20),
    ) {
        let entry = |&(publisher, length, offset, .., sample): &(u8, u8, u8, u8, u8, u8)| link(publisher, length, offset, sample);
        let (links, subscriptions) = entries.split_at(links.min(entries.len()));
        let links: Vec<_> = links.iter().map(entry).collect();
        let to = |from: &(u8, u8, u8, u8, u8, u8)| DxbSubscription { link: entry(from), slot: from.3, destination: from.4 };
        let subscriptions: Vec<_> = subscriptions.iter().map(to).collect();
        let good = prm(&links, &subscriptions);
        for prm in [good.clone(), [&good[..], &noise].concat(), [&good[..10], &noise].concat()] {
            let mut bench = Bench::new();
            bench.srd(Sap::SET_PRM, &prm);
            bench.srd(Sap::CHK_CFG, &CFG);
            let exchanging = bench.drive.slave().state() == SlaveState::DataExch;
            for &(publisher, length) in &lengths {
                if bench.drive.filter().publishers >> publisher & 1 == 1 {
                    prop_assert!(exchanging);
                    bench.publish(publisher, &[0xEE; 20][..length]);
                    bench.advance(Span::from_ms(30));
                    let status = bench.status(publisher);
                    prop_assert!(matches!(status, 0x40 | 0x41 | 0x81), "{status:02X}");
                }
            }
            if exchanging {
                bench.advance(WATCHDOG);
                prop_assert!(bench.drive.function().statuses().all(|(_, status)| status.0 & !1 == 0));
                prop_assert!(bench.diag().len() <= 68);
            }
        }
    }
}

#[test]
fn wrong_tables_are_a_parameter_fault() {
    let good = link(3, 12, 4, 4);
    let to = |slot, destination| DxbSubscription { link: good, slot, destination };
    let twice = [prm(&[good], &[]), prm(&[good], &[])[10..].to_vec()].concat();
    let mut off = prm(&[good], &[]);
    off[0] = 0x80;
    let many: Vec<_> = (20..50).map(|publisher| link(publisher, 12, 0, 1)).collect();
    for (prm, fault) in [
        (prm(&[good], &[to(1, 0)]), false),
        (prm(&many[..29], &[]), false),
        (prm(&many, &[]), true),
        (prm(&many[..29], &[to(1, 0)]), true),
        (twice, true),
        (off, true),
        (prm(&[link(DRIVE, 12, 4, 4)], &[]), true),
        (prm(&[link(126, 12, 4, 4)], &[]), true),
        (prm(&[link(3, 0, 0, 0)], &[]), true),
        (prm(&[link(3, 12, 12, 1)], &[]), true),
        (prm(&[link(3, 12, 10, 4)], &[]), true),
        (prm(&[], &[to(0, 0)]), true),
        (prm(&[], &[to(3, 0)]), true),
        (prm(&[], &[to(1, 241)]), true),
        (prm(&[], &[to(1, 0), to(1, 3)]), true),
    ] {
        let mut bench = Bench::new();
        bench.srd(Sap::SET_PRM, &prm);
        let diagnosis = bench.diag();
        assert_eq!(diagnosis[0] & 0x40 != 0, fault, "{:02X?}", &prm[10..]);
        let state = if fault { SlaveState::WaitPrm } else { SlaveState::WaitCfg };
        assert_eq!(bench.drive.slave().state(), state, "{:02X?}", &prm[10..]);
    }
}
