//! The network: stations on cables, and the one loop that makes time pass.
//!
//! Events are ordered by (time, phase, station, number), see [`queue`](super::queue). A telegram's arrivals have its
//! number on the line, a station's other events are numbered by this station alone. Only the order of numbers matters,
//! and each random stream belongs to one station or one link, so that one more or less changes nothing for the others.

// What every telegram and every deadline goes through is one function for the machine, written as several: a call for each
// of them takes as long as what it does.
#![allow(clippy::inline_always)]

mod alarms;
mod deadline;
mod disturbed;
mod listeners;
mod source;
mod tune;
mod turn;

use crate::fdl::params::BusParams;
use crate::fdl::{Filter, Heard, Input, Order, Outbox, Route, Send, Station, Timer};
use crate::observation::Observation;
use crate::sim::bus::{Bus, Flight, FlightId, Mark, Wave};
use crate::sim::crystal::Crystal;
use crate::sim::cut::Cuts;
use crate::sim::fault::Faults;
use crate::sim::jitter::JitterSource;
use crate::sim::motion::{Resolution, Shaft};
use crate::sim::noise::LinkJitter;
use crate::sim::queue::{Key, Lane, NearQueue, Phase, Queue};
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::sim::topology::{Delays, Place, Tree};
use crate::time::{BitRate, Local, Time};
use crate::wire::{Address, Frame};
use alarms::Alarms;
use deadline::{Deadline, Turned};
use disturbed::Held;
use listeners::Neighbour;
use turn::Turning;

mod alter;

/// One station and the world around it.
#[derive(Clone, Debug)]
pub struct Site<S> {
    /// The machine.
    pub machine: S,
    /// Where it is on the cables.
    pub place: Place,
    /// Its crystal.
    pub crystal: Crystal,
    /// The shaft it senses, and how finely.
    pub shaft: Option<(Shaft, Resolution)>,
    /// When its supply comes on.
    pub powered_at: Time,
}

/// The cables and what joins them.
#[derive(Clone, Debug)]
pub struct Wiring {
    /// Segments and links.
    pub tree: Tree,
    /// The links with jitter, by index, and what each draws.
    pub jitter: Vec<(usize, LinkJitter)>,
    /// Where cables may be cut, each place with the name of the disturbance that does it.
    pub cuts: Vec<(String, Place)>,
}

impl Wiring {
    /// One segment of cable.
    pub fn line() -> Self {
        Self { tree: Tree::line(), jitter: Vec::new(), cuts: Vec::new() }
    }
    /// The bus of stations at `places`.
    fn bus(self, places: &[Place]) -> Bus {
        let (unsteady, jitter): (Vec<_>, Vec<_>) = self.jitter.into_iter().unzip();
        let cuts = Cuts::new(self.cuts, &self.tree, places);
        Bus::new(Delays::new(&self.tree, places, &unsteady), jitter).with_cuts(cuts)
    }
}

/// When the scenario orders something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum When {
    /// At an instant.
    Time(Time),
    /// When the cycle of this number begins, just before the master learns of it.
    Cycle(u64),
}

/// What the scenario orders.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Act<C> {
    /// Supply on.
    PowerOn,
    /// Supply off: the station hears, does and says nothing.
    PowerOff,
    /// Something that the station's machine understands.
    Command(C),
}

/// How far to run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Until {
    /// To this instant.
    Time(Time),
    /// Until the cycle of this number begins.
    Cycle(u64),
}

/// What happens to a station; the number of the event tells which.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum Event {
    /// An order of the scenario, by its place among them.
    #[default]
    Act,
    /// A telegram's end, by the telegram's place.
    Telegram,
    /// The same of a telegram for all; the next neighbour of the sender is not yet told.
    Broadcast,
    /// Its cycle begins.
    Sent,
    /// A deadline, by its number.
    Deadline,
    /// A telegram that a disturbance has held up, or made, leaves, by the telegram's place.
    Held,
    /// A disturbance turns, by its number among those that do.
    Turn,
    /// A disturbance changes rates of crystals, by its number among those that turn.
    Step,
    /// A disturbance puts something on the line, by its number among those that turn.
    Source,
}

impl Event {
    /// The row of a telegram's arrivals that are all known when it is sent.
    const ARRIVALS: Lane = Lane::Row(2);

    /// Where the event of this number waits: T_O and latches come one station after the other, as the clock came to them,
    /// and what disturbances and the scenario plan may lie far ahead.
    #[inline(always)]
    const fn lane(self, number: usize) -> Lane {
        const SET_POINT: usize = Timer::SetPoint as usize;
        match (self, number) {
            (Self::Deadline, SET_POINT) => Lane::Row(0),
            (Self::Deadline, Outbox::SAMPLE) => Lane::Row(1),
            (Self::Deadline | Self::Telegram | Self::Broadcast | Self::Sent | Self::Held, _) => Lane::Soon,
            (Self::Act | Self::Turn | Self::Step | Self::Source, _) => Lane::Any,
        }
    }
}

/// What a station's supply depends on.
#[derive(Clone, Copy, Debug, Default)]
struct Supply {
    /// Its switch is on.
    switched_on: bool,
    /// Disturbances that keep it off.
    outages: u16,
}

/// How fast a station's crystal should be (parts per billion).
#[derive(Clone, Copy, Debug)]
struct Offset {
    own: i64,
    /// What disturbances add.
    pulled: i64,
    /// It is not in force yet.
    waits: bool,
}

#[derive(Clone)]
struct Slot<S> {
    site: Site<S>,
    address: Address,
    filter: Filter,
    powered: bool,
    supply: Supply,
    offset: Offset,
    /// When its next cycle begins, once that is known.
    cycle_at: Option<Time>,
    sample_with_telegrams: bool,
    deadlines: [Deadline; Outbox::DEADLINES],
    /// Number of the station's next event other than a telegram.
    number: u64,
}

/// What carrying out a station's answer needs beside the station.
struct Means<'a, Q> {
    alarms: &'a mut Alarms,
    queue: &'a mut Q,
    now: Time,
    rate: BitRate,
}

/// When a station sends the telegram in the outbox: first and last bit.
#[derive(Clone, Copy, Debug)]
struct Sending {
    line: (Time, Time),
    clock: bool,
    sender: Address,
}

impl<S: Station> Slot<S> {
    /// Lets the station answer into the outbox; without supply it does not. Returns `now` if it has.
    #[inline(always)]
    fn ask(&mut self, now: Local, input: Input<'_, S::Command>, out: &mut Outbox) -> Option<Local> {
        self.powered.then(|| {
            out.clear();
            self.site.machine.step(now, input, out);
            now
        })
    }
    /// A telegram's end reaches the station. Its reading if it has answered.
    #[inline(always)]
    fn hear(&mut self, flight: &Flight, now: Time, out: &mut Outbox) -> Option<Local> {
        // Without octets it was cut off before it began.
        if !self.powered || flight.frame.is_empty() {
            return None;
        }
        let local = self.site.crystal.to_local(now);
        let sample = if self.sample_with_telegrams { self.raw(now) } else { 0 };
        let octets = if flight.mark.broken { &[] } else { flight.frame.octets() };
        out.clear();
        self.site.machine.step(local, Input::Telegram(Heard { octets, sample }), out);
        Some(local)
    }
    /// A deadline that was armed for the reading `local` comes. That reading if the station has answered.
    #[inline(always)]
    fn due(&mut self, which: usize, local: Local, now: Time, out: &mut Outbox) -> Option<Local> {
        let input = match Timer::ALL.get(which) {
            Some(&timer) => Input::Deadline { timer, busy: false },
            None => Input::Sample(self.raw(now)),
        };
        self.ask(local, input, out)
    }
    /// Tells what the station of slot `index` has seen at the reading `local`, and arms its deadlines. Returns what it sends.
    #[inline(always)]
    fn carry_out<Q: Queue<NetworkEvent>, R: Recorder>(
        &mut self,
        (index, local): (usize, Local),
        out: &Outbox,
        means: Means<'_, Q>,
        recorder: &mut R,
    ) -> Option<Sending> {
        let Means { alarms, queue, now, rate } = means;
        for seen in out.observations() {
            recorder.observe(Stamp { at: now, station: self.address, crystal: &self.site.crystal }, seen);
        }
        for (which, order) in out.orders() {
            match (Alarms::has(which), order) {
                (true, Order::At(at)) => alarms.arm((index, which), at.max(local), now),
                (true, Order::Off) => alarms.disarm((index, which)),
                (false, Order::At(at)) => self.arm((index, which), at.max(local), now, queue),
                (false, Order::Off) => self.deadlines[which].disarm(),
            }
        }
        debug_assert!(out.has_filter_changed() || self.filter == self.site.machine.filter());
        let (Send { at, clock }, frame) = out.sending()?;
        let crystal = &self.site.crystal;
        let line = (crystal.to_true(at), crystal.to_true(at + rate.octets(frame.len())));
        Some(Sending { line, clock, sender: self.address })
    }
    /// Arms a deadline.
    #[inline(always)]
    fn arm<Q>(&mut self, (index, which): (usize, usize), reading: Local, now: Time, queue: &mut Q)
    where
        Q: Queue<NetworkEvent>,
    {
        let at = self.site.crystal.to_true(reading).max(now);
        if self.deadlines[which].arm(reading, at) {
            self.push(index, (at, Phase::Deadline), (Event::Deadline, which as u32), queue);
        }
    }
    /// Something will happen to the station of slot `index`.
    #[inline(always)]
    fn push<Q>(&mut self, index: usize, (at, phase): (Time, Phase), (event, number): (Event, u32), queue: &mut Q)
    where
        Q: Queue<NetworkEvent>,
    {
        let key = Key::new(at, phase, self.address.get(), self.number);
        self.number += 1;
        queue.push(event.lane(number as usize), key, NetworkEvent { number, event, slot: index as u8, rank: 0 });
    }
    /// The shaft's raw position at `now` (steps); zero without a shaft.
    #[inline(always)]
    fn raw(&self, now: Time) -> u32 {
        self.site.shaft.as_ref().map_or(0, |(shaft, resolution)| resolution.raw(shaft.angle(now)))
    }
}

/// A network in time. `Q` is the event queue; any queue gives the same run. A clone goes on as the original does.
#[derive(Clone)]
pub struct Network<S: Station, Q = NearQueue<NetworkEvent>> {
    rate: BitRate,
    slots: Vec<Slot<S>>,
    /// Slot of each address.
    by_address: [Option<u8>; 128],
    /// Slots that hear everything.
    attentive: Vec<u8>,
    /// Slots that hear replies to all stations.
    subscribers: Vec<u8>,
    /// For each slot all others, in the order in which a telegram reaches them.
    neighbours: Vec<Vec<Neighbour>>,
    /// Of each address the slot that hears what is for it alone, and does not hear everything.
    addressed: [Option<u8>; 128],
    bus: Bus,
    queue: Q,
    alarms: Alarms,
    jitter: JitterSource,
    faults: Faults,
    held: Held,
    /// Room for what comes onto the line and is not as a sender has just written it.
    altered: Frame,
    acts: Vec<(usize, Act<S::Command>)>,
    /// Which of them do not count any more.
    cancelled: core::ops::Range<usize>,
    /// Acts bound to cycles, by cycle.
    cycle_acts: Vec<(u64, usize)>,
    next_cycle_act: usize,
    /// Disturbances that begin and end, and the first cycle in which one of them does.
    turning: Vec<Turning<S::Command>>,
    next_turn: u64,
    now: Time,
    /// Nothing later than this happens in the running call, and no more events.
    limit: Time,
    left: u64,
    /// Cycles that the first station has begun, with a lost SYNCH too.
    clocks: u64,
    out: Outbox,
}

/// An event of a network. Opaque: only queues handle it.
///
/// Its parts lie beside each other, not in the variants of an enum, so that each is written and read by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkEvent {
    number: u32,
    event: Event,
    /// The station that it happens to.
    slot: u8,
    /// Of a telegram for all: the station's rank among the sender's neighbours.
    rank: u8,
}

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// The station whose cycles count.
    const CLOCK: usize = 0;

    /// A network at rest at time zero. Stations are switched on at their own instants. Cycles are those of the first
    /// station: they end a run, orders are bound to them.
    ///
    /// # Panics
    /// If two stations have one address, or there are more than 127: the caller checks scenarios.
    pub fn new(
        rate: BitRate,
        (wiring, sites): (Wiring, Vec<Site<S>>),
        jitter: JitterSource,
        mut faults: Faults,
    ) -> Self {
        let places: Vec<_> = sites.iter().map(|site| site.place).collect();
        let mut by_address = [None; 128];
        let mut slots = Vec::with_capacity(sites.len());
        for (index, site) in sites.into_iter().enumerate() {
            let address = site.machine.address();
            let place = &mut by_address[usize::from(address.get())];
            assert!(place.is_none(), "two stations with address {address}");
            *place = Some(index as u8);
            let (filter, own) = (site.machine.filter(), site.crystal.ppb());
            slots.push(Slot {
                site,
                address,
                filter,
                powered: false,
                supply: Supply::default(),
                offset: Offset { own, pulled: 0, waits: false },
                cycle_at: None,
                sample_with_telegrams: false,
                deadlines: [Deadline::OFF; Outbox::DEADLINES],
                number: 0,
            });
        }
        let turning = faults.take_turning();
        let mut network = Self {
            rate,
            alarms: Alarms::new(slots.iter().map(|slot| slot.site.crystal.clone())),
            slots,
            by_address,
            attentive: Vec::new(),
            subscribers: Vec::new(),
            neighbours: Vec::new(),
            addressed: [None; 128],
            bus: wiring.bus(&places).with_t_syn(rate.span(BusParams::T_SYN)),
            queue: Q::default(),
            jitter,
            faults,
            held: Held::default(),
            altered: Frame::new(),
            acts: Vec::new(),
            cancelled: 0..0,
            cycle_acts: Vec::new(),
            next_cycle_act: 0,
            turning: Vec::new(),
            next_turn: u64::MAX,
            now: Time::ZERO,
            limit: Time::MAX,
            left: 0,
            clocks: 0,
            out: Outbox::new(),
        };
        network.sort_listeners();
        network.neighbours = (0..network.slots.len()).map(|sender| network.neighbours_of(sender)).collect();
        for index in 0..network.slots.len() {
            let (address, at) = (network.slots[index].address, network.slots[index].site.powered_at);
            network.order(When::Time(at), address, Act::PowerOn);
        }
        network.disturb(turning);
        network
    }

    /// Orders `act` for the station at `address`; an address without station is ignored.
    pub fn order(&mut self, when: When, address: Address, act: Act<S::Command>) {
        let Some(slot) = self.by_address[usize::from(address.get())] else { return };
        self.acts.push((slot.into(), act));
        let act = self.acts.len() - 1;
        match when {
            When::Time(at) => self.push(at.max(self.now), Phase::Command, slot.into(), (Event::Act, act as u32)),
            When::Cycle(cycle) => {
                let at = self.cycle_acts.partition_point(|&(other, _)| other <= cycle);
                self.cycle_acts.insert(at, (cycle, act));
            }
        }
    }

    /// True time now.
    pub const fn now(&self) -> Time {
        self.now
    }
    /// Cycles begun.
    pub const fn cycles(&self) -> u64 {
        self.clocks
    }
    /// The machine at `address`.
    pub fn station(&self, address: Address) -> Option<&S> {
        let slot = self.by_address[usize::from(address.get())]?;
        Some(&self.slots[usize::from(slot)].site.machine)
    }

    /// Runs for at most `budget` events. Tells whether `until` is reached.
    pub fn run<R: Recorder>(&mut self, until: Until, budget: u64, recorder: &mut R) -> bool {
        self.limit = match until {
            Until::Cycle(_) => Time::MAX,
            Until::Time(end) => end,
        };
        self.left = budget;
        while self.left > 0 {
            self.left -= 1;
            let over = match until {
                Until::Cycle(cycle) => self.clocks > cycle,
                Until::Time(end) => !self.goes_on_until(end),
            };
            if over || !self.next(recorder) {
                if let Until::Time(end) = until {
                    self.now = end;
                }
                return true;
            }
        }
        false
    }

    /// Whether anything comes until `end`.
    fn goes_on_until(&mut self, end: Time) -> bool {
        if self.queue.peek().is_some_and(|key| key.time() <= end) {
            return true;
        }
        self.look_at_alarms(end);
        self.alarms.next() <= end
    }
    #[inline(always)]
    fn look_at_alarms(&mut self, limit: Time) {
        self.alarms.look(limit, self.now);
    }

    /// The next event. False when nothing will ever happen again.
    fn next<R: Recorder>(&mut self, recorder: &mut R) -> bool {
        if self.queue.peek().is_none_or(|key| key.time() >= self.alarms.next()) {
            if self.alarm(recorder) {
                return true;
            }
            if self.queue.is_empty() {
                return false;
            }
        }
        let (key, happening) = self.queue.take();
        self.now = key.time();
        let NetworkEvent { number, event, slot, mut rank } = happening;
        let mut slot = usize::from(slot);
        loop {
            let mut onward = None;
            match event {
                Event::Telegram | Event::Deadline => {}
                Event::Broadcast => {
                    rank += 1;
                    onward = self.onward(FlightId::of(number), rank);
                }
                _ => {
                    self.happen(slot, (event, number as usize), recorder);
                    return true;
                }
            }
            self.serve(slot, (event, number), recorder);
            let Some((key, listener)) = onward else { return true };
            if self.left == 0 || !self.is_next(key) {
                self.queue.push(Lane::Soon, key, NetworkEvent { number, event, slot: listener, rank });
                return true;
            }
            self.left -= 1;
            (self.now, slot) = (key.time(), listener.into());
        }
    }
    /// Whether an event with this key, which is not in the queue, comes before all others.
    #[inline(always)]
    fn is_next(&self, key: Key) -> bool {
        let time = key.time();
        time < self.alarms.next() && time <= self.limit && self.queue.peek().is_none_or(|head| key < head)
    }
    /// A telegram's end reaches a station, or a deadline of it comes.
    #[inline(always)]
    fn serve<R: Recorder>(&mut self, index: usize, (event, number): (Event, u32), recorder: &mut R) {
        let deaf = event != Event::Deadline && !self.faults.is_empty() && self.is_deaf(index);
        let (now, rate) = (self.now, self.rate);
        let Self { slots, bus, out, alarms, queue, .. } = self;
        let slot = &mut slots[index];
        let answered = if event == Event::Deadline {
            let which = number as usize;
            match slot.deadlines[which].turn(now) {
                Turned::Due(local) => slot.due(which, local, now, out),
                Turned::Early(at) => {
                    slot.push(index, (at, Phase::Deadline), (event, number), queue);
                    None
                }
                Turned::Void => None,
            }
        } else {
            let id = FlightId::of(number);
            let reaches = !deaf && bus.reaches(id, index);
            let flight = bus.heard(id);
            if reaches { slot.hear(flight, now, out) } else { None }
        };
        if let Some(local) = answered {
            let means = Means { alarms, queue, now, rate };
            let sending = slot.carry_out((index, local), out, means, recorder);
            self.finish(index, sending, recorder);
        }
    }
    /// What comes less often than telegrams and deadlines.
    #[inline(never)]
    fn happen<R: Recorder>(&mut self, slot: usize, (event, number): (Event, usize), recorder: &mut R) {
        match event {
            Event::Sent => self.sent(slot, recorder),
            Event::Act if self.cancelled.contains(&number) => {}
            Event::Act => self.act(number, recorder),
            Event::Held => self.release(slot, number, recorder),
            Event::Turn => self.turn(number, recorder),
            Event::Step => self.step_crystals(number),
            Event::Source => self.emit(number, recorder),
            Event::Telegram | Event::Broadcast | Event::Deadline => unreachable!("these come often"),
        }
    }

    /// The next event if it is an alarm. A station's other deadlines of the instant come before its alarms.
    #[inline(always)]
    fn alarm<R: Recorder>(&mut self, recorder: &mut R) -> bool {
        let limit = self.queue.peek().map_or(Time::MAX, Key::time);
        self.look_at_alarms(limit);
        self.alarms.next() <= limit && self.ring(recorder)
    }
    /// The alarm that comes first, unless another event comes before it.
    #[inline(never)]
    fn ring<R: Recorder>(&mut self, recorder: &mut R) -> bool {
        let at = self.alarms.next();
        let Some((slot, which, local)) = self.alarms.first(|slot| self.slots[slot].address) else { return false };
        let key = Key::new(at, Phase::Deadline, self.slots[slot].address.get(), Key::MAX_NUMBER);
        if self.queue.peek().is_some_and(|head| head < key) {
            return false;
        }
        self.now = at;
        self.alarms.disarm((slot, which));
        let timer = Timer::ALL[which];
        let busy = timer == Timer::Slot && self.is_busy(slot);
        self.step(slot, local, Input::Deadline { timer, busy }, recorder);
        true
    }

    fn act<R: Recorder>(&mut self, act: usize, recorder: &mut R) {
        let (slot, act) = self.acts[act];
        match act {
            Act::PowerOn => self.switch(slot, true, recorder),
            Act::PowerOff => self.switch(slot, false, recorder),
            Act::Command(command) => self.command(slot, command, recorder),
        }
    }
    fn command<R: Recorder>(&mut self, slot: usize, command: S::Command, recorder: &mut R) {
        if self.slots[slot].powered {
            self.step(slot, self.local(slot), Input::Command(command), recorder);
        } else {
            self.tell(slot, &Observation::OrderLost, recorder);
        }
    }
    fn switch<R: Recorder>(&mut self, slot: usize, on: bool, recorder: &mut R) {
        self.slots[slot].supply.switched_on = on;
        self.update_supply(slot, recorder);
    }
    /// Brings a station's supply to what its switch and the disturbances make of it.
    fn update_supply<R: Recorder>(&mut self, index: usize, recorder: &mut R) {
        let slot = &mut self.slots[index];
        let on = slot.supply.switched_on && slot.supply.outages == 0;
        if on == slot.powered {
            return;
        }
        slot.powered = on;
        if on {
            self.tell(index, &Observation::Power { on }, recorder);
            return self.step(index, self.local(index), Input::PowerOn, recorder);
        }
        slot.cycle_at = None;
        slot.deadlines.iter_mut().for_each(Deadline::disarm);
        self.alarms.disarm_all(index);
        if slot.offset.waits {
            self.tune(index);
        }
        self.bus.silence(index, self.now);
        recorder.withdrawn(self.slots[index].address, self.now);
        self.tell(index, &Observation::Power { on }, recorder);
    }
    /// Tells what happened to a station and was not its own doing.
    #[inline(never)]
    fn tell<R: Recorder>(&self, slot: usize, what: &Observation, recorder: &mut R) {
        let Slot { address, site, .. } = &self.slots[slot];
        recorder.observe(Stamp { at: self.now, station: *address, crystal: &site.crystal }, what);
    }
    fn local(&self, slot: usize) -> Local {
        self.slots[slot].site.crystal.to_local(self.now)
    }

    /// Whether a disturbance keeps a station from hearing.
    #[cold]
    fn is_deaf(&self, slot: usize) -> bool {
        self.faults.deafens(self.slots[slot].address, (self.now, self.clocks_begun(false)))
    }

    /// A station's cycle begins. Only those of the first station are the network's.
    fn sent<R: Recorder>(&mut self, slot: usize, recorder: &mut R) {
        // Or it lost its supply before.
        if self.slots[slot].cycle_at.take_if(|at| *at == self.now).is_none() {
            return;
        }
        if self.slots[slot].offset.waits {
            self.tune(slot);
        }
        if slot == Self::CLOCK {
            let cycle = self.clocks;
            self.clocks += 1;
            if cycle >= self.next_turn {
                self.turn_in_cycle(cycle, recorder);
            }
            while let Some(&(_, act)) = self.cycle_acts.get(self.next_cycle_act).filter(|&&(due, _)| due <= cycle) {
                self.next_cycle_act += 1;
                self.act(act, recorder);
            }
        }
        self.step(slot, self.local(slot), Input::Sent, recorder);
    }

    /// Whether a station sees characters on the line.
    fn is_busy(&self, slot: usize) -> bool {
        self.bus.is_busy(self.now, slot) && (self.faults.is_empty() || !self.is_deaf(slot))
    }

    /// Lets a station answer, and carries out what it answers.
    fn step<R: Recorder>(&mut self, index: usize, local: Local, input: Input<'_, S::Command>, recorder: &mut R) {
        let (now, rate) = (self.now, self.rate);
        let Self { slots, out, alarms, queue, .. } = self;
        let slot = &mut slots[index];
        if let Some(local) = slot.ask(local, input, out) {
            let means = Means { alarms, queue, now, rate };
            let sending = slot.carry_out((index, local), out, means, recorder);
            self.finish(index, sending, recorder);
        }
    }
    /// Does what is left of what the station has put into the outbox.
    #[inline(always)]
    fn finish<R: Recorder>(&mut self, index: usize, sending: Option<Sending>, recorder: &mut R) {
        if self.out.is_unusual() {
            self.carry_out_unusual(index);
        }
        if let Some(sending) = sending {
            self.transmit(index, sending, recorder);
        }
    }
    /// Does what the station seldom wants.
    #[cold]
    fn carry_out_unusual(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        if let Some(on) = self.out.sampling_with_telegrams() {
            slot.sample_with_telegrams = on;
        }
        if let Some(at) = self.out.beginning_cycle() {
            let at = slot.site.crystal.to_true(at).max(self.now);
            self.begin_cycle(index, at);
        }
        let slot = &mut self.slots[index];
        let filter = slot.site.machine.filter();
        if filter != slot.filter {
            slot.filter = filter;
            self.sort_listeners();
        }
    }

    /// The station's cycle begins at `at`.
    fn begin_cycle(&mut self, slot: usize, at: Time) {
        self.slots[slot].cycle_at = Some(at);
        self.push(at, Phase::Edge, slot, (Event::Sent, 0));
    }
    fn push(&mut self, at: Time, phase: Phase, index: usize, what: (Event, u32)) {
        self.slots[index].push(index, (at, phase), what, &mut self.queue);
    }

    /// Puts the telegram in the outbox onto the line.
    #[inline(always)]
    fn transmit<R: Recorder>(&mut self, index: usize, sending: Sending, recorder: &mut R) {
        let Sending { mut line, clock, sender } = sending;
        if clock {
            line = self.send_clock(index, line);
        }
        if !self.faults.is_empty() {
            match self.disturbed(index, line, clock, recorder) {
                Some(left) => line = left,
                None => return,
            }
        }
        let frame = self.out.frame();
        let route = announce(frame, sender, line, Mark::OWN, recorder);
        let on_line = self.bus.send(index, line, frame, Mark::OWN);
        self.sent_off(on_line, route, Mark::OWN, recorder);
    }
    /// The telegram in the outbox begins a cycle: when it is on the line.
    #[inline(never)]
    fn send_clock(&mut self, index: usize, (start, end): (Time, Time)) -> (Time, Time) {
        let jitter = self.jitter.draw(start, self.clocks) + self.faults.clock_strays(start, self.clocks);
        let jitter = jitter.max(self.now - start);
        // The master's transmitter runs, whatever becomes of the telegram.
        self.begin_cycle(index, end + jitter);
        (start + jitter, end + jitter)
    }
    /// Puts the altered telegram onto the line.
    #[inline(never)]
    fn send_altered<R: Recorder>(&mut self, slot: usize, line: (Time, Time), mark: Mark, recorder: &mut R) {
        let route = announce(&self.altered, self.slots[slot].address, line, mark, recorder);
        let on_line = self.bus.send(slot, line, &self.altered, mark);
        self.sent_off(on_line, route, mark, recorder);
    }
    /// A telegram is on the line: tells its listeners when its end will reach them.
    #[inline(always)]
    fn sent_off<R: Recorder>(
        &mut self,
        (wave, hit): (Wave, Option<u8>),
        route: Option<Route>,
        mark: Mark,
        recorder: &mut R,
    ) {
        if let Some(with) = hit {
            self.collided(wave.sender, usize::from(with), recorder);
        }
        self.deliver(wave, route, mark.apart);
    }
    #[cold]
    fn collided<R: Recorder>(&mut self, slot: usize, with: usize, recorder: &mut R) {
        self.tell(slot, &Observation::Collision { with: self.slots[with].address }, recorder);
    }
    /// The running cycle, or the one that the SYNCH being sent will begin.
    fn clocks_begun(&self, clock: bool) -> u64 {
        if clock { self.clocks } else { self.clocks.saturating_sub(1) }
    }
}

/// Tells that a telegram comes onto the line. Returns its route.
#[inline(always)]
fn announce<R: Recorder>(
    frame: &Frame,
    sender: Address,
    (start, end): (Time, Time),
    mark: Mark,
    recorder: &mut R,
) -> Option<Route> {
    let octets = frame.octets();
    recorder.telegram(&Transmission { start, end, sender, octets, origin: mark.origin });
    Route::of(octets)
}
