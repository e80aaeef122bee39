//! The number of leaves in the heaviest base leaf, which bounds the load balance of any partition.

use crate::brickset::{BrickSet, ones};
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::partition::ownership::BaseLeaf;

/// Leaves of the final mesh in the heaviest of this rank's base leaves, which are in Morton order; `split` is the graded
/// tree.
pub fn cells_heaviest(split: &[BrickSet], deleted: &[BrickSet], base_leaves: &[BaseLeaf]) -> u64 {
    let starts: Vec<u64> = base_leaves.iter().map(|b| start57(b.level, b.code)).collect();
    // The base leaf that contains an octant of level `l`.
    let containing = |l: Level, start: u64| {
        let i = starts.partition_point(|&s| s <= start).checked_sub(1)?;
        let b = base_leaves[i];
        (start < start57(b.level, b.code + 1) && b.level <= l).then_some(i)
    };
    let mut counts = vec![1i64; base_leaves.len()];
    let mut add = |l: Level, set: &BrickSet, each: i64| {
        for b in set.bricks() {
            if let Some(i) = l.checked_sub(2).and_then(|up| containing(up, start57(up, b.key))) {
                counts[i] += each * i64::from(b.bits.count_ones());
                continue;
            }
            // The brick spans several base leaves, or is another rank's.
            for bit in ones(b.bits) {
                if let Some(i) = containing(l, start57(l, b.key << 6 | u64::from(bit))) {
                    counts[i] += each;
                }
            }
        }
    };
    for l in 0..=LEVEL_MAX {
        add(l, &split[l as usize], 7);
        add(l, &deleted[l as usize], -1);
    }
    counts.into_iter().max().unwrap_or(0).max(0) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::Brick;
    use crate::tree::per_level;

    #[test]
    fn cells_are_counted_by_base_leaf() {
        let set = |codes: &[u64]| {
            let bricks = codes.iter().map(|c| Brick { key: c >> 6, bits: 1 << (c & 63) });
            BrickSet::from_unsorted(bricks.collect())
        };
        let (mut split, mut deleted) = (per_level(), per_level());
        // Octant 3 and two of its children are split, octant 5 alone; of the leaves below 3 two are deleted.
        for (l, codes) in [(0, &[0][..]), (1, &[3, 5]), (2, &[3 << 3, 3 << 3 | 6])] {
            split[l] = set(codes);
        }
        deleted[2] = set(&[3 << 3 | 1]);
        deleted[3] = set(&[3 << 6 | 7]);
        let leaves: Vec<BaseLeaf> =
            (0..8).map(|code| BaseLeaf { level: 1, code, owner: 0 }).collect();
        assert_eq!(cells_heaviest(&split, &deleted, &leaves[..4]), 1 + 7 + 14 - 2);
        assert_eq!(cells_heaviest(&split, &deleted, &leaves[4..]), 8);
        assert_eq!(cells_heaviest(&split, &deleted, &[]), 0);
    }
}
