//! Planner: the arithmetic of the bus cycle, without simulating it.
//!
//! ```text
//! t0                                          T_O                    T_I       t0 + T_DP
//! |- T_ID2 -| request | reply |- T_ID1 -| ... | GAP | token | spare |           | SYNCH |
//! |------------------- T_DX ------------------|
//! ```
//! Everything counts from t0, the last bit of SYNCH at the master (Model: D1), and takes the longest T_SDR that each
//! device may need (Model: D2).

use crate::device::profile::Profile;
use crate::fdl::params::BusParams;
use crate::study::scenario::{Bus, Scenario, Slave};
use crate::time::{Span, Tbit};
use crate::wire::Address;

/// SYNCH, a Global_Control of 13 octets.
pub const SYNCH: Tbit = Tbit::of_octets(13);
/// The token, 3 octets.
pub const TOKEN: Tbit = Tbit::of_octets(3);
/// Request of the FDL status, 6 octets.
const STATUS_REQUEST: Tbit = Tbit::of_octets(6);
/// Octets that a Data_Exchange telegram has around its data unit.
const OVERHEAD: usize = 9;

/// One Data_Exchange in the cycle, seen at the master's plug, relative to t0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Slot {
    /// With whom.
    pub slave: Address,
    /// First bit of the request.
    pub request: Span,
    /// Last bit of the request.
    pub request_end: Span,
    /// First bit of the reply at the latest.
    pub reply: Span,
    /// Last bit of the reply at the latest.
    pub reply_end: Span,
}

/// A planned bus cycle.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Plan {
    /// The Data_Exchange of every slave in address order (Model: D6).
    pub slots: Vec<Slot>,
    /// T_DX: from t0 to the last bit of the last reply (Model: D2).
    pub t_dx: Span,
    /// One GAP poll that nobody answers: T_ID1, the request and T_SL.
    pub gap: Span,
    /// One token: T_ID1 and its own length.
    pub token: Span,
    /// SYNCH with the T_ID1 before it.
    pub synch: Span,
}

impl Plan {
    /// Plans the cycle of `scenario`, whether its T_DP can hold it or not.
    pub fn of(scenario: &Scenario) -> Self {
        let bus = &scenario.bus.params;
        let t_id1 = bus.span(bus.t_id1());
        let mut start = bus.span(bus.t_id2());
        let mut slots = Vec::with_capacity(scenario.slaves.len());
        for slave in &scenario.slaves {
            let t_td = crate::sim::bus::cable_delay(slave.position_mm.abs_diff(scenario.master.position_mm));
            let t_sdr = longest_tsdr(bus, slave, scenario.publishes(slave.address));
            let slot = slot(bus, slave, start, t_td * 2 + bus.span(t_sdr));
            start = slot.reply_end + t_id1;
            slots.push(slot);
        }
        Self {
            t_dx: slots.last().map_or(Span::ZERO, |slot| slot.reply_end),
            slots,
            gap: t_id1 + bus.span(STATUS_REQUEST + bus.t_sl),
            token: t_id1 + bus.span(TOKEN),
            synch: t_id1 + bus.span(SYNCH),
        }
    }
    /// What every T_DP must hold: the Data_Exchange, one GAP poll, one token, SYNCH (manual 3.3.2).
    pub fn content(&self) -> Span {
        self.t_dx + self.gap + self.token + self.synch
    }
    /// The shortest T_DP on the grid of `device` that holds the cycle and that the device allows (manual 3.3.2).
    pub fn t_dp_min(&self, device: &Profile) -> Span {
        self.content().max(device.t_dp_min).ceil_to(device.dp_grid())
    }
    /// Smallest T_O of `device` (manual 3.3.6, Model: D3).
    pub fn t_o_min(&self, device: &Profile) -> Span {
        smallest_t_o(self.t_dx, device.t_o_min, device.io_grid())
    }
    /// Largest T_O of `slave` with its T_I in a cycle of `t_dp` (manual 3.3.5, Model: D3). Less than
    /// [`Self::t_o_min`] if there is none.
    pub fn t_o_max(&self, slave: &Slave, t_dp: Span) -> Span {
        floor_to(t_dp - slave.times.t_i - slave.device.gap_min(slave.functions), slave.device.io_grid())
    }
    /// Largest T_I of `slave` with its T_O in a cycle of `t_dp` (manual 3.3.5, Model: D3). Less than
    /// [`Profile::t_i_min`] if there is none.
    pub fn t_i_max(&self, slave: &Slave, t_dp: Span) -> Span {
        floor_to(t_dp - slave.times.t_o - slave.device.gap_min(slave.functions), slave.device.io_grid())
    }
}

/// Smallest T_O on `grid` that exceeds T_DX + T_O_MIN (manual 3.3.6: strictly).
pub const fn smallest_t_o(t_dx: Span, t_o_min: Span, grid: Span) -> Span {
    let bound = t_dx.ticks() + t_o_min.ticks();
    Span::from_ticks((bound.div_euclid(grid.ticks()) + 1) * grid.ticks())
}

/// The longest T_SDR of `slave` [t_bit]: MaxTsdr, or min_TSDR in force where that is more. A publisher's min_TSDR is
/// T_ID1 (Model: D2, D27).
pub fn longest_tsdr(bus: &BusParams, slave: &Slave, publishes: bool) -> Tbit {
    let min_tsdr = if publishes { bus.t_id1() } else { bus.min_tsdr };
    slave.device.max_tsdr(bus.rate).max(min_tsdr)
}

/// The multiple of `grid` not above `span`.
fn floor_to(span: Span, grid: Span) -> Span {
    grid * span.div_floor(grid)
}

/// The Data_Exchange with `slave` whose request begins at `start` and whose reply begins `delay` after its end.
fn slot(bus: &BusParams, slave: &Slave, start: Span, delay: Span) -> Slot {
    let length = |octets: u8| bus.rate.octets(OVERHEAD + usize::from(octets));
    let request_end = start + length(slave.device.outputs);
    let reply = request_end + delay;
    Slot { slave: slave.address, request: start, request_end, reply, reply_end: reply + length(slave.device.inputs) }
}

