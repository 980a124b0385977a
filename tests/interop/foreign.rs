//! profirust's master as a station of our network.
//!
//! Its UART sees the line character by character, as a chip does. Time is the network's: the master is polled every
//! [`STEP`] and when a telegram ends, with the instant that its crystal shows, in whole microseconds as profirust counts.

use std::cell::RefCell;
use std::rc::Rc;

use isodp::device::encoder::{Disc, Encoder};
use isodp::device::profile;
use isodp::device::unit::UnitSettings;
use isodp::fdl::{Filter, Input, Outbox, Station, Timer};
use isodp::observation::{Observation, SlaveCause, SlaveState};
use isodp::sim::crystal::Crystal;
use isodp::sim::fault::Faults;
use isodp::sim::jitter::{GcJitter, JitterSource};
use isodp::sim::motion::{Angle, Motion, Resolution, Shaft};
use isodp::sim::network::{Act, Network, Site, Until, When, Wiring};
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::sim::topology::Place;
use isodp::time::{BitRate, Local, Span, Tbit, Time};
use isodp::wire::{Address, Frame};
use profirust::Baudrate;
use profirust::dp::{DiagnosticFlags, DpMaster, Peripheral, PeripheralEvent, PeripheralHandle, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::phy::ProfibusPhy;

use crate::support::address;

/// Between two polls: 1 bit at 500 kbit/s, 3 bits at 1.5 Mbit/s. Whole microseconds, since profirust knows no others.
pub(crate) const STEP: Span = Span::from_us(2);
/// The watchdog that the master sets in its slaves.
pub(crate) const WATCHDOG: Span = Span::from_ms(100);
/// T_SDR of the encoders.
pub(crate) const T_SDR: Tbit = Tbit(30);
pub(crate) const MASTER: u8 = 2;
/// Ident_Number of the encoder.
pub(crate) const IDENT: u16 = 0x06DF;
/// Chk_Cfg of manual 2.1.1, telegram 81.
pub(crate) const CFG: &[u8] = &[0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x51];
/// Set_Prm from octet 8 on (manual 3.1): DP-V1 with blocks but without isochronous mode, and the user block.
pub(crate) const USER: &[u8] = &[
    0xC0, 0x00, 0x08, // octets 8 to 10: DPV1_Enable, Fail_Safe, Prm_Structure
    0x15, 0x81, 0x00, 0x00, 0x08, // octets 11 to 15: user block, as the GSD has it
    0x00, 0x00, 0x20, 0x00, 0x02, 0x00, 0x00, 0x00, 1, // octets 16 to 24: 8192, 33554432, 1 failure
    0, 0, 0, 0, 0, 0, 0, // octets 25 to 31
];

/// What the foreign master's configuration says of one slave.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Configured {
    pub(crate) address: u8,
    pub(crate) ident: u16,
    pub(crate) user: &'static [u8],
    pub(crate) cfg: &'static [u8],
}

impl Configured {
    /// The encoder as it wants to be parameterised.
    pub(crate) const fn good(address: u8) -> Self {
        Self { address, ident: IDENT, user: USER, cfg: CFG }
    }
    fn peripheral(self) -> Peripheral<'static> {
        let options = PeripheralOptions {
            ident_number: self.ident,
            max_tsdr: 60,
            fail_safe: true,
            user_parameters: Some(self.user),
            config: Some(self.cfg),
            ..PeripheralOptions::default()
        };
        Peripheral::new(self.address, options, vec![0; 12], vec![0; 4])
    }
}

/// What the test has the foreign master do.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Order {
    /// Leaves the bus.
    Stop,
    /// Comes onto the bus.
    Start,
    /// Outputs for one slave from now on.
    Outputs(u8, [u8; 4]),
    /// Reads the diagnosis of one slave in data exchange.
    Diagnose(u8),
    /// Forgets a slave and begins with it anew, configured like this.
    Anew(Configured),
}

/// A telegram as it was on the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Sent {
    /// First bit.
    pub(crate) start: Time,
    /// Last bit.
    pub(crate) end: Time,
    pub(crate) sender: u8,
    pub(crate) octets: Vec<u8>,
}

/// All telegrams so far: written by the recorder, read by the UART.
type Line = Rc<RefCell<Vec<Sent>>>;

/// profirust's physical layer: a UART on our line. There is no cable, so a character arrives when its last bit is sent.
struct Uart {
    rate: BitRate,
    line: Line,
    now: Local,
    /// Its transmitter runs until here.
    sends_until: Local,
    /// What it is to send from now on.
    to_send: Option<Vec<u8>>,
    received: Vec<u8>,
    /// Number of the telegram that is arriving, and how many of its characters have arrived.
    arriving: (usize, usize),
}

impl Uart {
    /// Takes all characters whose last bit is over. Half duplex: its own are not among them.
    fn advance(&mut self, now: Local) {
        self.now = now;
        let (number, taken) = &mut self.arriving;
        for sent in &self.line.borrow()[*number..] {
            let span = now.since_zero() - sent.start.since_zero();
            let arrived = (span.div_floor(self.rate.octets(1)).max(0) as usize).min(sent.octets.len());
            if sent.sender != MASTER {
                self.received.extend(&sent.octets[*taken..arrived]);
            }
            *taken = arrived;
            if arrived < sent.octets.len() {
                break;
            }
            (*number, *taken) = (*number + 1, 0);
        }
    }
}

impl ProfibusPhy for Uart {
    fn poll_transmission(&mut self, _: profirust::time::Instant) -> bool {
        self.now < self.sends_until
    }
    fn transmit_data<F, R>(&mut self, now: profirust::time::Instant, fill: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        assert!(!self.poll_transmission(now), "profirust sends while it sends");
        let mut octets = vec![0; 256];
        let (len, result) = fill(&mut octets);
        octets.truncate(len);
        if len > 0 {
            self.sends_until = self.now + self.rate.octets(len);
            assert_eq!(self.to_send.replace(octets), None, "one telegram in a poll");
        }
        result
    }
    fn receive_data<F, R>(&mut self, _: profirust::time::Instant, take: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let (taken, result) = take(&self.received);
        self.received.drain(..taken);
        result
    }
}

/// What happened to a slave, but for its many Data_Exchanges.
pub(crate) type Happened = (Local, u8, PeripheralEvent);

/// profirust's master.
pub(crate) struct Foreign {
    uart: Uart,
    fdl: FdlActiveStation,
    dp: DpMaster<'static>,
    pub(crate) events: Vec<Happened>,
    /// Data_Exchanges that profirust found good.
    pub(crate) exchanges: u64,
    /// Whose diagnosis is to be read.
    diagnose: Option<u8>,
}

impl Foreign {
    fn new(rate: BitRate, line: Line, slaves: &[Configured]) -> Self {
        let mut dp = DpMaster::new(Vec::new());
        for slave in slaves {
            dp.add(slave.peripheral());
        }
        dp.enter_operate();
        let baudrate = match rate {
            BitRate::K500 => Baudrate::B500000,
            BitRate::M1_5 => Baudrate::B1500000,
            other => panic!("profirust's microseconds are not for {other}"),
        };
        let watchdog = profirust::time::Duration::from_millis((WATCHDOG.ticks() / Span::from_ms(1).ticks()) as u64);
        let params = ParametersBuilder::new(MASTER, baudrate).watchdog_timeout(watchdog).build_verified(&dp);
        let (now, arriving) = (Local::ZERO, (0, 0));
        let uart = Uart { rate, line, now, sends_until: now, to_send: None, received: Vec::new(), arriving };
        Self { uart, fdl: FdlActiveStation::new(params), dp, events: Vec::new(), exchanges: 0, diagnose: None }
    }
    fn handle(&self, slave: u8) -> PeripheralHandle {
        self.dp.iter().find(|(_, peripheral)| peripheral.address() == slave).expect("a configured slave").0
    }
    fn peripheral(&self, slave: u8) -> &Peripheral<'static> {
        self.dp.iter().map(|(_, peripheral)| peripheral).find(|peripheral| peripheral.address() == slave).expect("one")
    }
    /// Whether profirust exchanges data with a slave.
    pub(crate) fn runs(&self, slave: u8) -> bool {
        self.peripheral(slave).is_running()
    }
    /// The inputs of a slave as profirust's application sees them.
    pub(crate) fn inputs(&self, slave: u8) -> &[u8] {
        self.peripheral(slave).pi_i()
    }
    /// What profirust read last: flags, parameterising master, Ident_Number.
    pub(crate) fn diagnosis(&self, slave: u8) -> Option<(DiagnosticFlags, Option<u8>, u16)> {
        let diagnosis = self.peripheral(slave).last_diagnostics()?;
        Some((diagnosis.flags, diagnosis.master_address, diagnosis.ident_number))
    }
    /// What happened to one slave, in order.
    pub(crate) fn events_of(&self, slave: u8) -> Vec<PeripheralEvent> {
        self.events.iter().filter(|&&(_, of, _)| of == slave).map(|&(.., event)| event).collect()
    }

    fn poll(&mut self, now: Local, out: &mut Outbox) {
        self.uart.advance(now);
        let micros = now.since_zero().div_floor(Span::from_us(1));
        self.fdl.poll(profirust::time::Instant::from_micros(micros), &mut self.uart, &mut self.dp);
        match self.dp.take_last_events().peripheral {
            Some((handle, PeripheralEvent::DataExchanged)) => {
                self.exchanges += 1;
                // Not between request and reply: profirust would take the reply for the diagnosis.
                let slave = self.dp.get_mut(handle);
                if self.diagnose.take_if(|diagnose| *diagnose == slave.address()).is_some() {
                    slave.request_diagnostics();
                }
            }
            Some((handle, event)) => {
                let slave = self.dp.get_mut(handle).address();
                self.events.push((now, slave, event));
            }
            None => {}
        }
        if let Some(octets) = self.uart.to_send.take() {
            out.send(now, |frame| *frame = Frame::from_octets(&octets).expect("a telegram's length"));
        }
    }
    fn order(&mut self, order: Order) {
        match order {
            Order::Stop => self.fdl.set_offline(),
            Order::Start => {
                self.uart.received.clear();
                self.fdl.set_online();
            }
            Order::Outputs(slave, octets) => {
                let handle = self.handle(slave);
                self.dp.get_mut(handle).pi_q_mut().copy_from_slice(&octets);
            }
            Order::Diagnose(slave) => self.diagnose = Some(slave),
            Order::Anew(slave) => {
                let handle = self.handle(slave.address);
                *self.dp.get_mut(handle) = slave.peripheral();
            }
        }
    }
    fn step(&mut self, now: Local, input: Input<'_, Order>, out: &mut Outbox) {
        match input {
            Input::PowerOn => {
                self.fdl.set_online();
                out.arm(Timer::Schedule, now + STEP);
            }
            Input::Deadline { .. } => {
                self.poll(now, out);
                out.arm(Timer::Schedule, now + STEP);
            }
            Input::Telegram(heard) => {
                let same = |sent: &Sent| sent.end.ticks() == now.ticks() && sent.octets == heard.octets;
                assert!(self.uart.line.borrow().last().is_some_and(same), "its characters were another telegram");
                self.poll(now, out);
            }
            Input::Command(order) => self.order(order),
            Input::Sent | Input::Sample(_) => {}
        }
    }
}

/// A station of this network.
pub(crate) enum Machine {
    Foreign(Box<Foreign>),
    Encoder(Box<Encoder>),
}

impl Station for Machine {
    type Command = Order;

    fn address(&self) -> Address {
        match self {
            Self::Foreign(_) => address(MASTER),
            Self::Encoder(encoder) => encoder.address(),
        }
    }
    fn filter(&self) -> Filter {
        match self {
            Self::Foreign(_) => Filter::all(address(MASTER)),
            Self::Encoder(encoder) => encoder.filter(),
        }
    }
    fn step(&mut self, now: Local, input: Input<'_, Order>, out: &mut Outbox) {
        match self {
            Self::Foreign(foreign) => foreign.step(now, input, out),
            Self::Encoder(encoder) => {
                if let Some(input) = input.map_command(|_| None) {
                    encoder.step(now, input, out);
                }
            }
        }
    }
}

/// Keeps what was on the line and what the slaves' states did.
struct Log {
    line: Line,
    states: Vec<(Time, u8, SlaveState, SlaveCause)>,
}

impl Recorder for Log {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let &Transmission { start, end, sender, octets, .. } = telegram;
        self.line.borrow_mut().push(Sent { start, end, sender: sender.get(), octets: octets.to_vec() });
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match *what {
            Observation::SlaveState { to, cause, .. } => self.states.push((stamp.at, stamp.station.get(), to, cause)),
            Observation::Collision { with } => panic!("{} and {with} collide at {:?}", stamp.station, stamp.at),
            _ => {}
        }
    }
}

/// The foreign master and its encoders.
pub(crate) struct Bus {
    network: Network<Machine>,
    log: Log,
}

/// The shaft of an encoder: it turns once in a second, and no two begin alike.
pub(crate) const fn motion(encoder: u8) -> Motion {
    Motion::Speed { start: Angle::from_units((encoder as i64) << 36), micro_rpm: 60_000_000 }
}

impl Bus {
    /// The master as configured, and encoders at these addresses.
    pub(crate) fn new(rate: BitRate, configured: &[Configured], encoders: &[u8]) -> Self {
        let line = Line::default();
        let site = |machine, shaft| Site {
            machine,
            place: Place::default(),
            // True time: the UART compares it with the line's.
            crystal: Crystal::new(0, Local::ZERO).expect("an exact crystal"),
            shaft,
            powered_at: Time::ZERO,
        };
        let foreign = Foreign::new(rate, line.clone(), configured);
        let mut sites = vec![site(Machine::Foreign(Box::new(foreign)), None)];
        for &encoder in encoders {
            let profile = profile::find("posital-ocd-dpb1b").expect("a known device");
            let settings = UnitSettings::new(address(encoder), rate, T_SDR);
            let unit = Encoder::new(profile, settings, Disc::new(profile, &settings.options));
            let disc = Resolution::new(profile.steps_per_rev, profile.revolutions).expect("a disc");
            let shaft = Shaft::new(&motion(encoder)).expect("a motion");
            sites.push(site(Machine::Encoder(Box::new(unit)), Some((shaft, disc))));
        }
        let jitter = JitterSource::new(GcJitter::None, 1, MASTER).expect("no jitter");
        let network = Network::new(rate, (Wiring::line(), sites), jitter, Faults::default());
        Self { network, log: Log { line, states: Vec::new() } }
    }
    /// A good configuration of encoders, all there.
    pub(crate) fn good(rate: BitRate, encoders: &[u8]) -> Self {
        let configured: Vec<_> = encoders.iter().map(|&encoder| Configured::good(encoder)).collect();
        Self::new(rate, &configured, encoders)
    }
    /// Runs until so many milliseconds after the beginning.
    pub(crate) fn run(&mut self, ms: i64) {
        let end = Until::Time(Time::ZERO + Span::from_ms(ms));
        assert!(self.network.run(end, 10_000_000, &mut self.log), "the run does not end");
    }
    /// Has the master do something now.
    pub(crate) fn order(&mut self, order: Order) {
        self.network.order(When::Time(self.network.now()), address(MASTER), Act::Command(order));
    }
    /// Switches the supply of an encoder now.
    pub(crate) fn power(&mut self, encoder: u8, on: bool) {
        let act = if on { Act::PowerOn } else { Act::PowerOff };
        self.network.order(When::Time(self.network.now()), address(encoder), act);
    }

    pub(crate) fn master(&self) -> &Foreign {
        match self.network.station(address(MASTER)) {
            Some(Machine::Foreign(foreign)) => foreign,
            _ => panic!("there is no master"),
        }
    }
    pub(crate) fn encoder(&self, number: u8) -> &Encoder {
        match self.network.station(address(number)) {
            Some(Machine::Encoder(encoder)) => encoder,
            _ => panic!("there is no encoder {number}"),
        }
    }
    /// Every telegram that is over.
    pub(crate) fn line(&self) -> Vec<Sent> {
        self.log.line.borrow().iter().filter(|sent| sent.end <= self.network.now()).cloned().collect()
    }
    /// The DP states that an encoder entered and why, with their instants.
    pub(crate) fn states_of(&self, encoder: u8) -> Vec<(Time, SlaveState, SlaveCause)> {
        let mine = self.log.states.iter().filter(|&&(_, of, ..)| of == encoder);
        mine.map(|&(at, _, state, cause)| (at, state, cause)).collect()
    }
    /// Requests of DP to an encoder, GAP polls left out, with what came back, if anything. One that still waits is none.
    pub(crate) fn requests_to(&self, encoder: u8) -> Vec<(Sent, Option<Sent>)> {
        let line = self.line();
        let is_to = |sent: &Sent| {
            sent.sender == MASTER && destination(&sent.octets) == Some(encoder) && fc(&sent.octets) != FDL_STATUS
        };
        let pairs = line.windows(2).filter(|pair| is_to(&pair[0]));
        let reply = |next: &Sent| (next.sender == encoder).then(|| next.clone());
        pairs.map(|pair| (pair[0].clone(), reply(&pair[1]))).collect()
    }
}

/// DA of a data telegram, read by hand.
pub(crate) fn destination(octets: &[u8]) -> Option<u8> {
    match *octets {
        [0x68, _, _, _, da, ..] | [0x10 | 0xA2, da, ..] => Some(da & 0x7F),
        _ => None,
    }
}
/// DSAP of a data telegram, none for Data_Exchange, read by hand.
pub(crate) fn dsap(octets: &[u8]) -> Option<u8> {
    match *octets {
        [0x68, _, _, _, da, _, _, dsap, ..] | [0xA2, da, _, _, dsap, ..] if da & 0x80 != 0 => Some(dsap),
        _ => None,
    }
}
/// FC of a data telegram, read by hand.
pub(crate) fn fc(octets: &[u8]) -> u8 {
    match *octets {
        [0x68, _, _, _, _, _, fc, ..] | [0x10 | 0xA2, _, _, fc, ..] => fc,
        _ => panic!("{octets:02X?} has no FC"),
    }
}
/// FC of a GAP poll.
pub(crate) const FDL_STATUS: u8 = 0x49;
/// Bit rates that the foreign master can.
pub(crate) const RATES: [BitRate; 2] = [BitRate::K500, BitRate::M1_5];
/// The span between two telegrams (t_bit), rounded down.
pub(crate) fn idle(rate: BitRate, before: &Sent, after: &Sent) -> i64 {
    (after.start - before.end).div_floor(rate.bit())
}
