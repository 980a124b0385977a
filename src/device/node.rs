//! A node: any station of a network, so that a network needs no dynamic dispatch.

use crate::device::controller::{Command as ControllerCommand, Controller};
use crate::device::drive::Drive;
use crate::device::encoder::Encoder;
use crate::device::tool::Tool;
use crate::dp::class2::Class2;
use crate::dp::handler::{Patch, StartupTelegram};
use crate::dp::master::{Master, Order, Overlong};
use crate::fdl::active::HoldToken;
use crate::fdl::{Filter, Input, Outbox, Station};
use crate::observation::MasterMode;
use crate::time::Local;
use crate::wire::Address;
use crate::wire::control::GlobalControl;

/// What a scenario may order a node to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Clear or Operate, to the master.
    Mode(MasterMode),
    /// A slave is started anew with a changed telegram.
    Patch(Address, StartupTelegram, Patch),
    /// Sync, Freeze and their ends, to the master.
    Control(GlobalControl),
    /// Tokens are kept longer, to any master.
    HoldToken(HoldToken),
    /// DS-Write in every cycle, whether it fits or not, or no more, to a class 1 master.
    Overlong(Option<Overlong>),
    /// Something for the master's application.
    Application(ControllerCommand),
}

/// Any station.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // A network holds one master and lives in one vector.
pub enum Node {
    /// A class 1 master with its application.
    Master(Master<Controller>),
    /// A class 2 master with its jobs.
    Class2(Class2<Tool>),
    /// An absolute encoder.
    Encoder(Encoder),
    /// A slave with the subscriber function.
    Drive(Drive),
    /// A station that is on the cable and never says anything.
    Silent(Address),
}

impl Station for Node {
    type Command = Command;

    fn address(&self) -> Address {
        match self {
            Self::Master(master) => master.address(),
            Self::Class2(master) => master.address(),
            Self::Encoder(encoder) => encoder.address(),
            Self::Drive(drive) => drive.address(),
            Self::Silent(address) => *address,
        }
    }
    fn filter(&self) -> Filter {
        match self {
            Self::Master(master) => master.filter(),
            Self::Class2(master) => master.filter(),
            Self::Encoder(encoder) => encoder.filter(),
            Self::Drive(drive) => drive.filter(),
            Self::Silent(address) => Filter::own(*address),
        }
    }
    fn step(&mut self, now: Local, input: Input<'_, Command>, out: &mut Outbox) {
        // The many first, by one test.
        if let Self::Encoder(encoder) = self {
            encoder.take(now, input, out);
        } else {
            self.step_other(now, input, out);
        }
    }
}

impl Node {
    /// A step of what is no encoder.
    #[inline(never)]
    fn step_other(&mut self, now: Local, input: Input<'_, Command>, out: &mut Outbox) {
        match self {
            Self::Master(master) => step_master(master, now, input, out),
            Self::Drive(drive) => drive.take(now, input, out),
            Self::Class2(master) => step_class2(master, now, input, out),
            Self::Encoder(_) | Self::Silent(_) => {}
        }
    }
}

impl From<Command> for Order<ControllerCommand> {
    fn from(command: Command) -> Self {
        match command {
            Command::Mode(mode) => Self::Mode(mode),
            Command::Patch(slave, telegram, patch) => Self::Patch(slave, telegram, patch),
            Command::Control(control) => Self::Control(control),
            Command::HoldToken(order) => Self::HoldToken(order),
            Command::Overlong(order) => Self::Overlong(order),
            Command::Application(command) => Self::Application(command),
        }
    }
}

fn step_master(master: &mut Master<Controller>, now: Local, input: Input<'_, Command>, out: &mut Outbox) {
    match input {
        Input::Command(command) => order_master(master, command, out),
        input => master.take(now, input, out),
    }
}
#[cold]
#[inline(never)]
fn order_master(master: &mut Master<Controller>, command: Command, out: &mut Outbox) {
    master.order(command.into(), out);
}
// Not inlined: a step of the others then saves no registers for what commands are made of.
#[inline(never)]
fn step_class2(master: &mut Class2<Tool>, now: Local, input: Input<'_, Command>, out: &mut Outbox) {
    let input = input.map_command(|command| match command {
        Command::HoldToken(order) => Some(order),
        _ => None,
    });
    if let Some(input) = input {
        master.step(now, input, out);
    }
}
