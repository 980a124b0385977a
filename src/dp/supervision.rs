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
