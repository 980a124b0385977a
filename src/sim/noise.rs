//! Noise: random streams with names, the distributions drawn from them, and the jitter of links.
//!
//! Every draw belongs to (seed, station, purpose): the three are written side by side into the key of a ChaCha8
//! generator, so adding a station, a metric or a trace leaves all other draws as they are. A link between segments takes
//! a station's place by its name. The distributions are our own few lines, in integers, `sqrt` and `libm` alone: each
//! value is the same on every machine and in every release.

use crate::time::Span;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Separates these keys from those of any other user of ChaCha8.
const KEY_DOMAIN: [u8; 8] = *b"isodp/v1";

macro_rules! purposes {
    ($($(#[$doc:meta])* $name:ident = $key:literal;)*) => {
        /// What a stream is drawn for.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
        pub enum Purpose { $($(#[$doc])* $name,)* }

        impl Purpose {
            /// Every purpose.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The eight octets that stand for the purpose in a stream's key. They never change: draws hang on them.
            pub const fn key(self) -> [u8; 8] {
                match self { $(Self::$name => *$key,)* }
            }
        }
    };
}
purposes! {
    /// Jitter of the master's SYNCH Global_Control.
    GcJitter = b"gcjitter";
    /// Offset of a station's crystal.
    CrystalOffset = b"xtaloffs";
    /// What a station's crystal shows when the run begins.
    CrystalStart = b"xtalstrt";
    /// Wander of a station's crystal.
    CrystalWander = b"xtalwand";
    /// A slave's T_SDR.
    ResponseDelay = b"respdely";
    /// The receiver's sampling of an edge.
    Sampling = b"sampling";
    /// The delay of cable and repeaters.
    Propagation = b"propagat";
    /// Frames that are lost.
    FrameLoss = b"frame-ls";
    /// Bits that arrive wrong.
    BitError = b"biterror";
    /// Frames that arrive twice.
    Duplicate = b"duplicat";
    /// Frames that arrive late.
    Late = b"lateness";
    /// Clocks that are missing.
    ClockLoss = b"clockmis";
    /// When a station falls silent, restarts or returns.
    Outage = b"outage--";
    /// When a station is switched on.
    PowerOn = b"power-on";
    /// Where a shaft stands when the run begins.
    Shaft = b"shaftpos";
    /// Electrical noise on the line.
    Noise = b"linenois";
    /// Acyclic requests of the master.
    Acyclic = b"acyclic-";
    /// What a repeater's delay strays by, telegram by telegram.
    Repeater = b"repeater";
}

/// A random stream: the draws of one station for one purpose.
///
/// A draw takes a number of 64-bit words that depends on the values drawn, never on the machine. No draw keeps
/// anything for the next, so the kinds of draw may be mixed freely.
#[derive(Clone, Debug)]
pub struct Stream {
    words: ChaCha8Rng,
}

impl Stream {
    /// The stream of (`seed`, `station`, `purpose`), at its beginning.
    pub fn new(seed: u64, station: u8, purpose: Purpose) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8] = station;
        key[16..24].copy_from_slice(&purpose.key());
        key[24..].copy_from_slice(&KEY_DOMAIN);
        Self { words: ChaCha8Rng::from_seed(key) }
    }
    /// The stream of (`seed`, the link called `link`, `purpose`), at its beginning.
    ///
    /// The name stands where a station has its address: 127, which no station has, and 56 bits of its FNV-1a hash
    /// (Fowler, Noll and Vo).
    pub fn of_link(seed: u64, link: &str, purpose: Purpose) -> Self {
        /// No station's address.
        const NO_STATION: u8 = 127;
        Self::named(seed, NO_STATION, link, purpose)
    }
    /// The stream of (`seed`, the disturbance called `name`, `station`, `purpose`), at its beginning: each station that
    /// a disturbance means has draws of its own.
    pub fn of_disturbance(seed: u64, name: &str, station: u8, purpose: Purpose) -> Self {
        Self::named(seed, station, name, purpose)
    }
    /// A stream with 56 bits of a name's FNV-1a hash beside the station.
    fn named(seed: u64, station: u8, name: &str, purpose: Purpose) -> Self {
        let hash = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |hash: u64, octet| (hash ^ u64::from(octet)).wrapping_mul(0x0100_0000_01b3));
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8] = station;
        key[9..16].copy_from_slice(&hash.to_le_bytes()[..7]);
        key[16..24].copy_from_slice(&purpose.key());
        key[24..].copy_from_slice(&KEY_DOMAIN);
        Self { words: ChaCha8Rng::from_seed(key) }
    }

    /// An integer from 0 to `n` - 1, each equally likely.
    ///
    /// A word times `n` is a number whose upper half is the draw. `n` does not divide 2^64, so some draws would be one
    /// word richer than others: the words that make up the surplus are refused and drawn again (Lemire, "Fast random
    /// integer generation in an interval", 2019).
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: u64) -> u64 {
        assert!(n > 0, "nothing to draw from");
        loop {
            let product = u128::from(self.words.next_u64()) * u128::from(n);
            let rest = product as u64;
            // The surplus, 2^64 mod n, is less than n: the division is rarely needed.
            if rest >= n || rest >= n.wrapping_neg() % n {
                return (product >> 64) as u64;
            }
        }
    }

    /// A whole number of ticks from -`half_width` to +`half_width`, both included, each equally likely.
    ///
    /// # Panics
    /// If `half_width` is negative.
    pub fn uniform(&mut self, half_width: Span) -> Span {
        assert!(half_width >= Span::ZERO, "half width {half_width} is negative");
        let count = 2 * half_width.ticks() as u64 + 1;
        Span::from_ticks((self.below(count) as i64).wrapping_sub(half_width.ticks()))
    }

    /// A standard normal number, mean 0 and standard deviation 1, never beyond ±12.
    ///
    /// Marsaglia's polar method: a point drawn from the square until it lies in the unit circle. Of the two normal
    /// numbers that a point yields the second is thrown away, so that no draw leaves anything behind.
    pub fn normal(&mut self) -> f64 {
        loop {
            let (u, v) = (self.coordinate(), self.coordinate());
            let s = u * u + v * v;
            if s < 1.0 {
                return u * (-2.0 * libm::log(s) / s).sqrt();
            }
        }
    }

    /// A normal span with mean 0 and standard deviation `sigma`, rounded once to the nearest tick.
    ///
    /// # Panics
    /// If `sigma` is negative.
    pub fn normal_span(&mut self, sigma: Span) -> Span {
        assert!(sigma >= Span::ZERO, "standard deviation {sigma} is negative");
        Span::from_ticks(libm::round(self.normal() * sigma.ticks() as f64) as i64)
    }

    /// A normal span as [`Self::normal_span`], drawn again until it lies within ±`bound`, both included.
    ///
    /// # Panics
    /// If `bound` is less than a quarter of `sigma`: four draws in five would be lost.
    pub fn bounded_normal(&mut self, sigma: Span, bound: Span) -> Span {
        assert!(reaches(sigma, bound), "bound {bound} is less than a quarter of the standard deviation {sigma}");
        loop {
            let span = self.normal_span(sigma);
            if -bound <= span && span <= bound {
                return span;
            }
        }
    }

    /// A span with an exponential distribution about `mean`, rounded up to a whole tick, at least one.
    ///
    /// # Panics
    /// If `mean` is not positive.
    pub fn exponential(&mut self, mean: Span) -> Span {
        assert!(mean > Span::ZERO, "mean {mean} is not positive");
        // The logarithm is above -37, the mean of a run's length at most.
        Span::from_ticks(libm::ceil(-libm::log(self.unit()) * mean.ticks() as f64).max(1.0) as i64)
    }

    /// An odd multiple of 2^-53 between 0 and 1: exact, neither of the two.
    pub fn unit(&mut self) -> f64 {
        /// 2^-52.
        const STEP: f64 = 1.0 / (1u64 << 52) as f64;
        ((self.words.next_u64() >> 12) as f64 + 0.5) * STEP
    }

    /// An odd multiple of 2^-52 between -1 and 1: exact, as often negative as positive, never 0.
    fn coordinate(&mut self) -> f64 {
        /// 2^-51.
        const STEP: f64 = 1.0 / (1u64 << 51) as f64;
        ((self.words.next_u64() >> 12) as f64 + 0.5) * STEP - 1.0
    }
}

/// Whether `bound` is at least a quarter of `sigma`.
pub(super) fn reaches(sigma: Span, bound: Span) -> bool {
    bound.ticks() >= sigma.ticks() / 4 + i64::from(sigma.ticks() % 4 > 0)
}

/// The jitter of one link between segments, telegram by telegram.
///
/// Model: each telegram strays by itself, equally likely anywhere within the half width, because a repeater samples what
/// it hears on a clock of its own that has nothing to do with the sender's.
#[derive(Clone, Debug)]
pub struct LinkJitter {
    half_width: Span,
    stream: Stream,
    /// What disturbances add.
    more: Vec<Addition>,
}

/// What a disturbance adds to the jitter of a link.
#[derive(Clone, Debug)]
struct Addition {
    name: String,
    /// Index of the link in the tree, and the half width: what else tells it from another one of this name.
    what: (usize, Span),
    stream: Stream,
    /// Whether it counts now.
    on: bool,
}

impl LinkJitter {
    /// The jitter of the link called `link` in a run with `seed`.
    ///
    /// # Panics
    /// If `half_width` is negative.
    pub fn new(half_width: Span, seed: u64, link: &str) -> Self {
        assert!(half_width >= Span::ZERO, "half width {half_width} is negative");
        Self { half_width, stream: Stream::of_link(seed, link, Purpose::Repeater), more: Vec::new() }
    }
    /// How much later than nominal the next telegram leaves the link. Signed.
    pub fn draw(&mut self) -> Span {
        let own = self.stream.uniform(self.half_width);
        let more = self.more.iter_mut().filter(|addition| addition.on);
        more.fold(own, |sum, addition| sum + addition.stream.uniform(addition.what.1))
    }
    /// Adds what the disturbance called `name` makes of the link, `what` being the index of it and the half width, in a
    /// run with `seed`. It does not count yet.
    ///
    /// # Panics
    /// If `half_width` is negative.
    #[must_use]
    pub fn with(mut self, what: (usize, Span), seed: u64, name: &str) -> Self {
        assert!(what.1 >= Span::ZERO, "half width {} is negative", what.1);
        // No station has the address 127.
        let stream = Stream::of_disturbance(seed, name, 127, Purpose::Repeater);
        self.more.push(Addition { name: name.to_owned(), what, stream, on: false });
        self
    }
    /// What the disturbance called `name` adds, this half width to the link of this index, counts from now on, or no more.
    pub(super) fn disturb(&mut self, name: &str, what: (usize, Span), counts: bool) {
        for addition in self.more.iter_mut().filter(|other| other.name == name && other.what == what) {
            addition.on = counts;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEED: u64 = 0x0123_4567_89ab_cdef;
    const US: Span = Span::from_us(1);

    fn stream(station: u8, purpose: Purpose) -> Stream {
        Stream::new(SEED, station, purpose)
    }
    /// Largest distance between the draws' distribution and the one expected, as Kolmogorov and Smirnov measure it.
    fn distance(mut draws: Vec<f64>, expected: impl Fn(f64) -> f64) -> f64 {
        draws.sort_by(f64::total_cmp);
        let n = draws.len() as f64;
        let gaps = draws.iter().enumerate().map(|(i, &x)| {
            let p = expected(x);
            (p - i as f64 / n).max((i + 1) as f64 / n - p)
        });
        gaps.fold(0.0, f64::max)
    }

    #[test]
    fn every_purpose_has_its_own_key() {
        for (i, a) in Purpose::ALL.iter().enumerate() {
            assert!(Purpose::ALL[..i].iter().all(|b| b.key() != a.key()), "{a:?}");
        }
    }

    #[test]
    fn draws_never_change_from_release_to_release() {
        let mut words = stream(2, Purpose::GcJitter);
        assert_eq!([(); 4].map(|()| words.below(1_000_000)), [151_189, 211_213, 742_479, 167_515]);
    }

    #[test]
    fn streams_of_other_seeds_stations_and_purposes_differ() {
        let draws = |mut stream: Stream| [(); 4].map(|()| stream.below(u64::MAX));
        let mut seen = vec![draws(Stream::new(SEED + 1, 0, Purpose::GcJitter))];
        for station in [0, 1, 2, 125] {
            for &purpose in Purpose::ALL {
                let these = draws(stream(station, purpose));
                assert_eq!(these, draws(stream(station, purpose)));
                assert!(seen.iter().flatten().all(|word| !these.contains(word)), "{station} {purpose:?}");
                seen.push(these);
            }
        }
    }

    #[test]
    fn links_have_streams_by_name_that_no_station_has() {
        let draws = |mut stream: Stream| [(); 4].map(|()| stream.below(u64::MAX));
        let of = |name| draws(Stream::of_link(SEED, name, Purpose::Repeater));
        let mut seen: Vec<_> = (0..=127).map(|number| draws(stream(number, Purpose::Repeater))).collect();
        for name in ["", "a", "b", "ab", "ba", "hall 1 - hall 2"] {
            assert_eq!(of(name), of(name));
            assert!(seen.iter().flatten().all(|word| !of(name).contains(word)), "{name}");
            seen.push(of(name));
        }
        assert_ne!(draws(Stream::of_link(SEED + 1, "a", Purpose::Repeater)), of("a"));
        for station in [0, 3, 125] {
            let these = draws(Stream::of_disturbance(SEED, "a", station, Purpose::Repeater));
            assert!(seen.iter().flatten().all(|word| !these.contains(word)), "{station}");
            seen.push(these);
        }
        let mut jitter = LinkJitter::new(US, SEED, "a");
        let strays: Vec<i64> = (0..10_000).map(|_| jitter.draw().ticks()).collect();
        assert!(strays.iter().all(|t| t.abs() <= US.ticks()) && strays.iter().any(|t| t.abs() > US.ticks() * 99 / 100));
        assert_eq!(LinkJitter::new(Span::ZERO, SEED, "a").draw(), Span::ZERO);
        let mut more = LinkJitter::new(Span::ZERO, SEED, "a").with((1, US), SEED, "more");
        let mut draws = |on: bool| {
            for (name, what) in [("other", (1, US)), ("more", (2, US)), ("more", (1, US * 2))] {
                more.disturb(name, what, !on);
            }
            more.disturb("more", (1, US), on);
            more.draw()
        };
        assert!(draws(true) != Span::ZERO && draws(false) == Span::ZERO && draws(true) != Span::ZERO);
    }

    #[test]
    fn neighbouring_streams_are_not_correlated() {
        let (mut a, mut b) = (stream(3, Purpose::GcJitter), stream(4, Purpose::GcJitter));
        let mean = (0..100_000).map(|_| a.normal() * b.normal()).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.015, "{mean}");
    }

    #[test]
    fn normal_draws_are_normal() {
        let mut stream = stream(2, Purpose::Sampling);
        let draws: Vec<f64> = (0..100_000).map(|_| stream.normal()).collect();
        let mean = draws.iter().sum::<f64>() / 1e5;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.015 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
        assert!(draws.iter().all(|x| x.abs() < 12.0));
        // 1.95 / sqrt(n) is passed by one series in a thousand; this one is fixed.
        let d = distance(draws, |x| 0.5 * libm::erfc(-x / core::f64::consts::SQRT_2));
        assert!(d < 1.95 / 1e5f64.sqrt(), "{d}");
    }

    #[test]
    fn uniform_draws_are_uniform() {
        let mut stream = stream(2, Purpose::Sampling);
        let draws: Vec<f64> = (0..100_000).map(|_| stream.uniform(Span::from_ms(1)).ticks() as f64).collect();
        let d = distance(draws, |x| 0.5 + x / 24e6);
        assert!(d < 1.95 / 1e5f64.sqrt(), "{d}");
        let mut counts = [0u32; 7];
        for _ in 0..70_000 {
            counts[(stream.uniform(Span::from_ticks(3)).ticks() + 3) as usize] += 1;
        }
        assert!(counts.iter().all(|n| (9_600..10_400).contains(n)), "{counts:?}");
    }

    #[test]
    fn draws_reach_the_ends_of_the_range_and_stay_inside() {
        let mut stream = stream(9, Purpose::FrameLoss);
        assert_eq!(stream.below(1), 0);
        assert_eq!(stream.uniform(Span::ZERO), Span::ZERO);
        assert_eq!(stream.normal_span(Span::ZERO), Span::ZERO);
        assert_eq!(stream.bounded_normal(Span::ZERO, Span::ZERO), Span::ZERO);
        let widest: Vec<i64> = (0..1_000).map(|_| stream.uniform(Span::MAX).ticks()).collect();
        assert!(widest.iter().any(|&t| t < i64::MIN / 8 * 7) && widest.iter().any(|&t| t > i64::MAX / 8 * 7));
        // The largest surplus there is: nearly half of all words are refused.
        let n = (1 << 63) + 1;
        assert!((0..1_000).all(|_| stream.below(n) < n));
        assert!((0..1_000).any(|_| stream.below(n) > n / 8 * 7));
    }

    #[test]
    fn bounded_draws_never_pass_the_bound() {
        let mut stream = stream(2, Purpose::GcJitter);
        for bound in [US, US * 2, Span::from_ns(250)] {
            let draws: Vec<Span> = (0..30_000).map(|_| stream.bounded_normal(US, bound)).collect();
            assert!(draws.iter().all(|s| s.abs() <= bound));
            assert!(draws.iter().any(|s| s.abs() > bound - Span::from_ns(50)));
        }
    }
}
