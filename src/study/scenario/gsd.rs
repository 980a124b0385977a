//! Devices from GSD files: `device = { gsd = "file", module = "name" }` and `prm = { "name" = value }` of a slave.

use super::check::{Facts, about, about_slave};
use super::error::{Fault, Problem};
use super::section::{Reader, Section, choice, text};
use super::tree::{Node, Value};
use super::{Action, CodeSequence, Scaling, Slave};
use crate::device::profile::{Device, PROFILES};
use crate::device::tool::Work;
use crate::study::build;
use crate::study::gsd::{Gsd, Touched, UserPrm};
use crate::time::BitRate;
use crate::wire::prm::{EncoderOptions, UserPrm81};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;

/// GSD files by their path, each read once.
pub(super) type Files = BTreeMap<PathBuf, Result<Rc<Gsd>, Box<Problem>>>;

/// What a slave is.
pub(super) struct Kind {
    pub(super) device: Device,
    /// Preset user parameters of a GSD file's device.
    preset: Option<UserPrm>,
}

/// Reads `device`: the name of a built-in one, or a table with a GSD file.
pub(super) fn device(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Kind> {
    if !matches!(section.node("device"), Some(Node { value: Value::Table(_), .. })) {
        let example = format!("\"{}\"", PROFILES[0].name);
        let profile = section
            .required(reader, "device", &example, |node| choice(node, "device", PROFILES, |profile| &profile.name));
        return profile.map(|profile| Kind { device: profile.into(), preset: None });
    }
    let mut inner = section.table(reader, "device")?;
    let file = inner.required(reader, "gsd", "\"encoder.gsd\"", |node| text(node).map(str::to_owned));
    let module = inner.optional(reader, "module", |node| text(node).map(str::to_owned));
    let wrong_module = inner.has("module") && module.is_none();
    let paths = (inner.path_of("gsd"), inner.path_of("module"));
    inner.finish(reader);
    let path = reader.source.dir.join(file.filter(|_| !wrong_module)?);
    let read = reader.gsd_files.entry(path.clone()).or_insert_with(|| Gsd::load(&path).map(Rc::new)).clone();
    let place = reader.place(&[&paths.0]);
    let gsd = read.map_err(|problem| reader.complain(place, &paths.0, unusable(*problem))).ok()?;
    let module = module.as_deref();
    let read = gsd.device(module).and_then(|device| Ok(Kind { device, preset: Some(gsd.user_prm(module)?) }));
    let help = |fault: Fault| {
        let see = fault.help.is_empty();
        if see { fault.help(format!("isodp gsd {} shows all of it", path.display())) } else { fault }
    };
    let key = if module.is_some() { &paths.1 } else { &paths.0 };
    read.map_err(|fault| reader.complain(reader.place(&[key]), key, help(fault))).ok()
}

/// A file that cannot be read, as a fault of the key that names it.
fn unusable(problem: Problem) -> Fault {
    let Problem { source, position, fault, .. } = problem;
    let place = position.map_or(String::new(), |at| format!(":{}:{}", at.line, at.column));
    Fault { message: format!("{source}{place}: {}", fault.message), ..fault }
}

/// Keys of a slave that fill bits of the encoders' user block: the key, octet of Set_Prm in a block that begins with
/// octet 11, how many octets, bits (manual 3.1).
const KEYS: [(&str, usize, usize, u8); 6] = [
    ("code_sequence", 15, 1, EncoderOptions::COUNTER_CLOCKWISE.0),
    ("functions", 15, 1, EncoderOptions::ACTIVATE.0),
    ("scaling", 15, 1, EncoderOptions::ACTIVATE.0 | EncoderOptions::SCALING.0),
    ("scaling", 16, 4, 0xFF),
    ("scaling", 20, 4, 0xFF),
    ("max_life_failures", 24, 1, 0xFF),
];
/// First octet of the user block in [`KEYS`].
const BLOCK: usize = 11;
/// First octet of user parameters in Set_Prm.
const FIRST: usize = 8;

/// User parameters of a slave, with what the scenario says about them.
pub(super) struct Chosen {
    prm: UserPrm,
    /// Where the encoders' user block begins in them.
    block: Option<usize>,
    /// Which of the scenario's own keys are given.
    given: Vec<&'static str>,
}

/// Reads `prm` of a slave of this kind; `None` for built-in devices. The slave's other keys have been read.
pub(super) fn user_prm(kind: Option<&Kind>, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Chosen> {
    let Some(Kind { device, preset: Some(preset) }) = kind else {
        if section.table(reader, "prm").is_some() && kind.is_some() {
            let fault = Fault::new("only a device from a GSD file has named user parameters")
                .help("device = { gsd = \"...\" }, or the keys code_sequence, functions, scaling, max_life_failures");
            reader.complain(reader.place(&[&section.path_of("prm")]), &section.path_of("prm"), fault);
        }
        return None;
    };
    let mut prm = preset.clone();
    let block = if device.subscriber { None } else { prm.encoder_block().ok().flatten() };
    let given: Vec<_> = KEYS.iter().map(|key| key.0).filter(|key| section.has(key)).collect();
    section.table(reader, "prm");
    let mut filled: Vec<Touched> = Vec::new();
    if let Some(Node { value: Value::Table(table), .. }) = section.node("prm") {
        for (name, (_, node)) in &table.0 {
            let path = format!("{}.{name}", section.path_of("prm"));
            reader.places.insert(path.clone(), node.place);
            let keys = set(&mut prm, name, node).and_then(|touched| {
                let twice =
                    |at: &Touched| filled.iter().any(|other| other.octet == at.octet && other.bits & at.bits != 0);
                if touched.iter().any(twice) {
                    return Err(Fault::new(format!("another parameter sets the octets of \"{name}\" too")));
                }
                filled.extend(&touched);
                no_conflict(&touched, block, &given, name)
            });
            match keys {
                Err(fault) => reader.complain(node.place, &path, fault),
                // A rule about such a key is a rule about this parameter.
                Ok(keys) => {
                    for key in keys {
                        reader.places.insert(section.path_of(key), node.place);
                    }
                }
            }
        }
    }
    Some(Chosen { prm, block, given })
}

/// Sets one parameter.
fn set(prm: &mut UserPrm, name: &str, node: &Node) -> Result<Vec<Touched>, Fault> {
    match &node.value {
        Value::Text(text) => prm.set_text(name, text),
        Value::Integer(Some(number)) => match i64::try_from(*number) {
            Ok(number) => prm.set(name, number),
            Err(_) => Err(Fault::new(format!("\"{name}\" cannot be {number}"))),
        },
        other => Err(Fault::new(format!("this is {}", other.noun()))
            .help("write a number, or one of the parameter's texts in quotation marks")),
    }
}

/// The scenario's own keys that would fill bits of `touched`, if none of them is given.
fn no_conflict(
    touched: &[Touched],
    block: Option<usize>,
    given: &[&'static str],
    name: &str,
) -> Result<Vec<&'static str>, Fault> {
    let Some(block) = block else { return Ok(Vec::new()) };
    let fills = |&(_, octet, count, bits): &(&str, usize, usize, u8)| {
        let first = octet - BLOCK + FIRST + block;
        touched.iter().any(|at| (first..first + count).contains(&at.octet) && at.bits & bits != 0)
    };
    let keys: Vec<_> = KEYS.iter().filter(|key| fills(key)).map(|key| key.0).collect();
    match keys.iter().find(|key| given.contains(key)) {
        Some(key) => {
            let octet = touched.first().map_or(0, |at| at.octet);
            Err(Fault::new(format!("\"{name}\" and {key} of this slave are about the same parameter"))
                .rule(format!("octet {octet} of Set_Prm is said once (manual 3.1)"))
                .help(format!("leave out {key}, or leave out \"{name}\"")))
        }
        None => Ok(keys),
    }
}

impl Chosen {
    /// Gives them to `slave`: the scenario's own keys go into the octets, what the octets say besides into the slave.
    pub(super) fn apply(self, slave: &mut Slave) {
        slave.user_prm = self.prm.octets().to_vec();
        let Some(block) = self.block else { return };
        let Some(octets) = slave.user_prm.get_mut(block + 4..block + UserPrm81::LEN) else { return };
        let has = |key| self.given.contains(&key);
        let mut options = EncoderOptions(octets[0]);
        if has("code_sequence") {
            options = options.with(EncoderOptions::COUNTER_CLOCKWISE, slave.code_sequence == CodeSequence::Ccw);
        }
        if has("functions") || has("scaling") {
            options = options.with(EncoderOptions::ACTIVATE, slave.functions);
        }
        if let Some(Scaling { units_per_rev, total_range }) = slave.scaling {
            options = options.with(EncoderOptions::SCALING, true);
            octets[1..5].copy_from_slice(&units_per_rev.to_be_bytes());
            octets[5..9].copy_from_slice(&total_range.to_be_bytes());
        }
        octets[0] = options.0;
        if has("max_life_failures") {
            octets[9] = slave.max_life_failures;
        }
        let word = |at: usize| octets[at..at + 4].iter().fold(0, |word, &octet| word << 8 | u32::from(octet));
        if !has("scaling") {
            let scaled = options.activate() && options.scaling();
            slave.scaling = scaled.then(|| Scaling { units_per_rev: word(1), total_range: word(5) });
        }
        slave.max_life_failures = octets[9];
        slave.functions = options.activate();
        slave.code_sequence = if options.counter_clockwise() { CodeSequence::Ccw } else { CodeSequence::Cw };
    }
}

/// Every slave works at the bit rate.
pub(super) fn device_rates(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let rate = facts.scenario.bus.params.rate;
    for slave in facts.scenario.answering().filter(|slave| !slave.device.works_at(rate)) {
        let all = BitRate::ALL.iter().filter(|&&rate| slave.device.works_at(rate));
        let fault = Fault::new(format!("slave {} does not work at {rate}", slave.address))
            .rule(format!("bit rates of {} (its profile or GSD file)", slave.device.name))
            .help(all.map(|rate| format!("\"{rate}\"")).collect::<Vec<_>>().join(", "));
        about(reader, "bus.rate", &[], fault);
    }
}

/// Blocks and links fit into what the device takes.
pub(super) fn set_prm_length(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let octets = build::set_prm(facts.scenario, slave).len() - 7;
        if octets > slave.device.max_prm.into() {
            let fault = Fault::new(format!("slave {} would get {octets} octets of user parameters", slave.address))
                .rule(format!(
                    "{} takes {} octets (GSD: Max_User_Prm_Data_Len)",
                    slave.device.name, slave.device.max_prm
                ))
                .help("an entry of the link table takes 4 octets; is the GSD file right?");
            about_slave(reader, slave, "device", fault);
        }
    }
}

/// Parameters are asked of devices that answer.
pub(super) fn acyclic_devices(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, event) in facts.scenario.events.iter().enumerate() {
        if !matches!(event.action, Action::ReadParameter { .. } | Action::ChangeParameter { .. }) {
            continue;
        }
        let slaves = event.slaves.iter().filter_map(|&address| facts.scenario.slave(address));
        if let Some(slave) = slaves.into_iter().find(|slave| !slave.device.acyclic && !slave.user_prm.is_empty()) {
            let fault = Fault::new(format!("slave {} takes no acyclic requests", slave.address))
                .rule(format!("{} has no C1_Read_Write_supp (its GSD file)", slave.device.name));
            let path = format!("event.{}", i + 1);
            about(reader, &format!("{path}.slave"), &[&format!("{path}.slaves")], fault);
        }
    }
    for (i, class2) in facts.scenario.class2.iter().enumerate() {
        for (j, job) in class2.jobs.iter().enumerate() {
            // Every slave answers the reading services of DP-V0.
            if job.works.iter().all(|work| matches!(work, Work::Read(_))) {
                continue;
            }
            let slaves = job.slaves.iter().filter_map(|&address| facts.scenario.slave(address));
            let without = |slave: &&Slave| slave.device.ms2_connections == 0 && slave.options.ms2_connections.is_none();
            if let Some(slave) = slaves.into_iter().find(without) {
                let fault = Fault::new(format!("slave {} takes no acyclic requests of class 2 masters", slave.address))
                    .rule(format!("{} has no C2_Read_Write_supp (its GSD file)", slave.device.name))
                    .help("ms2_connections of the slave gives it some all the same");
                let path = format!("class2.{}.job.{}", i + 1, j + 1);
                about(reader, &format!("{path}.slave"), &[&format!("{path}.slaves")], fault);
            }
        }
    }
}
