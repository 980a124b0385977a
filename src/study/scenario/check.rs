//! The rules between the keys of a scenario, each with its source, the numbers, and the nearest right value. Those of
//! the bus and of its times are the planner's, see [`crate::study::plan::rules`]; the others are a function each here.

use super::class1;
use super::class2;
use super::disturbance;
use super::error::{Fault, Problem};
use super::expect;
use super::gsd;
use super::section::Reader;
use super::services;
use super::topology;
use super::tree::Place;
use super::{Action, CodeSequence, Crystal, Extent, LineFault, Link, Run, Sample, Scenario, Slave, What, When, Which};
use crate::device::options::Resolution;
use crate::sim::motion;
use crate::study::plan::finding::{Finding, Subject};
pub(super) use crate::study::plan::rules::Facts;
use crate::study::plan::rules::{self, Weight};
use crate::time::Span;
use crate::wire::Address;

/// Which rules a scenario must keep.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Check {
    /// Every one.
    All,
    /// All but the planner's.
    ToPlan,
    /// The same, and times may be missing.
    ToPropose,
}

/// A rule: looks at the facts and complains.
type Rule = fn(&Facts<'_>, &mut Reader<'_>);

/// One stage of rules.
struct Stage {
    own: &'static [Rule],
    /// Rules of the planner.
    planned: &'static [&'static [rules::Rule]],
}

impl Stage {
    const fn own(own: &'static [Rule]) -> Self {
        Self { own, planned: &[] }
    }
}

/// All rules in stages. A stage takes for granted that the stages before found nothing.
static STAGES: &[Stage] = &[
    Stage::own(&[some_slave, own_addresses, class1::owners, addresses_within_hsa, wiring, crystals, run_length]),
    Stage::own(&[class2::slaves, class1::watchdogs, class1::isochronous_required]),
    Stage { own: &[gsd::device_rates], planned: &[rules::BUS] },
    Stage { own: &[], planned: &[rules::CYCLE] },
    Stage { own: &[services::sync_and_freeze], planned: &[rules::SERVICES] },
    Stage::own(&[encoder_parameters, resolution]),
    Stage { own: &[], planned: &[rules::INSTANTS] },
    Stage { own: &[], planned: &[rules::TIMERS] },
    Stage { own: &[functions, code_sequence, units_per_rev, total_range, cycles_fit], planned: &[rules::JITTER] },
    Stage::own(&[publishers, subscribers, samples, link_counts, link_watchdog]),
    Stage::own(&[sample_lengths, destinations, told_lengths]),
    Stage::own(&[gsd::set_prm_length]),
    Stage::own(&[event_stations, class1::event_stations, gsd::acyclic_devices, event_instants]),
    Stage::own(&[
        disturbance_stations,
        disturbance::station::are_there,
        disturbance::application::are_slaves,
        disturbance::clock::are_crystals,
        disturbance::token::are_masters,
        disturbance::path::in_order,
        disturbance::path::few_cuts,
        services::commands,
        expect::subjects,
    ]),
    Stage { own: &[], planned: &[rules::START_UP] },
];

/// Largest offset of a crystal. Model: twice what cheap ones have over temperature and age.
pub(super) const CRYSTAL_MAX_PPB: i64 = 200_000;

/// Checks `scenario` stage by stage until one complains, the planner's rules only with [`Check::All`].
pub(super) fn check(scenario: &Scenario, reader: &mut Reader<'_>, check: Check) -> Vec<Problem> {
    let facts = Facts::of(scenario);
    for stage in STAGES {
        for rule in stage.own {
            rule(&facts, reader);
        }
        let planned = stage.planned.iter().filter(|_| check == Check::All).copied().flatten();
        for rule in planned.filter(|rule| rule.weight == Weight::Must) {
            for finding in rule.findings(&facts) {
                tell(reader, finding);
            }
        }
        let problems = reader.take_problems();
        if !problems.is_empty() {
            return problems;
        }
    }
    Vec::new()
}

/// Complains about what the planner found, if it has something to say.
fn tell(reader: &mut Reader<'_>, finding: Finding) {
    let Some(fault) = finding.fault else { return };
    let path = finding.key.to_string();
    match finding.key.subject {
        Subject::Slave(address) if finding.rule.instead.is_empty() => {
            let inherited = format!("master.{}", finding.key.name);
            about(reader, &path, &[&inherited, &format!("slave.{address}.address")], fault);
        }
        _ => about(reader, &path, finding.rule.instead, fault),
    }
}

/// Complains about `key`, which stands at its own path or at one of `others`.
pub(super) fn about(reader: &mut Reader<'_>, key: &str, others: &[&str], fault: Fault) {
    let place = match reader.place(&[key]) {
        Place::Missing => reader.place(others),
        place => place,
    };
    reader.complain_first(place, key, fault);
}

/// Complains about `key` of `slave`, which may have inherited it from `[master]`.
pub(super) fn about_slave(reader: &mut Reader<'_>, slave: &Slave, key: &str, fault: Fault) {
    let path = format!("slave.{}.{key}", slave.address);
    let address = format!("slave.{}.address", slave.address);
    about(reader, &path, &[&format!("master.{key}"), &address], fault);
}

fn some_slave(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    if facts.scenario.configured().next().is_none() {
        let fault =
            Fault::new("there is no slave that answers").help("add a [[slave]] with address, device, t_i and t_o");
        about(reader, "slave", &[], fault);
    }
}

fn own_addresses(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    // Of slaves the table is known by the address, so that two of them are found when they are read.
    let all: Vec<_> = facts.scenario.stations().collect();
    for (i, station) in all.iter().enumerate() {
        if let Some(other) = all[..i].iter().find(|other| other.address == station.address) {
            let (a, b) = (other.what_it_is(), station.what_it_is());
            let fault = Fault::new(format!("{a} and {b} have the address {}", station.address))
                .rule("every station of a bus has an address of its own (EN 50170-2)");
            about(reader, &format!("{}.address", station.path()), &[], fault);
        }
    }
}

fn addresses_within_hsa(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let hsa = facts.scenario.bus.params.hsa;
    for station in facts.scenario.stations() {
        let address = station.address;
        if address.get() > hsa {
            let fault = Fault::new(format!("the address {address} is above hsa = {hsa}"))
                .rule("no station is above the highest station address HSA (EN 50170-2)")
                .help(format!("hsa = {address} or more, at most 126"));
            about(reader, &format!("{}.address", station.path()), &[], fault);
        }
    }
}

fn wiring(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    topology::positions(facts.scenario, reader);
    topology::loads(facts.scenario, reader);
    topology::jitter(facts.scenario, reader);
}

fn crystals(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for station in facts.scenario.stations() {
        let (Crystal::Offset(ppb) | Crystal::Within(ppb)) = station.crystal;
        if ppb.abs() > CRYSTAL_MAX_PPB {
            let fault = Fault::new(format!("a crystal is not off by {} ppm", ppb as f64 / 1e3))
                .rule("a crystal is within 200 ppm (Model: twice what cheap ones have)")
                .help(format!("\"{} ppm\" at most", ppb.signum() * CRYSTAL_MAX_PPB / 1_000));
            about(reader, &format!("{}.crystal", station.path()), &[], fault);
        }
    }
}

fn run_length(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let (key, fault) = match facts.scenario.run.duration {
        Extent::Time(span) if span <= Span::ZERO => ("run.duration", Fault::new("a run of no time shows nothing")),
        Extent::Cycles(0) => ("run.cycles", Fault::new("a run of no cycles shows nothing")),
        _ => return,
    };
    about(reader, key, &[], fault);
}

/// Octet 15 and scaling belong to the encoders' parameter block, which a subscriber does not have.
fn encoder_parameters(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering().filter(|slave| slave.device.subscriber) {
        let given = [
            ("scaling", slave.scaling.is_some()),
            ("functions", slave.functions),
            ("code_sequence", slave.code_sequence == CodeSequence::Ccw),
            ("resolution", slave.options.resolution.is_some()),
            ("preset_value", slave.options.preset_value != 0),
        ];
        if let Some((key, _)) = given.into_iter().find(|&(_, given)| given) {
            let fault = Fault::new(format!("{} has no {key}", slave.device.name))
                .rule("disc, scaling, preset and code sequence are an encoder's (manual 3.2)");
            about_slave(reader, slave, key, fault);
        }
    }
}

/// The positions of a disc fit into the words of telegram 81.
fn resolution(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let Resolution { steps_per_rev, revolutions } = slave.resolution();
        if let Err(error) = motion::Resolution::new(steps_per_rev, revolutions) {
            let fault = Fault::new(error.to_string()).rule("G1_XIST1 and G1_XIST2 have 32 bits (manual 2.2)");
            about_slave(reader, slave, "resolution", fault);
        }
    }
}

fn functions(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        if slave.scaling.is_some() && !slave.functions {
            let fault = Fault::new(format!("slave {} has scaling, but functions = false", slave.address))
                .rule("scaling needs octet 15 bit 1 as well as bit 3 (manual 3.2.2, Model: D21)")
                .help("leave out functions, or leave out scaling");
            about_slave(reader, slave, "functions", fault);
        }
    }
}

fn code_sequence(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        if slave.code_sequence == CodeSequence::Ccw && !slave.functions {
            let fault = Fault::new(format!("code_sequence = \"ccw\" has no effect in slave {}", slave.address))
                .rule("the code sequence is in force with octet 15 bit 1 alone (manual 3.2.2)")
                .help("add functions = true, which needs T_I and the gap of 375 us");
            about_slave(reader, slave, "code_sequence", fault);
        }
    }
}

fn units_per_rev(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let (Some(scaling), steps) = (slave.scaling, slave.resolution().steps_per_rev) else { continue };
        if !(1..=steps).contains(&scaling.units_per_rev) {
            let fault = Fault::new(format!("{} units per revolution are out of range", scaling.units_per_rev))
                .rule(format!("1 to {steps} units, the physical resolution of {} (manual 3.2.3)", slave.device.name))
                .help(format!("units_per_rev = {}", scaling.units_per_rev.clamp(1, steps)));
            about_slave(reader, slave, "scaling.units_per_rev", fault);
        }
    }
}

fn total_range(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let Some(scaling) = slave.scaling else { continue };
        let revolutions = slave.resolution().revolutions;
        let max = u64::from(scaling.units_per_rev) * u64::from(revolutions);
        if scaling.total_range == 0 || u64::from(scaling.total_range) > max {
            let fault = Fault::new(format!("a total range of {} is out of range", scaling.total_range))
                .rule(format!(
                    "total range <= {} units per revolution x {revolutions} revolutions (manual 3.2.4, Model: D20)",
                    scaling.units_per_rev
                ))
                .help(format!("total_range = {}", u64::from(scaling.total_range).clamp(1, max.max(1))));
            about_slave(reader, slave, "scaling.total_range", fault);
        }
    }
}

fn cycles_fit(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let Extent::Cycles(cycles) = facts.scenario.run.duration else { return };
    let most = Run::LONGEST.div_floor(t_dp(facts)) as u64;
    if cycles > most {
        let fault = Fault::new(format!("{cycles} cycles of {} are too long", facts.scenario.master.t_dp))
            .rule("a run ends within 24 years (Model: range of time)")
            .help(format!("cycles = {most} at most"));
        about(reader, "run.cycles", &[], fault);
    }
}

/// T_DP, or a tick if it is nothing: the planner says that.
fn t_dp(facts: &Facts<'_>) -> Span {
    facts.scenario.master.t_dp.max(Span::from_ticks(1))
}

/// The links with their paths.
fn links<'a>(facts: &Facts<'a>) -> impl Iterator<Item = (String, &'a Link)> {
    facts.scenario.links.iter().enumerate().map(|(i, link)| (format!("link.{}", i + 1), link))
}

fn publishers(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link) in links(facts) {
        let fault = match configured(facts, link.publisher) {
            None => no_slave(facts, link.publisher),
            Some(slave) if !slave.device.publisher => Fault::new(format!("slave {} cannot publish", slave.address))
                .rule(format!("{} has no publisher function (its profile, manual 3.4)", slave.device.name)),
            Some(_) if link.publisher == link.subscriber => {
                Fault::new(format!("slave {} would subscribe to itself", link.publisher))
                    .rule("publisher and subscriber are two slaves (manual 1.2)")
            }
            Some(_) => continue,
        };
        about(reader, &format!("{path}.publisher"), &[], fault);
    }
}

fn subscribers(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, (path, link)) in links(facts).enumerate() {
        let earlier = &facts.scenario.links[..i];
        let fault = match configured(facts, link.subscriber) {
            None => no_slave(facts, link.subscriber),
            Some(_) if link.publisher == link.subscriber => continue,
            Some(slave) if !slave.device.subscriber => Fault::new(format!("slave {} cannot subscribe", slave.address))
                .rule(format!("{} has no subscriber function (its profile, manual 3.4)", slave.device.name))
                .help("subscriber-drive can"),
            Some(_) if earlier.iter().any(|e| is_pair(e, link) && e.table == link.table) => {
                Fault::new(format!("slave {} has this publisher already", link.subscriber))
                    .rule("one link per publisher, subscriber and table (Model: D26 counts latencies by the pair)")
                    .help("one link with both: samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]")
            }
            Some(_) => continue,
        };
        about(reader, &format!("{path}.subscriber"), &[], fault);
    }
}

/// The slave at `address`, if the master has it in its list.
fn configured<'a>(facts: &Facts<'a>, address: Address) -> Option<&'a Slave> {
    facts.scenario.slave(address).filter(|slave| !slave.silent && slave.master == facts.scenario.master.address)
}

/// The fault of naming a slave that is not there, or silent.
fn no_slave(facts: &Facts<'_>, address: Address) -> Fault {
    let all: Vec<_> = facts.scenario.configured().map(|slave| slave.address.to_string()).collect();
    let silent = facts.scenario.slave(address).is_some();
    let message = if silent { format!("slave {address} is silent") } else { format!("there is no slave {address}") };
    Fault::new(message).help(format!("the slaves are {}", all.join(", ")))
}

/// Whether two links are of the same publisher and subscriber.
fn is_pair(one: &Link, other: &Link) -> bool {
    (one.publisher, one.subscriber) == (other.publisher, other.subscriber)
}

/// Every sample with the path of its keys.
fn all_samples<'a>(facts: &Facts<'a>, reader: &Reader<'_>) -> Vec<(String, &'a Link, Sample)> {
    let mut all = Vec::new();
    for (path, link) in links(facts) {
        let listed = reader.place(&[&format!("{path}.samples")]) != Place::Missing;
        for (i, &sample) in link.samples.iter().enumerate() {
            all.push((if listed { format!("{path}.samples.{}", i + 1) } else { path.clone() }, link, sample));
        }
    }
    all
}

/// Length of the publisher's data as Set_Prm says it, and who says so.
fn told_length<'a>(facts: &Facts<'a>, link: &Link) -> Option<(u8, &'a str)> {
    let publisher = facts.scenario.slave(link.publisher)?;
    Some(
        link.publisher_length
            .map_or((publisher.device.inputs, &*publisher.device.name), |told| (told, "publisher_length")),
    )
}

fn samples(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link, sample) in all_samples(facts, reader) {
        let Some((inputs, whose)) = told_length(facts, link) else { continue };
        let (offset, length) = (u32::from(sample.offset), u32::from(sample.length));
        if length == 0 || offset + length > u32::from(inputs) {
            let fault = Fault::new(format!(
                "a sample of {length} octets from octet {offset} on is not in the publisher's data"
            ))
            .rule(format!(
                "length >= 1 and offset {offset} + length {length} <= {inputs} octets of {whose} (DXB link table)"
            ))
            .help("offset = 4, length = 4 is G1_XIST1 of telegram 81");
            let publisher = format!("link.{}.publisher", number_of(&path));
            about(reader, &format!("{path}.length"), &[&format!("{path}.offset"), &publisher], fault);
        }
    }
}

/// The number of the link that `path` belongs to.
fn number_of(path: &str) -> &str {
    path.split('.').nth(1).unwrap_or_default()
}

fn sample_lengths(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link, sample) in all_samples(facts, reader) {
        let Some(subscriber) = facts.scenario.slave(link.subscriber) else { continue };
        let longest = subscriber.device.dxb.data;
        if sample.length > longest {
            let fault = Fault::new(format!("slave {} takes no sample of {} octets", link.subscriber, sample.length))
                .rule(format!("length <= {longest} octets of {} (DXB_Max_Data_Length)", subscriber.device.name));
            about(reader, &format!("{path}.length"), &[], fault);
        }
    }
}

/// Where the samples of the subscriber table go.
fn destinations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let mut taken: Vec<(Address, u8, std::ops::Range<u16>)> = Vec::new();
    for (path, link, sample) in all_samples(facts, reader) {
        let (Some(slot), Some(subscriber)) = (link.slot(), facts.scenario.slave(link.subscriber)) else { continue };
        let (limits, name) = (subscriber.device.dxb, &subscriber.device.name);
        let to = u16::from(sample.to)..u16::from(sample.to) + u16::from(sample.length);
        if slot > limits.slots {
            let fault = Fault::new(format!("slave {} has no slot {slot} for samples", link.subscriber))
                .rule(format!("slot 1 to {} of {name} (its profile)", limits.slots));
            about(reader, &format!("link.{}.slot", number_of(&path)), &[], fault);
        } else if to.end > limits.data.into() {
            let fault = Fault::new(format!(
                "{} octets from octet {} on are not in the slot's data area",
                sample.length, to.start
            ))
            .rule(format!("to + length <= {} octets of {name} (its profile)", limits.data));
            about(reader, &format!("{path}.to"), &[&format!("{path}.length")], fault);
        } else if let Some((.., other)) = taken.iter().find(|(station, number, other)| {
            (*station, *number) == (link.subscriber, slot) && other.start < to.end && to.start < other.end
        }) {
            let fault =
                Fault::new(format!("octets {} to {} of slot {slot} are taken already", other.start, other.end - 1))
                    .rule(format!(
                        "no two samples of slave {} go to the same octet (Model: its slots)",
                        link.subscriber
                    ))
                    .help(format!("for example to = {}", other.end));
            let publisher = format!("link.{}.publisher", number_of(&path));
            about(reader, &format!("{path}.to"), &[&format!("{path}.offset"), &publisher], fault);
        }
        taken.push((link.subscriber, slot, to));
    }
}

/// A publisher's data have one length, and its subscriber knows one.
fn told_lengths(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, (path, link)) in links(facts).enumerate() {
        let Some((told, _)) = told_length(facts, link) else { continue };
        let others = facts.scenario.links[..i].iter().filter(|other| is_pair(other, link));
        let other = others.filter_map(|other| told_length(facts, other)).find(|&(other, _)| other != told);
        if let Some((other, _)) = other {
            let fault = Fault::new(format!("slave {} would know two lengths of its publisher's data", link.subscriber))
                .rule("all links of a pair say the same publisher_length (Model: a publisher has one)")
                .help(format!("publisher_length = {other} here too"));
            about(reader, &format!("{path}.publisher_length"), &[&format!("{path}.publisher")], fault);
        }
    }
}

fn link_counts(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let most = usize::from(slave.device.dxb.links);
        let all = all_samples(facts, reader);
        let mut own = all.iter().filter(|(_, link, _)| link.subscriber == slave.address);
        if let Some((path, ..)) = own.nth(most) {
            let fault = Fault::new(format!("slave {} has more than {most} links", slave.address))
                .rule(format!("a subscriber has up to {most} links (GSD: DXB_Max_Link_Count), each sample is one"));
            about(reader, &format!("link.{}.subscriber", number_of(path)), &[], fault);
        }
    }
}

fn link_watchdog(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    if facts.scenario.master.watchdog.is_none() && !facts.scenario.links.is_empty() {
        let fault = Fault::new("links need the watchdog")
            .rule("a subscriber watches its links for the watchdog time (VPC3+ manual, Model: D27)")
            .help("watchdog = \"200 ms\"");
        about(reader, "master.watchdog", &[], fault);
    }
}

fn event_stations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let events = facts.scenario.events.iter().enumerate();
    let orders = events.filter(|(_, event)| !matches!(event.action, Action::PowerOff | Action::PowerOn));
    for (i, event) in orders {
        if let Some(&address) = event.slaves.iter().find(|&&address| facts.scenario.slave(address).is_none()) {
            let path = format!("event.{}", i + 1);
            about(reader, &format!("{path}.slave"), &[&format!("{path}.slaves")], no_slave(facts, address));
        }
    }
}

fn event_instants(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dp = t_dp(facts);
    for (i, event) in facts.scenario.events.iter().enumerate() {
        let (key, late) = match (event.when, facts.scenario.run.duration) {
            (When::Time(at), Extent::Time(end)) => ("at", at >= end),
            (When::Cycle(at), Extent::Cycles(end)) => ("cycle", at >= end),
            (When::Cycle(at), Extent::Time(end)) => ("cycle", at >= end.div_floor(t_dp) as u64),
            // How long the first cycle takes to come is not known here.
            (When::Time(_), Extent::Cycles(_)) => continue,
        };
        if late {
            let fault = Fault::new("the run is over before this event");
            about(reader, &format!("event.{}.{key}", i + 1), &[], fault.help("a longer run, or an earlier event"));
        }
    }
}

fn disturbance_stations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let named = match &disturbance.what {
            What::Line(LineFault { which: Which { from, to, .. }, .. }) => [("from", *from), ("to", *to)],
            What::Source(source) => [("near", source.near), ("near", None)],
            _ => continue,
        };
        for (key, station) in named {
            if let Some(address) = station
                && address != facts.scenario.master.address
                && facts.scenario.class1(address).is_none()
                && facts.scenario.slave(address).is_none()
                && facts.scenario.class2.iter().all(|class2| class2.address != address)
            {
                let fault = no_slave(facts, address);
                about(reader, &format!("disturbance.{}.{key}", i + 1), &[], fault);
            }
        }
    }
}

impl Action {
    /// Whether an event with this action names slaves.
    pub(super) const fn about_slaves(self) -> bool {
        !matches!(self, Self::Clear | Self::Operate | Self::Control(_))
    }
}
