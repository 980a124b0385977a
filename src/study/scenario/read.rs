//! The tree of a scenario becomes a [`Scenario`], table by table and key by key.

use super::acyclic;
use super::class1;
use super::class2;
use super::disturbance;
use super::error::Fault;
use super::expect;
use super::flight;
use super::gsd;
use super::jitter;
use super::kinds::{self, ACTIONS, Kind, address};
use super::link::link;
use super::options;
use super::section::{Around, Reader, Section, cycle_time, instant, number, quantity, suggestion, text, yes};
use super::services;
use super::topology::{self, cable, spread, station_segment};
use super::tree::{Node, Place, Table, Value};
use super::{
    Action, Bus, CodeSequence, Crystal, CsvTable, Disturbance, Event, Extent, IsoTimes, Master, Record, Run, Scaling,
    Scenario, Slave, Topology, Watchdog, When,
};
use crate::device::profile::Profile;
use crate::dp::master::Pace;
use crate::fdl::params::BusParams;
use crate::sim::jitter::GcJitter;
use crate::sim::motion::{Angle, Motion};
use crate::study::invocation::Invocation;
use crate::study::plan::Plan;
use crate::study::quantity::{bit_rate, ppb, tbit};
use crate::time::{BitRate, Span, Tbit};
use crate::wire::Address;

/// The tables of a file; the second half is lists, `[[slave]]`.
const TABLES: [&str; 13] = [
    "run",
    "bus",
    "master",
    "record",
    expect::EXPECT,
    "segment",
    "repeater",
    "slave",
    "class1",
    "class2",
    "link",
    "event",
    "disturbance",
];
/// How many of [`TABLES`] are single tables.
const SINGLE: usize = 5;
/// The single tables.
pub(in crate::study) const TABLES_OF_ONE: &[&str] = TABLES.split_at(SINGLE).0;

/// A slave's table after its list of addresses has been written out: one per slave.
pub(super) struct SlaveTable {
    pub(super) address: Address,
    /// Of the key that says the address.
    address_place: Place,
    place: Place,
    pub(super) table: Table,
}

/// Reads everything. `None` if something is missing or wrong; the reader knows what.
pub(super) fn scenario(reader: &mut Reader<'_>, mut root: Table) -> Option<Scenario> {
    unknown_tables(reader, &root);
    let slave_tables = changed(reader, &mut root);
    let run = run(Section::of_file(reader, &root, "run"), reader);
    let bus = bus(Section::of_file(reader, &root, "bus"), reader);
    let rate = bus.map_or(BitRate::M12, |bus| bus.params.rate);
    let topology = topology::read(reader, &root, rate, bus.map_or(0, |bus| bus.cable_mm));
    let section = Section::of_file(reader, &root, "master");
    let (master, times) = master(section, reader, rate, topology.as_ref()).unzip();
    let tables = slave_tables.iter().map(|slave| &slave.table);
    let positions = topology.as_ref().map(|topology| spread(topology, tables)).unwrap_or_default();
    let mut slaves = Vec::with_capacity(slave_tables.len());
    for (index, table) in slave_tables.iter().enumerate() {
        let position_mm = positions.get(index).copied().unwrap_or(0);
        let context = Context {
            bus: bus.as_ref(),
            master: master.as_ref(),
            topology: topology.as_ref(),
            times: times.as_ref(),
            position_mm,
        };
        slaves.extend(slave(reader, table, &context));
    }
    let addresses: Vec<_> = slave_tables.iter().map(|table| table.address).collect();
    let class1 = list(reader, &root, "class1", |section, reader| class1::read(section, reader, topology.as_ref()));
    let class2 =
        list(reader, &root, "class2", |section, reader| class2::read(section, reader, &addresses, topology.as_ref()));
    let links = list(reader, &root, "link", link);
    let events = list(reader, &root, "event", |section, reader| event(section, reader, &addresses));
    let heard = slaves.iter().filter(|slave| !slave.silent);
    let masters = heard.map(|slave| (slave.address, slave.master)).collect();
    reader.around = Around { slaves: addresses, masters, topology: topology.clone(), rate };
    let disturbances = disturbances(reader, &root);
    let record = record(Section::of_file(reader, &root, "record"), reader);
    let expectations = expect::read(reader, &root, rate);
    let mut scenario = Scenario {
        name: String::new(),
        question: String::new(),
        run: run?,
        bus: bus?,
        topology: topology?,
        master: master?,
        class1,
        slaves,
        class2,
        links,
        events,
        disturbances,
        record,
        invocation: Invocation::default(),
        expectations,
    };
    if scenario.master.pace != Pace::Synch {
        scenario.master.t_dp = Plan::of(&scenario).free_running(&scenario).with_gap();
    }
    Some(scenario)
}

/// Complains about tables that nothing is known of.
fn unknown_tables(reader: &mut Reader<'_>, root: &Table) {
    for (name, (place, _)) in &root.0 {
        if !TABLES.contains(&name.as_str()) {
            let fault = Fault::new("there is no such table").help(suggestion(name, TABLES.into_iter()));
            reader.complain(*place, name, fault);
        }
    }
}

/// The tables of the list `name`.
fn tables<'t>(reader: &mut Reader<'_>, root: &'t Table, name: &str) -> Vec<(Place, &'t Table)> {
    let Some((place, node)) = root.0.get(name) else { return Vec::new() };
    let mut all = Vec::new();
    let mut bad = !matches!(node.value, Value::List(_));
    if let Value::List(items) = &node.value {
        for item in items {
            match &item.value {
                Value::Table(table) => all.push((item.place, table)),
                _ => bad = true,
            }
        }
    }
    if bad {
        let fault = Fault::new(format!("this is {}", node.value.noun())).help(format!("write [[{name}]]"));
        reader.complain(*place, name, fault);
    }
    all
}

/// Reads the list `name` with `read`, entry by entry.
pub(super) fn list<T>(
    reader: &mut Reader<'_>,
    root: &Table,
    name: &str,
    read: impl Fn(Section<'_>, &mut Reader<'_>) -> Option<T>,
) -> Vec<T> {
    let tables = tables(reader, root, name);
    let sections = tables.into_iter().enumerate();
    sections
        .filter_map(|(i, (place, table))| read(Section::new(format!("{name}.{}", i + 1), place, Some(table)), reader))
        .collect()
}

/// Reads every `[[disturbance]]`; a name is taken once.
fn disturbances(reader: &mut Reader<'_>, root: &Table) -> Vec<Disturbance> {
    let mut all = Vec::new();
    for (i, (place, table)) in tables(reader, root, "disturbance").into_iter().enumerate() {
        let section = Section::new(format!("disturbance.{}", i + 1), place, Some(table));
        all.extend(disturbance::read(section, reader, &all));
    }
    all
}

/// Writes out the addresses of every `[[slave]]`, in address order; of two slaves at one address the first comes first.
fn slave_tables(reader: &mut Reader<'_>, root: &Table) -> Vec<SlaveTable> {
    let mut all = Vec::new();
    for (place, table) in tables(reader, root, "slave") {
        let mut section = Section::new("slave", place, Some(table));
        for (address, address_place) in addresses_of(reader, &mut section) {
            reader.places.insert(format!("slave.{address}.address"), address_place);
            let mut table = table.clone();
            table.0.retain(|key, _| key != "address" && key != "addresses");
            all.push(SlaveTable { address, address_place, place: section.place(), table });
        }
    }
    all.sort_by_key(|slave: &SlaveTable| slave.address);
    for pair in all.windows(2).filter(|pair| pair[0].address == pair[1].address) {
        let fault = Fault::new(format!("two slaves have the address {}", pair[0].address))
            .rule("every station of a bus has an address of its own (EN 50170-2)");
        let place = pair[0].address_place.max(pair[1].address_place);
        reader.complain(place, "slave.address", fault);
    }
    all.dedup_by_key(|slave| slave.address);
    all
}

/// Puts every override where it belongs, and writes out the slaves.
pub(super) fn changed(reader: &mut Reader<'_>, root: &mut Table) -> Vec<SlaveTable> {
    overrides_of_groups(reader, root);
    let mut slaves = slave_tables(reader, root);
    overrides(reader, root, &mut slaves);
    slaves
}

/// The addresses of one `[[slave]]` with the place that says so.
fn addresses_of(reader: &mut Reader<'_>, section: &mut Section<'_>) -> Vec<(Address, Place)> {
    let one = section.optional(reader, "address", address);
    let many = section.optional(reader, "addresses", address_list);
    let key = match (section.has("address"), section.has("addresses")) {
        (true, false) => "address",
        (false, true) => "addresses",
        _ => {
            let fault = Fault::new("a slave has either address or addresses");
            section.complain(reader, fault.help("for example: address = 3, or addresses = \"3..10\""));
            return Vec::new();
        }
    };
    let place = section.node(key).map_or(Place::Missing, |node| node.place);
    one.into_iter().chain(many.into_iter().flatten()).map(|address| (address, place)).collect()
}

/// Addresses, `3`, `"3..5, 9"` or `[3, 4, 9]`, in order and each once.
pub(super) fn address_list(node: &Node) -> Result<Vec<Address>, Fault> {
    let bad = |part: &str| {
        Fault::new(format!("\"{part}\" is no address and no range of addresses"))
            .help("addresses are 0 to 125; a range is written \"3..10\" and includes both ends")
    };
    let mut all = match &node.value {
        Value::Text(text) => {
            let mut all = Vec::new();
            for part in text.split(',').map(str::trim) {
                let (first, last) = part.split_once("..").unwrap_or((part, part));
                let ends = first.trim().parse::<u8>().ok().zip(last.trim().parse::<u8>().ok());
                let (first, last) = ends.filter(|&(a, b)| a <= b && b <= 125).ok_or_else(|| bad(part))?;
                all.extend((first..=last).filter_map(Address::new));
            }
            all
        }
        Value::List(items) => items.iter().map(address).collect::<Result<_, _>>()?,
        _ => vec![address(node)?],
    };
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// Puts every override of a whole `[[slave]]` table, `slave.#1.addresses`, into it before its addresses are written out.
fn overrides_of_groups(reader: &mut Reader<'_>, root: &mut Table) {
    let source = reader.source;
    for set in &source.sets {
        let path: Vec<&str> = set.path.iter().map(String::as_str).collect();
        let ["slave", group, ref rest @ ..] = path[..] else { continue };
        let Some(number) = group.strip_prefix('#') else { continue };
        let result = match entry(root, "slave", number) {
            Some(table) => put(table, rest, &set.node),
            None => Err(Fault::new(format!("there is no [[slave]] number \"{number}\"")).help("the first is slave.#1")),
        };
        if let Err(fault) = result {
            reader.complain(set.node.place, &set.path.join("."), fault);
        }
    }
}

/// Puts every override into its table.
fn overrides(reader: &mut Reader<'_>, root: &mut Table, slaves: &mut [SlaveTable]) {
    let source = reader.source;
    for set in &source.sets {
        let path: Vec<&str> = set.path.iter().map(String::as_str).collect();
        let key = set.path.join(".");
        let result = match path[..] {
            ["slave", group, ..] if group.starts_with('#') => Ok(()),
            ["slave", station, ref rest @ ..] => {
                if let Some(slave) = slaves.iter_mut().find(|slave| slave.address.to_string() == station) {
                    put(&mut slave.table, rest, &set.node)
                } else {
                    let all: Vec<_> = slaves.iter().map(|slave| slave.address.to_string()).collect();
                    let fault = Fault::new(format!("no slave has the address \"{station}\""));
                    Err(fault.help(format!("the slaves are {}", all.join(", "))))
                }
            }
            [expect::EXPECT, ref rest @ ..] if !rest.is_empty() => {
                expect::put(root, &rest.join("."), &set.node);
                Ok(())
            }
            [name, index, ref rest @ ..] if TABLES[SINGLE..].contains(&name) => match entry(root, name, index) {
                Some(table) => put(table, rest, &set.node),
                None => Err(Fault::new(format!("there is no [[{name}]] number \"{index}\"")).help("the first is 1")),
            },
            [name, _, ..] if TABLES[..SINGLE].contains(&name) => put(root, &path, &set.node),
            [name] if TABLES.contains(&name) => Err(Fault::new("an override names a table and a key")
                .help("for example master.t_dp=2 ms, slave.3.crystal=20 ppm, link.1.length=2")),
            [name, ..] => Err(Fault::new("there is no such table").help(suggestion(name, TABLES.into_iter()))),
            [] => Ok(()),
        };
        if let Err(fault) = result {
            reader.complain(set.node.place, &key, fault);
        }
    }
}

/// The table with this number, counted from 1, of the list `name`.
fn entry<'t>(root: &'t mut Table, name: &str, index: &str) -> Option<&'t mut Table> {
    let (_, Node { value: Value::List(items), .. }) = root.0.get_mut(name)? else { return None };
    match &mut items.get_mut(index.parse::<usize>().ok()?.checked_sub(1)?)?.value {
        Value::Table(table) => Some(table),
        _ => None,
    }
}

/// Keys of which one takes the other's place when it is overridden.
const INSTEAD: [(&str, &str); 4] =
    [("duration", "cycles"), ("at", "cycle"), ("slave", "slaves"), ("address", "addresses")];

/// Puts `node` at `path` under `table`; what is neither table nor list on the way becomes a table. Entries of lists are
/// counted from 1.
fn put(table: &mut Table, path: &[&str], node: &Node) -> Result<(), Fault> {
    match path {
        [] | [""] => Err(Fault::new("an override names a key").help("for example slave.3.crystal=20 ppm")),
        [key] => {
            for (one, other) in INSTEAD.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]) {
                if *key == one {
                    table.0.remove(other);
                }
            }
            table.0.insert((*key).to_owned(), (node.place, node.clone()));
            Ok(())
        }
        [key, rest @ ..] => {
            let empty = || Node { place: node.place, value: Value::Table(Table::default()) };
            let (_, inner) = table.0.entry((*key).to_owned()).or_insert_with(|| (node.place, empty()));
            if !matches!(inner.value, Value::Table(_) | Value::List(_)) {
                *inner = empty();
            }
            match &mut inner.value {
                Value::Table(inner) => put(inner, rest, node),
                Value::List(items) => put_in_list(key, items, rest, node),
                _ => Ok(()),
            }
        }
    }
}
/// Puts `node` at `path`, which begins with a number, into the list `key`.
fn put_in_list(key: &str, items: &mut [Node], path: &[&str], node: &Node) -> Result<(), Fault> {
    let [index, rest @ ..] = path else { return Ok(()) };
    let help = match items.len() {
        0 => "the list is empty".to_owned(),
        1 => format!("it has one: {key}.1"),
        count => format!("it has {key}.1 to {key}.{count}"),
    };
    let number = index.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    let Some(item) = number.and_then(|number| items.get_mut(number)) else {
        return Err(Fault::new(format!("the list {key} has no number \"{index}\"")).help(help));
    };
    match (&mut item.value, rest) {
        (Value::Table(table), rest) => put(table, rest, node),
        (Value::List(items), [_, ..]) => put_in_list(index, items, rest, node),
        (_, []) => {
            *item = node.clone();
            Ok(())
        }
        (_, [key, ..]) => Err(Fault::new(format!("entry {index} of the list has no keys, and so no \"{key}\""))),
    }
}

/// Reads `[run]`.
fn run(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Run> {
    let seed = section.optional(reader, "seed", number(0..=u64::MAX)).unwrap_or(1);
    let time = section.optional(reader, "duration", instant);
    let cycles = section.optional(reader, "cycles", number(0..=u64::MAX));
    if section.has("duration") == section.has("cycles") {
        let fault = Fault::new("a run has either duration or cycles");
        section.complain(reader, fault.help("for example: duration = \"20 s\", or cycles = 10000"));
    }
    let max_events = section.optional(reader, "max_events", number(1..=u64::MAX));
    section.finish(reader);
    let duration = time.map(Extent::Time).or(cycles.map(Extent::Cycles))?;
    Some(Run { seed, duration, max_events })
}

/// Reads `[bus]`.
fn bus(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Bus> {
    let rate = section.required(reader, "rate", "\"12 Mbit/s\"", quantity("12 Mbit/s", bit_rate));
    let mut params = BusParams::profile(rate.unwrap_or(BitRate::M12));
    let bits: [(&'static str, &mut Tbit); 5] = [
        ("t_sl", &mut params.t_sl),
        ("min_tsdr", &mut params.min_tsdr),
        ("max_tsdr", &mut params.max_tsdr),
        ("t_set", &mut params.t_set),
        ("t_qui", &mut params.t_qui),
    ];
    for (key, value) in bits {
        let few = |node: &Node| match quantity("300 tbit", tbit)(node)? {
            bits if bits.0 > 65_535 => Err(Fault::new(format!("{bits} is more than any of these times has"))),
            bits => Ok(bits),
        };
        *value = section.optional(reader, key, few).unwrap_or(*value);
    }
    let numbers: [(&'static str, &mut u8); 3] = [
        ("max_retry_limit", &mut params.max_retry_limit),
        ("gap_factor", &mut params.gap_factor),
        ("hsa", &mut params.hsa),
    ];
    for (key, value) in numbers {
        *value = section.optional(reader, key, number(0..=u8::MAX)).unwrap_or(*value);
    }
    let t_tr = section.optional(reader, "t_tr", quantity("100000 tbit", tbit));
    params.t_tr = t_tr.unwrap_or_else(|| BusParams::usual_t_tr(params.hsa.max(1)));
    let cable_mm = section.optional(reader, "cable", cable).unwrap_or(0);
    section.finish(reader);
    rate.map(|_| Bus { params, cable_mm })
}

/// Reads `[master]`: the master and the times that all slaves inherit.
fn master(
    mut section: Section<'_>,
    reader: &mut Reader<'_>,
    rate: BitRate,
    topology: Option<&Topology>,
) -> Option<(Master, Times)> {
    let s = &mut section;
    let address = s.required(reader, "address", "2", address);
    let pace = class1::pace(s, reader);
    let powered_at = s.optional(reader, "powered_at", instant).unwrap_or(Span::ZERO);
    let t_dp = match pace {
        Pace::Synch if reader.proposes && !s.has("t_dp") => Some(Span::from_ms(1)),
        Pace::Synch => s.required(reader, "t_dp", "\"2 ms\"", cycle_time(rate)),
        // The planned cycle, once the slaves are known.
        Pace::Free { .. } => s.optional(reader, "t_dp", cycle_time(rate)).or(Some(Span::ZERO)),
    };
    let t_mapc = s.optional(reader, "t_mapc", number(0..=u8::MAX)).unwrap_or(1);
    let times = Times::read(reader, s, rate);
    let watchdog = s.optional(reader, "watchdog", watchdog).unwrap_or(Some(Watchdog::USUAL));
    let get_cfg = s.optional(reader, "get_cfg", yes).unwrap_or(true);
    let dx_retries = s.optional(reader, "dx_retries", number(0..=15)).unwrap_or(1);
    let lost_after = s.optional(reader, "lost_after", number(1..=u32::from(u16::MAX))).unwrap_or(10);
    let clear_for = s.optional(reader, "clear_for", number(0..=i64::MAX as u64)).unwrap_or(0);
    let crystal = crystal(reader, s);
    let segment = station_segment(s, reader, topology);
    let position_mm = s.optional(reader, "position", cable).unwrap_or(0);
    let jitter = s.table(reader, "gc_jitter");
    let (gc_jitter, accumulate) =
        jitter.and_then(|inner| jitter::of_master(inner, reader)).unwrap_or((GcJitter::None, false));
    let life_start = s.optional(reader, "life_start", number(1..=15)).unwrap_or(1);
    let life_delay = s.optional(reader, "life_delay", number(0..=u32::MAX)).unwrap_or(0);
    let active_spare = s.optional(reader, "active_spare", yes).unwrap_or(false);
    let ms1_timeout = s.optional(reader, "ms1_timeout", acyclic::timeout);
    let services = services::master(s, reader);
    section.finish(reader);
    let (address, t_dp) = (address?, t_dp?);
    let master = Master {
        address,
        segment,
        position_mm,
        crystal,
        pace,
        powered_at,
        t_dp,
        t_mapc,
        watchdog,
        get_cfg,
        dx_retries,
        lost_after,
        clear_for,
        gc_jitter,
        accumulate,
        life_start,
        life_delay,
        active_spare,
        ms1_timeout,
        services,
    };
    Some((master, times))
}

/// Isochronous times where they are given.
#[expect(clippy::struct_field_names, reason = "the standard's names")]
#[derive(Clone, Copy)]
struct Times {
    t_i: Option<Span>,
    t_o: Option<Span>,
    t_pll_w: Option<Span>,
    t_pll_d: Option<Span>,
}

impl Times {
    /// Reads them.
    fn read(reader: &mut Reader<'_>, section: &mut Section<'_>, rate: BitRate) -> Self {
        let mut time = |key| section.optional(reader, key, cycle_time(rate));
        Self { t_i: time("t_i"), t_o: time("t_o"), t_pll_w: time("t_pll_w"), t_pll_d: time("t_pll_d") }
    }
    /// Fills gaps from `other`.
    fn or(self, other: Option<&Self>) -> Self {
        let Some(other) = other else { return self };
        Self {
            t_i: self.t_i.or(other.t_i),
            t_o: self.t_o.or(other.t_o),
            t_pll_w: self.t_pll_w.or(other.t_pll_w),
            t_pll_d: self.t_pll_d.or(other.t_pll_d),
        }
    }
}

/// A watchdog; `"0 ms"` is none.
pub(super) fn watchdog(node: &Node) -> Result<Option<Watchdog>, Fault> {
    let wanted = instant(node)?;
    if wanted == Span::ZERO {
        return Ok(None);
    }
    Watchdog::of(wanted).map(Some).ok_or_else(|| {
        let fine = !wanted.is_multiple_of(Watchdog::BASE) && wanted < Watchdog::BASE_1MS * (255 * 255);
        let step = if fine { Watchdog::BASE_1MS } else { Watchdog::BASE };
        let steps = wanted.div_floor(step).clamp(0, 255 * 255);
        let of = |steps: i64| Watchdog::of(step * steps).map(|watchdog| format!("\"{}\"", watchdog.span()));
        let below = (0..=steps).rev().find_map(of);
        let above = (steps + 1..=255 * 255).find_map(of);
        let nearest: Vec<_> = below.into_iter().chain(above).collect();
        Fault::new(format!("no watchdog runs for {wanted}"))
            .rule(
                "a watchdog is 10 ms x WD_Fact_1 x WD_Fact_2 with factors from 1 to 255 (Set_Prm octets 2 and 3), or 1 ms x \
                 both with WD_Base_1ms_supp (octet 8)",
            )
            .help(format!("the nearest are {}, and \"0 ms\" is off", nearest.join(" and ")))
    })
}

/// A crystal: `"50 ppm"` or `{ within = "50 ppm" }`.
pub(super) fn crystal(reader: &mut Reader<'_>, section: &mut Section<'_>) -> Crystal {
    let is_table = matches!(section.node("crystal"), Some(Node { value: Value::Table(_), .. }));
    if !is_table {
        let offset = section.optional(reader, "crystal", quantity("50 ppm", ppb));
        return Crystal::Offset(offset.unwrap_or(0));
    }
    let Some(mut inner) = section.table(reader, "crystal") else { return Crystal::Offset(0) };
    let width = |node: &Node| match quantity("50 ppm", ppb)(node)? {
        ppb if ppb < 0 => Err(Fault::new("a width is not negative")),
        ppb => Ok(ppb),
    };
    let within = inner.required(reader, "within", "\"50 ppm\"", width);
    inner.finish(reader);
    Crystal::Within(within.unwrap_or(0))
}

/// What a slave inherits.
struct Context<'a> {
    bus: Option<&'a Bus>,
    master: Option<&'a Master>,
    topology: Option<&'a Topology>,
    times: Option<&'a Times>,
    position_mm: u64,
}

/// Reads one slave.
fn slave(reader: &mut Reader<'_>, from: &SlaveTable, context: &Context<'_>) -> Option<Slave> {
    let rate = context.bus.map_or(BitRate::M12, |bus| bus.params.rate);
    let mut section = Section::new(format!("slave.{}", from.address), from.place, Some(&from.table));
    let s = &mut section;
    let kind = gsd::device(s, reader);
    let segment = station_segment(s, reader, context.topology);
    let position_mm = s.optional(reader, "position", cable).unwrap_or(context.position_mm);
    let crystal = crystal(reader, s);
    let t_sdr = s.optional(reader, "t_sdr", quantity("30 tbit", tbit));
    let own = Times::read(reader, s, rate);
    let master = s.optional(reader, "master", address).or(context.master.map(|master| master.address));
    let clocked = context.master.is_none_or(|own| own.pace == Pace::Synch && master == Some(own.address));
    let isochronous = kind.as_ref().is_none_or(|kind| kind.device.isochronous);
    if !clocked {
        class1::refuse_times(s, reader);
    } else if !isochronous {
        class1::refuse_times_of_device(s, reader);
    }
    let standstill = Motion::Standstill { at: Angle::ZERO };
    let motion = match s.table(reader, "motion") {
        Some(inner) => kinds::motion(inner, reader)?,
        None => standstill,
    };
    let max_life_failures = s.optional(reader, "max_life_failures", number(0..=u8::MAX)).unwrap_or(1);
    let options = options::read(s, reader, rate);
    let code_sequence = s.optional(reader, "code_sequence", code_sequence).unwrap_or(CodeSequence::Cw);
    let inner = s.table(reader, "scaling");
    let scaling = inner.and_then(|inner| scaling(inner, reader));
    // Scaling turns octet 15 bit 1 on unless the file says otherwise, which a rule then refuses.
    let functions = s.optional(reader, "functions", yes).unwrap_or(scaling.is_some());
    let silent = s.optional(reader, "silent", yes).unwrap_or(false);
    let powered_at = s.optional(reader, "powered_at", instant).unwrap_or(Span::ZERO);
    let user_prm = gsd::user_prm(kind.as_ref(), s, reader);
    let services = services::slave(s, reader);
    section.finish(reader);
    let times = if clocked && isochronous {
        iso_times(reader, from, own.or(context.times), context.times.is_some())
    } else {
        Some(class1::UNCLOCKED)
    };
    let (device, bus) = (kind?.device, context.bus?);
    let t_sdr = t_sdr.unwrap_or_else(|| default_t_sdr(bus, &device));
    let mut slave = Slave {
        address: from.address,
        master: master?,
        device,
        segment,
        position_mm,
        crystal,
        t_sdr,
        times: times?,
        motion,
        max_life_failures,
        code_sequence,
        functions,
        scaling,
        silent,
        powered_at,
        services,
        options,
        user_prm: Vec::new(),
    };
    if let Some(user_prm) = user_prm {
        user_prm.apply(&mut slave);
    }
    Some(slave)
}

/// The times in force; T_I and T_O must come from the slave or from `[master]`, if that could be read (`master`).
fn iso_times(reader: &mut Reader<'_>, from: &SlaveTable, times: Times, master: bool) -> Option<IsoTimes> {
    for (key, time, example) in [("t_i", times.t_i, "125 us"), ("t_o", times.t_o, "1 ms")] {
        if reader.proposes {
            break;
        }
        let keys = [format!("master.{key}"), format!("slave.{}.{key}", from.address)];
        let given = keys.iter().any(|key| reader.places.contains_key(key));
        if time.is_none() && !given && master {
            let fault = Fault::new(format!("this key is missing, and slave {} has no own {key}", from.address))
                .rule(format!("every slave has its {} (manual 3.3)", key.to_uppercase()))
                .help(format!("for example: {key} = \"{example}\""));
            reader.complain(reader.place(&["master"]), &keys[0], fault);
        }
    }
    let missing = reader.proposes.then_some(Span::ZERO);
    Some(IsoTimes {
        t_i: times.t_i.or(missing)?,
        t_o: times.t_o.or(missing)?,
        t_pll_w: times.t_pll_w.unwrap_or(Span::from_us(1)),
        t_pll_d: times.t_pll_d.unwrap_or(Span::ZERO),
    })
}

/// 30 t_bit, or the nearest that the device may use (Model: D2).
fn default_t_sdr(bus: &Bus, device: &Profile) -> Tbit {
    Tbit(30).min(device.max_tsdr(bus.params.rate)).max(bus.params.min_tsdr)
}

/// `"cw"` or `"ccw"`.
fn code_sequence(node: &Node) -> Result<CodeSequence, Fault> {
    match text(node)? {
        "cw" => Ok(CodeSequence::Cw),
        "ccw" => Ok(CodeSequence::Ccw),
        _ => Err(Fault::new("there is no such code sequence").help("\"cw\" or \"ccw\" (manual 3.2.1)")),
    }
}

/// Reads `scaling = { units_per_rev, total_range }`.
fn scaling(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Scaling> {
    let units_per_rev = section.required(reader, "units_per_rev", "4096", number(0..=u32::MAX));
    let total_range = section.required(reader, "total_range", "16777216", number(0..=u32::MAX));
    section.finish(reader);
    Some(Scaling { units_per_rev: units_per_rev?, total_range: total_range? })
}

/// Reads one `[[event]]`; `all` are the addresses of all slaves.
fn event(mut section: Section<'_>, reader: &mut Reader<'_>, all: &[Address]) -> Option<Event> {
    let s = &mut section;
    let at = s.optional(reader, "at", instant);
    let cycle = s.optional(reader, "cycle", number(0..=i64::MAX as u64));
    if s.has("at") == s.has("cycle") {
        let fault = Fault::new("an event has either at or cycle");
        s.complain(reader, fault.help("for example: at = \"1 s\", or cycle = 500"));
    }
    let action = Kind::read(ACTIONS, "action", "do", s, reader)?;
    let power = matches!(action, Action::PowerOff | Action::PowerOn);
    let slaves = if power && s.has("station") {
        s.optional(reader, "station", address).map(|station| vec![station])
    } else if action.about_slaves() {
        Some(targets("event", reader, s, all))
    } else {
        None
    };
    section.finish(reader);
    let when = at.map(When::Time).or(cycle.map(When::Cycle))?;
    Some(Event { when, slaves: slaves.unwrap_or_default(), action })
}

/// The slaves that an event is about.
pub(super) fn targets(noun: &str, reader: &mut Reader<'_>, section: &mut Section<'_>, all: &[Address]) -> Vec<Address> {
    let one = section.optional(reader, "slave", address);
    let many = section.optional(reader, "slaves", |node| match &node.value {
        Value::Text(text) if text.trim() == "all" => Ok(all.to_vec()),
        _ => address_list(node),
    });
    if section.has("slave") == section.has("slaves") {
        let fault = Fault::new(format!("this {noun} needs either slave or slaves"));
        section.complain(reader, fault.help("for example: slave = 3, slaves = \"3..10\", or slaves = \"all\""));
    }
    one.into_iter().chain(many.into_iter().flatten()).collect()
}

/// Reads `[record]`.
fn record(mut section: Section<'_>, reader: &mut Reader<'_>) -> Record {
    let mut flag = |key| section.optional(reader, key, yes).unwrap_or(true);
    let tables = CsvTable::ALL.iter().filter(|&&(key, _)| flag(key)).map(|&(_, table)| table).collect();
    let (files, plots) = (flag("files"), flag("plots"));
    let rows = section.optional(reader, "rows", number(1..=i64::MAX as u64)).unwrap_or(20_000);
    let flight = flight::read(section.table(reader, "flight"), reader);
    section.finish(reader);
    Record { files, plots, tables, rows, flight }
}
