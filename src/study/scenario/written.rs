//! What a scenario says of one key, without reading the rest of it.

use super::error::ScenarioError;
use super::read::changed;
use super::section::Reader;
use super::tree::{Node, Source, Table, Value};

/// The value that `text`, which messages call `source`, and `overrides` give `key`, named as an override names it; none
/// if they say nothing of it, even if it has a usual value. A text comes as it is, anything else as an override has it.
///
/// # Errors
/// The text is no TOML, or an override fits nowhere.
pub(in crate::study) fn written(
    source: &str,
    text: &str,
    overrides: &[(String, String)],
    key: &str,
) -> Result<Option<String>, ScenarioError> {
    let source = Source::new(source, text, overrides);
    let mut root = source.parse()?;
    let mut reader = Reader::new(&source);
    let slaves = changed(&mut reader, &mut root);
    if reader.has_problems() {
        return Err(ScenarioError { problems: reader.take_problems() });
    }
    let path: Vec<&str> = key.split('.').map(str::trim).collect();
    let node = match path[..] {
        ["slave", group, ref rest @ ..] if group.starts_with('#') => {
            root.get("slave").and_then(|node| of(node, group.trim_start_matches('#'), rest))
        }
        ["slave", station, ref rest @ ..] => {
            let slave = slaves.iter().find(|slave| slave.address.to_string() == station);
            slave.and_then(|slave| at(&slave.table, rest))
        }
        _ => at(&root, &path),
    };
    Ok(node.map(|node| match &node.value {
        Value::Text(text) => text.clone(),
        other => other.as_override(),
    }))
}

/// The value at `path` under `table`. Entries of lists are counted from 1.
fn at<'t>(table: &'t Table, path: &[&str]) -> Option<&'t Node> {
    let (key, rest) = path.split_first()?;
    let node = table.get(key)?;
    rest.split_first().map_or(Some(node), |(next, rest)| of(node, next, rest))
}
/// The value at `key`, and then `rest`, under `node`.
fn of<'t>(node: &'t Node, key: &str, rest: &[&str]) -> Option<&'t Node> {
    let inner = match &node.value {
        Value::Table(table) => table.get(key),
        Value::List(items) => items.get(key.parse::<usize>().ok()?.checked_sub(1)?),
        _ => None,
    }?;
    rest.split_first().map_or(Some(inner), |(next, rest)| of(inner, next, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[run]\ncycles = 100\n[master]\nt_dp = \"1 ms\"\ngc_jitter = { kind = \"sum\", of = [{ sigma = \"1 ns\" }] }\n\
        [[slave]]\naddresses = \"3..4\"\nt_sdr = \"20 tbit\"\npll = { kp = 0.25 }\n\
        [[disturbance]]\nrate = \"1 %\"\n";

    #[test]
    fn a_key_has_the_value_that_is_written_or_set() {
        let sets = [("slave.4.t_sdr", "30 tbit"), ("slave.#1.pll.ki", "1/32"), ("disturbance.1.rate", "2e-3")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()));
        let of = |sets: &[_], key: &str| written("s.toml", TEXT, sets, key).unwrap();
        for (key, before, after) in [
            ("master.t_dp", Some("1 ms"), Some("1 ms")),
            ("run.cycles", Some("100"), Some("100")),
            ("master.gc_jitter.of.1.sigma", Some("1 ns"), Some("1 ns")),
            ("slave.3.t_sdr", Some("20 tbit"), Some("20 tbit")),
            ("slave.4.t_sdr", Some("20 tbit"), Some("30 tbit")),
            ("slave.#1.t_sdr", Some("20 tbit"), Some("20 tbit")),
            ("slave.3.pll.kp", Some("0.25"), Some("0.25")),
            ("slave.3.pll.ki", None, Some("1/32")),
            ("slave.#1.pll.ki", None, Some("1/32")),
            ("disturbance.1.rate", Some("1 %"), Some("2e-3")),
            ("master.t_o", None, None),
            ("slave.5.t_sdr", None, None),
            ("slave.#2.t_sdr", None, None),
            ("disturbance.0.rate", None, None),
            ("master.t_dp.deeper", None, None),
        ] {
            assert_eq!(of(&[], key).as_deref(), before, "{key}");
            assert_eq!(of(&sets, key).as_deref(), after, "{key}");
        }
    }

    #[test]
    fn what_is_wrong_is_told() {
        let told =
            |text, sets: &[(String, String)]| written("s.toml", text, sets, "master.t_dp").unwrap_err().to_string();
        assert!(told("[master", &[]).contains("the file is TOML"));
        let set = ("slave.9.t_sdr".to_owned(), "20 tbit".to_owned());
        assert!(told(TEXT, &[set]).contains("no slave has the address \"9\""));
    }
}
