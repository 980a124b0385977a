//! The master application: a sign of life and a sensor control word for each slave, and a check of the slaves' signs.
//!
//! Model: D17. The application counts its sign of life per T_MAPC from the cycle on in which a slave exchanges data
//! and the master operates, and checks the slave's by the same rule with a tolerance of four.

use alloc::vec::Vec;

use crate::device::parameter_client::ParameterClient;
use crate::device::sign_of_life::{Monitor, MonitorSettings};
use crate::dp::master::Application;
use crate::dp::ms1::{Failure, Job};
use crate::fdl::Outbox;
use crate::observation::{LifeState, MasterMode, Observation};
use crate::wire::Address;
use crate::wire::drive::{G1Stw, Inputs81, Outputs81, SignOfLife, Stw2};
use crate::wire::parameter::{Format, ParameterAddress};

/// Tolerated failures of a slave's sign of life (Model: D17).
const TOLERANCE: u16 = 4;
/// Cycles for which an acknowledgement is held: its answer shows two cycles later at the latest (Model: D10).
const ACKNOWLEDGE_CYCLES: u8 = 4;

/// What the scenario may order the application to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Set G1_STW bit 15 for a few cycles (manual 2.2).
    Acknowledge(Address),
    /// Put these bits into G1_STW until the next such order.
    ControlWord(Address, G1Stw),
    /// Count the sign of life no further, for so many cycles or for good.
    HoldLife(Address, Option<u32>),
    /// Count again.
    ReleaseLife(Address),
    /// Send this value from the coming cycle on, for T_MAPC, and go on counting from it; 0 is followed by the start value.
    JumpLife(Address, u8),
    /// Ask for a parameter over the parameter channel (manual 4).
    ReadParameter(Address, ParameterAddress),
    /// Ask to change a parameter to this value of this format.
    ChangeParameter(Address, ParameterAddress, Format, u32),
}

impl Command {
    /// The slave that is meant.
    pub const fn slave(&self) -> Address {
        match *self {
            Self::Acknowledge(slave)
            | Self::ControlWord(slave, _)
            | Self::HoldLife(slave, _)
            | Self::ReleaseLife(slave)
            | Self::JumpLife(slave, _)
            | Self::ReadParameter(slave, _)
            | Self::ChangeParameter(slave, ..) => slave,
        }
    }
}

/// How the application counts its signs of life (Model: D17).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LifeSettings {
    /// Cycles per value, T_MAPC, 1..=14 (manual 3.3.3).
    pub t_mapc: u8,
    /// First value, 1..=15. Model: D17, default 1.
    pub start: u8,
    /// Cycles from a slave's data exchange in Operate to the first value. Model: D17, default 0.
    pub delay: u32,
}

/// What the application keeps of one slave.
#[derive(Clone, Debug)]
struct Axis {
    slave: Address,
    joined: bool,
    /// Own sign of life for this slave and the cycles for which it has been sent.
    sign: SignOfLife,
    age: u8,
    /// Cycles that the first value still waits.
    wait: u32,
    /// What the coming cycle sends instead.
    jump: Option<SignOfLife>,
    held: Held,
    control: G1Stw,
    acknowledge: u8,
    monitor: Monitor,
    /// Sign of life last received; it counts again where nothing comes.
    received: SignOfLife,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Held {
    No,
    For(u32),
    ForGood,
}

/// The master application.
#[derive(Clone, Debug)]
pub struct Controller {
    axes: Vec<Axis>,
    life: LifeSettings,
    parameters: ParameterClient,
}

impl Controller {
    /// An application for these slaves.
    pub fn new(slaves: impl IntoIterator<Item = Address>, life: LifeSettings) -> Self {
        let axis = |slave| Axis {
            slave,
            joined: false,
            sign: SignOfLife::NONE,
            age: 0,
            wait: life.delay,
            jump: None,
            held: Held::No,
            control: G1Stw::default(),
            acknowledge: 0,
            monitor: Monitor::new(MonitorSettings::new(1, TOLERANCE)),
            received: SignOfLife::NONE,
        };
        Self { axes: slaves.into_iter().map(axis).collect(), life, parameters: ParameterClient::default() }
    }
}

impl Axis {
    /// One cycle of the sign of life.
    fn count(&mut self, life: LifeSettings, out: &mut Outbox) {
        if let Held::For(cycles) = self.held {
            if cycles == 0 {
                self.hold(Held::No, out);
            } else {
                self.held = Held::For(cycles - 1);
            }
        }
        self.acknowledge = self.acknowledge.saturating_sub(1);
        if let Some(sign) = self.jump.take() {
            (self.sign, self.age) = (sign, 0);
        } else if !self.sign.is_valid() && self.wait > 0 {
            self.wait -= 1;
        } else if !self.sign.is_valid() {
            (self.sign, self.age) = (SignOfLife::masked(life.start), 0);
        } else if self.held == Held::No && self.age + 1 >= life.t_mapc {
            (self.sign, self.age) = (self.sign.next(), 0);
        } else {
            self.age = self.age.saturating_add(1).min(life.t_mapc - 1);
        }
    }
    fn hold(&mut self, held: Held, out: &mut Outbox) {
        if (self.held == Held::No) != (held == Held::No) {
            out.observe(Observation::MasterLifeHeld { slave: self.slave, held: held != Held::No });
        }
        self.held = held;
    }
    fn check(&mut self, out: &mut Outbox) {
        let from = self.monitor.state();
        let step = self.monitor.cycle(self.received.get());
        let to = self.monitor.state();
        if from != to {
            out.observe(Observation::SlaveLife { slave: self.slave, from, to, tripped: step.tripped });
        }
    }
}

impl Application for Controller {
    type Command = Command;

    fn power_on(&mut self, out: &mut Outbox) {
        for axis in &mut self.axes {
            axis.hold(Held::No, out);
            (axis.control, axis.acknowledge, axis.jump) = (G1Stw::default(), 0, None);
        }
    }
    fn cycle(&mut self, _cycle: u64, mode: MasterMode, out: &mut Outbox) {
        for axis in &mut self.axes {
            if axis.joined && mode == MasterMode::Operate {
                axis.count(self.life, out);
            } else {
                (axis.sign, axis.jump, axis.wait) = (SignOfLife::NONE, None, self.life.delay);
            }
        }
    }
    fn outputs(&mut self, slave: usize, du: &mut [u8]) {
        let axis = &self.axes[slave];
        let g1_stw = axis.control.with(G1Stw::ACKNOWLEDGE, axis.control.acknowledge() || axis.acknowledge > 0);
        let outputs = Outputs81 { stw2: Stw2(axis.sign.to_word()), g1_stw };
        du.copy_from_slice(&outputs.emit());
    }
    fn inputs(&mut self, slave: usize, inputs: Option<&[u8]>, out: &mut Outbox) {
        let axis = &mut self.axes[slave];
        if let Some(inputs) = inputs.and_then(Inputs81::parse) {
            axis.received = SignOfLife::from_word(inputs.zsw2.0);
        }
        axis.check(out);
    }
    fn joined(&mut self, slave: usize, joined: bool, out: &mut Outbox) {
        let axis = &mut self.axes[slave];
        let from = axis.monitor.state();
        axis.joined = joined;
        (axis.sign, axis.wait) = (SignOfLife::NONE, self.life.delay);
        axis.received = SignOfLife::NONE;
        axis.monitor.reset();
        if from != LifeState::Waiting {
            let to = LifeState::Waiting;
            out.observe(Observation::SlaveLife { slave: axis.slave, from, to, tripped: false });
        }
    }
    fn command(&mut self, command: Command, out: &mut Outbox) {
        let mut all = self.axes.iter_mut().enumerate();
        let Some((slave, axis)) = all.find(|(_, axis)| axis.slave == command.slave()) else { return };
        match command {
            Command::Acknowledge(_) => axis.acknowledge = ACKNOWLEDGE_CYCLES + 1,
            Command::ControlWord(_, bits) => axis.control = bits,
            Command::HoldLife(_, cycles) => axis.hold(cycles.map_or(Held::ForGood, Held::For), out),
            Command::ReleaseLife(_) => axis.hold(Held::No, out),
            Command::JumpLife(_, to) => axis.jump = Some(SignOfLife::masked(to)),
            Command::ReadParameter(_, parameter) => {
                self.parameters.ask((slave, axis.slave), parameter, None, out);
            }
            Command::ChangeParameter(_, parameter, format, value) => {
                self.parameters.ask((slave, axis.slave), parameter, Some((format, value)), out);
            }
        }
    }
    fn acyclic(&mut self) -> Option<Job> {
        self.parameters.job()
    }
    fn acyclic_done(&mut self, _slave: usize, answer: Result<&[u8], Failure>, out: &mut Outbox) {
        self.parameters.answered(answer, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLAVE: Address = Address::new(3).unwrap();

    /// Signs of life sent in cycles 0.. at this T_MAPC; `order` is given before cycle 4 begins.
    fn sent(t_mapc: u8, order: Command) -> [u8; 10] {
        let mut out = Outbox::new();
        let mut controller = Controller::new([SLAVE], LifeSettings { t_mapc, start: 1, delay: 0 });
        controller.joined(0, true, &mut out);
        core::array::from_fn(|cycle| {
            if cycle == 4 {
                controller.command(order, &mut out);
            }
            controller.cycle(cycle as u64, MasterMode::Operate, &mut out);
            let mut du = [0; 4];
            controller.outputs(0, &mut du);
            du[0] >> 4
        })
    }

    #[test]
    fn a_jump_is_sent_itself_and_held_as_long_as_any_value() {
        assert_eq!(sent(1, Command::JumpLife(SLAVE, 9)), [1, 2, 3, 4, 9, 10, 11, 12, 13, 14]);
        assert_eq!(sent(2, Command::JumpLife(SLAVE, 9)), [1, 1, 2, 2, 9, 9, 10, 10, 11, 11]);
        assert_eq!(sent(1, Command::JumpLife(SLAVE, 0)), [1, 2, 3, 4, 0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn what_was_ordered_before_the_supply_failed_is_forgotten() {
        let mut out = Outbox::new();
        let mut controller = Controller::new([SLAVE], LifeSettings { t_mapc: 1, start: 1, delay: 0 });
        let parked = G1Stw::default().with(G1Stw::PARKING, true);
        for order in [Command::HoldLife(SLAVE, None), Command::ControlWord(SLAVE, parked), Command::Acknowledge(SLAVE)]
        {
            controller.command(order, &mut out);
        }
        controller.power_on(&mut out);
        controller.joined(0, true, &mut out);
        let mut du = [0xFF; 4];
        for sign in 1..=3 {
            controller.cycle(u64::from(sign), MasterMode::Operate, &mut out);
            controller.outputs(0, &mut du);
            assert_eq!(du, [sign << 4, 0, 0, 0]);
        }
        let held = |held| {
            out.observations().filter(|&seen| *seen == Observation::MasterLifeHeld { slave: SLAVE, held }).count()
        };
        assert_eq!((held(true), held(false)), (1, 1));
    }

    #[test]
    fn a_held_sign_of_life_goes_on_where_it_stopped() {
        assert_eq!(sent(1, Command::HoldLife(SLAVE, Some(2))), [1, 2, 3, 4, 4, 4, 5, 6, 7, 8]);
        assert_eq!(sent(2, Command::HoldLife(SLAVE, Some(2))), [1, 1, 2, 2, 2, 2, 3, 3, 4, 4]);
        assert_eq!(sent(1, Command::HoldLife(SLAVE, None)), [1, 2, 3, 4, 4, 4, 4, 4, 4, 4]);
    }
}
