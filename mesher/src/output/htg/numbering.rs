//! Numbers of siblings in the order of the file: level by level, and in Morton order within a level.

use crate::Mesh;
use crate::partition::ownership::{Ownership, brick_start};
use bricks::octant::Level;
use bricks::tree::{LEVELS, Tree};
use ranks::Comm;
use std::ops::Range;

/// Where the siblings of this rank are in the file. Siblings are numbered from the root's children, which have number 0.
pub(super) struct Numbering {
    /// Number of nodes of each level that has any, over all ranks.
    pub(super) nodes: Vec<u64>,
    /// The first number in each interval of this rank, by level.
    first: Vec<Vec<u64>>,
    intervals: Vec<Range<u64>>,
}

impl Numbering {
    /// Counts siblings by interval of the curve, and numbers them. Collective.
    pub(super) fn new(mesh: &Mesh, comm: &dyn Comm) -> Self {
        let intervals: Vec<_> = mesh.ownership.intervals().collect();
        let mut mine = Vec::with_capacity(LEVELS * intervals.len());
        for l in 0..LEVELS as Level {
            let mut counts = vec![0; intervals.len()];
            if l > 0 {
                for b in Tree::exists(&mesh.split, l).filter(|b| mesh.ownership.owns(l, b.key)) {
                    counts[interval_of(&intervals, l, b.key)] += u64::from(b.bits.count_ones() / 8);
                }
            }
            mine.extend(counts);
        }
        let all = comm.all_gather(&mine);
        let mut by_rank = vec![&[][..]; comm.size()];
        all.messages().for_each(|(rank, counts)| by_rank[rank] = counts);
        Self::of_counts(&mesh.ownership, comm.rank(), &by_rank, intervals)
    }

    fn of_counts(
        ownership: &Ownership,
        rank: usize,
        counts: &[&[u64]],
        intervals: Vec<Range<u64>>,
    ) -> Self {
        let (mut nodes, mut first, mut next) = (vec![1], Vec::with_capacity(LEVELS), 0);
        for l in 0..LEVELS {
            let begin = next;
            let mut seen = vec![0; counts.len()];
            let mut own = Vec::with_capacity(intervals.len());
            for (_, owner) in ownership.boundaries() {
                let per_level = counts[owner].len() / LEVELS;
                if owner == rank {
                    own.push(next);
                }
                next += counts[owner][l * per_level + seen[owner]];
                seen[owner] += 1;
            }
            first.push(own);
            nodes.extend((next > begin).then(|| 8 * (next - begin)));
        }
        Self { nodes, first, intervals }
    }

    /// The interval with the brick, which this rank owns, and the first number in it.
    pub(super) fn first(&self, l: Level, key: u64) -> (usize, u64) {
        let interval = interval_of(&self.intervals, l, key);
        (interval, self.first[l as usize][interval])
    }
}

/// The interval with the minimum corner of a brick.
fn interval_of(intervals: &[Range<u64>], l: Level, key: u64) -> usize {
    let start = brick_start(l, key);
    intervals.partition_point(|interval| interval.end <= start)
}
