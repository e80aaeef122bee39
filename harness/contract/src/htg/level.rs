//! The nodes of one level, read from begin to end.

use super::bytes::Bytes;
use super::index::Index;
use super::{Result, nodes};
use std::ops::Range;
use vtkhdf::format::Chunked;
use vtkhdf::read::TreeReader;

/// Up to eight siblings, a bit for each from the lowest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Siblings {
    pub(super) split: u8,
    pub(super) masked: u8,
    /// Sides of those that are neither split nor masked.
    pub(super) sides: [u8; 8],
    /// Ranks of the same nodes, if the reader has ranks.
    pub(super) ranks: Option<[u32; 8]>,
}

/// The least number that is no rank, so that counting leaves by rank takes little memory whatever a file contains.
const RANKS_MAX: u32 = 1 << 24;

/// A reader of one level.
pub(super) struct LevelReader<'a> {
    begin: u64,
    next: u64,
    end: u64,
    split: Option<Bytes<'a>>,
    masked: Option<Bytes<'a>>,
    sides: Option<Bytes<'a>>,
    ranks: Option<Bytes<'a>>,
    /// The numbers of split nodes and of masked ones before the first node, when they are known.
    before: Option<[u64; 2]>,
}

impl<'a> LevelReader<'a> {
    /// A reader of these nodes. The arrays are the split nodes, the masked ones, sides and ranks; without one of the first three,
    /// its bits and bytes are zero.
    pub(super) fn new(
        file: &'a TreeReader,
        Range { start: begin, end }: Range<u64>,
        arrays: [Option<&'a Chunked>; 4],
    ) -> Self {
        let [split, masked, sides, ranks] =
            arrays.map(|array| array.map(|array| Bytes::new(file, array)));
        Self { begin, next: begin, end, split, masked, sides, ranks, before: None }
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.next == self.end
    }

    /// The first node.
    pub(super) fn begin(&self) -> u64 {
        self.begin
    }

    /// Continues with a node.
    pub(super) fn seek(&mut self, node: u64) {
        self.next = node;
    }

    /// Whether a node is split.
    pub(super) fn is_split(&mut self, node: u64) -> Result<bool> {
        if node >= self.end {
            return nodes(format!("node {} has no children", node - 1));
        }
        self.split.as_mut().map_or(Ok(false), |bytes| Ok(bytes.bits(node, 1)? == 1))
    }

    /// The numbers of split nodes and of masked ones before a node of this level, or before its end.
    pub(super) fn bits_before(&mut self, node: u64, index: &Index) -> Result<[u64; 2]> {
        if node > self.end {
            return nodes(format!("node {} has no children", node - 1));
        }
        // Where a level begins is often in another chunk than the node.
        let before = match self.before {
            Some(before) => before,
            None => self.bits_before_in_file(self.begin, index)?,
        };
        self.before = Some(before);
        let [split, masked] = self.bits_before_in_file(node, index)?;
        Ok([split - before[0], masked - before[1]])
    }

    /// The same for nodes of all levels.
    fn bits_before_in_file(&mut self, node: u64, index: &Index) -> Result<[u64; 2]> {
        let count = |bytes: &mut Option<Bytes>, counts: &[u64]| match bytes {
            Some(bytes) => bytes.ones_before(node, counts),
            None => Ok(0),
        };
        Ok([count(&mut self.split, &index.split)?, count(&mut self.masked, &index.masked)?])
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
        let leaves = !(split | masked) & exist;
        if let Some(bytes) = self.sides.as_mut().filter(|_| leaves != 0) {
            for (i, side) in sides.iter_mut().enumerate().filter(|(i, _)| leaves >> i & 1 == 1) {
                *side = bytes.at(first + i as u64)?;
                if *side > 2 {
                    return nodes(format!("node {} has the side {side}", first + i as u64));
                }
            }
        }
        let mut ranks = self.ranks.as_ref().map(|_| [0; 8]);
        if let (Some(ints), Some(ranks)) = (&mut self.ranks, &mut ranks) {
            for (i, rank) in ranks.iter_mut().enumerate().filter(|(i, _)| leaves >> i & 1 == 1) {
                let node = first + i as u64;
                let found = ints.int(node)?;
                match u32::try_from(found).ok().filter(|&rank| rank < RANKS_MAX) {
                    Some(found) => *rank = found,
                    None => return nodes(format!("node {node} has the rank {found}")),
                }
            }
        }
        Ok(Siblings { split, masked, sides, ranks })
    }
}
