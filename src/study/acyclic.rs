//! Acyclic services of a run, counted by the class of the master that asked for them.

use serde::Serialize;

use super::export::decimal::us_or_null;
use crate::observation::{AcyclicResult, MasterClass, Observation};
use crate::time::Span;

/// What became of the acyclic services of both classes, by [`MasterClass`] number.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct AcyclicCounts([ClassCounts; MasterClass::ALL.len()]);

/// What became of the acyclic services of one class.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ClassCounts {
    /// Services by [`AcyclicResult`] number.
    results: [u64; AcyclicResult::ALL.len()],
    /// Of those that were answered, positively or not.
    min: Option<Span>,
    max: Option<Span>,
    /// Sum (ticks); a run is too long for a span of all.
    sum: i128,
}

impl AcyclicCounts {
    /// Counts what any station observed.
    pub(super) fn station(&mut self, what: &Observation) {
        if let Observation::AcyclicDone { class, result, took, .. } = *what {
            self.0[class as usize].add(result, took);
        }
    }
    /// Of masters of this class.
    pub const fn of(&self, class: MasterClass) -> &ClassCounts {
        &self.0[class as usize]
    }
}

impl ClassCounts {
    fn add(&mut self, result: AcyclicResult, took: Span) {
        self.results[result as usize] += 1;
        if matches!(result, AcyclicResult::Positive | AcyclicResult::Negative) {
            self.min = Some(self.min.map_or(took, |min| min.min(took)));
            self.max = Some(self.max.map_or(took, |max| max.max(took)));
            self.sum += i128::from(took.ticks());
        }
    }
    /// Services that ended in this way.
    pub const fn ended(&self, result: AcyclicResult) -> u64 {
        self.results[result as usize]
    }
    /// Services that are over.
    pub fn requests(&self) -> u64 {
        self.results.iter().sum()
    }
    /// Services that were answered, positively or not.
    pub const fn answered(&self) -> u64 {
        self.ended(AcyclicResult::Positive) + self.ended(AcyclicResult::Negative)
    }
    /// Shortest response time.
    pub const fn min(&self) -> Option<Span> {
        self.min
    }
    /// Longest response time.
    pub const fn max(&self) -> Option<Span> {
        self.max
    }
    /// Mean response time, to the tick below.
    pub fn mean(&self) -> Option<Span> {
        let mean = self.sum.checked_div(i128::from(self.answered()))?;
        Some(Span::from_ticks(mean as i64))
    }
}

/// The acyclic services of one class in the summary of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AcyclicSummary {
    /// `class 1` or `class 2`.
    pub class: &'static str,
    /// Services that are over.
    pub requests: u64,
    /// Answered positively.
    pub positive: u64,
    /// Answered negatively.
    pub negative: u64,
    /// Without answer in time.
    pub timeouts: u64,
    /// Their connection was refused, aborted or closed.
    pub connection_lost: u64,
    /// Shortest response time.
    #[serde(rename = "response_min_us", serialize_with = "us_or_null")]
    pub response_min: Option<Span>,
    /// Mean response time.
    #[serde(rename = "response_mean_us", serialize_with = "us_or_null")]
    pub response_mean: Option<Span>,
    /// Longest response time.
    #[serde(rename = "response_max_us", serialize_with = "us_or_null")]
    pub response_max: Option<Span>,
}

impl AcyclicSummary {
    /// Every class that asked for something.
    pub fn all(counts: &AcyclicCounts) -> Vec<Self> {
        let asked = MasterClass::ALL.iter().map(|&class| (class, counts.of(class)));
        asked.filter(|(_, counts)| counts.requests() > 0).map(|(class, counts)| Self::of(class, counts)).collect()
    }
    fn of(class: MasterClass, counts: &ClassCounts) -> Self {
        Self {
            class: class.text(),
            requests: counts.requests(),
            positive: counts.ended(AcyclicResult::Positive),
            negative: counts.ended(AcyclicResult::Negative),
            timeouts: counts.ended(AcyclicResult::Timeout),
            connection_lost: counts.ended(AcyclicResult::Broken),
            response_min: counts.min,
            response_mean: counts.mean(),
            response_max: counts.max,
        }
    }
    /// The line of the report.
    pub fn line(&self) -> String {
        let span = |span: Option<Span>| span.map_or_else(|| "-".to_owned(), |span| span.to_string());
        let others = [
            (self.negative, "negative"),
            (self.timeouts, "without answer in time"),
            (self.connection_lost, "connection lost"),
        ];
        let others = others.into_iter().filter(|(count, _)| *count > 0);
        let others: Vec<_> = others.map(|(count, what)| format!(", {count} {what}")).collect();
        let others = others.concat();
        let [min, mean, max] = [self.response_min, self.response_mean, self.response_max].map(span);
        let Self { class, requests, positive, .. } = self;
        format!(
            "acyclic, {class}: {requests} requests, {positive} answered{others}; response {min} to {max}, mean {mean}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Address;

    #[test]
    fn services_are_counted_by_class_and_timed_where_they_were_answered() {
        let mut counts = AcyclicCounts::default();
        let slave = Address::new(3).unwrap();
        for (class, result, us) in [
            (MasterClass::Two, AcyclicResult::Positive, 300),
            (MasterClass::Two, AcyclicResult::Negative, 100),
            (MasterClass::Two, AcyclicResult::Timeout, 9_000),
            (MasterClass::Two, AcyclicResult::Broken, 8_000),
        ] {
            counts.station(&Observation::AcyclicDone { slave, class, result, took: Span::from_us(us) });
        }
        let all = AcyclicSummary::all(&counts);
        assert_eq!(all.len(), 1, "class 1 asked for nothing");
        let line = "acyclic, class 2: 4 requests, 1 answered, 1 negative, 1 without answer in time, 1 connection lost; \
                    response 100 us to 300 us, mean 200 us";
        assert_eq!(all[0].line(), line);
        let json = serde_json::to_value(&all[0]).unwrap();
        assert_eq!((&json["response_mean_us"], &json["requests"]), (&200.0.into(), &4.into()));
    }
}
