//! Every file of a run, read by a reader that someone else wrote, and compared with the summary.

use std::collections::BTreeMap;
use std::fs;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::Deserializer;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use serde_json::Value;

use crate::cli::{Room, SCENE};

/// Quantities: the table and the column that have their values, and what one of the column is in nanoseconds.
const QUANTITIES: &[(&str, &str, &str, f64)] = &[
    ("latch_skew", "cycles.csv", "latch_skew_ns", 1.0),
    ("gc_jitter", "cycles.csv", "gc_jitter_ns", 1.0),
    ("t_dp_deviation", "cycles.csv", "t_dp_deviation_ns", 1.0),
    ("t_dx", "cycles.csv", "t_dx_us", 1e3),
    ("spare", "cycles.csv", "spare_us", 1e3),
    ("latch_offset", "slaves.csv", "latch_offset_ns", 1.0),
    ("pll_error", "slaves.csv", "pll_error_ns", 1.0),
    ("wire", "links.csv", "wire_ns", 1.0),
    ("publish", "links.csv", "publish_ns", 1.0),
    ("age", "links.csv", "age_ns", 1.0),
];

/// What a disturbed run left.
struct Left {
    room: Room,
    summary: Value,
}

/// A table by its columns.
struct Table {
    columns: BTreeMap<String, Vec<String>>,
    rows: usize,
}

impl Left {
    /// A run in which clocks and telegrams are lost, so that no table and no count is empty.
    fn new() -> Self {
        let room = Room::new();
        let disturbed = "[[disturbance]]\nkind = \"missing-clocks\"\ncycle = 150\nfor = 2\n\
                         [[disturbance]]\nkind = \"lost-telegrams\"\nto = 4\ncycle = 160\nfor = 3\n";
        room.write("scene.toml", SCENE.replace("\"150 ms\"", "\"600 ms\"") + disturbed);
        room.runs(&["run", "scene.toml"]);
        let text = fs::read_to_string(room.path("out/scene/summary.json")).expect("a summary");
        Self { summary: serde_json::from_str(&text).expect("JSON"), room }
    }
    fn text(&self, file: &str) -> String {
        fs::read_to_string(self.room.path("out/scene").join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
    }
    fn table(&self, file: &str) -> Table {
        let text = self.text(file);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let names: Vec<_> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
        let mut table = Table { columns: names.iter().map(|name| (name.clone(), Vec::new())).collect(), rows: 0 };
        for row in reader.records() {
            let row = row.expect("a row as long as the header");
            table.rows += 1;
            for (name, cell) in names.iter().zip(row.iter()) {
                table.columns.get_mut(name).expect("a column").push(cell.to_owned());
            }
        }
        table
    }
    fn number(&self, pointer: &str) -> f64 {
        self.summary.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"))
    }
    /// Distributions of one quantity: the tag of the subject, and the numbers.
    fn distributions<'s>(&'s self, quantity: &str) -> Vec<(String, &'s Value)> {
        let network = [("network".to_owned(), &self.summary)];
        let slave = |slave: &'s Value| (format!("slave-{}", slave["address"]), slave);
        let slaves = self.summary["slaves"].as_array().expect("slaves").iter();
        let link = |link: &'s Value| (format!("link-{}-{}", link["publisher"], link["subscriber"]), link);
        let links = self.summary["links"].as_array().expect("links").iter();
        let all = network.into_iter().chain(slaves.map(slave)).chain(links.map(link));
        all.filter_map(|(tag, of)| Some((tag, of["distributions"].get(quantity)?))).collect()
    }
}

impl Table {
    fn column(&self, name: &str) -> &[String] {
        self.columns.get(name).unwrap_or_else(|| panic!("no column {name}"))
    }
    /// The numbers of a column where `tag` is whom the row is about; empty cells are none.
    fn values(&self, name: &str, tag: &str) -> Vec<f64> {
        let about = |row: usize| {
            let cell = |column: &str| self.columns.get(column).map(|cells| cells[row].as_str());
            match (cell("slave"), cell("publisher"), cell("subscriber")) {
                (Some(slave), ..) => format!("slave-{slave}"),
                (_, Some(publisher), Some(subscriber)) => format!("link-{publisher}-{subscriber}"),
                _ => "network".to_owned(),
            }
        };
        let cells = self.column(name).iter().enumerate().filter(|&(row, cell)| !cell.is_empty() && about(row) == tag);
        cells.map(|(_, cell)| cell.parse().unwrap_or_else(|_| panic!("{name}: {cell}"))).collect()
    }
}

/// Whether this is a hexadecimal word, `0x1000`.
fn is_word(cell: &str) -> bool {
    cell.strip_prefix("0x").is_some_and(|word| u16::from_str_radix(word, 16).is_ok())
}

fn near(one: f64, other: f64, what: &str) {
    assert!((one - other).abs() <= 0.002 + other.abs() * 1e-9, "{what}: {one} and {other}");
}

#[test]
fn tables_have_a_row_per_cycle_and_numbers_in_their_cells() {
    let left = Left::new();
    let cycles = left.number("/network/cycles") as usize;
    let [slaves, links, events] = ["slaves.csv", "links.csv", "events.csv"].map(|file| left.table(file));
    assert_eq!(left.table("cycles.csv").rows, cycles);
    assert_eq!(slaves.rows, cycles * left.number("/network/slaves") as usize);
    assert_eq!(links.rows, left.number("/links/0/distributions/wire/count") as usize);
    assert_eq!(events.rows, left.number("/counts/events") as usize);
    for file in ["cycles.csv", "slaves.csv", "links.csv", "events.csv"] {
        let table = left.table(file);
        for (name, cells) in &table.columns {
            let cells = cells.iter().filter(|cell| !cell.is_empty());
            match name.as_str() {
                "state" | "phase" | "pll" | "leds" | "event" => {
                    assert!(cells.clone().all(|cell| cell.parse::<f64>().is_err()));
                }
                "g1_zsw" => assert!(cells.clone().all(|cell| is_word(cell)), "{file}: {name}"),
                _ => assert!(cells.clone().all(|cell| cell.parse::<f64>().is_ok()), "{file}: {name}"),
            }
            assert!(cells.count() > 0, "{file}: {name} is empty");
        }
    }
}

#[test]
fn tables_and_counts_agree() {
    let left = Left::new();
    let cycles = left.table("cycles.csv");
    let numbers: Vec<u64> = cycles.column("cycle").iter().map(|cell| cell.parse().expect("a number")).collect();
    assert!(numbers.iter().copied().eq(0..numbers.len() as u64));
    near(cycles.values("retries", "network").iter().sum(), left.number("/counts/retries"), "retries");
    let events = left.table("events.csv");
    let told = |text: &str| events.column("event").iter().filter(|event| event.contains(text)).count() as f64;
    near(told("disturbed"), left.number("/counts/disturbed"), "disturbed telegrams");
    near(told("clock missing") + told("clock outside"), sum(&left, "clock_failures"), "clock failures");
    assert!(told("clock missing") > 0.0 && left.number("/counts/retries") > 0.0, "the run is disturbed");
    let slaves = left.table("slaves.csv");
    for slave in left.summary["slaves"].as_array().expect("slaves") {
        let address = slave["address"].to_string();
        let mine = |row: &usize| slaves.column("slave")[*row] == address;
        let last = (0..slaves.rows).rfind(mine).expect("a row");
        for name in ["state", "phase", "pll"] {
            assert_eq!(Some(slaves.column(name)[last].as_str()), slave[name].as_str());
        }
    }
}

fn sum(left: &Left, key: &str) -> f64 {
    left.summary["slaves"].as_array().expect("slaves").iter().map(|slave| slave[key].as_f64().expect("a count")).sum()
}

#[test]
fn tables_and_distributions_agree() {
    let left = Left::new();
    for &(quantity, file, column, ns) in QUANTITIES {
        let table = left.table(file);
        let distributions = left.distributions(quantity);
        assert!(!distributions.is_empty(), "{quantity}");
        for (tag, distribution) in distributions {
            let values: Vec<_> = table.values(column, &tag).iter().map(|value| value * ns).collect();
            assert_eq!(distribution["count"].as_u64(), Some(values.len() as u64), "{quantity} of {tag}");
            let Some(mean) = distribution["mean_ns"].as_f64() else { continue };
            let number = |key: &str| distribution[key].as_f64().expect("a number");
            let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)));
            near(low, number("min_ns"), &format!("least {quantity} of {tag}"));
            near(high, number("max_ns"), &format!("largest {quantity} of {tag}"));
            let average = values.iter().sum::<f64>() / values.len() as f64;
            assert!((average - mean).abs() < 0.05, "mean {quantity} of {tag}: {average} and {mean}");
            assert!(number("p50_ns") <= number("p90_ns") && number("p90_ns") <= number("p99.9_ns"), "{quantity}");
        }
    }
}

#[test]
fn histogram_logs_keep_every_value_and_its_sign() {
    let left = Left::new();
    let logs = left.summary["files"].as_array().expect("files").iter().filter_map(Value::as_str);
    let logs: Vec<_> = logs.filter_map(|name| name.strip_suffix(".hlog")).collect();
    assert_eq!(logs.len(), QUANTITIES.len());
    let mut negative = 0;
    for quantity in logs {
        let text = left.text(&format!("{quantity}.hlog"));
        let read: BTreeMap<String, Histogram<u64>> = IntervalLogIterator::new(text.as_bytes())
            .map(|entry| {
                let Ok(LogEntry::Interval(interval)) = entry else { panic!("{quantity}: {entry:?}") };
                let octets = STANDARD.decode(interval.encoded_histogram()).expect("base 64");
                let histogram = Deserializer::new().deserialize(&mut &octets[..]).expect("a histogram");
                (interval.tag().expect("a tag").as_str().to_owned(), histogram)
            })
            .collect();
        for (tag, distribution) in left.distributions(quantity) {
            let side = |name: String| read.get(&name);
            let positive = side(tag.clone()).or_else(|| side(format!("{tag}.pos"))).expect("values from zero up");
            let below = side(format!("{tag}.neg"));
            let count = positive.len() + below.map_or(0, Histogram::len);
            let out_of_range = distribution["out_of_range"].as_u64().expect("a count");
            assert_eq!(Some(count + out_of_range), distribution["count"].as_u64(), "{quantity} of {tag}");
            // Ticks of 1/12 ns, three significant digits.
            let same = |ticks: u64, ns: f64| (ticks as f64 / 12.0 - ns).abs() <= 0.1 + ns * 1e-3;
            let end = |key: &str| distribution[key].as_f64().unwrap_or(0.0);
            if end("max_ns") > 0.0 {
                assert!(same(positive.max(), end("max_ns")), "{quantity} of {tag}");
            }
            if end("min_ns") < 0.0 {
                let below = below.expect("a side below zero");
                assert!(same(below.max(), -end("min_ns")), "{quantity} of {tag}");
                negative += below.len();
            }
        }
    }
    assert!(negative > 0, "some errors are negative");
}

/// Calls `see` with every key and its value.
fn walk(value: &Value, see: &mut impl FnMut(&str, &Value)) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| {
            see(key, value);
            walk(value, see);
        }),
        Value::Array(list) => list.iter().for_each(|value| walk(value, see)),
        _ => {}
    }
}

#[test]
fn the_summary_names_units_and_keeps_the_order_of_its_keys() {
    let left = Left::new();
    walk(&left.summary, &mut |key, value| {
        let has_unit = ["_ns", "_us", "_ms", "_s", "_steps", "_cycles"].iter().any(|unit| key.ends_with(unit));
        // Times of phases are in a map whose own name has the unit.
        let fraction = value.is_f64() && !key.starts_with(|c: char| c.is_ascii_digit());
        assert!(!fraction || has_unit, "{key}: {value} has no unit");
    });
    let keys = |text: &str| -> Vec<String> {
        let key = |line: &str| Some(line.trim().strip_prefix('"')?.split_once("\": ")?.0.to_owned());
        text.lines().filter_map(key).collect()
    };
    let first = left.text("summary.json");
    left.room.runs(&["run", "scene.toml", "--seed", "77"]);
    let second = left.text("summary.json");
    assert_ne!(first, second);
    assert_eq!(keys(&first), keys(&second));
}

#[test]
fn pictures_are_well_formed_and_say_what_they_show() {
    let room = Room::new();
    // A name with everything that markup has to escape.
    let name = "R&D <1> \"x\" 'y'";
    room.write(&format!("{name}.toml"), SCENE);
    room.runs(&["run", &format!("{name}.toml")]);
    let mut count = 0;
    for entry in fs::read_dir(room.path("out").join(name)).expect("results") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "svg") {
            continue;
        }
        count += 1;
        let picture = fs::read_to_string(&path).expect("a picture");
        let document =
            roxmltree::Document::parse(&picture).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let svg = document.root_element();
        assert_eq!(svg.tag_name().name(), "svg");
        let size = |key: &str| svg.attribute(key).and_then(|size| size.parse::<f64>().ok()).expect("a size");
        assert!(size("width") > 100.0 && size("height") > 100.0);
        let texts =
            document.descendants().filter(|node| node.has_tag_name((svg.tag_name().namespace().unwrap_or(""), "text")));
        let lines: Vec<String> = texts.map(|node| node.text().unwrap_or_default().trim().to_owned()).collect();
        assert!(lines.iter().any(|line| line.contains(name)), "{}: {lines:?}", path.display());
        assert!(!picture.contains("NaN"), "{}", path.display());
    }
    assert_eq!(count, 8);
}
