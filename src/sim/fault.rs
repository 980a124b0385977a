//! What goes wrong on the line: which telegrams never get there.
//!
//! A disturbance changes octets and instants, never a machine. It is decided once per telegram, from the cycle, the
//! sender and the octets alone, so a disturbance of one station leaves every other telegram as it was.

use crate::wire::{self, Address, FrameControl, Telegram};

/// One disturbance of the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Disturbance {
    /// The master's SYNCH never gets onto the line.
    MissingClocks {
        /// In which cycles: those that the lost SYNCH would have begun.
        bursts: Bursts,
    },
    /// Telegrams never get onto the line.
    LostTelegrams {
        /// Only those of this station.
        from: Option<Address>,
        /// Only those to this station.
        to: Option<Address>,
        /// Only those of this service.
        service: Service,
        /// In which cycles.
        bursts: Bursts,
    },
}

/// Which telegrams a disturbance means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Service {
    /// Requests and replies without SAPs.
    DataExchange,
    /// All but SYNCH.
    Any,
}

/// Cycles in which something happens: `count` from `from_cycle` on, and again every `every` cycles.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bursts {
    /// First cycle.
    pub from_cycle: u64,
    /// Cycles in a row.
    pub count: u64,
    /// Distance from burst to burst (cycles); none for a single burst.
    pub every: Option<u64>,
}

impl Bursts {
    /// Whether `cycle` belongs to a burst.
    pub const fn contains(&self, cycle: u64) -> bool {
        let Some(since) = cycle.checked_sub(self.from_cycle) else { return false };
        match self.every {
            Some(every) => since % every < self.count,
            None => since < self.count,
        }
    }
}

impl Disturbance {
    /// Whether this telegram is lost. `clock` marks SYNCH; `cycle` is the running cycle, for SYNCH the one it begins.
    pub fn loses(&self, cycle: u64, sender: Address, clock: bool, octets: &[u8]) -> bool {
        match *self {
            Self::MissingClocks { bursts } => clock && bursts.contains(cycle),
            Self::LostTelegrams { from, to, service, bursts } => {
                !clock
                    && bursts.contains(cycle)
                    && from.is_none_or(|from| from == sender)
                    && service.means(octets)
                    && to.is_none_or(|to| destination(octets) == Some(to))
            }
        }
    }
}

impl Service {
    fn means(self, octets: &[u8]) -> bool {
        match self {
            Self::Any => true,
            Self::DataExchange => match Telegram::parse(octets) {
                // A status request has no SAPs either.
                Ok(Telegram::Data { header, .. }) => {
                    header.dsap.is_none()
                        && match header.fc {
                            FrameControl::Request { service, .. } => {
                                !matches!(service, wire::Service::FdlStatus | wire::Service::Ident)
                            }
                            FrameControl::Response { .. } => true,
                        }
                }
                _ => false,
            },
        }
    }
}

fn destination(octets: &[u8]) -> Option<Address> {
    match Telegram::parse(octets) {
        Ok(Telegram::Data { header, .. }) => Some(header.da),
        Ok(Telegram::Token { da, .. }) => Some(da),
        _ => None,
    }
}
