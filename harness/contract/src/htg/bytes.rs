//! The bytes, bits and integers of an array, of which one chunk is in memory.

use super::Result;
use vtkhdf::format::Chunked;
use vtkhdf::read::TreeReader;

/// Bytes between two counts: a divisor of the length of chunks.
pub(super) const STEP: u64 = 512;

/// Number of set bits.
pub(super) fn ones(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let words: u32 = words.iter().map(|word| u64::from_le_bytes(*word).count_ones()).sum();
    let rest: u32 = rest.iter().map(|byte| byte.count_ones()).sum();
    u64::from(words + rest)
}

/// The bytes of an array. Fast if most positions are near the last one.
pub(super) struct Bytes<'a> {
    file: &'a TreeReader,
    array: &'a Chunked,
    /// The chunk in memory, and the position of its first byte.
    chunk: Vec<u8>,
    start: u64,
}

impl<'a> Bytes<'a> {
    pub(super) fn new(file: &'a TreeReader, array: &'a Chunked) -> Self {
        Self { file, array, chunk: Vec::new(), start: 0 }
    }

    /// The byte at a position, which is in the array.
    #[inline]
    pub(super) fn at(&mut self, position: u64) -> Result<u8> {
        if let Some(&byte) = self.chunk.get(position.wrapping_sub(self.start) as usize) {
            return Ok(byte);
        }
        let at = self.load(position)?;
        Ok(self.chunk[at])
    }

    /// The element at a position of an array of i32.
    pub(super) fn int(&mut self, position: u64) -> Result<i32> {
        let at = |chunk: &[u8], element: usize| {
            let bytes = chunk.get(element.checked_mul(4)?..)?;
            bytes.first_chunk().map(|bytes| i32::from_le_bytes(*bytes))
        };
        if let Some(int) = at(&self.chunk, position.wrapping_sub(self.start) as usize) {
            return Ok(int);
        }
        let element = self.load(position)?;
        Ok(at(&self.chunk, element).expect("chunks have whole elements"))
    }

    /// Reads the chunk with a position; returns the number of that element in the chunk.
    fn load(&mut self, position: u64) -> Result<usize> {
        let chunk_len = u64::from(self.array.chunk_len);
        let index = position / chunk_len;
        self.file.read_chunk(self.array, index as usize, &mut self.chunk)?;
        self.start = index * chunk_len;
        Ok((position - self.start) as usize)
    }

    /// Up to eight bits from a position on, which the file has from the most significant one; the first becomes the lowest.
    pub(super) fn bits(&mut self, first: u64, count: u32) -> Result<u8> {
        let high = self.at(first / 8)?;
        let last = first + u64::from(count) - 1;
        let low = if last / 8 > first / 8 { self.at(last / 8)? } else { 0 };
        let pair = u16::from_be_bytes([high, low]) << (first % 8);
        let bits = ((pair >> 8) as u8).reverse_bits();
        Ok(bits & ((1u16 << count) - 1) as u8)
    }

    /// Number of bits that are set before a position; `counts` are those before every [`STEP`] bytes.
    pub(super) fn ones_before(&mut self, bit: u64, counts: &[u64]) -> Result<u64> {
        let (step, within) = (bit / 8 / STEP, bit % (8 * STEP));
        let (full, partial) = (within / 8, within % 8);
        let mut sum = counts[step as usize];
        if full > 0 {
            self.at(step * STEP)?;
            let first = (step * STEP - self.start) as usize;
            sum += ones(&self.chunk[first..first + full as usize]);
        }
        if partial > 0 {
            sum += u64::from((self.at(bit / 8)? >> (8 - partial)).count_ones());
        }
        Ok(sum)
    }
}
