//! What goes wrong on the line: which telegrams never get there.
//!
//! It is decided once per telegram, from the instant, the sender and the octets alone, so a disturbance of one station
//! leaves every other telegram as it was.

use crate::sim::fault::window::Window;
use crate::wire::{self, Address, FrameControl, Telegram};

/// A disturbance of the line at work.
#[derive(Clone, Debug)]
pub(super) struct OnLine {
    /// Number of the disturbance in the scenario, from 0.
    pub number: u16,
    /// When it acts.
    pub window: Window,
    /// What it does.
    pub fault: LineFault,
}

/// What a disturbance does to telegrams.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LineFault {
    /// The master's SYNCH never gets onto the line.
    MissingClocks,
    /// Telegrams never get onto the line.
    LostTelegrams {
        /// Only those of this station.
        from: Option<Address>,
        /// Only those to this station.
        to: Option<Address>,
        /// Only those of this service.
        service: Service,
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

impl LineFault {
    /// Whether this telegram is lost. `clock` marks SYNCH.
    pub fn loses(&self, sender: Address, clock: bool, octets: &[u8]) -> bool {
        match *self {
            Self::MissingClocks => clock,
            Self::LostTelegrams { from, to, service } => {
                !clock
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
