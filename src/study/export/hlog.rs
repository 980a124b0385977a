//! Histogram logs: every distribution of a run in the interval log of HdrHistogram, version 2, one file per quantity.
//!
//! HdrHistogram's own tools and plotters read them. Values are whole ticks of 1/12 ns, the maximum column is in ns. A
//! log has one interval, the run, per subject; its tag is `network`, `slave-5` or `link-3-7`. HdrHistogram knows no
//! values below zero, so a signed quantity has two intervals per subject: `slave-5.pos` with the values from zero up
//! and `slave-5.neg` with the magnitudes of those below. Values beyond the bounds are in a comment.

use std::io::{self, BufWriter};
use std::time::Duration;

use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{
    IntervalLogWriter, IntervalLogWriterBuilder, IntervalLogWriterError, Tag,
};

use super::staged::{ExportError, Staged};
use super::{Export, Exporter, Target};
use crate::study::histogram::{Histogram, Histograms, QUANTITIES, Quantity, Subject};
use crate::study::layout::Layout;
use crate::study::row::Sink;
use crate::study::summary::Summary;
use crate::time::Span;

/// Distributions for HdrHistogram's tools.
pub const EXPORTER: Exporter =
    Exporter { name: "hlog", what: "distributions in the interval log of HdrHistogram", files: names, every, open };

type Log<'a> = IntervalLogWriter<'a, 'a, BufWriter<Staged>, V2DeflateSerializer>;

/// One log per quantity that anyone has.
struct Logs(Vec<(&'static Quantity, Staged)>);

fn quantities(layout: &Layout) -> impl Iterator<Item = &'static Quantity> {
    QUANTITIES.iter().filter(|quantity| !quantity.subjects(layout).is_empty())
}

fn name(quantity: &Quantity) -> String {
    format!("{}.hlog", quantity.name)
}

fn names(target: &Target<'_>) -> Vec<String> {
    quantities(target.layout).map(name).collect()
}

fn every() -> Vec<String> {
    QUANTITIES.iter().map(name).collect()
}

fn open(target: &Target<'_>) -> Result<Box<dyn Export>, ExportError> {
    let log = |quantity| Ok((quantity, Staged::create(target.dir, &name(quantity))?));
    Ok(Box::new(Logs(quantities(target.layout).map(log).collect::<Result<_, ExportError>>()?)))
}

impl Sink for Logs {}

impl Export for Logs {
    fn close(self: Box<Self>, histograms: &Histograms, summary: &mut Summary) -> Result<Vec<Staged>, ExportError> {
        let duration = Duration::from_nanos(summary.network.duration.as_ns().max(0.0) as u64);
        let mut files = Vec::new();
        for (quantity, file) in self.0 {
            let mut writer = BufWriter::new(file);
            let written = write(&mut writer, quantity, histograms, duration);
            match (written, writer.into_inner()) {
                (Ok(()), Ok(file)) => files.push(file),
                (Err(source), Ok(file)) => return Err(file.error(source)),
                (_, Err(error)) => {
                    let (source, writer) = error.into_parts();
                    return Err(writer.get_ref().error(source));
                }
            }
        }
        Ok(files)
    }
}

/// Writes the log of one quantity.
fn write(file: &mut BufWriter<Staged>, of: &Quantity, histograms: &Histograms, duration: Duration) -> io::Result<()> {
    let mut serializer = V2DeflateSerializer::new();
    let mut log = IntervalLogWriterBuilder::new()
        .add_comment(&format!("{}, isodp {}; values in ticks of 1/12 ns", of.title, env!("CARGO_PKG_VERSION")))
        .add_comment("Tags: network, slave-<address>, link-<publisher>-<subscriber>")
        .add_comment("Signed quantities: .pos has the values from zero up, .neg the magnitudes of those below")
        .with_max_value_divisor(Span::TICKS_PER_NS as f64)
        .begin_log_with(file, &mut serializer)?;
    for (_, subject, histogram) in histograms.iter().filter(|(quantity, ..)| quantity.name == of.name) {
        write_subject(&mut log, subject, histogram, duration)?;
    }
    Ok(())
}

/// Writes the one or two intervals of one subject.
fn write_subject(log: &mut Log<'_>, subject: Subject, histogram: &Histogram, duration: Duration) -> io::Result<()> {
    if histogram.below() + histogram.above() > 0 {
        log.write_comment(&format!(
            "{subject}: {} below and {} above the range",
            histogram.below(),
            histogram.above()
        ))?;
    }
    let mut interval = |tag: &str, values| {
        let tag = Tag::new(tag).expect("a tag has neither comma nor blank");
        log.write_histogram(values, Duration::ZERO, duration, Some(tag)).map_err(|error| match error {
            IntervalLogWriterError::IoError(error) => error,
            IntervalLogWriterError::SerializeError(error) => io::Error::other(error),
        })
    };
    match histogram.negative() {
        None => interval(&subject.to_string(), histogram.positive()),
        Some(negative) => {
            interval(&format!("{subject}.neg"), negative)?;
            interval(&format!("{subject}.pos"), histogram.positive())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;
    use crate::study::scenario::CsvTable;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
    use std::collections::BTreeMap;

    /// The octets behind base64 text (RFC 4648).
    fn base64(text: &str) -> Vec<u8> {
        const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut octets = Vec::new();
        let (mut bits, mut have) = (0u32, 0);
        for letter in text.bytes().filter(|&letter| letter != b'=') {
            bits = bits << 6 | DIGITS.iter().position(|&digit| digit == letter).unwrap() as u32;
            have += 6;
            if have >= 8 {
                have -= 8;
                octets.push((bits >> have) as u8);
            }
        }
        octets
    }

    /// Writes `histograms` and reads the log of `quantity` back, by tag.
    fn read_back(histograms: &Histograms, quantity: &str) -> (BTreeMap<String, hdrhistogram::Histogram<u64>>, String) {
        let dir = tempfile::tempdir().unwrap();
        let logs =
            open(&Target { dir: dir.path(), layout: histograms.layout(), cycles: 1, rows: 1, tables: CsvTable::EVERY })
                .unwrap();
        Staged::place_all(logs.close(histograms, &mut sample::summary()).unwrap()).unwrap();
        let text = std::fs::read_to_string(dir.path().join(format!("{quantity}.hlog"))).unwrap();
        let mut read = BTreeMap::new();
        for entry in IntervalLogIterator::new(text.as_bytes()) {
            let LogEntry::Interval(interval) = entry.unwrap() else { panic!("only intervals are written") };
            assert_eq!((interval.start_timestamp(), interval.duration()), (Duration::ZERO, Duration::from_secs(10)));
            let octets = base64(interval.encoded_histogram());
            let histogram = Deserializer::new().deserialize(&mut &octets[..]).unwrap();
            read.insert(interval.tag().unwrap().as_str().to_owned(), histogram);
        }
        (read, text)
    }

    #[test]
    fn a_foreign_reader_finds_every_value_with_its_sign() {
        let mut histograms = Histograms::new(&sample::layout());
        for error in [-900_000, -5, -5, 0, 7, 600_000_000] {
            histograms.slave(&crate::study::row::SlaveRow {
                pll_error: Some(Span::from_ticks(error)),
                ..sample::slave(1, 5)
            });
        }
        let (read, text) = read_back(&histograms, "pll_error");
        assert_eq!(read.keys().collect::<Vec<_>>(), ["slave-3.neg", "slave-3.pos", "slave-5.neg", "slave-5.pos"]);
        let (negative, positive) = (&read["slave-5.neg"], &read["slave-5.pos"]);
        assert_eq!((negative.len(), negative.count_at(5), negative.count_at(900_000)), (3, 2, 1));
        assert_eq!((positive.len(), positive.count_at(0), positive.count_at(7)), (2, 1, 1));
        assert!(read["slave-3.pos"].is_empty());
        assert!(text.contains("\n#slave-5: 0 below and 1 above the range\n"), "{text}");
    }

    #[test]
    fn unsigned_quantities_have_one_interval_and_equal_runs_equal_bytes() {
        let mut histograms = Histograms::new(&sample::layout());
        (0..1_000).for_each(|cycle| histograms.link(&sample::link(cycle)));
        let (read, text) = read_back(&histograms, "publish");
        assert_eq!(read.len(), 1);
        assert_eq!(read["link-3-5"].count_at(Span::from_us(400).ticks() as u64), 1_000);
        assert_eq!(text, read_back(&histograms, "publish").1);
    }

    #[test]
    fn a_network_without_links_has_no_logs_of_them() {
        let mut layout = sample::layout();
        layout = Layout::new(layout.master, layout.t_dp, layout.slaves().to_vec(), vec![]);
        let named = |layout: &Layout| {
            names(&Target { dir: std::path::Path::new(""), layout, cycles: 1, rows: 1, tables: CsvTable::EVERY })
        };
        assert!(named(&layout).iter().all(|name| name != "wire.hlog"));
        assert!(named(&sample::layout()).contains(&"wire.hlog".to_owned()));
    }
}
