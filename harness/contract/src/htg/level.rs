//! The nodes of one level, read from begin to end.

use super::{Result, nodes};
use std::ops::Range;
use vtkhdf::format::Chunked;
use vtkhdf::read::File;

/// Up to eight siblings, a bit for each from the lowest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Siblings {
    pub(super) split: u8,
    pub(super) masked: u8,
    /// Sides of those that are neither split nor masked.
    pub(super) sides: [u8; 8],
}

/// A reader of one level.
pub(super) struct LevelReader<'a> {
    next: u64,
    end: u64,
    split: Option<Bytes<'a>>,
    masked: Option<Bytes<'a>>,
    sides: Option<Bytes<'a>>,
}

impl<'a> LevelReader<'a> {
    /// A reader of these nodes; without an array, its bits and bytes are zero.
    pub(super) fn new(
        file: &'a File,
        range: Range<u64>,
        split: Option<&'a Chunked>,
        masked: Option<&'a Chunked>,
        sides: Option<&'a Chunked>,
    ) -> Self {
        let bytes = |array: Option<&'a Chunked>| array.map(|array| Bytes::new(file, array));
        let Range { start: next, end } = range;
        Self { next, end, split: bytes(split), masked: bytes(masked), sides: bytes(sides) }
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.next == self.end
    }

    /// The next nodes.
    pub(super) fn next(&mut self, count: u32) -> Result<Siblings> {
        let first = self.next;
        self.next += u64::from(count);
        if self.next > self.end {
            return nodes(format!("node {} has no children", first - 1));
        }
        let bits = |bytes: &mut Option<Bytes>| match bytes {
            Some(bytes) => bytes.bits(first, count),
            None => Ok(0),
        };
        let (split, masked) = (bits(&mut self.split)?, bits(&mut self.masked)?);
        if split & masked != 0 {
            return nodes(format!("a node from {first} on is masked and split"));
        }
        let mut sides = [0; 8];
        let exist = ((1u16 << count) - 1) as u8;
        if let Some(bytes) = self.sides.as_mut().filter(|_| split | masked != exist) {
            let leaves = !(split | masked) & exist;
            for (i, side) in sides.iter_mut().enumerate().filter(|(i, _)| leaves >> i & 1 == 1) {
                *side = bytes.at(first + i as u64)?;
                if *side > 2 {
                    return nodes(format!("node {} has the side {side}", first + i as u64));
                }
            }
        }
        Ok(Siblings { split, masked, sides })
    }
}

/// The bytes of an array, for ascending positions.
struct Bytes<'a> {
    file: &'a File,
    array: &'a Chunked,
    /// The chunk in memory, and the position of its first byte.
    chunk: Vec<u8>,
    start: u64,
}

impl<'a> Bytes<'a> {
    fn new(file: &'a File, array: &'a Chunked) -> Self {
        Self { file, array, chunk: Vec::new(), start: 0 }
    }

    /// The byte at a position, which is in the array.
    #[inline]
    fn at(&mut self, position: u64) -> Result<u8> {
        if let Some(&byte) = self.chunk.get(position.wrapping_sub(self.start) as usize) {
            return Ok(byte);
        }
        self.load(position)
    }

    fn load(&mut self, position: u64) -> Result<u8> {
        let chunk_len = u64::from(self.array.chunk_len);
        let index = position / chunk_len;
        self.file.read_chunk(self.array, index as usize, &mut self.chunk)?;
        self.start = index * chunk_len;
        Ok(self.chunk[(position - self.start) as usize])
    }

    /// Up to eight bits from a position on, which the file has from the most significant one; the first becomes the lowest.
    fn bits(&mut self, first: u64, count: u32) -> Result<u8> {
        let high = self.at(first / 8)?;
        let last = first + u64::from(count) - 1;
        let low = if last / 8 > first / 8 { self.at(last / 8)? } else { 0 };
        let pair = u16::from_be_bytes([high, low]) << (first % 8);
        let bits = ((pair >> 8) as u8).reverse_bits();
        Ok(bits & ((1u16 << count) - 1) as u8)
    }
}
