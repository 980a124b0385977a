//! Ascending: any number of integers, told from the smallest to the largest, in a memory that does not grow with them.
//!
//! Up to [`PIECE`] values stay in memory. Beyond, sorted pieces of them wait in a file without a name, and are told one
//! beside the other, the smallest value that is left first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use super::temporary;

/// Values of a piece.
const PIECE: usize = 1 << 14;
/// Values of a piece that are read at once.
const WINDOW: usize = 256;
/// Octets of a value in the file.
const OCTETS: usize = 8;

/// Values in any order.
#[derive(Debug, Default)]
pub(super) struct Unsorted {
    piece: Vec<i64>,
    /// Pieces that are full, one after the other.
    file: Option<File>,
    full: u64,
}

impl Unsorted {
    /// Takes one more value.
    ///
    /// # Errors
    /// The temporary file cannot be made or written.
    pub(super) fn push(&mut self, value: i64) -> io::Result<()> {
        if self.piece.len() == PIECE {
            self.put_away()?;
        }
        self.piece.push(value);
        Ok(())
    }
    /// All of them, ascending.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub(super) fn ascending(mut self) -> io::Result<Ascending> {
        self.piece.sort_unstable_by(|one, other| other.cmp(one));
        let start = |piece: u64| Piece { at: piece * PIECE as u64, left: PIECE, window: Vec::new() };
        let mut pieces: Vec<_> = (0..self.full).map(start).collect();
        pieces.push(Piece { at: 0, left: 0, window: self.piece });
        let mut all = Ascending { file: self.file, pieces, heads: BinaryHeap::new() };
        for piece in 0..all.pieces.len() {
            all.refill(piece)?;
        }
        Ok(all)
    }
    fn put_away(&mut self) -> io::Result<()> {
        self.piece.sort_unstable();
        let file = match self.file.take() {
            Some(file) => file,
            None => temporary::file()?,
        };
        let mut writer = BufWriter::new(&file);
        for value in self.piece.drain(..) {
            writer.write_all(&value.to_le_bytes())?;
        }
        writer.flush()?;
        drop(writer);
        (self.file, self.full) = (Some(file), self.full + 1);
        Ok(())
    }
}

/// A sorted part of the values.
#[derive(Debug)]
struct Piece {
    /// Values of the file before what is not read of it.
    at: u64,
    /// Values of it that are not read.
    left: usize,
    /// What was read, the smallest last.
    window: Vec<i64>,
}

/// Values in ascending order.
#[derive(Debug)]
pub(super) struct Ascending {
    file: Option<File>,
    pieces: Vec<Piece>,
    /// The smallest value of each piece that has some, with the piece's number.
    heads: BinaryHeap<Reverse<(i64, usize)>>,
}

impl Ascending {
    /// Takes the next value of this piece among the heads.
    fn refill(&mut self, number: usize) -> io::Result<()> {
        let piece = &mut self.pieces[number];
        if piece.window.is_empty()
            && piece.left > 0
            && let Some(mut file) = self.file.as_ref()
        {
            let values = piece.left.min(WINDOW);
            let mut octets = [0; WINDOW * OCTETS];
            file.seek(SeekFrom::Start(piece.at * OCTETS as u64))?;
            file.read_exact(&mut octets[..values * OCTETS])?;
            let (read, _) = octets[..values * OCTETS].as_chunks();
            piece.window.extend(read.iter().rev().map(|&octets| i64::from_le_bytes(octets)));
            (piece.at, piece.left) = (piece.at + values as u64, piece.left - values);
        }
        self.heads.extend(piece.window.pop().map(|value| Reverse((value, number))));
        Ok(())
    }
}

impl Iterator for Ascending {
    type Item = io::Result<i64>;
    fn next(&mut self) -> Option<Self::Item> {
        let Reverse((value, piece)) = self.heads.pop()?;
        Some(self.refill(piece).map(|()| value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn told(values: &[i64]) -> Vec<i64> {
        let mut unsorted = Unsorted::default();
        for &value in values {
            unsorted.push(value).unwrap();
        }
        unsorted.ascending().unwrap().collect::<io::Result<_>>().unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn they_come_as_sorting_brings_them(
            seed in any::<u64>(),
            count in prop_oneof![0..4usize, PIECE - 1..PIECE + 2, 2 * PIECE..4 * PIECE],
        ) {
            let next = |value: &u64| Some(value.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
            // A quarter of them are the same.
            let value = |word: u64| if word >> 62 == 0 { 7 } else { word as i64 };
            let mut values: Vec<_> = std::iter::successors(Some(seed), next).take(count).map(value).collect();
            let found = told(&values);
            values.sort_unstable();
            prop_assert_eq!(found, values);
        }
    }

    #[test]
    fn the_ends_of_the_range_are_values_as_any_other() {
        assert_eq!(told(&[i64::MAX, 0, i64::MIN, 0]), [i64::MIN, 0, 0, i64::MAX]);
        assert!(told(&[]).is_empty());
    }
}
