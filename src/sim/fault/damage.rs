//! What wrong bits do to a telegram.
//!
//! A character is a start bit 0, eight data bits with the least significant first, a bit of even parity and a stop bit 1
//! (EN 50170-2). Model: a receiver's UART refuses a character whose start or stop bit is wrong or whose parity is odd, and the
//! receiver drops the whole telegram; only that something was on the line is seen. Two wrong bits among data and parity
//! pass the UART: the octet is another one, and the telegram's own checks have to find it.

use crate::wire::Frame;

/// Bits of a character.
pub const CHARACTER: u64 = 11;
/// The first and the last data bit of a character and its parity bit, counted from the start bit.
const DATA: u64 = 1;
const PARITY: u64 = 9;

/// A telegram and what became of it.
#[derive(Clone, Debug, Default)]
pub struct Damage {
    /// The characters.
    pub frame: Frame,
    /// Whether a receiver drops it because of a character that its UART refuses.
    pub broken: bool,
    /// The character of the last wrong bit, and whether its data and parity bits are an odd number off.
    odd: (usize, bool),
}

impl Damage {
    /// Begins with the telegram as it was sent.
    pub fn begin(&mut self, octets: &[u8]) {
        self.frame.set(octets);
        self.broken = false;
    }
    /// So many bits the telegram has.
    pub fn bits(&self) -> u64 {
        self.frame.len() as u64 * CHARACTER
    }
    /// Turns bits round, given by their numbers from the first start bit on, ascending.
    pub fn turn(&mut self, bits: impl Iterator<Item = u64>) {
        self.odd = (0, false);
        for bit in bits {
            let (character, place) = ((bit / CHARACTER) as usize, bit % CHARACTER);
            if character != self.odd.0 {
                self.close();
                self.odd = (character, false);
            }
            match place {
                DATA..PARITY => {
                    self.frame.octets_mut()[character] ^= 1 << (place - DATA);
                    self.odd.1 ^= true;
                }
                PARITY => self.odd.1 ^= true,
                _ => self.broken = true,
            }
        }
        self.close();
    }
    fn close(&mut self) {
        self.broken |= self.odd.1;
    }
    /// Turns the data bits of `flip` in the character of this number, from 0, if there is one; whether it was. With
    /// `good_parity` the character gets the parity that fits, otherwise it keeps the one it had.
    pub fn change(&mut self, character: usize, flip: u8, good_parity: bool) -> bool {
        let Some(octet) = self.frame.octets_mut().get_mut(character) else { return false };
        *octet ^= flip;
        self.broken |= !good_parity && flip.count_ones() % 2 == 1;
        flip != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Address, Fcb, Header, Service, TelegramError};

    const TOKEN: [u8; 3] = [0xDC, 0x02, 0x05];

    fn turned(octets: &[u8], bits: &[u64]) -> Damage {
        let mut damage = Damage::default();
        damage.begin(octets);
        damage.turn(bits.iter().copied());
        damage
    }

    #[test]
    fn one_wrong_bit_in_a_character_is_always_refused() {
        for bit in 0..33 {
            let damage = turned(&TOKEN, &[bit]);
            assert!(damage.broken, "bit {bit}");
            let data = (1..9).contains(&(bit % 11));
            assert_eq!(damage.frame.octets() != TOKEN, data, "bit {bit}");
        }
    }

    #[test]
    fn two_wrong_bits_among_data_and_parity_pass_and_others_do_not() {
        for (first, second) in (0..33).flat_map(|first| (first + 1..33).map(move |second| (first, second))) {
            let damage = turned(&TOKEN, &[first, second]);
            let inner = |bit: u64| (1..=9).contains(&(bit % 11));
            let passes = first / 11 == second / 11 && inner(first) && inner(second);
            assert_eq!(damage.broken, !passes, "bits {first} and {second}");
        }
        // Bits 3 and 6 of DA: a token for another master that nobody can tell from a good one.
        let damage = turned(&TOKEN, &[11 + 4, 11 + 7]);
        assert_eq!((damage.broken, damage.frame.octets()), (false, &[0xDC, 0x4A, 0x05][..]));
        let three = turned(&TOKEN, &[11 + 4, 11 + 7, 11 + 9]);
        assert!(three.broken);
    }

    #[test]
    fn whatever_two_bits_of_one_octet_are_wrong_the_checks_of_a_data_telegram_find_them() {
        let station = |number| Address::new(number).unwrap();
        let header = Header::request(station(3), station(2), Service::SrdHigh, Fcb::First);
        let mut frame = Frame::new();
        frame.set_data(&header, &[0x12, 0x34, 0x56]).unwrap();
        for character in 0..frame.len() as u64 {
            for (first, second) in (1..9).flat_map(|first| (first + 1..9).map(move |second| (first, second))) {
                let damage = turned(frame.octets(), &[character * 11 + first, character * 11 + second]);
                assert!(!damage.broken);
                assert!(damage.frame.telegram().is_err(), "character {character}, bits {first} and {second}");
            }
        }
    }

    #[test]
    fn an_octet_may_get_a_good_parity_and_then_its_sum_tells() {
        let octets = [0x10, 0x06, 0x02, 0x49, 0x51, 0x16];
        let mut damage = Damage::default();
        for (flip, good, broken) in [(0x01, false, true), (0x01, true, false), (0x03, false, false), (0, false, false)]
        {
            damage.begin(&octets);
            assert_eq!(damage.change(3, flip, good), flip != 0);
            assert_eq!(damage.broken, broken);
        }
        damage.begin(&octets);
        assert!(damage.change(1, 0x01, true) && !damage.change(6, 0x01, true));
        assert!(matches!(damage.frame.telegram(), Err(TelegramError::FrameCheck { .. })));
    }
}
