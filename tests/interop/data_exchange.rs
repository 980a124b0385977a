//! The foreign master starts encoders up, exchanges data with them, loses them and finds them again.

use isodp::observation::{SlaveCause, SlaveState};
use isodp::sim::motion::{Angle, Motion};
use isodp::time::{BitRate, Span, Time};
use isodp::wire::drive::{G1Zsw, Inputs81};
use profirust::dp::DiagnosticFlags;
use profirust::dp::PeripheralEvent::{self, Offline, Online};

use super::foreign::{
    Bus, CFG, Configured, IDENT, MASTER, Order, RATES, T_SDR, USER, WATCHDOG, destination, dsap, fc, idle, motion,
};

const ENCODER: u8 = 6;
/// Ready for data exchange.
const READY: PeripheralEvent = PeripheralEvent::Configured;

/// The steps of the disc and the shift of G1_XIST1, 32 - 25 bits.
const STEPS_PER_REV: i128 = 8_192;
const SHIFT: u32 = 7;

/// A telegram with SD2 around these octets, as the standard builds one.
fn sd2(covered: &[u8]) -> Vec<u8> {
    let fcs = covered.iter().fold(0u8, |sum, octet| sum.wrapping_add(*octet));
    let le = covered.len() as u8;
    [&[0x68, le, le, 0x68], covered, &[fcs, 0x16]].concat()
}

/// Where the encoder's shaft stands (steps), from speed and start alone.
fn steps(encoder: u8, at: Time) -> u32 {
    let Motion::Speed { start, micro_rpm } = motion(encoder) else { panic!("the shaft turns") };
    let turned = i128::from(at.ticks()) * i128::from(micro_rpm) * STEPS_PER_REV / (60_000_000 * 12_000_000_000);
    let from = i128::from(start.units()) * STEPS_PER_REV / i128::from(Angle::UNITS_PER_REV);
    (from + turned).rem_euclid(1 << 25) as u32
}

/// Instants of Data_Exchange requests to an encoder with the inputs that came back.
fn exchanges(bus: &Bus, encoder: u8) -> Vec<(Time, Inputs81)> {
    let requests = bus.requests_to(encoder).into_iter().filter(|(request, _)| fc(&request.octets) & 0x4F == 0x4D);
    let data = requests.filter_map(|(request, reply)| Some((request.end, reply?.octets)));
    let inputs = data.filter_map(|(at, octets)| Some((at, Inputs81::parse(octets.get(7..19)?)?)));
    inputs.collect()
}

#[test]
fn the_start_up_is_that_of_the_standard_octet_by_octet() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER]);
        bus.run(100);
        let requests = bus.requests_to(ENCODER);
        let set_prm = [&[0x88, 1, 10, 11, 0x06, 0xDF, 0x00], USER].concat();
        let ready = [0x00, 0x0C, 0x00, MASTER, 0x06, 0xDF];
        let expected = [
            (sd2(&[0x86, 0x82, 0x6C, 60, 62]), sd2(&[0x82, 0x86, 0x08, 62, 60, 0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF])),
            (sd2(&[&[0x86, 0x82, 0x5C, 61, 62][..], &set_prm].concat()), vec![0xE5]),
            // SD3: two service access points and telegram 81 are 8 octets.
            (vec![0xA2, 0x86, 0x82, 0x7C, 62, 62, 0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x51, 0x97, 0x16], vec![0xE5]),
            (sd2(&[0x86, 0x82, 0x5C, 60, 62]), sd2(&[&[0x82, 0x86, 0x08, 62, 60][..], &ready].concat())),
        ];
        for ((request, reply), (asked, answered)) in requests.iter().zip(expected) {
            assert_eq!(
                (&request.octets, reply.as_ref().map(|reply| &reply.octets)),
                (&asked, Some(&answered)),
                "{rate}"
            );
        }
        // Data_Exchange: FCB goes on, four octets there, twelve back.
        assert_eq!(requests[4].0.octets, sd2(&[0x06, 0x02, 0x7D, 0, 0, 0, 0]));
        assert_eq!(requests[5].0.octets, sd2(&[0x06, 0x02, 0x5D, 0, 0, 0, 0]));
        let exchanges = exchanges(&bus, ENCODER);
        assert!(exchanges.len() > 20, "{rate}: {}", exchanges.len());
        assert_eq!(exchanges.len() + 4, requests.len(), "each is answered and nothing else is asked");
        assert_eq!(bus.master().exchanges, exchanges.len() as u64, "profirust took each");
        assert!(bus.master().runs(ENCODER));
        assert_eq!(bus.master().events_of(ENCODER), [Online, READY]);
        let diagnosis = Some((DiagnosticFlags::WATCHDOG_ON, Some(MASTER), IDENT));
        assert_eq!(bus.master().diagnosis(ENCODER), diagnosis);
        assert_eq!(bus.encoder(ENCODER).slave().state(), SlaveState::DataExch);
    }
}

#[test]
fn the_encoder_answers_a_gap_poll_as_a_passive_station() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER]);
        bus.run(200);
        let line = bus.line();
        let polls: Vec<_> = line.windows(2).filter(|pair| pair[0].octets == [0x10, 6, 2, 0x49, 0x51, 0x16]).collect();
        assert!(!polls.is_empty(), "{rate}");
        assert!(polls.iter().all(|pair| pair[1].octets == [0x10, 2, 6, 0x00, 0x08, 0x16]), "{rate}");
    }
}

#[test]
fn idle_times_are_kept_on_both_sides() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER, 7]);
        bus.run(100);
        let line = bus.line();
        assert!(line.windows(2).filter(|pair| pair[1].sender != MASTER).count() > 40);
        for pair in line.windows(2) {
            let idle = idle(rate, &pair[0], &pair[1]);
            if pair[1].sender == MASTER {
                assert!(idle >= 33, "{rate}: T_SYN is {idle} t_bit at {:?}", pair[1].start);
            } else {
                assert_eq!(idle, i64::from(T_SDR.0), "{rate}: T_SDR at {:?}", pair[1].start);
                assert_eq!(destination(&pair[0].octets), Some(pair[1].sender), "only who is asked answers");
            }
        }
    }
}

#[test]
fn the_position_is_that_of_the_shaft_at_the_request() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER]);
        bus.run(1_200);
        let exchanges = exchanges(&bus, ENCODER);
        let (first, last) = (exchanges[0], exchanges[exchanges.len() - 1]);
        assert!(last.0 - first.0 > Span::from_s(1), "more than a revolution");
        for (at, inputs) in exchanges {
            let (xist1, expected) = (inputs.xist1, steps(ENCODER, at));
            assert_eq!(xist1 & ((1 << SHIFT) - 1), 0, "left-justified");
            assert!((xist1 >> SHIFT).abs_diff(expected) <= 1, "{rate}: {} at {at:?}, {expected}", xist1 >> SHIFT);
            assert_eq!((inputs.zsw2.0, inputs.g1_zsw.0, inputs.xist2), (0, 0, 0), "no sign of life without a clock");
        }
        assert_eq!(bus.master().inputs(ENCODER), last.1.emit(), "profirust's application has the last");
    }
}

#[test]
fn outputs_reach_the_encoder() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER]);
        bus.run(50);
        // G1_STW bit 13: the absolute position in G1_XIST2, too.
        bus.order(Order::Outputs(ENCODER, [0x00, 0x00, 0x20, 0x00]));
        bus.run(100);
        let inputs = Inputs81::parse(bus.master().inputs(ENCODER)).expect("telegram 81");
        assert!(inputs.g1_zsw.has(G1Zsw(0x2000)) && inputs.xist2 != 0, "{inputs:?}");
        assert_eq!(inputs.xist2, inputs.xist1 >> SHIFT);
        // G1_STW bit 14: parking, no position at all.
        bus.order(Order::Outputs(ENCODER, [0x00, 0x00, 0x40, 0x00]));
        bus.run(150);
        let inputs = Inputs81::parse(bus.master().inputs(ENCODER)).expect("telegram 81");
        assert_eq!((inputs.g1_zsw, inputs.xist1, inputs.xist2), (G1Zsw(0x4000), 0, 0));
        bus.order(Order::Outputs(ENCODER, [0; 4]));
        bus.run(200);
        let inputs = Inputs81::parse(bus.master().inputs(ENCODER)).expect("telegram 81");
        assert!(inputs.g1_zsw == G1Zsw(0) && inputs.xist1 != 0, "{inputs:?}");
    }
}

#[test]
fn the_diagnosis_can_be_read_during_data_exchange() {
    let mut bus = Bus::good(BitRate::M1_5, &[ENCODER]);
    bus.run(50);
    let before = bus.master().exchanges;
    bus.order(Order::Diagnose(ENCODER));
    bus.run(60);
    assert_eq!(bus.master().events_of(ENCODER).last(), Some(&PeripheralEvent::Diagnostics));
    assert_eq!(bus.master().diagnosis(ENCODER), Some((DiagnosticFlags::WATCHDOG_ON, Some(MASTER), IDENT)));
    assert!(bus.master().exchanges > before + 5, "it goes on");
    assert_eq!(bus.states_of(ENCODER).len(), 3, "WAIT_PRM, WAIT_CFG, DATA_EXCH and nothing more");
}

#[test]
fn two_encoders_have_their_own_positions_and_outputs() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER, 7]);
        bus.run(50);
        bus.order(Order::Outputs(7, [0x00, 0x00, 0x20, 0x00]));
        bus.run(150);
        let [one, other] = [ENCODER, 7].map(|encoder| {
            let exchanges = exchanges(&bus, encoder);
            for &(at, inputs) in &exchanges {
                assert!((inputs.xist1 >> SHIFT).abs_diff(steps(encoder, at)) <= 1, "{encoder} at {at:?}");
            }
            (exchanges.len(), Inputs81::parse(bus.master().inputs(encoder)).expect("telegram 81"))
        });
        assert!(one.0.abs_diff(other.0) <= 2 && one.0 > 20, "{rate}: {} and {} exchanges", one.0, other.0);
        assert_eq!((one.1.g1_zsw.0, other.1.g1_zsw.0), (0x0000, 0x2000));
    }
}

#[test]
fn an_encoder_that_loses_its_supply_comes_back_and_the_other_does_not_notice() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER, 7]);
        bus.run(100);
        bus.power(ENCODER, false);
        bus.run(300);
        assert!(!bus.master().runs(ENCODER) && bus.master().runs(7));
        bus.power(ENCODER, true);
        bus.run(500);
        assert!(bus.master().runs(ENCODER) && bus.master().runs(7));
        assert_eq!(bus.master().events_of(ENCODER), [Online, READY, Offline, Online, READY]);
        assert_eq!(bus.master().events_of(7), [Online, READY]);
        assert_eq!(bus.states_of(7).len(), 3, "the other one never left data exchange");
        let (at, inputs) = *exchanges(&bus, ENCODER).last().expect("data");
        assert!((inputs.xist1 >> SHIFT).abs_diff(steps(ENCODER, at)) <= 1, "the absolute position is known at once");
        // One repetition, then one Slave_Diag in each rotation until it is back.
        let lost: Vec<_> = bus.requests_to(ENCODER).into_iter().filter(|(_, reply)| reply.is_none()).collect();
        assert_eq!(lost[0].0.octets, lost[1].0.octets, "the repetition is the same telegram");
        assert!(lost.len() > 10 && lost[2..].iter().all(|(request, _)| dsap(&request.octets) == Some(60)));
    }
}

#[test]
fn an_encoder_that_is_not_there_keeps_nobody_waiting() {
    let configured = [Configured::good(ENCODER), Configured::good(7)];
    let mut bus = Bus::new(BitRate::M1_5, &configured, &[7]);
    bus.run(100);
    assert!(bus.master().runs(7) && !bus.master().runs(ENCODER));
    assert_eq!((bus.master().diagnosis(ENCODER), bus.master().events_of(ENCODER).len()), (None, 0));
}

#[test]
fn the_watchdog_releases_the_encoder_when_the_master_stops() {
    for rate in RATES {
        let mut bus = Bus::good(rate, &[ENCODER]);
        bus.run(150);
        assert_eq!(bus.states_of(ENCODER).len(), 3, "the watchdog runs for longer than its time and does not bite");
        bus.order(Order::Stop);
        bus.run(400);
        let last = bus.requests_to(ENCODER).last().expect("a request").0.end;
        let states = bus.states_of(ENCODER);
        assert_eq!(states[3..], [(last + WATCHDOG, SlaveState::WaitPrm, SlaveCause::Watchdog)]);
        bus.order(Order::Start);
        bus.run(600);
        assert!(bus.master().runs(ENCODER), "{:?}", bus.master().events);
        let after: Vec<_> = bus.states_of(ENCODER)[4..].iter().map(|&(_, state, _)| state).collect();
        assert_eq!(after, [SlaveState::WaitCfg, SlaveState::DataExch]);
        // profirust learns from RS, and that alone, that its slave is free.
        let resumed: Vec<_> = bus.requests_to(ENCODER).into_iter().filter(|(sent, _)| sent.start > last).collect();
        let refused = resumed.iter().position(|(_, reply)| matches!(reply, Some(reply) if fc(&reply.octets) == 0x03));
        let services: Vec<_> = resumed[refused.expect("RS")..].iter().map(|(sent, _)| dsap(&sent.octets)).collect();
        assert_eq!(services[..6], [None, Some(60), Some(61), Some(62), Some(60), None]);
    }
}

/// Everything that a run with a bit of everything leaves.
fn eventful(rate: BitRate) -> String {
    let mut bus = Bus::good(rate, &[ENCODER, 7]);
    bus.run(50);
    bus.power(7, false);
    bus.run(100);
    bus.order(Order::Outputs(ENCODER, [0x00, 0x00, 0x20, 0x00]));
    bus.power(7, true);
    bus.run(150);
    bus.order(Order::Stop);
    bus.run(300);
    bus.order(Order::Anew(Configured { cfg: &CFG[..5], ..Configured::good(7) }));
    bus.order(Order::Start);
    bus.run(400);
    format!("{:?} {:?} {:?} {:?}", bus.line(), bus.master().events, bus.states_of(ENCODER), bus.states_of(7))
}

#[test]
fn the_same_orders_give_the_same_run() {
    let [slow, fast] = RATES.map(|rate| {
        let once = eventful(rate);
        assert!(once == eventful(rate), "{rate}: two runs differ");
        once
    });
    assert!(slow != fast, "but another rate is another run");
}
