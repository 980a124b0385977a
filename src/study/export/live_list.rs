//! Live list: all stations with their counters, as text for people. The page shows only those with something to look at.

use std::io::Write;

use super::staged::{ExportError, Staged};
use super::{Export, Exporter, Target};
use crate::study::histogram::Histograms;
use crate::study::report;
use crate::study::row::Sink;
use crate::study::summary::Summary;

/// The live list for people.
pub const EXPORTER: Exporter =
    Exporter { name: "live_list", what: "all stations with the counters of a bus analyser", files: names, every, open };

const LIVE_LIST: &str = "live-list.txt";

struct LiveList(Staged);

fn names(_: &Target<'_>) -> Vec<String> {
    every()
}
fn every() -> Vec<String> {
    vec![LIVE_LIST.to_owned()]
}

fn open(target: &Target<'_>) -> Result<Box<dyn Export>, ExportError> {
    Ok(Box::new(LiveList(Staged::create(target.dir, LIVE_LIST)?)))
}

impl Sink for LiveList {}

impl Export for LiveList {
    fn close(self: Box<Self>, _: &Histograms, summary: &mut Summary) -> Result<Vec<Staged>, ExportError> {
        let mut file = self.0;
        match file.write_all(report::live_list_of_all(summary).as_bytes()) {
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

    #[test]
    fn every_station_has_a_line() {
        let (dir, layout) = (tempfile::tempdir().unwrap(), sample::layout());
        let target = Target { dir: dir.path(), layout: &layout, cycles: 3, rows: 10, tables: CsvTable::EVERY };
        let list = open(&target).unwrap().close(&Histograms::new(&layout), &mut sample::run()).unwrap();
        Staged::place_all(list).unwrap();
        let expected = "\
station  worst state  lost  syncs  repeats  most in a cycle  illegal  diagnoses
      1  master          0      0        0                0        0          0
      3  missing         0      0        0                0        0          0
      5  lost            1      2        2                2        0          2
";
        assert_eq!(std::fs::read_to_string(dir.path().join(LIVE_LIST)).unwrap(), expected);
    }
}
