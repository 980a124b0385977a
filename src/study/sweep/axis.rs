//! Axis: a parameter, or several that move together, and the values that it takes.
//!
//! Values are a list, or a range whose values are exact: a linear one by its ends and its step or the number of its
//! values, a logarithmic one by its ends, the number of its values and the significant digits to which they are rounded.

use std::cmp::Ordering;

use crate::study::quantity::Measure;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, Section, number, text};
use crate::study::scenario::tree::{Node, Place, Value};

/// What a [`Measure`] of time says it is.
const TIME: &str = "a time";
/// Most values of one axis.
pub const MOST_VALUES: usize = 100_000;

/// One axis.
#[derive(Clone, PartialEq, Debug)]
pub struct Axis {
    /// What conditions, tables and plots call it: its first key unless the file says otherwise.
    pub name: String,
    /// The keys of the scenario that it sets, as overrides name them.
    pub keys: Vec<String>,
    /// Per value of the axis the values of its keys, as overrides have them.
    pub values: Vec<Vec<String>>,
    /// Per value of the axis what stands for it in tables and plots, if it is not the first key's value.
    pub labels: Option<Vec<String>>,
    /// Where the values are written.
    pub(super) place: Place,
    /// Where each value is written.
    pub(super) places: Vec<Place>,
}

impl Axis {
    /// How many values it has.
    pub fn len(&self) -> usize {
        self.values.len()
    }
    /// Whether it has no value. Axes of a file have.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
    /// What stands for its value of this number: the label, or the first key's value.
    pub fn label(&self, number: usize) -> &str {
        self.labels.as_ref().map_or_else(|| plain(&self.values[number][0]), |labels| &labels[number])
    }
    /// Reads one `[[axis]]`.
    pub(super) fn read(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Self> {
        let s = &mut section;
        let key = s.optional(reader, "key", key);
        let keys =
            s.optional(reader, "keys", |node| match &node.value {
                Value::List(items) if items.len() > 1 => items.iter().map(self::key).collect(),
                _ => Err(Fault::new("this is no list of several keys")
                    .help("one key alone is written key = \"master.t_dp\"")),
            });
        if s.has("key") == s.has("keys") {
            let fault = Fault::new("an axis has either key or keys");
            let help = "for example: key = \"master.t_dp\", or keys = [\"master.t_dp\", \"master.t_o\"]";
            s.complain(reader, fault.help(help));
        }
        let name = s.optional(reader, "name", |node| text(node).map(str::to_owned));
        let keys = key.map(|key| vec![key]).or(keys);
        let many = keys.as_ref().map_or(1, Vec::len);
        let place = ["values", "from"].iter().find_map(|key| s.node(key)).map_or(s.place(), |node| node.place);
        let listed = s.optional(reader, "values", |node| list(node, many));
        let range = range(s, reader, many);
        if s.has("values") == s.has("from") {
            let fault = Fault::new("an axis has either values or a range");
            let help =
                "for example: values = [\"1 ms\", \"2 ms\"], or from = \"1 ms\", to = \"8 ms\", step = \"0.5 ms\"";
            s.complain(reader, fault.help(help));
        }
        let places = match s.node("values") {
            Some(Node { value: Value::List(items), .. }) => items.iter().map(|item| item.place).collect(),
            _ => vec![place; range.as_ref().map_or(0, Vec::len)],
        };
        let values = listed.or(range);
        let count = values.as_ref().map_or(0, Vec::len);
        let labels = s.optional(reader, "labels", |node| labels(node, count));
        section.finish(reader);
        let (keys, values) = (keys?, values?);
        Some(Self { name: name.unwrap_or_else(|| keys[0].clone()), keys, values, labels, place, places })
    }
}

/// A value as people write it: a text that would be something else without its quotation marks loses them.
pub(super) fn plain(value: &str) -> &str {
    let inner = value.strip_prefix('"').and_then(|value| value.strip_suffix('"'));
    inner.filter(|inner| !inner.contains(['"', '\\'])).unwrap_or(value)
}

/// A key as an override names it.
fn key(node: &Node) -> Result<String, Fault> {
    key_of(text(node)?)
}

/// `text` as a key of a scenario that can take several values.
pub(in crate::study) fn key_of(text: &str) -> Result<String, Fault> {
    match text.trim() {
        "run.seed" => Err(Fault::new("seeds are no parameter")
            .rule("each repetition of a combination has its own seed")
            .help("write repetitions = 10")),
        key if key.contains('.') && !key.contains('=') => Ok(key.to_owned()),
        _ => Err(Fault::new("this is no key of a scenario")
            .help("a key names a table and a key, as --set does: \"master.t_dp\", \"slave.3.crystal\", \"slave.#1.addresses\"")),
    }
}

/// `values = [...]`; where several keys move together, a list of as many for each value.
fn list(node: &Node, keys: usize) -> Result<Vec<Vec<String>>, Fault> {
    let Value::List(items) = &node.value else {
        return Err(Fault::new(format!("this is {}", node.value.noun())).help("write values = [\"1 ms\", \"2 ms\"]"));
    };
    if items.is_empty() || items.len() > MOST_VALUES {
        return Err(Fault::new(format!("{} values", items.len())).rule(format!("an axis has 1 to {MOST_VALUES}")));
    }
    let together = |item: &Node| match &item.value {
        _ if keys == 1 => Ok(vec![item.value.as_override()]),
        Value::List(row) if row.len() == keys => Ok(row.iter().map(|item| item.value.as_override()).collect()),
        Value::List(row) => Err(Fault::new(format!("{} values for {keys} keys", row.len()))),
        other => Err(Fault::new(format!("this is {} for {keys} keys", other.noun())).help(
            "keys that move together have a list of values for each step: values = [[\"1 ms\", \"0.5 ms\"], ...]",
        )),
    };
    let values: Vec<_> = items.iter().map(together).collect::<Result<_, _>>()?;
    match values.iter().enumerate().find(|(at, value)| values[..*at].contains(value)) {
        Some((_, twice)) if values.len() <= 1_000 => {
            Err(Fault::new(format!("{} is there twice", twice.join(", "))).rule("the values of an axis differ"))
        }
        _ => Ok(values),
    }
}

/// `labels = [...]`, one for each value.
fn labels(node: &Node, count: usize) -> Result<Vec<String>, Fault> {
    match &node.value {
        Value::List(items) if items.len() == count => Ok(items
            .iter()
            .map(|item| match &item.value {
                Value::Text(text) => text.clone(),
                other => other.literal(),
            })
            .collect()),
        Value::List(items) => Err(Fault::new(format!("{} labels for {count} values", items.len()))),
        other => Err(Fault::new(format!("this is {}", other.noun())).help("write labels = [1, 2, 4, 8]")),
    }
}

/// A number with its unit, or a number.
fn measure(node: &Node) -> Result<Measure, Fault> {
    let written = match &node.value {
        Value::Text(text) => text.clone(),
        Value::Integer(_) | Value::Fraction(_) => node.value.literal(),
        other => return Err(Fault::new(format!("this is {}", other.noun())).help("such as \"125 us\" or 3")),
    };
    measured(&written)
}

/// The number with its unit, or the number, that was `written`.
pub(in crate::study) fn measured(written: &str) -> Result<Measure, Fault> {
    let found = Measure::read(written);
    let found = found
        .ok_or_else(|| Fault::new(format!("\"{written}\" is no number with a unit")).help("such as \"125 us\""))?;
    whole_ticks(found)?;
    Ok(found)
}

/// A time that is no whole number of ticks is refused, with its neighbours.
fn whole_ticks(found: Measure) -> Result<(), Fault> {
    let (above, below) = found.steps();
    if found.noun != TIME || below == 1 {
        return Ok(());
    }
    let ticks = above.div_euclid(below);
    Err(Fault::new(format!(
        "\"{found}\" is not a whole number of ticks of 1/12 ns; its neighbours are \"{ticks} tick\" and \"{} tick\"",
        ticks + 1
    )))
}

/// What a range is written with.
const RANGE: [&str; 6] = ["from", "to", "step", "steps", "scale", "digits"];

/// `from`, `to` and what is between; none if there is no range or something is wrong.
fn range(s: &mut Section<'_>, reader: &mut Reader<'_>, keys: usize) -> Option<Vec<Vec<String>>> {
    let [from, to, step] = ["from", "to", "step"].map(|key| s.optional(reader, key, measure));
    let count = s.optional(reader, "steps", number(2..=MOST_VALUES));
    let scale = s.optional(reader, "scale", |node| match text(node)? {
        "linear" => Ok(false),
        "log" => Ok(true),
        _ => Err(Fault::new("there is no such scale").help("\"linear\" or \"log\"")),
    });
    let digits = s.optional(reader, "digits", number(1..=12_usize));
    if !RANGE.iter().any(|key| s.has(key)) {
        return None;
    }
    let logarithmic = scale == Some(true);
    let wrong = if keys > 1 {
        Some(Fault::new("a range is of one key").help("keys that move together have their values listed"))
    } else if !(s.has("from") && s.has("to")) {
        Some(Fault::new("a range has from and to"))
    } else if s.has("step") == s.has("steps") {
        let fault = Fault::new("a range has either step or steps");
        Some(fault.help("step is the distance of two values, steps the number of all values, both ends included"))
    } else if logarithmic && s.has("step") {
        Some(Fault::new("a logarithmic range has no step").help("write steps, the number of its values"))
    } else if !logarithmic && s.has("digits") {
        Some(Fault::new("a linear range is exact and has no digits"))
    } else {
        None
    };
    if let Some(fault) = wrong {
        s.complain(reader, fault);
        return None;
    }
    let (from, to) = (from?, to?);
    let values = if logarithmic {
        logarithms(from, to, count?, digits.unwrap_or(3))
    } else {
        match (step, count) {
            (Some(step), _) => stepped(from, to, step),
            (_, Some(count)) => divided(from, to, count),
            _ => return None,
        }
    };
    let place = s.node("from").map_or(s.place(), |node| node.place);
    let values = values.map_err(|fault| reader.complain(place, &s.path_of("from"), fault)).ok()?;
    Some(values.into_iter().map(|value| vec![value]).collect())
}

/// Refuses ends that are not of one kind or are the same.
pub(in crate::study) fn like(from: Measure, to: Measure) -> Result<(), Fault> {
    if !from.is_like(to) {
        return Err(Fault::new(format!("\"{from}\" and \"{to}\" are not of one kind")));
    }
    if from.steps() == to.steps() {
        return Err(Fault::new(format!("this range begins and ends with \"{from}\"")));
    }
    Ok(())
}

/// The exact value `from + (to - from) * number / count`.
fn between(from: Measure, to: Measure, number: i128, count: i128) -> Result<String, Fault> {
    let value = distance(from, to).and_then(|(far, per)| {
        let far = if from.compare(to) == Some(Ordering::Greater) { -far } else { far };
        let (above, below) = from.steps();
        // `per` is a multiple of `below`.
        let start = above.checked_mul(per / below)?.checked_mul(count)?;
        from.with_steps((start.checked_add(far.checked_mul(number)?)?, per.checked_mul(count)?))
    });
    let value = value.ok_or_else(too_fine)?;
    whole_ticks(value)?;
    let exact = value.decimal_in(value).is_some() || value.steps().1 == 1 && value.noun == TIME;
    exact.then(|| value.to_string()).ok_or_else(|| {
        Fault::new(format!("value {} of this range, about {value}, has no end", number + 1))
            .help("choose ends or steps whose values can be written down")
    })
}

/// `count` values, both ends included.
fn divided(from: Measure, to: Measure, count: usize) -> Result<Vec<String>, Fault> {
    like(from, to)?;
    (0..count as i128).map(|number| between(from, to, number, count as i128 - 1)).collect()
}

/// Values `step` apart, both ends included.
fn stepped(from: Measure, to: Measure, step: Measure) -> Result<Vec<String>, Fault> {
    like(from, to)?;
    if !from.is_like(step) {
        return Err(Fault::new(format!("\"{from}\" and the step \"{step}\" are not of one kind")));
    }
    if step.steps().0 <= 0 {
        let fault = Fault::new(format!("a step of \"{step}\" leads nowhere"));
        return Err(fault.help("write it positive, whatever the direction"));
    }
    let quotient = distance(from, to).and_then(|(above, below)| {
        let (of, per) = step.steps();
        Some((above.checked_mul(per)?, below.checked_mul(of)?))
    });
    let (above, below) = quotient.ok_or_else(too_fine)?;
    let count = above / below;
    if above % below != 0 {
        return Err(Fault::new(format!("steps of \"{step}\" do not lead from \"{from}\" to \"{to}\""))
            .rule("a range ends with its last value"));
    }
    if count >= MOST_VALUES as i128 {
        return Err(Fault::new(format!("{} values", count + 1)).rule(format!("an axis has 1 to {MOST_VALUES}")));
    }
    divided(from, to, count as usize + 1)
}

/// How far it is from one to the other, a fraction; none if it is out of reach.
pub(in crate::study) fn distance(from: Measure, to: Measure) -> Option<(i128, i128)> {
    let ((above, below), (other, other_below)) = (from.steps(), to.steps());
    let difference = other.checked_mul(below)?.checked_sub(above.checked_mul(other_below)?)?;
    Some((difference.checked_abs()?, below.checked_mul(other_below)?))
}

pub(in crate::study) fn too_fine() -> Fault {
    Fault::new("this range is too fine to reckon with")
}

/// `count` values of equal ratio, rounded to `digits` significant digits in the unit of `from`; the ends are exact.
fn logarithms(from: Measure, to: Measure, count: usize, digits: usize) -> Result<Vec<String>, Fault> {
    like(from, to)?;
    let (first, last) = (from.value(), to.value_in(from));
    if first <= 0.0 || last <= 0.0 {
        return Err(Fault::new("a logarithmic range is above 0"));
    }
    let mut values = Vec::with_capacity(count);
    for number in 0..count {
        let value = match number {
            0 => from.to_string(),
            last if last == count - 1 => to.to_string(),
            _ => {
                let share = number as f64 / (count - 1) as f64;
                let rounded = format!("{:.*e}", digits - 1, first * libm::pow(last / first, share));
                let rounded: f64 = rounded.parse().expect("a number that was just written");
                let value = Measure::read(format!("{rounded} {}", from.unit).trim());
                let value = value.ok_or_else(|| Fault::new("this range has values beyond 15 digits"))?;
                whole_ticks(value)?;
                value.to_string()
            }
        };
        if values.last() == Some(&value) {
            let fault = Fault::new(format!("{digits} significant digits make two values \"{value}\""));
            return Err(fault.help("write more digits or fewer steps"));
        }
        values.push(value);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use crate::study::scenario::ScenarioError;
    use crate::study::sweep::definition::Definition;

    fn definition(axis: &str) -> Result<Definition, ScenarioError> {
        let text = format!("base = \"x.toml\"\nfigures = [\"faults\"]\n[[axis]]\n{axis}\n");
        Definition::parse("s", "s.toml", &text)
    }
    #[track_caller]
    fn values(range: &str) -> Vec<String> {
        let definition = definition(&format!("key = \"a.b\"\n{range}")).unwrap_or_else(|error| panic!("{error}"));
        definition.axes[0].values.iter().map(|value| value.join("|")).collect()
    }
    /// What is wrong, without rule and help.
    #[track_caller]
    fn wrong(axis: &str) -> Vec<String> {
        let problems = definition(axis).expect_err("it is wrong").problems;
        problems.into_iter().map(|problem| problem.fault.message).collect()
    }

    #[test]
    fn linear_ranges_are_exact_and_have_both_ends() {
        for (range, expected) in [
            (r#"from = "100 ns", to = "0.4 us", step = "100 ns""#, &["100 ns", "200 ns", "300 ns", "400 ns"][..]),
            (r#"from = "1 ms", to = "0.5 ms", steps = 3"#, &["1 ms", "0.75 ms", "0.5 ms"]),
            (r#"from = "0 ns", to = "1 ns", steps = 4"#, &["0 ns", "4 tick", "8 tick", "1 ns"]),
            ("from = 1, to = 10, step = 3", &["1", "4", "7", "10"]),
            (r#"from = "-50 ppm", to = "50 ppm", step = "50 ppm""#, &["-50 ppm", "0 ppm", "50 ppm"]),
            (r#"from = "0.1 m", to = "30 cm", steps = 3"#, &["0.1 m", "0.2 m", "0.3 m"]),
        ] {
            assert_eq!(values(&range.replace(", ", "\n")), expected, "{range}");
        }
    }

    #[test]
    fn logarithmic_ranges_are_rounded_to_digits_that_are_said() {
        assert_eq!(
            values("from = \"1 us\"\nto = \"1 ms\"\nsteps = 4\nscale = \"log\""),
            ["1 us", "10 us", "100 us", "1 ms"]
        );
        assert_eq!(
            values("from = 1\nto = 10\nsteps = 5\nscale = \"log\"\ndigits = 2"),
            ["1", "1.8", "3.2", "5.6", "10"]
        );
        assert_eq!(values("from = 10\nto = 1\nsteps = 3\nscale = \"log\""), ["10", "3.16", "1"]);
    }

    #[test]
    fn lists_hold_any_value_as_an_override_has_it() {
        let list = "values = [\"1 ms\", 3, true, \"7\", { kind = \"uniform\", half_width = \"1 us\" }, [1, \"a\"]]";
        assert_eq!(
            values(list),
            ["1 ms", "3", "true", "\"7\"", "{ half_width = \"1 us\", kind = \"uniform\" }", "[1, \"a\"]"]
        );
        let axis = definition("keys = [\"a.b\", \"c.d\"]\nvalues = [[\"1 ms\", 2], [\"2 ms\", 4]]").unwrap();
        assert_eq!(axis.axes[0].values, [["1 ms", "2"], ["2 ms", "4"]]);
    }

    #[test]
    fn what_is_no_axis_is_told() {
        let range = |range: &str| wrong(&format!("key = \"a.b\"\n{}", range.replace(", ", "\n")));
        for (told, expected) in [
            (
                range(r#"from = "1 ns", to = "2 ns", steps = 8"#),
                "is not a whole number of ticks of 1/12 ns; its neighbours are \"13 tick\"",
            ),
            (range(r#"from = "0.1 ns", to = "2 ns", steps = 2"#), "\"0.1 ns\" is not a whole number of ticks"),
            (range(r#"from = "1 ns", to = "2 m", steps = 2"#), "\"1 ns\" and \"2 m\" are not of one kind"),
            (range(r#"from = "1 ns", to = "1 ns", steps = 2"#), "this range begins and ends with \"1 ns\""),
            (range(r#"from = "1 ns", to = "2 us", step = "3 ns""#), "steps of \"3 ns\" do not lead from"),
            (range(r#"from = "1 ns", to = "2 us", step = "-1 ns""#), "a step of \"-1 ns\" leads nowhere"),
            (range("from = 0, to = 100000, step = 1"), "100001 values"),
            (range("from = 0, to = 1, steps = 4"), "value 2 of this range, about 0.333"),
            (range(r#"from = 0, to = 1, steps = 4, scale = "log""#), "a logarithmic range is above 0"),
            (range(r#"from = 1, to = 2, steps = 40, scale = "log", digits = 1"#), "1 significant digits make two"),
            (range(r#"from = 1, to = 2, step = 1, scale = "log""#), "a logarithmic range has no step"),
            (range("from = 1, to = 2"), "a range has either step or steps"),
            (range("from = 1, steps = 2"), "a range has from and to"),
            (range("from = 1, to = 2, steps = 2, digits = 2"), "a linear range is exact and has no digits"),
            (range("from = \"x\", to = 2, steps = 2"), "\"x\" is no number with a unit"),
            (range("values = []"), "0 values"),
            (range("values = [1,1]"), "1 is there twice"),
            (range("values = [1,2]\nlabels = [1]"), "1 labels for 2 values"),
            (range("value = [1]"), "there is no such key"),
            (wrong("values = [1]"), "an axis has either key or keys"),
            (wrong("key = \"t_dp\"\nvalues = [1]"), "this is no key of a scenario"),
            (wrong("key = \"run.seed\"\nvalues = [1]"), "seeds are no parameter"),
            (wrong("keys = [\"a.b\"]\nvalues = [[1]]"), "this is no list of several keys"),
            (wrong("keys = [\"a.b\", \"a.c\"]\nvalues = [[1, 2], [3]]"), "1 values for 2 keys"),
            (wrong("keys = [\"a.b\", \"a.c\"]\nfrom = 1\nto = 2\nsteps = 2"), "a range is of one key"),
            (wrong("keys = [\"a.b\", \"a.b\"]\nvalues = [[1, 2]]"), "a.b is set twice"),
        ] {
            assert!(told.iter().any(|told| told.contains(expected)), "{expected}: {told:?}");
        }
    }
}
