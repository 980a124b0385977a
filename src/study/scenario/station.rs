//! Stations: all that sit on the cables, whatever they are, for what is asked of every one of them.

use super::topology::Point;
use super::{Crystal, Scenario};
use crate::wire::Address;

/// What a station is in a scenario.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    Master,
    Slave,
    /// By its number in the file, from 1.
    Class1(usize),
    /// By its number in the file, from 1.
    Class2(usize),
}

/// A station on the cables.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Station<'a> {
    /// Its address.
    pub address: Address,
    /// Where it sits.
    pub point: Point,
    /// How far its crystal is off.
    pub crystal: Crystal,
    /// Its device, or which kind of master it is.
    pub what: &'a str,
    kind: Kind,
}

impl Station<'_> {
    /// What it is, with its article.
    pub(super) fn what_it_is(&self) -> &'static str {
        match self.kind {
            Kind::Master => "the master",
            Kind::Slave => "a slave",
            Kind::Class1(_) => "a class 1 master",
            Kind::Class2(_) => "a class 2 master",
        }
    }
    /// Its table in the scenario: `master`, `slave.3` by address, `class1.1` and `class2.1` by number.
    pub fn path(&self) -> String {
        match self.kind {
            Kind::Master => "master".to_owned(),
            Kind::Slave => format!("slave.{}", self.address),
            Kind::Class1(number) => format!("class1.{number}"),
            Kind::Class2(number) => format!("class2.{number}"),
        }
    }
}

impl Scenario {
    /// Every station: the master, the slaves, then further masters in the order of the file.
    pub fn stations(&self) -> impl Iterator<Item = Station<'_>> {
        let point = |segment, mm| Point { segment, mm };
        let master = &self.master;
        let master = Station {
            address: master.address,
            point: point(master.segment, master.position_mm),
            crystal: master.crystal,
            what: "master",
            kind: Kind::Master,
        };
        let slaves = self.slaves.iter().map(move |slave| Station {
            address: slave.address,
            point: point(slave.segment, slave.position_mm),
            crystal: slave.crystal,
            what: &slave.device.name,
            kind: Kind::Slave,
        });
        let class1 = self.class1.iter().zip(1..).map(move |(class1, number)| Station {
            address: class1.address,
            point: point(class1.segment, class1.position_mm),
            crystal: class1.crystal,
            what: "class 1 master",
            kind: Kind::Class1(number),
        });
        let class2 = self.class2.iter().zip(1..).map(move |(class2, number)| Station {
            address: class2.address,
            point: point(class2.segment, class2.position_mm),
            crystal: class2.crystal,
            what: "class 2 master",
            kind: Kind::Class2(number),
        });
        [master].into_iter().chain(slaves).chain(class1).chain(class2)
    }
}
