//! Numbers of split and of masked nodes, so that the children of any node are found without reading those before them.
//!
//! Bits are counted before every [`STEP`] bytes: about 3 MB for a billion leaves. Counting from there to any bit reads a few hundred
//! bytes.

use super::bytes::{STEP, ones};
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
    pub(super) fn new(
        file: &File,
        total: u64,
        split: &Chunked,
        masked: Option<&Chunked>,
    ) -> Result<Self> {
        let split = counts(file, Some(split))?;
        let masked = counts(file, masked)?;
        let all = |counts: &[u64]| counts.last().copied().unwrap_or(0);
        let Some(leaves) = total.checked_sub(all(&split) + all(&masked)) else {
            return nodes("more nodes are split or masked than there are");
        };
        Ok(Self { split, masked, leaves })
    }
}

/// Numbers of set bits before each step, and at the end. Bits beyond the nodes must be zero.
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
