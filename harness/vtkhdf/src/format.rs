//! What the writer and the reader know of HDF5: the signature, arrays in chunks, and the checksum.

use std::ops::Range;

/// The first bytes of every file.
pub const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";
/// Bytes of the superblock, version 3.
pub(crate) const SUPERBLOCK_BYTES: usize = 48;
/// Bytes of the header of a table of chunks; the table follows it.
pub(crate) const TABLE_HEAD_BYTES: u64 = 28;
/// The address of what is not stored.
pub(crate) const UNDEFINED: u64 = u64::MAX;

/// A one-dimensional array of bytes in compressed chunks of equal length.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunked {
    /// Number of bytes.
    pub len: u64,
    /// Bytes of a chunk before compression; the last one is padded.
    pub chunk_len: u32,
    /// Where the compressed chunks are in the file. One that is not stored has zeros only.
    pub chunks: Vec<Option<Range<u64>>>,
}

impl Chunked {
    /// An array of zeros.
    ///
    /// # Panics
    /// If the array or a chunk is empty.
    pub fn new(len: u64, chunk_len: u32) -> Self {
        // The library refuses chunks that are longer than the array.
        let chunk_len = u64::from(chunk_len).min(len) as u32;
        let chunks = len.div_ceil(u64::from(chunk_len)) as usize;
        Self { len, chunk_len, chunks: vec![None; chunks] }
    }

    /// Bytes that encode the compressed size of a chunk in the table: the library's rule.
    pub(crate) fn size_bytes(&self) -> usize {
        1 + (self.chunk_len.ilog2() as usize + 8) / 8
    }
}

/// Why a file was not read: the predicate of a sentence whose subject is the file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// It is not what the writer makes: another HDF5 file, or none.
    #[error("is not a tree as this program writes it: {0}")]
    Unknown(String),
    /// It is damaged.
    #[error("is damaged: {0}")]
    Damaged(String),
}

/// The checksum of a block of metadata: Bob Jenkins' lookup3, as `H5_checksum_lookup3` computes it, with initial value 0.
pub fn lookup3(bytes: &[u8]) -> u32 {
    let mut s = [0xdead_beef_u32.wrapping_add(bytes.len() as u32); 3];
    let mut blocks = bytes.chunks(12).peekable();
    while let Some(block) = blocks.next() {
        add(&mut s, block);
        let end = if blocks.peek().is_some() { mix } else { finish };
        end(&mut s);
    }
    s[2]
}

/// Adds up to twelve bytes, with zeros after them.
fn add(s: &mut [u32; 3], bytes: &[u8]) {
    for (word, part) in s.iter_mut().zip(bytes.chunks(4)) {
        let mut padded = [0; 4];
        padded[..part.len()].copy_from_slice(part);
        *word = word.wrapping_add(u32::from_le_bytes(padded));
    }
}

fn mix(s: &mut [u32; 3]) {
    for (step, rotation) in [4, 6, 8, 16, 19, 4].into_iter().enumerate() {
        let (a, b, c) = (step % 3, (step + 1) % 3, (step + 2) % 3);
        s[a] = s[a].wrapping_sub(s[c]) ^ s[c].rotate_left(rotation);
        s[c] = s[c].wrapping_add(s[b]);
    }
}

fn finish(s: &mut [u32; 3]) {
    for (step, rotation) in [14, 11, 25, 16, 4, 14, 24].into_iter().enumerate() {
        let (to, from) = ((step + 2) % 3, (step + 1) % 3);
        s[to] = (s[to] ^ s[from]).wrapping_sub(s[from].rotate_left(rotation));
    }
}

#[cfg(test)]
mod tests {
    use super::lookup3;

    /// Values that the author of lookup3 published.
    #[test]
    fn the_checksum_is_lookup3() {
        assert_eq!(lookup3(b""), 0xdead_beef);
        assert_eq!(lookup3(b"Four score and seven years ago"), 0x1777_0551);
    }
}
