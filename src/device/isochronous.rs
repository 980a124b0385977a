//! The isochronous part of a slave: clock, signs of life and the five start-up phases (manual 2.1).
//!
//! | phase | input | next phase |
//! |---|---|---|
//! | Configuration | Operate known and valid Data_Exchange: the clock recovery starts | Clock |
//! | Clock | locked | MasterLife |
//! | MasterLife | sixteen correct steps of the master's sign of life | SlaveLife, own sign of life runs |
//! | SlaveLife | sixteen further cycles | Operation |
//! | MasterLife to Operation | too many clock failures | Clock, fault 0F04 |
//! | SlaveLife | wrong sign of life | MasterLife |
//! | Operation | too many wrong signs of life | MasterLife, fault 0F02 |
//! | any | end of data exchange | Configuration |

// What follows a SYNCH runs once per slave-cycle: each call would save and fetch all registers again.
#![allow(clippy::inline_always)]

use crate::device::options::{LifeStart, UnitOptions};
use crate::device::pll::{Change, Judgement, Pll, PllSettings};
use crate::device::sign_of_life::{Counter, Monitor, MonitorSettings, Verdict};
use crate::fdl::{Outbox, Timer};
use crate::observation::{ClockVerdict, LifeState, Observation, Phase, PllState};
use crate::time::{Local, Span};
use crate::wire::drive::SensorFault;
use crate::wire::prm::IsoM;

/// What the isochronous part is told by the parameters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct IsoSettings {
    /// Clock recovery.
    pub pll: PllSettings,
    /// Monitor of the master's sign of life.
    pub life: MonitorSettings,
    /// T_I, latch before the end of the cycle (manual 3.3.5).
    pub t_i: Span,
    /// T_O, set point after the start of the cycle (manual 3.3.6).
    pub t_o: Span,
    /// When the own sign of life starts (Model: D16).
    pub life_start: LifeStart,
}

impl IsoSettings {
    /// Settings from the isochronous block and the tolerated failures (Set_Prm octets 32..=59 and 24).
    pub fn new(iso: &IsoM, max_failures: u8, options: &UnitOptions) -> Self {
        let span = |units: u64| Span::from_ticks(units as i64 * Span::TICKS_PER_ISO_UNIT);
        let pll = PllSettings::new(
            span(iso.t_dp_units()),
            Span::from_iso_units(iso.t_pll_w.into()),
            Span::from_iso_units(iso.t_pll_d.into()),
        );
        Self {
            pll: PllSettings { tolerance: options.clock_tolerance, ..options.pll.on(pll) },
            life: MonitorSettings {
                steps: options.life.steps,
                confirmation: options.life.confirmation,
                ..MonitorSettings::new(iso.t_mapc, max_failures.into())
            },
            t_i: span(iso.t_i_units()),
            t_o: span(iso.t_o_units()),
            life_start: options.life.start,
        }
    }
}

/// The isochronous part of a slave.
#[derive(Clone, Debug)]
pub struct Isochronous {
    settings: IsoSettings,
    pll: Pll,
    life: Monitor,
    own: Counter,
    phase: Phase,
    operate: bool,
}

impl Isochronous {
    /// An isochronous part whose slave does not exchange data yet.
    pub fn new(settings: IsoSettings) -> Self {
        Self {
            settings,
            pll: Pll::new(settings.pll),
            life: Monitor::new(settings.life),
            own: Counter::new(),
            phase: Phase::Configuration,
            operate: false,
        }
    }
    /// Phase now.
    pub const fn phase(&self) -> Phase {
        self.phase
    }
    /// Whether T_O and T_I run.
    pub fn is_locked(&self) -> bool {
        self.pll.is_locked()
    }
    /// Own sign of life, bits 15..12 of ZSW2.
    pub fn own_sign(&self) -> u8 {
        self.own.sign().get()
    }

    /// Data exchange begins: positions come along with requests until the clock is locked (Model: D8).
    pub fn enter(&mut self, out: &mut Outbox) {
        out.sample_with_telegrams(true);
    }
    /// Data exchange is over.
    pub fn leave(&mut self, out: &mut Outbox) {
        let before = self.pll.state();
        let life = self.life.state();
        *self = Self { phase: self.phase, ..Self::new(self.settings) };
        stop(out);
        out.disarm(Timer::Window);
        out.sample_with_telegrams(false);
        self.observe_pll(before, out);
        self.observe_life(life, out);
        self.enter_phase(Phase::Configuration, out);
    }
    /// The master said Operate or Clear. Clear does not stop the clock.
    pub fn operate(&mut self, operate: bool) {
        self.operate = operate;
    }
    /// A valid Data_Exchange came: with Operate this starts the clock recovery (manual 2.1.2).
    #[inline]
    pub fn exchanged(&mut self, out: &mut Outbox) {
        if self.phase == Phase::Configuration {
            self.configured(out);
        }
    }
    #[cold]
    fn configured(&mut self, out: &mut Outbox) {
        if self.operate {
            self.pll.start();
            self.observe_pll(PllState::Idle, out);
            self.enter_phase(Phase::Clock, out);
        }
    }

    /// SYNCH arrived. Returns the fault that this makes.
    #[inline(always)]
    pub fn synch(&mut self, now: Local, out: &mut Outbox) -> Option<SensorFault> {
        let before = self.pll.state();
        let judgement = self.pll.synch(now)?;
        self.judged(before, judgement, out)
    }
    /// [`Timer::Window`] came due. Returns the fault that this makes.
    #[cold]
    pub fn window_closed(&mut self, now: Local, out: &mut Outbox) -> Option<SensorFault> {
        let before = self.pll.state();
        let judgement = self.pll.window_closed(now)?;
        self.judged(before, judgement, out)
    }
    #[inline(always)]
    fn judged(&mut self, before: PllState, judgement: Judgement, out: &mut Outbox) -> Option<SensorFault> {
        out.observe(Observation::Clock {
            verdict: judgement.verdict,
            error: judgement.error,
            period: self.pll.period(),
            window: self.pll.window(),
            counter: judgement.counter,
        });
        if self.pll.state() != before {
            self.observe_pll(before, out);
        }
        match self.pll.window_end() {
            Some(end) => out.arm(Timer::Window, end),
            None => out.disarm(Timer::Window),
        }
        let fault = if judgement.change == Change::None { None } else { self.changed(judgement.change, out) };
        // A stray SYNCH belongs to a cycle that is planned already.
        if judgement.verdict != ClockVerdict::Stray {
            self.plan_cycle(out);
        }
        fault
    }
    #[cold]
    fn changed(&mut self, change: Change, out: &mut Outbox) -> Option<SensorFault> {
        match change {
            Change::Locked => {
                out.sample_with_telegrams(false);
                self.enter_phase(Phase::MasterLife, out);
                None
            }
            Change::Lost => {
                self.lost(out);
                Some(SensorFault::Clock)
            }
            Change::None | Change::Restarted => None,
        }
    }
    /// T_O and the latch of the running cycle, once its start is known.
    #[inline(always)]
    fn plan_cycle(&mut self, out: &mut Outbox) {
        if let (true, Some(edge), Some(next)) = (self.pll.is_locked(), self.pll.edge(), self.pll.next_edge()) {
            out.arm(Timer::SetPoint, edge + self.settings.t_o);
            out.sample_at(next - self.settings.t_i);
        }
    }
    /// The clock is lost: phases 3 to 5 and the own sign of life begin anew (Model: D15).
    fn lost(&mut self, out: &mut Outbox) {
        let life = self.life.state();
        self.life.reset();
        self.own.cycle(false);
        self.observe_life(life, out);
        stop(out);
        out.sample_with_telegrams(true);
        self.enter_phase(Phase::Clock, out);
    }

    /// T_O: compares the master's sign of life. Returns the fault that this makes.
    #[inline]
    pub fn set_point(&mut self, mls: u8, out: &mut Outbox) -> Option<SensorFault> {
        let before = self.life.state();
        let step = self.life.cycle(mls);
        let runs = self.life.is_synchronised() || self.settings.life_start == LifeStart::AfterClock;
        let sls = self.own.cycle(runs).get();
        out.observe(Observation::SetPoint {
            mls,
            sls,
            counter: self.life.failures().min(u16::MAX.into()) as u16,
            expected: !matches!(step.verdict, Verdict::Wrong { .. }),
        });
        if step.entered.is_some() {
            self.life_changed(before, out);
        }
        step.tripped.then_some(SensorFault::LifeSign)
    }
    /// The start-up goes on, or begins anew. While the monitor's state stays, so does the phase that it stands for.
    #[cold]
    fn life_changed(&mut self, before: LifeState, out: &mut Outbox) {
        self.observe_life(before, out);
        let phase = match self.life.state() {
            LifeState::Waiting | LifeState::Strict => Phase::MasterLife,
            LifeState::Confirming => Phase::SlaveLife,
            LifeState::Operating => Phase::Operation,
        };
        self.enter_phase(phase, out);
    }

    fn enter_phase(&mut self, to: Phase, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.phase, to);
        if from != to {
            out.observe(Observation::Phase { from, to });
        }
    }
    #[cold]
    fn observe_pll(&self, from: PllState, out: &mut Outbox) {
        let to = self.pll.state();
        if from != to {
            out.observe(Observation::Pll { from, to });
        }
    }
    fn observe_life(&self, from: LifeState, out: &mut Outbox) {
        let to = self.life.state();
        if from != to {
            out.observe(Observation::MasterLife { from, to });
        }
    }
}

/// T_O and the latch run no more.
fn stop(out: &mut Outbox) {
    out.disarm(Timer::SetPoint);
    out.cancel_sample();
}
