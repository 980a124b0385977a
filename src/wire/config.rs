//! Config: the identifiers of `Chk_Cfg` and `Get_Cfg`, which say how many octets are exchanged. EN 50170-2.

/// The configuration of standard telegram 81: 2 words out, 6 words in, both consistent as a whole. Manual 2.1.1.
pub const TELEGRAM_81: [u8; 6] = [0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x51];
/// Most octets that `Data_Exchange` carries in one direction.
pub const MAX_LENGTH: u16 = 244;

/// Bits 3..=0 of a special identifier that say: no manufacturer octets.
const UNCHECKED: u8 = 15;

rules! {
    /// A configuration that cannot be read.
    pub struct CfgError, pub enum CfgRule {
        LengthOctet = "the length octet it announces is missing";
        Manufacturer = "the manufacturer octets it announces are missing";
        Total = "at most 244 octets are exchanged in one direction";
    }
}

/// What one identifier exchanges in one direction.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Part {
    /// Length (octets).
    pub octets: u8,
    /// Counted in words of two octets.
    pub words: bool,
    /// Consistent over the whole length instead of one octet or word.
    pub whole: bool,
}

impl Part {
    /// A length octet of a special identifier: bit 7 consistency, bit 6 words, bits 5..=0 length - 1.
    const fn of_length_octet(octet: u8) -> Self {
        Self::new(octet & 0x3F, octet)
    }
    const fn new(length_less_one: u8, flags: u8) -> Self {
        let words = flags & 0x40 != 0;
        let octets = (length_less_one + 1) << words as u8;
        Self { octets, words, whole: flags & 0x80 != 0 }
    }
}

/// One identifier: a module, or a free slot.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Identifier<'a> {
    /// What the master sends.
    pub outputs: Option<Part>,
    /// What the slave sends.
    pub inputs: Option<Part>,
    /// Octets at the end of a special identifier that only the manufacturer, or a profile, understands.
    pub manufacturer: &'a [u8],
}

impl Identifier<'_> {
    /// Whether nothing is exchanged.
    pub const fn is_free_slot(&self) -> bool {
        self.outputs.is_none() && self.inputs.is_none()
    }
}

/// The identifiers of a configuration in their order. Ends after the first error.
pub const fn identifiers(cfg: &[u8]) -> Identifiers<'_> {
    Identifiers { octet: 1, rest: cfg }
}

/// Iterator over the identifiers of a configuration.
#[derive(Clone, Debug)]
pub struct Identifiers<'a> {
    octet: usize,
    rest: &'a [u8],
}

impl<'a> Identifiers<'a> {
    /// The number of the next identifier's octet, counted from 1.
    pub const fn octet(&self) -> usize {
        self.octet
    }
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        self.octet += count;
        Some(taken)
    }
    /// The length octet that `id` announces with one of its bits, if it does.
    fn length(&mut self, octet: usize, id: u8, bit: u8) -> Result<Option<Part>, CfgError> {
        if id & bit == 0 {
            return Ok(None);
        }
        match self.take(1) {
            Some(&[length]) => Ok(Some(Part::of_length_octet(length))),
            _ => Err(CfgError::new(octet, CfgRule::LengthOctet, id)),
        }
    }
    /// Bits 7..=6 say which lengths follow (outputs first), bits 3..=0 how many manufacturer octets.
    fn special(&mut self, octet: usize, id: u8) -> Result<Identifier<'a>, CfgError> {
        let outputs = self.length(octet, id, 0x80)?;
        let inputs = self.length(octet, id, 0x40)?;
        let count = match id & 0x0F {
            UNCHECKED => 0,
            count => usize::from(count),
        };
        let manufacturer = self.take(count).ok_or(CfgError::new(octet, CfgRule::Manufacturer, id))?;
        Ok(Identifier { outputs, inputs, manufacturer })
    }
}
impl<'a> Iterator for Identifiers<'a> {
    type Item = Result<Identifier<'a>, CfgError>;

    fn next(&mut self) -> Option<Self::Item> {
        let octet = self.octet;
        let id = *self.take(1)?.first()?;
        if id & 0x30 == 0 {
            let identifier = self.special(octet, id);
            if identifier.is_err() {
                self.rest = &[];
            }
            return Some(identifier);
        }
        let part = Part::new(id & 0x0F, id);
        let outputs = (id & 0x20 != 0).then_some(part);
        let inputs = (id & 0x10 != 0).then_some(part);
        Some(Ok(Identifier { outputs, inputs, manufacturer: &[] }))
    }
}

/// Octets that the configuration exchanges: inputs (from the slave), outputs (to the slave).
///
/// # Errors
/// An identifier ends before what it announces, or a direction exceeds 244 octets.
pub fn lengths(cfg: &[u8]) -> Result<(u8, u8), CfgError> {
    let (mut inputs, mut outputs) = (0, 0);
    let mut identifiers = identifiers(cfg);
    let mut octet = identifiers.octet();
    while let Some(identifier) = identifiers.next() {
        let identifier = identifier?;
        for (total, part) in [(&mut inputs, identifier.inputs), (&mut outputs, identifier.outputs)] {
            *total += u16::from(part.map_or(0, |part| part.octets));
            if *total > MAX_LENGTH {
                return Err(CfgError::new(octet, CfgRule::Total, *total));
            }
        }
        octet = identifiers.octet();
    }
    Ok((inputs as u8, outputs as u8))
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn telegram_81_is_two_words_out_and_six_words_in() {
        let found: Vec<_> = identifiers(&TELEGRAM_81).collect();
        let part = |octets| Some(Part { octets, words: true, whole: true });
        let expected = Identifier { outputs: part(4), inputs: part(12), manufacturer: &[0xFD, 0x00, 0x51] };
        assert_eq!(found, [Ok(expected)]);
        assert_eq!(lengths(&TELEGRAM_81), Ok((12, 4)));
    }

    #[test]
    fn normal_and_special_identifiers_count_octets_and_words() {
        // Six words out consistent, two words in consistent, axis separator of a drive.
        assert_eq!(lengths(&[0xE5, 0xD1, 0x01, 0xFE]), Ok((4, 12)));
        for (cfg, inputs, outputs) in [
            (&[0x10][..], 1, 0),
            (&[0x2F], 0, 16),
            (&[0x70], 2, 2),
            (&[0x00, 0x00], 0, 0),
            (&[0x4F, 0x3F], 64, 0),
            (&[0x80, 0x7F], 0, 128),
            (&[], 0, 0),
        ] {
            assert_eq!(lengths(cfg), Ok((inputs, outputs)), "{cfg:02X?}");
        }
        assert!(identifiers(&[0x00]).all(|identifier| identifier.is_ok_and(|identifier| identifier.is_free_slot())));
    }

    #[test]
    fn errors_name_the_identifier() {
        assert_eq!(lengths(&[0x10, 0xC0, 0x00]), Err(CfgError::new(2, CfgRule::LengthOctet, 0xC0u8)));
        assert_eq!(lengths(&[0xC3, 0xC1, 0xC5, 0xFD]), Err(CfgError::new(1, CfgRule::Manufacturer, 0xC3u8)));
        assert_eq!(lengths(&[0x80, 0x7F, 0x80, 0x7F]), Err(CfgError::new(3, CfgRule::Total, 256u16)));
    }
}
