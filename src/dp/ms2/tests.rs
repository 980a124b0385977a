use super::*;
use crate::wire::acyclic::{ErrorCode, Record};

const MS: Span = Span::from_ms(1);
const WORKING: Span = Span::from_ms(2);
const MASTER: Address = Address::new(1).unwrap();
const OTHER: Address = Address::new(3).unwrap();
const INITIATE: [u8; 20] = [0x57, 0, 0, 0, 0x03, 0xE8, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0];
const READ: [u8; 4] = [0x5E, 1, 47, 240];
const WRITE: [u8; 6] = [0x5F, 1, 47, 2, 7, 8];
const IDLE: [u8; 2] = [0x48, 0];
const ABORT: [u8; 4] = [0x58, 0, 0x23, 0];

fn at(ms: i64) -> Local {
    Local::ZERO + MS * ms
}

/// Record 47 of slot 1, for each connection what it has written.
#[derive(Default)]
struct Each([Vec<u8>; 3]);
impl Each {
    fn of(&mut self, access: Access) -> &mut Vec<u8> {
        match access {
            Access::Ms1 => panic!("MS2 alone"),
            Access::Ms2(sap) => &mut self.0[usize::from(sap)],
        }
    }
}
impl Records for Each {
    fn read(&mut self, access: Access, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode> {
        if record.index != 47 {
            return Err(ErrorCode::INDEX);
        }
        let written = self.of(access);
        out[..written.len()].copy_from_slice(written);
        Ok(written.len())
    }
    fn write(&mut self, access: Access, record: Record, data: &[u8]) -> Result<(), ErrorCode> {
        if record.slot != 1 {
            return Err(ErrorCode::SLOT);
        }
        *self.of(access) = data.to_vec();
        Ok(())
    }
    fn closed(&mut self, access: Access) {
        self.of(access).clear();
    }
}

/// A manager with its records, asked octet by octet.
struct Bench {
    manager: Manager,
    records: Each,
    seen: Vec<Observation>,
}
impl Bench {
    fn new() -> Self {
        let settings =
            Settings { connections: 2, max_data: 240, send_timeout: 100, working: WORKING, profile_ident: 0x3D00 };
        Self { manager: Manager::new(settings), records: Each::default(), seen: Vec::new() }
    }
    fn ask_as(&mut self, master: Address, now: Local, sap: u8, du: &[u8]) -> Result<Vec<u8>, Option<Status>> {
        let message = Message { master, ssap: Sap::MASTER_MS2, dsap: Sap(sap), du };
        let mut out = Outbox::new();
        let answer = match self.manager.heard(now, &message, &mut self.records, &mut out) {
            Answer::Acknowledge => Err(None),
            Answer::Data(pdu) => Ok(pdu.to_vec()),
            Answer::Refuse(status) => Err(Some(status)),
        };
        self.seen.extend(out.observations().copied());
        answer
    }
    fn ask(&mut self, now: Local, sap: u8, du: &[u8]) -> Result<Vec<u8>, Option<Status>> {
        self.ask_as(MASTER, now, sap, du)
    }
    fn due(&mut self, now: Local) {
        let mut out = Outbox::new();
        self.manager.due(now, &mut self.records, &mut out);
        self.seen.extend(out.observations().copied());
    }
    fn state(&self, sap: u8) -> ConnectionState {
        self.manager.state(Sap(sap)).unwrap()
    }
    /// Connection 0 in this state at instant 0; its answer is ready at 2 ms.
    fn in_state(state: ConnectionState) -> Self {
        let mut bench = Self::new();
        if state == ConnectionState::Closed {
            return bench;
        }
        bench.ask(at(-10), 49, &INITIATE).unwrap();
        if state == ConnectionState::Opening {
            bench.manager.connections[0].ready = at(2);
            bench.manager.connections[0].deadline = at(1_002);
            return bench;
        }
        bench.ask(at(0), 0, &[]).unwrap();
        match state {
            ConnectionState::Working => assert_eq!(bench.ask(at(0), 0, &WRITE), Err(None)),
            ConnectionState::Aborting => assert_eq!(bench.ask(at(0), 0, &[0x5C]), Err(None)),
            _ => {}
        }
        assert_eq!(bench.state(0), state);
        bench
    }
}
const SC: Result<Vec<u8>, Option<Status>> = Err(None);
const RS: Result<Vec<u8>, Option<Status>> = Err(Some(Status::Rs));
const RR: Result<Vec<u8>, Option<Status>> = Err(Some(Status::Rr));

/// Every state with every request; the table of the file header.
#[test]
fn states_and_requests() {
    use ConnectionState::{Aborting, Closed, Open, Opening, Working};
    let initiated = Ok([0x57, 240, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0].to_vec());
    let written = Ok([0x5F, 1, 47, 2].to_vec());
    let told = Ok([0x58, 0, 0x12, 0].to_vec());
    // Poll before and after the answer is ready, record, Idle, Initiate, a function it has not, Abort.
    let requests: [(i64, &[u8]); 7] =
        [(1, &[]), (2, &[]), (1, &READ), (1, &IDLE), (1, &INITIATE), (1, &[0x5C]), (1, &ABORT)];
    let table = [
        (Closed, [RS, RS, RS, RS, RS, RS, RS], [Closed; 7]),
        (Opening, [SC, initiated, SC, SC, SC, SC, SC], [Opening, Open, Aborting, Aborting, Aborting, Aborting, Closed]),
        (Open, [SC, SC, SC, SC, SC, SC, SC], [Open, Open, Working, Working, Aborting, Aborting, Closed]),
        (Working, [SC, written, RR, RR, RR, RR, SC], [Working, Open, Working, Working, Working, Working, Closed]),
        (
            Aborting,
            [told.clone(), told.clone(), told.clone(), told.clone(), told.clone(), told.clone(), told],
            [Closed; 7],
        ),
    ];
    for (state, answers, next) in table {
        for (((ms, du), answer), next) in requests.into_iter().zip(answers).zip(next) {
            let mut bench = Bench::in_state(state);
            assert_eq!(bench.ask_as(OTHER, at(ms), 0, du), RS, "{state}: another master, {du:02X?}");
            assert_eq!(bench.state(0), state, "{state}: another master, {du:02X?}");
            assert_eq!(bench.ask(at(ms), 0, du), answer, "{state}: {du:02X?} at {ms} ms");
            assert_eq!(bench.state(0), next, "{state}: {du:02X?} at {ms} ms");
        }
    }
}

#[test]
fn a_connection_opens_reads_writes_and_closes() {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(at(0), 49, &[]), SC, "asks for nothing");
    assert_eq!(bench.ask(at(0), 49, &INITIATE), Ok([0x56, 0, 0, 100].to_vec()));
    assert_eq!(bench.ask(at(1), 0, &[]), SC);
    assert_eq!(bench.ask(at(2), 0, &[]).unwrap()[..2], [0x57, 240]);
    for (pdu, answer) in [
        (&WRITE[..], &[0x5F, 1, 47, 2][..]),
        (&READ, &[0x5E, 1, 47, 2, 7, 8]),
        (&[0x5E, 1, 46, 240], &[0xDE, 0x80, 0xB0, 0]),
        (&[0x5F, 2, 47, 1, 0], &[0xDF, 0x80, 0xB2, 0]),
        (&[0x5F, 1, 47, 9, 0], &[0xDF, 0x80, 0xB1, 0]),
        (&[0x51, 1, 47, 1, 0], &[0xD1, 0x80, 0xA9, 0]),
        (&IDLE, &IDLE),
    ] {
        assert_eq!(bench.ask(at(10), 0, pdu), SC, "{pdu:02X?}");
        assert_eq!(bench.ask(at(12), 0, &[]), Ok(answer.to_vec()), "{pdu:02X?}");
    }
    assert_eq!(bench.ask(at(13), 0, &ABORT), SC);
    let told = bench.seen.iter().map(|seen| match seen {
        Observation::Connection { peer: MASTER, sap: Sap(0), to, why, .. } => (*to, *why),
        other => panic!("{other}"),
    });
    let causes: Vec<_> = told.collect();
    let expected = [
        (ConnectionState::Opening, ConnectionCause::Initiated),
        (ConnectionState::Open, ConnectionCause::Confirmed),
        (ConnectionState::Closed, ConnectionCause::Aborted(0x23)),
    ];
    assert_eq!(causes, expected);
    assert!(bench.records.0[0].is_empty(), "what it has written is forgotten");
    assert_eq!(bench.manager.deadline(), None);
}

#[test]
fn each_connection_has_its_own_answer_and_a_third_is_refused() {
    let mut bench = Bench::new();
    for (master, sap) in [(MASTER, 0), (OTHER, 1)] {
        assert_eq!(bench.ask_as(master, at(0), 49, &INITIATE).unwrap()[1], sap);
        assert_eq!(bench.ask_as(master, at(2), sap, &[]).unwrap()[0], 0x57);
        assert_eq!(bench.ask_as(master, at(2), sap, &[0x5F, 1, 47, 1, sap + 10]), SC);
    }
    assert_eq!(bench.ask_as(Address::new(4).unwrap(), at(3), 49, &INITIATE), RS, "no third");
    for (master, sap) in [(MASTER, 0), (OTHER, 1)] {
        assert_eq!(bench.ask_as(master, at(4), sap, &[]), Ok([0x5F, 1, 47, 1].to_vec()));
        assert_eq!(bench.ask_as(master, at(4), sap, &READ), SC);
        assert_eq!(bench.ask_as(master, at(6), sap, &[]), Ok([0x5E, 1, 47, 1, sap + 10].to_vec()));
    }
    assert_eq!(bench.ask(at(7), 0, &ABORT), SC);
    assert_eq!(bench.ask_as(Address::new(4).unwrap(), at(8), 49, &INITIATE).unwrap()[1], 0, "free again");
    assert_eq!(bench.ask_as(OTHER, at(8), 1, &IDLE), SC, "the other one lives on");
    assert_eq!(bench.ask(at(9), 2, &[]), RS, "there is no connection 2");
}

/// The supervision: send timeout after a ready answer, twice that between requests; both sides' longer one counts.
#[test]
fn silence_is_noticed_and_told() {
    let over = |state: ConnectionState, ms: i64| {
        let mut bench = Bench::in_state(state);
        assert_eq!(bench.manager.deadline(), Some(at(ms)), "{state}");
        bench.due(at(ms - 1));
        assert_eq!(bench.state(0), state, "{state}: not yet");
        bench.due(at(ms));
        bench
    };
    // The master asked for 10 s, the slave alone would take 1 s.
    let mut bench = over(ConnectionState::Open, 20_000);
    assert_eq!(bench.state(0), ConnectionState::Aborting);
    assert_eq!(bench.ask(at(20_001), 0, &READ), Ok([0x58, 0, 0x13, 0].to_vec()), "time-out");
    let mut bench = over(ConnectionState::Working, 10_002);
    assert_eq!(bench.manager.deadline(), Some(at(20_002)));
    bench.due(at(20_002));
    assert_eq!((bench.state(0), bench.manager.deadline()), (ConnectionState::Closed, None), "nobody asks any more");
    let bench = over(ConnectionState::Opening, 1_002);
    assert_eq!(bench.state(0), ConnectionState::Aborting);
    let bench = over(ConnectionState::Aborting, 10_000);
    assert_eq!(bench.state(0), ConnectionState::Closed);
}

#[test]
fn a_wrong_initiate_gets_a_connection_whose_first_answer_is_an_abort() {
    let with = |changes: &[(usize, u8)]| {
        let mut pdu = INITIATE.to_vec();
        for &(octet, value) in changes {
            pdu[octet - 1] = value;
        }
        pdu
    };
    let routed = [&with(&[(15, 1), (16, 4)])[..], &[9, 9]].concat();
    for (pdu, reason, why) in [
        (READ.to_vec(), 0x12, "no Initiate"),
        (with(&[(2, 1)]), 0x12, "a reserved octet"),
        (with(&[(14, 1)]), 0x12, "lengths that do not fit"),
        (INITIATE[..19].to_vec(), 0x12, "cut short"),
        (with(&[(13, 1)]), 0x12, "a network without its address"),
        (routed, 0x17, "routing"),
        (with(&[(19, 1)]), 0x17, "another application"),
    ] {
        let mut bench = Bench::new();
        assert_eq!(bench.ask(at(0), 49, &pdu), Ok([0x56, 0, 0, 100].to_vec()), "{why}");
        assert_eq!(bench.ask(at(0), 0, &[]), Ok([0x58, 0, reason, 0].to_vec()), "{why}");
        assert_eq!(bench.state(0), ConnectionState::Closed, "{why}");
    }
    // An end behind the master is mirrored.
    let mut bench = Bench::new();
    let caller = [1, 0, 1, 2, 3, 4, 5, 6];
    let pdu = [&INITIATE[..12], &[1, 8, 0, 2], &caller, &[0, 0]].concat();
    bench.ask(at(0), 49, &pdu).unwrap();
    let answer = bench.ask(at(2), 0, &[]).unwrap();
    assert_eq!(answer[8..], [&[0, 2, 1, 8, 0, 0][..], &caller].concat());
}

#[test]
fn send_timeouts_follow_the_rate() {
    let rates = [BitRate::M12, BitRate::M1_5, BitRate::K500, BitRate::K187_5, BitRate::K9_6];
    assert_eq!(rates.map(send_timeout), [100, 100, 200, 400, 400]);
}

/// Octets on the line: master 2, slave 6, both with a Send_Timeout of 10 s.
#[test]
fn the_telegrams_of_an_opening() {
    use crate::wire::{Fcb, Frame, Header, Service, Telegram};
    let hex = |text: &str| -> Vec<u8> { text.split(' ').map(|octet| u8::from_str_radix(octet, 16).unwrap()).collect() };
    let settings =
        Settings { connections: 2, max_data: 240, send_timeout: 1_000, working: WORKING, profile_ident: 0x3D00 };
    let (mut manager, mut records, mut out) = (Manager::new(settings), Each::default(), Outbox::new());
    let slave = Address::new(6).unwrap();
    let master = Address::new(2).unwrap();
    let client_settings = client::Settings { send_timeout: 1_000, response_timeout: MS * 3_000, profile_ident: 0x3D00 };
    let mut client = client::Client::new(slave, client_settings);
    client.connect(at(0), &mut out);
    for (fcb, request, reply) in [
        (
            Fcb::Alternate(false),
            "68 19 19 68 86 82 5C 31 32 57 00 00 00 03 E8 01 00 00 00 3D 00 00 02 00 02 00 00 00 00 4B 16",
            "68 09 09 68 82 86 08 32 31 56 00 03 E8 B4 16",
        ),
        (
            Fcb::Alternate(true),
            "68 05 05 68 86 82 7C 00 32 B6 16",
            "68 15 15 68 82 86 08 32 00 57 F0 01 00 00 00 3D 00 00 02 00 02 00 00 00 00 CB 16",
        ),
    ] {
        let sending = client.next(at(0)).unwrap();
        let header = Header::request(slave, master, Service::SrdLow, fcb).with_saps(sending.sap, Sap::MASTER_MS2);
        let mut frame = Frame::new();
        frame.set_data(&header, sending.du).unwrap();
        assert_eq!(frame.octets(), hex(request));
        let Ok(Telegram::Data { header, du }) = frame.telegram() else { panic!("a request") };
        let message = Message { master: header.sa, ssap: header.ssap.unwrap(), dsap: header.dsap.unwrap(), du };
        let Answer::Data(pdu) = manager.heard(at(5), &message, &mut records, &mut out) else { panic!("an answer") };
        let mut answer = Frame::new();
        answer.set_data(&header.slave_reply(Status::Dl), pdu).unwrap();
        assert_eq!(answer.octets(), hex(reply));
        client.answered(at(5), Ok(Some(pdu)), &mut out);
        manager.connections[0].ready = at(5);
    }
    assert_eq!(client.state(), ConnectionState::Open);
    assert_eq!(manager.state(Sap(0)), Some(ConnectionState::Open));
}
