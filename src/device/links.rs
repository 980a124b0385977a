//! Links: what the tables of Set_Prm ask of a subscriber, checked, and where each sample goes.
//!
//! Entries of one publisher, in either table, make one link. The samples of the link table go one behind the other, in
//! the table's order, into an area of their own; those of the subscriber table go where they say, into the data area
//! of their slot. Model: the sources describe the tables and leave the device's memory to the device.

use alloc::vec::Vec;
use core::ops::Range;

use crate::device::profile::DxbLimits;
use crate::dp::slave::Refusal;
use crate::wire::Address;
use crate::wire::prm::{Block, BlockType, DxbLink, DxbLinks, DxbSubscriptions, SetPrm};

/// The links of a subscriber, each of one publisher.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Links {
    by_publisher: Vec<Link>,
    /// Of every link, those of one link behind each other.
    samples: Vec<Sample>,
    /// Octets of all areas.
    octets: usize,
    /// Octets of the link table's area, which comes first.
    first: usize,
    /// Octets of the area of each slot.
    slot: usize,
}

/// A link to one publisher.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Link {
    /// Whose data.
    pub publisher: Address,
    /// Their length (octets); data of another length are not taken.
    pub length: u8,
    /// Which samples are of this link.
    samples: Range<usize>,
}

/// Octets to copy.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Sample {
    /// Where they are in the publisher's data.
    pub from: Range<usize>,
    /// Where they go among the octets of all areas.
    pub to: Range<usize>,
}

/// An entry of a table.
struct Entry {
    link: DxbLink,
    /// Octet number of its publisher in Set_Prm.
    octet: usize,
    /// Slot and offset; none in the link table. Behind it the octet number of the offset.
    place: Option<((u8, u8), usize)>,
}

impl Links {
    /// The links that `prm` asks of the subscriber at `own`, which has these limits.
    ///
    /// # Errors
    /// The first rule that is broken, with its octet.
    pub fn of(prm: &SetPrm<'_>, own: Address, limits: DxbLimits) -> Result<Self, Refusal> {
        let entries = entries(prm, limits)?;
        for (at, entry) in entries.iter().enumerate() {
            entry.check(own, limits)?;
            entry.check_with(&entries[..at])?;
        }
        if !entries.is_empty() && !prm.status.wd_on() {
            let rule = "links need the watchdog, its time monitors them (VPC3+ manual)";
            return Err(Refusal::Device { octet: 1, rule, value: prm.status.0.into() });
        }
        Ok(Self::place(&entries, limits))
    }
    fn place(entries: &[Entry], limits: DxbLimits) -> Self {
        let slot = usize::from(limits.data);
        let in_link_table = entries.iter().filter(|entry| entry.place.is_none());
        let first = in_link_table.map(|entry| usize::from(entry.link.sample)).sum();
        let mut all = Self { octets: first + slot * usize::from(limits.slots), first, slot, ..Self::default() };
        let mut free = 0;
        let mut samples = Vec::with_capacity(entries.len());
        for Entry { link, place, .. } in entries {
            let (from, length) = (usize::from(link.offset), usize::from(link.sample));
            let to = if let Some(((number, offset), _)) = *place {
                first + (usize::from(number) - 1) * slot + usize::from(offset)
            } else {
                free += length;
                free - length
            };
            samples.push((link, Sample { from: from..from + length, to: to..to + length }));
        }
        for (of, _) in &samples {
            if all.by_publisher.iter().any(|link| link.publisher.get() == of.publisher) {
                continue;
            }
            let begin = all.samples.len();
            let own = samples.iter().filter(|(link, _)| link.publisher == of.publisher);
            all.samples.extend(own.map(|(_, sample)| sample.clone()));
            let publisher = Address::new(of.publisher).expect("a checked publisher");
            all.by_publisher.push(Link { publisher, length: of.length, samples: begin..all.samples.len() });
        }
        all
    }

    /// The links in the order in which their publishers are named first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Link> {
        self.by_publisher.iter()
    }
    /// The link of this number among [`iter`](Self::iter).
    ///
    /// # Panics
    /// If there are fewer.
    pub fn link(&self, index: usize) -> &Link {
        &self.by_publisher[index]
    }
    /// The samples of a link, in the order of the tables.
    pub fn samples(&self, link: &Link) -> &[Sample] {
        &self.samples[link.samples.clone()]
    }
    /// Octets of all areas together.
    pub const fn octets(&self) -> usize {
        self.octets
    }
    /// Where the area of the link table is.
    pub const fn link_table(&self) -> Range<usize> {
        0..self.first
    }
    /// Where the data area of `slot` is, for the subscriber table. None for a slot that has none.
    pub fn slot(&self, slot: u8) -> Option<Range<usize>> {
        let begin = self.first + usize::from(slot).checked_sub(1)? * self.slot;
        (begin < self.octets).then_some(begin..begin + self.slot)
    }
}

/// All entries of both tables in the order of the octets. Each table is there once at most, and nothing else but the
/// isochronous block.
fn entries(prm: &SetPrm<'_>, limits: DxbLimits) -> Result<Vec<Entry>, Refusal> {
    let mut all = Vec::new();
    let mut seen: [Option<BlockType>; 2] = [None; 2];
    for block in prm.blocks() {
        let block = block?;
        match block.kind {
            BlockType::IsoM => continue,
            BlockType::User if limits.user_blocks => continue,
            BlockType::DxbLinks | BlockType::DxbSubscriptions => {}
            kind => {
                let rule = "this device takes isochronous, link table and subscriber table blocks only";
                return Err(Refusal::Device { octet: block.octet + 1, rule, value: kind.code().into() });
            }
        }
        let free = seen.iter_mut().find(|kind| kind.is_none_or(|kind| kind == block.kind));
        if free.and_then(|free| free.replace(block.kind)).is_some() {
            let rule = "a table is there once at most (Model: a second one would leave open which counts)";
            return Err(Refusal::Device { octet: block.octet + 1, rule, value: block.kind.code().into() });
        }
        read(&block, &mut all)?;
        if let Some(entry) = all.get(usize::from(limits.links)) {
            let rule = "there are no more links than DXB_Max_Link_Count";
            return Err(Refusal::Device { octet: entry.octet, rule, value: all.len() as u64 });
        }
    }
    Ok(all)
}

/// Appends the entries of one table.
fn read(block: &Block<'_>, all: &mut Vec<Entry>) -> Result<(), Refusal> {
    if block.kind == BlockType::DxbLinks {
        let table = DxbLinks::parse(block)?;
        all.extend(table.iter().enumerate().map(|(at, link)| Entry { link, octet: table.octet(at), place: None }));
    } else {
        let table = DxbSubscriptions::parse(block)?;
        all.extend(table.iter().enumerate().map(|(at, entry)| {
            let octet = table.octet(at);
            Entry { link: entry.link, octet, place: Some(((entry.slot, entry.destination), octet + 4)) }
        }));
    }
    Ok(())
}

impl Entry {
    /// Octet number of the sample's length.
    const fn sample_octet(&self) -> usize {
        self.octet + if self.place.is_some() { 5 } else { 3 }
    }
    /// The rules for one entry: those of any subscriber, then this device's.
    fn check(&self, own: Address, limits: DxbLimits) -> Result<(), Refusal> {
        let link = self.link;
        link.check(self.octet, limits.data).map_err(|mut error| {
            // The sample's length stands elsewhere in the subscriber table.
            error.octet = if error.octet == self.octet + 3 { self.sample_octet() } else { error.octet };
            error
        })?;
        let refuse = |octet, rule, value: u8| Err(Refusal::Device { octet, rule, value: value.into() });
        if link.publisher == own.get() {
            return refuse(self.octet, "a subscriber is not its own publisher (manual 1.2)", link.publisher);
        }
        if link.sample == 0 {
            return refuse(self.sample_octet(), "a sample has an octet at least (Model: a link brings something)", 0);
        }
        let Some(((slot, offset), octet)) = self.place else { return Ok(()) };
        if !(1..=limits.slots).contains(&slot) {
            return refuse(octet - 1, "this slot has a data area; slot 0 is the device itself (Model: D24)", slot);
        }
        if u16::from(offset) + u16::from(link.sample) > u16::from(limits.data) {
            return refuse(octet, "the sample ends within the data area of its slot", offset);
        }
        Ok(())
    }
    /// The rules between this entry and those before it.
    fn check_with(&self, before: &[Self]) -> Result<(), Refusal> {
        let link = self.link;
        if before.iter().any(|other| other.link.publisher == link.publisher && other.link.length != link.length) {
            let rule = "all samples of a publisher say the same length of its data (Model: it has one)";
            return Err(Refusal::Device { octet: self.octet + 1, rule, value: link.length.into() });
        }
        let Some(((slot, offset), octet)) = self.place else { return Ok(()) };
        let own = u16::from(offset)..u16::from(offset) + u16::from(link.sample);
        let overlaps = |other: &Self| {
            other.place.is_some_and(|((other_slot, begin), _)| {
                let begin = u16::from(begin);
                other_slot == slot && begin < own.end && own.start < begin + u16::from(other.link.sample)
            })
        };
        if before.iter().any(overlaps) {
            let rule = "no two samples go to the same octet (Model: the last to come would win)";
            return Err(Refusal::Device { octet, rule, value: offset.into() });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::prm::{DpV1Status, DxbSubscription, PrmBuilder, PrmRule, StationStatus};

    const OWN: Address = Address::new(9).unwrap();
    const LIMITS: DxbLimits = DxbLimits { links: 4, data: 20, slots: 2, user_blocks: false };

    const fn link(publisher: u8, length: u8, offset: u8, sample: u8) -> DxbLink {
        DxbLink { publisher, length, offset, sample }
    }
    const fn to(link: DxbLink, slot: u8, destination: u8) -> DxbSubscription {
        DxbSubscription { link, slot, destination }
    }
    /// Set_Prm with these tables: link table from octet 11 on, its first entry at 16.
    fn octets(links: &[DxbLink], subscriptions: &[DxbSubscription], watchdog: bool) -> Vec<u8> {
        let prm = SetPrm {
            status: StationStatus::LOCK.with(StationStatus::WD_ON, watchdog),
            wd_fact_1: 20,
            wd_fact_2: 1,
            min_tsdr: 11,
            ident: 0xF0D0,
            group: 0x80,
            dpv1: DpV1Status::DPV1_ENABLE | DpV1Status::PRM_STRUCTURE,
            blocks: &[],
        };
        let mut built = PrmBuilder::new(&prm).unwrap();
        if !links.is_empty() {
            built = built.dxb_links(links).unwrap();
        }
        if !subscriptions.is_empty() {
            built = built.dxb_subscriptions(subscriptions).unwrap();
        }
        built.octets().to_vec()
    }
    fn of(du: &[u8]) -> Result<Links, Refusal> {
        Links::of(&SetPrm::parse(du).unwrap(), OWN, LIMITS)
    }
    /// Octet and value of the refusal.
    fn refused(du: &[u8]) -> (usize, u64) {
        match of(du) {
            Err(Refusal::Device { octet, value, .. }) => (octet, value),
            Err(Refusal::Telegram(error)) => (error.octet, error.value.into()),
            Ok(links) => panic!("{links:?}"),
        }
    }

    #[test]
    fn both_tables_make_one_link_per_publisher() {
        let du =
            octets(&[link(6, 12, 4, 4), link(7, 12, 0, 2), link(6, 12, 0, 2)], &[to(link(7, 12, 8, 4), 2, 16)], true);
        let links = of(&du).unwrap();
        let found: Vec<_> = links.iter().map(|link| (link.publisher.get(), link.length)).collect();
        assert_eq!(found, [(6, 12), (7, 12)]);
        let samples: Vec<Vec<_>> = links
            .iter()
            .map(|link| links.samples(link).iter().map(|sample| (sample.from.clone(), sample.to.clone())).collect())
            .collect();
        // The link table's area has 8 octets, slot 1 is at 8, slot 2 at 28.
        assert_eq!(samples[0], [(4..8, 0..4), (0..2, 6..8)]);
        assert_eq!(samples[1], [(0..2, 4..6), (8..12, 44..48)]);
        assert_eq!((links.octets(), links.link_table()), (48, 0..8));
        assert_eq!([0, 1, 2, 3].map(|slot| links.slot(slot)), [None, Some(8..28), Some(28..48), None]);
    }

    #[test]
    fn the_worked_blocks_are_taken() {
        let mut du = octets(&[], &[], true);
        du.extend([0x09, 0x03, 0, 0, 1, 6, 12, 4, 4, 0x0B, 0x07, 0, 0, 1, 6, 12, 4, 1, 0, 4]);
        let links = of(&du).unwrap();
        let link = links.iter().next().unwrap().clone();
        assert_eq!((links.iter().len(), link.publisher.get(), link.length), (1, 6, 12));
        let samples: Vec<_> = links.samples(&link).iter().map(|sample| sample.to.clone()).collect();
        assert_eq!(samples, [0..4, 4..8], "the link table's area, then the beginning of slot 1");
    }

    /// Link table: entries at 16 and 20. Subscriber table alone: the entry at 16, its slot at 19.
    #[test]
    fn every_rule_names_its_octet() {
        let good = link(6, 12, 4, 4);
        let table = |entry: DxbLink| octets(&[good, entry], &[], true);
        for (entry, octet, value) in [
            (link(126, 12, 4, 4), 20, 126),
            (link(255, 12, 4, 4), 20, 255),
            (link(9, 12, 4, 4), 20, 9),
            (link(7, 0, 0, 0), 21, 0),
            (link(7, 245, 0, 4), 21, 245),
            (link(6, 13, 4, 4), 21, 13),
            (link(7, 12, 12, 1), 22, 12),
            (link(7, 12, 9, 4), 23, 4),
            (link(7, 12, 4, 0), 23, 0),
            (link(7, 30, 0, 21), 23, 21),
        ] {
            assert_eq!(refused(&table(entry)), (octet, value), "{entry:?}");
        }
        for (entry, octet, value) in [
            (to(link(9, 12, 4, 4), 1, 0), 16, 9),
            (to(good, 0, 0), 19, 0),
            (to(good, 3, 0), 19, 3),
            (to(good, 2, 17), 20, 17),
            (to(link(6, 12, 9, 4), 1, 0), 21, 4),
            (to(link(6, 12, 4, 0), 1, 0), 21, 0),
        ] {
            assert_eq!(refused(&octets(&[], &[entry], true)), (octet, value), "{entry:?}");
        }
    }

    #[test]
    fn tables_come_once_with_as_many_links_as_the_device_has_and_a_watchdog() {
        let links: Vec<_> = (20..24).map(|publisher| link(publisher, 12, 4, 4)).collect();
        assert_eq!(of(&octets(&links, &[], true)).map(|links| links.iter().len()), Ok(4));
        assert_eq!(refused(&octets(&links, &[to(link(20, 12, 0, 1), 1, 0)], true)), (11 + 21 + 5, 5));
        assert_eq!(refused(&octets(&links[..1], &[], false)), (1, 0x80));
        assert_eq!(of(&octets(&[], &[], false)), of(&octets(&[], &[], true)), "without links the watchdog may be off");
        for mut du in [octets(&links[..1], &[], true), octets(&[], &[to(links[0], 1, 0)], true)] {
            let block = du[10..].to_vec();
            du.extend(&block);
            assert_eq!(refused(&du), (11 + block.len() + 1, block[1].into()), "the same table twice");
        }
        let mut user = octets(&links[..1], &[], true);
        user.extend([4, 0x81, 0, 0]);
        assert_eq!(refused(&user), (21, 0x81));
        let taken = Links::of(&SetPrm::parse(&user).unwrap(), OWN, DxbLimits { user_blocks: true, ..LIMITS });
        assert!(taken.is_ok_and(|links| links.iter().len() == 1), "a device that takes user blocks");
    }

    #[test]
    fn samples_do_not_share_octets() {
        let entries = |second| [to(link(6, 12, 4, 4), 1, 4), second];
        for (slot, destination, refusal) in
            [(1, 1, Some(26)), (1, 7, Some(26)), (1, 4, Some(26)), (1, 0, None), (1, 8, None), (2, 4, None)]
        {
            let du = octets(&[], &entries(to(link(7, 12, 0, 4), slot, destination)), true);
            match refusal {
                Some(octet) => assert_eq!(refused(&du), (octet, destination.into())),
                None => assert!(of(&du).is_ok(), "slot {slot}, octet {destination}"),
            }
        }
    }

    #[test]
    fn a_broken_table_is_the_telegrams_fault() {
        let mut du = octets(&[link(6, 12, 4, 4)], &[], true);
        du[14] = 2;
        let error = match of(&du) {
            Err(Refusal::Telegram(error)) => error,
            other => panic!("{other:?}"),
        };
        assert_eq!((error.octet, error.rule), (15, PrmRule::Version));
    }
}
