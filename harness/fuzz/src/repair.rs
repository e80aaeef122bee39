//! Checksums of HDF5's metadata: with wrong ones, a reader refuses a file before it looks at anything else.

use vtkhdf::checksum::lookup3;
use vtkhdf::format::SIGNATURE;

/// Bytes of the superblock.
const SUPERBLOCK: usize = 48;
/// Bytes of the head of a table of chunks.
const TABLE_HEAD: usize = 28;

/// Makes the checksums and the length in the superblock right, wherever the blocks that have them are complete.
pub fn checksums(bytes: &mut [u8]) {
    if bytes.starts_with(&SIGNATURE) && bytes.len() >= SUPERBLOCK {
        let length = bytes.len() as u64;
        bytes[28..36].copy_from_slice(&length.to_le_bytes());
        sum(bytes, 0, SUPERBLOCK as u64);
    }
    for at in 0..bytes.len().saturating_sub(TABLE_HEAD) {
        if bytes[at..].starts_with(b"OHDR") {
            let size = number(bytes, at + 6, 4);
            sum(bytes, at as u64, 10 + size + 4);
        } else if bytes[at..].starts_with(b"FAHD") {
            sum(bytes, at as u64, TABLE_HEAD as u64);
            let (entry, count) = (u64::from(bytes[at + 6]), number(bytes, at + 8, 8));
            let table = number(bytes, at + 16, 8);
            sum(bytes, table, count.saturating_mul(entry).saturating_add(18));
        }
    }
}

/// The number in these bytes, little-endian.
fn number(bytes: &[u8], at: usize, length: usize) -> u64 {
    bytes[at..at + length].iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// Writes the checksum of a block into its last four bytes, if the block is part of the file.
fn sum(bytes: &mut [u8], at: u64, length: u64) {
    let end = at.saturating_add(length);
    if end <= bytes.len() as u64 && length >= 4 {
        let (at, sum_at) = (at as usize, end as usize - 4);
        let checksum = lookup3(&bytes[at..sum_at]);
        bytes[sum_at..end as usize].copy_from_slice(&checksum.to_le_bytes());
    }
}
