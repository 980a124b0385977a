//! A second opinion on every telegram that our stations send: profirust's parser, compared field by field.

use std::collections::BTreeSet;
use std::mem::take;

use isodp::device::node::Node;
use isodp::observation::{Disturbance, Observation};
use isodp::sim::network::{Network, NetworkEvent, Until};
use isodp::sim::queue::NearQueue;
use isodp::sim::record::{Origin, Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::scenario::Extent;
use isodp::time::Time;
use isodp::wire::{Fcb, FrameControl, Telegram};
use profirust::fdl::{FrameCountBit, FunctionCode};
use rayon::prelude::*;

use crate::support::{scenario, shipped};

/// Telegrams that differ, as stations sent them.
#[derive(Default)]
struct Distinct {
    telegrams: BTreeSet<Vec<u8>>,
    /// The scenario made the next one wrong.
    damaged: bool,
}

impl Recorder for Distinct {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let sent = telegram.origin == Origin::Sender && !take(&mut self.damaged);
        if sent && !self.telegrams.contains(telegram.octets) {
            self.telegrams.insert(telegram.octets.to_vec());
        }
    }
    fn observe(&mut self, _: Stamp<'_>, what: &Observation) {
        self.damaged |= matches!(what, Observation::Disturbed { how: Disturbance::WrongBits, .. });
    }
}

fn telegrams(name: &str) -> BTreeSet<Vec<u8>> {
    let scenario = scenario(name, &[]);
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(&scenario);
    let until = match scenario.run.duration {
        Extent::Time(span) => Until::Time(Time::ZERO + span),
        Extent::Cycles(cycles) => Until::Cycle(cycles),
    };
    let mut distinct = Distinct::default();
    assert!(network.run(until, 100_000_000, &mut distinct), "the run does not end");
    distinct.telegrams
}

/// Our reading of FC in profirust's words.
fn function_code(fc: FrameControl) -> FunctionCode {
    match fc {
        FrameControl::Request { service, fcb } => FunctionCode::Request {
            fcb: match fcb {
                Fcb::Unused => FrameCountBit::Inactive,
                Fcb::First => FrameCountBit::First,
                Fcb::Alternate(true) => FrameCountBit::High,
                Fcb::Alternate(false) => FrameCountBit::Low,
            },
            req: profirust::fdl::RequestType::from_u8(service.code()).expect("a service that both know"),
        },
        FrameControl::Response { station, status } => FunctionCode::Response {
            state: profirust::fdl::ResponseState::from_u8(station.code() >> 4).expect("a station type"),
            status: profirust::fdl::ResponseStatus::from_u8(status.code()).expect("a status that both know"),
        },
    }
}

/// Compares both readings of one telegram. Tells what kind of telegram it is.
fn compare(octets: &[u8]) -> u32 {
    let Some(Ok((theirs, len))) = profirust::fdl::Telegram::deserialize(octets) else {
        panic!("profirust refuses {octets:02X?}")
    };
    assert_eq!(len, octets.len(), "{octets:02X?}");
    for cut in 0..len {
        assert!(profirust::fdl::Telegram::deserialize(&octets[..cut]).is_none(), "{octets:02X?} before its end");
    }
    match (Telegram::parse(octets).expect("our own telegram"), theirs) {
        (Telegram::ShortAck, profirust::fdl::Telegram::ShortConfirmation(_)) => 0,
        (Telegram::Token { da, sa }, profirust::fdl::Telegram::Token(token)) => {
            assert_eq!((da.get(), sa.get()), (token.da, token.sa), "{octets:02X?}");
            1
        }
        (Telegram::Data { header, du }, profirust::fdl::Telegram::Data(data)) => {
            let [dsap, ssap] = [header.dsap, header.ssap].map(|sap| sap.map(|sap| sap.0));
            let ours = (header.da.get(), header.sa.get(), dsap, ssap, function_code(header.fc), du);
            assert_eq!(ours, (data.h.da, data.h.sa, data.h.dsap, data.h.ssap, data.h.fc, data.pdu), "{octets:02X?}");
            assert_eq!(data.h.fc.to_byte(), header.fc.octet(), "{octets:02X?}");
            dsap.map_or(2, |dsap| 3 + u32::from(dsap))
        }
        (ours, theirs) => panic!("{octets:02X?} is {ours:?} or {theirs:?}"),
    }
}

#[test]
fn every_telegram_of_every_shipped_scenario_reads_the_same() {
    let all: Vec<_> = shipped().par_iter().map(|name| telegrams(name)).collect();
    let distinct: BTreeSet<Vec<u8>> = all.into_iter().flatten().collect();
    assert!(distinct.len() > 1_000, "{}", distinct.len());
    let kinds: BTreeSet<u32> = distinct.iter().map(|octets| compare(octets)).collect();
    // SC, token, and without and with each service access point that the scenarios use.
    let saps = [51, 58, 59, 60, 61, 62].map(|sap| 3 + sap);
    assert!(kinds.is_superset(&[&[0, 1, 2][..], &saps].concat().into_iter().collect()), "{kinds:?}");
}
