use super::*;
use crate::fdl::{Heard, Order};
use crate::time::{BitRate, Tbit};
use crate::wire::acyclic::Function;
use crate::wire::{Frame, FrameControl, Telegram};

const OWN: Address = Address::new(1).unwrap();
const INITIATED: [u8; 16] = [0x57, 240, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0];
const READ: [u8; 4] = [0x5E, 1, 47, 240];

/// Always the same task for every slave; what became of it is kept.
#[derive(Clone, Debug)]
struct Fake {
    task: Option<Task>,
    ended: Vec<(usize, Result<usize, Failure>)>,
}
impl Application for Fake {
    fn power_on(&mut self, _now: Local) {}
    fn next(&mut self, _now: Local, _slave: usize, _out: &mut Outbox) -> Option<Task> {
        self.task
    }
    fn done(&mut self, _now: Local, slave: usize, answer: Result<&[u8], Failure>, _out: &mut Outbox) {
        self.ended.push((slave, answer.map(<[u8]>::len)));
    }
}

/// What is on the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Sent {
    Token,
    Gap,
    /// To this slave and SAP, with high priority or not; the function of its PDU.
    Request(u8, u8, bool, Option<Function>),
}

/// What it asks of every connection.
const fn ms2() -> client::Settings {
    client::Settings { send_timeout: 100, response_timeout: Span::from_s(1), profile_ident: 0x3D00 }
}

/// A station with its timers, and slaves that answer at once: 3 and 4, which have one connection at SAP 0.
struct Bench {
    station: Class2<Fake>,
    now: Local,
    timers: [Option<Local>; Timer::ALL.len()],
    sent: Vec<Sent>,
    /// For each slave the function of its last PDU.
    last: [u8; 5],
}
impl Bench {
    fn new(task: Option<Task>, per_token: u8, t_tr: u32) -> Self {
        let mut bus = BusParams::profile(BitRate::M12);
        (bus.hsa, bus.t_tr) = (4, Tbit(t_tr));
        let slaves = [3, 4].into_iter().filter_map(Address::new).map(|slave| (slave, ms2())).collect();
        let settings = Settings { address: OWN, bus, per_token, slaves };
        let station = Class2::new(settings, Fake { task, ended: Vec::new() });
        let mut bench =
            Self { station, now: Local::ZERO, timers: [None; Timer::ALL.len()], sent: Vec::new(), last: [0; 5] };
        bench.step(Input::PowerOn);
        bench
    }
    fn step(&mut self, input: Input<'_, HoldToken>) {
        let mut out = Outbox::new();
        self.station.step(self.now, input, &mut out);
        for (which, order) in out.orders() {
            self.timers[which] = if let Order::At(at) = order { Some(at) } else { None };
        }
        let Some((send, frame)) = out.sending() else { return };
        let telegram = frame.telegram().expect("a telegram");
        self.sent.push(sent(&telegram));
        let end = send.at + BitRate::M12.octets(frame.len());
        if let Some(reply) = reply(&telegram, &mut self.last) {
            self.now = end + BitRate::M12.span(Tbit(11)) + BitRate::M12.octets(reply.len());
            self.step(Input::Telegram(Heard { octets: reply.octets(), sample: 0 }));
        }
    }
    /// The next deadline.
    fn wait(&mut self) {
        let due = Timer::ALL.into_iter().filter_map(|timer| Some((self.timers[timer as usize]?, timer))).min();
        let (at, timer) = due.expect("a deadline");
        self.now = self.now.max(at);
        self.timers[timer as usize] = None;
        self.step(Input::Deadline { timer, busy: false });
    }
    /// What is sent from here to so many tokens later, between the tokens.
    fn visits(&mut self, tokens: usize) -> Vec<Vec<Sent>> {
        self.sent.clear();
        while self.sent.iter().filter(|&&sent| sent == Sent::Token).count() < tokens {
            self.wait();
        }
        self.sent.split(|&sent| sent == Sent::Token).take(tokens).map(<[_]>::to_vec).collect()
    }
}
fn sent(telegram: &Telegram<'_>) -> Sent {
    match telegram {
        Telegram::Token { .. } => Sent::Token,
        Telegram::Data { header, du } => match header.fc {
            FrameControl::Request { service: Service::FdlStatus, .. } => Sent::Gap,
            FrameControl::Request { service, .. } => {
                let sap = header.dsap.map_or(0xFF, |sap| sap.0);
                let function = du.first().copied().and_then(Function::from_code);
                Sent::Request(header.da.get(), sap, service == Service::SrdHigh, function)
            }
            FrameControl::Response { .. } => panic!("a master asks"),
        },
        Telegram::ShortAck => panic!("a master asks"),
    }
}
/// What the slaves answer: a poll finds the answer to their `last` PDU at once.
fn reply(request: &Telegram<'_>, last: &mut [u8; 5]) -> Option<Frame> {
    let Telegram::Data { header, du } = request else { return None };
    let (true, Some(dsap)) = ([3, 4].contains(&header.da.get()), header.dsap) else { return None };
    let last = &mut last[usize::from(header.da.get())];
    let mut frame = Frame::new();
    let data: &[u8] = match (dsap, *du) {
        (Sap::SLAVE_DIAG, _) => &[0, 0x0C, 0, 2, 0x06, 0xDF],
        (Sap::MS2_RM, _) => &[0x56, 0, 0, 100],
        (_, []) if *last == Function::Initiate.code() => &INITIATED,
        (_, []) => &[0x5E, 1, 47, 1, 9],
        (..) => {
            frame.set_short_ack();
            &[]
        }
    };
    *last = du.first().copied().unwrap_or(*last);
    if !data.is_empty() {
        frame.set_data(&header.slave_reply(Status::Dl), data).expect("a reply");
    }
    Some(frame)
}

/// Alone on the line: claimed after T_TO, then one message with each token.
#[test]
fn a_connection_is_opened_with_the_first_request() {
    let mut bench = Bench::new(Some(Task::Record(Pdu::from_octets(&READ))), 1, 100_000);
    let visits = bench.visits(8);
    let messages: Vec<_> = visits.into_iter().flatten().filter(|sent| *sent != Sent::Gap).collect();
    let expected = [
        Sent::Request(3, 49, false, Some(Function::Initiate)),
        Sent::Request(4, 49, false, Some(Function::Initiate)),
        Sent::Request(3, 0, false, None),
        Sent::Request(4, 0, false, None),
        Sent::Request(3, 0, false, Some(Function::Read)),
        Sent::Request(4, 0, false, Some(Function::Read)),
    ];
    assert_eq!(messages[..expected.len()], expected, "the slaves in turn");
    assert_eq!(bench.station.connection(0), ConnectionState::Working);
    bench.visits(2);
    assert_eq!(bench.station.app.ended, [(0, Ok(5)), (1, Ok(5))]);
}

#[test]
fn a_token_visit_has_as_many_messages_as_it_may() {
    for per_token in 1..=4 {
        let mut bench = Bench::new(Some(Task::Read(AcyclicService::Diagnosis)), per_token, 100_000);
        bench.visits(3);
        for visit in bench.visits(10) {
            let messages = visit.iter().filter(|&&sent| sent != Sent::Gap).count();
            assert_eq!(messages, usize::from(per_token), "{visit:?}");
        }
    }
}

/// T_TR of 256 t_bit is less than any message cycle: after a visit with a message T_TH is used up at the next.
#[test]
fn low_priority_waits_for_t_th_and_one_message_with_high_priority_does_not() {
    let messages = |task| {
        let mut bench = Bench::new(Some(task), 4, 256);
        bench.visits(3);
        let visits = bench.visits(10);
        visits.iter().map(|visit| visit.iter().filter(|&&sent| sent != Sent::Gap).count()).collect::<Vec<_>>()
    };
    let low = messages(Task::Record(Pdu::from_octets(&READ)));
    assert!(low.windows(2).all(|pair| pair[0] + pair[1] == 1), "every second visit: {low:?}");
    let high = messages(Task::Read(AcyclicService::Diagnosis));
    assert!(high.iter().all(|&count| count == 1), "one in every visit: {high:?}");
}

#[test]
fn without_work_the_token_goes_round_and_the_gap_is_polled() {
    let mut bench = Bench::new(None, 1, 100_000);
    bench.visits(3);
    let polls = bench.visits(100).into_iter().flatten().filter(|&sent| sent == Sent::Gap).count();
    assert_eq!(polls, 10, "G = 10");
}

/// Another master sends while an answer is awaited: the token is gone, and with it the answer.
#[test]
fn a_lost_token_ends_the_message() {
    for (task, ended) in [
        (Task::Read(AcyclicService::Diagnosis), &[(0, Err(Failure::Timeout))][..]),
        (Task::Record(Pdu::from_octets(&READ)), &[]),
    ] {
        let mut bench = Bench::new(Some(task), 1, 100_000);
        bench.station.settings.slaves.clear();
        // Slaves that are not there: the answer is awaited.
        bench.station.partners.truncate(1);
        bench.station.partners[0].connection = Client::new(Address::new(2).expect("an address"), ms2());
        while !matches!(bench.station.part, Part::Message(0)) {
            bench.wait();
        }
        let mut token = Frame::new();
        token.set_token(Address::new(4).expect("an address"), Address::new(3).expect("an address"));
        bench.now += Span::from_us(20);
        bench.step(Input::Telegram(Heard { octets: token.octets(), sample: 0 }));
        assert_eq!((bench.station.part, &bench.station.app.ended[..]), (Part::Away, ended));
    }
}
