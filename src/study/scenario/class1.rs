//! Further masters: `[[class1]]`, free-running class 1 masters beside `[master]`, and what a master without isochronous
//! mode has and has not.

use super::check::{Facts, about};
use super::error::Fault;
use super::read::{crystal, watchdog};
use super::section::{Reader, Section, instant, number, yes};
use super::topology::{cable, station_segment};
use super::{Action, Crystal, IsoTimes, Scenario, Slave, Topology, Watchdog};
use crate::dp::master::Pace;
use crate::study::plan::rules::coarse_watchdog;
use crate::time::Span;
use crate::wire::Address;

/// A free-running class 1 master besides `[master]`. Its slaves name it: `[[slave]] master = 3`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Class1 {
    /// Its address, 0..=125.
    pub address: Address,
    /// Index of its segment.
    pub segment: u8,
    /// Where on the segment's cable it sits (mm).
    pub position_mm: u64,
    /// How far its crystal is off.
    pub crystal: Crystal,
    /// From the start of one of its poll cycles to the next at least.
    pub least_cycle: Span,
    /// The watchdog that it sets in every slave; none is off.
    pub watchdog: Option<Watchdog>,
    /// Whether it reads the configuration with Get_Cfg during start-up.
    pub get_cfg: bool,
    /// Repeats of an unanswered Data_Exchange, 0..=15 (Model: D7).
    pub dx_retries: u8,
    /// Cycles without an answer until a slave counts as lost.
    pub lost_after: u32,
    /// Cycles in Clear before it changes to Operate.
    pub clear_for: u64,
    /// When its supply comes on.
    pub powered_at: Span,
}

impl Scenario {
    /// The slaves of all masters that answer, in address order.
    pub fn answering(&self) -> impl Iterator<Item = &Slave> {
        self.slaves.iter().filter(|slave| !slave.silent)
    }
    /// The slaves in the list of the master at `master`, in address order.
    pub fn slaves_of(&self, master: Address) -> impl Iterator<Item = &Slave> {
        self.answering().filter(move |slave| slave.master == master)
    }
    /// The further master that has this address.
    pub fn class1(&self, address: Address) -> Option<&Class1> {
        self.class1.iter().find(|class1| class1.address == address)
    }
    /// Symbol of the bus cycle: T_DP, of a free-running master T_cycle.
    pub fn cycle_symbol(&self) -> &'static str {
        if self.master.pace == Pace::Synch { "T_DP" } else { "T_cycle" }
    }
    /// Whether `slave` is clocked: its master sends SYNCH, and the device has isochronous mode. Any other slave gets no
    /// isochronous block and runs freely, also in a network whose cycle is isochronous.
    pub fn is_clocked(&self, slave: &Slave) -> bool {
        self.master.pace == Pace::Synch && slave.master == self.master.address && slave.device.isochronous
    }
}

/// Times of a slave whose master sends no SYNCH.
pub(super) const UNCLOCKED: IsoTimes =
    IsoTimes { t_i: Span::ZERO, t_o: Span::ZERO, t_pll_w: Span::from_us(1), t_pll_d: Span::ZERO };

/// Reads one `[[class1]]`.
pub(super) fn read(mut section: Section<'_>, reader: &mut Reader<'_>, topology: Option<&Topology>) -> Option<Class1> {
    let s = &mut section;
    let address = s.required(reader, "address", "3", super::kinds::address);
    let segment = station_segment(s, reader, topology);
    let position_mm = s.optional(reader, "position", cable).unwrap_or(0);
    let crystal = crystal(reader, s);
    let least_cycle = least_cycle(s, reader);
    let watchdog = s.optional(reader, "watchdog", watchdog).unwrap_or(Some(Watchdog::USUAL));
    let get_cfg = s.optional(reader, "get_cfg", yes).unwrap_or(true);
    let dx_retries = s.optional(reader, "dx_retries", number(0..=15)).unwrap_or(1);
    let lost_after = s.optional(reader, "lost_after", number(1..=u32::from(u16::MAX))).unwrap_or(10);
    let clear_for = s.optional(reader, "clear_for", number(0..=i64::MAX as u64)).unwrap_or(0);
    let powered_at = s.optional(reader, "powered_at", instant).unwrap_or(Span::ZERO);
    section.finish(reader);
    Some(Class1 {
        address: address?,
        segment,
        position_mm,
        crystal,
        least_cycle,
        watchdog,
        get_cfg,
        dx_retries,
        lost_after,
        clear_for,
        powered_at,
    })
}
fn least_cycle(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Span {
    section.optional(reader, "least_cycle", instant).unwrap_or(Span::ZERO)
}

/// Reads of `[master]` whether it is isochronous, and complains about keys of the other kind.
pub(super) fn pace(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Pace {
    let isochronous = section.optional(reader, "isochronous", yes).unwrap_or(true);
    let least = least_cycle(section, reader);
    if !isochronous {
        refuse(section, reader, &["t_dp", "t_i", "t_o", "t_pll_w", "t_pll_d", "gc_jitter", "active_spare"]);
        return Pace::Free { least };
    }
    if let Some(node) = section.node("least_cycle") {
        let fault = Fault::new("an isochronous master has T_DP and no least cycle time")
            .rule("its cycles begin with SYNCH every T_DP (manual 3.3.2)")
            .help("leave it out, or isochronous = false");
        reader.complain(node.place, &section.path_of("least_cycle"), fault);
    }
    Pace::Synch
}
/// No slave that works only isochronously has a master without SYNCH.
pub(super) fn isochronous_required(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let required = |slave: &&Slave| slave.device.isochronous_required && !facts.scenario.is_clocked(slave);
    for slave in facts.scenario.answering().filter(required) {
        let fault = Fault::new(format!(
            "slave {} works only in isochronous mode, and its master {} sends no SYNCH",
            slave.address, slave.master
        ))
        .rule(format!("{} has Isochron_Mode_required (its GSD file)", slave.device.name))
        .help("an isochronous [master] for it, or another device");
        about(reader, &format!("slave.{}.master", slave.address), &[&format!("slave.{}.device", slave.address)], fault);
    }
}
/// Complains about isochronous times of a slave whose device has no isochronous mode.
pub(super) fn refuse_times_of_device(section: &Section<'_>, reader: &mut Reader<'_>) {
    for key in ["t_i", "t_o", "t_pll_w", "t_pll_d"] {
        if let Some(node) = section.node(key) {
            let fault = Fault::new("this device has no isochronous mode, and so no such time")
                .rule("a device without Isochron_Mode_supp gets no isochronous block (its GSD file)")
                .help("leave it out");
            reader.complain(node.place, &section.path_of(key), fault);
        }
    }
}
/// Complains about isochronous times of a slave that is not clocked.
pub(super) fn refuse_times(section: &Section<'_>, reader: &mut Reader<'_>) {
    refuse(section, reader, &["t_i", "t_o", "t_pll_w", "t_pll_d"]);
}
fn refuse(section: &Section<'_>, reader: &mut Reader<'_>, keys: &[&str]) {
    for key in keys {
        if let Some(node) = section.node(key) {
            let fault = Fault::new("without SYNCH this key has no meaning")
                .rule("T_DP, T_I, T_O, the PLL window and SYNCH belong to isochronous mode (manual 3.3)")
                .help("leave it out, or give the slave an isochronous master");
            reader.complain(node.place, &section.path_of(key), fault);
        }
    }
}

/// Every slave's master is there.
pub(super) fn owners(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let scenario = facts.scenario;
    let further = scenario.class1.iter().map(|class1| class1.address);
    let masters: Vec<_> = std::iter::once(scenario.master.address).chain(further).collect();
    for slave in &scenario.slaves {
        if !masters.contains(&slave.master) {
            let all: Vec<_> = masters.iter().map(ToString::to_string).collect();
            let fault = Fault::new(format!("slave {} has no master: there is none at {}", slave.address, slave.master))
                .rule("master is the address of [master] or of a [[class1]]")
                .help(format!("the masters are {}", all.join(", ")));
            about(reader, &format!("slave.{}.master", slave.address), &[], fault);
        }
    }
}

/// Events that switch the supply name any station, all others a slave.
pub(super) fn event_stations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, event) in facts.scenario.events.iter().enumerate() {
        let power = matches!(event.action, Action::PowerOff | Action::PowerOn);
        let missing = event
            .slaves
            .iter()
            .find(|&&address| power && facts.scenario.stations().all(|station| station.address != address));
        if let Some(address) = missing {
            let fault = Fault::new(format!("there is no station {address}"))
                .help("station is the address of a master or of a slave");
            let path = format!("event.{}", i + 1);
            let others = [format!("{path}.slave"), format!("{path}.slaves")];
            about(reader, &format!("{path}.station"), &[&others[0], &others[1]], fault);
        }
    }
}

/// The watchdog of a further master has steps that its slaves have.
pub(super) fn watchdogs(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, class1) in facts.scenario.class1.iter().enumerate() {
        let Some(watchdog) = class1.watchdog.filter(|watchdog| watchdog.base_1ms) else { continue };
        let coarse = facts.scenario.slaves_of(class1.address).find(|slave| !slave.device.wd_base_1ms);
        if let Some(slave) = coarse {
            let fault = coarse_watchdog(watchdog.span(), slave);
            about(reader, &format!("class1.{}.watchdog", i + 1), &[], fault);
        }
    }
}
