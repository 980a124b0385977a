//! What goes wrong on the line: telegrams that never get there, come late, come twice or come with wrong bits.
//!
//! It is decided once per telegram, from the instant, the sender and the octets. Draws belong to the disturbance and to the
//! sender, so that one more station, or one more disturbance, leaves every other telegram as it was. For the same reason each
//! disturbance counts and draws as if it were alone: a telegram that another one loses counts all the same.

use crate::observation::Disturbance as How;
use crate::sim::fault::damage::Damage;
use crate::sim::fault::manner::{Counter, Manner};
use crate::sim::fault::which::{Classifier, Identity, Kind, Sent, Service, Which};
use crate::sim::fault::window::Window;
use crate::sim::noise::{Purpose, Stream};
use crate::sim::share::Share;
use crate::time::{Span, Time};
use crate::wire::{Address, Frame};

/// What a disturbance does to telegrams.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LineFault {
    /// To which.
    pub which: Which,
    /// To how many of them.
    pub manner: Manner,
    /// What.
    pub effect: Effect,
}

impl LineFault {
    /// Whether it draws anything.
    pub const fn draws(&self) -> bool {
        match self.effect {
            Effect::Bits { .. } | Effect::Late { random: true, .. } => true,
            _ => self.manner.is_chance(),
        }
    }
}

/// What becomes of a telegram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Effect {
    /// It never gets onto the line.
    Lost,
    /// It leaves late, and its sender does not know.
    Late {
        /// By how much.
        by: Span,
        /// Anything up to that is equally likely.
        random: bool,
    },
    /// It comes a second time.
    Twice {
        /// From its end to the beginning of the copy.
        after: Span,
    },
    /// Bits are wrong, each with this probability.
    Bits {
        /// Share of wrong bits.
        rate: Share,
    },
    /// Bits of one octet are wrong.
    Octet {
        /// Its number, from 0.
        number: u8,
        /// The bits.
        flip: u8,
        /// The parity fits the wrong octet.
        good_parity: bool,
    },
}

impl Effect {
    /// What it draws for, where telegrams of this service are meant.
    const fn purpose(self, service: Service) -> Purpose {
        match (self, service) {
            (Self::Lost, Service::Only(Kind::Synch)) => Purpose::ClockLoss,
            (Self::Lost, _) => Purpose::FrameLoss,
            (Self::Late { .. }, _) => Purpose::Late,
            (Self::Twice { .. }, _) => Purpose::Duplicate,
            (Self::Bits { .. } | Self::Octet { .. }, _) => Purpose::BitError,
        }
    }
}

/// What one disturbance did to a telegram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Strike {
    /// Number of the disturbance in the scenario, from 0.
    pub number: u16,
    /// What it did.
    pub what: Struck,
}

/// What was done to a telegram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Struck {
    /// It never gets onto the line.
    Lost,
    /// It leaves so much later.
    Late(Span),
    /// So long after its end it comes again.
    Twice(Span),
    /// Bits are wrong.
    Damaged,
}

impl Struck {
    /// As it is told.
    pub const fn how(self) -> How {
        match self {
            Self::Lost => How::Lost,
            Self::Late(_) => How::Late,
            Self::Twice(_) => How::Doubled,
            Self::Damaged => How::WrongBits,
        }
    }
}

/// What a disturbance draws for one sender.
#[derive(Clone, Debug)]
struct Draws {
    stream: Stream,
    /// Good bits until the next wrong one.
    good: u64,
}

/// A disturbance of the line at work.
#[derive(Clone, Debug)]
struct OnLine {
    number: u16,
    window: Window,
    fault: LineFault,
    counter: Counter,
    /// By the sender's address; none where nothing is drawn.
    draws: Vec<Option<Draws>>,
}

/// All disturbances of the line at work.
#[derive(Clone, Debug, Default)]
pub struct Line {
    faults: Vec<OnLine>,
    classifier: Classifier,
    strikes: Vec<Strike>,
    damage: Damage,
}

impl Line {
    /// Takes a disturbance in: its number, name and window, in a run with `seed` among `stations`.
    pub(super) fn add(
        &mut self,
        (number, name, window): (u16, &str, Window),
        fault: LineFault,
        (seed, stations): (u64, &[Address]),
    ) {
        let chance = fault.draws();
        let mut draws = Vec::new();
        for station in stations.iter().filter(|&&station| chance && fault.which.from.is_none_or(|from| from == station))
        {
            let purpose = fault.effect.purpose(fault.which.service);
            let mut stream = Stream::of_disturbance(seed, name, station.get(), purpose);
            let good = if let Effect::Bits { rate } = fault.effect { rate.passed_over(&mut stream) } else { 0 };
            draws.resize(draws.len().max(usize::from(station.get()) + 1), None);
            draws[usize::from(station.get())] = Some(Draws { stream, good });
        }
        self.faults.push(OnLine { number, window, fault, counter: Counter::default(), draws });
        self.strikes.reserve(self.faults.len());
    }
    /// Goes on counting and drawing where `before` is. `same` tells under which number a disturbance was there.
    pub(super) fn go_on_from(&mut self, before: &Self, same: impl Fn(u16) -> Option<usize>) {
        self.classifier = before.classifier.clone();
        for fault in &mut self.faults {
            let number = same(fault.number);
            if let Some(old) = before.faults.iter().find(|old| Some(usize::from(old.number)) == number) {
                fault.counter = old.counter;
                fault.draws.clone_from(&old.draws);
            }
        }
    }
    /// Whether there are any.
    pub const fn is_idle(&self) -> bool {
        self.faults.is_empty()
    }
    /// Judges a telegram that would leave at `now` in the cycle of this number, for SYNCH the one it begins.
    pub fn judge(&mut self, (now, cycle): (Time, u64), sent: &Sent<'_>) {
        let identity = self.classifier.identify(sent);
        self.strikes.clear();
        self.damage.begin(sent.octets);
        for fault in &mut self.faults {
            if let Some(burst) = fault.window.burst(now, cycle)
                && let Some(what) = fault.strike(burst, sent.sender, identity, &mut self.damage)
            {
                self.strikes.push(Strike { number: fault.number, what });
            }
        }
        if let Some(lost) = self.strikes.iter().position(|strike| strike.what == Struck::Lost) {
            // What else was done to it nobody will see.
            self.strikes.swap(0, lost);
            self.strikes.truncate(1);
        }
    }
    /// What was done to the telegram judged last, in the order of the scenario.
    pub fn strikes(&self) -> &[Strike] {
        &self.strikes
    }
    /// The telegram judged last, as it gets onto the line, and whether one of its characters is broken.
    pub const fn telegram(&self) -> (&Frame, bool) {
        (&self.damage.frame, self.damage.broken)
    }
}

impl OnLine {
    fn strike(&mut self, burst: u64, sender: Address, telegram: Identity, damage: &mut Damage) -> Option<Struck> {
        let LineFault { which, manner, effect } = self.fault;
        if !which.means(sender, telegram) {
            return None;
        }
        let mut draws = self.draws.get_mut(usize::from(sender.get())).and_then(Option::as_mut);
        if !manner.takes(burst, &mut self.counter, draws.as_mut().map(|draws| &mut draws.stream)) {
            return None;
        }
        match effect {
            Effect::Lost => Some(Struck::Lost),
            Effect::Late { by, random } => {
                let by = match draws {
                    Some(draws) if random => Span::from_ticks(draws.stream.below(by.ticks() as u64 + 1) as i64),
                    _ => by,
                };
                (by > Span::ZERO).then_some(Struck::Late(by))
            }
            Effect::Twice { after } => Some(Struck::Twice(after)),
            Effect::Bits { rate } => draws?.turn(rate, damage).then_some(Struck::Damaged),
            Effect::Octet { number, flip, good_parity } => {
                damage.change(number.into(), flip, good_parity).then_some(Struck::Damaged)
            }
        }
    }
}

impl Draws {
    /// Turns the wrong bits of a telegram; whether there are any.
    fn turn(&mut self, rate: Share, damage: &mut Damage) -> bool {
        let bits = damage.bits();
        if self.good >= bits {
            self.good -= bits;
            return false;
        }
        let mut next = self.good;
        damage.turn(std::iter::from_fn(|| {
            let bit = next;
            if bit >= bits {
                return None;
            }
            next = bit.saturating_add(1).saturating_add(rate.passed_over(&mut self.stream));
            Some(bit)
        }));
        self.good = next - bits;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fault::manner::Pattern;
    use crate::sim::fault::window::Bursts;
    use crate::sim::fault::{Faults, What};
    use crate::wire::{Fcb, Header, Service as FdlService, Status};

    const SEED: u64 = 5;

    fn address(number: u8) -> Address {
        Address::new(number).unwrap()
    }
    fn all(effect: Effect) -> LineFault {
        LineFault { which: Which::all(Service::All), manner: Manner::All, effect }
    }
    fn some(share: u64, effect: Effect) -> LineFault {
        LineFault { manner: Manner::Share(Share::new(Share::WHOLE / share).unwrap()), ..all(effect) }
    }
    fn line(faults: &[(&str, Window, LineFault)], stations: &[u8]) -> Line {
        let disturbance = |&(name, window, fault): &(&str, Window, LineFault)| crate::sim::fault::Disturbance {
            name: name.to_owned(),
            window,
            what: What::Line(fault),
        };
        let disturbances: Vec<_> = faults.iter().map(disturbance).collect();
        let stations: Vec<_> = stations.iter().map(|&station| address(station)).collect();
        Faults::new(&disturbances, SEED, &stations).line
    }
    fn reply(from: u8) -> Frame {
        let header = Header::request(address(from), address(2), FdlService::SrdHigh, Fcb::First);
        let mut frame = Frame::new();
        frame.set_data(&header.slave_reply(Status::Dl), &[0x12, 0x34]).unwrap();
        frame
    }
    /// What the disturbance called "a" does to each of many replies of slave 4, with the octets and whether they are
    /// broken; between them `others` reply.
    fn done_to_4(faults: &[(&str, Window, LineFault)], others: &[u8]) -> Vec<(Vec<Struck>, Vec<u8>, bool)> {
        let number = faults.iter().position(|(name, ..)| *name == "a").unwrap() as u16;
        let mut line = line(faults, &[&[2, 4], others].concat());
        let mut judge = |cycle: u64, sender: u8| {
            let frame = reply(sender);
            let sent = Sent { sender: address(sender), clock: false, octets: frame.octets() };
            line.judge((Time::ZERO, cycle), &sent);
            let own = line.strikes().iter().filter(|strike| strike.number == number).map(|strike| strike.what);
            (own.collect(), line.telegram().0.octets().to_vec(), line.telegram().1)
        };
        (0..400)
            .map(|cycle| {
                let done = judge(cycle, 4);
                for &other in others {
                    judge(cycle, other);
                }
                done
            })
            .collect()
    }

    const US: Span = Span::from_us(1);

    #[test]
    fn draws_are_those_of_the_disturbance_and_the_sender() {
        let rate = Share::new(Share::WHOLE / 500).unwrap();
        for fault in [
            some(3, Effect::Lost),
            some(3, Effect::Twice { after: US }),
            all(Effect::Late { by: US, random: true }),
            all(Effect::Bits { rate }),
        ] {
            let alone = done_to_4(&[("a", Window::Always, fault)], &[]);
            let struck = alone.iter().filter(|(strikes, ..)| !strikes.is_empty()).count();
            assert!(struck > 50, "{fault:?}: {struck}");
            assert_eq!(done_to_4(&[("a", Window::Always, fault)], &[3, 5]), alone, "more stations");
            assert_ne!(done_to_4(&[("a", Window::Always, some(2, Effect::Lost))], &[]), alone);
            // Another disturbance leaves it as it was, whatever that one draws; one that loses the telegram hides it.
            let other = ("b", Window::Always, LineFault { which: Which::all(Service::Only(Kind::Token)), ..fault });
            assert_eq!(done_to_4(&[other, ("a", Window::Always, fault)], &[]), alone, "another one");
            let early = ("b", Window::Cycles(Bursts::once(0, Some(200))), some(2, Effect::Lost));
            let both = done_to_4(&[early, ("a", Window::Always, fault)], &[]);
            assert_eq!(both[200..], alone[200..], "after another one has lost telegrams");
        }
    }

    #[test]
    fn counts_are_those_of_the_disturbance_even_where_another_one_loses_the_telegram() {
        let pattern = LineFault { manner: Manner::Pattern(Pattern::parse("..x").unwrap()), ..all(Effect::Lost) };
        let others = ("b", Window::Cycles(Bursts::once(0, Some(2))), all(Effect::Lost));
        let mut line = line(&[others, ("a", Window::Always, pattern)], &[2, 4]);
        let frame = reply(4);
        let mut lost = Vec::new();
        for cycle in 0..9 {
            line.judge((Time::ZERO, cycle), &Sent { sender: address(4), clock: false, octets: frame.octets() });
            lost.push(line.strikes().first().map(|strike| strike.number));
        }
        assert_eq!(lost, [Some(0), Some(0), Some(1), None, None, Some(1), None, None, Some(1)]);
    }

    #[test]
    fn one_that_stays_goes_on_where_it_was() {
        let pattern = LineFault { manner: Manner::Pattern(Pattern::parse("..x").unwrap()), ..all(Effect::Lost) };
        let by_chance = ("chance", Window::Always, some(2, Effect::Twice { after: US }));
        let frame = reply(4);
        let judge = |line: &mut Line| {
            line.judge((Time::ZERO, 0), &Sent { sender: address(4), clock: false, octets: frame.octets() });
            line.strikes().iter().map(|strike| strike.what).collect::<Vec<_>>()
        };
        let mut old = line(&[("a", Window::Always, pattern), by_chance], &[4]);
        (0..10).for_each(|_| drop(judge(&mut old)));
        let mut new = line(&[by_chance, ("a", Window::Always, pattern)], &[4]);
        new.go_on_from(&old, |number| Some(1 - usize::from(number)));
        for _ in 0..20 {
            let (mut before, mut now) = (judge(&mut old), judge(&mut new));
            before.sort_by_key(|what| *what == Struck::Lost);
            now.sort_by_key(|what| *what == Struck::Lost);
            assert_eq!(before, now);
        }
    }

    #[test]
    fn disturbances_come_together_and_a_lost_telegram_is_only_lost() {
        let flip = |number| all(Effect::Octet { number, flip: 0x03, good_parity: false });
        let mut faults = vec![
            ("late", Window::Always, all(Effect::Late { by: US, random: false })),
            ("later", Window::Always, all(Effect::Late { by: US * 2, random: false })),
            ("one", Window::Always, flip(7)),
            ("two", Window::Always, flip(8)),
            ("twice", Window::Always, all(Effect::Twice { after: US })),
        ];
        let frame = reply(4);
        let sent = Sent { sender: address(4), clock: false, octets: frame.octets() };
        let mut work = line(&faults, &[4]);
        work.judge((Time::ZERO, 0), &sent);
        let done: Vec<_> = work.strikes().iter().map(|strike| strike.what).collect();
        let damaged = Struck::Damaged;
        assert_eq!(done, [Struck::Late(US), Struck::Late(US * 2), damaged, damaged, Struck::Twice(US)]);
        let octets = work.telegram().0.octets();
        assert_eq!((&octets[7..9], octets.len(), work.telegram().1), (&[0x11, 0x37][..], frame.len(), false));
        faults.push(("lost", Window::Always, all(Effect::Lost)));
        let mut work = line(&faults, &[4]);
        work.judge((Time::ZERO, 0), &sent);
        assert_eq!(work.strikes(), [Strike { number: 5, what: Struck::Lost }]);
    }

    #[test]
    fn what_has_no_strength_does_nothing() {
        let none = LineFault { manner: Manner::Share(Share::NONE), ..all(Effect::Lost) };
        for fault in [
            none,
            LineFault { manner: Manner::First(0), ..none },
            all(Effect::Late { by: Span::ZERO, random: false }),
            all(Effect::Late { by: Span::ZERO, random: true }),
            all(Effect::Bits { rate: Share::NONE }),
            all(Effect::Octet { number: 200, flip: 1, good_parity: false }),
            LineFault { which: Which { to: Some(address(9)), ..Which::all(Service::All) }, ..all(Effect::Lost) },
        ] {
            let clean = (Vec::new(), reply(4).octets().to_vec(), false);
            assert!(done_to_4(&[("a", Window::Always, fault)], &[]).iter().all(|done| *done == clean), "{fault:?}");
        }
    }

    #[test]
    fn bits_are_wrong_as_often_as_the_rate_says() {
        // 500 telegrams of 11 characters with 11 bits; a rate of 1/100 is 605 wrong bits, give or take 25.
        let rate = Share::new(Share::WHOLE / 100).unwrap();
        let clean = reply(4);
        let mut line = line(&[("a", Window::Always, all(Effect::Bits { rate }))], &[4]);
        let (mut wrong, mut broken, mut other) = (0, 0, 0);
        for _ in 0..500 {
            line.judge((Time::ZERO, 0), &Sent { sender: address(4), clock: false, octets: clean.octets() });
            let (frame, bad) = line.telegram();
            let turned = frame.octets().iter().zip(clean.octets()).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
            wrong += turned;
            broken += u32::from(bad);
            other += u32::from(!bad && turned > 0);
        }
        // 8 of 11 bits are data: 440. A telegram of 121 bits gets away with 0.99^121 = 30 %.
        assert!((380..500).contains(&wrong) && (315..385).contains(&broken) && other < 20, "{wrong} {broken} {other}");
    }
}
