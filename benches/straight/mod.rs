//! The straight loop: what a network of encoders computes in a cycle, with the same octets, written as one loop.
//!
//! No queue, no stations, no bus and no recorder: the loop knows in which order everything happens. What it leaves out
//! on purpose is what no result depends on: timers that never come due (slot time, watchdog, clock window), the search
//! for the next event, the question who listens, GAP polls, the repeated Operate and the LEDs. What it does, per slave and cycle:
//!
//! | part | with |
//! |---|---|
//! | SYNCH read, arrival by the slave's crystal, clock recovery | `wire`, `sim::crystal`, `device::pll` |
//! | request: sign of life, frame written, read, FCB told apart | `device::sign_of_life`, `wire` |
//! | reply: latched words, frame written, read, sign of life checked | `wire`, `device::sign_of_life` |
//! | T_O: the master's sign of life compared, sensor handshake | `device::sign_of_life`, `device::sensor` |
//! | T_I: true instant, shaft, position words | `sim::crystal`, `sim::motion`, `device::position` |
//! | histograms of the latch offset and the clock's error | `study::histogram` |
//!
//! and once per cycle: the jitter's draw, SYNCH written, the token written, the five histograms of the network.
//!
//! A loop without octets hands the same values over as numbers.

pub(crate) mod check;
pub(crate) mod effort;
pub(crate) mod encoders;

use encoders::StartUp;
use isodp::device::pll::{Pll, PllSettings};
use isodp::device::position::{CodeSequence, Position};
use isodp::device::sensor::{Faults, Sensor, SensorOptions, Xist1, Xist2};
use isodp::device::sign_of_life::{Counter, Monitor, MonitorSettings};
use isodp::dp::GLOBAL_CONTROL;
use isodp::observation::ClockVerdict;
use isodp::sim::crystal::Crystal;
use isodp::sim::jitter::JitterSource;
use isodp::sim::motion::{Resolution, Shaft};
use isodp::study::histogram::{Histogram, Quantity};
use isodp::study::scenario::{self, Scenario};
use isodp::time::{Local, Span, Time};
use isodp::wire::control::GlobalControl;
use isodp::wire::drive::{G1Stw, G1Zsw, Inputs81, Outputs81, SignOfLife, Stw2, Zsw2};
use isodp::wire::{Address, Fcb, Frame, FrameControl, Header, Service, Status, Telegram};
use std::hint::black_box;

/// Octets of a Data_Exchange request, of its reply and of the token.
const REQUEST: usize = 13;
const REPLY: usize = 21;
const TOKEN: usize = 3;
/// Octets of SYNCH.
const SYNCH: usize = 13;
/// Tolerated failures of a slave's sign of life (Model: D17).
const TOLERANCE: u16 = 4;

/// Sees what the loop does. `()` sees nothing and costs nothing.
pub(crate) trait Witness {
    /// The last bit of a telegram left its sender.
    fn telegram(&mut self, _sender: Address, _end: Time, _octets: &[u8]) {}
    /// A slave's clock recovery judged a SYNCH.
    fn clock(&mut self, _slave: Address, _error: Span) {}
    /// T_O came: the two signs of life.
    fn set_point(&mut self, _slave: Address, _mls: u8, _sls: u8) {}
    /// The position was latched.
    fn latch(&mut self, _slave: Address, _at: Time, _inputs: &Inputs81) {}
}
impl Witness for () {}

/// The loop, and all that it knows. With `OCTETS`, every telegram is written and read.
pub(crate) struct Straight<const OCTETS: bool> {
    master: Address,
    crystal: Crystal,
    jitter: JitterSource,
    times: Times,
    /// Number and grid point of the coming cycle.
    cycle: u64,
    nominal: Local,
    /// Start of the cycle before.
    before: Option<Time>,
    /// SYNCH, and the telegram that is on the line.
    synch: Frame,
    frame: Frame,
    slaves: Vec<Slave>,
    records: Records,
    /// What the master has received, so that nothing is left out as unused.
    pub(crate) received: u64,
}

/// Spans that all slaves share.
#[derive(Clone, Copy)]
struct Times {
    t_dp: Span,
    t_i: Span,
    t_id1: Span,
    t_id2: Span,
    synch: Span,
    request: Span,
    reply: Span,
    token: Span,
}

/// The histograms of the whole network.
pub(crate) struct Records {
    pub(crate) latch_skew: Histogram,
    pub(crate) gc_jitter: Histogram,
    pub(crate) t_dp_deviation: Histogram,
    pub(crate) t_dx: Histogram,
    pub(crate) spare: Histogram,
}

/// A slave, and what its master keeps of it.
struct Slave {
    address: Address,
    delay: Span,
    crystal: Crystal,
    shaft: Shaft,
    resolution: Resolution,
    counts_per_rev: f64,
    position: Position,
    pll: Pll,
    life: Monitor,
    own: Counter,
    sensor: Sensor,
    t_sdr: Span,
    /// FCB of the last request.
    seen: Option<bool>,
    outputs: Outputs81,
    inputs: Inputs81,
    axis: Axis,
    /// Cycle of the first SYNCH that counts.
    clock: u64,
    latch_offset: Histogram,
    pll_error: Histogram,
}

/// The master's part of a slave.
struct Axis {
    fcb: Fcb,
    sign: Counter,
    monitor: Monitor,
    /// First cycle with a Data_Exchange.
    joined: u64,
}

/// The smallest and the largest latch offset of a cycle, as time and in counts [steps].
struct Skew {
    locked: u32,
    low: Span,
    high: Span,
    low_counts: f64,
    high_counts: f64,
}

fn empty(name: &str) -> Histogram {
    let quantity = Quantity::named(name).expect("a quantity of the histograms");
    Histogram::new(quantity.limit, quantity.signed)
}

impl Records {
    fn new() -> Self {
        let [latch_skew, gc_jitter, t_dp_deviation, t_dx, spare] =
            ["latch_skew", "gc_jitter", "t_dp_deviation", "t_dx", "spare"].map(empty);
        Self { latch_skew, gc_jitter, t_dp_deviation, t_dx, spare }
    }
}

impl Times {
    fn of(scenario: &Scenario) -> Self {
        let bus = &scenario.bus.params;
        let times = scenario.slaves[0].times;
        Self {
            t_dp: scenario.master.t_dp,
            t_i: times.t_i,
            t_id1: bus.span(bus.t_id1()),
            t_id2: bus.span(bus.t_id2()),
            synch: bus.rate.octets(SYNCH),
            request: bus.rate.octets(REQUEST),
            reply: bus.rate.octets(REPLY),
            token: bus.rate.octets(TOKEN),
        }
    }
}

impl Slave {
    fn new(scenario: &Scenario, slave: &scenario::Slave, start: &StartUp) -> Self {
        let bus = &scenario.bus.params;
        let profile = &slave.device;
        let (steps, revolutions) = (profile.steps_per_rev, profile.revolutions);
        let times = slave.times;
        let settings = PllSettings::new(scenario.master.t_dp, times.t_pll_w, times.t_pll_d);
        let mut pll = Pll::new(PllSettings { tolerance: slave.options.clock_tolerance, ..settings });
        pll.start();
        let told = start.station(slave.address);
        Self {
            address: slave.address,
            delay: scenario.delay(slave.address, scenario.master.address),
            crystal: told.crystal().clone(),
            shaft: Shaft::new(&slave.motion).expect("a checked motion"),
            resolution: Resolution::new(steps, revolutions).expect("a profile's disc"),
            counts_per_rev: f64::from(steps),
            position: Position::new(steps, revolutions, CodeSequence::Cw, None).expect("an unscaled disc"),
            pll,
            life: Monitor::new(MonitorSettings::new(scenario.master.t_mapc, slave.max_life_failures.into())),
            own: Counter::new(),
            sensor: Sensor::new(SensorOptions::default()),
            t_sdr: bus.span(slave.t_sdr.max(bus.min_tsdr)),
            seen: None,
            outputs: Outputs81::default(),
            inputs: Inputs81::default(),
            axis: Axis {
                fcb: told.fcb(),
                sign: Counter::new(),
                monitor: Monitor::new(MonitorSettings::new(1, TOLERANCE)),
                joined: told.joined,
            },
            clock: told.clock(),
            latch_offset: empty("latch_offset"),
            pll_error: empty("pll_error"),
        }
    }

    /// SYNCH, whose last bit left the master at `t0`.
    fn clock(&mut self, t0: Time, witness: &mut impl Witness) {
        let Some(judged) = self.pll.synch(self.crystal.to_local(t0 + self.delay)) else { return };
        if matches!(judged.verdict, ClockVerdict::Hit | ClockVerdict::Outside) {
            self.pll_error.record(judged.error);
        }
        witness.clock(self.address, judged.error);
    }

    /// A new request, not a repeated one.
    fn takes(&mut self, fcb: Fcb) -> bool {
        let Fcb::Alternate(bit) = fcb else { return false };
        self.seen.replace(bit) != Some(bit)
    }

    /// T_O: the outputs take effect. What the latch of this cycle will say beside the position.
    fn set_point(&mut self, witness: &mut impl Witness) -> (Inputs81, Xist1, Xist2) {
        let mls = SignOfLife::from_word(self.outputs.stw2.0).get();
        self.life.cycle(mls);
        let sls = self.own.cycle(self.life.is_synchronised());
        witness.set_point(self.address, mls, sls.get());
        let answer = self.sensor.cycle(self.outputs.g1_stw.0, Faults::NONE);
        let inputs = Inputs81 { zsw2: Zsw2(sls.to_word()), g1_zsw: G1Zsw(answer.zsw), ..Inputs81::default() };
        (inputs, answer.xist1, answer.xist2)
    }

    /// T_O and the latch of this cycle.
    fn cycle(&mut self, times: &Times, grid: Time, skew: &mut Skew, witness: &mut impl Witness) {
        let (true, Some(next)) = (self.pll.is_locked(), self.pll.next_edge()) else { return };
        let (mut inputs, xist1, xist2) = self.set_point(witness);
        let at = self.crystal.to_true(next - times.t_i);
        let value = self.position.value(self.resolution.raw(self.shaft.angle(at)));
        inputs.xist1 = if xist1 == Xist1::Position { self.position.xist1(value) } else { 0 };
        inputs.xist2 = match xist2 {
            Xist2::Zero => 0,
            Xist2::Position => self.position.xist2(value),
            Xist2::Code(code) => code.into(),
        };
        self.inputs = inputs;
        let offset = at - grid;
        self.latch_offset.record(offset);
        skew.add(offset, offset.as_s() * self.shaft.speed(at) * self.counts_per_rev);
        witness.latch(self.address, at, &inputs);
    }
}

impl Skew {
    const NONE: Self = Self {
        locked: 0,
        low: Span::MAX,
        high: Span::from_ticks(-Span::MAX.ticks()),
        low_counts: f64::INFINITY,
        high_counts: f64::NEG_INFINITY,
    };

    fn add(&mut self, offset: Span, counts: f64) {
        self.locked += 1;
        (self.low, self.high) = (self.low.min(offset), self.high.max(offset));
        (self.low_counts, self.high_counts) = (self.low_counts.min(counts), self.high_counts.max(counts));
    }
}

/// A telegram as its receiver finds it: nothing is known of its octets any more.
fn on_the_line(frame: &Frame) -> &Frame {
    black_box(frame)
}

/// Whether a telegram is the clock, as a slave finds out.
fn is_synch(frame: &Frame) -> bool {
    match frame.telegram() {
        Ok(Telegram::Data { header, du }) if header.da.is_broadcast() => {
            (header.dsap, header.ssap) == (Some(GLOBAL_CONTROL.0), Some(GLOBAL_CONTROL.1))
                && GlobalControl::parse(du).is_ok_and(|control| control.is_synch())
        }
        _ => false,
    }
}

impl<const OCTETS: bool> Straight<OCTETS> {
    /// The loop of a scenario of [`encoders`], before its first cycle. The network's start-up is told by `start`.
    pub(crate) fn new(scenario: &Scenario, start: &StartUp) -> Self {
        let master = scenario.master.address;
        Self {
            master,
            crystal: start.station(master).crystal().clone(),
            jitter: JitterSource::new(scenario.master.gc_jitter.clone(), scenario.run.seed, master.get())
                .expect("a checked jitter"),
            times: Times::of(scenario),
            cycle: 0,
            nominal: start.first(),
            before: None,
            synch: Frame::new(),
            frame: Frame::new(),
            slaves: scenario.slaves.iter().map(|slave| Slave::new(scenario, slave, start)).collect(),
            records: Records::new(),
            received: 0,
        }
    }
    /// Forgets what was recorded.
    pub(crate) fn reset(&mut self) {
        (self.records, self.before) = (Records::new(), None);
        for slave in &mut self.slaves {
            (slave.latch_offset, slave.pll_error) = (empty("latch_offset"), empty("pll_error"));
        }
    }
    /// The histograms of the whole network.
    pub(crate) fn records(&self) -> &Records {
        &self.records
    }
    /// Each slave's histograms of its latch offset and of its clock's error.
    pub(crate) fn slaves(&self) -> impl Iterator<Item = (Address, &Histogram, &Histogram)> {
        self.slaves.iter().map(|slave| (slave.address, &slave.latch_offset, &slave.pll_error))
    }

    /// So many cycles.
    pub(crate) fn run(&mut self, cycles: u64, witness: &mut impl Witness) {
        for _ in 0..cycles {
            self.cycle(witness);
        }
    }

    fn cycle(&mut self, witness: &mut impl Witness) {
        let times = self.times;
        let aimed = self.crystal.to_true(self.nominal);
        let t0 = aimed + self.jitter.draw(aimed, self.cycle);
        if OCTETS {
            self.write_synch(t0, witness);
        }
        let began = self.crystal.to_local(t0);
        let next = self.nominal + times.t_dp;
        let grid = self.crystal.to_true(next - times.t_i);

        let mut skew = Skew::NONE;
        let mut free_at = began + times.t_id2;
        let mut t_dx = Span::ZERO;
        for index in 0..self.slaves.len() {
            let slave = &mut self.slaves[index];
            if (!OCTETS || is_synch(on_the_line(&self.synch))) && self.cycle >= slave.clock {
                slave.clock(t0, witness);
            }
            if self.cycle >= slave.axis.joined {
                let answered = self.exchange(index, free_at, witness);
                t_dx = answered - began;
                free_at = answered + times.t_id1;
            }
            self.slaves[index].cycle(&times, grid, &mut skew, witness);
        }
        if OCTETS {
            self.frame.set_token(self.master, self.master);
        }
        let planned = next - times.synch;
        let spare = (planned - (free_at + times.token)).max(Span::ZERO);
        self.record(aimed, t0, (t_dx, spare), &skew);
        (self.cycle, self.nominal) = (self.cycle + 1, next);
    }

    fn write_synch(&mut self, end: Time, witness: &mut impl Witness) {
        let header = Header::request(Address::BROADCAST, self.master, Service::SdnHigh, Fcb::Unused)
            .with_saps(GLOBAL_CONTROL.0, GLOBAL_CONTROL.1);
        self.synch.set_data(&header, &GlobalControl::SYNCH.emit()).expect("SYNCH fits");
        witness.telegram(self.master, end, self.synch.octets());
    }

    fn record(&mut self, aimed: Time, t0: Time, (t_dx, spare): (Span, Span), skew: &Skew) {
        let records = &mut self.records;
        records.gc_jitter.record(t0 - aimed);
        if let Some(before) = self.before.replace(t0) {
            records.t_dp_deviation.record(t0 - before - self.times.t_dp);
        }
        if t_dx > Span::ZERO {
            records.t_dx.record(t_dx);
        }
        records.spare.record(spare);
        if skew.locked >= 2 {
            records.latch_skew.record(skew.high - skew.low);
            self.received ^= (skew.high_counts - skew.low_counts).to_bits();
        }
    }

    /// Data_Exchange with one slave, the first bit of the request at `at`. When the answer has come, by the master.
    fn exchange(&mut self, index: usize, at: Local, witness: &mut impl Witness) -> Local {
        let times = &self.times;
        let slave = &mut self.slaves[index];
        let axis = &mut slave.axis;
        let sign = axis.sign.cycle(true);
        let outputs = Outputs81 { stw2: Stw2(sign.to_word()), g1_stw: G1Stw::default() };
        let requested = self.crystal.to_true(at + times.request);
        let request = Header::request(slave.address, self.master, Service::SrdHigh, axis.fcb);
        axis.fcb = axis.fcb.next();
        let taken = if OCTETS {
            self.frame.set_data(&request, &outputs.emit()).expect("a request fits");
            witness.telegram(self.master, requested, self.frame.octets());
            slave.read_request(on_the_line(&self.frame))
        } else {
            slave.outputs = outputs;
            let FrameControl::Request { fcb, .. } = request.fc else { unreachable!("a request") };
            slave.takes(fcb).then_some(request)
        };
        let request = taken.expect("a request for this slave");

        let heard = slave.crystal.to_local(requested + slave.delay);
        let replied = slave.crystal.to_true(heard + slave.t_sdr + times.reply);
        let inputs = if OCTETS {
            self.frame.set_data(&request.slave_reply(Status::Dl), &slave.inputs.emit()).expect("a reply fits");
            witness.telegram(slave.address, replied, self.frame.octets());
            read_reply(on_the_line(&self.frame), self.master, slave.address).expect("a reply of this slave")
        } else {
            slave.inputs
        };
        let sign = SignOfLife::from_word(inputs.zsw2.0);
        let step = slave.axis.monitor.cycle(sign.get());
        self.received ^= u64::from(inputs.xist1) << u32::from(step.tripped) ^ u64::from(inputs.xist2);
        self.crystal.to_local(replied + slave.delay)
    }
}

impl Slave {
    /// Reads a request; none if it is not for this slave, or a repeated one.
    fn read_request(&mut self, frame: &Frame) -> Option<Header> {
        match frame.telegram() {
            Ok(Telegram::Data { header: header @ Header { dsap: None, ssap: None, .. }, du })
                if header.da == self.address =>
            {
                let FrameControl::Request { service: Service::SrdHigh, fcb } = header.fc else { return None };
                self.outputs = Outputs81::parse(du)?;
                self.takes(fcb).then_some(header)
            }
            _ => None,
        }
    }
}

/// Reads the reply of `slave`.
fn read_reply(frame: &Frame, master: Address, slave: Address) -> Option<Inputs81> {
    match frame.telegram() {
        Ok(Telegram::Data { header, du }) if header.sa == slave && header.da == master => match header.fc {
            FrameControl::Response { status: Status::Dl | Status::Dh, .. } => Inputs81::parse(du),
            _ => None,
        },
        _ => None,
    }
}
