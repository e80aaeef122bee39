//! Numbers of split and of masked nodes, so that the children of any node are found without reading those before them.
//!
//! Bits are counted before every [`STEP`] bytes: about 3 MB for a billion leaves. Counting from there to any bit reads a few hundred
//! bytes.

use super::bytes::{Bytes, STEP, ones};
use super::{Result, layout, nodes};
use vtkhdf::format::Chunked;
use vtkhdf::read::File;

/// Numbers of bits that are set.
#[derive(Debug)]
pub struct Index {
    pub(super) split: Vec<u64>,
    pub(super) masked: Vec<u64>,
    /// Number of leaves.
    pub leaves: u64,
}

impl Index {
    /// The index of `total` nodes, of which the first `described` may be split. Bits beyond them have no meaning.
    pub(super) fn new(
        file: &File,
        [described, total]: [u64; 2],
        split: &Chunked,
        masked: Option<&Chunked>,
    ) -> Result<Self> {
        let all = |array: &Chunked, counts: &[u64], bits: u64| {
            Bytes::new(file, array).ones_before(bits, counts)
        };
        let split_counts = counts(file, Some(split))?;
        let masked_counts = counts(file, masked)?;
        let split = all(split, &split_counts, described)?;
        let masked = masked.map_or(Ok(0), |array| all(array, &masked_counts, total))?;
        let Some(leaves) = total.checked_sub(split + masked) else {
            return nodes("more nodes are split or masked than there are");
        };
        Ok(Self { split: split_counts, masked: masked_counts, leaves })
    }
}

/// Numbers of set bits before each step, and at the end.
fn counts(file: &File, array: Option<&Chunked>) -> Result<Vec<u64>> {
    let Some(array) = array else { return Ok(Vec::new()) };
    let (mut counts, mut sum, mut chunk) = (vec![0], 0, Vec::new());
    if array.chunks.len() > 1 && !u64::from(array.chunk_len).is_multiple_of(STEP) {
        return layout(format!("its chunks have {} bytes", array.chunk_len));
    }
    for index in 0..array.chunks.len() {
        file.read_chunk(array, index, &mut chunk)?;
        for step in chunk.chunks(STEP as usize) {
            sum += ones(step);
            counts.push(sum);
        }
    }
    Ok(counts)
}
