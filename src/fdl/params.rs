//! Bus parameters (EN 50170-2): the times of the data link layer and the rules between them.

use core::fmt;

use crate::time::{BitRate, Span, Tbit};

/// The bus parameter set. Times in bit times of `rate` unless said otherwise.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BusParams {
    /// Bit rate of the whole bus.
    pub rate: BitRate,
    /// T_SET, set-up time, 1..=494.
    pub t_set: Tbit,
    /// T_QUI, quiet time of the transmitter, 0..=31.
    pub t_qui: Tbit,
    /// Shortest T_SDR a slave may use.
    pub min_tsdr: Tbit,
    /// Longest T_SDR a slave may need.
    pub max_tsdr: Tbit,
    /// T_SL, slot time.
    pub t_sl: Tbit,
    /// Repeats of an unanswered acyclic request, 1..=15.
    pub max_retry_limit: u8,
    /// G, the GAP factor: one address is polled every G-th token visit, 1..=100.
    pub gap_factor: u8,
    /// Highest station address, 1..=126.
    pub hsa: u8,
    /// T_TR, target rotation time of the token, 256..=16 777 960.
    pub t_tr: Tbit,
}

/// A rule between bus parameters that does not hold.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ParamRule {
    /// The parameter's name.
    pub name: &'static str,
    /// Its value.
    pub value: u32,
    /// Smallest value allowed by the others.
    pub min: u32,
    /// Largest value allowed by the others.
    pub max: u32,
    /// The rule in words.
    pub rule: &'static str,
}
impl ParamRule {
    /// Whether the value is allowed by the others.
    pub fn holds(&self) -> bool {
        (self.min..=self.max).contains(&self.value)
    }
}
impl fmt::Display for ParamRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {} breaks {} (allowed here: {}..={})", self.name, self.value, self.rule, self.min, self.max)
    }
}
impl core::error::Error for ParamRule {}

impl BusParams {
    /// T_SYN, the idle time before a request.
    pub const T_SYN: Tbit = Tbit(33);

    /// The DP profile's values for `rate`.
    pub const fn profile(rate: BitRate) -> Self {
        let (t_set, t_qui, max_tsdr, t_sl, retries) = match rate {
            BitRate::K500 => (1, 0, 100, 200, 1),
            BitRate::M1_5 => (1, 0, 150, 300, 1),
            BitRate::M3 => (4, 3, 250, 400, 2),
            BitRate::M6 => (8, 6, 450, 600, 3),
            BitRate::M12 => (16, 9, 800, 1000, 4),
            _ => (1, 0, 60, 100, 1),
        };
        Self {
            rate,
            t_set: Tbit(t_set),
            t_qui: Tbit(t_qui),
            min_tsdr: Tbit(11),
            max_tsdr: Tbit(max_tsdr),
            t_sl: Tbit(t_sl),
            max_retry_limit: retries,
            gap_factor: 10,
            hsa: 126,
            t_tr: Self::usual_t_tr(126),
        }
    }
    /// The usual T_TR: 5000 t_bit for each address up to HSA (STEP 7, ranges of the bus parameters).
    pub const fn usual_t_tr(hsa: u8) -> Tbit {
        Tbit(5_000 * hsa as u32)
    }
    /// T_SM = 2 + 2 T_SET + T_QUI, safety margin.
    pub const fn t_sm(&self) -> Tbit {
        Tbit(2 + 2 * self.t_set.0 + self.t_qui.0)
    }
    /// T_ID1 = max(T_SYN + T_SM, min T_SDR): idle time after a reply, an acknowledgement or a token.
    pub fn t_id1(&self) -> Tbit {
        Tbit((Self::T_SYN.0 + self.t_sm().0).max(self.min_tsdr.0))
    }
    /// T_ID2 = max(T_SYN + T_SM, max T_SDR): idle time after a telegram that nobody answers.
    pub fn t_id2(&self) -> Tbit {
        Tbit((Self::T_SYN.0 + self.t_sm().0).max(self.max_tsdr.0))
    }
    /// T_TO = 6 T_SL + 2 address T_SL: silence after which the token is claimed.
    pub const fn t_to(&self, address: u8) -> Tbit {
        Tbit((6 + 2 * address as u32) * self.t_sl.0)
    }
    /// T_TC, token cycle: the token's three characters and T_ID1.
    pub fn t_tc(&self) -> Tbit {
        Tbit::of_octets(3) + self.t_id1()
    }
    /// The least T_TR with which `masters` active stations have one message cycle of `t_mc` each, with high priority,
    /// and `low` of them in a rotation with low priority: n (T_TC + T_MC) + k T_MC (felser.ch, token_umlaufzeit).
    pub fn least_t_tr(&self, masters: u32, low: u32, t_mc: Tbit) -> Tbit {
        Tbit(masters * (self.t_tc().0 + t_mc.0) + low * t_mc.0)
    }
    /// `bits` as a span at this bus's rate.
    pub const fn span(&self, bits: Tbit) -> Span {
        self.rate.span(bits)
    }

    /// Every rule between the parameters for a bus with a longest one-way delay of `t_td`, with its numbers.
    pub fn rules(&self, t_td: Span) -> [ParamRule; 9] {
        let t_td = t_td.ceil_to(self.rate.bit()).div_floor(self.rate.bit()) as u32;
        let idle = 35 + 2 * self.t_set.0 + self.t_qui.0;
        let slot = (2 * t_td + self.max_tsdr.0).max(2 * t_td + self.t_id1().0) + 11 + self.t_sm().0;
        let min_tsdr_max = 255.min(self.max_tsdr.0.saturating_sub(1)).min(idle - 1);
        [
            ("t_set", self.t_set.0, 1, 494, "1 <= T_SET <= 494"),
            ("t_qui", self.t_qui.0, 0, 31.min(self.min_tsdr.0.saturating_sub(1)), "T_QUI <= min(31, min T_SDR - 1)"),
            ("max_tsdr", self.max_tsdr.0, idle, 1023, "35 + 2 T_SET + T_QUI <= max T_SDR <= 1023"),
            (
                "min_tsdr",
                self.min_tsdr.0,
                11,
                min_tsdr_max,
                "11 <= min T_SDR <= min(255, max T_SDR - 1, 34 + 2 T_SET + T_QUI)",
            ),
            ("t_sl", self.t_sl.0, slot, 16_383, "T_SL >= 2 T_TD + max(max T_SDR, T_ID1) + 11 + T_SM"),
            ("max_retry_limit", u32::from(self.max_retry_limit), 1, 15, "1 <= max_retry_limit <= 15"),
            ("gap_factor", u32::from(self.gap_factor), 1, 100, "1 <= G <= 100"),
            ("hsa", u32::from(self.hsa), 1, 126, "HSA <= 126"),
            ("t_tr", self.t_tr.0, 256, 16_777_960, "256 <= T_TR <= 16 777 960"),
        ]
        .map(|(name, value, min, max, rule)| ParamRule { name, value, min, max, rule })
    }
    /// Checks every rule between the parameters for a bus with a longest one-way delay of `t_td`.
    ///
    /// # Errors
    /// The first rule that does not hold, with its numbers.
    pub fn check(&self, t_td: Span) -> Result<(), ParamRule> {
        match self.rules(t_td).into_iter().find(|rule| !rule.holds()) {
            Some(broken) => Err(broken),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derived columns of the profile table: rate, T_SM, T_ID1, T_ID2, T_TO of address 2 (t_bit).
    #[test]
    fn profile_values_and_derived_times() {
        for (rate, t_sm, t_id1, t_id2, t_to) in [
            (BitRate::K9_6, 4, 37, 60, 1_000),
            (BitRate::K500, 4, 37, 100, 2_000),
            (BitRate::M1_5, 4, 37, 150, 3_000),
            (BitRate::M3, 13, 46, 250, 4_000),
            (BitRate::M6, 24, 57, 450, 6_000),
            (BitRate::M12, 43, 76, 800, 10_000),
        ] {
            let bus = BusParams::profile(rate);
            assert_eq!(
                (bus.t_sm().0, bus.t_id1().0, bus.t_id2().0, bus.t_to(2).0),
                (t_sm, t_id1, t_id2, t_to),
                "{rate}"
            );
            assert_eq!(bus.check(Span::ZERO), Ok(()), "{rate}");
        }
    }

    #[test]
    fn a_broken_rule_is_named_with_its_numbers() {
        let mut bus = BusParams::profile(BitRate::M12);
        bus.t_sl = Tbit(800);
        let rule = bus.check(Span::from_ns(500)).unwrap_err();
        assert_eq!((rule.name, rule.value, rule.min), ("t_sl", 800, 2 * 6 + 800 + 11 + 43));
    }

    /// felser.ch, token_umlaufzeit: n (T_TC + T_MC) + k T_MC.
    #[test]
    fn the_least_t_tr_has_room_for_every_master() {
        let bus = BusParams::profile(BitRate::M1_5);
        // Token 33, T_ID1 37; a message cycle of 300.
        assert_eq!(bus.t_tc(), Tbit(70));
        assert_eq!(bus.least_t_tr(3, 0, Tbit(300)), Tbit(3 * 370));
        assert_eq!(bus.least_t_tr(3, 2, Tbit(300)), Tbit(3 * 370 + 2 * 300));
    }

    #[test]
    fn t_tr_has_a_range_and_a_rule_of_thumb() {
        let mut bus = BusParams::profile(BitRate::M12);
        assert_eq!(bus.t_tr, Tbit(630_000));
        for (t_tr, fits) in [(255, false), (256, true), (16_777_960, true), (16_777_961, false)] {
            bus.t_tr = Tbit(t_tr);
            assert_eq!(bus.check(Span::ZERO).is_ok(), fits, "{t_tr}");
        }
    }
}
