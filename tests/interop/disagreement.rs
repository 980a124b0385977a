//! What the module's table says of profirust, so that it is noticed when a later profirust no longer does it.

use isodp::fdl::params::BusParams;
use isodp::time::{BitRate, Span, Tbit};
use isodp::wire::{Fcb, FrameControl, Header, Sap, Service, Telegram};
use profirust::Baudrate;

use super::foreign::{Bus, MASTER, RATES, STEP, fc, idle};
use crate::support::address;

/// The rates of both, slowest first.
const BAUDRATES: [Baudrate; 11] = [
    Baudrate::B9600,
    Baudrate::B19200,
    Baudrate::B31250,
    Baudrate::B45450,
    Baudrate::B93750,
    Baudrate::B187500,
    Baudrate::B500000,
    Baudrate::B1500000,
    Baudrate::B3000000,
    Baudrate::B6000000,
    Baudrate::B12000000,
];

#[test]
fn profirust_waits_t_syn_where_the_standard_has_t_id1_and_t_id2() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[6]);
        bus.run(50);
        let line = bus.line();
        let pairs = || line.windows(2).filter(|pair| pair[1].sender == MASTER);
        let after = |which: &dyn Fn(&[u8]) -> bool, sender| {
            let which = pairs().filter(|pair| which(&pair[0].octets) && (pair[0].sender == MASTER) == sender);
            which.map(|pair| idle(rate, &pair[0], &pair[1])).min().expect("one such pair")
        };
        let params = BusParams::profile(rate);
        // Polled every 2 us it sends two polls after T_SYN at the latest.
        let waits = 33..=33 + 2 * STEP.div_floor(rate.bit());
        let (reply, control) = (after(&|_| true, false), after(&|octets| fc_is_sdn(octets), true));
        assert!(waits.contains(&reply) && waits.contains(&control), "{rate}: {reply} {control}");
        assert_eq!(params.t_id1(), Tbit(37));
        assert!(i64::from(params.max_tsdr.0) > *waits.end(), "{rate}: T_ID2");
    }
}

fn fc_is_sdn(octets: &[u8]) -> bool {
    octets[0] == 0x68 && fc(octets) == 0x44
}

#[test]
fn profirust_counts_whole_microseconds() {
    for (&rate, baudrate) in BitRate::ALL.iter().zip(BAUDRATES) {
        let exact = rate.span(Tbit(1_000));
        let theirs = Span::from_us(baudrate.bits_to_time(1_000).total_micros() as i64);
        // 500/11 kbit/s against 45.45 kbit/s is one part in ten thousand; all else is rounding.
        let off = if rate == BitRate::K45_45 { Span::from_us(2) } else { Span::ZERO };
        let difference = theirs - exact - off;
        assert!(difference <= Span::ZERO && difference > -Span::from_us(1), "{rate}: {exact} and {theirs}");
    }
    assert_eq!(Baudrate::B12000000.bits_to_time(11).total_micros(), 0, "a character takes no time");
    assert_eq!(Baudrate::B12000000.bits_to_time(33).total_micros(), 2);
    assert!(BitRate::M12.span(Tbit(33)) > Span::from_us(2), "T_SYN is 2.75 us");
}

/// The 8 octets of a diagnosis with its service access points: profirust sends SD3 where we send SD2.
#[test]
fn eight_octets_travel_in_either_frame() {
    let data = [0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF];
    let saps = [Sap::SLAVE_DIAG, Sap::MASTER_MS0];
    let fc = profirust::fdl::FunctionCode::new_srd_high(profirust::fdl::FrameCountBit::First);
    let [dsap, ssap] = saps.map(|sap| Some(sap.0));
    let theirs = profirust::fdl::DataTelegramHeader { da: 6, sa: 2, dsap, ssap, fc };
    let mut octets = [0; 256];
    let len = theirs.serialize(&mut octets, data.len(), |du| du.copy_from_slice(&data));
    assert_eq!((len, octets[0]), (14, 0xA2));
    let header = Header::request(address(6), address(2), Service::SrdHigh, Fcb::First).with_saps(saps[0], saps[1]);
    assert_eq!(Telegram::parse(&octets[..len]), Ok(Telegram::Data { header, du: &data }));
    let mut ours = isodp::wire::Frame::new();
    ours.set_data(&header, &data).expect("a telegram");
    assert_eq!((ours.octets()[0], ours.len()), (0x68, 17));
}

#[test]
fn code_7_is_the_same_service_under_another_name() {
    let fc = profirust::fdl::FunctionCode::from_byte(0x67).expect("a function code");
    let request = profirust::fdl::RequestType::MulticastSrd;
    assert_eq!(fc, profirust::fdl::FunctionCode::Request { fcb: profirust::fdl::FrameCountBit::First, req: request });
    assert_eq!(FrameControl::from_octet(0x67), Ok(FrameControl::Request { service: Service::Msrd, fcb: Fcb::First }));
    assert_eq!(Service::Msrd.expects_reply(), request.expects_reply());
}
