//! Worked telegrams, in both directions, and what holds for all octets.
//!
//! Master 2, encoder 6, telegram 81. The frames come from devices and from a trace of a real start-up.

use super::acyclic::{self, Abort, Ends, ErrorCode, Function, InitiateReq, InitiateRes, Negative, Record};
use super::config::{self, TELEGRAM_81};
use super::control::GlobalControl;
use super::diag::{DiagStatus, Diagnosis};
use super::drive::{G1Stw, G1Zsw, Inputs81, Outputs81, SignOfLife, Stw2, Zsw2};
use super::parameter::{self, ParameterAddress, RequestId};
use super::prm::{
    BlockType, DpV1Status, DxbLink, DxbLinks, DxbSubscription, DxbSubscriptions, EncoderOptions, IsoM, PrmBuilder,
    PrmError, PrmRule, SetPrm, StationStatus, UserPrm81,
};
use super::*;
use alloc::string::ToString;
use alloc::vec::Vec;
use proptest::prelude::*;

fn hex(text: &str) -> Vec<u8> {
    text.split([' ', '|'])
        .filter(|octet| !octet.is_empty())
        .map(|octet| u8::from_str_radix(octet, 16).unwrap())
        .collect()
}
fn address(number: u8) -> Address {
    Address::new(number).unwrap()
}
fn master() -> Address {
    address(2)
}
fn encoder() -> Address {
    address(6)
}
const SRD: Service = Service::SrdHigh;
const EVEN: Fcb = Fcb::Alternate(false);
const ODD: Fcb = Fcb::Alternate(true);

fn request(service: Service, fcb: Fcb) -> Header {
    Header::request(encoder(), master(), service, fcb)
}
fn request_at(sap: Sap, service: Service, fcb: Fcb) -> Header {
    let masters = match sap {
        Sap::MS1 => Sap::MASTER_MS1,
        sap if sap <= Sap::MS2_RM => Sap::MASTER_MS2,
        _ => Sap::MASTER_MS0,
    };
    request(service, fcb).with_saps(sap, masters)
}
fn reply_at(sap: Sap) -> Header {
    request_at(sap, SRD, Fcb::First).slave_reply(Status::Dl)
}

/// The frame is exactly this header and data unit, read and written.
#[track_caller]
fn data(text: &str, header: Header, du: &[u8]) {
    let octets = hex(text);
    assert_eq!(Telegram::parse(&octets), Ok(Telegram::Data { header, du }), "{text}");
    let mut frame = Frame::new();
    frame.set_data(&header, du).unwrap();
    assert_eq!(frame.octets(), octets, "{text}");
}

#[test]
fn global_controls() {
    let header = Header::request(Address::BROADCAST, master(), Service::SdnHigh, Fcb::Unused)
        .with_saps(Sap::GLOBAL_CONTROL, Sap::MASTER_MS0);
    let sync_1 = GlobalControl { sync: true, groups: 1, ..GlobalControl::OPERATE };
    let freeze_1 = GlobalControl { freeze: true, groups: 1, ..GlobalControl::OPERATE };
    for (text, control) in [
        ("68 07 07 68 FF 82 46 3A 3E 00 80 BF 16", GlobalControl::SYNCH),
        ("68 07 07 68 FF 82 46 3A 3E 00 00 3F 16", GlobalControl::OPERATE),
        ("68 07 07 68 FF 82 46 3A 3E 02 00 41 16", GlobalControl::CLEAR),
        ("68 07 07 68 FF 82 46 3A 3E 20 01 60 16", sync_1),
        ("68 07 07 68 FF 82 46 3A 3E 08 01 48 16", freeze_1),
    ] {
        data(text, header, &control.emit());
        assert_eq!(GlobalControl::parse(&control.emit()), Ok(control));
    }
    // The one of the real trace comes from master 1.
    let header = Header { sa: address(1), ..header };
    data("68 07 07 68 FF 81 46 3A 3E 00 00 3E 16", header, &GlobalControl::OPERATE.emit());
}

#[test]
fn tokens_and_short_acknowledgement() {
    for (text, telegram) in [
        ("DC 02 02", Telegram::Token { da: master(), sa: master() }),
        ("DC 05 02", Telegram::Token { da: address(5), sa: master() }),
        ("E5", Telegram::ShortAck),
    ] {
        assert_eq!(Telegram::parse(&hex(text)), Ok(telegram));
        let mut frame = Frame::new();
        telegram.emit(&mut frame).unwrap();
        assert_eq!(frame.to_string(), text);
    }
}

#[test]
fn fdl_status_and_its_replies() {
    data("10 03 02 49 4E 16", Header::request(address(3), master(), Service::FdlStatus, Fcb::Unused), &[]);
    for (text, station) in [
        ("10 02 03 00 05 16", StationType::Slave),
        ("10 02 03 10 15 16", StationType::MasterNotReady),
        ("10 02 03 20 25 16", StationType::MasterReady),
        ("10 02 03 30 35 16", StationType::MasterInRing),
    ] {
        let fc = FrameControl::Response { station, status: Status::Ok };
        data(text, Header { da: master(), sa: address(3), dsap: None, ssap: None, fc }, &[]);
    }
}

#[test]
fn slave_diag() {
    data("68 05 05 68 86 82 6D 3C 3E EF 16", request_at(Sap::SLAVE_DIAG, SRD, Fcb::First), &[]);
    let waiting = DiagStatus::STATION_NOT_READY | DiagStatus::BY_SLAVE | DiagStatus::PRM_REQ;
    let ready = DiagStatus::WD_ON | DiagStatus::BY_SLAVE;
    for (text, status, master) in [
        ("68 0B 0B 68 82 86 08 3E 3C 02 05 00 FF 80 F9 09 16", waiting, None),
        ("68 0B 0B 68 82 86 08 3E 3C 00 0C 00 02 80 F9 11 16", ready, Some(master())),
        ("68 0B 0B 68 82 86 08 3E 3C 42 05 00 FF 80 F9 49 16", waiting | DiagStatus::PRM_FAULT, None),
        ("68 0B 0B 68 82 86 08 3E 3C 06 05 00 FF 80 F9 0D 16", waiting | DiagStatus::CFG_FAULT, None),
    ] {
        let diagnosis = Diagnosis { status, master, ident: 0x80F9, extended: &[] };
        data(text, reply_at(Sap::SLAVE_DIAG), &diagnosis.emit());
        assert_eq!(Diagnosis::parse(&diagnosis.emit()), Ok(diagnosis));
    }
}

#[test]
fn configurations() {
    data("68 05 05 68 86 82 7D 3B 3E FE 16", request_at(Sap::GET_CFG, SRD, ODD), &[]);
    data("68 0B 0B 68 82 86 08 3E 3B C3 C1 C5 FD 00 51 20 16", reply_at(Sap::GET_CFG), &TELEGRAM_81);
    data("68 0B 0B 68 86 82 7D 3E 3E C3 C1 C5 FD 00 51 98 16", request_at(Sap::CHK_CFG, SRD, ODD), &TELEGRAM_81);
}

/// The example's isochronous block: 2 ms, `T_I` 125 µs, `T_O` 375 µs, `T_DX` of three encoders.
const ISO: IsoM = IsoM {
    version: 1,
    t_base_dp: 1500,
    t_dp: 16,
    t_mapc: 1,
    t_base_io: 1500,
    t_i: 1,
    t_o: 3,
    t_dx: 2674,
    t_pll_w: 12,
    t_pll_d: 0,
};
const USER: UserPrm81 = UserPrm81 {
    options: EncoderOptions::SCALING,
    units_per_revolution: 8192,
    total_range: 0x0200_0000,
    max_failures: 1,
    reserved: [0; 7],
};
const BLOCKS: &str = "15 81 00 00 08 00 00 20 00 02 00 00 00 01 00 00 00 00 00 00 00 | \
    1C 04 00 00 01 00 00 05 DC 00 10 01 00 00 05 DC 00 01 00 03 00 00 0A 72 00 0C 00 00";

#[test]
fn set_prm_with_and_without_publisher() {
    let dpv1 = DpV1Status::DPV1_ENABLE | DpV1Status::FAIL_SAFE | DpV1Status::PRM_STRUCTURE | DpV1Status::ISOM_REQ;
    for (octets, sum, min_tsdr, dpv1) in [
        ("88 14 01 0B 80 F9 80 | C0 00 18", "9A", 11, dpv1),
        ("88 14 01 4C 80 F9 80 | E0 00 18", "FB", 76, dpv1 | DpV1Status::PUBLISHER_ENABLE),
    ] {
        let fixed = SetPrm {
            status: StationStatus::LOCK | StationStatus::WD_ON,
            wd_fact_1: 20,
            wd_fact_2: 1,
            min_tsdr,
            ident: 0x80F9,
            group: 0x80,
            dpv1,
            blocks: &[],
        };
        let built = PrmBuilder::new(&fixed).and_then(|prm| prm.user_81(&USER)).and_then(|prm| prm.iso_m(&ISO)).unwrap();
        assert_eq!(built.octets().len(), 59);
        let text = alloc::format!("68 40 40 68 86 82 5D 3D 3E | {octets} | {BLOCKS} | {sum} 16");
        data(&text, request_at(Sap::SET_PRM, SRD, EVEN), built.octets());

        let prm = SetPrm::parse(built.octets()).unwrap();
        assert_eq!(SetPrm { blocks: &[], ..prm }, fixed);
        assert_eq!((prm.watchdog_units(), prm.watchdog_base_ms()), (Some(20), 10));
        assert_eq!(prm.check(), Ok(()));
        let blocks: Vec<_> = prm.blocks().map(Result::unwrap).collect();
        let places: Vec<_> = blocks.iter().map(|block| (block.octet, block.kind)).collect();
        assert_eq!(places, [(11, BlockType::User), (32, BlockType::IsoM)]);
        assert_eq!(UserPrm81::parse(&blocks[0]), Ok(USER));
        assert_eq!(IsoM::parse(&blocks[1]), Ok(ISO));
        assert_eq!(ISO.check(32), Ok(()));
        assert!(!USER.scaled(), "bit 3 alone scales nothing");
    }
}

#[test]
fn set_prm_of_a_real_master() {
    let prm = hex("B8 0D 0F 0B 80 E0 00 C0 00 00");
    let prm = SetPrm::parse(&prm).unwrap();
    assert_eq!(prm.status.to_string(), "Lock_Req, Sync_Req, Freeze_Req, WD_On");
    assert_eq!(prm.dpv1.to_string(), "DPV1_Enable, Fail_Safe");
    // 1.95 s.
    assert_eq!(prm.watchdog_units(), Some(195));
    assert_eq!((prm.min_tsdr, prm.ident, prm.group), (11, 0x80E0, 0));
}

#[test]
fn set_prm_errors_name_the_octet_of_the_manuals() {
    let base = "88 14 01 0B 80 F9 80 | C0 00 18 |";
    let first = |blocks: &str| {
        let octets = hex(&alloc::format!("{base} {blocks}"));
        SetPrm::parse(&octets).unwrap().blocks().find_map(Result::err)
    };
    assert_eq!(first(BLOCKS), None);
    assert_eq!(first("04 81 00 00 | 03 04 00 00"), Some(PrmError::new(15, PrmRule::BlockLength, 3u8)));
    assert_eq!(first("1C 04 00 00 01"), Some(PrmError::new(11, PrmRule::BlockLength, 28u8)));
    assert_eq!(first("00"), Some(PrmError::new(11, PrmRule::BlockLength, 0u8)));
    for len in [0, 6, 8, 9] {
        assert_eq!(SetPrm::parse(&[0; 9][..len]).map_err(|error| error.rule), Err(PrmRule::Length));
    }
    assert!(SetPrm::parse(&[0; 7]).is_ok());
    for (iso, octet, rule, value) in [
        (IsoM { t_base_dp: 1000, ..ISO }, 37, PrmRule::TimeBase, 1000),
        (IsoM { t_base_io: 0, ..ISO }, 44, PrmRule::TimeBase, 0),
        (IsoM { t_dp: 3, ..ISO }, 41, PrmRule::TDp, 3),
        (IsoM { t_dp: 257, ..ISO }, 41, PrmRule::TDp, 257),
        (IsoM { t_mapc: 15, ..ISO }, 43, PrmRule::TMapc, 15),
        (IsoM { t_pll_w: 0, ..ISO }, 56, PrmRule::TPllW, 0),
    ] {
        assert_eq!(iso.check(32), Err(PrmError { octet, rule, value }));
    }
    let error = IsoM { t_mapc: 15, ..ISO }.check(32).unwrap_err();
    assert_eq!(error.to_string(), "octet 43 is 15, but T_MAPC is 1 to 14 in T_DP");
    let no_watchdog = SetPrm { status: StationStatus::WD_ON, wd_fact_1: 1, ..SetPrm::default() };
    assert_eq!(no_watchdog.check(), Err(PrmError { octet: 3, rule: PrmRule::Watchdog, value: 0 }));
    let reserved = SetPrm { dpv1: DpV1Status::from_octets([0, 2, 0]), ..SetPrm::default() };
    assert_eq!(reserved.check(), Err(PrmError { octet: 9, rule: PrmRule::DpV1Reserved, value: 2 }));
}

#[test]
fn dxb_tables() {
    let link = DxbLink { publisher: 6, length: 12, offset: 4, sample: 4 };
    let subscription = DxbSubscription { link, slot: 1, destination: 0 };
    let fixed = SetPrm { dpv1: DpV1Status::PRM_STRUCTURE, ..SetPrm::default() };
    let built = PrmBuilder::new(&fixed).and_then(|prm| prm.dxb_links(&[link]));
    let built = built.and_then(|prm| prm.dxb_subscriptions(&[subscription])).unwrap();
    assert_eq!(built.octets()[10..], hex("09 03 00 00 01 06 0C 04 04 | 0B 07 00 00 01 06 0C 04 01 00 04"));
    let blocks: Vec<_> = SetPrm::parse(built.octets()).unwrap().blocks().map(Result::unwrap).collect();
    let links = DxbLinks::parse(&blocks[0]).unwrap();
    assert!(links.iter().eq([link]));
    assert_eq!(links.check(244), Ok(()));
    assert_eq!(links.check(3), Err(PrmError { octet: 19, rule: PrmRule::DxbSample, value: 4 }));
    let subscriptions = DxbSubscriptions::parse(&blocks[1]).unwrap();
    assert!(subscriptions.iter().eq([subscription]));
    // The second table begins at octet 20, its sample length is the sixth octet of the entry.
    assert_eq!(subscriptions.check(3), Err(PrmError { octet: 30, rule: PrmRule::DxbSample, value: 4 }));
    for (link, octet, rule, value) in [
        (DxbLink { publisher: 126, ..link }, 1, PrmRule::DxbPublisher, 126),
        (DxbLink { length: 0, ..link }, 2, PrmRule::DxbPublisherLength, 0),
        (DxbLink { length: 245, ..link }, 2, PrmRule::DxbPublisherLength, 245),
        (DxbLink { offset: 12, ..link }, 3, PrmRule::DxbOffset, 12),
        (DxbLink { sample: 9, ..link }, 4, PrmRule::DxbSample, 9),
    ] {
        assert_eq!(link.check(1, 244), Err(PrmError { octet, rule, value }));
    }
}

#[test]
fn data_exchange() {
    let outputs =
        Outputs81 { stw2: Stw2::default().with_sign_of_life(SignOfLife::FIRST), g1_stw: G1Stw::ABSOLUTE_VALUE };
    let inputs = Inputs81 {
        zsw2: Zsw2::default().with_sign_of_life(SignOfLife::new(3).unwrap()),
        g1_zsw: G1Zsw::ABSOLUTE_VALUE,
        xist1: 0x0001_2345 << 7,
        xist2: 0x0001_2345,
    };
    let dx = request(SRD, ODD);
    data("68 07 07 68 06 02 7D 10 00 20 00 B5 16", dx, &outputs.emit());
    let response = "68 0F 0F 68 02 06 08 30 00 20 00 00 91 A2 80 00 01 23 45 7C 16";
    data(response, dx.slave_reply(Status::Dl), &inputs.emit());
    let response = "68 0F 0F 68 02 06 0A 30 00 20 00 00 91 A2 80 00 01 23 45 7E 16";
    data(response, dx.slave_reply(Status::Dh), &inputs.emit());
    data("10 06 02 7D 85 16", dx, &[]);
    data("10 02 06 03 0B 16", dx.slave_reply(Status::Rs), &[]);
    assert_eq!(Outputs81::parse(&outputs.emit()), Some(outputs));
    assert_eq!(Inputs81::parse(&inputs.emit()), Some(inputs));
    assert_eq!(config::lengths(&TELEGRAM_81), Ok((Inputs81::LEN as u8, Outputs81::LEN as u8)));

    data("68 07 07 68 06 02 77 10 00 20 00 AF 16", request(Service::Msrd, ODD), &outputs.emit());
    data("68 07 07 68 06 02 57 10 00 20 00 8F 16", request(Service::Msrd, EVEN), &outputs.emit());
    let broadcast = Header { da: Address::BROADCAST, ..dx.slave_reply(Status::Dl) };
    data("68 0F 0F 68 7F 06 08 30 00 20 00 00 91 A2 80 00 01 23 45 F9 16", broadcast, &inputs.emit());
}

/// The frame carries this PDU, both ways.
#[track_caller]
fn acyclic_request(text: &str, header: Header, pdu: &acyclic::Request<'_>) {
    let mut out = [0; MAX_DU];
    let len = pdu.emit(&mut out).unwrap();
    data(text, header, &out[..len]);
    assert_eq!(acyclic::Request::parse(&out[..len]).as_ref(), Ok(pdu));
}
#[track_caller]
fn acyclic_response(text: &str, header: Header, pdu: &acyclic::Response<'_>) {
    let mut out = [0; MAX_DU];
    let len = pdu.emit(&mut out).unwrap();
    data(text, header, &out[..len]);
    assert_eq!(acyclic::Response::parse(&out[..len]).as_ref(), Ok(pdu));
}

#[test]
fn ms1_reads_a_parameter() {
    let low = |fcb| request_at(Sap::MS1, Service::SrdLow, fcb);
    let record = Record { slot: 0, index: Record::PARAMETER_CHANNEL };
    let mut p979 = [0; 10];
    let first = ParameterAddress { attribute: ParameterAddress::VALUE, elements: 1, pnu: 979, subindex: 0 };
    assert_eq!(parameter::emit_request((1, RequestId::Read, 0), &[first], &[], &mut p979), Some(10));
    let write = acyclic::Request::Write { record, data: &p979 };
    acyclic_request("68 13 13 68 86 82 5C 33 33 5F 00 2F 0A 01 01 00 01 10 01 03 D3 00 00 4C 16", low(EVEN), &write);
    data("68 05 05 68 86 82 7C 33 33 EA 16", low(ODD), &[]);
    let written = acyclic::Response::Write { record, len: 10 };
    acyclic_response("68 09 09 68 82 86 08 33 33 5F 00 2F 0A 0E 16", reply_at(Sap::MS1), &written);
    let read = acyclic::Request::Read { record, len: 240 };
    acyclic_request("68 09 09 68 86 82 5C 33 33 5E 00 2F F0 47 16", low(EVEN), &read);
    let refused = Negative::new(Function::Read, ErrorCode::STATE_CONFLICT);
    let negative = acyclic::Response::Negative(refused);
    acyclic_response("68 09 09 68 82 86 08 33 33 DE 80 B5 00 89 16", reply_at(Sap::MS1), &negative);
    assert_eq!((refused.refused(), refused.code_1.class()), (Some(Function::Read), 11));
    assert_eq!(refused.code_1.to_string(), "state conflict");
}

#[test]
fn ms2_opens_a_connection() {
    let initiate = acyclic::Request::Initiate(InitiateReq {
        send_timeout: 1000,
        features: [1, 0],
        profile_features: [0, 0],
        profile_ident: 0x3D00,
        ends: Ends { source_type: 0, source: &[0, 0], destination_type: 0, destination: &[0, 0] },
    });
    let text = "68 19 19 68 86 82 5C 31 32 57 00 00 00 03 E8 01 00 00 00 3D 00 00 02 00 02 00 00 00 00 4B 16";
    acyclic_request(text, request_at(Sap::MS2_RM, Service::SrdLow, EVEN), &initiate);
    let manager = acyclic::Response::ResourceManager { server_sap: 0, send_timeout: 1000 };
    acyclic_response("68 09 09 68 82 86 08 32 31 56 00 03 E8 B4 16", reply_at(Sap::MS2_RM), &manager);
    data("68 05 05 68 86 82 7C 00 32 B6 16", request_at(Sap(0), Service::SrdLow, ODD), &[]);
}

#[test]
fn every_other_acyclic_pdu_reads_as_it_was_written() {
    use acyclic::{Request, Response};
    let record = Record { slot: 1, index: 2 };
    let ends = Ends { source_type: 0, source: &[1, 2], destination_type: 1, destination: &[3, 4, 5, 6, 7, 8, 9, 10] };
    let initiated = InitiateRes { max_len: 240, features: [1, 0], profile_features: [0; 2], profile_ident: 1, ends };
    let abort = Abort { subnet: 2, reason: 0x23, detail: 0 };
    assert_eq!((abort.instance(), abort.code()), (2, 3));
    let mut out = [0; MAX_DU];
    for response in [
        Response::Read { record, data: &[1, 2, 3] },
        Response::DataTransport { record, data: &[4] },
        Response::AlarmAck { data: &[0, 1, 2] },
        Response::Initiate(initiated),
        Response::Idle,
        Response::Abort(abort),
    ] {
        let len = response.emit(&mut out).unwrap();
        assert_eq!(Response::parse(&out[..len]), Ok(response));
        assert_eq!(response.emit(&mut out[..len - 1]), None);
    }
    for request in [
        Request::DataTransport { record, data: &[4] },
        Request::AlarmAck { data: &[] },
        Request::Idle,
        Request::Abort(abort),
    ] {
        let len = request.emit(&mut out).unwrap();
        assert_eq!(Request::parse(&out[..len]), Ok(request));
    }
    assert_eq!(Request::Write { record, data: &[0; 256] }.emit(&mut [0; 300]), None);
}

#[test]
fn sd3_is_read_and_leaves_as_sd2() {
    let octets = hex("A2 06 02 7D 00 00 00 00 00 00 00 00 85 16");
    let header = request(SRD, ODD);
    let telegram = Telegram::Data { header, du: &[0; 8] };
    assert_eq!(Telegram::parse(&octets), Ok(telegram));
    let mut frame = Frame::new();
    frame.set_sd3(&header, &[0; 8]).unwrap();
    assert_eq!(frame.octets(), octets);
    telegram.emit(&mut frame).unwrap();
    assert_eq!((frame.octets()[0], frame.len(), frame.telegram()), (0x68, 17, Ok(telegram)));
    // Service access points count among the eight octets.
    let header = request_at(Sap::SLAVE_DIAG, SRD, ODD);
    frame.set_sd3(&header, &[1, 2, 3, 4, 5, 6]).unwrap();
    assert_eq!(frame.telegram(), Ok(Telegram::Data { header, du: &[1, 2, 3, 4, 5, 6] }));
    assert_eq!(frame.set_sd3(&header, &[0; 8]), Err(TelegramError::Length { expected: 14, found: 16 }));
}

#[test]
fn frames_occupy_the_line_as_long_as_the_tables_say() {
    const BITS_PER_OCTET: usize = 11;
    let mut frame = Frame::new();
    let mut bits = |telegram: Telegram<'_>| {
        telegram.emit(&mut frame).unwrap();
        frame.len() * BITS_PER_OCTET
    };
    assert_eq!(bits(Telegram::ShortAck), 11);
    assert_eq!(bits(Telegram::Token { da: master(), sa: master() }), 33);
    let (plain, with_saps) = (request(SRD, ODD), request_at(Sap::SET_PRM, SRD, ODD));
    assert_eq!(bits(Telegram::Data { header: plain, du: &[] }), 66);
    for n in 1..=MAX_DU {
        assert_eq!(bits(Telegram::Data { header: plain, du: &[0; MAX_DU][..n] }), 99 + 11 * n);
    }
    for n in 0..=MAX_DU - 2 {
        assert_eq!(bits(Telegram::Data { header: with_saps, du: &[0; MAX_DU][..n] }), 121 + 11 * n);
    }
    assert_eq!(MAX_FRAME * BITS_PER_OCTET, 2805);
}

#[test]
fn the_checks_of_a_receiver_say_what_and_where() {
    for (text, error, sentence) in [
        ("", TelegramError::Empty, "there are no octets"),
        ("99 01", TelegramError::Start { offset: 0, found: 0x99 }, "octet 0 is 99, which starts no frame"),
        ("E5 E5", TelegramError::Length { expected: 1, found: 2 }, "the frame has 2 octets instead of 1"),
        ("DC 02", TelegramError::Length { expected: 3, found: 2 }, "the frame has 2 octets instead of 3"),
        ("DC 7F 02", TelegramError::Address { offset: 1, found: 127 }, "octet 1 is 127, which is no station's address"),
        ("DC 02 82", TelegramError::Address { offset: 2, found: 130 }, "octet 2 is 130, which is no station's address"),
        (
            "68 03 03 68 06 02 7D 85 16",
            TelegramError::LengthField { offset: 1, found: 3 },
            "octet 1 is LE 3, which is not in 4..=249",
        ),
        (
            "68 07 06 68 06 02 7D 10 00 20 00 B5 16",
            TelegramError::LengthRepeat { offset: 2, expected: 7, found: 6 },
            "octet 2 repeats LE 7 as 6",
        ),
        (
            "68 07 07 69 06 02 7D 10 00 20 00 B5 16",
            TelegramError::Start { offset: 3, found: 0x69 },
            "octet 3 is 69, which starts no frame",
        ),
        (
            "68 07 07 68 06 02 7D 10 00 20 00 B5",
            TelegramError::Length { expected: 13, found: 12 },
            "the frame has 12 octets instead of 13",
        ),
        (
            "68 07 07 68 06 02 7D 10 00 20 00 B5 17",
            TelegramError::End { offset: 12, found: 0x17 },
            "octet 12 is 17 instead of the end 16",
        ),
        (
            "68 07 07 68 06 02 7D 10 00 20 00 B4 16",
            TelegramError::FrameCheck { offset: 11, expected: 0xB5, found: 0xB4 },
            "octet 11 is FCS B4, but the octets sum up to B5",
        ),
        (
            "10 06 7F 7D 02 16",
            TelegramError::Address { offset: 2, found: 127 },
            "octet 2 is 127, which is no station's address",
        ),
        (
            "10 06 02 42 4A 16",
            TelegramError::FrameControl { offset: 3, found: 0x42 },
            "octet 3 is FC 42, which is not assigned",
        ),
        (
            "10 86 02 7D 05 16",
            TelegramError::ExtensionMissing { offset: 4 },
            "octet 4 should be a service access point",
        ),
        (
            "68 04 04 68 06 82 7D 40 45 16",
            TelegramError::Extension { offset: 7, found: 0x40 },
            "octet 7 is 40, which is no service access point",
        ),
    ] {
        assert_eq!(Telegram::parse(&hex(text)), Err(error), "{text}");
        assert_eq!(error.to_string(), sentence);
        assert!(error.offset().is_none_or(|offset| offset < hex(text).len().max(5)));
    }
}

#[test]
fn a_frame_refuses_what_no_receiver_would_take() {
    let header = request_at(Sap::SET_PRM, SRD, ODD);
    let mut frame = Frame::new();
    frame.set_short_ack();
    for (header, len, error) in [
        (header, 245, TelegramError::DataUnit { most: 244, found: 245 }),
        (request(SRD, ODD), 247, TelegramError::DataUnit { most: 246, found: 247 }),
        (Header { sa: Address::BROADCAST, ..header }, 1, TelegramError::Address { offset: 5, found: 127 }),
        (Header { dsap: Some(Sap(64)), ..header }, 1, TelegramError::Extension { offset: 7, found: 64 }),
        (Header { ssap: Some(Sap(255)), ..header }, 1, TelegramError::Extension { offset: 8, found: 255 }),
    ] {
        assert_eq!(frame.set_data(&header, &[0; 250][..len]), Err(error));
        assert_eq!(frame.octets(), [0xE5]);
    }
    let token = Telegram::Token { da: Address::BROADCAST, sa: master() };
    assert_eq!(token.emit(&mut frame), Err(TelegramError::Address { offset: 1, found: 127 }));
    assert_eq!(Frame::from_octets(&[0; 256]), None);
}

#[test]
fn a_data_unit_is_written_in_place_over_nothing_old() {
    let mut frame = Frame::from_octets(&[0xFF; MAX_FRAME]).unwrap();
    let header = request(SRD, ODD);
    frame.set_data_with(&header, 4, |du| du[1] = 7).unwrap();
    assert_eq!(frame.telegram(), Ok(Telegram::Data { header, du: &[0, 7, 0, 0] }));
    let mut copy = Frame::new();
    copy.copy_from(&frame);
    assert_eq!(copy, frame);
    copy.truncate(3);
    assert_eq!(copy.octets(), &frame.octets()[..3]);
    copy.clear();
    assert!(copy.is_empty());
}

fn any_station() -> impl Strategy<Value = Address> {
    (0..=126u8).prop_map(address)
}
fn any_header() -> impl Strategy<Value = Header> {
    let sap = || proptest::option::of((0..=63u8).prop_map(Sap));
    let fc = any::<u8>().prop_filter_map("assigned", |octet| FrameControl::from_octet(octet).ok());
    (0..=127u8, any_station(), sap(), sap(), fc).prop_map(|(da, sa, dsap, ssap, fc)| Header {
        da: address(da),
        sa,
        dsap,
        ssap,
        fc,
    })
}
fn octets(most: usize) -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(any::<u8>(), 0..=most)
}
/// Each frame that differs in one bit, with the position of the bit.
fn flips(frame: &Frame) -> impl Iterator<Item = (usize, u8, Frame)> {
    (0..frame.len()).flat_map(move |at| {
        (0..8).map(move |bit| {
            let mut flipped = frame.clone();
            flipped.octets_mut()[at] ^= 1 << bit;
            (at, bit, flipped)
        })
    })
}

/// Feeds every parser of data units; what it accepts and its emitter knows must come out the same.
fn read_everything(du: &[u8]) {
    let mut out = [0; 600];
    if let Ok(prm) = SetPrm::parse(du) {
        let _ = (prm.check(), prm.watchdog_units());
        for block in prm.blocks().flatten() {
            let _ = (UserPrm81::parse(&block), IsoM::parse(&block).map(|iso| iso.check(block.octet)));
            let _ = (DxbLinks::parse(&block).map(|t| t.check(9)), DxbSubscriptions::parse(&block).map(|t| t.check(9)));
        }
        let len = prm.emit(&mut out).unwrap();
        assert!(out[..len].starts_with(du));
    }
    let _ = config::lengths(du);
    if let Ok(diagnosis) = Diagnosis::parse(du) {
        assert_eq!(diagnosis.emit(), du[..6]);
        let _ = diagnosis.to_string();
    }
    if let Ok(control) = GlobalControl::parse(du) {
        assert_eq!(control.emit(), du);
    }
    if let Ok(pdu) = acyclic::Request::parse(du) {
        let len = pdu.emit(&mut out).unwrap();
        assert_eq!(out[..len], *du);
    }
    if let Ok(pdu) = acyclic::Response::parse(du) {
        let len = pdu.emit(&mut out).unwrap();
        assert_eq!(out[..len], *du);
    }
    if let Ok(request) = parameter::Request::parse(du) {
        let (addresses, values): (Vec<_>, Vec<_>) = (request.addresses().collect(), request.values().collect());
        let head = (request.reference, request.id, request.axis);
        let len = parameter::emit_request(head, &addresses, &values, &mut out).unwrap();
        assert_eq!(parameter::Request::parse(&out[..len]).map(|again| again.values().eq(values)), Ok(true));
    }
    if let Ok(response) = parameter::Response::parse(du) {
        let values: Vec<_> = response.values().collect();
        assert!(values.iter().all(|values| values.unsigned(values.count()).is_none()));
        let head = (response.reference, response.id, response.axis);
        let len = parameter::emit_response(head, response.count, &values, &mut out).unwrap();
        assert_eq!(parameter::Response::parse(&out[..len]).map(|again| again.values().eq(values)), Ok(true));
    }
    assert_eq!(Outputs81::parse(du).map(|outputs| outputs.emit().to_vec()).unwrap_or(du.to_vec()), du);
    assert_eq!(Inputs81::parse(du).map(|inputs| inputs.emit().to_vec()).unwrap_or(du.to_vec()), du);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_octets_are_read_without_panic(octets in octets(300)) {
        let _ = Telegram::parse(&octets).map_err(|error| error.to_string());
        read_everything(&octets);
    }

    /// Random octets rarely begin like a PDU, so here they do.
    #[test]
    fn any_octets_behind_a_good_beginning_are_read_without_panic(
        start in proptest::sample::select(&[0x10u8, 0x68, 0xA2, 0xDC, 0xE5][..]),
        function in proptest::sample::select(&[0x48u8, 0x51, 0x56, 0x57, 0x58, 0x5C, 0x5E, 0x5F, 0xDE, 1, 2][..]),
        small in proptest::collection::vec(0..6u8, 0..24),
        octets in octets(40),
    ) {
        for middle in [&small, &octets] {
            let _ = Telegram::parse(&[&[start], &middle[..]].concat());
            read_everything(&[&[function], &middle[..]].concat());
            read_everything(&[&hex("88 14 01 0B 80 F9 80 C0 00 18")[..], middle].concat());
            read_everything(&[&hex("01 01 00 01")[..], middle].concat());
            for kind in [0x03, 0x04, 0x07, 0x81] {
                let head = [4 + middle.len() as u8, kind, 0, 0];
                read_everything(&[&hex("88 14 01 0B 80 F9 80 C0 00 18")[..], &head, middle].concat());
            }
        }
    }

    #[test]
    fn what_is_written_is_read_again(header in any_header(), du in octets(MAX_DU)) {
        let mut frame = Frame::new();
        let fits = du.len() + header.sap_octets() <= MAX_DU;
        prop_assert_eq!(frame.set_data(&header, &du).is_ok(), fits);
        if fits {
            prop_assert_eq!(frame.telegram(), Ok(Telegram::Data { header, du: &du }));
            let mut again = Frame::new();
            frame.telegram().unwrap().emit(&mut again).unwrap();
            prop_assert_eq!(again, frame);
        }
    }

    /// FCS is a sum, and one flipped bit changes a sum by a power of two, never by a multiple of 256. What FCS does not
    /// cover (starts, LE, LEr, ED, FCS itself) is checked octet by octet. So one flipped bit is always noticed.
    #[test]
    fn one_flipped_bit_of_a_data_frame_is_always_rejected(header in any_header(), du in octets(40)) {
        let mut frame = Frame::new();
        frame.set_data(&header, &du).unwrap();
        for (at, bit, flipped) in flips(&frame) {
            prop_assert!(flipped.telegram().is_err(), "octet {} bit {}: {:?}", at, bit, flipped);
        }
    }
    #[test]
    fn one_flipped_bit_of_an_sd3_is_always_rejected(header in any_header(), du in [any::<u8>(); 8]) {
        let mut frame = Frame::new();
        frame.set_sd3(&header, &du[..8 - header.sap_octets()]).unwrap();
        for (at, bit, flipped) in flips(&frame) {
            prop_assert!(flipped.telegram().is_err(), "octet {} bit {}: {:?}", at, bit, flipped);
        }
    }

    /// A token has no FCS: a flipped address bit gives the token to somebody else unless it leaves 0..=126. On the line
    /// the parity of the character notices it, before there are octets.
    #[test]
    fn one_flipped_bit_of_a_token_is_another_token_or_rejected(da in any_station(), sa in any_station()) {
        let mut frame = Frame::new();
        frame.set_token(da, sa);
        for (at, bit, flipped) in flips(&frame) {
            let octet = flipped.octets()[at];
            let expected = match at {
                1 if octet <= 126 => Some(Telegram::Token { da: address(octet), sa }),
                2 if octet <= 126 => Some(Telegram::Token { da, sa: address(octet) }),
                _ => None,
            };
            prop_assert_eq!(flipped.telegram().ok(), expected, "octet {} bit {}", at, bit);
        }
    }
}

#[test]
fn one_flipped_bit_of_a_short_acknowledgement_is_always_rejected() {
    let mut frame = Frame::new();
    frame.set_short_ack();
    assert!(flips(&frame).all(|(_, _, flipped)| flipped.telegram().is_err()));
}

/// The limit of a sum: two flipped bits that undo each other pass FCS. Only parity notices them on the line.
#[test]
fn two_flipped_bits_may_pass_the_sum() {
    let mut frame = Frame::from_octets(&hex("68 07 07 68 06 02 7D 10 00 20 00 B5 16")).unwrap();
    frame.octets_mut()[7] ^= 0x10;
    frame.octets_mut()[8] ^= 0x10;
    assert_eq!(frame.telegram(), Ok(Telegram::Data { header: request(SRD, ODD), du: &[0x00, 0x10, 0x20, 0x00] }));
}
