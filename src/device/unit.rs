//! A unit: a complete isochronous slave, from the telegram on the line to the word in telegram 81.
//!
//! It joins the DP slave, the isochronous part and the sensor handshake with a [`Function`], which is all that an
//! encoder and a drive do not share. Before the clock is locked the unit runs freely: each Data_Exchange request
//! is answered with the position at this request. After lock, T_O takes the control words over and T_I latches what
//! the next request will find (Model: D8, D10).

use alloc::vec;
use alloc::vec::Vec;

use crate::device::isochronous::{IsoSettings, Isochronous};
use crate::device::leds::{LedInput, LedLogic};
use crate::device::options::UnitOptions;
use crate::device::profile::Device;
use crate::device::sensor::{Answer, Faults, Preset, Sensor, SensorOptions, Xist1, Xist2};
use crate::dp::ms1::{Access, Records};
use crate::dp::ms2;
use crate::dp::slave::{ACYCLIC_TIME, Application, Identity, Refusal, Slave};
use crate::fdl::{Filter, Heard, Input, Outbox, Station, Timer};
use crate::observation::{self, Leds, Observation, Phase, SlaveState};
use crate::time::{BitRate, Local, Span, Tbit};
use crate::wire::Address;
use crate::wire::acyclic::{ErrorCode, Record};
use crate::wire::diag::DiagBuffer;
use crate::wire::drive::{G1Zsw, Inputs81, Outputs81, SensorFault, Zsw2};
use crate::wire::prm::{Block, BlockType, IsoM, SetPrm};

/// Profile_Ident_Number of encoders in an MS2 connection.
pub const PROFILE_IDENT: u16 = 0x3D00;

/// What one kind of unit does and another does not.
pub trait Function {
    /// Checks the blocks of Set_Prm that are the device's own; the isochronous block is not among them.
    ///
    /// # Errors
    /// The rule that is broken.
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal>;
    /// Takes parameters over that were found good. `watchdog` is none while it is off.
    fn parameterise(&mut self, prm: &SetPrm<'_>, watchdog: Option<Span>);
    /// Tolerated failures of the master's sign of life that these parameters ask for (manual 3.2.5).
    fn max_failures(prm: &SetPrm<'_>) -> u8;
    /// Whether these parameters enable scaling, preset and code sequence, which take the longer computing time (manual
    /// 3.2.2).
    fn slow(prm: &SetPrm<'_>) -> bool;
    /// G1_XIST1 and the right-justified position for G1_XIST2 at this raw position (steps).
    fn position(&self, raw: u32) -> (u32, u32);
    /// Sets the position (manual 2.2, G1_STW bits 11 and 12) at this raw position.
    fn preset(&mut self, preset: Preset, raw: u32);
    /// Answers a request of the parameter channel (manual 4). Returns the length of the answer (octets).
    ///
    /// # Errors
    /// Class and code of the negative answer.
    fn parameters(&self, _address: Address, _request: &[u8], _out: &mut [u8]) -> Result<usize, ErrorCode> {
        Err(ErrorCode::NOT_SUPPORTED)
    }
    /// T_O came.
    fn set_point(&mut self, _now: Local, _out: &mut Outbox) {}
    /// A publisher's reply was heard.
    fn published(&mut self, _now: Local, _publisher: Address, _du: &[u8], _out: &mut Outbox) {}
    /// Publishers to listen to: bit n is address n.
    fn publishers(&self) -> u128 {
        0
    }
    /// Data exchange begins.
    fn enter(&mut self, _now: Local, _out: &mut Outbox) {}
    /// [`Timer::Links`] came due.
    fn monitor(&mut self, _now: Local, _out: &mut Outbox) {}
    /// Data exchange is over.
    fn leave(&mut self, _out: &mut Outbox) {}
    /// Writes the device's own part of the diagnosis.
    fn diagnosis(&self, _diagnosis: &mut DiagBuffer) {}
    /// Another number than before whenever [`diagnosis`](Self::diagnosis) writes something else.
    fn diagnosis_revision(&self) -> u32 {
        0
    }
}

/// What is set at a unit, not by its master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UnitSettings {
    /// Station address.
    pub address: Address,
    /// Bit rate of the bus.
    pub rate: BitRate,
    /// Own T_SDR (Model: D2).
    pub t_sdr: Tbit,
    /// Where this unit differs from others.
    pub options: UnitOptions,
}

impl UnitSettings {
    /// Settings with the defaults of the model.
    pub fn new(address: Address, rate: BitRate, t_sdr: Tbit) -> Self {
        Self { address, rate, t_sdr, options: UnitOptions::default() }
    }
}

/// A complete isochronous slave.
#[derive(Clone, Debug)]
pub struct Unit<F> {
    slave: Slave,
    body: Body<F>,
    leds: LedLogic,
}

/// The unit behind its DP slave.
#[derive(Clone, Debug)]
struct Body<F> {
    profile: Device,
    settings: UnitSettings,
    iso: Option<Isochronous>,
    sensor: Sensor,
    /// The parameter channel of MS1, and behind it those of the MS2 connections.
    channels: Vec<Channel>,
    function: F,
    outputs: Outputs81,
    /// Raw position of the last latch, for a preset.
    raw: u32,
    /// Faults that the handshake has not seen yet.
    causes: Faults,
    /// What the handshake says, until its next cycle.
    answer: Answer,
    /// What the next request will find.
    inputs: Inputs81,
}

impl<F: Function> Unit<F> {
    /// A unit of this kind without supply.
    pub fn new(profile: impl Into<Device>, settings: UnitSettings, function: F) -> Self {
        let profile = profile.into();
        let connections = settings.options.ms2_connections.unwrap_or(profile.ms2_connections);
        let identity = Identity {
            address: settings.address,
            ident: profile.ident,
            config: profile.config.clone(),
            outputs: profile.outputs,
            inputs: profile.inputs,
            fail_safe: profile.fail_safe,
            publisher: profile.publisher,
            sync: profile.sync,
            freeze: profile.freeze,
            max_diag: profile.max_diag,
            rate: settings.rate,
            t_sdr: settings.t_sdr,
            c1_max_data: profile.c1.max_data,
            ms2: ms2::Settings {
                connections,
                max_data: profile.c2.max_data,
                send_timeout: ms2::send_timeout(settings.rate),
                working: ACYCLIC_TIME,
                profile_ident: PROFILE_IDENT,
            },
        };
        let body = Body {
            profile,
            settings,
            iso: None,
            sensor: Sensor::new(settings.options.sensor),
            channels: vec![Channel::EMPTY; 1 + usize::from(connections)],
            function,
            outputs: Outputs81::default(),
            raw: 0,
            causes: Faults::NONE,
            answer: Answer::NONE,
            inputs: Inputs81::default(),
        };
        Self { slave: Slave::new(identity), body, leds: LedLogic::default() }
    }
    /// The DP slave.
    pub const fn slave(&self) -> &Slave {
        &self.slave
    }
    /// What makes it this kind of unit.
    pub const fn function(&self) -> &F {
        &self.body.function
    }
    /// Start-up phase now.
    pub fn phase(&self) -> Phase {
        self.body.iso.as_ref().map_or(Phase::Configuration, Isochronous::phase)
    }
    /// What the LEDs show.
    pub const fn leds(&self) -> Leds {
        self.leds.leds()
    }
    /// To be called after whatever may have changed the slave's state.
    fn update_leds(&mut self, now: Local, heard: bool, out: &mut Outbox) {
        let input = LedInput { powered: true, state: self.slave.state(), fault: self.slave.has_fault(), heard };
        let before = self.leds.next_deadline();
        if let Some((from, to)) = self.leds.update(now, input) {
            out.observe(Observation::Leds { from, to });
        }
        if let Some(deadline) = self.leds.next_deadline().filter(|&deadline| before != Some(deadline)) {
            out.arm(Timer::Leds, deadline);
        }
    }
    /// What the next request will find.
    pub const fn inputs(&self) -> &Inputs81 {
        &self.body.inputs
    }

    /// As [`Station::step`], where stations of other kinds take orders; a unit does not.
    ///
    /// What comes in every cycle is not inlined: each input then saves the registers that it needs itself.
    pub fn take<C: Copy>(&mut self, now: Local, input: Input<'_, C>, out: &mut Outbox) {
        match input {
            Input::Telegram(heard) => self.heard(now, heard, out),
            Input::Deadline { timer: Timer::SetPoint, .. } => self.body.set_point(now, out),
            Input::Sample(raw) => self.sampled(raw, out),
            _ => self.take_seldom(now, input, out),
        }
    }
    /// Takes what does not come in every cycle.
    #[cold]
    fn take_seldom<C: Copy>(&mut self, now: Local, input: Input<'_, C>, out: &mut Outbox) {
        match input {
            Input::PowerOn => self.power_on(now, out),
            Input::Deadline { timer, .. } => self.due(now, timer, out),
            Input::Telegram(_) | Input::Sent | Input::Sample(_) | Input::Command(_) => {}
        }
    }
    #[inline(never)]
    fn sampled(&mut self, raw: u32, out: &mut Outbox) {
        if self.slave.state() == SlaveState::DataExch {
            self.body.latch(raw, true, out);
        }
    }
    fn power_on(&mut self, now: Local, out: &mut Outbox) {
        self.leds = LedLogic::default();
        self.body.reset(out);
        self.body.function.leave(out);
        self.slave.power_on(now, &mut self.body, out);
        self.update_leds(now, false, out);
    }
    #[inline(never)]
    fn heard(&mut self, now: Local, heard: Heard<'_>, out: &mut Outbox) {
        self.slave.heard(now, heard, &mut self.body, out);
        if self.slave.state() == SlaveState::DataExch && self.leds.leds() == Leds::DataExchange {
            self.leds.goes_on(now);
        } else {
            self.update_leds(now, true, out);
        }
    }
    /// A deadline came due that does not in every cycle.
    fn due(&mut self, now: Local, timer: Timer, out: &mut Outbox) {
        match timer {
            Timer::Window => self.body.window_closed(now, out),
            Timer::Links => self.body.function.monitor(now, out),
            Timer::Watchdog => self.slave.watchdog(now, &mut self.body, out),
            Timer::Connection => self.slave.connection_due(now, &mut self.body, out),
            _ => {}
        }
        self.update_leds(now, false, out);
    }
}

impl<F: Function> Body<F> {
    fn reset(&mut self, out: &mut Outbox) {
        if let Some(mut iso) = self.iso.take() {
            iso.leave(out);
        }
        self.sensor = Sensor::new(self.settings.options.sensor);
        self.causes = Faults::NONE;
        self.answer = Answer::NONE;
        self.outputs = Outputs81::default();
        self.inputs = Inputs81::default();
    }

    /// The control words take effect: at T_O, or with each request while the clock is not locked.
    #[inline]
    fn take_over(&mut self, out: &mut Outbox) {
        let causes = core::mem::take(&mut self.causes);
        self.answer = self.sensor.cycle(self.outputs.g1_stw.0, causes);
        let Answer { preset, latched, cleared, .. } = self.answer;
        if preset.is_some() || !latched.is_empty() || cleared.is_some() {
            self.act_on_answer(out);
        }
    }
    /// The handshake says more than the words that go to the master.
    #[cold]
    fn act_on_answer(&mut self, out: &mut Outbox) {
        if let Some(preset) = self.answer.preset {
            self.function.preset(preset, self.raw);
        }
        for fault in self.answer.latched.iter() {
            out.observe(Observation::Fault { code: fault.code() });
        }
        if let Some(fault) = self.answer.cleared {
            out.observe(Observation::Acknowledged { code: fault.code() });
        }
    }
    /// Keeps a fault for the next cycle of the handshake.
    fn raise(&mut self, fault: Option<SensorFault>) {
        if let Some(fault) = fault {
            self.causes = self.causes.with(fault);
        }
    }
    /// Takes the position for the next reply.
    #[inline(never)]
    fn latch(&mut self, raw: u32, locked: bool, out: &mut Outbox) {
        self.raw = raw;
        let (xist1, position) = self.function.position(raw);
        let sls = self.iso.as_ref().map_or(0, Isochronous::own_sign);
        self.inputs = Inputs81 {
            zsw2: Zsw2(u16::from(sls) << 12),
            g1_zsw: G1Zsw(self.answer.zsw),
            xist1: if self.answer.xist1 == Xist1::Position { xist1 } else { 0 },
            xist2: match self.answer.xist2 {
                Xist2::Zero => 0,
                Xist2::Position => position,
                Xist2::Code(code) => code.into(),
            },
        };
        let Inputs81 { zsw2, g1_zsw, xist1, xist2 } = self.inputs;
        let inputs = observation::Inputs { zsw2: zsw2.0, g1_zsw: g1_zsw.0, xist1, xist2 };
        out.observe(Observation::Latch { locked, inputs });
    }
    fn window_closed(&mut self, now: Local, out: &mut Outbox) {
        let fault = self.iso.as_mut().and_then(|iso| iso.window_closed(now, out));
        self.raise(fault);
    }
    #[inline(never)]
    fn set_point(&mut self, now: Local, out: &mut Outbox) {
        let mls = (self.outputs.stw2.0 >> 12) as u8;
        let fault = self.iso.as_mut().and_then(|iso| iso.set_point(mls, out));
        self.raise(fault);
        self.take_over(out);
        self.function.set_point(now, out);
    }
    fn is_locked(&self) -> bool {
        self.iso.as_ref().is_some_and(Isochronous::is_locked)
    }

    /// The rules of the isochronous block (Model: D3, manual 3.3).
    fn check_iso(&self, block: &Block<'_>, slow: bool) -> Result<(), Refusal> {
        let iso = IsoM::parse(block)?;
        iso.check(block.octet)?;
        let units = |span: Span| (span.ticks() / Span::TICKS_PER_ISO_UNIT) as u64;
        let (t_dp, latch, set_point) = (iso.t_dp_units(), iso.t_i_units(), iso.t_o_units());
        let earliest = u64::from(iso.t_dx) + units(self.profile.t_o_min);
        let gap = units(self.profile.gap_min(slow));
        let window = u64::from(iso.t_pll_w).max(units(self.settings.options.pll.min_window));
        let range = units(self.profile.t_dp_min)..=units(self.profile.t_dp_max);
        let rules = [
            (9, t_dp, range.contains(&t_dp), "T_DP [1/12 us] is within the device's range (manual 3.3.2)"),
            (
                16,
                latch,
                latch >= units(self.profile.t_i_min(slow)),
                "T_I [1/12 us] is 125 us or more, 375 us with octet 15 bit 1 (manual 3.3.5)",
            ),
            (16, latch, latch < t_dp, "T_I [1/12 us] is less than T_DP (manual 3.3.5)"),
            (18, set_point, set_point > earliest, "T_O [1/12 us] is more than T_DX + T_O_MIN (manual 3.3.6)"),
            (18, set_point, set_point < t_dp, "T_O [1/12 us] is less than T_DP (Model: D3)"),
            (
                18,
                set_point,
                set_point + latch + gap <= t_dp,
                "T_O [1/12 us] is 125 us or more before the latch, 375 us with octet 15 bit 1 (manual 3.3.6)",
            ),
            (
                24,
                u64::from(iso.t_pll_w),
                iso.t_pll_w <= self.profile.t_pll_w_max,
                "T_PLL_W [1/12 us] is not above T_PLL_W_MAX (GSD)",
            ),
            (
                26,
                u64::from(iso.t_pll_d),
                u64::from(iso.t_pll_d) + window < latch,
                "T_PLL_D [1/12 us] leaves the delayed latch before the next clock (manual 3.3.9, Model: D13)",
            ),
        ];
        match rules.into_iter().find(|&(.., good, _)| !good) {
            Some((offset, value, _, rule)) => Err(Refusal::Device { octet: block.octet + offset, rule, value }),
            None => Ok(()),
        }
    }
}

/// The parameter channel: the answer to the request written last.
#[derive(Clone, Debug)]
struct Channel {
    octets: [u8; Self::MAX],
    len: Option<usize>,
}

impl Channel {
    /// Octets of the longest answer (C1_Max_Data_Len of the encoders).
    const MAX: usize = 240;
    const EMPTY: Self = Self { octets: [0; Self::MAX], len: None };
    /// The slot of the telegram's module (manual 6.3).
    const SLOT: u8 = 1;

    fn check(record: Record) -> Result<(), ErrorCode> {
        match (record.slot, record.index) {
            (Self::SLOT, Record::PARAMETER_CHANNEL) => Ok(()),
            (Self::SLOT, _) => Err(ErrorCode::INDEX),
            _ => Err(ErrorCode::SLOT),
        }
    }
}

impl<F: Function> Body<F> {
    fn channel(&mut self, access: Access) -> Option<&mut Channel> {
        let index = match access {
            Access::Ms1 => 0,
            Access::Ms2(connection) => 1 + usize::from(connection),
        };
        self.channels.get_mut(index)
    }
}

impl<F: Function> Records for Body<F> {
    fn read(&mut self, access: Access, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode> {
        Channel::check(record)?;
        let channel = self.channel(access).ok_or(ErrorCode::UNAVAILABLE)?;
        let len = channel.len.ok_or(ErrorCode::STATE_CONFLICT)?;
        out.get_mut(..len).ok_or(ErrorCode::READ_CONSTRAINT)?.copy_from_slice(&channel.octets[..len]);
        Ok(len)
    }
    fn write(&mut self, access: Access, record: Record, data: &[u8]) -> Result<(), ErrorCode> {
        Channel::check(record)?;
        let mut octets = [0; Channel::MAX];
        let answer = self.function.parameters(self.settings.address, data, &mut octets);
        let channel = self.channel(access).ok_or(ErrorCode::UNAVAILABLE)?;
        *channel = Channel { octets, len: answer.ok() };
        answer.map(|_| ())
    }
    fn closed(&mut self, access: Access) {
        if let Some(channel) = self.channel(access) {
            channel.len = None;
        }
    }
}

/// The isochronous block, where there is one.
fn iso_block<'a>(prm: &SetPrm<'a>) -> Result<Option<Block<'a>>, Refusal> {
    let mut found = None;
    for block in prm.blocks() {
        let block = block?;
        if block.kind == BlockType::IsoM && found.replace(block).is_some() {
            let rule = "there is one isochronous block at most (manual 3.3)";
            return Err(Refusal::Device { octet: block.octet, rule, value: u64::from(block.kind.code()) });
        }
    }
    Ok(found)
}

impl<F: Function> Application for Body<F> {
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal> {
        self.function.check(prm)?;
        match iso_block(prm)? {
            Some(block) => self.check_iso(&block, F::slow(prm)),
            None if prm.dpv1.isom_req() => {
                let rule = "IsoM_Req needs an isochronous block (manual 3.1)";
                Err(Refusal::Device { octet: 10, rule, value: prm.dpv1.octets()[2].into() })
            }
            None => Ok(()),
        }
    }
    fn parameterise(&mut self, prm: &SetPrm<'_>) {
        let watchdog = prm.watchdog_units().map(|n| Span::from_ms(i64::from(n) * i64::from(prm.watchdog_base_ms())));
        let iso = iso_block(prm).ok().flatten().filter(|_| prm.dpv1.isom_req());
        self.iso = iso
            .and_then(|block| IsoM::parse(&block).ok())
            .map(|iso| Isochronous::new(IsoSettings::new(&iso, F::max_failures(prm), &self.settings.options)));
        let preset_enabled = self.settings.options.sensor.preset_enabled && F::slow(prm);
        self.sensor = Sensor::new(SensorOptions { preset_enabled, ..self.settings.options.sensor });
        self.function.parameterise(prm, watchdog);
    }
    fn enter(&mut self, now: Local, out: &mut Outbox) {
        out.sample_with_telegrams(true);
        self.function.enter(now, out);
    }
    fn leave(&mut self, _now: Local, out: &mut Outbox) {
        self.reset(out);
        out.sample_with_telegrams(false);
        self.function.leave(out);
    }
    fn outputs(&mut self, _now: Local, outputs: Option<&[u8]>, sample: u32, out: &mut Outbox) {
        // Clear: no sign of life, no command.
        self.outputs = outputs.and_then(Outputs81::parse).unwrap_or_default();
        if let Some(iso) = &mut self.iso {
            iso.exchanged(out);
            if iso.is_locked() {
                return;
            }
        }
        // A preset is about the position that this reply carries.
        self.raw = sample;
        self.take_over(out);
        self.latch(sample, false, out);
    }
    fn transfer(&mut self, _now: Local, outputs: Option<&[u8]>, out: &mut Outbox) {
        self.outputs = outputs.and_then(Outputs81::parse).unwrap_or_default();
        // Once the clock is locked, T_O takes them over.
        if !self.is_locked() {
            self.take_over(out);
        }
    }
    fn freeze(&mut self, _now: Local, sample: u32, out: &mut Outbox) {
        // Once the clock is locked, what is held was latched at T_I.
        if !self.is_locked() {
            self.latch(sample, false, out);
        }
    }
    fn inputs(&self, du: &mut [u8]) {
        du.copy_from_slice(&self.inputs.emit());
    }
    fn synch(&mut self, now: Local, out: &mut Outbox) {
        let fault = self.iso.as_mut().and_then(|iso| iso.synch(now, out));
        self.raise(fault);
    }
    fn operate(&mut self, _now: Local, operate: bool, _out: &mut Outbox) {
        if let Some(iso) = &mut self.iso {
            iso.operate(operate);
        }
    }
    fn published(&mut self, now: Local, publisher: Address, du: &[u8], out: &mut Outbox) {
        self.function.published(now, publisher, du, out);
    }
    fn publishers(&self) -> u128 {
        self.function.publishers()
    }
    fn diagnosis(&self, diagnosis: &mut DiagBuffer) {
        self.function.diagnosis(diagnosis);
    }
    fn diagnosis_revision(&self) -> u32 {
        self.function.diagnosis_revision()
    }
}

impl<F: Function> Station for Unit<F> {
    /// A unit takes no orders but from its master.
    type Command = core::convert::Infallible;

    fn address(&self) -> Address {
        self.slave.identity().address
    }
    fn filter(&self) -> Filter {
        self.slave.filter(&self.body)
    }
    fn step(&mut self, now: Local, input: Input<'_, Self::Command>, out: &mut Outbox) {
        self.take(now, input, out);
    }
}
