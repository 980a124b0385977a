//! The master's clock: where the isochronous cycle begins (Model: D1).
//!
//! Cycle k starts when the last bit of its SYNCH leaves the master. The master aims at a grid of T_DP on its own
//! crystal; what disturbs one SYNCH does not move the next, unless the master re-arms from the last one.

use crate::time::{Local, Span};

/// How the master finds its next cycle start.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Rearm {
    /// From the grid: disturbances do not add up.
    #[default]
    Grid,
    /// From the SYNCH just sent, as some masters do: disturbances add up.
    LastSent,
}

/// The grid of cycle starts.
#[derive(Clone, Copy, Debug)]
pub struct CycleClock {
    t_dp: Span,
    /// Time on the line of SYNCH.
    t_gc: Span,
    rearm: Rearm,
    /// Number of the coming cycle.
    cycle: u64,
    /// Grid point of the coming cycle start, free of disturbances.
    nominal: Local,
    /// Where the coming cycle start is aimed at.
    aim: Local,
}

impl CycleClock {
    /// A clock whose cycle 0 starts at `first`.
    pub const fn new(t_dp: Span, t_gc: Span, rearm: Rearm, first: Local) -> Self {
        Self { t_dp, t_gc, rearm, cycle: 0, nominal: first, aim: first }
    }
    /// Aims the coming cycle start at `first`; the numbers go on.
    pub const fn restart(&mut self, first: Local) {
        (self.nominal, self.aim) = (first, first);
    }
    /// Leaves out the cycles whose SYNCH should have left a whole T_DP and more before `now`: the grid goes on
    /// (Model: D1), numbers count what is sent. Returns how many.
    pub fn miss(&mut self, now: Local) -> u64 {
        let late = now - self.planned();
        if late < self.t_dp {
            return 0;
        }
        let missed = late.div_floor(self.t_dp);
        self.nominal += self.t_dp * missed;
        self.aim += self.t_dp * missed;
        missed as u64
    }
    /// Number of the coming cycle.
    pub const fn coming(&self) -> u64 {
        self.cycle
    }
    /// Instant at which the first bit of the coming SYNCH should leave.
    pub fn planned(&self) -> Local {
        self.aim - self.t_gc
    }
    /// SYNCH has left, its last bit at `now`. Returns the number and the grid point of the cycle that began.
    pub fn started(&mut self, now: Local) -> (u64, Local) {
        let began = (self.cycle, self.nominal);
        self.cycle += 1;
        self.nominal += self.t_dp;
        self.aim = match self.rearm {
            Rearm::Grid => self.nominal,
            Rearm::LastSent => now + self.t_dp,
        };
        began
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_clock_moves_the_next_one_only_where_the_master_rearms_from_it() {
        let late = Local::ZERO + Span::from_ms(2) + Span::from_us(3);
        for (rearm, next) in [(Rearm::Grid, Span::from_ms(4)), (Rearm::LastSent, Span::from_ms(4) + Span::from_us(3))] {
            let mut clock = CycleClock::new(Span::from_ms(2), Span::from_us(10), rearm, Local::ZERO + Span::from_ms(2));
            assert_eq!(clock.started(late), (0, Local::ZERO + Span::from_ms(2)));
            assert_eq!(clock.planned(), Local::ZERO + next - Span::from_us(10));
            assert_eq!(clock.coming(), 1);
        }
    }

    #[test]
    fn whole_cycles_without_token_are_left_out_and_the_grid_goes_on() {
        let us = |us| Local::ZERO + Span::from_us(us);
        for (back, missed, next) in [(1_500, 0, 2_000), (3_900, 0, 2_000), (3_990, 1, 4_000), (7_000, 2, 6_000)] {
            let mut clock = CycleClock::new(Span::from_ms(2), Span::from_us(10), Rearm::Grid, us(2_000));
            assert_eq!((clock.miss(us(back)), clock.planned()), (missed, us(next - 10)), "token back at {back} us");
            assert_eq!(clock.started(us(next)), (0, us(next)), "numbers count what is sent");
        }
    }
}
