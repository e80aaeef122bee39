//! The bytes and integers of an array, of which one chunk is in memory.

use super::Result;
use vtkhdf::format::Chunked;
use vtkhdf::read::TreeReader;

/// The elements of an array. Fast if most positions are near the last one.
pub(super) struct Bytes<'a> {
    file: &'a TreeReader,
    array: &'a Chunked,
    /// The chunk in memory, and the position of its first element.
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
        let [byte] = self.element(position)?;
        Ok(byte)
    }

    /// The element at a position of an array of i32.
    pub(super) fn int(&mut self, position: u64) -> Result<i32> {
        Ok(i32::from_le_bytes(self.element(position)?))
    }

    /// The element of `N` bytes at a position.
    #[inline]
    fn element<const N: usize>(&mut self, position: u64) -> Result<[u8; N]> {
        let at = |chunk: &[u8], start: u64| {
            let element = usize::try_from(position.checked_sub(start)?).ok()?;
            chunk.get(N * element..)?.first_chunk().copied()
        };
        if let Some(element) = at(&self.chunk, self.start) {
            return Ok(element);
        }
        let chunk_len = u64::from(self.array.chunk_len);
        let index = position / chunk_len;
        self.file.read_chunk(self.array, index as usize, &mut self.chunk)?;
        self.start = index * chunk_len;
        Ok(at(&self.chunk, self.start).expect("chunks have whole elements"))
    }
}
