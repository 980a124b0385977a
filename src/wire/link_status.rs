//! Link status: the diagnosis block in which a subscriber says how its slave-to-slave links are.
//!
//! | octet | content |
//! |---|---|
//! | 1 | length of the block, these four octets included |
//! | 2 | 83: status message, link status |
//! | 3 | slot |
//! | 4 | status specifier, 0 |
//! | 5, 6 and so on | a publisher's address and its [`LinkStatus`] |
//!
//! Source: VPC3+ driver for the layout. It names the three bits of a status and not their places.

use super::header::Address;
use core::fmt;

/// Octets of the block's header.
const HEAD: usize = 4;
/// Octets of the longest block of extended diagnosis: its length has 6 bits.
const LONGEST: usize = 63;
/// Octet 2: a status message about links.
const LINK_STATUS: u8 = 0x83;

rules! {
    /// A link status block that cannot be read.
    pub struct LinkStatusError, pub enum LinkStatusRule {
        Length = "a link status block has 4 octets and two for each link, up to 62, and says so";
        Type = "link status is block type 83 hex";
        Publisher = "a publisher's address is 0 to 125";
    }
}

bits! {
    /// How one link is. Model: no source has the places of the bits; the good state is on top and the history at the
    /// bottom, so that `80` hex and above is a link that works.
    pub struct LinkStatus: u8 {
        /// Valid data came within the last monitoring time.
        active ACTIVE = 7, "active";
        /// The publisher's data have another length than parameterised.
        error ERROR = 6, "error";
        /// Valid data came since data exchange began.
        data_existed DATA_EXISTED = 0, "data existed";
    }
}

/// A link status block, complete with its header.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct LinkStatusBlock {
    octets: [u8; LONGEST],
    len: usize,
}

impl LinkStatusBlock {
    /// Links that one block holds.
    pub const MAX_LINKS: usize = (LONGEST - HEAD) / 2;

    /// A block about the links of `slot`, without any yet.
    pub const fn new(slot: u8) -> Self {
        let mut octets = [0; LONGEST];
        [octets[0], octets[1], octets[2]] = [HEAD as u8, LINK_STATUS, slot];
        Self { octets, len: HEAD }
    }
    /// Reads a block of extended diagnosis.
    ///
    /// # Errors
    /// Another length or type, or a publisher that cannot be.
    pub fn parse(block: &[u8]) -> Result<Self, LinkStatusError> {
        let &[length, kind, slot, _, ref links @ ..] = block else {
            return Err(LinkStatusError::new(1, LinkStatusRule::Length, block.len() as u32));
        };
        if usize::from(length) != block.len() || block.len() > LONGEST || !links.len().is_multiple_of(2) {
            return Err(LinkStatusError::new(1, LinkStatusRule::Length, length));
        }
        if kind != LINK_STATUS {
            return Err(LinkStatusError::new(2, LinkStatusRule::Type, kind));
        }
        let mut read = Self::new(slot);
        let (pairs, _) = links.as_chunks::<2>();
        for (at, &[publisher, status]) in pairs.iter().enumerate() {
            let address = Address::new(publisher).filter(|address| address.get() <= 125);
            let error = LinkStatusError::new(HEAD + 1 + 2 * at, LinkStatusRule::Publisher, publisher);
            read.push(address.ok_or(error)?, LinkStatus(status));
        }
        Ok(read)
    }
    /// Appends a link. False if the block is full, [`Self::MAX_LINKS`].
    pub fn push(&mut self, publisher: Address, status: LinkStatus) -> bool {
        let Some(free) = self.octets.get_mut(self.len..self.len + 2) else { return false };
        free.copy_from_slice(&[publisher.get(), status.0]);
        self.len += 2;
        self.octets[0] = self.len as u8;
        true
    }
    /// The octets on the wire.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..self.len]
    }
    /// The slot that the block is about.
    pub const fn slot(&self) -> u8 {
        self.octets[2]
    }
    /// The links with their publishers, in their order.
    pub fn links(&self) -> impl Iterator<Item = (Address, LinkStatus)> + use<'_> {
        let (pairs, _) = self.octets[HEAD..self.len].as_chunks::<2>();
        pairs.iter().filter_map(|&[publisher, status]| Some((Address::new(publisher)?, LinkStatus(status))))
    }
}
impl fmt::Debug for LinkStatusBlock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "LinkStatusBlock({:02X?})", self.octets())
    }
}
/// The links, each with the names of its bits.
impl fmt::Display for LinkStatusBlock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, (publisher, status)) in self.links().enumerate() {
            write!(f, "{}link to {publisher}: {status}", if at > 0 { "; " } else { "" })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    fn address(number: u8) -> Address {
        Address::new(number).unwrap()
    }

    #[test]
    fn a_block_is_its_header_and_a_pair_for_each_link() {
        let mut block = LinkStatusBlock::new(0);
        assert_eq!(block.octets(), [4, 0x83, 0, 0]);
        assert!(block.push(address(3), LinkStatus::ACTIVE | LinkStatus::DATA_EXISTED));
        assert!(block.push(address(4), LinkStatus::DATA_EXISTED));
        assert!(block.push(address(5), LinkStatus::ERROR));
        assert_eq!(block.octets(), [0x0A, 0x83, 0, 0, 3, 0x81, 4, 0x01, 5, 0x40]);
        assert_eq!(LinkStatusBlock::parse(block.octets()), Ok(block));
        assert_eq!(block.to_string(), "link to 3: active, data existed; link to 4: data existed; link to 5: error");
    }

    #[test]
    fn a_block_holds_the_links_of_a_vpc3_and_no_more() {
        let mut block = LinkStatusBlock::new(1);
        assert_eq!(LinkStatusBlock::MAX_LINKS, 29);
        assert!((0..29).all(|publisher| block.push(address(publisher), LinkStatus::ACTIVE)));
        assert!(!block.push(address(29), LinkStatus::ACTIVE));
        assert_eq!((block.octets().len(), block.octets()[0], block.slot()), (62, 62, 1));
        assert_eq!(block.links().last(), Some((address(28), LinkStatus::ACTIVE)));
    }

    #[test]
    fn a_strange_block_is_refused_with_its_octet() {
        let error = |octets: &[u8]| LinkStatusBlock::parse(octets).map_err(|error| (error.octet, error.rule));
        assert_eq!(error(&[4, 0x83, 0]), Err((1, LinkStatusRule::Length)));
        assert_eq!(error(&[5, 0x83, 0, 0, 3]), Err((1, LinkStatusRule::Length)));
        assert_eq!(error(&[8, 0x83, 0, 0, 3, 0x80]), Err((1, LinkStatusRule::Length)));
        let mut long = [0; 64];
        [long[0], long[1]] = [64, 0x83];
        assert_eq!(error(&long), Err((1, LinkStatusRule::Length)));
        assert_eq!(error(&[6, 0x81, 0, 0, 3, 0x80]), Err((2, LinkStatusRule::Type)));
        assert_eq!(error(&[8, 0x83, 0, 0, 3, 0x80, 126, 0]), Err((7, LinkStatusRule::Publisher)));
    }
}
