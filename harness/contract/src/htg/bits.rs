//! The bits of an array, all in memory: an eighth of a byte for each node in a chunk that is stored.

use super::Result;
use std::ops::Range;
use vtkhdf::format::Chunked;
use vtkhdf::read::TreeReader;

/// Bits that the file has from the most significant one of each byte.
#[derive(Debug, Default)]
pub(super) struct Bits {
    /// The chunks; empty without set bits.
    chunks: Vec<Vec<u8>>,
    /// Bytes of a chunk.
    chunk_bytes: u64,
}

impl Bits {
    /// The first `count` bits of an array. Those after them have no meaning, and are zero here.
    pub(super) fn read(file: &TreeReader, array: &Chunked, count: u64) -> Result<Self> {
        let mut bits = Self { chunks: Vec::new(), chunk_bytes: u64::from(array.chunk_len) };
        for (index, begin) in (0..array.chunks.len()).zip((0..).step_by(array.chunk_len as usize)) {
            let mut chunk = Vec::new();
            if array.chunks[index].is_some() {
                file.read_chunk(array, index, &mut chunk)?;
            }
            let left = count.saturating_sub(8 * begin);
            if left < 8 * chunk.len() as u64 {
                chunk.truncate(left.div_ceil(8) as usize);
                if let Some(last) = chunk.last_mut().filter(|_| !left.is_multiple_of(8)) {
                    *last &= !(0xff >> (left % 8));
                }
            }
            bits.chunks.push(chunk);
        }
        Ok(bits)
    }

    /// Up to eight bits from a position on; the first becomes the lowest.
    pub(super) fn get(&self, first: u64, count: u32) -> u8 {
        let pair = u16::from_be_bytes([self.byte(first / 8), self.byte(first / 8 + 1)]);
        let bits = ((pair << (first % 8) >> 8) as u8).reverse_bits();
        bits & ((1u16 << count) - 1) as u8
    }

    fn byte(&self, at: u64) -> u8 {
        let Some(chunk) = at.checked_div(self.chunk_bytes) else { return 0 };
        let chunk = self.chunks.get(chunk as usize);
        let byte = chunk.and_then(|chunk| chunk.get((at % self.chunk_bytes) as usize));
        byte.copied().unwrap_or(0)
    }

    /// Number of bits that are set in a range.
    pub(super) fn ones(&self, Range { start, end }: Range<u64>) -> u64 {
        let bits = |first: u64| self.get(first, (end - first).min(8) as u32).count_ones();
        (start..end).step_by(8).map(|first| u64::from(bits(first))).sum()
    }

    /// Whether no bit is set in both.
    pub(super) fn are_disjoint(&self, other: &Self) -> bool {
        let of_chunk = |(a, b): (&Vec<u8>, &Vec<u8>)| a.iter().zip(b).all(|(a, b)| a & b == 0);
        // Of two arrays of which one has a shorter chunk, that is the only one.
        self.chunks.iter().zip(&other.chunks).all(of_chunk)
    }
}
