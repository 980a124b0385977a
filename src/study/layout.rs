//! Layout: which stations a study watches and what their clocks aim at.

use crate::observation::MasterClass;
use crate::time::Span;
use crate::wire::Address;

/// What the metrics must know of a network before it runs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Layout {
    /// The master whose clock is the grid.
    pub master: Address,
    /// Nominal T_DP, counted on the master's grid.
    pub t_dp: Span,
    /// The slaves, in address order.
    slaves: Vec<SlaveLayout>,
    /// Slave-to-slave links as (publisher, subscriber), in this order.
    links: Vec<(Address, Address)>,
    /// All masters, in address order; nobody where there is one only.
    masters: Vec<MasterLayout>,
    /// Number of a slave by its address, [`Layout::NONE`] where there is none.
    index: [u8; 128],
}

/// One slave of a [`Layout`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SlaveLayout {
    /// The slave.
    pub address: Address,
    /// T_I, counted on the master's grid (manual 3.3.5).
    pub t_i: Span,
    /// Whether it measures a position of its own: latch skew is that of encoders (Model: D9).
    pub encoder: bool,
}

/// One master of a [`Layout`] that has several.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MasterLayout {
    /// The master.
    pub address: Address,
    /// Its class.
    pub class: MasterClass,
    /// The slaves in its list, in address order; none of class 2.
    pub slaves: Vec<Address>,
}

impl Layout {
    const NONE: u8 = u8::MAX;

    /// The layout of a network; slaves and links are brought into address order, repeated ones are dropped.
    pub fn new(master: Address, t_dp: Span, mut slaves: Vec<SlaveLayout>, mut links: Vec<(Address, Address)>) -> Self {
        slaves.sort_by_key(|slave| slave.address);
        slaves.dedup_by_key(|slave| slave.address);
        links.sort_unstable();
        links.dedup();
        let mut index = [Self::NONE; 128];
        for (number, slave) in slaves.iter().enumerate() {
            index[usize::from(slave.address.get())] = number as u8;
        }
        Self { master, t_dp, slaves, links, masters: Vec::new(), index }
    }
    /// The same with the masters that share the token, [`Layout::master`] among them; they are brought into address order.
    #[must_use]
    pub fn with_masters(self, mut masters: Vec<MasterLayout>) -> Self {
        masters.sort_by_key(|master| master.address);
        Self { masters, ..self }
    }

    /// The slaves, in address order.
    pub fn slaves(&self) -> &[SlaveLayout] {
        &self.slaves
    }
    /// The links as (publisher, subscriber), in this order.
    pub fn links(&self) -> &[(Address, Address)] {
        &self.links
    }
    /// The masters in address order, where several share the token; nobody where there is one only.
    pub fn masters(&self) -> &[MasterLayout] {
        &self.masters
    }
    /// Number of the slave at `address` among [`slaves`](Self::slaves).
    #[inline]
    pub fn slave(&self, address: Address) -> Option<usize> {
        match self.index[usize::from(address.get())] {
            Self::NONE => None,
            number => Some(usize::from(number)),
        }
    }
    /// Number of a link among [`links`](Self::links).
    pub fn link(&self, publisher: Address, subscriber: Address) -> Option<usize> {
        self.links.binary_search(&(publisher, subscriber)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slaves_and_links_are_found_by_address_whatever_their_order() {
        let a = |n| Address::new(n).unwrap();
        let slave = |n| SlaveLayout { address: a(n), t_i: Span::from_us(125), encoder: true };
        let links = vec![(a(9), a(3)), (a(3), a(126)), (a(3), a(9)), (a(9), a(3))];
        let layout = Layout::new(a(1), Span::from_ms(1), vec![slave(9), slave(126), slave(3)], links);
        assert_eq!(layout.slaves().iter().map(|s| s.address.get()).collect::<Vec<_>>(), [3, 9, 126]);
        assert_eq!([3, 9, 126, 1, 127].map(|n| layout.slave(a(n))), [Some(0), Some(1), Some(2), None, None]);
        assert_eq!(layout.links(), [(a(3), a(9)), (a(3), a(126)), (a(9), a(3))]);
        assert_eq!((layout.link(a(9), a(3)), layout.link(a(126), a(3))), (Some(2), None));
    }
}
