//! Results as Parquet: what the CSV says, each cell as what it is.
//!
//! A test binary of its own, so that the feature `parquet` does not build all other tests a second time.

use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use isodp::study::sweep::command::{Call, End, join, sweep};
use isodp::study::sweep::shard::Shard;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::schema::types::ColumnDescPtr;
use tempfile::TempDir;

/// Values of every kind: labels, texts, whole numbers, with a unit; runs that fail, and figures that a network lacks.
const SWEEP: &str = r#"repetitions = 2
draws = "independent"
figures = ["latch_skew.p99", "faults", "slave.3.in_operation", "slave.4.lock_time", "slave.max.lock_time"]
[set]
run.duration = "10 s"

[[axis]]
name = "encoders"
key = "slave.#1.addresses"
values = ["3", "3..4"]
labels = [1, 2]

[[axis]]
keys = ["bus.cable", "master.auto_clear"]
values = [["10 m", true], ["0.1 km", false]]

[[axis]]
key = "slave.#1.pll.kp"
values = ["1/4", "0.5"]

[[axis]]
key = "run.max_events"
values = [1, 1000000]
"#;

/// Names and types of the columns.
const SCHEMA: [(&str, &str); 15] = [
    ("encoders", "INT64"),
    ("slave_1_addresses", "BYTE_ARRAY String"),
    ("bus_cable_m", "DOUBLE"),
    ("master_auto_clear", "BOOLEAN"),
    ("slave_1_pll_kp", "BYTE_ARRAY String"),
    ("run_max_events", "INT64"),
    ("repetition", "INT64"),
    ("seed", "INT64 Integer(IntType { bit_width: 64, is_signed: false })"),
    ("status", "BYTE_ARRAY String"),
    ("latch_skew_p99_ns", "DOUBLE"),
    ("faults", "INT64"),
    ("slave_3_in_operation", "BOOLEAN"),
    ("slave_4_lock_time_ms", "DOUBLE"),
    ("slave_max_lock_time_ms", "DOUBLE"),
    ("run", "BYTE_ARRAY String"),
];

/// A directory with [`SWEEP`] of the reference network.
fn room() -> TempDir {
    let room = tempfile::tempdir().expect("a directory");
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/reference.toml");
    let text = format!("base = '{}'\n{SWEEP}", base.display());
    fs::write(room.path().join("kinds.toml"), text).expect("a file");
    room
}

/// Does a part of the sweep, or all of it, to a directory of this name.
fn run(room: &TempDir, out: &str, threads: usize, shard: &str) {
    let shard: Shard = shard.parse().unwrap_or_else(|_| panic!("{shard}"));
    let (file, out) = (room.path().join("kinds.toml"), room.path().join(out));
    let call = Call { file, out, threads, shard, plan: false };
    let answer = sweep(&call, &AtomicBool::new(false), |_| ()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(answer.end, End::Failed, "runs of few events fail: {}", answer.page);
    assert_eq!(answer.page.contains("results.csv, results.parquet, "), shard.is_all(), "{}", answer.page);
}

fn opened(dir: &Path) -> SerializedFileReader<File> {
    let file = File::open(dir.join("results.parquet")).expect("a file");
    SerializedFileReader::new(file).expect("Parquet")
}

/// Whether a cell says what CSV has.
fn is_same(field: &Field, text: &str) -> bool {
    match field {
        Field::Null => text.is_empty(),
        Field::Double(number) => text.parse::<f64>().is_ok_and(|told| told.to_bits() == number.to_bits()),
        Field::Long(number) => text == number.to_string(),
        Field::ULong(number) => text == number.to_string(),
        Field::Bool(truth) => text == truth.to_string(),
        Field::Str(told) => text == told && !text.is_empty(),
        _ => false,
    }
}

#[test]
fn every_cell_is_that_of_the_csv_and_of_its_kind() {
    let room = room();
    run(&room, "out", 2, "1/1");
    let dir = room.path().join("out/kinds");
    let reader = opened(&dir);
    let of = |column: &ColumnDescPtr| {
        let logical = column.logical_type_ref().map_or_else(String::new, |logical| format!(" {logical:?}"));
        (column.name().to_owned(), format!("{}{logical}", column.physical_type()))
    };
    let schema: Vec<_> = reader.metadata().file_metadata().schema_descr().columns().iter().map(of).collect();
    assert_eq!(schema, SCHEMA.map(|(name, kind)| (name.to_owned(), kind.to_owned())));

    let mut csv = csv::Reader::from_path(dir.join("results.csv")).expect("a table");
    let names: Vec<_> = csv.headers().expect("a head").iter().map(str::to_owned).collect();
    assert_eq!(names, SCHEMA.map(|(name, _)| name));
    let (mut rows, mut nulls, mut large) = (reader.get_row_iter(None).expect("rows"), [0; SCHEMA.len()], false);
    for record in csv.records() {
        let (record, row) = (record.expect("a row"), rows.next().expect("as many rows").expect("a row"));
        for (at, ((name, field), text)) in row.get_column_iter().zip(&record).enumerate() {
            assert!(is_same(field, text), "{name}: {field:?} and {text}");
            nulls[at] += u32::from(*field == Field::Null);
            large |= matches!(field, Field::ULong(seed) if *seed > i64::MAX as u64);
        }
    }
    assert!(rows.next().is_none(), "more rows than CSV has");
    assert!(large, "no seed needs the bit of the sign");
    // Of 32 runs 16 fail. One encoder alone has no skew, and where there is no slave 4 that has no lock.
    assert_eq!(nulls, [0, 0, 0, 0, 0, 0, 0, 0, 0, 24, 16, 16, 24, 16, 0]);
}

#[test]
fn the_file_does_not_tell_how_it_came_about() {
    let room = room();
    for (out, threads) in [("one", 1), ("two", 2)] {
        run(&room, out, threads, "1/1");
    }
    let parts = ["1-of-2", "2-of-2"].map(|part| room.path().join(format!("parts/kinds.part-{part}")));
    for (part, dir) in ["1/2", "2/2"].into_iter().zip(&parts) {
        run(&room, "parts", 2, part);
        assert!(!dir.join("results.parquet").exists(), "a part has no table");
    }
    let [first, second] = parts;
    join(&room.path().join("merged"), &[second, first]).unwrap_or_else(|error| panic!("{error}"));
    let octets = |dir: &str| fs::read(room.path().join(dir).join("results.parquet")).expect("a file");
    assert_eq!(octets("one/kinds"), octets("two/kinds"));
    assert_eq!(octets("one/kinds"), octets("merged"));
}
