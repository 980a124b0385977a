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
}
