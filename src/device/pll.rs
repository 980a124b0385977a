//! Clock recovery: a second-order loop that follows the SYNCH `Global_Control` (manual 2.1.2, 3.3.8, 3.3.9).
//!
//! The loop predicts the instant E of the next SYNCH and the period P. A SYNCH captured at `a` has the error e = a − E.
//! Within the window w it is a hit: E += Kp·e + P, P += Ki·e. Otherwise, or if nothing came until E + w, it is a clock
//! failure and the loop runs on by itself: E += P. Model: D11.
//!
//! | state | `start` | `synch` | `window_closed` | `stop` |
//! |---|---|---|---|---|
//! | Idle | Waiting (2.1.2) | nothing | nothing | Idle |
//! | Waiting | Waiting | first: E = a + `T_DP`, P = `T_DP`; Narrowing (D11) | nothing | Idle |
//! | Narrowing | same | hit: same; the run of hits full: window halved, at the final width Settling (D12) | failure | Idle |
//! | Settling | same | hit: same; the run of hits full: Locked (D12) | failure | Idle |
//! | Locked | same | hit: failure counter −1 (D15) | failure | Idle |
//!
//! A failure (`window_closed` in time, or a `synch` outside the window) leads from Narrowing and Settling back to Waiting
//! at the third in a row (D12) and from Locked back to Waiting, with fault 0F04, when the counter, +10 per failure, is
//! above ten times the tolerance (manual 2.1.2, 5.3; D15). Otherwise the state stays.
//!
//! Model: exactly one failure per cycle. The SYNCH belongs to the prediction that is nearer: before E − P/2 it belongs
//! to a cycle already judged (a late one after its window was closed, a second one, the true one after a false early
//! one) and is `Stray`, counted nowhere.
//!
//! Model: a run of hits counts towards a narrower window only while each of them would have fitted that window too. A
//! frequency offset swings the error to 2.6 times its per-cycle value about six cycles after the first SYNCH; halving
//! regardless would throw such a clock out in every attempt, for ever.

use crate::observation::{ClockVerdict, PllState};
use crate::time::{Local, Span};

/// Fraction bits of the loop's own arithmetic: E, P and the gains are counted in 1/65 536, so that the integral gain
/// has no dead zone.
const FRACTION_BITS: u32 = 16;
/// One tick, or a gain of one, in the loop's fixed point.
const ONE: i128 = 1 << FRACTION_BITS;
/// Failure counter: what one clock failure adds (Model: D15).
const FAILURE_WEIGHT: u16 = 10;

/// Settings of the clock recovery. Everything but the three isochronous parameters is an option with a default.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PllSettings {
    /// `T_DP`, cycle time as parameterised; 500 µs ..= 32 ms for the encoder. Manual 3.3.2, octets 41-42.
    pub t_dp: Span,
    /// `T_PLL_W`, half width of the clock window, 1..=65535 units of 1/12 µs. Manual 3.3.8, octets 56-57.
    pub t_pll_w: Span,
    /// `T_PLL_D`, delay of the recovered edge, 0..=65535 units of 1/12 µs. Manual 3.3.9, octets 58-59; Model: D13.
    pub t_pll_d: Span,
    /// n1, multiple of `t_pll_w` in the first window. Model: D11, default 4.
    pub first_window_factor: u16,
    /// n2, share of `t_dp` in the first window [ppm]. Model: D11, default 300.
    pub first_window_ppm: u32,
    /// Kp, proportional gain [1/65536], 0..=65536. Model: D11, default 1/4.
    pub kp: u32,
    /// Ki, integral gain [1/65536], 0..=65536. Model: D11, default 1/32.
    pub ki: u32,
    /// Hits in a row that halve the window. Model: D12, default 4.
    pub hits_per_step: u8,
    /// Further hits in a row at the final width until locked. Model: D12, default 4.
    pub hits_to_lock: u8,
    /// Failures in a row that start over before lock. Model: D12, default 3.
    pub failures_to_restart: u8,
    /// Clock failures accepted without history after lock. Model: D15, default 1.
    pub tolerance: u8,
    /// Grid of capture and timers. Model: D14, default 1/48 µs = 250 ticks.
    pub quantum: Span,
    /// Least half width of the window. Manual 3.3.8, 1 µs.
    pub min_window: Span,
}

impl PllSettings {
    /// Settings for the three isochronous parameters, every option at its default.
    pub const fn new(t_dp: Span, t_pll_w: Span, t_pll_d: Span) -> Self {
        Self {
            t_dp,
            t_pll_w,
            t_pll_d,
            first_window_factor: 4,
            first_window_ppm: 300,
            kp: 1 << (FRACTION_BITS - 2),
            ki: 1 << (FRACTION_BITS - 5),
            hits_per_step: 4,
            hits_to_lock: 4,
            failures_to_restart: 3,
            tolerance: 1,
            quantum: Span::from_ticks(250),
            min_window: Span::from_us(1),
        }
    }

    /// Half width of the window once locked: `t_pll_w`, not below `min_window` (manual 3.3.8).
    ///
    /// Model: no window is wider than `T_DP`/4, so that it never reaches the neighbouring clock.
    pub fn final_window(&self) -> Span {
        self.t_pll_w.max(self.min_window).min(self.widest())
    }
    /// Half width of the window after the first SYNCH: n1·`T_PLL_W` + n2·`T_DP` (Model: D11), not below the final one.
    pub fn first_window(&self) -> Span {
        let share = i128::from(self.t_dp.ticks()) * i128::from(self.first_window_ppm) / 1_000_000;
        let multiple = i128::from(self.t_pll_w.max(self.min_window).ticks()) * i128::from(self.first_window_factor);
        let ticks = (share + multiple).min(i128::from(self.widest().ticks()));
        Span::from_ticks(ticks as i64).max(self.final_window())
    }
    fn widest(&self) -> Span {
        Span::from_ticks(self.t_dp.ticks() / 4)
    }
    /// Window after the halving of `window` (Model: D12).
    fn narrowed(&self, window: Span) -> Span {
        Span::from_ticks(window.ticks() / 2).max(self.final_window())
    }
    /// The timer's reading at `instant`: the last point of the grid not after it (Model: D14).
    fn captured(&self, instant: Local) -> Local {
        Local::ZERO + self.quantum * instant.since_zero().div_floor(self.quantum)
    }
}

/// An instant, or a signed distance between two, in 1/65536 tick.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Fine(i128);

impl Fine {
    fn at(instant: Local) -> Self {
        Self(i128::from(instant.ticks()) << FRACTION_BITS)
    }
    fn of(span: Span) -> Self {
        Self(i128::from(span.ticks()) << FRACTION_BITS)
    }
    fn plus(self, distance: Self) -> Self {
        Self(self.0 + distance.0)
    }
    fn minus(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
    fn half(self) -> Self {
        Self(self.0 / 2)
    }
    /// This distance times a gain [1/65536].
    fn times(self, gain: u32) -> Self {
        Self((self.0 * i128::from(gain)) >> FRACTION_BITS)
    }
    /// Whether this error lies in a window of half width `window`, its borders included.
    fn within(self, window: Span) -> bool {
        self.0.abs() <= Self::of(window).0
    }
    /// The nearest whole tick.
    fn round(self) -> i64 {
        ((self.0 + ONE / 2) >> FRACTION_BITS) as i64
    }
    /// The first whole tick not before this instant.
    fn ceil(self) -> i64 {
        ((self.0 + ONE - 1) >> FRACTION_BITS) as i64
    }
    /// The last whole tick not after this instant.
    fn floor(self) -> i64 {
        (self.0 >> FRACTION_BITS) as i64
    }
}

/// What the loop knows while it follows the clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Track {
    /// E, predicted arrival of the next SYNCH.
    next: Fine,
    /// P, recovered period.
    period: Fine,
    /// w, half width of the window around E.
    window: Span,
}

impl Track {
    fn first(arrival: Local, settings: &PllSettings) -> Self {
        let period = Fine::of(settings.t_dp);
        Self { next: Fine::at(arrival).plus(period), period, window: settings.first_window() }
    }
    fn error(&self, arrival: Local) -> Fine {
        Fine::at(arrival).minus(self.next)
    }
    /// Model: D11. The period stays within `T_DP` ± the first window: further away no first window could catch it.
    fn corrected(self, error: Fine, settings: &PllSettings) -> Self {
        let next = self.next.plus(error.times(settings.kp)).plus(self.period);
        let nominal = Fine::of(settings.t_dp);
        let pull = Fine::of(settings.first_window());
        let period = self.period.plus(error.times(settings.ki)).clamp(nominal.minus(pull), nominal.plus(pull));
        Self { next, period, ..self }
    }
    /// The next cycle without a correction.
    fn flywheel(self) -> Self {
        Self { next: self.next.plus(self.period), ..self }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    Idle,
    Waiting,
    Narrowing { track: Track, hits: u8, failures: u8 },
    Settling { track: Track, hits: u8, failures: u8 },
    Locked { track: Track, failures: u16 },
}

/// What a verdict changed beyond the loop's own numbers.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Change {
    /// Nothing a user of the clock has to know.
    None,
    /// Locked from now on (manual 2.1.2: the monitoring of the clock starts).
    Locked,
    /// Lock lost: fault 0F04, waits for a new first SYNCH (manual 5.3; Model: D15).
    Lost,
    /// Gave up before lock, waits for a new first SYNCH; no fault (manual 5.3; Model: D12).
    Restarted,
}

/// Answer to one SYNCH or one closed window.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Judgement {
    /// What it was. `Stray` counts nowhere.
    pub verdict: ClockVerdict,
    /// Arrival minus prediction, rounded to a tick; zero for `First` and `Missing`.
    pub error: Span,
    /// What it changed.
    pub change: Change,
}

/// The clock recovery of one slave. Instants are of its own crystal, within ± 2^61 ticks (6 years).
#[derive(Clone, Debug)]
pub struct Pll {
    settings: PllSettings,
    state: State,
}

impl Pll {
    /// A clock recovery that is not started.
    ///
    /// # Panics
    /// If `t_dp` or `quantum` is not positive or a gain is above one: the caller checks parameters.
    pub fn new(settings: PllSettings) -> Self {
        assert!(settings.t_dp > Span::ZERO, "T_DP must be positive");
        assert!(settings.quantum > Span::ZERO, "the timer quantum must be positive");
        assert!(settings.kp.max(settings.ki) <= 1 << FRACTION_BITS, "a gain above one does not settle");
        Self { settings, state: State::Idle }
    }

    /// Starts to look for the clock: the slave sees Operate and valid `Data_Exchange` (manual 2.1.2).
    /// Without effect once started.
    pub fn start(&mut self) {
        if self.state == State::Idle {
            self.state = State::Waiting;
        }
    }

    /// Forgets the clock: the slave left data exchange.
    pub fn stop(&mut self) {
        self.state = State::Idle;
    }

    /// The last bit of a SYNCH arrived. `None` while not started. Ask [`Pll::window_end`] again afterwards.
    pub fn synch(&mut self, arrival: Local) -> Option<Judgement> {
        let arrival = self.settings.captured(arrival);
        let track = match self.state {
            State::Idle => return None,
            State::Waiting => {
                let first = self.following(Track::first(arrival, &self.settings), 0, 0);
                return Some(self.enter(first, ClockVerdict::First, Fine(0)));
            }
            State::Narrowing { track, .. } | State::Settling { track, .. } | State::Locked { track, .. } => track,
        };
        let error = track.error(arrival);
        let (verdict, next) = if error.0 < -track.period.half().0 {
            (ClockVerdict::Stray, self.state)
        } else if error.within(track.window) {
            (ClockVerdict::Hit, self.after_hit(error))
        } else {
            (ClockVerdict::Outside, self.after_failure())
        };
        Some(self.enter(next, verdict, error))
    }

    /// The deadline [`Pll::window_end`] came due at `now`. A call before the deadline in force is stale and answered
    /// with `None`. Ask [`Pll::window_end`] again afterwards.
    pub fn window_closed(&mut self, now: Local) -> Option<Judgement> {
        if now < self.window_end()? {
            return None;
        }
        let next = self.after_failure();
        Some(self.enter(next, ClockVerdict::Missing, Fine(0)))
    }

    /// When [`Pll::window_closed`] is due: the first point of the timer grid at which no SYNCH can be a hit any more.
    /// `None` without prediction. Changes with every call of `synch`, `window_closed`, `start` and `stop`.
    pub fn window_end(&self) -> Option<Local> {
        let track = self.track()?;
        let end = Local::from_ticks(track.next.plus(Fine::of(track.window)).floor());
        Some(self.settings.captured(end) + self.settings.quantum)
    }

    /// Recovered start of the running cycle, E − P, delayed by `T_PLL_D` (Model: D13) and on the timer grid, never
    /// before the computed instant (Model: D14). `None` without prediction.
    ///
    /// The running cycle is the one whose SYNCH was judged last.
    pub fn edge(&self) -> Option<Local> {
        self.track().map(|track| self.fired(track.next.minus(track.period)))
    }

    /// Predicted start of the next cycle, E, delayed and on the grid as [`Pll::edge`]. `None` without prediction.
    pub fn next_edge(&self) -> Option<Local> {
        self.track().map(|track| self.fired(track.next))
    }

    /// Whether the loop follows the clock and monitors it.
    pub fn is_locked(&self) -> bool {
        matches!(self.state, State::Locked { .. })
    }

    /// Recovered period P, rounded to a tick; `T_DP` as parameterised without prediction.
    pub fn period(&self) -> Span {
        self.track().map_or(self.settings.t_dp, |track| Span::from_ticks(track.period.round()))
    }

    /// Half width of the window in force; the first one's without prediction.
    pub fn window(&self) -> Span {
        self.track().map_or_else(|| self.settings.first_window(), |track| track.window)
    }

    /// Failure counter of the clock monitoring, +10 per failure, −1 per hit, 0..=10·tolerance; 0 unless locked.
    pub fn failures(&self) -> u16 {
        match self.state {
            State::Locked { failures, .. } => failures,
            _ => 0,
        }
    }

    /// State, without its data.
    pub fn state(&self) -> PllState {
        match self.state {
            State::Idle => PllState::Idle,
            State::Waiting => PllState::Waiting,
            State::Narrowing { .. } => PllState::Narrowing,
            State::Settling { .. } => PllState::Settling,
            State::Locked { .. } => PllState::Locked,
        }
    }

    /// Settings this loop was made with.
    pub fn settings(&self) -> &PllSettings {
        &self.settings
    }

    fn track(&self) -> Option<&Track> {
        match &self.state {
            State::Idle | State::Waiting => None,
            State::Narrowing { track, .. } | State::Settling { track, .. } | State::Locked { track, .. } => Some(track),
        }
    }

    /// The instant at which a timer set to `at` + `T_PLL_D` fires.
    fn fired(&self, at: Fine) -> Local {
        let due = Local::from_ticks(at.ceil()) + self.settings.t_pll_d;
        Local::ZERO + due.since_zero().ceil_to(self.settings.quantum)
    }

    /// Narrowing or Settling, as the width of the window says.
    fn following(&self, track: Track, hits: u8, failures: u8) -> State {
        if track.window > self.settings.final_window() {
            State::Narrowing { track, hits, failures }
        } else {
            State::Settling { track, hits, failures }
        }
    }

    fn after_hit(&self, error: Fine) -> State {
        let settings = &self.settings;
        match self.state {
            State::Narrowing { track, hits, .. } => {
                let narrower = settings.narrowed(track.window);
                let hits = if error.within(narrower) { hits + 1 } else { 0 };
                let track = track.corrected(error, settings);
                if hits > 0 && hits >= settings.hits_per_step {
                    self.following(Track { window: narrower, ..track }, 0, 0)
                } else {
                    State::Narrowing { track, hits, failures: 0 }
                }
            }
            State::Settling { track, hits, .. } => {
                let track = track.corrected(error, settings);
                if hits + 1 >= settings.hits_to_lock {
                    State::Locked { track, failures: 0 }
                } else {
                    State::Settling { track, hits: hits + 1, failures: 0 }
                }
            }
            State::Locked { track, failures } => {
                State::Locked { track: track.corrected(error, settings), failures: failures.saturating_sub(1) }
            }
            state @ (State::Idle | State::Waiting) => state,
        }
    }

    fn after_failure(&self) -> State {
        match self.state {
            State::Narrowing { track, failures, .. } | State::Settling { track, failures, .. } => {
                if failures + 1 >= self.settings.failures_to_restart {
                    State::Waiting
                } else {
                    self.following(track.flywheel(), 0, failures + 1)
                }
            }
            State::Locked { track, failures } => {
                let failures = failures + FAILURE_WEIGHT;
                if failures > FAILURE_WEIGHT * u16::from(self.settings.tolerance) {
                    State::Waiting
                } else {
                    State::Locked { track: track.flywheel(), failures }
                }
            }
            state @ (State::Idle | State::Waiting) => state,
        }
    }

    /// Stores a state and names what that changed.
    fn enter(&mut self, next: State, verdict: ClockVerdict, error: Fine) -> Judgement {
        let before = self.state();
        self.state = next;
        let change = match (before, self.state()) {
            (PllState::Narrowing | PllState::Settling, PllState::Locked) => Change::Locked,
            (PllState::Locked, PllState::Waiting) => Change::Lost,
            (PllState::Narrowing | PllState::Settling, PllState::Waiting) => Change::Restarted,
            _ => Change::None,
        };
        Judgement { verdict, error: Span::from_ticks(error.round()), change }
    }
}
