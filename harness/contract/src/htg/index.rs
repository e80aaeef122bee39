//! Numbers of split and of masked nodes, so that the children of any node are found without reading those before them.
//!
//! Bits are counted before every [`STEP`] bytes: about 3 MB for a billion leaves. Counting from there to any bit reads a few hundred
//! bytes.

use super::bytes::{Bytes, STEP, ones};
use super::{Result, TreeError};
use vtkhdf::format::Chunked;
use vtkhdf::read::TreeReader;

/// Numbers of bits that are set.
#[derive(Debug)]
pub struct Index {
    pub(super) split: Vec<u64>,
    pub(super) masked: Vec<u64>,
    /// Number of leaves.
    pub leaves: u64,
}

impl Index {
    /// The index of the nodes of a file. Bits beyond them have no meaning.
    pub(super) fn new(file: &TreeReader) -> Result<Self> {
        let nodes = &file.shape.nodes;
        let total = file.shape.nodes_total();
        let described = total - nodes[nodes.len() - 1];
        let counted = |array: Option<&Chunked>, bits: u64| {
            let Some(array) = array else { return Ok((Vec::new(), 0)) };
            let counts = counts(file, array)?;
            let all = Bytes::new(file, array).ones_before(bits, &counts)?;
            Ok::<_, TreeError>((counts, all))
        };
        let (split, all_split) = counted(Some(&file.split), described)?;
        let (masked, all_masked) = counted(file.masked.as_ref(), total)?;
        match total.checked_sub(all_split + all_masked) {
            Some(leaves) => Ok(Self { split, masked, leaves }),
            None => super::nodes("more nodes are split or masked than there are"),
        }
    }
}

/// Numbers of set bits before each step, and at the end.
fn counts(file: &TreeReader, array: &Chunked) -> Result<Vec<u64>> {
    let (mut counts, mut sum, mut chunk) = (vec![0], 0, Vec::new());
    for index in 0..array.chunks.len() {
        file.read_chunk(array, index, &mut chunk)?;
        for step in chunk.chunks(STEP as usize) {
            sum += ones(step);
            counts.push(sum);
        }
    }
    Ok(counts)
}
