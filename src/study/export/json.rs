//! JSON: the summary of a run for other programs. Keys come in a fixed order and name their units.

use std::io::{BufWriter, Write};

use super::staged::{ExportError, Staged};
use super::{Export, Exporter, Target};
use crate::study::histogram::Histograms;
use crate::study::row::Sink;
use crate::study::summary::Summary;

/// The summary for other programs.
pub const EXPORTER: Exporter =
    Exporter { name: "json", what: "the summary for other programs", files: names, every, open };

const SUMMARY: &str = "summary.json";

struct Json(Staged);

fn names(_: &Target<'_>) -> Vec<String> {
    every()
}
fn every() -> Vec<String> {
    vec![SUMMARY.to_owned()]
}

fn open(target: &Target<'_>) -> Result<Box<dyn Export>, ExportError> {
    Ok(Box::new(Json(Staged::create(target.dir, SUMMARY)?)))
}

impl Sink for Json {}

impl Export for Json {
    fn close(self: Box<Self>, _: &Histograms, summary: &mut Summary) -> Result<Vec<Staged>, ExportError> {
        let mut file = self.0;
        let mut writer = BufWriter::new(&mut file);
        let written = serde_json::to_writer_pretty(&mut writer, summary)
            .map_err(std::io::Error::from)
            .and_then(|()| writer.write_all(b"\n"))
            .and_then(|()| writer.flush());
        drop(writer);
        match written {
            Ok(()) => Ok(vec![file]),
            Err(source) => Err(file.error(source)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;
    use crate::study::scenario::CsvTable;
    use serde_json::Value;

    fn written() -> String {
        let (dir, layout) = (tempfile::tempdir().unwrap(), sample::layout());
        let json =
            open(&Target { dir: dir.path(), layout: &layout, cycles: 3, rows: 10, tables: CsvTable::EVERY }).unwrap();
        Staged::place_all(json.close(&Histograms::new(&layout), &mut sample::run()).unwrap()).unwrap();
        std::fs::read_to_string(dir.path().join(SUMMARY)).unwrap()
    }

    #[test]
    fn a_foreign_reader_finds_numbers_with_their_units() {
        let json: Value = serde_json::from_str(&written()).unwrap();
        for (pointer, value) in [
            ("/network/duration_s", Value::from(10.0)),
            ("/network/bit_rate", "12 Mbit/s".into()),
            ("/timing/t_dx_max_us", 449.0.into()),
            ("/timing/left_after_t_dx_us", 551.0.into()),
            ("/counts/skew_max_steps", 0.25.into()),
            ("/distributions/gc_jitter/min_ns", (-0.083).into()),
            ("/distributions/latch_skew/p99.9_ns", 90.0.into()),
            ("/slaves/1/faults/0F04", 1.into()),
            ("/slaves/1/lock_ms", 20.0.into()),
            ("/slaves/0/lock_ms", Value::Null),
            ("/slaves/0/phases_ms/1 configuration", 10_000.0.into()),
            ("/slaves/1/distributions/pll_error/farthest_ns", (-42.0).into()),
            ("/links/0/distributions/publish/mean_ns", 400_000.0.into()),
            ("/fingerprint/wire", "0123456789abcdef".into()),
            ("/thinning/0/stride_cycles", 1.into()),
            ("/files/1", SUMMARY.into()),
        ] {
            assert_eq!(json.pointer(pointer), Some(&value), "{pointer}");
        }
    }

    #[test]
    fn keys_keep_their_order_and_equal_runs_equal_bytes() {
        let text = written();
        let keys =
            ["network", "timing", "counts", "distributions", "slaves", "links", "fingerprint", "thinning", "files"];
        let places: Vec<_> = keys.iter().map(|key| text.find(&format!("\n  \"{key}\": ")).expect(key)).collect();
        assert!(places.is_sorted(), "{places:?}");
        assert_eq!(text, written());
        assert!(text.ends_with("}\n"));
    }
}
