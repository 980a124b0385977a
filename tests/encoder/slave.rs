//! The DP slave of the encoder: every state with every input (EN 50170-2; manual 2.1.1).

use isodp::observation::SlaveState;
use isodp::time::Span;
use isodp::wire::{Sap, Service, Status};

use crate::rig::{
    CFG, CHK_CFG, GET_CFG, MASTER, MS1, PRM, RD_INP, RD_OUTP, Reply, Rig, SET_PRM, SLAVE_DIAG, STRANGER, prm,
};

type Input = fn(&mut Rig) -> Reply;

/// An input, tried in each state.
#[derive(Clone, Copy)]
struct Try {
    name: &'static str,
    input: Input,
    /// Answer and next state from WAIT_PRM, WAIT_CFG, DATA_EXCH.
    expected: [(Kind, SlaveState); 3],
}

/// What an answer is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    Nothing,
    Ack,
    /// So many octets.
    Data(usize),
    Rs,
}
use Kind::{Ack, Data, Nothing, Rs};
use SlaveState::{DataExch, WaitCfg, WaitPrm};

fn kind(reply: &Reply) -> Kind {
    match reply {
        Reply::Nothing => Nothing,
        Reply::Ack => Ack,
        Reply::Data(_, du) => Data(du.len()),
        Reply::Status(Status::Rs) => Rs,
        Reply::Status(other) => panic!("{other:?}"),
    }
}
/// A slave in this state with [`PRM`].
fn in_state(state: SlaveState) -> Rig {
    match state {
        SlaveState::PowerOn => unreachable!("the bench has supply"),
        WaitPrm => Rig::new(),
        WaitCfg => Rig::parameterised(&PRM),
        DataExch => Rig::exchanging(&PRM),
    }
}
fn walk(tries: &[Try]) {
    for case in tries {
        for (state, expected) in [WaitPrm, WaitCfg, DataExch].into_iter().zip(case.expected) {
            let mut rig = in_state(state);
            let reply = (case.input)(&mut rig);
            assert_eq!((kind(&reply), rig.state()), expected, "{} in {state}", case.name);
        }
    }
}
/// The same in every state: this answer, no other state.
const fn always(kind: Kind) -> [(Kind, SlaveState); 3] {
    [(kind, WaitPrm), (kind, WaitCfg), (kind, DataExch)]
}
/// Answered in data exchange alone.
const fn exchanging(kind: Kind) -> [(Kind, SlaveState); 3] {
    [(Rs, WaitPrm), (Rs, WaitCfg), (kind, DataExch)]
}

#[test]
fn section_2_1_1_states_and_telegrams_of_the_start_up() {
    let try_ = |name, input, expected| Try { name, input, expected };
    walk(&[
        try_("good Set_Prm", |rig| rig.srd(SET_PRM, &PRM), [(Ack, WaitCfg); 3]),
        try_("bad Set_Prm", |rig| rig.srd(SET_PRM, &prm(&[(43, 0)])), [(Ack, WaitPrm); 3]),
        try_("Set_Prm of 3 octets", |rig| rig.srd(SET_PRM, &PRM[..3]), [(Ack, WaitPrm); 3]),
        try_("Unlock", |rig| rig.srd(SET_PRM, &prm(&[(1, 0x40)])), [(Ack, WaitPrm); 3]),
        try_("Lock and Unlock", |rig| rig.srd(SET_PRM, &prm(&[(1, 0xC0)])), [(Ack, WaitPrm); 3]),
        try_("min T_SDR alone", |rig| rig.srd(SET_PRM, &prm(&[(1, 0), (5, 0x12)])[..7]), always(Ack)),
        try_("good Chk_Cfg", |rig| rig.srd(CHK_CFG, &CFG), [(Rs, WaitPrm), (Ack, DataExch), (Ack, DataExch)]),
        try_("bad Chk_Cfg", |rig| rig.srd(CHK_CFG, &[0]), [(Rs, WaitPrm), (Ack, WaitPrm), (Ack, WaitPrm)]),
        try_("Slave_Diag", |rig| rig.srd(SLAVE_DIAG, &[]), always(Data(6))),
        try_("Get_Cfg", |rig| rig.srd(GET_CFG, &[]), always(Data(6))),
        try_("a service access point it has not", |rig| rig.srd((Sap(40), Sap::MASTER_MS0), &[]), always(Rs)),
        try_("Set_Slave_Add", |rig| rig.srd((Sap::SET_SLAVE_ADD, Sap::MASTER_MS0), &[9, 6, 0xDF, 0]), always(Rs)),
    ]);
}

#[test]
fn section_2_states_and_telegrams_of_data_exchange() {
    let try_ = |name, input, expected| Try { name, input, expected };
    walk(&[
        try_("Data_Exchange", |rig| rig.exchange(&[0; 4]), exchanging(Data(12))),
        try_("Data_Exchange in Clear, empty", |rig| rig.exchange(&[]), exchanging(Data(12))),
        try_("too short", |rig| rig.exchange(&[0; 3]), [(Rs, WaitPrm), (Rs, WaitCfg), (Rs, WaitPrm)]),
        try_("too long", |rig| rig.exchange(&[0; 5]), [(Rs, WaitPrm), (Rs, WaitCfg), (Rs, WaitPrm)]),
        try_("RD_Inp", |rig| rig.srd(RD_INP, &[]), exchanging(Data(12))),
        try_("RD_Outp", |rig| rig.srd(RD_OUTP, &[]), exchanging(Data(4))),
        try_("MS1", |rig| rig.srd(MS1, &[0x5E, 1, 47, 240]), exchanging(Ack)),
        try_("SYNCH", |rig| rig.control_from(MASTER, [0x00, 0x80]), always(Nothing)),
        try_("Clear", |rig| rig.control_from(MASTER, [0x02, 0x00]), always(Nothing)),
        try_(
            "the watchdog",
            |rig| {
                rig.advance(rig.now + Span::from_ms(201));
                Reply::Nothing
            },
            [(Nothing, WaitPrm), (Nothing, WaitPrm), (Nothing, WaitPrm)],
        ),
    ]);
}

fn other(rig: &mut Rig, saps: (Sap, Sap), du: &[u8]) -> Reply {
    rig.srd_from(STRANGER, saps, du)
}
#[test]
fn section_2_1_1_another_master_changes_nothing() {
    let tries: [(&str, Input, [Kind; 2]); 10] = [
        ("Set_Prm", |rig| other(rig, SET_PRM, &PRM), [Rs, Rs]),
        ("bad Set_Prm", |rig| other(rig, SET_PRM, &PRM[..9]), [Rs, Rs]),
        ("Unlock", |rig| other(rig, SET_PRM, &prm(&[(1, 0x40)])), [Rs, Rs]),
        ("Chk_Cfg", |rig| other(rig, CHK_CFG, &CFG), [Rs, Rs]),
        ("bad Chk_Cfg", |rig| other(rig, CHK_CFG, &[0]), [Rs, Rs]),
        ("Data_Exchange", |rig| rig.exchange_from(STRANGER, Service::SrdHigh, &[0; 4]), [Rs, Rs]),
        ("Data_Exchange too long", |rig| rig.exchange_from(STRANGER, Service::SrdHigh, &[0; 5]), [Rs, Rs]),
        ("MS1", |rig| other(rig, MS1, &[0x5E, 1, 47, 240]), [Rs, Rs]),
        ("Slave_Diag", |rig| other(rig, SLAVE_DIAG, &[]), [Data(6), Data(6)]),
        ("RD_Inp", |rig| other(rig, RD_INP, &[]), [Rs, Data(12)]),
    ];
    for (name, input, expected) in tries {
        for (state, expected) in [WaitCfg, DataExch].into_iter().zip(expected) {
            let mut rig = in_state(state);
            assert_eq!((kind(&input(&mut rig)), rig.state()), (expected, state), "{name} in {state}");
            assert_eq!(rig.diag()[3], MASTER, "{name}: the slave still belongs to its master");
        }
    }
    // Nor does it keep the slave from its watchdog.
    let mut rig = in_state(DataExch);
    for _ in 0..30 {
        rig.advance(rig.now + Span::from_ms(7));
        other(&mut rig, SLAVE_DIAG, &[]);
    }
    assert_eq!(rig.state(), WaitPrm, "210 ms without its own master");
    // Unlocked by its master it is free for the other one.
    let mut rig = in_state(DataExch);
    rig.srd(SET_PRM, &prm(&[(1, 0x40)]));
    assert_eq!(other(&mut rig, SET_PRM, &PRM), Reply::Ack);
    assert_eq!((rig.state(), rig.diag()[3]), (WaitCfg, STRANGER));
}

#[test]
fn section_3_1_the_watchdog_runs_for_its_factors_and_every_request_of_the_master_renews_it() {
    // 10 ms x 3 x 2, 1 ms x 30 x 2.
    for changes in [[(2, 3), (3, 2), (8, 0xC0)], [(2, 30), (3, 2), (8, 0xC4)]] {
        let mut rig = Rig::exchanging(&prm(&changes));
        let last = rig.now - Span::from_us(0);
        rig.srd(SLAVE_DIAG, &[]);
        let renewed = rig.now;
        assert!(renewed > last);
        rig.advance(renewed + Span::from_ms(60) - Span::from_us(1));
        assert_eq!(rig.state(), DataExch);
        rig.advance(renewed + Span::from_ms(60));
        assert_eq!((rig.state(), rig.diag()), (WaitPrm, vec![0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF]));
    }
    let mut rig = Rig::exchanging(&prm(&[(1, 0x80)]));
    rig.advance(rig.now + Span::from_s(100));
    assert_eq!(rig.state(), DataExch, "off");
}

#[test]
fn section_2_rd_inp_and_rd_outp_read_what_data_exchange_carries() {
    let mut rig = Rig::exchanging(&PRM);
    rig.raw = 0x12345;
    let outputs = [0x10, 0x00, 0x20, 0x00];
    let Reply::Data(MASTER, inputs) = rig.exchange(&outputs) else { panic!("no data") };
    assert_eq!(inputs, [0, 0, 0x20, 0, 0x00, 0x91, 0xA2, 0x80, 0x00, 0x01, 0x23, 0x45]);
    assert_eq!(rig.srd_from(STRANGER, RD_INP, &[]), Reply::Data(STRANGER, inputs));
    assert_eq!(rig.srd_from(STRANGER, RD_OUTP, &[]), Reply::Data(STRANGER, outputs.to_vec()));
    rig.exchange(&[]);
    assert_eq!(rig.srd(RD_OUTP, &[]), Reply::Data(MASTER, vec![0; 4]), "Clear");
}

#[test]
fn section_2_1_2_only_the_own_masters_global_control_counts() {
    let mut rig = Rig::parameterised(&PRM);
    rig.srd(CHK_CFG, &CFG);
    assert_eq!(rig.control_from(STRANGER, [0x00, 0x00]), Reply::Nothing);
    rig.exchange(&[0; 4]);
    assert_eq!(rig.encoder.phase(), isodp::observation::Phase::Configuration, "another master's Operate");
    rig.control([0x00, 0x01]);
    rig.exchange(&[0; 4]);
    assert_eq!(rig.encoder.phase(), isodp::observation::Phase::Configuration, "Operate for group 1");
    rig.control([0x00, 0x00]);
    assert_eq!(rig.encoder.phase(), isodp::observation::Phase::Configuration, "no valid data yet");
    rig.exchange(&[0; 4]);
    assert_eq!(rig.encoder.phase(), isodp::observation::Phase::Clock);
}
