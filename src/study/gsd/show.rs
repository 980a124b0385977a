//! A GSD file as a page: what was understood, what was ignored, what does not fit, and whether it can be simulated.

use super::device::{hex, title};
use super::file::{File, Value};
use super::keywords::{Group, KEYWORDS, Keyword, Unit, WITHOUT_EFFECT};
use super::prm::{UserPrm, allowed};
use super::{Gsd, device};
use crate::study::report::aligned;
use crate::time::Span;
use crate::wire::config;
use std::collections::BTreeMap;
use std::fmt;

/// Longest text that is shown as a value (characters).
const TEXT: usize = 40;
/// Rows of a table that are shown.
const ROWS: usize = 60;
/// Modules of a slot that are shown.
const ALLOWED: usize = 12;

impl fmt::Display for Gsd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = &self.file;
        let mut lines = vec![format!("{}: {}", self.name, title(file))];
        for group in Group::ALL {
            group_table(file, group, &mut lines);
        }
        modules(file, &mut lines);
        user_parameters(file, &mut lines);
        ignored(file, &mut lines);
        self.findings_table(&mut lines);
        self.verdict(&mut lines);
        for line in lines {
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

impl Gsd {
    fn findings_table(&self, lines: &mut Vec<String>) {
        let found = self.findings();
        if found.is_empty() {
            return;
        }
        lines.extend([String::new(), "does not fit".to_owned()]);
        let line = |line: Option<usize>| line.map_or_else(|| "-".to_owned(), |line| line.to_string());
        let count = found.len();
        let shown = found.into_iter().take(ROWS);
        let rows: Vec<_> =
            shown.map(|finding| vec![line(finding.line), finding.weight.text().to_owned(), finding.message]).collect();
        lines.extend(aligned(&["line", "", "what"], &[1, 2], &rows));
        more(count, lines);
    }
    fn verdict(&self, lines: &mut Vec<String>) {
        lines.push(String::new());
        match device::profile(&self.file, None) {
            Ok(profile) => {
                let function = if profile.subscriber { "a subscriber drive" } else { "an encoder" };
                let mode = if profile.isochronous { "" } else { " without isochronous mode, which runs freely" };
                lines.push(format!("can be simulated as {function}{mode}: device = {{ gsd = \"{}\" }}", self.name));
                lines.push(format!(
                    "not in a GSD file: disc of {} x {} steps (resolution), T_O to the latch {}, with octet 15 bit 1 {} (Model)",
                    profile.steps_per_rev, profile.revolutions, profile.gap_min, profile.functions_min
                ));
            }
            Err(fault) => {
                lines.extend([fault.message, fault.rule, fault.help].into_iter().filter(|text| !text.is_empty()));
            }
        }
    }
}

/// Says how many of `count` rows were left out.
fn more(count: usize, lines: &mut Vec<String>) {
    if count > ROWS {
        lines.push(format!("and {} more", count - ROWS));
    }
}

fn group_table(file: &File, group: Group, lines: &mut Vec<String>) {
    let row = |keyword: &Keyword| {
        let (value, at) = file.values.get(keyword.name)?;
        let (shown, means) = shown(file, keyword, value);
        Some(vec![keyword.name.to_owned(), shown, means, at.line.to_string()])
    };
    let has_effect = |keyword: &&Keyword| WITHOUT_EFFECT.iter().all(|(name, _)| *name != keyword.name);
    let of_group = KEYWORDS.iter().filter(|keyword| keyword.group == group);
    let rows: Vec<_> = of_group.filter(has_effect).filter_map(row).collect();
    if !rows.is_empty() {
        lines.push(String::new());
        lines.extend(aligned(&[group.title(), "value", "", "line"], &[0, 1, 2], &rows));
    }
}

/// A value, and what it means.
fn shown(file: &File, keyword: &Keyword, value: &Value) -> (String, String) {
    let number = match value {
        Value::Text(text) if text.chars().count() > TEXT => {
            return (format!("{}...", text.chars().take(TEXT).collect::<String>()), keyword.says.to_owned());
        }
        Value::Text(text) => return (text.clone(), keyword.says.to_owned()),
        Value::Number(number) => *number,
    };
    let base = |keyword| file.number(keyword).unwrap_or(1_500);
    let iso =
        |units: u64| u32::try_from(units).map_or_else(|_| "-".to_owned(), |u| Span::from_iso_units(u).to_string());
    let quantity = match keyword.unit {
        Unit::Plain => return (number.to_string(), keyword.says.to_owned()),
        Unit::Hex => return (format!("0x{number:04X}"), keyword.says.to_owned()),
        Unit::Octets => "octets".to_owned(),
        Unit::Tbit => "t_bit".to_owned(),
        Unit::Iso => iso(number.into()),
        Unit::OfBaseDp => iso(u64::from(number) * u64::from(base("TBASE_DP"))),
        Unit::OfBaseIo => iso(u64::from(number) * u64::from(base("TBASE_IO"))),
        Unit::Us100 => (Span::from_us(100) * number.into()).to_string(),
        Unit::Ms10 => (Span::from_ms(10) * number.into()).to_string(),
    };
    (number.to_string(), format!("{quantity}, {}", keyword.says))
}

fn modules(file: &File, lines: &mut Vec<String>) {
    let all = &file.description.available_modules;
    let row = |(module, at): (&std::sync::Arc<gsd_parser::Module>, &super::At)| {
        let lengths = config::lengths(&module.config);
        let (inputs, outputs) = lengths
            .map_or(("-".to_owned(), "-".to_owned()), |(inputs, outputs)| (inputs.to_string(), outputs.to_string()));
        vec![module.name.trim().to_owned(), hex(&module.config), inputs, outputs, at.line.to_string()]
    };
    let rows: Vec<_> = all.iter().zip(&file.modules).take(ROWS).map(row).collect();
    if !rows.is_empty() {
        lines.push(String::new());
        lines.extend(aligned(&["module", "Chk_Cfg", "in", "out", "line"], &[0, 1], &rows));
    }
    more(all.len(), lines);
    for slot in file.description.slots.iter().take(ROWS) {
        let mut allowed: Vec<_> = slot.allowed_modules.iter().take(ALLOWED).map(|module| module.name.trim()).collect();
        if slot.allowed_modules.len() > ALLOWED {
            allowed.push("...");
        }
        let usual = slot.default.name.trim();
        lines.push(format!("slot {} {}: {usual}; allowed: {}", slot.number, slot.name.trim(), allowed.join(", ")));
    }
    more(file.description.slots.len(), lines);
}

fn user_parameters(file: &File, lines: &mut Vec<String>) {
    let module =
        device::module(file, None).ok().map(|index| &file.description.available_modules[index].module_prm_data);
    let Ok(prm) = UserPrm::of(file, module) else { return };
    lines.extend([String::new(), format!("preset octets of Set_Prm from octet 8 on: {}", hex(prm.octets()))]);
    let row = |(octet, definition): (usize, &gsd_parser::UserPrmDataDefinition)| {
        let text = definition.text_ref.as_ref().map(|texts| {
            let mut texts: Vec<_> = texts.iter().map(|(text, value)| (*value, text.trim())).collect();
            texts.sort_unstable();
            texts.iter().map(|(value, text)| format!("{value} {text}")).collect::<Vec<_>>().join(", ")
        });
        vec![
            definition.name.trim().to_owned(),
            octet.to_string(),
            format!("{:?}", definition.data_type),
            definition.default_value.to_string(),
            text.unwrap_or_else(|| allowed(definition)),
        ]
    };
    let rows: Vec<_> = prm.named().take(ROWS).map(row).collect();
    if !rows.is_empty() {
        lines.extend(aligned(&["user parameter", "octet", "type", "preset", "can be"], &[0, 2, 4], &rows));
    }
    more(prm.named().count(), lines);
}

fn ignored(file: &File, lines: &mut Vec<String>) {
    // Keywords that are there again and again are one line.
    let mut known = BTreeMap::new();
    let mut rows: Vec<(&str, Vec<usize>)> = Vec::new();
    for (keyword, line) in &file.ignored {
        let row = *known.entry(keyword.to_lowercase()).or_insert(rows.len());
        match rows.get_mut(row) {
            Some((_, places)) => places.push(*line),
            None => rows.push((keyword, vec![*line])),
        }
    }
    let known = WITHOUT_EFFECT.iter().filter_map(|&(keyword, reason)| {
        let (_, at) = file.values.get(keyword)?;
        Some(vec![keyword.to_owned(), at.line.to_string(), reason.to_owned()])
    });
    let known: Vec<_> = known.collect();
    if rows.is_empty() && known.is_empty() {
        return;
    }
    lines.push(String::new());
    let row = |(keyword, places): &(&str, Vec<usize>)| {
        let first = places[0].to_string();
        let all = if places.len() == 1 { first } else { format!("{first} and {} more", places.len() - 1) };
        vec![(*keyword).to_owned(), all, "nothing here depends on it".to_owned()]
    };
    let shown: Vec<_> = known.into_iter().chain(rows.iter().take(ROWS).map(row)).collect();
    lines.extend(aligned(&["ignored, without an effect here", "line", "reason"], &[0, 1, 2], &shown));
    more(rows.len(), lines);
}
