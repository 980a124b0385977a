//! Supervision of the operation mode: when the master changes to Operate on its own, and when back to Clear.
//!
//! | mode | input | Error_Action_Flag off | Error_Action_Flag on |
//! |---|---|---|---|
//! | Clear | cycle `clear_for` begins | Operate | Operate as soon as all slaves exchange data, once |
//! | Clear | ordered mode | as ordered | as ordered, and no Operate on its own any more |
//! | Operate | a slave without Data_Exchange for Data_Control_Time | Operate | Clear (AutoClear) |
//! | Clear after AutoClear | all slaves exchange data | - | Clear: only an order brings Operate back |
//!
//! Source: EN 50170-2, Error_Action_Flag and Data_Control_Time of the master's parameters. Model: the time runs from a
//! slave's last good answer to Data_Exchange, but not from before Operate; it is looked at when a cycle begins. That
//! outputs do not come back by themselves after AutoClear is the careful reading, since the sources say nothing.

use crate::dp::handler::Handler;
use crate::observation::MasterMode;
use crate::time::{Local, Span};

/// What decides on the master's mode besides orders.
#[derive(Clone, Copy, Debug)]
pub struct Supervision {
    /// Error_Action_Flag.
    auto_clear: bool,
    data_control_time: Span,
    /// Cycles in Clear before Operate.
    clear_for: u64,
    /// Operate does not come on its own any more.
    settled: bool,
    /// Start of the last cycle that did not begin in Operate.
    since: Local,
}

impl Supervision {
    /// The supervision of a master that has not begun.
    pub const fn new(auto_clear: bool, data_control_time: Span, clear_for: u64) -> Self {
        Self { auto_clear, data_control_time, clear_for, settled: false, since: Local::ZERO }
    }
    /// The master starts over.
    pub const fn restart(&mut self) {
        self.settled = false;
    }
    /// A mode was ordered.
    pub const fn ordered(&mut self) {
        self.settled |= self.auto_clear;
    }
    /// A cycle begins at `now` in this mode. The mode that it shall have, and the slave that is to blame for AutoClear.
    pub fn cycle(
        &mut self,
        now: Local,
        cycle: u64,
        mode: MasterMode,
        handlers: &[Handler],
    ) -> (MasterMode, Option<usize>) {
        if mode != MasterMode::Operate {
            self.since = now;
        } else if self.auto_clear
            && let Some(slave) = handlers.iter().position(|handler| self.is_overdue(now, handler))
        {
            return (MasterMode::Clear, Some(slave));
        }
        let ready = !self.auto_clear || handlers.iter().all(Handler::exchanges);
        if self.settled || cycle < self.clear_for || !ready {
            return (mode, None);
        }
        self.settled = true;
        (if mode == MasterMode::Clear { MasterMode::Operate } else { mode }, None)
    }
    fn is_overdue(&self, now: Local, handler: &Handler) -> bool {
        let last = handler.exchanged_at().map_or(self.since, |at| at.max(self.since));
        now - last >= self.data_control_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dp::handler::{Answer, SlaveParams};
    use crate::fdl::Outbox;
    use crate::wire::Address;

    const T_DP: Span = Span::from_ms(1);
    const TIME: Span = Span::from_ms(20);

    /// Two slaves, of which so many exchange data since time 0.
    fn handlers(exchanging: usize) -> [Handler; 2] {
        let params = |address| SlaveParams {
            address: Address::new(address).unwrap(),
            prm: alloc::vec![1],
            cfg: alloc::vec![2],
            outputs: 4,
            inputs: 12,
            publisher: false,
            fail_safe: true,
            get_cfg: false,
            max_diag: 6,
            min_interval: Span::ZERO,
            ms1_timeout: Span::from_s(10),
        };
        let mut handlers = [3, 4].map(|address| Handler::new(params(address)));
        let ready = Answer::Data(&[0x00, 0x0C, 0x00, 0x02, 0x80, 0xF9]);
        for handler in &mut handlers[..exchanging] {
            for answer in [ready, Answer::Acknowledged, Answer::Acknowledged, ready] {
                handler.answered(answer, &mut Outbox::new());
            }
            handler.exchanged(Local::ZERO, false, &mut Outbox::new());
            assert!(handler.exchanges());
        }
        handlers
    }
    fn at(cycle: u64) -> Local {
        Local::ZERO + T_DP * cycle as i64
    }

    #[test]
    fn operate_comes_after_its_cycles_and_with_the_flag_after_the_last_slave() {
        use MasterMode::{Clear, Operate};
        for (auto_clear, exchanging, expected) in
            [(false, 0, Operate), (false, 2, Operate), (true, 1, Clear), (true, 2, Operate)]
        {
            let mut supervision = Supervision::new(auto_clear, TIME, 3);
            let handlers = handlers(exchanging);
            for cycle in 0..6 {
                let mode = supervision.cycle(at(cycle), cycle, Clear, &handlers).0;
                // Once it came, a mode is ordered and kept.
                let due = cycle == 3 || (cycle > 3 && expected == Clear);
                assert_eq!(mode, if due { expected } else { Clear }, "{auto_clear} {exchanging} cycle {cycle}");
            }
            supervision.restart();
            assert_eq!(supervision.cycle(at(9), 9, Clear, &handlers).0, expected);
        }
    }

    #[test]
    fn an_ordered_clear_is_not_undone_once_all_exchange_data() {
        let mut supervision = Supervision::new(true, TIME, 0);
        supervision.ordered();
        assert_eq!(supervision.cycle(at(0), 0, MasterMode::Clear, &handlers(2)).0, MasterMode::Clear);
    }

    #[test]
    fn a_slave_that_is_gone_for_the_time_brings_clear_for_good() {
        use MasterMode::{Clear, Operate};
        let mut all = handlers(2);
        for (auto_clear, expected) in [(false, (Operate, None)), (true, (Clear, Some(1)))] {
            let mut supervision = Supervision::new(auto_clear, TIME, 0);
            assert_eq!(supervision.cycle(at(0), 0, Clear, &all), (Operate, None));
            assert_eq!(supervision.cycle(at(19), 19, Operate, &all), (Operate, None));
            all[0].exchanged(at(19), false, &mut Outbox::new());
            assert_eq!(supervision.cycle(at(20), 20, Operate, &all), expected);
            if auto_clear {
                assert_eq!(supervision.cycle(at(21), 21, Clear, &all), (Clear, None), "both exchange data, no order");
                // Ordered back, the time begins anew.
                for (cycle, mode) in [(22, Operate), (40, Operate), (41, Clear)] {
                    assert_eq!(supervision.cycle(at(cycle), cycle, Operate, &all).0, mode, "cycle {cycle}");
                }
            }
        }
    }
}
