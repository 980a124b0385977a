//! Rider: what is recorded of a future, so that both can be laid side by side.

use crate::study::episode::Episodes;
use crate::study::figure::{Figures, Value};
use crate::study::histogram::Histograms;
use crate::study::metric::Metrics;
use crate::study::plot::futures::Course;
use crate::study::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use crate::study::run::{Speeds, layout};
use crate::study::scenario::Scenario;
use crate::time::Time;

/// Cycles that a picture shows before the futures part.
const LEAD: u64 = 50;

/// Records of a run what comes from some cycle on.
#[derive(Clone, Debug)]
pub(super) struct Since {
    cycle: u64,
    histograms: Histograms,
    episodes: Episodes,
    course: Course,
}

impl Sink for Since {
    fn cycle(&mut self, row: &CycleRow) {
        self.course.cycle(row);
        if row.cycle >= self.cycle {
            self.histograms.cycle(row);
        }
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.course.slave(row);
        // They are of the whole run, as what is counted.
        self.episodes.slave(row);
        if row.cycle >= self.cycle {
            self.histograms.slave(row);
        }
    }
    fn link(&mut self, row: &LinkRow) {
        if row.cycle >= self.cycle {
            self.histograms.link(row);
        }
    }
    fn event(&mut self, row: &EventRow) {
        self.episodes.event(row);
        if row.cycle >= self.cycle {
            self.histograms.event(row);
        }
    }
}

/// Makes rows of a future.
pub(super) type Rider = Metrics<Since, Speeds>;

/// A rider for a run of `scenario` of which the cycles from `cycle` on count.
pub(super) fn rider(scenario: &Scenario, cycle: u64) -> Rider {
    let layout = layout(scenario);
    let clocked = |slave| scenario.slave(slave).is_some_and(|slave| scenario.is_clocked(slave));
    let since = Since {
        cycle,
        histograms: Histograms::new(&layout),
        episodes: Episodes::new(&layout, clocked),
        course: Course::new(cycle.saturating_sub(LEAD)),
    };
    Metrics::new(layout, Speeds::of(scenario), since)
}

/// The figures of a future that is over, and what is drawn of it.
pub(super) fn over(rider: Rider, end: Time) -> (Vec<(String, Option<Value>)>, Course) {
    let (counts, Since { histograms, mut episodes, course, .. }) = rider.finish(end);
    episodes.finish(end);
    let figures = Figures::new(counts, histograms, episodes);
    let named = figures.iter().map(|(figure, value)| (figure.to_string(), value)).collect();
    (named, course)
}
