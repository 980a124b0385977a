//! Written: a proposal as the text of a scenario, which is the one that was read with the proposed values in their places.
//! Everything else stays as it was, comments too.

use std::fmt::Write as _;

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::Plan;
use super::proposal::Proposal;
use crate::dp::master::Pace;
use crate::study::quantity;
use crate::study::scenario::{Scenario, Slave, Watchdog};
use crate::time::Span;

/// The lists of a scenario, whose tables an override counts from 1.
const LISTS: [&str; 7] = ["segment", "repeater", "class1", "class2", "link", "event", "disturbance"];
/// Times that slaves inherit from the master.
const TIMES: [&str; 4] = ["t_i", "t_o", "t_pll_w", "t_pll_d"];

/// `text`, the network `before` with `overrides`, with the values of `proposal`.
///
/// # Errors
/// The text is no TOML.
pub fn written(
    text: &str,
    overrides: &[(String, String)],
    before: &Scenario,
    proposal: &Proposal,
) -> Result<String, toml_edit::TomlError> {
    let mut document: DocumentMut = text.parse()?;
    let root = document.as_table_mut();
    let mut slaves = listed(root, "slave");
    for (path, value) in overrides {
        put_override(root, &mut slaves, path, value);
    }
    let after = &proposal.scenario;
    bus(root, before, after);
    master(root, before, after);
    for table in slaves.iter_mut() {
        slave(table, before, after);
    }
    root.insert("slave", Item::ArrayOfTables(slaves));
    Ok(head(proposal) + &document.to_string())
}

/// What the text begins with.
fn head(proposal: &Proposal) -> String {
    let scenario = &proposal.scenario;
    let plan = Plan::of(scenario);
    let mut head = format!("# Proposal for {}: ", scenario.name);
    if scenario.master.pace == Pace::Synch {
        let _ = write!(
            head,
            "the shortest T_DP with which all rules hold.\n#\n# T_DX {} at most; the cycle holds {}, {} is spare.\n# A \
             repeated Data_Exchange fits before SYNCH from t_dp = \"{}\" on.\n",
            plan.t_dx,
            plan.content(),
            plan.spare(scenario.master.t_dp),
            exact(proposal.t_dp_with_repeat)
        );
    } else {
        let free = plan.free_running(scenario);
        let _ = writeln!(
            head,
            "without SYNCH; all rules hold.\n#\n# T_cycle {} at most, {} with a GAP poll.",
            free.cycle(),
            free.with_gap()
        );
    }
    if !plan.visits.is_empty() {
        let _ =
            writeln!(head, "# T_TR {}: {} masters share the line.", scenario.bus.params.t_tr, plan.visits.len() + 1);
    }
    head + "\n"
}

/// The tables of the list `name`, taken out of `root`.
fn listed(root: &mut Table, name: &str) -> ArrayOfTables {
    root.remove(name).and_then(|item| item.into_array_of_tables().ok()).unwrap_or_default()
}

/// Puts one `--set` into its place.
fn put_override(root: &mut Table, slaves: &mut ArrayOfTables, path: &str, value: &str) {
    let parts: Vec<_> = path.split('.').map(str::trim).collect();
    let literal = format!("x = {}", value.trim()).parse::<DocumentMut>().ok().filter(|_| !value.contains('\n'));
    let literal = literal.filter(|document| document.len() == 1).and_then(|document| document.get("x").cloned());
    let item = literal.unwrap_or_else(|| toml_edit::value(value.trim()));
    match parts[..] {
        ["slave", station, ref rest @ ..] => {
            if let Some(table) = station.parse().ok().and_then(|address| alone(slaves, address)) {
                put(table, rest, item);
            }
        }
        [name, number, ref rest @ ..] if LISTS.contains(&name) => {
            let index = number.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let mut tables = listed(root, name);
            if let Some(table) = index.and_then(|index| tables.get_mut(index)) {
                put(table, rest, item);
            }
            root.insert(name, Item::ArrayOfTables(tables));
        }
        _ => put(root, &parts, item),
    }
}

/// Keys of which one takes the other's place.
const INSTEAD: [(&str, &str); 3] = [("duration", "cycles"), ("at", "cycle"), ("slave", "slaves")];

fn put(table: &mut dyn TableLike, path: &[&str], item: Item) {
    match path {
        [] => {}
        [key] => {
            for (one, other) in INSTEAD.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]) {
                if *key == one {
                    table.remove(other);
                }
            }
            replace(table, key, item);
        }
        [key, rest @ ..] => {
            let inner = table.entry(key).or_insert(toml_edit::value(toml_edit::InlineTable::new()));
            if let Some(inner) = inner.as_table_like_mut() {
                put(inner, rest, item);
            }
        }
    }
}

/// Gives a key its value; a comment behind the old one stays.
fn replace(table: &mut dyn TableLike, key: &str, mut item: Item) {
    let decor = table.get(key).and_then(Item::as_value).map(|old: &Value| old.decor().clone());
    if let (Some(decor), Some(value)) = (decor, item.as_value_mut()) {
        *value.decor_mut() = decor;
    }
    table.insert(key, item);
}

/// The addresses of one `[[slave]]`.
fn addresses(table: &Table, all: &Scenario) -> Vec<u8> {
    let numbers = |item: &Item| -> Vec<i64> {
        match item.as_value() {
            Some(Value::Integer(number)) => vec![*number.value()],
            Some(Value::Array(numbers)) => numbers.iter().filter_map(Value::as_integer).collect(),
            Some(Value::String(text)) => text.value().split(',').flat_map(range).collect(),
            _ => Vec::new(),
        }
    };
    let named: Vec<_> = ["address", "addresses"].iter().filter_map(|key| table.get(key)).flat_map(numbers).collect();
    let known = all.slaves.iter().map(|slave| slave.address.get());
    known.filter(|address| named.contains(&i64::from(*address))).collect()
}

/// `3` or `3..10`, both ends included.
fn range(part: &str) -> Vec<i64> {
    let (first, last) = part.split_once("..").unwrap_or((part, part));
    match (first.trim().parse(), last.trim().parse::<u8>()) {
        (Ok(first), Ok(last)) => (first..=i64::from(last)).collect(),
        _ => Vec::new(),
    }
}

/// The table of the slave at `address` alone: taken out of the list of addresses if it is in one.
fn alone(slaves: &mut ArrayOfTables, address: u8) -> Option<&mut Table> {
    let all: Vec<Vec<i64>> = slaves
        .iter()
        .map(|table| match (table.get("address"), table.get("addresses")) {
            (Some(item), _) => item.as_integer().into_iter().collect(),
            (_, Some(item)) => match item.as_value() {
                Some(Value::Array(numbers)) => numbers.iter().filter_map(Value::as_integer).collect(),
                Some(Value::String(text)) => text.value().split(',').flat_map(range).collect(),
                Some(Value::Integer(number)) => vec![*number.value()],
                _ => Vec::new(),
            },
            _ => Vec::new(),
        })
        .collect();
    let index = all.iter().position(|numbers| numbers.contains(&address.into()))?;
    if all[index].len() == 1 {
        return slaves.get_mut(index);
    }
    let table = slaves.get_mut(index)?;
    let mut own = table.clone();
    let others: toml_edit::Array = all[index].iter().copied().filter(|&number| number != i64::from(address)).collect();
    replace(table, "addresses", toml_edit::value(others));
    own.remove("addresses");
    own.insert("address", toml_edit::value(i64::from(address)));
    slaves.push(own);
    let last = slaves.len() - 1;
    slaves.get_mut(last)
}

/// Bus parameters that are no longer what they were.
fn bus(root: &mut Table, before: &Scenario, after: &Scenario) {
    let (old, new) = (&before.bus.params, &after.bus.params);
    let Some(table) = root.get_mut("bus").and_then(Item::as_table_like_mut) else { return };
    for (key, old, new) in [
        ("t_sl", old.t_sl, new.t_sl),
        ("min_tsdr", old.min_tsdr, new.min_tsdr),
        ("max_tsdr", old.max_tsdr, new.max_tsdr),
        ("t_set", old.t_set, new.t_set),
        ("t_qui", old.t_qui, new.t_qui),
        ("t_tr", old.t_tr, new.t_tr),
    ] {
        if old != new {
            replace(table, key, toml_edit::value(new.to_string()));
        }
    }
    for (key, old, new) in [
        ("max_retry_limit", old.max_retry_limit, new.max_retry_limit),
        ("gap_factor", old.gap_factor, new.gap_factor),
        ("hsa", old.hsa, new.hsa),
    ] {
        if old != new {
            replace(table, key, toml_edit::value(i64::from(new)));
        }
    }
}

fn master(root: &mut Table, before: &Scenario, after: &Scenario) {
    let Some(table) = root.get_mut("master").and_then(Item::as_table_like_mut) else { return };
    let (old, new) = (&before.master, &after.master);
    let span = |span: Span| toml_edit::value(exact(span));
    if new.pace == Pace::Synch {
        replace(table, "t_dp", span(new.t_dp));
        let first = after.configured().next().map(times).unwrap_or_default();
        for (key, time) in TIMES.into_iter().zip(first) {
            if key != "t_pll_d" || table.contains_key(key) || time != Span::ZERO {
                replace(table, key, span(time));
            }
        }
    }
    if old.t_mapc != new.t_mapc {
        replace(table, "t_mapc", toml_edit::value(i64::from(new.t_mapc)));
    }
    if old.watchdog != new.watchdog {
        replace(table, "watchdog", span(new.watchdog.map_or(Span::ZERO, Watchdog::span)));
    }
    if let Some(time) = new.services.data_control_time.filter(|_| old.services != new.services) {
        replace(table, "data_control_time", span(time));
    }
}

/// The times that a slave inherits from the master where it has none, as [`TIMES`].
fn times(slave: &Slave) -> [Span; 4] {
    [slave.times.t_i, slave.times.t_o, slave.times.t_pll_w, slave.times.t_pll_d]
}

/// One `[[slave]]`; all its slaves have the same values.
fn slave(table: &mut Table, before: &Scenario, after: &Scenario) {
    let of =
        |scenario: &Scenario, number: u8| scenario.slaves.iter().find(|slave| slave.address.get() == number).cloned();
    let found = addresses(table, after).into_iter().find_map(|number| of(before, number).zip(of(after, number)));
    let Some((old, new)) = found else { return };
    if old.t_sdr != new.t_sdr {
        replace(table, "t_sdr", toml_edit::value(new.t_sdr.to_string()));
    }
    if !after.is_clocked(&new) || new.silent {
        return;
    }
    let inherited = after.configured().next().map(times).unwrap_or_default();
    for ((key, time), inherited) in TIMES.into_iter().zip(times(&new)).zip(inherited) {
        if time == inherited {
            table.remove(key);
        } else {
            replace(table, key, toml_edit::value(exact(time)));
        }
    }
}

/// A span as a scenario can have it, exactly.
fn exact(span: Span) -> String {
    let shown = span.to_string();
    if quantity::span(&shown, None) == Ok(span) { shown } else { format!("{} tick", span.ticks()) }
}
