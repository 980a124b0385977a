//! Progress: a line on standard error while runs go on.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use isodp::study::run::Progress;
use isodp::study::scenario::{Extent, Scenario};
use isodp::study::sweep::command::Progress as SweepProgress;
use isodp::study::tolerance::trial::Progress as ToleranceProgress;
use isodp::time::Span;

/// The progress bar; nothing where standard error is no terminal.
pub(crate) struct Bar {
    pub(crate) line: ProgressBar,
    pub(crate) end: Option<Span>,
    pub(crate) cycles: Option<u64>,
    pub(crate) started: Instant,
}

impl Bar {
    /// Positions are thousandths of the run.
    const LENGTH: u64 = 1_000;

    pub(crate) fn new(scenario: &Scenario) -> Self {
        let (end, cycles) = match scenario.run.duration {
            Extent::Time(span) => (Some(span), None),
            Extent::Cycles(cycles) => (None, Some(cycles)),
        };
        let target = ProgressDrawTarget::stderr();
        let bar = ProgressBar::with_draw_target(Some(Self::LENGTH), target);
        let style = ProgressStyle::with_template("{prefix} [{bar:30}] {percent:>3} %  {msg}  {eta} left");
        bar.set_style(style.expect("a template that is right").progress_chars("=> "));
        bar.set_prefix(scenario.name.clone());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { line: bar, end, cycles, started: Instant::now() }
    }

    pub(crate) fn show(&self, at: Progress) {
        let share = match (self.end, self.cycles) {
            (Some(end), _) => at.simulated.as_s() / end.as_s(),
            (_, Some(cycles)) => at.cycles as f64 / cycles.max(1) as f64,
            _ => 1.0,
        };
        self.line.set_position((share * Self::LENGTH as f64) as u64);
        let speed = at.simulated.as_s() / self.started.elapsed().as_secs_f64().max(1e-9);
        self.line.set_message(format!(
            "{:.1} s simulated, cycle {}, {speed:.0} x real time",
            at.simulated.as_s(),
            at.cycles
        ));
    }
}

/// The progress bar of many runs.
pub(crate) struct SweepBar(pub(crate) ProgressBar);

impl SweepBar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("[{bar:30}] {pos} of {len} runs{msg}  {per_sec}  {eta} left");
        bar.set_style(style.expect("a template that is right").progress_chars("=> "));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    pub(crate) fn show(&self, at: SweepProgress) {
        self.0.set_length(at.runs as u64);
        self.0.set_position(at.done as u64);
        if at.failed > 0 {
            self.0.set_message(format!(", {} failed", at.failed));
        }
    }
}

/// The progress line of a search, whose end nobody knows.
pub(crate) struct ToleranceBar(pub(crate) ProgressBar);

impl ToleranceBar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{spinner} {msg}  {elapsed}");
        bar.set_style(style.expect("a template that is right"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    pub(crate) fn show(&self, at: &ToleranceProgress) {
        let ToleranceProgress { value, values, runs, failures } = at;
        self.0.set_message(format!("{values} values done, {value}: {runs} runs, {failures} failed"));
    }
}
