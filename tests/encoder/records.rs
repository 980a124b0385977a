//! Manual 4: the parameters over MS1, octet by octet.

use isodp::time::Span;
use isodp::wire::Status;

use crate::rig::{MASTER, MS1, MS2, MS2_RM, PRM, Reply, Rig, SET_PRM, STRANGER, prm};

/// Sends a PDU and polls for its answer.
fn asked(rig: &mut Rig, pdu: &[u8]) -> Vec<u8> {
    assert_eq!(rig.srd(MS1, pdu), Reply::Ack, "{pdu:02X?}");
    for _ in 0..50 {
        match rig.srd(MS1, &[]) {
            Reply::Ack => {}
            Reply::Data(MASTER, answer) => return answer,
            other => panic!("{other:?}"),
        }
    }
    panic!("no answer within 5 ms");
}
/// Writes a request of the parameter channel and reads its response.
fn parameter(rig: &mut Rig, request: &[u8]) -> Vec<u8> {
    let head = [0x5F, 1, 47, request.len() as u8];
    assert_eq!(asked(rig, &[&head, request].concat()), head);
    let answer = asked(rig, &[0x5E, 1, 47, 240]);
    assert_eq!((&answer[..3], usize::from(answer[3])), (&[0x5E, 1, 47][..], answer.len() - 4));
    answer[4..].to_vec()
}
fn hex(text: &str) -> Vec<u8> {
    text.split(' ').map(|octet| u8::from_str_radix(octet, 16).expect("an octet")).collect()
}

#[test]
fn section_4_the_five_parameters_read_as_real_devices_answer() {
    let mut rig = Rig::exchanging(&PRM);
    for (request, response) in [
        ("01 01 00 01 10 01 03 96 00 00", "01 01 00 01 06 01 00 06"),
        ("02 01 00 01 10 01 03 9A 00 00", "02 01 00 01 06 01 00 51"),
        ("03 01 00 01 10 06 03 C4 00 00", "03 01 00 01 06 06 00 00 06 DF 01 01 07 D7 00 65 00 01"),
        ("04 01 00 01 10 01 03 C5 00 00", "04 01 00 01 0A 02 03 02"),
        (
            "05 01 00 01 10 06 03 D3 00 00",
            "05 01 00 01 07 06 00 00 51 11 80 00 00 02 00 00 20 00 00 00 00 07 00 00 00 00 00 00 10 00",
        ),
        (
            "01 01 00 01 10 05 03 D3 00 01",
            "01 01 00 01 07 05 80 00 00 02 00 00 20 00 00 00 00 07 00 00 00 00 00 00 10 00",
        ),
    ] {
        assert_eq!(parameter(&mut rig, &hex(request)), hex(response), "{request}");
    }
}

#[test]
fn section_4_p979_follows_the_scaling() {
    let scaled = [(15, 0x0A), (49, 3), (18, 0), (19, 100), (20, 0), (22, 0x32), (23, 0)];
    let mut rig = Rig::exchanging(&prm(&scaled));
    // 100 units per revolution, shift 32 - 14 bits, 128 revolutions.
    let response = hex("09 01 00 01 07 04 00 00 00 64 00 00 00 12 00 00 00 00 00 00 00 80");
    assert_eq!(parameter(&mut rig, &hex("09 01 00 01 10 04 03 D3 00 02")), response);
}

#[test]
fn section_4_all_are_read_only_and_others_are_unknown() {
    let mut rig = Rig::exchanging(&PRM);
    for (request, response) in [
        ("01 02 00 01 10 01 03 96 00 00 42 01 00 07", "01 82 00 01 44 01 00 01"),
        ("01 01 00 01 10 01 03 9D 00 00", "01 81 00 01 44 01 00 00"),
        ("01 01 00 01 10 01 03 D3 00 0B", "01 81 00 01 44 01 00 03"),
        ("01 01 00 01 10 02 03 96 00 00", "01 81 00 01 44 01 00 04"),
        ("01 01 07 01 10 01 03 96 00 00", "01 81 07 01 44 01 00 19"),
    ] {
        let expected = hex(response);
        assert_eq!(parameter(&mut rig, &hex(request)), expected, "{request}");
    }
}

#[test]
fn section_4_wrong_records_get_the_code_of_dp_v1() {
    let mut rig = Rig::exchanging(&PRM);
    let good = hex("5F 01 2F 0A 01 01 00 01 10 01 03 96 00 00");
    for (pdu, answer, why) in [
        ("5E 01 2F F0", "DE 80 B5 00", "before any write"),
        ("5E 00 2F F0", "DE 80 B2 00", "slot 0"),
        ("5E 02 2F F0", "DE 80 B2 00", "slot 2"),
        ("5E 01 2E F0", "DE 80 B0 00", "index 46"),
        ("5F 02 2F 0A 01 01 00 01 10 01 03 96 00 00", "DF 80 B2 00", "slot 2"),
        ("5F 01 FF 0A 01 01 00 01 10 01 03 96 00 00", "DF 80 B0 00", "index 255"),
        ("5F 01 2F 0B 01 01 00 01 10 01 03 96 00 00", "DF 80 B1 00", "one octet more than there is"),
        ("5F 01 2F 09 01 01 00 01 10 01 03 96 00", "DF 80 B1 00", "an address cut short"),
        ("5F 01 2F 00", "DF 80 B1 00", "no request"),
        ("5F 01 2F 0A 01 03 00 01 10 01 03 96 00 00", "DF 80 B7 00", "request 03"),
        ("5E 01 2F F0", "DE 80 B5 00", "a refused write leaves nothing to read"),
        ("51 01 2F 00", "D1 80 A9 00", "a function it has not"),
    ] {
        assert_eq!(asked(&mut rig, &hex(pdu)), hex(answer), "{why}");
    }
    assert_eq!(asked(&mut rig, &good), hex("5F 01 2F 0A"));
    assert_eq!(asked(&mut rig, &hex("5E 01 2F 07")), hex("DE 80 C0 00"), "8 octets do not fit into 7");
    assert_eq!(asked(&mut rig, &hex("5E 01 2F 08")), hex("5E 01 2F 08 01 01 00 01 06 01 00 06"));
}

#[test]
fn section_4_one_request_at_a_time_and_none_outlives_data_exchange() {
    let mut rig = Rig::exchanging(&PRM);
    let read = [0x5E, 1, 47, 240];
    assert_eq!(rig.srd(MS1, &read), Reply::Ack);
    assert_eq!(rig.srd(MS1, &read), Reply::Status(Status::Rr), "busy");
    parameter_survives(&mut rig);
    let _ = parameter(&mut rig, &hex("01 01 00 01 10 01 03 96 00 00"));
    rig.srd(SET_PRM, &PRM);
    assert_eq!(rig.srd(MS1, &read), Reply::Status(Status::Rs), "closed outside of data exchange");
    rig.srd(crate::rig::CHK_CFG, &crate::rig::CFG);
    assert_eq!(asked(&mut rig, &read), hex("DE 80 B5 00"), "the old answer is forgotten");
}
/// The answer of the first request comes although a second one was refused.
fn parameter_survives(rig: &mut Rig) {
    rig.advance(rig.now + Span::from_ms(3));
    assert_eq!(rig.srd(MS1, &[]), Reply::Data(MASTER, hex("DE 80 B5 00")));
}

#[test]
fn section_4_without_dpv1_enable_the_access_point_is_closed() {
    let mut rig = Rig::exchanging(&prm(&[(8, 0x40)]));
    assert_eq!(rig.srd(MS1, &[0x5E, 1, 47, 240]), Reply::Status(Status::Rs));
    assert!(matches!(rig.exchange(&[0; 4]), Reply::Data(..)));
}

const INITIATE: [u8; 20] = [0x57, 0, 0, 0, 0, 100, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0];

/// A class 2 master opens connection `which`.
fn connect(rig: &mut Rig, station: u8, which: usize) {
    assert_eq!(rig.srd_from(station, MS2_RM, &INITIATE), Reply::Data(station, vec![0x56, which as u8, 0, 100]));
    let answer = polled(rig, station, which);
    assert_eq!(answer, hex("57 F0 01 00 00 00 3D 00 00 02 00 02 00 00 00 00"));
}
/// Polls connection `which` for its answer.
fn polled(rig: &mut Rig, station: u8, which: usize) -> Vec<u8> {
    for _ in 0..50 {
        match rig.srd_from(station, MS2[which], &[]) {
            Reply::Ack => {}
            Reply::Data(to, answer) if to == station => return answer,
            other => panic!("{other:?}"),
        }
    }
    panic!("no answer within 5 ms");
}
fn asked_over(rig: &mut Rig, station: u8, which: usize, pdu: &[u8]) -> Vec<u8> {
    assert_eq!(rig.srd_from(station, MS2[which], pdu), Reply::Ack, "{pdu:02X?}");
    polled(rig, station, which)
}

#[test]
fn section_4_a_class_2_master_reads_whatever_the_master_does() {
    let mut rig = Rig::new();
    connect(&mut rig, STRANGER, 0);
    let write = hex("5F 01 2F 0A 01 01 00 01 10 01 03 96 00 00");
    let answer = hex("5E 01 2F 08 01 01 00 01 06 01 00 06");
    assert_eq!(asked_over(&mut rig, STRANGER, 0, &write), hex("5F 01 2F 0A"), "before anybody has parameterised it");
    assert_eq!(rig.srd(SET_PRM, &PRM), Reply::Ack);
    assert_eq!(rig.srd(crate::rig::CHK_CFG, &crate::rig::CFG), Reply::Ack);
    assert_eq!(asked_over(&mut rig, STRANGER, 0, &[0x5E, 1, 47, 240]), answer, "its answer outlives the start-up");
    rig.srd(SET_PRM, &PRM);
    assert_eq!(asked_over(&mut rig, STRANGER, 0, &[0x5E, 1, 47, 240]), answer, "and the end of data exchange");
    assert_eq!(rig.srd_from(STRANGER, MS1, &[0x5E, 1, 47, 240]), Reply::Status(Status::Rs), "MS1 is not for it");
}

#[test]
fn section_4_each_connection_has_its_own_parameter_channel() {
    let mut rig = Rig::exchanging(&PRM);
    connect(&mut rig, STRANGER, 0);
    connect(&mut rig, 7, 1);
    assert_eq!(rig.srd_from(8, MS2_RM, &INITIATE), Reply::Status(Status::Rs), "no third connection");
    let request = |reference: u8| [0x5F, 1, 47, 10, reference, 1, 0, 1, 0x10, 1, 3, 0x96, 0, 0];
    assert_eq!(asked(&mut rig, &request(1)), hex("5F 01 2F 0A"));
    assert_eq!(asked_over(&mut rig, STRANGER, 0, &request(2)), hex("5F 01 2F 0A"));
    assert_eq!(asked_over(&mut rig, 7, 1, &[0x5E, 1, 47, 240]), hex("DE 80 B5 00"), "it has asked for nothing");
    assert_eq!(asked_over(&mut rig, 7, 1, &request(3)), hex("5F 01 2F 0A"));
    let read = [0x5E, 1, 47, 240];
    let answers = [asked(&mut rig, &read), asked_over(&mut rig, STRANGER, 0, &read), asked_over(&mut rig, 7, 1, &read)];
    assert_eq!(answers.map(|answer| answer[4]), [1, 2, 3]);
}

#[test]
fn section_4_a_connection_without_requests_is_aborted() {
    let mut rig = Rig::exchanging(&PRM);
    connect(&mut rig, STRANGER, 0);
    rig.advance(rig.now + Span::from_ms(1_999));
    assert_eq!(asked_over(&mut rig, STRANGER, 0, &[0x48, 0]), [0x48, 0], "twice the send timeout is not over");
    rig.advance(rig.now + Span::from_ms(2_000));
    assert_eq!(rig.srd_from(STRANGER, MS2[0], &[0x48, 0]), Reply::Data(STRANGER, hex("58 00 13 00")), "time-out");
    assert_eq!(rig.srd_from(STRANGER, MS2[0], &[]), Reply::Status(Status::Rs), "closed");
    connect(&mut rig, STRANGER, 0);
    rig.advance(rig.now + Span::from_ms(3_001));
    assert_eq!(rig.srd_from(STRANGER, MS2[0], &[]), Reply::Status(Status::Rs), "closed without telling anybody");
}
