//! An encoder on the bench: one unit, stepped telegram by telegram, without a simulator. Its crystal is exact, its shaft
//! stands where the test puts it.

use isodp::device::encoder::{Disc, Encoder};
use isodp::device::profile;
use isodp::device::unit::UnitSettings;
use isodp::fdl::{Heard, Input, Order, Outbox, Station, Timer};
use isodp::observation::{Leds, Observation, SlaveState};
use isodp::time::{BitRate, Local, Span, Tbit};
use isodp::wire::drive::{G1Stw, Inputs81, Outputs81, Stw2};
use isodp::wire::{Address, Fcb, Frame, FrameControl, Header, Sap, Service, Status, Telegram};

use crate::support::address;

/// Set_Prm of manual 3.1: 59 octets, T_DP 2 ms, T_I 125 us, T_O 1 ms, T_DX 449 us, T_PLL_W 1 us, watchdog 200 ms.
pub(crate) const PRM: [u8; 59] = [
    0x88, 20, 1, 11, 0x06, 0xDF, 0x80, // octets 1 to 7: DP
    0xC0, 0x00, 0x18, // octets 8 to 10: DP-V1, Fail_Safe, IsoM_Req, Prm_Structure
    0x15, 0x81, 0x00, 0x00, 0x00, // octets 11 to 15: user block, nothing enabled
    0x00, 0x00, 0x20, 0x00, 0x02, 0x00, 0x00, 0x00, 1, // octets 16 to 24: 8192, 33554432, 1 failure
    0, 0, 0, 0, 0, 0, 0, // octets 25 to 31
    0x1C, 0x04, 0x00, 0x00, 1, // octets 32 to 36: isochronous block, version 1
    0x00, 0x00, 0x05, 0xDC, 0x00, 16, 1, // octets 37 to 43: T_BASE_DP, T_DP, T_MAPC
    0x00, 0x00, 0x05, 0xDC, 0x00, 1, 0x00, 8, // octets 44 to 51: T_BASE_IO, T_I, T_O
    0x00, 0x00, 0x15, 0x0C, 0x00, 12, 0x00, 0, // octets 52 to 59: T_DX, T_PLL_W, T_PLL_D
];
/// Chk_Cfg of manual 2.1.1, telegram 81.
pub(crate) const CFG: [u8; 6] = [0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x51];
/// The cycle of [`PRM`].
pub(crate) const T_DP: Span = Span::from_ms(2);

pub(crate) const SET_PRM: (Sap, Sap) = (Sap::SET_PRM, Sap::MASTER_MS0);
pub(crate) const CHK_CFG: (Sap, Sap) = (Sap::CHK_CFG, Sap::MASTER_MS0);
pub(crate) const SLAVE_DIAG: (Sap, Sap) = (Sap::SLAVE_DIAG, Sap::MASTER_MS0);
pub(crate) const GET_CFG: (Sap, Sap) = (Sap::GET_CFG, Sap::MASTER_MS0);
pub(crate) const RD_INP: (Sap, Sap) = (Sap::RD_INP, Sap::MASTER_MS0);
pub(crate) const RD_OUTP: (Sap, Sap) = (Sap::RD_OUTP, Sap::MASTER_MS0);
pub(crate) const MS1: (Sap, Sap) = (Sap::MS1, Sap::MASTER_MS1);
/// The resource manager and the first connection of MS2.
pub(crate) const MS2_RM: (Sap, Sap) = (Sap::MS2_RM, Sap::MASTER_MS2);
pub(crate) const MS2: [(Sap, Sap); 2] = [(Sap(0), Sap::MASTER_MS2), (Sap(1), Sap::MASTER_MS2)];
/// The master, the encoder and a second master.
pub(crate) const MASTER: u8 = 2;
pub(crate) const ENCODER: u8 = 6;
pub(crate) const STRANGER: u8 = 1;

/// [`PRM`] with other octets, numbered from 1 as in the manual.
pub(crate) fn prm(changes: &[(usize, u8)]) -> Vec<u8> {
    let mut du = PRM.to_vec();
    for &(octet, value) in changes {
        du[octet - 1] = value;
    }
    du
}

/// What the encoder answers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Reply {
    Nothing,
    /// SC.
    Ack,
    /// DL with these octets, to this address.
    Data(u8, Vec<u8>),
    /// A status without data.
    Status(Status),
}

/// The encoder with what firmware would bring along: timers, the latch, the line.
pub(crate) struct Rig {
    pub(crate) encoder: Encoder,
    pub(crate) now: Local,
    /// Raw position of the shaft (steps).
    pub(crate) raw: u32,
    /// Everything observed, in order.
    pub(crate) seen: Vec<Observation>,
    /// Where the next cycle of [`Rig::cycle`] begins.
    pub(crate) t0: Local,
    timers: [Option<Local>; Timer::ALL.len()],
    sample: Option<Local>,
    out: Outbox,
}

impl Rig {
    /// An encoder whose supply has just come on.
    pub(crate) fn new() -> Self {
        let profile = profile::find("posital-ocd-dpb1b").expect("a known device");
        let settings = UnitSettings::new(address(ENCODER), BitRate::M12, Tbit(30));
        let mut rig = Self {
            encoder: Encoder::new(profile, settings, Disc::new(profile, &settings.options)),
            now: Local::ZERO,
            raw: 0,
            seen: Vec::new(),
            t0: Local::ZERO + T_DP,
            timers: [None; Timer::ALL.len()],
            sample: None,
            out: Outbox::new(),
        };
        rig.step(Input::PowerOn);
        rig
    }
    /// An encoder that took this Set_Prm.
    pub(crate) fn parameterised(prm: &[u8]) -> Self {
        let mut rig = Self::new();
        assert_eq!(rig.srd(SET_PRM, prm), Reply::Ack);
        assert_eq!(rig.state(), SlaveState::WaitCfg, "the parameters are good");
        rig
    }
    /// An encoder in data exchange with this Set_Prm, the master in Operate.
    pub(crate) fn exchanging(prm: &[u8]) -> Self {
        let mut rig = Self::parameterised(prm);
        assert_eq!(rig.srd(CHK_CFG, &CFG), Reply::Ack);
        assert_eq!(rig.state(), SlaveState::DataExch);
        rig.control([0x00, 0x00]);
        rig
    }

    pub(crate) fn state(&self) -> SlaveState {
        self.encoder.slave().state()
    }
    pub(crate) fn leds(&self) -> Leds {
        self.encoder.leds()
    }
    /// The diagnosis as Slave_Diag reads it (manual 5.1).
    pub(crate) fn diag(&mut self) -> Vec<u8> {
        match self.srd(SLAVE_DIAG, &[]) {
            Reply::Data(MASTER, du) => du,
            other => panic!("{other:?} is no diagnosis"),
        }
    }
    /// Takes everything observed so far.
    pub(crate) fn take_seen(&mut self) -> Vec<Observation> {
        core::mem::take(&mut self.seen)
    }

    fn step(&mut self, input: Input<'_, core::convert::Infallible>) {
        self.out.clear();
        self.encoder.step(self.now, input, &mut self.out);
        for (which, order) in self.out.orders() {
            // The sample is asked for behind the timers.
            apply(self.timers.get_mut(which).unwrap_or(&mut self.sample), order);
        }
        self.seen.extend(self.out.observations().copied());
    }
    /// Lets time pass; timers and the latch come when they are due.
    pub(crate) fn advance(&mut self, to: Local) {
        loop {
            let timer = Timer::ALL.into_iter().filter_map(|timer| Some((self.timers[timer as usize]?, timer))).min();
            let due = timer.map(|(at, _)| at).into_iter().chain(self.sample).min();
            let Some(at) = due.filter(|&at| at <= to) else { break };
            self.now = self.now.max(at);
            if self.sample == Some(at) {
                self.sample = None;
                self.step(Input::Sample(self.raw));
            } else if let Some((_, timer)) = timer {
                self.timers[timer as usize] = None;
                self.step(Input::Deadline { timer, busy: false });
            }
        }
        self.now = self.now.max(to);
    }
    /// Hears a telegram 100 us from now.
    pub(crate) fn telegram(&mut self, header: &Header, du: &[u8]) -> Reply {
        self.advance(self.now + Span::from_us(100));
        self.telegram_now(header, du)
    }
    fn telegram_now(&mut self, header: &Header, du: &[u8]) -> Reply {
        let mut frame = Frame::new();
        frame.set_data(header, du).expect("a telegram");
        let sample = self.raw;
        self.step(Input::Telegram(Heard { octets: frame.octets(), sample }));
        let Some((_, reply)) = self.out.sending() else { return Reply::Nothing };
        match reply.telegram().expect("a telegram") {
            Telegram::ShortAck => Reply::Ack,
            Telegram::Data { header, du } => match header.fc {
                FrameControl::Response { status: Status::Dl, .. } => Reply::Data(header.da.get(), du.to_vec()),
                FrameControl::Response { status, .. } => Reply::Status(status),
                FrameControl::Request { .. } => panic!("a slave asks for nothing"),
            },
            Telegram::Token { .. } => panic!("a slave has no token"),
        }
    }
    /// A request of this station to a service access point.
    pub(crate) fn srd_from(&mut self, station: u8, (dsap, ssap): (Sap, Sap), du: &[u8]) -> Reply {
        let header = Header::request(address(ENCODER), address(station), Service::SrdHigh, Fcb::First);
        self.telegram(&header.with_saps(dsap, ssap), du)
    }
    /// A request of the master to a service access point.
    pub(crate) fn srd(&mut self, saps: (Sap, Sap), du: &[u8]) -> Reply {
        self.srd_from(MASTER, saps, du)
    }
    /// Data_Exchange of this station.
    pub(crate) fn exchange_from(&mut self, station: u8, service: Service, du: &[u8]) -> Reply {
        let header = Header::request(address(ENCODER), address(station), service, Fcb::First);
        self.telegram(&header, du)
    }
    /// Data_Exchange of the master.
    pub(crate) fn exchange(&mut self, du: &[u8]) -> Reply {
        self.exchange_from(MASTER, Service::SrdHigh, du)
    }
    /// Global_Control of this station to all.
    pub(crate) fn control_from(&mut self, station: u8, du: [u8; 2]) -> Reply {
        let header = Header::request(Address::BROADCAST, address(station), Service::SdnHigh, Fcb::Unused);
        self.telegram_now(&header.with_saps(Sap::GLOBAL_CONTROL, Sap::MASTER_MS0), &du)
    }
    /// Global_Control of the master.
    pub(crate) fn control(&mut self, du: [u8; 2]) {
        assert_eq!(self.control_from(MASTER, du), Reply::Nothing);
    }

    /// One cycle: SYNCH at its instant unless it is lost, Data_Exchange 100 us later, T_O, T_I. What the reply carries.
    pub(crate) fn cycle_with(&mut self, synch: bool, mls: u8, g1_stw: u16) -> Inputs81 {
        if self.t0 < self.now {
            self.t0 = self.now + T_DP;
        }
        self.advance(self.t0);
        if synch {
            self.control([0x00, 0x80]);
        }
        let outputs = Outputs81 { stw2: Stw2(u16::from(mls) << 12), g1_stw: G1Stw(g1_stw) };
        let reply = self.exchange(&outputs.emit());
        self.t0 += T_DP;
        self.advance(self.t0 - Span::from_us(50));
        match reply {
            Reply::Data(_, du) => Inputs81::parse(&du).expect("telegram 81"),
            other => panic!("{other:?} is no telegram 81"),
        }
    }
    /// One cycle with its SYNCH.
    pub(crate) fn cycle(&mut self, mls: u8, g1_stw: u16) -> Inputs81 {
        self.cycle_with(true, mls, g1_stw)
    }
}

fn apply(place: &mut Option<Local>, order: Order) {
    match order {
        Order::At(at) => *place = Some(at),
        Order::Off => *place = None,
    }
}

/// The master's sign of life: counts once in so many cycles from 1 on.
pub(crate) struct Life {
    hold: u32,
    cycle: u32,
}

impl Life {
    pub(crate) fn new(hold: u8) -> Self {
        Self { hold: hold.into(), cycle: 0 }
    }
    /// The value of the next cycle.
    pub(crate) fn next(&mut self) -> u8 {
        let sign = (self.cycle / self.hold % 15) as u8 + 1;
        self.cycle += 1;
        sign
    }
}
