//! Build: from a scenario to a network that is ready to run, with the telegrams of a configuration tool.

use crate::device::controller::{self, Controller, LifeSettings};
use crate::device::drive::{Drive, Subscriber};
use crate::device::encoder::{Disc, Encoder};
use crate::device::node::{Command, Node};
use crate::device::options::Resolution;
use crate::device::profile::AcyclicLimits;
use crate::device::tool::{self, Tool};
use crate::device::unit::{self, UnitSettings};
use crate::dp::CLOCK_GROUP;
use crate::dp::class2::{self, Class2};
use crate::dp::handler::{Patch, SlaveParams, StartupTelegram};
use crate::dp::iso::Rearm;
use crate::dp::master::{Master, Pace, Settings};
use crate::dp::ms2::{self, client};
use crate::fdl::active::HoldToken;
use crate::observation::MasterMode;
use crate::sim::crystal::Crystal;
use crate::sim::fault::order::OrderFault;
use crate::sim::fault::{Disturbance, Faults, What};
use crate::sim::jitter::JitterSource;
use crate::sim::motion::{self, Shaft};
use crate::sim::network::{self, Act, Network, NetworkEvent, Site, Wiring};
use crate::sim::noise::{LinkJitter, Purpose, Stream};
use crate::sim::queue::Queue;
use crate::sim::topology::Place;
use crate::study::plan::{self, Plan};
use crate::study::scenario::{self, Action, Class1, CodeSequence, Event, Scenario, Slave, When};
use crate::time::{Local, Span, Time};
use crate::wire::Address;
use crate::wire::drive::G1Stw;
use crate::wire::parameter::ParameterAddress;
use crate::wire::prm::{
    DpV1Status, DxbLink, DxbSubscription, EncoderOptions, IsoM, PrmBuilder, SetPrm, StationStatus, UserPrm81,
};

/// A station's clock shows anything up to this when the run begins: clocks need not agree.
const CLOCK_START: Span = Span::from_s(1);
/// Data_Control_Time, where the master's watchdog does not set it.
const DATA_CONTROL_TIME: Span = Span::from_ms(600);

/// The data unit of Set_Prm for a slave of this scenario (manual 3.1).
///
/// # Panics
/// If the scenario breaks a rule that reading it checks.
pub fn set_prm(scenario: &Scenario, slave: &Slave) -> Vec<u8> {
    let bus = &scenario.bus.params;
    let publisher = scenario.publishes(slave.address);
    // A publisher's listeners need the time of an idle line (Model: D27).
    let min_tsdr = plan::min_tsdr(bus, publisher);
    let owner = scenario.class1(slave.master);
    let watchdog = owner.map_or(scenario.master.watchdog, |class1| class1.watchdog);
    let clocked = scenario.is_clocked(slave);
    let services = slave.services;
    let prm = SetPrm {
        status: (StationStatus::LOCK)
            .with(StationStatus::SYNC, services.sync)
            .with(StationStatus::FREEZE, services.freeze)
            .with(StationStatus::WD_ON, watchdog.is_some()),
        wd_fact_1: watchdog.map_or(1, |watchdog| watchdog.factor_1),
        wd_fact_2: watchdog.map_or(1, |watchdog| watchdog.factor_2),
        min_tsdr: min_tsdr.0.min(u8::MAX.into()) as u8,
        ident: slave.device.ident,
        group: if clocked { CLOCK_GROUP } else { 0 } | services.groups,
        dpv1: (DpV1Status::DPV1_ENABLE | DpV1Status::PRM_STRUCTURE)
            .with(DpV1Status::ISOM_REQ, clocked)
            .with(DpV1Status::WD_BASE_1MS, watchdog.is_some_and(|watchdog| watchdog.base_1ms))
            .with(DpV1Status::FAIL_SAFE, slave.device.fail_safe)
            .with(DpV1Status::PUBLISHER_ENABLE, publisher)
            | preset_status(slave),
        blocks: preset_blocks(slave),
    };
    let builder = PrmBuilder::new(&prm).and_then(|builder| {
        let own = !slave.device.subscriber && preset_blocks(slave).is_empty();
        let builder = if own { builder.user_81(&user_block(slave)) } else { Some(builder) }?;
        let builder = if clocked { builder.iso_m(&iso_block(scenario, slave))? } else { builder };
        let (links, subscriptions) = tables_of(scenario, slave.address);
        let builder = if links.is_empty() { Some(builder) } else { builder.dxb_links(&links) }?;
        if subscriptions.is_empty() { Some(builder) } else { builder.dxb_subscriptions(&subscriptions) }
    });
    builder.expect("a checked scenario fits into Set_Prm").octets().to_vec()
}

/// DPV1_Status as a GSD file presets it, without what the configuration tool decides and what is reserved.
fn preset_status(slave: &Slave) -> DpV1Status {
    let preset = slave.user_prm.first_chunk().map_or(DpV1Status::default(), |&octets| DpV1Status::from_octets(octets));
    let [_, check_cfg_mode, _] = DpV1Status::CHECK_CFG_MODE.octets();
    let [_, octet_9, _] = preset.octets();
    DpV1Status::from_octets([0, preset.alarms() | octet_9 & check_cfg_mode, preset.alarm_mode()])
}
/// The blocks of a GSD file's user parameters.
fn preset_blocks(slave: &Slave) -> &[u8] {
    slave.user_prm.get(3..).unwrap_or_default()
}

fn user_block(slave: &Slave) -> UserPrm81 {
    let Resolution { steps_per_rev, revolutions } = slave.resolution();
    let positions = u64::from(steps_per_rev) * u64::from(revolutions);
    let scaling = slave.scaling;
    UserPrm81 {
        options: EncoderOptions::default()
            .with(EncoderOptions::COUNTER_CLOCKWISE, slave.code_sequence == CodeSequence::Ccw)
            .with(EncoderOptions::ACTIVATE, slave.functions)
            // Bit 3 is the default of the GSD; without bit 1 it does nothing (manual 3.2.2).
            .with(EncoderOptions::SCALING, scaling.is_some() || !slave.functions),
        units_per_revolution: scaling.map_or(steps_per_rev, |scaling| scaling.units_per_rev),
        // Not in force without scaling.
        total_range: scaling.map_or(positions.min(u32::MAX.into()) as u32, |scaling| scaling.total_range),
        max_failures: slave.max_life_failures,
        reserved: [0; 7],
    }
}

fn iso_block(scenario: &Scenario, slave: &Slave) -> IsoM {
    let device = &slave.device;
    let units = |span: Span| (span.ticks() / Span::TICKS_PER_ISO_UNIT) as u32;
    // Only a network to plan has longer ones.
    let short = |units: u32| units.min(u16::MAX.into()) as u16;
    let t_dx = Plan::of(scenario).t_dx_told();
    IsoM {
        version: 1,
        t_base_dp: device.t_base_dp,
        t_dp: short(units(scenario.master.t_dp) / device.t_base_dp),
        t_mapc: scenario.master.t_mapc,
        t_base_io: device.t_base_io,
        t_i: short(units(slave.times.t_i) / device.t_base_io),
        t_o: short(units(slave.times.t_o) / device.t_base_io),
        t_dx: units(t_dx),
        t_pll_w: short(units(slave.times.t_pll_w)),
        t_pll_d: short(units(slave.times.t_pll_d)),
    }
}

/// The entries that `subscriber` gets: those of the link table and those of the subscriber table.
fn tables_of(scenario: &Scenario, subscriber: Address) -> (Vec<DxbLink>, Vec<DxbSubscription>) {
    let (mut links, mut subscriptions) = (Vec::new(), Vec::new());
    for link in scenario.links.iter().filter(|link| link.subscriber == subscriber) {
        let inputs = scenario.slave(link.publisher).map_or(0, |slave| slave.device.inputs);
        let (publisher, length) = (link.publisher.get(), link.publisher_length.unwrap_or(inputs));
        for sample in &link.samples {
            let entry = DxbLink { publisher, length, offset: sample.offset, sample: sample.length };
            match link.slot() {
                None => links.push(entry),
                Some(slot) => subscriptions.push(DxbSubscription { link: entry, slot, destination: sample.to }),
            }
        }
    }
    (links, subscriptions)
}

/// What the master knows of a slave beforehand.
pub fn slave_params(scenario: &Scenario, slave: &Slave) -> SlaveParams {
    SlaveParams {
        address: slave.address,
        prm: set_prm(scenario, slave),
        cfg: slave.device.config.to_vec(),
        outputs: slave.device.outputs,
        inputs: slave.device.inputs,
        publisher: scenario.publishes(slave.address),
        fail_safe: slave.device.fail_safe,
        get_cfg: scenario.class1(slave.master).map_or(scenario.master.get_cfg, |class1| class1.get_cfg),
        max_diag: slave.device.max_diag,
        min_interval: slave.min_slave_interval(),
        ms1_timeout: scenario.master.ms1_timeout.unwrap_or(slave.device.c1.response_timeout),
    }
}

/// The network of a checked scenario.
///
/// # Panics
/// If the scenario breaks a rule that reading it checks.
pub fn network<Q: Queue<NetworkEvent>>(scenario: &Scenario) -> Network<Node, Q> {
    network_beside(scenario, scenario)
}

/// The same with paths on which the disturbances of `other` can act too, which sleep: a network that runs gets no new
/// ones ([`Network::set_faults`]).
///
/// # Panics
/// If the scenario breaks a rule that reading it checks, or both together have too many cuts ([`cuts_beside`]).
pub fn network_beside<Q: Queue<NetworkEvent>>(scenario: &Scenario, other: &Scenario) -> Network<Node, Q> {
    let seed = scenario.run.seed;
    let master = &scenario.master;
    let mut sites = vec![Site {
        machine: Node::Master(master_of(scenario)),
        place: place(scenario, master.address),
        crystal: crystal(seed, master.address, master.crystal),
        shaft: None,
        powered_at: Time::ZERO + master.powered_at,
    }];
    sites.extend(scenario.class1.iter().map(|class1| Site {
        machine: Node::Master(further_master(scenario, class1)),
        place: place(scenario, class1.address),
        crystal: crystal(seed, class1.address, class1.crystal),
        shaft: None,
        powered_at: Time::ZERO + class1.powered_at,
    }));
    sites.extend(scenario.slaves.iter().map(|slave| site(scenario, slave)));
    sites.extend(scenario.class2.iter().map(|class2| class2_site(scenario, class2)));
    let jitter = JitterSource::new(master.gc_jitter.clone(), seed, master.address.get()).expect("a checked jitter");
    let mut network =
        Network::new(scenario.bus.params.rate, (wiring(scenario, other), sites), jitter, faults(scenario));
    order_disturbances(&mut network, scenario);
    order(&mut network, scenario, &scenario.events);
    network
}

/// The disturbances of a scenario at work, with the draws of its seed for each of its stations.
pub fn faults(scenario: &Scenario) -> Faults {
    let stations: Vec<_> = scenario.stations().map(|station| station.address).collect();
    Faults::new(&scenario.disturbances, scenario.run.seed, &stations)
}

/// Gives `network` the orders of `events`, which are events of `scenario`.
pub fn order<Q: Queue<NetworkEvent>>(network: &mut Network<Node, Q>, scenario: &Scenario, events: &[Event]) {
    for event in events {
        let when = match event.when {
            When::Time(span) => network::When::Time(Time::ZERO + span),
            When::Cycle(cycle) => network::When::Cycle(cycle),
        };
        for &(station, act) in &acts(scenario, &event.slaves, event.action) {
            network.order(when, station, act);
        }
    }
}

/// Tells `network` what the disturbances of `scenario` order of masters.
pub fn order_disturbances<Q: Queue<NetworkEvent>>(network: &mut Network<Node, Q>, scenario: &Scenario) {
    for (number, disturbance) in scenario.disturbances.iter().enumerate() {
        if let What::Order(stations, fault) = &disturbance.what {
            let [begin, end] = order_bursts(scenario, stations, *fault);
            network.order_bursts(number as u16, &begin, &end);
        }
    }
}

/// What a disturbance orders of these masters, or of the masters of these slaves, at the beginning and at the end of a burst.
fn order_bursts(scenario: &Scenario, slaves: &[Address], fault: OrderFault) -> [Vec<(Address, Command)>; 2] {
    let owner = |slave| scenario.slave(slave).map_or(scenario.master.address, |slave| slave.master);
    let all = |order: &dyn Fn(Address) -> Command| slaves.iter().map(|&slave| (owner(slave), order(slave))).collect();
    let life = |order: &dyn Fn(Address) -> controller::Command| all(&|slave| Command::Application(order(slave)));
    let t_mapc = u32::from(scenario.master.t_mapc);
    match fault {
        OrderFault::HoldLife => {
            [life(&|slave| controller::Command::HoldLife(slave, None)), life(&controller::Command::ReleaseLife)]
        }
        OrderFault::JumpLife(to) => [life(&|slave| controller::Command::JumpLife(slave, to)), Vec::new()],
        OrderFault::RepeatLife => [life(&|slave| controller::Command::HoldLife(slave, Some(t_mapc))), Vec::new()],
        OrderFault::HoldToken(by) => {
            let hold = |by| slaves.iter().map(|&master| (master, Command::HoldToken(HoldToken(by)))).collect();
            [hold(by), hold(Span::ZERO)]
        }
        OrderFault::Overlong(overlong) => {
            let order = |order| slaves.iter().map(|&master| (master, Command::Overlong(order))).collect();
            [order(Some(overlong)), order(None)]
        }
        OrderFault::WrongPrm(patch) => {
            let prm = |patch| move |slave| Command::Patch(slave, StartupTelegram::Prm, patch);
            [all(&prm(patch)), all(&prm(Patch::default()))]
        }
    }
}

/// The disturbances of `scenario`, and those of `other` that are not the same but for their windows.
fn disturbances<'a>(scenario: &'a Scenario, other: &'a Scenario) -> impl Iterator<Item = &'a Disturbance> {
    let known = |new: &&Disturbance| {
        scenario.disturbances.iter().any(|disturbance| (&disturbance.name, &disturbance.what) == (&new.name, &new.what))
    };
    scenario.disturbances.iter().chain(other.disturbances.iter().filter(move |new| !known(new)))
}
/// The cuts of both scenarios, each with the name of the disturbance that makes it.
pub fn cuts_beside(scenario: &Scenario, other: &Scenario) -> Vec<(String, Place)> {
    let cut = |disturbance: &Disturbance| match disturbance.what {
        What::Cut(place) => Some((disturbance.name.clone(), place)),
        _ => None,
    };
    disturbances(scenario, other).filter_map(cut).collect()
}

/// The cables of `scenario`, with what the disturbances of both make of them; every repeater with jitter has its own
/// draws, by its name.
fn wiring(scenario: &Scenario, other: &Scenario) -> Wiring {
    let seed = scenario.run.seed;
    let jitter = scenario.topology.repeaters().iter().enumerate().filter_map(|(index, repeater)| {
        let more = disturbances(scenario, other).filter_map(|disturbance| match disturbance.what {
            What::Repeater(at, half_width) if at == index => Some((disturbance, half_width)),
            _ => None,
        });
        let own = LinkJitter::new(repeater.jitter, seed, &repeater.name);
        let mut more = more.peekable();
        let strays = repeater.jitter > Span::ZERO || more.peek().is_some();
        let jitter =
            more.fold(own, |jitter, (disturbance, width)| jitter.with((index, width), seed, &disturbance.name));
        strays.then_some((index, jitter))
    });
    let cuts = cuts_beside(scenario, other);
    Wiring { tree: scenario.topology.tree().clone(), jitter: jitter.collect(), cuts }
}

/// Where a station is.
fn place(scenario: &Scenario, station: Address) -> Place {
    scenario.topology.place(scenario.point(station).expect("a station of the scenario"))
}

fn master_of(scenario: &Scenario) -> Master<Controller> {
    let master = &scenario.master;
    // A station that is no slave to the master is not in its list.
    let slaves: Vec<&Slave> = scenario.configured().collect();
    let settings = Settings {
        address: master.address,
        bus: scenario.bus.params,
        t_dp: master.t_dp,
        pace: master.pace,
        shared: !scenario.class1.is_empty() || !scenario.class2.is_empty(),
        rearm: if master.accumulate { Rearm::LastSent } else { Rearm::Grid },
        dx_retries: master.dx_retries,
        lost_after: master.lost_after.min(u16::MAX.into()) as u16,
        clear_for: master.clear_for,
        active_spare: master.active_spare,
        data_control_time: data_control_time(master),
        auto_clear: master.services.auto_clear,
        slaves: slaves.iter().map(|slave| slave_params(scenario, slave)).collect(),
    };
    let life = LifeSettings { t_mapc: master.t_mapc, start: master.life_start, delay: master.life_delay };
    let addresses = slaves.iter().map(|slave| slave.address);
    Master::new(settings, Controller::new(addresses, life))
}

/// A free-running master beside `[master]`.
fn further_master(scenario: &Scenario, class1: &Class1) -> Master<Controller> {
    let slaves: Vec<&Slave> = scenario.slaves_of(class1.address).collect();
    let settings = Settings {
        address: class1.address,
        bus: scenario.bus.params,
        // What it is for is the pace of Global_Control.
        t_dp: class1.least_cycle.max(Span::from_ms(1)),
        pace: Pace::Free { least: class1.least_cycle },
        shared: true,
        rearm: Rearm::Grid,
        dx_retries: class1.dx_retries,
        lost_after: class1.lost_after.min(u16::MAX.into()) as u16,
        clear_for: class1.clear_for,
        active_spare: false,
        data_control_time: class1.watchdog.map_or(DATA_CONTROL_TIME, scenario::Watchdog::span),
        auto_clear: false,
        slaves: slaves.iter().map(|slave| slave_params(scenario, slave)).collect(),
    };
    let life = LifeSettings { t_mapc: 1, start: 1, delay: 0 };
    Master::new(settings, Controller::new(slaves.iter().map(|slave| slave.address), life))
}

/// The scenario's, else the time after which slaves without a master clear their outputs, so that both sides agree.
fn data_control_time(master: &scenario::Master) -> Span {
    let watchdog = || master.watchdog.map_or(DATA_CONTROL_TIME, scenario::Watchdog::span);
    master.services.data_control_time.unwrap_or_else(watchdog)
}

fn site(scenario: &Scenario, slave: &Slave) -> Site<Node> {
    let settings = UnitSettings {
        options: slave.options,
        ..UnitSettings::new(slave.address, scenario.bus.params.rate, slave.t_sdr)
    };
    let machine = if slave.silent {
        Node::Silent(slave.address)
    } else if slave.device.subscriber {
        Node::Drive(Drive::new(&slave.device, settings, Subscriber::new(&slave.device, slave.address)))
    } else {
        Node::Encoder(Encoder::new(&slave.device, settings, Disc::new(&slave.device, &slave.options)))
    };
    let Resolution { steps_per_rev, revolutions } = slave.resolution();
    let resolution = motion::Resolution::new(steps_per_rev, revolutions);
    let shaft = Shaft::new(&slave.motion).expect("a checked motion");
    Site {
        machine,
        place: place(scenario, slave.address),
        crystal: crystal(scenario.run.seed, slave.address, slave.crystal),
        shaft: Some((shaft, resolution.expect("a checked resolution"))),
        powered_at: Time::ZERO + slave.powered_at,
    }
}

/// A class 2 master with its jobs.
fn class2_site(scenario: &Scenario, class2: &scenario::Class2) -> Site<Node> {
    let bus = scenario.bus.params;
    let mut slaves: Vec<Address> = class2.jobs.iter().flat_map(|job| job.slaves.iter().copied()).collect();
    slaves.sort_unstable();
    slaves.dedup();
    let jobs = class2.jobs.iter().flat_map(|job| {
        let pairs = job.works.iter().flat_map(|work| job.slaves.iter().map(move |slave| (work, slave)));
        pairs.map(|(work, slave)| tool::Job {
            slave: slaves.binary_search(slave).expect("a slave of a job"),
            work: work.clone(),
            start: job.start,
            period: job.period,
        })
    });
    let jobs = jobs.collect();
    let shortest = ms2::TIMEOUT_UNIT * i64::from(ms2::send_timeout(bus.rate));
    let ms2 = |&slave: &Address| {
        let settings = client::Settings {
            send_timeout: class2.send_timeout.unwrap_or(shortest).div_floor(ms2::TIMEOUT_UNIT) as u16,
            response_timeout: class2.response_timeout.unwrap_or(limits_of(scenario, slave).response_timeout),
            profile_ident: unit::PROFILE_IDENT,
        };
        (slave, settings)
    };
    let partners = slaves.iter().map(ms2).collect();
    let settings = class2::Settings { address: class2.address, bus, per_token: class2.per_token, slaves: partners };
    Site {
        machine: Node::Class2(Class2::new(settings, Tool::new(slaves, jobs))),
        place: place(scenario, class2.address),
        crystal: crystal(scenario.run.seed, class2.address, class2.crystal),
        shaft: None,
        powered_at: Time::ZERO + class2.powered_at,
    }
}

/// What a slave takes of class 2 masters.
fn limits_of(scenario: &Scenario, slave: Address) -> AcyclicLimits {
    scenario.slave(slave).map_or(AcyclicLimits::FULL, |slave| slave.device.c2)
}

/// A station's crystal: its offset set or drawn, its start always drawn.
fn crystal(seed: u64, station: Address, crystal: scenario::Crystal) -> Crystal {
    let mut stream = Stream::new(seed, station.get(), Purpose::CrystalStart);
    let start = Local::from_ticks(stream.below(CLOCK_START.ticks() as u64) as i64);
    Crystal::new(crystal_offset(seed, station, crystal), start).expect("a checked offset")
}
/// How far a station's crystal is off (10^-9).
pub fn crystal_offset(seed: u64, station: Address, crystal: scenario::Crystal) -> i64 {
    match crystal {
        scenario::Crystal::Offset(ppb) => ppb,
        scenario::Crystal::Within(ppb) => {
            let mut stream = Stream::new(seed, station.get(), Purpose::CrystalOffset);
            stream.uniform(Span::from_ticks(ppb)).ticks()
        }
    }
}

/// An action as orders to stations.
fn acts(scenario: &Scenario, slaves: &[Address], action: Action) -> Vec<(Address, Act<Command>)> {
    let master = scenario.master.address;
    let owner = |slave| scenario.slave(slave).map_or(master, |slave| slave.master);
    let to_slaves = |act: Act<Command>| slaves.iter().map(|&slave| (slave, act)).collect();
    let for_slaves = |order: &dyn Fn(Address) -> controller::Command| {
        slaves.iter().map(|&slave| (owner(slave), Act::Command(Command::Application(order(slave))))).collect()
    };
    match action {
        Action::PowerOff => to_slaves(Act::PowerOff),
        Action::PowerOn => to_slaves(Act::PowerOn),
        Action::ReadParameter { parameter, subindex, elements } => for_slaves(&|slave| {
            let address = ParameterAddress { attribute: ParameterAddress::VALUE, elements, pnu: parameter, subindex };
            controller::Command::ReadParameter(slave, address)
        }),
        Action::ChangeParameter { parameter, subindex, format, value } => for_slaves(&|slave| {
            let address =
                ParameterAddress { attribute: ParameterAddress::VALUE, elements: 1, pnu: parameter, subindex };
            controller::Command::ChangeParameter(slave, address, format, value)
        }),
        Action::Startup { telegram, patch } => {
            slaves.iter().map(|&slave| (owner(slave), Act::Command(Command::Patch(slave, telegram, patch)))).collect()
        }
        Action::Clear => vec![(master, Act::Command(Command::Mode(MasterMode::Clear)))],
        Action::Operate => vec![(master, Act::Command(Command::Mode(MasterMode::Operate)))],
        Action::Control(control) => vec![(master, Act::Command(Command::Control(control)))],
        Action::Acknowledge => for_slaves(&controller::Command::Acknowledge),
        Action::HoldLifeSign { cycles } => for_slaves(&|slave| controller::Command::HoldLife(slave, cycles)),
        Action::ReleaseLifeSign => for_slaves(&controller::Command::ReleaseLife),
        Action::JumpLifeSign { to } => for_slaves(&|slave| controller::Command::JumpLife(slave, to)),
        Action::ControlWord { value } => for_slaves(&|slave| controller::Command::ControlWord(slave, G1Stw(value))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three encoders at 12 Mbit/s, T_DP 2 ms, T_I 125 us, T_O 375 us, watchdog 200 ms.
    const THREE: &str = r#"
        [run]
        cycles = 1
        [bus]
        rate = "12 Mbit/s"
        [master]
        address = 2
        t_dp = "2 ms"
        t_i = "125 us"
        t_o = "375 us"
        watchdog = "200 ms"
        [[slave]]
        addresses = "6..8"
        device = "simodrive-sensor-isochron"
    "#;
    const LINK: &str = r#"
        [[slave]]
        address = 9
        device = "subscriber-drive"
        [[link]]
        publisher = 6
        subscriber = 9
    "#;

    fn octets(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|octet| u8::from_str_radix(octet, 16).expect("an octet")).collect()
    }

    /// The worked telegram: T_DX is 2674 units of 1/12 us, the user block is the GSD's default.
    #[test]
    fn set_prm_is_the_telegram_of_a_configuration_tool() {
        let three = Scenario::parse("three", "three.toml", THREE, &[]).expect("a good scenario");
        let expected = octets(
            "88 14 01 0B 80 F9 80 C0 00 18 \
             15 81 00 00 08 00 00 20 00 02 00 00 00 01 00 00 00 00 00 00 00 \
             1C 04 00 00 01 00 00 05 DC 00 10 01 00 00 05 DC 00 01 00 03 00 00 0A 72 00 0C 00 00",
        );
        assert_eq!(set_prm(&three, &three.slaves[0]), expected);
    }

    #[test]
    fn a_publisher_waits_for_an_idle_line_and_a_subscriber_gets_its_links() {
        let text = [THREE, LINK].concat().replace("375 us", "500 us");
        let four = Scenario::parse("four", "four.toml", &text, &[]).expect("a good scenario");
        let publisher = set_prm(&four, &four.slaves[0]);
        assert_eq!((publisher[3], publisher[7]), (76, 0xE0), "min T_SDR is T_ID1, Publisher_Enable is set");
        let subscriber = set_prm(&four, &four.slaves[3]);
        assert_eq!(subscriber[10 + IsoM::LEN..], octets("09 03 00 00 01 06 0C 04 04"));
    }

    #[test]
    fn a_subscriber_gets_both_tables_with_all_samples() {
        let more = r#"
            table = "subscriber"
            [[link]]
            publisher = 7
            subscriber = 9
            samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]
            [[link]]
            publisher = 7
            subscriber = 9
            table = "subscriber"
            slot = 2
            samples = [{ offset = 8, length = 4, to = 6 }, { offset = 2, length = 2 }]
            [[link]]
            publisher = 8
            subscriber = 9
            publisher_length = 10
        "#;
        let text = [THREE, LINK, more].concat().replace("375 us", "500 us");
        let four = Scenario::parse("four", "four.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let subscriber = set_prm(&four, &four.slaves[3]);
        let expected = octets(
            "11 03 00 00 01 07 0C 04 04 07 0C 00 02 08 0A 04 04 \
             17 07 00 00 01 06 0C 04 01 00 04 07 0C 08 02 06 04 07 0C 02 02 0A 02",
        );
        assert_eq!(subscriber[10 + IsoM::LEN..], expected);
    }
}
