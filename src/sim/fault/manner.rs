//! Which of the telegrams that a disturbance means it gets hold of: all, a share, the first ones, or a pattern.

use crate::sim::noise::Stream;
use crate::sim::share::Share;

/// Which of the telegrams it means a disturbance gets hold of.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Manner {
    /// All of them.
    #[default]
    All,
    /// Each with this probability.
    Share(Share),
    /// The first so many of each burst.
    First(u64),
    /// Those that the pattern marks, counted from the beginning of each burst.
    Pattern(Pattern),
}

/// Marks on a row of telegrams, again and again from its beginning.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pattern {
    marks: u64,
    length: u8,
}

impl Pattern {
    /// The longest.
    pub const LONGEST: usize = 64;

    /// Reads `x` for a telegram that is meant and `.` for one that is not.
    pub fn parse(text: &str) -> Option<Self> {
        if text.is_empty() || text.len() > Self::LONGEST {
            return None;
        }
        let mut marks = 0;
        for (place, mark) in text.bytes().enumerate() {
            match mark {
                b'x' => marks |= 1 << place,
                b'.' => {}
                _ => return None,
            }
        }
        Some(Self { marks, length: text.len() as u8 })
    }
    /// Whether the telegram of this number, from 0, is marked.
    pub const fn marks(&self, number: u64) -> bool {
        self.marks >> (number % self.length as u64) & 1 == 1
    }
}

/// Telegrams counted in a burst.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counter {
    burst: u64,
    next: u64,
}

impl Counter {
    /// Number, from 0, of the next telegram in this burst.
    fn count(&mut self, burst: u64) -> u64 {
        if self.burst != burst {
            *self = Self { burst, next: 0 };
        }
        self.next += 1;
        self.next - 1
    }
}

impl Manner {
    /// Whether chance decides.
    pub const fn is_chance(&self) -> bool {
        matches!(self, Self::Share(share) if share.is_chance())
    }
    /// Whether the next telegram of this burst is one. `stream` belongs to its sender.
    pub(super) fn takes(&self, burst: u64, counter: &mut Counter, stream: Option<&mut Stream>) -> bool {
        match self {
            Self::All => true,
            Self::Share(share) => stream.map_or(*share == Share::ALL, |stream| share.takes(stream)),
            Self::First(telegrams) => counter.count(burst) < *telegrams,
            Self::Pattern(pattern) => pattern.marks(counter.count(burst)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Telegrams of two bursts with six each, `x` for those taken.
    fn taken(manner: Manner) -> String {
        let mut counter = Counter::default();
        let mut text = String::new();
        for burst in [0, 1] {
            text.extend((0..6).map(|_| if manner.takes(burst, &mut counter, None) { 'x' } else { '.' }));
        }
        text
    }

    #[test]
    fn manners_begin_anew_with_each_burst() {
        assert_eq!(taken(Manner::All), "xxxxxxxxxxxx");
        assert_eq!(taken(Manner::First(0)), "............");
        assert_eq!(taken(Manner::First(2)), "xx....xx....");
        assert_eq!(taken(Manner::Pattern(Pattern::parse("x..x").unwrap())), "x..xx.x..xx.");
        assert_eq!(taken(Manner::Share(Share::NONE)), "............");
        assert_eq!(taken(Manner::Share(Share::ALL)), "xxxxxxxxxxxx");
    }

    #[test]
    fn patterns_are_rows_of_marks() {
        for wrong in ["", "X", "x-", "x x", &"x".repeat(65)] {
            assert_eq!(Pattern::parse(wrong), None, "{wrong}");
        }
        let longest = Pattern::parse(&format!("{}x", ".".repeat(63))).unwrap();
        assert!((0..200).all(|number| longest.marks(number) == (number % 64 == 63)));
    }
}
