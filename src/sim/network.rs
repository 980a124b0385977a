//! The network: stations on cables, and the one loop that makes time pass.
//!
//! Events are ordered by (time, phase, station, number), see [`queue`](super::queue). A telegram's arrivals have its
//! number on the line, a station's other events are numbered by this station alone. Only the order of numbers matters,
//! and each random stream belongs to one station or one link, so that one more or less changes nothing for the others.

mod alarms;
mod disturbed;
mod source;
mod tune;
mod turn;

use crate::fdl::params::BusParams;
use crate::fdl::{Filter, Heard, Input, Order, Outbox, Route, Station, Timer};
use crate::observation::Observation;
use crate::sim::bus::{Bus, Flight, FlightId, Mark};
use crate::sim::crystal::Crystal;
use crate::sim::cut::Cuts;
use crate::sim::fault::Faults;
use crate::sim::jitter::JitterSource;
use crate::sim::motion::{Resolution, Shaft};
use crate::sim::noise::LinkJitter;
use crate::sim::queue::{Key, NearQueue, Phase, Queue};
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::sim::topology::{Delays, Place, Tree};
use crate::time::{BitRate, Local, Time};
use crate::wire::{Address, Frame};
use alarms::Alarms;
use disturbed::Held;
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

/// A deadline that is no alarm. Only one event of it counts at a time; arming it later than that event costs nothing until
/// it comes.
#[derive(Clone, Copy, Debug, Default)]
struct Deadline {
    /// Armed for this reading of the station's crystal, and the true time of it.
    due: Option<(Local, Time)>,
    /// Time of the event in the queue that counts.
    queued: Option<Time>,
}

#[derive(Clone, Copy, Debug)]
enum Event {
    Act(u32),
    Telegram(FlightId),
    /// A telegram for all reaches the station of this rank among the sender's neighbours; the next one is not yet told.
    Broadcast(FlightId, u8),
    Sent,
    Deadline(u8),
    /// A telegram that a disturbance has held up, or made, leaves.
    Held(u16),
    /// A disturbance of this number among those that turn does so.
    Turn(u16),
    /// A disturbance of this number among those that turn changes rates of crystals.
    Step(u16),
    /// A disturbance of this number among those that turn puts something on the line.
    Source(u16),
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

/// A network in time. `Q` is the event queue; any queue gives the same run. A clone goes on as the original does.
#[derive(Clone)]
pub struct Network<S: Station, Q = NearQueue<NetworkEvent>> {
    rate: BitRate,
    slots: Vec<Slot<S>>,
    /// Slot of each address.
    by_address: [Option<u8>; 128],
    /// Slots that hear more than what is for them or for everybody.
    curious: Vec<u8>,
    /// For each slot all others, in the order in which a telegram reaches them.
    neighbours: Vec<Vec<u8>>,
    bus: Bus,
    queue: Q,
    alarms: Alarms,
    jitter: JitterSource,
    faults: Faults,
    held: Held,
    /// Room for what comes onto the line from nowhere.
    foreign: Frame,
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
    /// Cycles that the first station has begun, with a lost SYNCH too.
    clocks: u64,
    out: Outbox,
}

/// An event of a network. Opaque: only queues handle it.
#[derive(Clone, Copy, Debug)]
pub struct NetworkEvent(Event);

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
                deadlines: [Deadline::default(); Outbox::DEADLINES],
                number: 0,
            });
        }
        let turning = faults.take_turning();
        let mut network = Self {
            rate,
            alarms: Alarms::new(slots.len()),
            slots,
            by_address,
            curious: Vec::new(),
            neighbours: Vec::new(),
            bus: wiring.bus(&places).with_t_syn(rate.span(BusParams::T_SYN)),
            queue: Q::default(),
            jitter,
            faults,
            held: Held::default(),
            foreign: Frame::new(),
            acts: Vec::new(),
            cancelled: 0..0,
            cycle_acts: Vec::new(),
            next_cycle_act: 0,
            turning: Vec::new(),
            next_turn: u64::MAX,
            now: Time::ZERO,
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
            When::Time(at) => self.push(at.max(self.now), Phase::Command, slot.into(), Event::Act(act as u32)),
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
        for _ in 0..budget {
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
    fn look_at_alarms(&mut self, limit: Time) {
        let Self { alarms, slots, now, .. } = self;
        alarms.look(limit, *now, |slot| &slots[slot].site.crystal);
    }

    /// The next event. False when nothing will ever happen again.
    fn next<R: Recorder>(&mut self, recorder: &mut R) -> bool {
        let (key, NetworkEvent(event)) = match self.queue.pop_before(self.alarms.next()) {
            Some(next) => next,
            None if self.alarm(recorder) => return true,
            None => match self.queue.pop() {
                Some(next) => next,
                None => return false,
            },
        };
        self.now = key.time();
        let slot = usize::from(self.by_address[usize::from(key.station())].expect("events belong to stations"));
        match event {
            Event::Act(act) if self.cancelled.contains(&(act as usize)) => {}
            Event::Act(act) => self.act(act as usize, recorder),
            Event::Telegram(id) => self.telegram(slot, id, recorder),
            Event::Broadcast(id, rank) => {
                self.tell_neighbour(id, rank + 1);
                self.telegram(slot, id, recorder);
            }
            Event::Sent => self.sent(slot, recorder),
            Event::Deadline(which) => self.deadline(slot, usize::from(which), recorder),
            Event::Held(which) => self.release(slot, usize::from(which), recorder),
            Event::Turn(number) => self.turn(number.into(), recorder),
            Event::Step(number) => self.step_crystals(number.into()),
            Event::Source(number) => self.emit(number.into(), recorder),
        }
        true
    }

    /// The next event if it is an alarm. A station's other deadlines of the instant come before its alarms.
    #[inline(never)]
    fn alarm<R: Recorder>(&mut self, recorder: &mut R) -> bool {
        let head = self.queue.peek();
        self.look_at_alarms(head.map_or(Time::MAX, Key::time));
        let at = self.alarms.next();
        if head.is_some_and(|key| key.time() < at) {
            return false;
        }
        let Some((slot, which, local)) = self.alarms.first(|slot| self.slots[slot].address) else { return false };
        let key = Key::new(at, Phase::Deadline, self.slots[slot].address.get(), Key::MAX_NUMBER);
        if head.is_some_and(|head| head < key) {
            return false;
        }
        self.now = at;
        self.alarms.disarm((slot, which));
        self.due(slot, which, local, recorder);
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
        for deadline in &mut slot.deadlines {
            deadline.due = None;
        }
        self.alarms.disarm_all(index);
        if slot.offset.waits {
            self.tune(index);
        }
        self.bus.silence(index, self.now);
        recorder.withdrawn(self.slots[index].address, self.now);
        self.tell(index, &Observation::Power { on }, recorder);
    }
    /// Tells what happened to a station and was not its own doing.
    fn tell<R: Recorder>(&self, slot: usize, what: &Observation, recorder: &mut R) {
        let Slot { address, site, .. } = &self.slots[slot];
        recorder.observe(Stamp { at: self.now, station: *address, crystal: &site.crystal }, what);
    }
    fn local(&self, slot: usize) -> Local {
        self.slots[slot].site.crystal.to_local(self.now)
    }

    fn telegram<R: Recorder>(&mut self, index: usize, id: FlightId, recorder: &mut R) {
        let sample = if self.slots[index].sample_with_telegrams { self.raw(index) } else { 0 };
        let running = (self.now, self.clocks_begun(false));
        let Self { slots, bus, faults, out, .. } = self;
        let slot = &mut slots[index];
        let now = slot.site.crystal.to_local(running.0);
        let flight = bus.flight(id);
        // Without octets it was cut off before it began.
        let comes = slot.powered && !flight.frame.is_empty() && bus.reaches(id, index);
        let hears = comes && !faults.deafens(slot.address, running);
        if hears {
            out.clear();
            let octets = if flight.mark.broken { &[] } else { flight.frame.octets() };
            slot.site.machine.step(now, Input::Telegram(Heard { octets, sample }), out);
        }
        bus.heard(id);
        if hears {
            self.carry_out(index, now, recorder);
        }
    }
    /// Whether a disturbance keeps a station from hearing.
    fn is_deaf(&self, slot: usize) -> bool {
        self.faults.deafens(self.slots[slot].address, (self.now, self.clocks_begun(false)))
    }
    /// The shaft's raw position now (steps); zero without a shaft.
    fn raw(&self, slot: usize) -> u32 {
        self.slots[slot].site.shaft.as_ref().map_or(0, |(shaft, resolution)| resolution.raw(shaft.angle(self.now)))
    }

    /// A station's cycle begins. Only those of the first station are the network's.
    fn sent<R: Recorder>(&mut self, slot: usize, recorder: &mut R) {
        if self.slots[slot].cycle_at.take_if(|at| *at == self.now).is_none() {
            return; // It lost its supply before.
        }
        if self.slots[slot].offset.waits {
            self.tune(slot);
        }
        if slot != Self::CLOCK {
            return self.step(slot, self.local(slot), Input::Sent, recorder);
        }
        let cycle = self.clocks;
        self.clocks += 1;
        if cycle >= self.next_turn {
            self.turn_in_cycle(cycle, recorder);
        }
        while let Some(&(_, act)) = self.cycle_acts.get(self.next_cycle_act).filter(|&&(due, _)| due <= cycle) {
            self.next_cycle_act += 1;
            self.act(act, recorder);
        }
        self.step(slot, self.local(slot), Input::Sent, recorder);
    }

    fn deadline<R: Recorder>(&mut self, slot: usize, which: usize, recorder: &mut R) {
        let now = self.now;
        let deadline = &mut self.slots[slot].deadlines[which];
        if deadline.queued != Some(now) {
            return; // An earlier arming took its place.
        }
        deadline.queued = None;
        let Some((local, due)) = deadline.due else { return };
        if due > now {
            deadline.queued = Some(due);
            return self.push(due, Phase::Deadline, slot, Event::Deadline(which as u8));
        }
        deadline.due = None;
        self.due(slot, which, local, recorder);
    }
    /// The deadline of this number that was armed for the reading `local` is due.
    fn due<R: Recorder>(&mut self, slot: usize, which: usize, local: Local, recorder: &mut R) {
        let input = match Timer::ALL.get(which) {
            Some(&timer) => Input::Deadline { timer, busy: timer == Timer::Slot && self.is_busy(slot) },
            None => Input::Sample(self.raw(slot)),
        };
        self.step(slot, local, input, recorder);
    }

    /// Whether a station sees characters on the line.
    fn is_busy(&self, slot: usize) -> bool {
        self.bus.is_busy(self.now, slot) && !self.is_deaf(slot)
    }

    fn step<R: Recorder>(&mut self, slot: usize, now: Local, input: Input<'_, S::Command>, recorder: &mut R) {
        if self.slots[slot].powered {
            self.out.clear();
            self.slots[slot].site.machine.step(now, input, &mut self.out);
            self.carry_out(slot, now, recorder);
        }
    }

    /// Does what the station has put into the outbox.
    fn carry_out<R: Recorder>(&mut self, index: usize, now: Local, recorder: &mut R) {
        let Self { out, slots, alarms, queue, now: instant, .. } = self;
        let slot = &mut slots[index];
        for seen in out.observations() {
            recorder.observe(Stamp { at: *instant, station: slot.address, crystal: &slot.site.crystal }, seen);
        }
        for (which, order) in out.orders() {
            match (Alarms::has(which), order) {
                (true, Order::At(at)) => alarms.arm((index, which), at.max(now), &slot.site.crystal, *instant),
                (true, Order::Off) => alarms.disarm((index, which)),
                (false, Order::At(at)) => Self::arm(queue, slot, which, at.max(now), *instant),
                (false, Order::Off) => slot.deadlines[which].due = None,
            }
        }
        debug_assert!(out.has_filter_changed() || slot.filter == slot.site.machine.filter());
        if out.is_unusual() {
            self.carry_out_unusual(index);
        }
        self.transmit(index, recorder);
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
        self.push(at, Phase::Edge, slot, Event::Sent);
    }
    fn arm(queue: &mut Q, slot: &mut Slot<S>, which: usize, at: Local, now: Time) {
        let due = slot.site.crystal.to_true(at).max(now);
        let deadline = &mut slot.deadlines[which];
        deadline.due = Some((at, due));
        if deadline.queued.is_none_or(|queued| queued > due) {
            deadline.queued = Some(due);
            let key = Key::new(due, Phase::Deadline, slot.address.get(), slot.number);
            slot.number += 1;
            queue.push(key, NetworkEvent(Event::Deadline(which as u8)));
        }
    }
    fn push(&mut self, at: Time, phase: Phase, slot: usize, event: Event) {
        let slot = &mut self.slots[slot];
        self.queue.push(Key::new(at, phase, slot.address.get(), slot.number), NetworkEvent(event));
        slot.number += 1;
    }

    /// Puts the telegram in the outbox, if there is one, onto the line.
    fn transmit<R: Recorder>(&mut self, index: usize, recorder: &mut R) {
        let Some((send, frame)) = self.out.sending() else { return };
        let crystal = &self.slots[index].site.crystal;
        let mut line = (crystal.to_true(send.at), crystal.to_true(send.at + self.rate.octets(frame.len())));
        if send.clock {
            let jitter = self.jitter.draw(line.0, self.clocks) + self.faults.clock_strays(line.0, self.clocks);
            let jitter = jitter.max(self.now - line.0);
            line = (line.0 + jitter, line.1 + jitter);
            // The master's transmitter runs, whatever becomes of the telegram.
            self.begin_cycle(index, line.1);
        }
        if !self.faults.is_empty() {
            return self.transmit_disturbed(index, line, send.clock, recorder);
        }
        let flight = self.bus.send(index, line, self.out.frame(), Mark::OWN);
        self.sent_off(index, flight, recorder);
    }
    /// Tells that a telegram is on the line, and its listeners when its end will reach them.
    fn sent_off<R: Recorder>(&mut self, slot: usize, (id, hit): (FlightId, Option<usize>), recorder: &mut R) {
        let sender = self.slots[slot].address;
        let Flight { start, end, mark, ref frame, .. } = *self.bus.flight(id);
        recorder.telegram(&Transmission { start, end, sender, octets: frame.octets(), origin: mark.origin });
        if let Some(with) = hit {
            self.tell(slot, &Observation::Collision { with: self.slots[with].address }, recorder);
        }
        self.deliver(slot, id);
    }
    /// The running cycle, or the one that the SYNCH being sent will begin.
    fn clocks_begun(&self, clock: bool) -> u64 {
        if clock { self.clocks } else { self.clocks.saturating_sub(1) }
    }

    /// Tells every listener when the telegram's end will reach it.
    fn deliver(&mut self, sender: usize, id: FlightId) {
        let route = Route::of(self.bus.flight(id).frame.octets());
        if matches!(route, Some(Route { da: Route::TO_ALL, reply: false, .. })) {
            return self.broadcast(sender, id);
        }
        let apart = self.bus.flight(id).mark.apart;
        let mut listeners = 0;
        for rank in 0..self.curious.len() {
            let listener = usize::from(self.curious[rank]);
            if (listener != sender || apart) && self.slots[listener].filter.passes(route) {
                self.push_telegram(listener, id, Event::Telegram(id));
                listeners += 1;
            }
        }
        let addressed = route.and_then(|route| self.by_address[usize::from(route.da)]).map(usize::from);
        if let Some(listener) = addressed.filter(|&slot| slot != sender || apart) {
            let filter = &self.slots[listener].filter;
            if !filter.is_curious() && filter.passes(route) {
                self.push_telegram(listener, id, Event::Telegram(id));
                listeners += 1;
            }
        }
        self.bus.expect_listeners(id, listeners);
    }
    /// A request for all passes every filter. Only the nearest neighbour is told now and tells the next one when it has
    /// heard, so that the queue holds one event of the telegram, not one for each station. Where links have jitter, who
    /// is nearest differs from telegram to telegram, and all are told now; so where receivers have.
    fn broadcast(&mut self, sender: usize, id: FlightId) {
        let (count, apart) = (self.neighbours[sender].len(), self.bus.flight(id).mark.apart);
        self.bus.expect_listeners(id, count as u16 + u16::from(apart));
        if apart {
            self.push_telegram(sender, id, Event::Telegram(id));
        }
        if count == 0 {
            return;
        }
        if self.bus.delays().is_steady() && !self.faults.strays_arrivals() {
            return self.tell_neighbour(id, 0);
        }
        for rank in 0..count {
            let listener = self.neighbours[sender][rank].into();
            self.push_telegram(listener, id, Event::Telegram(id));
        }
    }
    fn tell_neighbour(&mut self, id: FlightId, rank: u8) {
        if let Some(&listener) = self.neighbours[self.bus.flight(id).sender].get(usize::from(rank)) {
            self.push_telegram(listener.into(), id, Event::Broadcast(id, rank));
        }
    }
    /// The telegram's end reaches `listener`. Of telegrams that end there at one instant the one sent first comes first.
    fn push_telegram(&mut self, listener: usize, id: FlightId, event: Event) {
        let (mut at, number) = self.bus.arrival(id, listener);
        if self.faults.strays_arrivals() {
            let running = (self.bus.flight(id).start, self.clocks_begun(false));
            at += self.faults.capture_stray(self.slots[listener].address, running);
            // Nobody hears what has not been said.
            at = at.max(self.bus.flight(id).end).max(self.now);
        }
        let key = Key::new(at, Phase::Telegram, self.slots[listener].address.get(), number);
        self.queue.push(key, NetworkEvent(event));
    }
    /// All but `sender`, by delay and then by address, as events are ordered.
    fn neighbours_of(&self, sender: usize) -> Vec<u8> {
        let mut all: Vec<u8> = (0..self.slots.len() as u8).filter(|&slot| usize::from(slot) != sender).collect();
        all.sort_by_key(|&slot| {
            let slot = usize::from(slot);
            (self.bus.delays().nominal(sender, slot), self.slots[slot].address)
        });
        all
    }
    fn sort_listeners(&mut self) {
        self.curious.clear();
        let curious = |(index, slot): (usize, &Slot<S>)| slot.filter.is_curious().then_some(index as u8);
        self.curious.extend(self.slots.iter().enumerate().filter_map(curious));
    }
}
