//! Every state with every input, and whole rings of active stations on one line.

use super::*;
use crate::fdl::Order;
use crate::observation::RingExit;
use crate::time::{BitRate, Tbit};
use alloc::string::String;
use alloc::vec::Vec;

const fn at(number: u8) -> Address {
    Address::new(number).unwrap()
}
fn token(sa: u8, da: u8) -> Frame {
    let mut frame = Frame::new();
    frame.set_token(at(da), at(sa));
    frame
}
fn data(sa: u8, da: u8, fc: FrameControl) -> Frame {
    let mut frame = Frame::new();
    frame.set_data(&Header { da: at(da), sa: at(sa), dsap: None, ssap: None, fc }, &[]).unwrap();
    frame
}
fn request(sa: u8, da: u8, service: Service) -> Frame {
    data(sa, da, FrameControl::request(service, Fcb::Unused))
}

// ----- the table

const NOT_READY: &str = "Listen_Token";
const READY: &str = "Listen_Token, ready";
const IDLE: &str = "Active_Idle";
const SKIPPED: &str = "Active_Idle, skipped";
const CLAIM: &str = "Claim_Token";
const USE: &str = "Use_Token";
const DATA: &str = "Await_Data_Response";
const STATUS: &str = "Await_Status_Response";
const KEEP: &str = "Keep_Token";
const PASS: &str = "Pass_Token";
const CHECK: &str = "Check_Token_Pass";
const OFFLINE: &str = "Offline";
const STATES: [&str; 12] = [OFFLINE, NOT_READY, READY, IDLE, SKIPPED, CLAIM, USE, DATA, STATUS, KEEP, PASS, CHECK];

fn name(active: &Active) -> &'static str {
    match active.state {
        State::Offline => OFFLINE,
        State::ListenToken { .. } if active.ring.is_complete() => READY,
        State::ListenToken { .. } => NOT_READY,
        State::ActiveIdle { skipped: 0 } => IDLE,
        State::ActiveIdle { .. } => SKIPPED,
        State::ClaimToken { .. } => CLAIM,
        State::UseToken => USE,
        State::AwaitDataResponse(_) => DATA,
        State::AwaitStatusResponse(_) => STATUS,
        State::KeepToken => KEEP,
        State::PassToken(_) => PASS,
        State::CheckTokenPass(_) => CHECK,
    }
}
/// Station 5 between 2 and 9, in the state of this name, having asked 7.
fn station_in(state: &str) -> Active {
    let mut active = Active::new(at(5), BusParams::profile(BitRate::M12));
    if state != NOT_READY {
        for (sa, da) in [(9, 2), (2, 9), (9, 2), (2, 9), (9, 2)] {
            active.ring.listen(at(sa), at(da));
        }
    }
    let awaited = Awaited { from: at(7), retries_left: 0, extended: false };
    let passing = Passing { to: at(9), attempt: 1 };
    active.state = match state {
        OFFLINE => State::Offline,
        NOT_READY | READY => State::ListenToken { conflicts: 1 },
        IDLE => State::ActiveIdle { skipped: 0 },
        SKIPPED => State::ActiveIdle { skipped: 1 },
        CLAIM => State::ClaimToken { tokens_left: 0 },
        USE => State::UseToken,
        DATA => State::AwaitDataResponse(awaited),
        STATUS => State::AwaitStatusResponse(awaited),
        KEEP => State::KeepToken,
        PASS => State::PassToken(passing),
        CHECK => State::CheckTokenPass(passing),
        _ => unreachable!(),
    };
    assert_eq!(name(&active), state);
    active
}

/// Inputs by name; the two without telegram are T_SL, T_TO or the end of the own token.
fn inputs() -> [(&'static str, Option<Frame>); 12] {
    let reply = FrameControl::slave(Status::Dl);
    let mut broken = token(2, 5);
    broken.octets_mut()[0] ^= 1;
    [
        ("token from PS", Some(token(2, 5))),
        ("token from another", Some(token(9, 5))),
        ("token past", Some(token(2, 9))),
        ("token elsewhere", Some(token(9, 2))),
        ("own address", Some(token(5, 9))),
        ("request", Some(request(2, 7, Service::SrdHigh))),
        ("status request", Some(request(2, 5, Service::FdlStatus))),
        ("answer", Some(data(7, 5, reply))),
        ("foreign answer", Some(data(8, 2, reply))),
        ("broken", Some(broken)),
        ("timer, busy", None),
        ("timer, silent", None),
    ]
}

/// Where the state changes; everywhere else it stays.
const CHANGES: &[(&str, &[&str], &str)] = &[
    ("own address", &[NOT_READY, READY], OFFLINE),
    ("own address", &[IDLE, SKIPPED, CLAIM, USE, DATA, STATUS, KEEP, PASS, CHECK], NOT_READY),
    ("token from PS", &[READY, IDLE, SKIPPED, CHECK], USE),
    ("token from another", &[CHECK], IDLE),
    ("token past", &[IDLE], SKIPPED),
    ("token past", &[CHECK], SKIPPED),
    ("token past", &[SKIPPED], NOT_READY),
    ("token past", &[USE, DATA, STATUS, KEEP, PASS], IDLE),
    ("token elsewhere", &[USE, DATA, STATUS, KEEP, PASS, CHECK], IDLE),
    ("request", &[USE, DATA, STATUS, KEEP, PASS, CHECK], IDLE),
    ("status request", &[USE, DATA, STATUS, KEEP, PASS, CHECK], IDLE),
    ("answer", &[DATA, STATUS], USE),
    ("answer", &[CHECK], IDLE),
    ("foreign answer", &[DATA, STATUS], USE),
    ("foreign answer", &[CHECK], IDLE),
    ("broken", &[DATA, STATUS], USE),
    ("broken", &[CHECK], IDLE),
    ("token from PS", &[CLAIM], NOT_READY),
    ("token from another", &[CLAIM], NOT_READY),
    ("token past", &[CLAIM], NOT_READY),
    ("token elsewhere", &[CLAIM], NOT_READY),
    ("request", &[CLAIM], NOT_READY),
    ("status request", &[CLAIM], NOT_READY),
    ("answer", &[CLAIM], NOT_READY),
    ("foreign answer", &[CLAIM], NOT_READY),
    ("timer, busy", &[CLAIM], USE),
    ("timer, silent", &[CLAIM], USE),
    ("timer, busy", &[KEEP], PASS),
    ("timer, silent", &[KEEP], PASS),
    ("timer, busy", &[PASS], CHECK),
    ("timer, silent", &[PASS], CHECK),
    ("timer, busy", &[CHECK], IDLE),
    ("timer, silent", &[CHECK], PASS),
    ("timer, silent", &[NOT_READY, READY, IDLE, SKIPPED], CLAIM),
    ("timer, silent", &[DATA, STATUS], USE),
];

#[test]
fn every_state_takes_every_input_as_the_table_says() {
    for state in STATES {
        for (input, frame) in inputs() {
            let mut active = station_in(state);
            let mut out = Outbox::new();
            let now = Local::from_ticks(1_000_000);
            let confirm = match &frame {
                Some(frame) => active.heard(now, Heard { octets: frame.octets(), sample: 0 }, &mut out),
                None => active.slot_over(now, input == "timer, busy", &mut out),
            };
            let change = CHANGES.iter().find(|(on, from, _)| *on == input && from.contains(&state));
            assert_eq!(name(&active), change.map_or(state, |(_, _, to)| to), "{state} + {input}");
            let had = [USE, DATA, STATUS, KEEP, PASS].contains(&state);
            let gone = had && [IDLE, NOT_READY].contains(&name(&active));
            assert_eq!(confirm == Confirm::TokenGone, gone, "{state} + {input}: {confirm:?}");
            let held = !had && name(&active) == USE;
            assert_eq!(confirm == Confirm::TokenHeld, held, "{state} + {input}: {confirm:?}");
        }
    }
    for (input, from, to) in CHANGES {
        assert!(inputs().iter().any(|(known, _)| known == input) && STATES.contains(to), "{input}");
        assert!(from.iter().all(|from| STATES.contains(from)), "{input}");
    }
}

#[test]
fn fdl_status_tells_whether_the_station_is_ready_and_in_the_ring() {
    for (state, fc) in [(NOT_READY, 0x10), (READY, 0x20), (IDLE, 0x30)] {
        let mut active = station_in(state);
        let mut out = Outbox::new();
        let octets = [0x10, 0x05, 0x02, 0x49, 0x50, 0x16];
        active.heard(Local::ZERO, Heard { octets: &octets, sample: 0 }, &mut out);
        let (send, frame) = out.sending().expect("an answer");
        assert_eq!(frame.octets(), [0x10, 0x02, 0x05, fc, 0x07 + fc, 0x16], "{state}");
        assert_eq!(send.at - Local::ZERO, BitRate::M12.span(Tbit(11)), "min T_SDR");
    }
}

#[test]
fn a_token_from_another_than_ps_is_taken_when_it_comes_again() {
    for state in [READY, IDLE] {
        let mut active = station_in(state);
        let frame = token(9, 5);
        let heard = Heard { octets: frame.octets(), sample: 0 };
        assert_eq!(active.heard(Local::ZERO, heard, &mut Outbox::new()), Confirm::Nothing, "{state}");
        assert_eq!(active.heard(Local::ZERO, heard, &mut Outbox::new()), Confirm::TokenHeld, "{state}");
        assert_eq!(active.ring().ps(), at(9), "2 is gone");
    }
}

// ----- whole rings

#[expect(clippy::struct_excessive_bools, reason = "switches of a test")]
/// An active station and what the layer above wants to do with each token.
struct Node {
    active: Active,
    slot: Option<Local>,
    /// Alone in the ring: the next token visit.
    again: Option<Local>,
    alive: bool,
    /// A message with high priority, and as many with low priority as T_TH has room for.
    high: bool,
    low: bool,
    gap: bool,
    polled: bool,
    highs: usize,
    lows: usize,
    /// How many messages of either priority went in each visit.
    visits: Vec<(usize, usize)>,
}

struct Flight {
    start: Local,
    end: Local,
    sender: usize,
    frame: Frame,
    delivered: bool,
}

/// One line without delays; all crystals are right.
struct Line {
    bus: BusParams,
    nodes: Vec<Node>,
    flights: Vec<Flight>,
    log: Vec<(Local, u8, Observation)>,
    now: Local,
    collisions: usize,
}

/// What a layer above makes of a confirmation.
#[derive(Clone, Copy)]
enum Next {
    Wait,
    Visit,
    Continue,
}
impl From<Confirm<'_>> for Next {
    fn from(confirm: Confirm<'_>) -> Self {
        match confirm {
            Confirm::Nothing | Confirm::TokenGone => Self::Wait,
            Confirm::TokenHeld => Self::Visit,
            _ => Self::Continue,
        }
    }
}

impl Line {
    fn new(addresses: &[u8], t_tr: u32) -> Self {
        let mut bus = BusParams::profile(BitRate::M12);
        (bus.hsa, bus.t_tr) = (10, Tbit(t_tr));
        let node = |&address| Node {
            active: Active::new(at(address), bus),
            slot: None,
            again: None,
            alive: false,
            high: false,
            low: false,
            gap: true,
            polled: false,
            highs: 0,
            lows: 0,
            visits: Vec::new(),
        };
        let nodes = addresses.iter().map(node).collect();
        Self { bus, nodes, flights: Vec::new(), log: Vec::new(), now: Local::ZERO, collisions: 0 }
    }
    /// A line whose stations were switched on together and have built their ring.
    fn built(addresses: &[u8], t_tr: u32) -> Self {
        let mut line = Self::new(addresses, t_tr);
        (0..addresses.len()).for_each(|node| line.power_on(node));
        line.run(Span::from_ms(20));
        line.log.clear();
        line.flights.clear();
        line
    }
    fn power_on(&mut self, node: usize) {
        let mut out = Outbox::new();
        let Node { active, alive, .. } = &mut self.nodes[node];
        *active = Active::new(active.address(), *active.bus());
        *alive = true;
        active.power_on(self.now, &mut out);
        self.carry_out(node, &out);
    }
    fn power_off(&mut self, node: usize) {
        let node = &mut self.nodes[node];
        (node.alive, node.slot, node.again) = (false, None, None);
    }
    fn run(&mut self, span: Span) {
        let until = self.now + span;
        while self.next(until) {}
        self.now = until;
    }
    /// Runs until `when` holds after an event.
    fn run_until(&mut self, when: impl Fn(&Self) -> bool) {
        let until = self.now + Span::from_ms(100);
        while !when(self) {
            assert!(self.next(until), "it never happens");
        }
    }
    fn next(&mut self, until: Local) -> bool {
        let ends = self.flights.iter().enumerate().filter(|(_, flight)| !flight.delivered);
        let end = ends.map(|(index, flight)| (flight.end, 0, index)).min();
        let nodes = || self.nodes.iter().enumerate();
        let slot = nodes().filter_map(|(index, node)| Some((node.slot?, 1, index))).min();
        let again = nodes().filter_map(|(index, node)| Some((node.again?, 2, index))).min();
        let Some((at, kind, index)) = [end, slot, again].into_iter().flatten().min() else { return false };
        if at > until {
            return false;
        }
        self.now = at;
        match kind {
            0 => self.deliver(index),
            1 => self.slot_over(index),
            _ => {
                self.nodes[index].again = None;
                self.visit(index);
            }
        }
        true
    }
    fn deliver(&mut self, flight: usize) {
        self.flights[flight].delivered = true;
        let (sender, frame) = (self.flights[flight].sender, self.flights[flight].frame.clone());
        for node in (0..self.nodes.len()).filter(|&node| node != sender) {
            if self.nodes[node].alive {
                let mut out = Outbox::new();
                let heard = Heard { octets: frame.octets(), sample: 0 };
                let next = self.nodes[node].active.heard(self.now, heard, &mut out).into();
                self.go_on(node, &out, next);
            }
        }
    }
    fn slot_over(&mut self, node: usize) {
        self.nodes[node].slot = None;
        let busy = self.flights.iter().any(|flight| flight.start <= self.now && self.now < flight.end);
        let mut out = Outbox::new();
        let next = self.nodes[node].active.slot_over(self.now, busy, &mut out).into();
        self.go_on(node, &out, next);
    }
    fn go_on(&mut self, node: usize, out: &Outbox, next: Next) {
        self.carry_out(node, out);
        match next {
            Next::Wait => {}
            Next::Visit => self.visit(node),
            Next::Continue => self.work(node),
        }
    }
    fn visit(&mut self, node: usize) {
        let node_ = &mut self.nodes[node];
        (node_.polled, node_.highs, node_.lows) = (false, 0, 0);
        self.work(node);
    }
    /// One message of a token visit, or its end: nobody is at 10, so that every message lasts T_SL.
    fn work(&mut self, node: usize) {
        let mut out = Outbox::new();
        let Node { active, again, high, low, gap, polled, highs, lows, visits, .. } = &mut self.nodes[node];
        let at_ = active.free_at().max(self.now);
        let service = if *high && *highs == 0 && active.may_high(at_) {
            *highs += 1;
            Some(Service::SrdHigh)
        } else if *low && active.may_low(at_) {
            *lows += 1;
            Some(Service::SrdLow)
        } else {
            None
        };
        if let Some(service) = service {
            active.request(at_, &Request { to: at(10), service, saps: None, retries: 0 }, 0, &mut out, |_| ());
        } else if *gap && !*polled && active.may_gap(at_) && active.poll_gap(at_, &mut out).is_some() {
            *polled = true;
        } else {
            let end = active.pass_token(at_, &mut out);
            *again = active.may_send().then_some(end);
            visits.push((*highs, *lows));
        }
        self.carry_out(node, &out);
    }
    fn carry_out(&mut self, node: usize, out: &Outbox) {
        for (which, order) in out.orders() {
            assert_eq!(which, Timer::Slot as usize);
            self.nodes[node].slot = match order {
                Order::At(at) => Some(at),
                Order::Off => None,
            };
        }
        let address = self.nodes[node].active.address().get();
        self.log.extend(out.observations().map(|seen| (self.now, address, *seen)));
        let Some((send, frame)) = out.sending() else { return };
        let (start, end) = (send.at, send.at + self.bus.rate.octets(frame.len()));
        let mut frame = frame.clone();
        for other in self.flights.iter_mut().filter(|other| start < other.end && other.start < end) {
            self.collisions += 1;
            frame.octets_mut()[0] ^= 0xFF;
            if !other.delivered {
                other.frame.octets_mut()[0] ^= 0xFF;
            }
        }
        self.flights.push(Flight { start, end, sender: node, frame, delivered: false });
    }
    /// Who is in the ring, as each living station knows it.
    fn rings(&self) -> Vec<Vec<u8>> {
        let living = self.nodes.iter().filter(|node| node.alive);
        living.map(|node| node.active.ring().members().map(Address::get).collect()).collect()
    }
    fn seen(&self, station: u8, what: &Observation) -> usize {
        self.log.iter().filter(|(_, by, seen)| *by == station && seen == what).count()
    }
    fn holder(&self) -> Option<usize> {
        let holds = |node: &Node| [USE, DATA, STATUS].contains(&name(&node.active));
        self.nodes.iter().position(|node| node.alive && holds(node))
    }
}

#[test]
fn three_stations_build_a_ring_from_power_on() {
    let mut line = Line::new(&[9, 5, 3], 100_000);
    (0..3).for_each(|node| line.power_on(node));
    line.run(Span::from_ms(20));
    assert_eq!((line.rings(), line.collisions), ([[3, 5, 9]; 3].map(Vec::from).into(), 0));
    let first = &line.flights[0];
    let t_to = line.bus.span(line.bus.t_to(3));
    assert_eq!((first.sender, first.start - Local::ZERO), (2, t_to), "the lowest address claims, after its T_TO");
    assert_eq!(line.seen(3, &Observation::TokenClaimed), 1);
    assert_eq!([5, 9].map(|n| line.seen(n, &Observation::TokenClaimed)), [0, 0]);
    assert_eq!([3, 5, 9].map(|n| line.seen(n, &Observation::RingEntered)), [0, 1, 1]);
    assert_eq!(line.seen(3, &Observation::StationJoined { station: at(5) }), 1);
}

#[test]
fn a_station_that_dies_is_skipped_and_comes_back_through_the_gap() {
    let mut line = Line::built(&[3, 5, 9], 100_000);
    line.run_until(|line| line.holder() == Some(2));
    line.power_off(1);
    line.run(Span::from_ms(5));
    assert_eq!((line.rings(), line.collisions), ([[3, 9]; 2].map(Vec::from).into(), 0));
    assert_eq!(line.seen(3, &Observation::TokenRetry { to: at(5) }), 2, "three attempts");
    assert_eq!(line.seen(3, &Observation::TokenRetry { to: at(9) }), 1, "9 doubts a token that is not from 5");
    assert_eq!(line.seen(3, &Observation::StationLost { station: at(5) }), 1);
    line.log.clear();
    line.power_on(1);
    line.run(Span::from_ms(10));
    assert_eq!((line.rings(), line.collisions), ([[3, 5, 9]; 3].map(Vec::from).into(), 0));
    assert_eq!(line.seen(3, &Observation::StationJoined { station: at(5) }), 1);
    assert_eq!((line.seen(5, &Observation::RingEntered), line.seen(5, &Observation::TokenClaimed)), (1, 0));
    assert!(line.log.iter().all(|(_, _, seen)| !matches!(seen, Observation::TokenRetry { .. })), "9 knows 5 from 3");
}

#[test]
fn a_lost_token_is_claimed_by_the_lowest_address_and_the_ring_is_built_anew() {
    let mut line = Line::built(&[3, 5, 9], 100_000);
    line.run_until(|line| line.holder() == Some(1));
    line.power_off(1);
    line.run_until(|line| line.seen(3, &Observation::TokenClaimed) == 1);
    let claim = line.flights.iter().position(|flight| flight.frame.octets() == token(3, 3).octets()).unwrap();
    let silence = line.flights[claim].start - line.flights[claim - 1].end;
    assert_eq!(silence, line.bus.span(line.bus.t_to(3)));
    line.run(Span::from_ms(10));
    assert_eq!((line.rings(), line.collisions), ([[3, 9]; 2].map(Vec::from).into(), 0));
    assert_eq!(line.seen(9, &Observation::RingLeft { why: RingExit::Skipped }), 1, "the claim passes it over");
    assert_eq!((line.seen(9, &Observation::TokenClaimed), line.seen(9, &Observation::RingEntered)), (0, 1));
}

#[test]
fn the_last_station_goes_on_alone() {
    let mut line = Line::built(&[3, 5], 100_000);
    line.run_until(|line| line.holder() == Some(0));
    line.power_off(1);
    line.run(Span::from_ms(5));
    assert_eq!((line.rings(), line.collisions), ([[3].to_vec()].into(), 0));
    assert_eq!(line.seen(3, &Observation::TokenClaimed), 0, "the token was never lost");
    assert!(line.holder() == Some(0) || name(&line.nodes[0].active) == USE);
}

#[test]
fn a_station_whose_address_is_taken_keeps_away() {
    let mut line = Line::new(&[3, 5, 5], 100_000);
    line.power_on(0);
    line.power_on(1);
    line.run(Span::from_ms(20));
    line.power_on(2);
    line.run(Span::from_ms(20));
    assert_eq!(line.seen(5, &Observation::AddressConflict), 1);
    assert_eq!((name(&line.nodes[2].active), line.collisions), (OFFLINE, 0));
    let in_ring = |node: &Node| node.active.ring().members().map(Address::get).eq([3, 5]);
    assert!(line.nodes[..2].iter().all(in_ring));
}

#[test]
fn what_t_tr_leaves_is_for_low_priority_and_one_message_with_high_priority_always_goes() {
    let t_tr = 5_500;
    let mut line = Line::built(&[3, 5], t_tr);
    line.nodes[1].high = true;
    line.nodes.iter_mut().for_each(|node| (node.gap, node.visits) = (false, Vec::new()));
    line.run_until(|line| !line.nodes[1].visits.is_empty());
    let (mut late, mut lows) = (0, 0);
    // In turn: only the message with high priority, 5 uses what is left, nothing, 3 uses what is left.
    for round in 1..200 {
        (line.nodes[0].low, line.nodes[1].low) = (round % 4 == 3, round % 2 == 1);
        line.run_until(|line| line.nodes[1].visits.len() > round);
        let of_5 =
            |(_, by, seen): &&(_, u8, Observation)| *by == 5 && matches!(seen, Observation::TokenReceived { .. });
        let Some(&(_, _, Observation::TokenReceived { t_rr, t_th })) = line.log.iter().rev().find(of_5) else {
            panic!()
        };
        let visit = line.nodes[1].visits[round];
        assert_eq!(visit.0, 1, "one message with high priority in every visit");
        if t_th <= Span::ZERO {
            late += 1;
            assert_eq!(visit.1, 0, "nothing more where the token came late");
        }
        lows += visit.1;
        // T_RR exceeds T_TR by what each station began in time: a message, and its token.
        let longest = line.bus.span(Tbit(66 + 1_000 + 76 + 109));
        assert!(t_rr <= line.bus.span(Tbit(t_tr)) + longest * 2, "{t_rr}");
    }
    assert!(late > 10 && lows > 100, "{late} late tokens, {lows} messages with low priority");
}

#[test]
fn a_second_holder_gives_the_token_up() {
    let mut line = Line::built(&[3, 5, 9], 100_000);
    line.run_until(|line| line.holder() == Some(0));
    let mut out = Outbox::new();
    let foreign = token(7, 8);
    let heard = Heard { octets: foreign.octets(), sample: 0 };
    let now = line.now;
    assert_eq!(line.nodes[0].active.heard(now, heard, &mut out), Confirm::TokenGone);
    line.carry_out(0, &out);
    let why = RingExit::SecondToken;
    assert_eq!(line.seen(3, &Observation::TokenDropped { why }), 1);
    line.run(Span::from_ms(20));
    let rings: Vec<String> = line.rings().iter().map(|ring| alloc::format!("{ring:?}")).collect();
    assert_eq!(rings, ["[3, 5, 9]"; 3], "and the ring goes on");
}

#[test]
fn a_token_that_is_held_leaves_later_and_its_sender_waits_for_it_from_there() {
    let hold = Span::from_us(300);
    let mut active = station_in(USE);
    let begin = Local::from_ticks(1_000_000);
    let leaves = |active: &Active, out: &Outbox, at: Local, end: Local| {
        let (send, frame) = out.sending().expect("the token");
        assert_eq!((send.at, frame.octets(), name(active)), (at, &[0xDC, 9, 5][..], PASS));
        assert_eq!(end - at, BitRate::M12.octets(3));
        // T_SL counts from the last bit.
        let orders: Vec<_> = out.orders().collect();
        assert_eq!(orders, [(Timer::Slot as usize, Order::At(end))]);
    };
    active.hold_token(HoldToken(hold));
    let mut out = Outbox::new();
    let end = active.pass_token(begin, &mut out);
    assert!(out.sending().is_none() && !active.may_send());
    assert_eq!(out.orders().collect::<Vec<_>>(), [(Timer::Slot as usize, Order::At(begin + hold))]);
    out.clear();
    assert_eq!(active.slot_over(begin + hold, false, &mut out), Confirm::Nothing);
    leaves(&active, &out, begin + hold, end);

    let mut active = station_in(USE);
    active.hold_token(HoldToken(hold));
    active.hold_token(HoldToken(Span::ZERO));
    out.clear();
    let end = active.pass_token(begin, &mut out);
    leaves(&active, &out, begin, end);
}

#[test]
fn a_token_that_is_held_does_not_leave_any_more_when_another_station_has_one() {
    let hold = Span::from_ms(5);
    let mut active = station_in(USE);
    active.hold_token(HoldToken(hold));
    let (mut out, begin) = (Outbox::new(), Local::from_ticks(1_000_000));
    active.pass_token(begin, &mut out);
    out.clear();
    let mut frame = Frame::new();
    frame.set_token(Address::new(9).unwrap(), Address::new(3).unwrap());
    let telegram = Telegram::parse(frame.octets()).expect("a token");
    let confirm = active.heard_other(begin + Span::from_ms(1), Some(&telegram), &mut out);
    assert_eq!((confirm, name(&active)), (Confirm::TokenGone, IDLE));
    assert!(out.sending().is_none());
    let slot = out.orders().find(|&(which, _)| which == Timer::Slot as usize);
    assert!(matches!(slot, Some((_, Order::At(at))) if at < begin + hold), "T_TO instead: {slot:?}");
}

#[test]
fn a_ring_with_a_station_that_holds_the_token_turns_slower_and_loses_nobody() {
    let visits = |hold| {
        let mut line = Line::new(&[9, 5, 3], 100_000);
        (0..3).for_each(|node| line.power_on(node));
        line.run(Span::from_ms(20));
        line.nodes[1].active.hold_token(HoldToken(hold));
        let before = line.nodes[0].visits.len();
        line.run(Span::from_ms(40));
        let lost = line.seen(9, &Observation::TokenClaimed) + line.seen(3, &Observation::TokenClaimed);
        (line.nodes[0].visits.len() - before, lost, line.collisions)
    };
    let (free, held) = (visits(Span::ZERO), visits(Span::from_us(300)));
    assert!(held.0 > 10 && held.0 * 5 < free.0 * 3, "{free:?} {held:?}");
    assert_eq!((held.1, held.2), (free.1, free.2));
}
