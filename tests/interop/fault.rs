//! Wrong parameters and configurations: the foreign master sees the fault, exchanges no data, and does once they are right.

use isodp::observation::{SlaveCause, SlaveState};
use isodp::time::BitRate;
use profirust::dp::DiagnosticFlags;
use profirust::dp::PeripheralEvent::{ConfigError, Offline, Online};

use super::foreign::{Bus, Configured, IDENT, Order, RATES, Sent, USER, dsap, fc};

const ENCODER: u8 = 6;
const NOT_READY: DiagnosticFlags = DiagnosticFlags::STATION_NOT_READY.union(DiagnosticFlags::PARAMETER_REQUIRED);

/// The user block with scaling to 8193 units in a revolution of 8192 steps (manual 3.2.3).
const TOO_FINE: &[u8] = &[
    0xC0, 0x00, 0x08, 0x15, 0x81, 0x00, 0x00, 0x0A, 0x00, 0x00, 0x20, 0x01, 0x02, 0x00, 0x00, 0x00, 1, 0, 0, 0, 0, 0,
    0, 0,
];
/// No user block (manual 3.1).
const NO_BLOCK: &[u8] = &[0xC0, 0x00, 0x08];
/// Telegram 82 (manual 2.1.1 knows 81 alone).
const TELEGRAM_82: &[u8] = &[0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x52];

const WRONG_PRM: [Configured; 4] = [
    Configured { ident: 0x80F9, ..Configured::good(ENCODER) },
    Configured { user: TOO_FINE, ..Configured::good(ENCODER) },
    Configured { user: NO_BLOCK, ..Configured::good(ENCODER) },
    Configured { user: &[0xC0, 0x00, 0x08, 0x15], ..Configured::good(ENCODER) },
];

/// Whether a Data_Exchange was ever answered with data.
fn exchanged(bus: &Bus) -> bool {
    let data = |reply: &Option<_>| reply.as_ref().is_some_and(|reply: &Sent| reply.octets.len() == 21);
    bus.requests_to(ENCODER).iter().any(|(request, reply)| dsap(&request.octets).is_none() && data(reply))
}

#[test]
fn refused_parameters_are_a_parameter_fault_until_they_are_right() {
    for rate in RATES {
        for wrong in WRONG_PRM {
            let mut bus = Bus::new(rate, &[wrong], &[ENCODER]);
            bus.run(50);
            let fault = (SlaveState::WaitPrm, SlaveCause::PrmFault);
            let states: Vec<_> = bus.states_of(ENCODER).iter().map(|&(_, to, cause)| (to, cause)).collect();
            assert_eq!(states[1..], [fault], "{wrong:?}");
            // profirust reads the diagnosis when it begins anew; see the next test for why not before.
            bus.order(Order::Anew(wrong));
            bus.run(100);
            let diagnosis = Some((NOT_READY | DiagnosticFlags::PARAMETER_FAULT, None, IDENT));
            assert_eq!(bus.master().diagnosis(ENCODER), diagnosis, "{wrong:?}");
            assert!(!exchanged(&bus) && !bus.master().runs(ENCODER) && bus.master().exchanges == 0);
            bus.order(Order::Anew(Configured::good(ENCODER)));
            bus.run(150);
            assert!(exchanged(&bus) && bus.master().runs(ENCODER));
            assert_eq!(bus.master().diagnosis(ENCODER).map(|(flags, ..)| flags), Some(DiagnosticFlags::WATCHDOG_ON));
        }
    }
}

/// profirust inverts FCB neither after RS nor for a station that it gave up: its Slave_Diag is a repeated Chk_Cfg to a
/// slave by the book (EN 50170-2: same master, FCV = 1, same FCB: the stored reply again, nothing executed).
#[test]
fn after_a_refusal_profirust_asks_with_the_fcb_that_was_answered() {
    let mut bus = Bus::new(BitRate::M1_5, &[WRONG_PRM[0]], &[ENCODER]);
    bus.run(50);
    let requests = bus.requests_to(ENCODER);
    let seen: Vec<_> = requests.iter().map(|(sent, _)| (dsap(&sent.octets), fc(&sent.octets))).collect();
    let chk_cfg = (Some(62), 0x7C);
    assert_eq!(seen[..4], [(Some(60), 0x6C), (Some(61), 0x5C), chk_cfg, chk_cfg]);
    assert!(seen.len() > 10 && seen[4..].iter().all(|&slave_diag| slave_diag == (Some(60), 0x7C)), "{seen:?}");
    let rs = |reply: &Sent| fc(&reply.octets) == 0x03;
    assert!(requests[2..].iter().all(|(_, reply)| reply.as_ref().is_some_and(rs)));
    assert_eq!(bus.master().events_of(ENCODER), [Online, Offline]);
    assert_eq!(bus.master().diagnosis(ENCODER), Some((NOT_READY, None, IDENT)), "that of before");
}

#[test]
fn a_refused_configuration_is_a_configuration_fault_until_it_is_right() {
    for rate in RATES {
        let wrong = Configured { cfg: TELEGRAM_82, ..Configured::good(ENCODER) };
        let mut bus = Bus::new(rate, &[wrong], &[ENCODER]);
        bus.run(50);
        assert_eq!(bus.master().events_of(ENCODER)[..4], [Online, ConfigError, Online, ConfigError]);
        let diagnosis = Some((NOT_READY | DiagnosticFlags::CONFIGURATION_FAULT, None, IDENT));
        assert_eq!(bus.master().diagnosis(ENCODER), diagnosis);
        assert!(!exchanged(&bus) && !bus.master().runs(ENCODER));
        let accepted = bus.states_of(ENCODER).iter().filter(|&&(.., cause)| cause == SlaveCause::Parameterised).count();
        assert!(accepted > 1, "its Set_Prm is good each time");
        bus.order(Order::Anew(Configured { user: USER, ..Configured::good(ENCODER) }));
        bus.run(100);
        assert!(exchanged(&bus) && bus.master().runs(ENCODER));
    }
}
