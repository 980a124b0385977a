//! The DP slave alone, with a device that does nothing but remember: which outputs are in force when, which inputs are
//! read, when the master is asked to read the diagnosis.

use isodp::dp::ms1::{Access, Records};
use isodp::dp::ms2;
use isodp::dp::slave::{Application, Identity, Refusal, Slave};
use isodp::fdl::{Heard, Outbox};
use isodp::observation::{Observation, SlaveState};
use isodp::time::{BitRate, Local, Span, Tbit};
use isodp::wire::acyclic::{ErrorCode, Record};
use isodp::wire::diag::{Channel, DiagBuffer};
use isodp::wire::prm::SetPrm;
use isodp::wire::{Address, Fcb, Frame, Header, Sap, Service};

use crate::support::address;

const MASTER: u8 = 2;
const OTHER: u8 = 1;
const OWN: u8 = 6;
const CFG: &[u8] = &[0x21, 0x11];
/// Lock, Sync_Req, Freeze_Req; no watchdog, ident 1234, groups 1 and 3, Fail_Safe.
const PRM: [u8; 10] = [0xB0, 1, 1, 11, 0x12, 0x34, 0x05, 0x40, 0x00, 0x00];

const DIAG: (Sap, Sap) = (Sap::SLAVE_DIAG, Sap::MASTER_MS0);

/// Two octets out, two octets in.
#[derive(Default)]
struct Device {
    /// Every outputs in force that it was told.
    told: Vec<Option<Vec<u8>>>,
    operates: Vec<bool>,
    clocks: usize,
    inputs: [u8; 2],
    frozen_at: Vec<u32>,
    blocks: Vec<Vec<u8>>,
    ext: bool,
    static_diagnosis: bool,
    revision: u32,
    left: bool,
}
impl Records for Device {
    fn read(&mut self, _access: Access, _record: Record, _out: &mut [u8]) -> Result<usize, ErrorCode> {
        Err(ErrorCode::NOT_SUPPORTED)
    }
    fn write(&mut self, _access: Access, _record: Record, _data: &[u8]) -> Result<(), ErrorCode> {
        Err(ErrorCode::NOT_SUPPORTED)
    }
    fn closed(&mut self, _access: Access) {}
}
impl Application for Device {
    fn check(&self, _prm: &SetPrm<'_>) -> Result<(), Refusal> {
        Ok(())
    }
    fn parameterise(&mut self, _prm: &SetPrm<'_>) {}
    fn enter(&mut self, _now: Local, _out: &mut Outbox) {}
    fn leave(&mut self, _now: Local, _out: &mut Outbox) {
        self.left = true;
    }
    fn outputs(&mut self, _now: Local, outputs: Option<&[u8]>, _sample: u32, _out: &mut Outbox) {
        self.told.push(outputs.map(<[u8]>::to_vec));
    }
    fn transfer(&mut self, _now: Local, outputs: Option<&[u8]>, _out: &mut Outbox) {
        self.told.push(outputs.map(<[u8]>::to_vec));
    }
    fn freeze(&mut self, _now: Local, sample: u32, _out: &mut Outbox) {
        self.frozen_at.push(sample);
    }
    fn inputs(&self, du: &mut [u8]) {
        du.copy_from_slice(&self.inputs);
    }
    fn synch(&mut self, _now: Local, _out: &mut Outbox) {
        self.clocks += 1;
    }
    fn operate(&mut self, _now: Local, operate: bool, _out: &mut Outbox) {
        self.operates.push(operate);
    }
    fn published(&mut self, _now: Local, _publisher: Address, _du: &[u8], _out: &mut Outbox) {}
    fn publishers(&self) -> u128 {
        0
    }
    fn diagnosis(&self, diagnosis: &mut DiagBuffer) {
        if self.ext {
            diagnosis.set_ext_diag();
        }
        if self.static_diagnosis {
            diagnosis.set_stat_diag();
        }
        for block in &self.blocks {
            diagnosis.device(block);
        }
    }
    fn diagnosis_revision(&self) -> u32 {
        self.revision
    }
}

/// The slave and its device on a bench.
struct Bench {
    slave: Slave,
    device: Device,
    now: Local,
    fcb: bool,
    out: Outbox,
}

impl Bench {
    /// In data exchange with these parameters.
    fn exchanging(prm: &[u8]) -> Self {
        let identity = Identity {
            address: address(OWN),
            ident: 0x1234,
            config: CFG.into(),
            outputs: 2,
            inputs: 2,
            fail_safe: true,
            publisher: false,
            sync: true,
            freeze: true,
            max_diag: 16,
            rate: BitRate::M12,
            t_sdr: Tbit(30),
            c1_max_data: 240,
            ms2: ms2::Settings {
                connections: 0,
                max_data: 240,
                send_timeout: 100,
                working: Span::ZERO,
                profile_ident: 0,
            },
        };
        let slave = Slave::new(identity);
        let mut bench = Self { slave, device: Device::default(), now: Local::ZERO, fcb: false, out: Outbox::new() };
        bench.slave.power_on(bench.now, &mut bench.device, &mut bench.out);
        assert_eq!(bench.srd((Sap::SET_PRM, Sap::MASTER_MS0), prm), [0xE5]);
        assert_eq!(bench.srd((Sap::CHK_CFG, Sap::MASTER_MS0), CFG), [0xE5]);
        assert_eq!(bench.slave.state(), SlaveState::DataExch);
        bench
    }
    /// The octets of the answer to this telegram.
    fn hear(&mut self, header: &Header, du: &[u8], sample: u32) -> Vec<u8> {
        let mut frame = Frame::new();
        frame.set_data(header, du).expect("a telegram");
        self.now += Span::from_us(100);
        self.out.clear();
        let heard = Heard { octets: frame.octets(), sample };
        self.slave.heard(self.now, heard, &mut self.device, &mut self.out);
        self.out.sending().map(|(_, reply)| reply.octets().to_vec()).unwrap_or_default()
    }
    fn srd(&mut self, (dsap, ssap): (Sap, Sap), du: &[u8]) -> Vec<u8> {
        self.fcb = !self.fcb;
        let header = Header::request(address(OWN), address(MASTER), Service::SrdHigh, Fcb::Alternate(self.fcb));
        self.hear(&header.with_saps(dsap, ssap), du, 0)
    }
    /// The master's Slave_Diag: status octets and everything behind the ident number.
    fn diag(&mut self) -> ([u8; 3], Vec<u8>) {
        let octets = self.srd(DIAG, &[]);
        let du = &octets[9..octets.len() - 2];
        ([du[0], du[1], du[2]], du[6..].to_vec())
    }
    /// A Data_Exchange: FC of the answer and its inputs.
    fn exchange(&mut self, du: &[u8]) -> (u8, Vec<u8>) {
        self.fcb = !self.fcb;
        let header = Header::request(address(OWN), address(MASTER), Service::SrdHigh, Fcb::Alternate(self.fcb));
        let octets = self.hear(&header, du, 0);
        match octets[..] {
            [0x10, _, _, fc, ..] => (fc, vec![]),
            _ => (octets[6], octets[7..octets.len() - 2].to_vec()),
        }
    }
    /// A Global_Control of this station; nobody answers.
    fn control_from(&mut self, station: u8, du: [u8; 2], sample: u32) {
        let header = Header::request(Address::BROADCAST, address(station), Service::SdnHigh, Fcb::Unused)
            .with_saps(Sap::GLOBAL_CONTROL, Sap::MASTER_MS0);
        assert_eq!(self.hear(&header, &du, sample), [0; 0]);
    }
    fn control(&mut self, command: u8, groups: u8) {
        self.control_from(MASTER, [command, groups], 77);
    }
    /// The outputs in force, as the device was told last and as RD_Outp reads them.
    fn outputs(&mut self) -> Option<Vec<u8>> {
        let read = self.srd((Sap::RD_OUTP, Sap::MASTER_MS0), &[]);
        let told = self.device.told.last().cloned().flatten();
        assert_eq!(read[9..11], told.clone().unwrap_or(vec![0; 2]), "RD_Outp reads what is in force");
        told
    }
}

const SYNC: u8 = 0x20;
const UNSYNC: u8 = 0x10;
const FREEZE: u8 = 0x08;
const UNFREEZE: u8 = 0x04;
const CLEAR: u8 = 0x02;
const DL: u8 = 0x08;
const DH: u8 = 0x0A;

#[test]
fn outputs_take_effect_with_sync_alone() {
    let mut bench = Bench::exchanging(&PRM);
    bench.exchange(&[1, 1]);
    bench.control(SYNC, 0);
    bench.exchange(&[2, 2]);
    bench.exchange(&[3, 3]);
    assert_eq!(bench.outputs(), Some(vec![1, 1]));
    // The clock is no Sync, nor is an Operate.
    bench.control(0x00, 0x80);
    bench.control(0x00, 0x00);
    assert_eq!((bench.outputs(), bench.device.clocks), (Some(vec![1, 1]), 1));
    bench.control(SYNC, 0);
    assert_eq!(bench.outputs(), Some(vec![3, 3]), "the last ones");
    bench.exchange(&[4, 4]);
    assert_eq!(bench.outputs(), Some(vec![3, 3]));
    bench.control(SYNC | UNSYNC, 0);
    assert_eq!(bench.outputs(), Some(vec![4, 4]), "Unsync wins, and brings what waits");
    bench.exchange(&[5, 5]);
    assert_eq!(bench.outputs(), Some(vec![5, 5]));
}

#[test]
fn inputs_stand_while_they_are_frozen() {
    let mut bench = Bench::exchanging(&PRM);
    bench.device.inputs = [1, 1];
    assert_eq!(bench.exchange(&[0, 0]).1, [1, 1]);
    bench.control(FREEZE, 0);
    bench.device.inputs = [2, 2];
    assert_eq!(bench.exchange(&[0, 0]).1, [1, 1]);
    assert_eq!(bench.srd((Sap::RD_INP, Sap::MASTER_MS0), &[])[9..11], [1, 1]);
    bench.control(FREEZE, 0);
    bench.device.inputs = [3, 3];
    assert_eq!(bench.exchange(&[0, 0]).1, [2, 2], "taken anew");
    assert_eq!(bench.device.frozen_at, [77, 77], "each with the position of its instant");
    bench.control(FREEZE | UNFREEZE, 0);
    assert_eq!(bench.exchange(&[0, 0]).1, [3, 3], "Unfreeze wins");
    // Outputs are no business of Freeze.
    bench.control(FREEZE, 0);
    bench.exchange(&[9, 9]);
    assert_eq!(bench.outputs(), Some(vec![9, 9]));
}

/// Groups 1 and 3 are 05: octet 7 of Set_Prm against octet 2 of Global_Control.
#[test]
fn a_command_is_for_the_selected_groups() {
    for (select, meant) in [(0x00, true), (0x01, true), (0x04, true), (0x0A, false), (0xFF, true), (0x80, false)] {
        let mut bench = Bench::exchanging(&PRM);
        bench.exchange(&[1, 1]);
        bench.control(SYNC | FREEZE, select);
        bench.exchange(&[2, 2]);
        assert_eq!(bench.outputs(), Some(vec![if meant { 1 } else { 2 }; 2]), "{select:02X}");
        assert_eq!(bench.diag().0[1], if meant { 0x34 } else { 0x04 }, "{select:02X}");
        // Clear_Data is for groups as well; in Sync mode as out of it.
        bench.control(CLEAR, select);
        assert_eq!(bench.outputs().is_none(), meant, "{select:02X}");
        assert_eq!(bench.device.operates, if meant { vec![true, false] } else { vec![] }, "{select:02X}");
        // Another master's command is none.
        bench.control_from(OTHER, [UNSYNC | UNFREEZE, 0], 0);
        assert_eq!(bench.diag().0[1], if meant { 0x34 } else { 0x04 });
    }
    // A slave in no group is meant by a command for all.
    let mut bench = Bench::exchanging(&[0xB0, 1, 1, 11, 0x12, 0x34, 0x00]);
    bench.control(SYNC, 0xFF);
    assert_eq!(bench.diag().0[1], 0x04);
    bench.control(SYNC, 0x00);
    assert_eq!(bench.diag().0[1], 0x24);
}

#[test]
fn clear_acts_at_once_in_sync_mode_too() {
    for empty in [false, true] {
        let mut bench = Bench::exchanging(&PRM);
        bench.exchange(&[1, 1]);
        bench.control(SYNC, 0);
        bench.exchange(&[2, 2]);
        if empty {
            assert_eq!(bench.exchange(&[]).0 & 0x0F, DH, "Sync_Mode changed");
        } else {
            bench.control(SYNC | CLEAR, 0);
        }
        assert_eq!(bench.outputs(), None, "Clear_Data comes last");
        bench.exchange(&[3, 3]);
        assert_eq!(bench.outputs(), None, "Sync mode still");
        bench.control(SYNC, 0);
        assert_eq!(bench.outputs(), Some(vec![3, 3]));
    }
}

#[test]
fn sync_and_freeze_end_with_data_exchange_and_need_their_request() {
    let mut bench = Bench::exchanging(&PRM);
    bench.exchange(&[1, 1]);
    bench.control(SYNC | FREEZE, 0);
    assert_eq!(
        bench.out.observations().copied().collect::<Vec<_>>(),
        [Observation::Held { outputs: true, inputs: true }]
    );
    assert_eq!(bench.exchange(&[1]).0, 0x03, "a wrong length");
    assert!(bench.device.left);
    assert_eq!(bench.diag().0, [0x02, 0x05, 0x00]);
    // The same device with neither request takes no command.
    let mut prm = PRM;
    prm[0] = 0x80;
    let mut bench = Bench::exchanging(&prm);
    bench.control(SYNC | FREEZE, 0);
    bench.exchange(&[2, 2]);
    assert_eq!((bench.outputs(), bench.diag().0), (Some(vec![2, 2]), [0x00, 0x04, 0x00]));
}

/// The end of the watchdog is the end of the outputs, of both modes and of what waited.
#[test]
fn after_the_watchdog_nothing_of_before_is_in_force() {
    let mut prm = PRM;
    prm[0] |= 0x08;
    let mut bench = Bench::exchanging(&prm);
    bench.exchange(&[1, 1]);
    bench.control(SYNC | FREEZE, 0);
    bench.exchange(&[2, 2]);
    bench.out.clear();
    bench.slave.watchdog(bench.now, &mut bench.device, &mut bench.out);
    assert!(bench.device.left);
    assert_eq!((bench.diag(), bench.slave.state()), (([0x02, 0x05, 0x00], vec![]), SlaveState::WaitPrm));
    assert_eq!(bench.exchange(&[3, 3]).0, 0x03, "RS");
    bench.device.told.clear();
    assert_eq!(bench.srd((Sap::SET_PRM, Sap::MASTER_MS0), &prm), [0xE5]);
    assert_eq!(bench.srd((Sap::CHK_CFG, Sap::MASTER_MS0), CFG), [0xE5]);
    assert_eq!(bench.outputs(), None);
    bench.control(SYNC, 0);
    assert_eq!(bench.outputs(), None, "what waited is gone");
    bench.control(UNSYNC, 0);
    bench.exchange(&[4, 4]);
    assert_eq!(bench.outputs(), Some(vec![4, 4]));
}

/// Without Fail_Safe zeros are outputs like any other, and an empty request has a wrong length.
#[test]
fn clear_for_a_slave_without_fail_safe_is_zeros() {
    let mut prm = PRM;
    prm[7] = 0;
    let mut bench = Bench::exchanging(&prm);
    bench.control(CLEAR, 0);
    bench.exchange(&[0, 0]);
    assert_eq!((bench.outputs(), &bench.device.operates[..]), (Some(vec![0, 0]), &[false][..]));
    assert_eq!((bench.exchange(&[]).0, bench.slave.state()), (0x03, SlaveState::WaitPrm));
}

#[test]
fn requests_of_a_device_that_has_neither_are_not_supported() {
    for (sync, freeze) in [(false, false), (true, false), (false, true), (true, true)] {
        for (status, good) in [(0x80, true), (0xA0, sync), (0x90, freeze), (0xB0, sync && freeze)] {
            let identity = Identity { sync, freeze, ..Bench::exchanging(&PRM).slave.identity().clone() };
            let mut bench = Bench::exchanging(&PRM);
            bench.slave = Slave::new(identity);
            bench.slave.power_on(bench.now, &mut bench.device, &mut bench.out);
            let mut prm = PRM;
            prm[0] = status;
            assert_eq!(bench.srd((Sap::SET_PRM, Sap::MASTER_MS0), &prm), [0xE5]);
            let expected = if good { [0x02, 0x04, 0x00] } else { [0x12, 0x05, 0x00] };
            assert_eq!(bench.diag().0, expected, "{status:02X} {sync} {freeze}");
        }
    }
}

#[test]
fn replies_are_of_high_priority_until_the_master_has_read_what_changed() {
    let mut bench = Bench::exchanging(&PRM);
    assert_eq!(bench.exchange(&[0, 0]).0, DL, "what start-up reads is no news");
    bench.device.ext = true;
    bench.device.blocks = vec![vec![0x81, 0x00, 0x00]];
    bench.device.revision += 1;
    for _ in 0..3 {
        assert_eq!(bench.exchange(&[0, 0]).0, DH);
    }
    // Another master reads it too, which is not what the slave waits for.
    let header = Header::request(address(OWN), address(OTHER), Service::SrdHigh, Fcb::First).with_saps(DIAG.0, DIAG.1);
    assert_eq!(bench.hear(&header, &[], 0)[9..12], [0x08, 0x04, 0x00]);
    assert_eq!(bench.exchange(&[0, 0]).0, DH);
    assert_eq!(bench.diag(), ([0x08, 0x04, 0x00], vec![0x04, 0x81, 0x00, 0x00]));
    assert_eq!(bench.exchange(&[0, 0]).0, DL);
    // Its end is a change as well, and so is Sync mode.
    (bench.device.ext, bench.device.blocks) = (false, vec![]);
    bench.device.revision += 1;
    assert_eq!((bench.exchange(&[0, 0]).0, bench.diag().0, bench.exchange(&[0, 0]).0), (DH, [0x00, 0x04, 0x00], DL));
    bench.control(SYNC, 1);
    assert_eq!((bench.exchange(&[0, 0]).0, bench.diag().0, bench.exchange(&[0, 0]).0), (DH, [0x00, 0x24, 0x00], DL));
    bench.control(SYNC, 1);
    assert_eq!(bench.exchange(&[0, 0]).0, DL, "the mode is the same");
}

/// What a repeated request gets is what the first one got, whatever became of the diagnosis between them.
#[test]
fn a_repeated_request_gets_the_same_answer() {
    let mut bench = Bench::exchanging(&PRM);
    bench.device.revision = 1;
    let (first, _) = bench.exchange(&[1, 1]);
    let header = Header::request(address(OWN), address(MASTER), Service::SrdHigh, Fcb::Alternate(bench.fcb));
    let told = bench.device.told.len();
    assert_eq!((first, bench.hear(&header, &[1, 1], 0)[6], bench.device.told.len()), (DH, DH, told));
    let diag = bench.srd(DIAG, &[]);
    let header = header.with_saps(DIAG.0, DIAG.1);
    bench.device.revision = 2;
    let header =
        Header { fc: Header::request(header.da, header.sa, Service::SrdHigh, Fcb::Alternate(bench.fcb)).fc, ..header };
    assert_eq!(bench.hear(&header, &[], 0), diag);
    assert_eq!(bench.exchange(&[1, 1]).0, DH, "revision 2 has not been read");
}

#[test]
fn static_diagnosis_and_what_does_not_fit_are_said_in_octets_2_and_3() {
    let mut bench = Bench::exchanging(&PRM);
    bench.device.static_diagnosis = true;
    assert_eq!(bench.diag(), ([0x00, 0x06, 0x00], vec![]));
    // 16 octets hold ten of blocks.
    bench.device.blocks = vec![vec![0x81; 4], vec![0x82; 5], vec![0x83; 4]];
    let blocks = [&[5][..], &[0x81; 4], &[5], &[0x83; 4]].concat();
    assert_eq!(bench.diag(), ([0x00, 0x06, 0x80], blocks));
    let channel = Channel { module: 1, channel: 0x40, error: 0xA6 };
    let mut own = DiagBuffer::new(16);
    assert!(own.channel(channel) && own.identifier(&[2]));
    assert_eq!(bench.slave.diagnosis(&own).extended, [0x81, 0x40, 0xA6, 0x42, 0x02]);
}
