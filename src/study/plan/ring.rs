//! Ring: the token's visits to other active stations, and what they leave of a bus cycle.
//!
//! ```text
//! own token | T_ID1 | message ... | token | T_ID1 | the next station, or SYNCH
//!           |-------- one visit --------|
//! ```
//! A visit has one message with high priority whatever is left of T_TH, further ones while T_TH = T_TR - T_RR lasts, and
//! ends with the message that began in time (EN 50170-2 p. 119). An isochronous master passes the token on once in every
//! T_DP, so that T_RR is T_DP at every other station. Model: in operation, that is after the start-up of its slaves, and
//! without repeats.

use super::{Plan, STATUS_REQUEST, SYNCH, service};
use crate::fdl::params::BusParams;
use crate::study::scenario::{Scenario, Slave};
use crate::time::{Span, Tbit};
use crate::wire::Address;

/// Octets of the longest request behind SAPs that is read with, and of the longest answer.
const RECORD: (usize, usize) = (14, 244);

/// One visit of the token to another active station.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Visit {
    /// Whom.
    pub station: Address,
    /// Its class, 1 or 2.
    pub class: u8,
    /// Its longest message with high priority; nothing if it has none in operation.
    pub high: Span,
    /// The shortest that it must be given: that message and the token.
    pub least: Span,
    /// The longest message that it may begin at the last moment, and the token.
    pub longest: Span,
    /// All that it can do in one visit, with the token: every Data_Exchange of a poll cycle, one acyclic message, the
    /// GAP; of class 2 as many messages as it may send, the GAP.
    pub work: Span,
}

impl Visit {
    /// The longest visit that begins with this T_TH.
    pub fn most(&self, t_th: Span) -> Span {
        (t_th.max(Span::ZERO) + self.longest).min(self.work)
    }
}

/// Every other active station of `scenario`; `t_mc` tells the message cycle of a slave.
pub(super) fn visits(scenario: &Scenario, t_mc: impl Fn(&Slave) -> Span) -> Vec<Visit> {
    let bus = &scenario.bus.params;
    // The token comes over the cable and goes on.
    let token = bus.span(bus.t_tc()) + scenario.topology.t_td_max() * 2;
    let gap = bus.span(STATUS_REQUEST + bus.t_sl + bus.t_id1());
    let record = service(bus, RECORD.0, RECORD.1) + bus.span(bus.t_id1());
    let class1 = scenario.class1.iter().map(|class1| {
        let exchanges = || scenario.slaves_of(class1.address).map(&t_mc);
        let high = exchanges().max().unwrap_or_default();
        let mode = bus.span(SYNCH + bus.t_id2());
        Visit {
            station: class1.address,
            class: 1,
            high,
            least: token + high,
            longest: token + high.max(gap).max(mode),
            work: token + exchanges().sum::<Span>() + mode + gap,
        }
    });
    let class2 = scenario.class2.iter().map(|class2| Visit {
        station: class2.address,
        class: 2,
        high: Span::ZERO,
        // With nothing to ask it passes the token on.
        least: token,
        longest: token + record.max(gap),
        work: token + record * i64::from(class2.per_token) + gap,
    });
    class1.chain(class2).collect()
}

impl Plan {
    /// The longest message cycle with high priority of any master (t_bit, rounded up).
    pub fn longest_high(&self, bus: &BusParams) -> Tbit {
        let own = self.slots.iter().map(|slot| slot.t_mc(bus));
        let others = self.visits.iter().map(|visit| visit.high);
        let longest = own.chain(others).max().unwrap_or_default();
        Tbit(longest.ceil_to(bus.rate.bit()).div_floor(bus.rate.bit()) as u32)
    }
    /// The least T_TR: one message with high priority of every active station and one with low priority in a rotation
    /// (felser.ch, token_umlaufzeit).
    pub fn least_t_tr(&self, bus: &BusParams) -> Tbit {
        bus.least_t_tr(1 + self.visits.len() as u32, 1, self.longest_high(bus))
    }
    /// T_TH of every other station beside a master with SYNCH every `t_dp`: T_TR - T_DP, not below nothing.
    pub fn t_th(&self, bus: &BusParams, t_dp: Span) -> Span {
        (bus.span(bus.t_tr) - t_dp).max(Span::ZERO)
    }
    /// What T_DP must hold for the token to be back before SYNCH in any case, with this T_TH of every other station.
    pub fn content_at_most(&self, t_th: Span) -> Span {
        self.own() + self.visits.iter().map(|visit| visit.most(t_th)).sum::<Span>()
    }
    /// By how much the token may delay SYNCH at most where the SYNCH before was in time.
    pub fn synch_delay(&self, bus: &BusParams, t_dp: Span) -> Span {
        (self.content_at_most(self.t_th(bus, t_dp)) - t_dp).max(Span::ZERO)
    }
    /// The longest T_TR with which the token does not delay SYNCH; none if even T_TH = 0 does.
    pub fn longest_t_tr(&self, bus: &BusParams, t_dp: Span) -> Option<Tbit> {
        let left = t_dp - self.content_at_most(Span::ZERO);
        let share = Span::from_ticks(left.ticks() / (self.visits.len() as i64).max(1));
        (left >= Span::ZERO).then(|| Tbit((t_dp + share).div_floor(bus.rate.bit()) as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::BitRate;

    /// A visit of one message of 1000 t_bit at the last moment, 300 with high priority, 5000 at all.
    fn visit() -> Visit {
        let bits = |bits| BitRate::M12.span(Tbit(bits));
        let station = Address::new(9).unwrap();
        Visit { station, class: 1, high: bits(191), least: bits(300), longest: bits(1_000), work: bits(5_000) }
    }

    #[test]
    fn a_visit_ends_with_the_message_that_began_in_time_or_with_all_work() {
        let bits = |bits| BitRate::M12.span(Tbit(bits));
        for (t_th, most) in [(0, 1_000), (500, 1_500), (4_000, 5_000), (9_000, 5_000)] {
            assert_eq!(visit().most(bits(t_th)), bits(most), "T_TH {t_th}");
        }
        assert_eq!(visit().most(-bits(7)), bits(1_000));
    }

    #[test]
    fn the_longest_t_tr_just_does_not_delay_synch() {
        let bus = BusParams::profile(BitRate::M12);
        let bits = |bits| bus.span(Tbit(bits));
        let plan = Plan {
            slots: Vec::new(),
            t_dx: bits(4_000),
            gap: bits(1_000),
            token: bits(109),
            synch: bits(219),
            visits: vec![visit(), visit()],
        };
        let t_dp = bits(12_000);
        // 12000 - 5328 - 2 x 1000 are left for two.
        let t_tr = plan.longest_t_tr(&bus, t_dp).unwrap();
        assert_eq!(t_tr, Tbit(12_000 + 2_336));
        let with = |t_tr| BusParams { t_tr, ..bus };
        assert_eq!(plan.synch_delay(&with(t_tr), t_dp), Span::ZERO);
        assert_eq!(plan.synch_delay(&with(t_tr + Tbit(100)), t_dp), bits(200));
        assert_eq!(plan.longest_t_tr(&bus, bits(7_327)), None);
        assert_eq!(plan.content(), bits(5_328 + 600));
    }
}
