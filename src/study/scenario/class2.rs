//! `[[class2]]`: class 2 masters beside the master, and what they read and write, with their rules.

use super::acyclic;
use super::check::{Facts, about};
use super::error::Fault;
use super::kinds::address;
use super::read;
use super::section::{Reader, Section, choice, instant, number};
use super::topology::{cable, station_segment};
use super::tree::{Node, Table, Value};
use super::{Crystal, Slave, Topology};
use crate::device::parameters::PARAMETERS;
use crate::device::tool::Work;
use crate::observation::AcyclicService;
use crate::time::Span;
use crate::wire::Address;
use crate::wire::acyclic::Record;
use crate::wire::parameter::ParameterAddress;

/// A class 2 master.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Class2 {
    /// Its address, 0..=125.
    pub address: Address,
    /// Index of its segment.
    pub segment: u8,
    /// Where on the segment's cable it sits (mm).
    pub position_mm: u64,
    /// How far its crystal is off.
    pub crystal: Crystal,
    /// When its supply comes on (true time).
    pub powered_at: Span,
    /// Send_Timeout of its connections, a multiple of 10 ms; none is the shortest of the bit rate (VPC3+ driver).
    pub send_timeout: Option<Span>,
    /// When a request is given up, a multiple of 10 ms; none is each slave's C2_Response_Timeout (GSD).
    pub response_timeout: Option<Span>,
    /// Messages in one token visit at most. Model: default 1.
    pub per_token: u8,
    /// What it does, in the order of the file.
    pub jobs: Vec<Class2Job>,
}

/// A job of a class 2 master.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Class2Job {
    /// The slaves, in address order: it is done with each of them.
    pub slaves: Vec<Address>,
    /// What is done, one after the other.
    pub works: Vec<Work>,
    /// When for the first time, on its own clock from power-on.
    pub start: Span,
    /// And then every so often; none is once.
    pub period: Option<Span>,
}

/// What a job may be, by its name in a file.
const SERVICES: &[(&str, Service)] = &[
    ("parameter-read", Service::Parameter),
    ("record-read", Service::RecordRead),
    ("record-write", Service::RecordWrite),
    ("diagnosis", Service::Read(AcyclicService::Diagnosis)),
    ("rd-inp", Service::Read(AcyclicService::Inputs)),
    ("rd-outp", Service::Read(AcyclicService::Outputs)),
    ("get-cfg", Service::Read(AcyclicService::Configuration)),
];
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Service {
    Parameter,
    RecordRead,
    RecordWrite,
    Read(AcyclicService),
}

/// Most octets of a record (C2_Max_Data_Len).
const MAX_RECORD: u8 = 240;
/// The slot of the telegram's module (manual 6.3), where nothing else is said.
const SLOT: u8 = 1;

/// Reads one `[[class2]]`; `all` are the addresses of all slaves.
pub(super) fn read(
    mut section: Section<'_>,
    reader: &mut Reader<'_>,
    all: &[Address],
    topology: Option<&Topology>,
) -> Option<Class2> {
    let s = &mut section;
    let address = s.required(reader, "address", "1", address);
    let segment = station_segment(s, reader, topology);
    let position_mm = s.optional(reader, "position", cable).unwrap_or(0);
    let crystal = read::crystal(reader, s);
    let powered_at = s.optional(reader, "powered_at", instant).unwrap_or(Span::ZERO);
    let send_timeout = s.optional(reader, "send_timeout", acyclic::timeout);
    let response_timeout = s.optional(reader, "response_timeout", acyclic::timeout);
    let per_token = s.optional(reader, "per_token", number(1..=u8::MAX)).unwrap_or(1);
    let jobs = s.tables(reader, "job").into_iter().filter_map(|inner| job(inner, reader, all)).collect();
    section.finish(reader);
    Some(Class2 {
        address: address?,
        segment,
        position_mm,
        crystal,
        powered_at,
        send_timeout,
        response_timeout,
        per_token,
        jobs,
    })
}

fn job(mut section: Section<'_>, reader: &mut Reader<'_>, all: &[Address]) -> Option<Class2Job> {
    let s = &mut section;
    let service =
        s.required(reader, "service", "\"parameter-read\"", |node| choice(node, "service", SERVICES, |row| row.0));
    let slaves = read::targets("job", reader, s, all);
    let start = s.optional(reader, "start", instant).unwrap_or(Span::ZERO);
    let period = s.optional(reader, "period", period);
    let works = match service?.1 {
        Service::Parameter => parameters(s, reader),
        Service::RecordRead => {
            let record = record(s, reader);
            let length = s.optional(reader, "length", number(1..=MAX_RECORD)).unwrap_or(MAX_RECORD);
            record.map(|record| vec![Work::ReadRecord(record, length)])
        }
        Service::RecordWrite => {
            let record = record(s, reader);
            let data = s.required(reader, "data", "[0x01, 0x02]", octets);
            // Zeros behind the octets that are given.
            let length = s.optional(reader, "length", number(1..=MAX_RECORD)).map(usize::from);
            record.zip(data).map(|(record, mut data)| {
                data.resize(length.unwrap_or(data.len()).max(data.len()), 0);
                vec![Work::WriteRecord(record, data)]
            })
        }
        Service::Read(service) => Some(vec![Work::Read(service)]),
    };
    section.finish(reader);
    Some(Class2Job { slaves, works: works?, start, period })
}

/// `parameters = [918, 964]`, or one `parameter` with `subindex` and `elements`.
fn parameters(s: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Vec<Work>> {
    let many = s.optional(reader, "parameters", numbers);
    let one = s.optional(reader, "parameter", number(1..=u16::MAX));
    let subindex = s.optional(reader, "subindex", number(0..=u16::MAX)).unwrap_or(0);
    let elements = s.optional(reader, "elements", number(0..=u8::MAX));
    if s.has("parameters") == s.has("parameter") {
        let fault = Fault::new("a parameter-read has either parameter or parameters");
        s.complain(reader, fault.help("for example: parameter = 979, elements = 6, or parameters = [918, 922]"));
    }
    let numbers = many.into_iter().flatten().chain(one);
    // Where nothing is said, the whole parameter as encoders have it.
    let whole = |pnu| PARAMETERS.iter().find(|known| known.pnu == pnu).map_or(0, |known| known.elements as u8);
    let address = |pnu| ParameterAddress {
        attribute: ParameterAddress::VALUE,
        elements: elements.unwrap_or_else(|| whole(pnu).saturating_sub(subindex.min(u8::MAX.into()) as u8)),
        pnu,
        subindex,
    };
    let works: Vec<_> = numbers.map(|pnu| Work::Parameter(address(pnu))).collect();
    Some(works).filter(|works| !works.is_empty())
}
/// Slot and index.
fn record(s: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Record> {
    let slot = s.optional(reader, "slot", number(0..=254)).unwrap_or(SLOT);
    let index = s.required(reader, "index", "47", number(0..=u8::MAX));
    index.map(|index| Record { slot, index })
}

/// A time above 0.
fn period(node: &Node) -> Result<Span, Fault> {
    match instant(node)? {
        Span::ZERO => Err(Fault::new("a period is more than nothing")
            .help("a job that is to be done all the time has a short one, such as \"1 us\"")),
        period => Ok(period),
    }
}
fn numbers(node: &Node) -> Result<Vec<u16>, Fault> {
    match &node.value {
        Value::List(items) if !items.is_empty() => items.iter().map(number(1..=u16::MAX)).collect(),
        _ => Err(Fault::new("this is no list of parameter numbers").help("parameters = [918, 922]")),
    }
}
fn octets(node: &Node) -> Result<Vec<u8>, Fault> {
    match &node.value {
        Value::List(items) if items.len() <= MAX_RECORD.into() => items.iter().map(number(0..=u8::MAX)).collect(),
        _ => Err(Fault::new(format!("this is no list of up to {MAX_RECORD} octets")).help("data = [0x01, 0x02]")),
    }
}

/// Jobs are about slaves of the bus.
pub(super) fn slaves(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, class2) in facts.scenario.class2.iter().enumerate() {
        for (j, job) in class2.jobs.iter().enumerate() {
            let path = format!("class2.{}.job.{}", i + 1, j + 1);
            if let Some(address) = job.slaves.iter().find(|&&address| facts.scenario.slave(address).is_none()) {
                let all: Vec<_> = facts.scenario.slaves.iter().map(|slave: &Slave| slave.address.to_string()).collect();
                let fault = Fault::new(format!("there is no slave {address}"))
                    .help(format!("the slaves are {}", all.join(", ")));
                about(reader, &format!("{path}.slave"), &[&format!("{path}.slaves")], fault);
            }
        }
    }
}

impl<'t> Section<'t> {
    /// The tables of the list under `key`, `[[class2.job]]`.
    fn tables(&mut self, reader: &mut Reader<'_>, key: &'static str) -> Vec<Section<'t>> {
        let path = self.path_of(key);
        let items = self.optional(reader, key, |_| Ok(())).and_then(|()| self.node(key));
        let Some(Node { place, value }) = items else { return Vec::new() };
        let table = |(i, item): (usize, &'t Node)| match &item.value {
            Value::Table(table) => Some(Section::new(format!("{path}.{}", i + 1), item.place, Some::<&Table>(table))),
            _ => None,
        };
        let tables: Option<Vec<_>> = match value {
            Value::List(items) => items.iter().enumerate().map(table).collect(),
            _ => None,
        };
        tables.unwrap_or_else(|| {
            reader.complain(
                *place,
                &path,
                Fault::new(format!("this is {}", value.noun())).help("write [[class2.job]]"),
            );
            Vec::new()
        })
    }
}
