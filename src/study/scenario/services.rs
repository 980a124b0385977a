//! Services: the keys of DP services in operation, in `[master]`, in `[[slave]]` and of events, with their rules.

use super::check::{Facts, about, about_slave};
use super::error::Fault;
use super::section::{Reader, Section, instant, number, yes};
use super::tree::{Node, Value};
use super::{Action, Scenario, Slave};
use crate::dp::CLOCK_GROUP;
use crate::time::Span;
use crate::wire::control::GlobalControl;

/// How the master watches and tells its slaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct MasterServices {
    /// Error_Action_Flag: back to Clear when a slave misses Data_Exchange for Data_Control_Time.
    pub auto_clear: bool,
    /// Data_Control_Time; none is the watchdog's time, 600 ms without a watchdog.
    pub data_control_time: Option<Span>,
}

/// What a slave is parameterised for besides Data_Exchange.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SlaveServices {
    /// Group_Ident (Set_Prm octet 7) without the clock's: bit i is group i + 1.
    pub groups: u8,
    /// Sync_Req (Set_Prm octet 1 bit 5).
    pub sync: bool,
    /// Freeze_Req (Set_Prm octet 1 bit 4).
    pub freeze: bool,
    /// Min_Slave_Interval, where it is not the profile's.
    pub min_slave_interval: Option<Span>,
}

impl Slave {
    /// Shortest time from one Data_Exchange to the next.
    pub fn min_slave_interval(&self) -> Span {
        self.services.min_slave_interval.unwrap_or(self.device.min_slave_interval)
    }
}

/// Reads the keys of `[master]`.
pub(super) fn master(section: &mut Section<'_>, reader: &mut Reader<'_>) -> MasterServices {
    let auto_clear = section.optional(reader, "auto_clear", yes).unwrap_or(false);
    let data_control_time = section.optional(reader, "data_control_time", instant);
    MasterServices { auto_clear, data_control_time }
}

/// Reads the keys of one slave.
pub(super) fn slave(section: &mut Section<'_>, reader: &mut Reader<'_>) -> SlaveServices {
    let groups = section.optional(reader, "groups", groups).unwrap_or(0);
    let sync = section.optional(reader, "sync", yes).unwrap_or(false);
    let freeze = section.optional(reader, "freeze", yes).unwrap_or(false);
    let min_slave_interval = section.optional(reader, "min_slave_interval", instant);
    SlaveServices { groups, sync, freeze, min_slave_interval }
}

/// Reads the groups of a command; without the key it is for all slaves.
#[expect(clippy::unnecessary_wraps, reason = "the signature of all kinds")]
pub(super) fn command(command: GlobalControl, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    let groups = section.optional(reader, "groups", groups).unwrap_or(0);
    Some(Action::Control(GlobalControl { groups, ..command }))
}

/// Groups 1 to 7, `[1, 3]`, as bits.
fn groups(node: &Node) -> Result<u8, Fault> {
    let wrong = || {
        Fault::new("the groups are a list of numbers from 1 to 7")
            .rule("group 8 is the clock's (Global_Control octet 2, 00 80 is SYNCH)")
            .help("groups = [1, 3]")
    };
    let Value::List(list) = &node.value else { return Err(wrong()) };
    let bits = list.iter().map(|node| number(1..=7u8)(node).map(|group| 1 << (group - 1)));
    let bits = bits.collect::<Result<Vec<u8>, _>>().map_err(|_| wrong())?;
    if bits.is_empty() { Err(wrong()) } else { Ok(bits.into_iter().fold(0, |all, bit| all | bit)) }
}

/// A slave is not asked for what it cannot do.
pub(super) fn sync_and_freeze(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let SlaveServices { sync, freeze, .. } = slave.services;
        for (key, wanted, has) in [("sync", sync, slave.device.sync), ("freeze", freeze, slave.device.freeze)] {
            if wanted && !has {
                let fault = Fault::new(format!("{} knows no {key}", slave.device.name))
                    .rule("a slave refuses what it does not know with Not_Supported (EN 50170-2, Set_Prm octet 1)")
                    .help(format!("leave out {key}; simodrive-sensor-isochron knows it"));
                about_slave(reader, slave, key, fault);
            }
        }
    }
}

/// Every command has a slave that takes it.
pub(super) fn commands(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, event) in facts.scenario.events.iter().enumerate() {
        let Action::Control(control) = event.action else { continue };
        if !takers(facts.scenario, control) {
            let (word, key) = if control.sync_mode().is_some() { ("Sync", "sync") } else { ("Freeze", "freeze") };
            let fault = Fault::new("no slave takes this command")
                .rule(format!("{word} is for slaves of the groups whose Set_Prm asked for it (EN 50170-2)"))
                .help(format!("give a slave {key} = true, and one of the groups if the event has groups"));
            let path = format!("event.{}", i + 1);
            about(reader, &format!("{path}.groups"), &[&format!("{path}.do")], fault);
        }
    }
}
fn takers(scenario: &Scenario, control: GlobalControl) -> bool {
    scenario.configured().any(|slave| {
        let SlaveServices { groups, sync, freeze, .. } = slave.services;
        let takes = (sync && control.sync_mode().is_some()) || (freeze && control.freeze_mode().is_some());
        takes && control.selects(groups | CLOCK_GROUP)
    })
}
