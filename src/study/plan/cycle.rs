//! Arithmetic of the bus cycle: every message cycle in it, its shares, and the spans that follow from it.

use super::ring::{self, Visit};
use crate::device::profile::Profile;
use crate::dp::master::Pace;
use crate::fdl::params::BusParams;
use crate::study::scenario::{Scenario, Slave};
use crate::time::{BitRate, Span, Tbit};
use crate::wire::Address;

/// SYNCH, a Global_Control of 13 octets.
pub const SYNCH: Tbit = Tbit::of_octets(13);
/// The token, 3 octets.
pub const TOKEN: Tbit = Tbit::of_octets(3);
/// Request of the FDL status, 6 octets.
pub const STATUS_REQUEST: Tbit = Tbit::of_octets(6);
/// Octets that a Data_Exchange telegram has around its data unit.
const OVERHEAD: usize = 9;
/// Octets that a telegram with SAPs has around its data unit.
const SAP_OVERHEAD: usize = 11;

/// One Data_Exchange in the cycle, seen at the master's plug, relative to t0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Slot {
    /// With whom.
    pub slave: Address,
    /// Length of the request, T_S (t_bit).
    pub t_s: Tbit,
    /// Until the slave answers, T_SDR (t_bit).
    pub t_sdr: Tbit,
    /// Length of the reply, T_R (t_bit).
    pub t_r: Tbit,
    /// Propagation there and back, 2 T_TD.
    pub t_td_both: Span,
    /// First bit of the request.
    pub request: Span,
    /// Last bit of the request.
    pub request_end: Span,
    /// First bit of the reply at the latest.
    pub reply: Span,
    /// Last bit of the reply at the latest.
    pub reply_end: Span,
}

impl Slot {
    /// The message cycle T_MC = T_S + T_SDR + T_R + T_ID1 + 2 T_TD (EN 50170-2; T_ID1 has T_SYN in it, Model: D4).
    pub fn t_mc(&self, bus: &BusParams) -> Span {
        self.reply_end - self.request + bus.span(bus.t_id1())
    }
}

/// A planned bus cycle.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Plan {
    /// The Data_Exchange of every configured slave in address order (Model: D6).
    pub slots: Vec<Slot>,
    /// T_DX: from t0 to the last bit of the last reply (Model: D2).
    pub t_dx: Span,
    /// One GAP poll that nobody answers: T_ID1, the request and T_SL.
    pub gap: Span,
    /// One token: T_ID1 and its own length.
    pub token: Span,
    /// SYNCH with the T_ID1 before it; nothing without SYNCH.
    pub synch: Span,
    /// The token's visit to every other active station, in the order of the file.
    pub visits: Vec<Visit>,
}

impl Plan {
    /// Plans the cycle of `scenario` with the longest T_SDR of every slave, whether its T_DP can hold it or not.
    pub fn of(scenario: &Scenario) -> Self {
        let bus = &scenario.bus.params;
        Self::with(scenario, |slave| {
            let t_td = scenario.t_td(slave.master, slave.address);
            (longest_tsdr(bus, slave, scenario.publishes(slave.address)), t_td * 2)
        })
    }
    /// The cycle as an undisturbed run with perfect crystals has it to the tick: every slave takes its own T_SDR, and
    /// cables and repeaters without jitter delay as [`Scenario::delay`] says.
    pub fn expected(scenario: &Scenario) -> Self {
        let bus = &scenario.bus.params;
        Self::with(scenario, |slave| {
            let t_td = scenario.delay(slave.master, slave.address);
            (slave.t_sdr.max(min_tsdr(bus, scenario.publishes(slave.address))), t_td * 2)
        })
    }
    /// The cycle in which a slave answers after T_SDR and a propagation there and back that `delays` tells.
    fn with(scenario: &Scenario, delays: impl Fn(&Slave) -> (Tbit, Span)) -> Self {
        let bus = &scenario.bus.params;
        let t_id1 = bus.span(bus.t_id1());
        // Without SYNCH a cycle begins with the first request.
        let clocked = scenario.master.pace == Pace::Synch;
        let mut start = if clocked { bus.span(bus.t_id2()) } else { Span::ZERO };
        let mut slots = Vec::with_capacity(scenario.slaves.len());
        for slave in scenario.configured() {
            let slot = slot(bus.rate, slave, start, delays(slave));
            start = slot.reply_end + t_id1;
            slots.push(slot);
        }
        Self {
            t_dx: slots.last().map_or(Span::ZERO, |slot| slot.reply_end),
            slots,
            gap: t_id1 + bus.span(STATUS_REQUEST + bus.t_sl),
            token: t_id1 + bus.span(TOKEN),
            synch: if clocked { t_id1 + bus.span(SYNCH) } else { Span::ZERO },
            visits: ring::visits(scenario, |slave| slot(bus.rate, slave, Span::ZERO, delays(slave)).t_mc(bus)),
        }
    }
    /// T_DX as Set_Prm says it and slaves check it: in whole units of 1/12 us, rounded up.
    pub fn t_dx_told(&self) -> Span {
        self.t_dx.ceil_to(Span::from_iso_units(1))
    }
    /// What every T_DP must hold: the Data_Exchange, one GAP poll, one token, SYNCH (manual 3.3.2), and the shortest
    /// visit of the token to every other active station.
    pub fn content(&self) -> Span {
        self.own() + self.visits.iter().map(|visit| visit.least).sum::<Span>()
    }
    /// The content without other active stations.
    pub fn own(&self) -> Span {
        self.t_dx + self.gap + self.token + self.synch
    }
    /// What a cycle of `t_dp` has left; negative if it cannot hold its content.
    pub fn spare(&self, t_dp: Span) -> Span {
        t_dp - self.content()
    }
    /// The slot of the slave at `address`.
    pub fn slot(&self, address: Address) -> Option<&Slot> {
        self.slots.iter().find(|slot| slot.slave == address)
    }
    /// The longest of a slave's Data_Exchange repeated once because nothing came: T_S + T_SL + T_ID1 (Model: D7).
    pub fn repeat(&self, bus: &BusParams) -> Span {
        let request = self.slots.iter().map(|slot| slot.t_s).max().unwrap_or_default();
        bus.span(request + bus.t_sl + bus.t_id1())
    }
    /// The Global_Control that tells the mode, in the acyclic part: T_ID1, its length, T_ID2 instead of the T_ID1 after
    /// it (Model: D5).
    pub fn mode(&self, bus: &BusParams) -> Span {
        bus.span(SYNCH + bus.t_id2())
    }
    /// An acyclic message with data units of `request` and `reply` octets behind SAPs, at its longest: T_ID1, the
    /// request, max T_SDR and the reply, or T_SL where nothing comes.
    pub fn acyclic(&self, bus: &BusParams, request: usize, reply: usize) -> Span {
        bus.span(bus.t_id1()) + service(bus, request, reply)
    }
    /// What T_DP must hold while `slave` starts up and all others exchange data: its longest service, which is its Set_Prm
    /// of `octets` or its Slave_Diag of Max_Diag_Data_Len, one token, SYNCH. Model: D6, the service must end before SYNCH.
    pub fn start_up(&self, scenario: &Scenario, slave: &Slave, octets: usize) -> Span {
        let bus = &scenario.bus.params;
        let own = self.slot(slave.address).map_or(Span::ZERO, |slot| slot.reply_end - slot.request);
        let longest = service(bus, octets, 0).max(service(bus, 0, slave.device.max_diag.into()));
        self.t_dx - own + longest + self.token + self.synch
    }
    /// The shortest T_DP on the grid of `device` that holds the cycle and that the device allows (manual 3.3.2).
    pub fn t_dp_min(&self, device: &Profile) -> Span {
        self.content().max(device.t_dp_min).ceil_to(device.dp_grid())
    }
    /// Smallest T_O of `device` (manual 3.3.6, Model: D3).
    pub fn t_o_min(&self, device: &Profile) -> Span {
        smallest_t_o(self.t_dx_told(), device.t_o_min, device.io_grid())
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
    /// T_M, from when on the master application may compute: all inputs of the cycle are there (T_DX). What follows
    /// until the set points must be ready at the last bit of a SYNCH is [`computing_time`].
    pub const fn t_m(&self) -> Span {
        self.t_dx
    }
    /// A cycle of a master without SYNCH, alone in the ring: from the first bit of the first request to that of the next
    /// cycle. Data_Exchange with every slave, then the token or the GAP poll and the token, each with T_ID1 after it
    /// (Model: D6 without its clock). The next cycle begins no earlier than its least cycle time and Min_Slave_Interval
    /// of every slave, from its request on, allow: a master does not wait with the token.
    pub fn free_running(&self, scenario: &Scenario) -> FreeRunning {
        let bus = &scenario.bus.params;
        let interval = |slot: &Slot| Some(scenario.slave(slot.slave)?.min_slave_interval());
        let least_cycle = match scenario.master.pace {
            Pace::Free { least } => least,
            Pace::Synch => Span::ZERO,
        };
        FreeRunning {
            exchange: self.slots.iter().map(|slot| slot.t_mc(bus)).sum(),
            token: bus.span(bus.t_tc()),
            gap: bus.span(STATUS_REQUEST + bus.t_sl + bus.t_id1()),
            least_cycle,
            intervals: self.slots.iter().filter_map(interval).max().unwrap_or_default(),
        }
    }
}

/// The cycle of a network without SYNCH, from the first request of a master alone to the next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FreeRunning {
    /// The message cycle of every Data_Exchange.
    pub exchange: Span,
    /// The token and T_ID1, T_TC.
    pub token: Span,
    /// A GAP poll that nobody answers and T_ID1, at every G-th token visit.
    pub gap: Span,
    /// From the start of one cycle to the next at least, as the master was told.
    pub least_cycle: Span,
    /// The same, the longest Min_Slave_Interval of the slaves.
    pub intervals: Span,
}

impl FreeRunning {
    /// What keeps the bus busy in a cycle without a GAP poll.
    pub fn busy(&self) -> Span {
        self.exchange + self.token
    }
    /// From the start of one cycle to the next at least, whatever it holds.
    pub fn least(&self) -> Span {
        self.least_cycle.max(self.intervals)
    }
    /// The cycle without a GAP poll.
    pub fn cycle(&self) -> Span {
        self.cycle_with(Span::ZERO)
    }
    /// The cycle with a GAP poll.
    pub fn with_gap(&self) -> Span {
        self.cycle_with(self.gap)
    }
    /// The cycle with `more` on the bus, such as an acyclic message.
    pub fn cycle_with(&self, more: Span) -> Span {
        (self.busy() + more).max(self.least())
    }
    /// Silence at the end of a cycle with `more` on the bus.
    pub fn pause(&self, more: Span) -> Span {
        self.cycle_with(more) - self.busy() - more
    }
}

/// What the master application has to compute, every T_MAPC = `t_mapc` x T_DP: from T_M to the last bit of the SYNCH of
/// the cycle that takes the set points along.
pub fn computing_time(plan: &Plan, t_dp: Span, t_mapc: u8) -> Span {
    t_dp * i64::from(t_mapc) - plan.t_m()
}

/// The dead time from a latch to the set point that it led to:
///
/// ```text
/// T_I + T_MAPC x T_DP + T_O
/// ```
///
/// The position is latched T_I before the cycle in which it travels; the master application computes from T_DX on for
/// T_MAPC cycles at most; the set point travels in the cycle after that and is in force T_O after its start (manual
/// 3.3.3, 3.3.5, 3.3.6, Model: D8, D10).
pub fn dead_time(t_i: Span, t_o: Span, t_dp: Span, t_mapc: u8) -> Span {
    t_i + t_dp * i64::from(t_mapc) + t_o
}

/// The message cycle of one Data_Exchange (t_bit): `outputs` octets there, `inputs` octets back, T_ID1 after it, no
/// cable (EN 50170-2, Model: D4). Published estimates that add T_SYN = 33 t_bit once more count it twice.
pub fn message_cycle(bus: &BusParams, outputs: usize, inputs: usize, t_sdr: Tbit) -> Tbit {
    Tbit::of_octets(2 * OVERHEAD + outputs + inputs) + t_sdr + bus.t_id1()
}

/// Smallest T_O on `grid` that exceeds T_DX + T_O_MIN (manual 3.3.6: strictly).
pub const fn smallest_t_o(t_dx: Span, t_o_min: Span, grid: Span) -> Span {
    let bound = t_dx.ticks() + t_o_min.ticks();
    Span::from_ticks((bound.div_euclid(grid.ticks()) + 1) * grid.ticks())
}

/// min_TSDR that Set_Prm tells a slave (t_bit); a publisher's is T_ID1 (Model: D27).
pub fn min_tsdr(bus: &BusParams, publishes: bool) -> Tbit {
    if publishes { bus.t_id1() } else { bus.min_tsdr }
}

/// The longest T_SDR of `slave` (t_bit): MaxTsdr, or min_TSDR in force where that is more (Model: D2, D27).
pub fn longest_tsdr(bus: &BusParams, slave: &Slave, publishes: bool) -> Tbit {
    slave.device.max_tsdr(bus.rate).max(min_tsdr(bus, publishes))
}

/// A service with data units of `request` and `reply` octets behind SAPs, from its first bit to its end at the latest.
pub(super) fn service(bus: &BusParams, request: usize, reply: usize) -> Span {
    let answer = bus.span(bus.max_tsdr) + bus.rate.octets(SAP_OVERHEAD + reply);
    bus.rate.octets(SAP_OVERHEAD + request) + answer.max(bus.span(bus.t_sl))
}

/// The multiple of `grid` not above `span`.
fn floor_to(span: Span, grid: Span) -> Span {
    grid * span.div_floor(grid)
}

/// The Data_Exchange with `slave` whose request begins at `start`, with its T_SDR and propagation there and back.
fn slot(rate: BitRate, slave: &Slave, start: Span, (t_sdr, t_td_both): (Tbit, Span)) -> Slot {
    let length = |octets: u8| Tbit::of_octets(OVERHEAD + usize::from(octets));
    let (t_s, t_r) = (length(slave.device.outputs), length(slave.device.inputs));
    let request_end = start + rate.span(t_s);
    let reply = request_end + t_td_both + rate.span(t_sdr);
    let reply_end = reply + rate.span(t_r);
    Slot { slave: slave.address, t_s, t_sdr, t_r, t_td_both, request: start, request_end, reply, reply_end }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::profile::find;
    use crate::study::scenario::tests::network;
    use crate::study::scenario::{Link, Master};
    use crate::time::BitRate;

    const GRID: Span = Span::from_us(125);

    /// T_DX (us) of n encoders by rate, longest T_SDR as in the profile and as in a fast ASIC's GSD.
    #[test]
    fn worked_values_of_t_dx() {
        let table = [
            (BitRate::M1_5, [449.0, 823.0, 1_197.0, 3_067.0], [366.0, 657.0, 947.0, 2_401.0]),
            (BitRate::M3, [291.0, 515.0, 738.0, 1_855.0], [225.0, 381.0, 538.0, 1_321.0]),
            (BitRate::M6, [212.0, 359.0, 506.0, 1_240.0], [154.0, 243.0, 331.0, 774.0]),
            (BitRate::M12, [164.5, 268.7, 372.8, 894.0], [114.5, 168.7, 222.8, 494.0]),
        ];
        for (rate, profile, fast) in table {
            for (device, row) in [("posital-ocd-dpb1b", profile), ("simodrive-sensor-isochron", fast)] {
                for (n, us) in [1, 2, 3, 8].into_iter().zip(row) {
                    let t_dx = Plan::of(&network(rate, find(device).unwrap(), n)).t_dx.as_us();
                    assert!((t_dx - us).abs() < 0.51, "{n} x {device} at {rate}: {t_dx} us, expected {us}");
                }
            }
        }
    }

    /// Three fast encoders at 12 Mbit/s need 2674 units of 1/12 us.
    #[test]
    fn t_dx_is_exact() {
        let network = network(BitRate::M12, find("simodrive-sensor-isochron").unwrap(), 3);
        assert_eq!(Plan::of(&network).t_dx, Span::from_iso_units(2_674));
    }

    /// Manual 6.4.2, dialog "Clocking": one encoder at 1.5 Mbit/s gets a smallest T_O of 0.625 ms and T_I of 0.125 ms.
    #[test]
    fn clocking_dialog_of_the_manual() {
        let device = find("scancon-sag-dpb1b").unwrap();
        let plan = Plan::of(&network(BitRate::M1_5, device, 1));
        assert_eq!(plan.t_dx, BitRate::M1_5.span(Tbit(674)));
        assert_eq!(plan.t_o_min(device), Span::from_us(625));
        assert_eq!(device.t_i_min(false), Span::from_us(125));
    }

    /// SINAMICS S120 manual: T_DX 300 us and T_O_MIN 125 us make T_O 500 us, with > as with >=.
    #[test]
    fn reference_times_of_a_drive() {
        let (t_dx, t_o_min) = (Span::from_us(300), Span::from_us(125));
        assert_eq!(smallest_t_o(t_dx, t_o_min, GRID), Span::from_us(500));
        assert_eq!((t_dx + t_o_min).ceil_to(GRID), Span::from_us(500));
    }

    #[test]
    fn t_o_exceeds_its_bound_strictly() {
        assert_eq!(smallest_t_o(Span::from_us(250), GRID, GRID), Span::from_us(500));
        assert_eq!(smallest_t_o(Span::from_us(250) - Span::from_ticks(1), GRID, GRID), Span::from_us(375));
    }

    /// A T_DX within the last 1/12 us before a point of the grid counts as that point, as the slave will see it.
    #[test]
    fn t_o_exceeds_the_t_dx_that_slaves_are_told() {
        let device = find("posital-ocd-dpb1b").unwrap();
        let mut plan = Plan::of(&network(BitRate::M12, device, 1));
        plan.t_dx = Span::from_us(1_500) - Span::from_ticks(1);
        assert_eq!((plan.t_dx_told(), plan.t_o_min(device)), (Span::from_us(1_500), Span::from_us(1_750)));
        plan.t_dx = Span::from_us(1_500) - Span::from_iso_units(1);
        assert_eq!((plan.t_dx_told(), plan.t_o_min(device)), (plan.t_dx, Span::from_us(1_625)));
    }

    #[test]
    fn slots_follow_each_other_after_t_id1() {
        let mut network = network(BitRate::M12, find("posital-ocd-dpb1b").unwrap(), 2);
        // 100 m are 500 ns, 6 t_bit, there and back 12.
        network.slaves[1].position_mm = 100_000;
        let plan = Plan::of(&network);
        let tbit = |span: Span| span.div_floor(BitRate::M12.bit());
        let slots: Vec<_> =
            plan.slots.iter().map(|s| [s.request, s.request_end, s.reply, s.reply_end].map(tbit)).collect();
        assert_eq!(slots, [[800, 943, 1_743, 1_974], [2_050, 2_193, 3_005, 3_236]]);
        assert_eq!(tbit(plan.content()), 3_236 + (76 + 66 + 1_000) + (76 + 33) + (76 + 143));
    }

    /// At 1.5 Mbit/s: a Set_Prm of 59 octets and T_SL take 770 + 300 t_bit, a Slave_Diag of 6 octets 121 + 337, one of
    /// 244 octets 121 + 150 + 2805.
    #[test]
    fn the_longest_service_of_a_start_up_is_set_prm_or_a_long_diagnosis() {
        let mut network = network(BitRate::M1_5, find("simodrive-sensor-isochron").unwrap(), 1);
        let plan = Plan::of(&network);
        let usual = plan.start_up(&network, &network.slaves[0], 59);
        let device = Profile { max_diag: 244, ..Profile::clone(&network.slaves[0].device) };
        network.slaves[0].device = device.into();
        let long = plan.start_up(&network, &network.slaves[0], 59);
        assert_eq!(long - usual, BitRate::M1_5.span(Tbit(121 + 150 + 2_805 - 770 - 300)));
    }

    #[test]
    fn a_silent_station_takes_no_time() {
        let mut network = network(BitRate::M12, find("posital-ocd-dpb1b").unwrap(), 3);
        let all = Plan::of(&network);
        network.slaves[1].silent = true;
        let plan = Plan::of(&network);
        assert_eq!(plan.slots.iter().map(|slot| slot.slave.get()).collect::<Vec<_>>(), [3, 5]);
        assert_eq!(all.slots[..2].iter().map(|slot| slot.reply_end).max(), Some(plan.t_dx));
    }

    #[test]
    fn a_publisher_waits_at_least_t_id1() {
        let mut network = network(BitRate::M1_5, find("simodrive-sensor-isochron").unwrap(), 1);
        let alone = Plan::of(&network).t_dx;
        let publisher = network.slaves[0].address;
        network.links.push(Link::of(publisher, Address::new(9).unwrap(), 4, 4));
        assert_eq!(Plan::of(&network).t_dx - alone, BitRate::M1_5.span(Tbit(37 - 25)));
    }

    #[test]
    fn ranges_of_t_o_and_t_i_meet_the_gap_rule() {
        let device = find("posital-ocd-dpb1b").unwrap();
        let mut network = network(BitRate::M12, device, 1);
        let plan = Plan::of(&network);
        let Master { t_dp, .. } = network.master;
        let slave = &mut network.slaves[0];
        for functions in [false, true] {
            slave.functions = functions;
            slave.times.t_i = device.t_i_min(functions);
            slave.times.t_o = plan.t_o_max(slave, t_dp);
            assert_eq!(t_dp - slave.times.t_i - slave.times.t_o, device.gap_min(functions));
            assert_eq!(plan.t_i_max(slave, t_dp), slave.times.t_i);
        }
        assert_eq!(plan.t_dp_min(device), Span::from_us(500));
    }
}
