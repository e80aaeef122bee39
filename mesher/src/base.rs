//! The base tree and its partition (the paper's sections II.A and III): the top of T0, whose leaves
//! are dealt out to the ranks; and the facets' journey to them.
//!
//! Every rank marks the octants that its share of the facets asks to split; the union of the marks is
//! the same tree for all. Where the cut through it goes is a matter of balance: a base leaf that is
//! heavier than a small part of one rank's share is split further, as no partition can divide it.

mod rehearse;
mod route;

pub use route::route;

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::Comm;
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::{LEVEL_MAX, Level, edge, start57};
use crate::partition::area::{self, Areas};
use crate::partition::{self, Partitioner, Weights, boxed};
use crate::share::{BaseLeaf, Ownership};
use crate::tree::{PerLevel, Tree, per_level};
use crate::voxelise::{Depth, Filed, Start, Work, refine};

/// Base leaves with children per rank that the paper's way, one level for all, aims at.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// A base leaf heavier than this part of a rank's share is split where that is automatic: a cut then
/// misses an equal share by a few percent, and what everyone holds stays small.
const SHARE_PARTS: u64 = 16;
/// Deepest automatic `level_base`.
const LEVEL_BASE_AUTO_MAX: Level = 12;

/// How to divide the work. Without effect on the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Who cuts the base tree.
    pub partitioner: Partitioner,
    /// What a base leaf weighs.
    pub weights: Weights,
    /// Level at which the tree is cut into base leaves; chosen by ranks and weights if none.
    pub level_base: Option<Level>,
}

/// The base tree as all ranks know it: splits and crossing leaves down to the base leaves.
pub struct Base {
    /// Who owns which base leaf.
    pub share: Ownership,
    /// The part of T0 that is known to all.
    pub top: Tree,
    /// This rank's base leaves that are split in T0.
    pub starts: Vec<Start>,
    /// Level of the deepest base leaves.
    pub level_base: Level,
    /// Work done.
    pub work: Work,
}

/// A cut through the base tree.
struct Cut {
    /// Octants above the base leaves.
    internal: PerLevel,
    /// What is known of T0.
    top: Tree,
    /// The base leaves in order.
    leaves: Vec<BaseLeaf>,
    /// Which of them are split in T0.
    heavy: Vec<bool>,
    /// Level of the deepest base leaves, or of those that there might be.
    level_base: Level,
}

/// Builds the base tree and deals it out. Collective.
pub fn build(
    facets: &[Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Base, Error> {
    let deepest = rules.level_deepest().max(1);
    let level_wanted = match division.level_base {
        Some(l) => l,
        None => level_auto(facets, rules, comm),
    };
    let mark_level = (level_wanted + 1).min(deepest);
    let (marks, work) = mark(facets, rules, mark_level, comm);
    let areas = match division.weights {
        Weights::Unit => Areas::default(),
        _ => Areas::gather(facets, rules, mark_level - 1, comm),
    };
    let expected = |b: &BaseLeaf| {
        // A facet's cells come with the layers on its kept side, a third of them being coarser.
        let thick = (u64::from(rules.layer_cells_min) + 2) * 4 / 3;
        1 + areas.cells(b.level, b.code).saturating_mul(thick) + boxed(b, rules)
    };
    let internal = match (division.level_base, division.weights) {
        (Some(_), _) => uniform(&marks, mark_level - 1),
        (None, Weights::Unit) => {
            let enough = SPLIT_LEAVES_PER_RANK * comm.size() as u64;
            let level = (0..mark_level).find(|&l| marks.split[l as usize].count() >= enough);
            uniform(&marks, level.unwrap_or(mark_level - 1))
        }
        (None, _) => adaptive(&marks, mark_level - 1, expected, comm.size()),
    };
    let mut cut = cut(&marks, internal, rules.level_surface);
    let weights = match division.weights {
        Weights::Unit => vec![1; cut.leaves.len()],
        Weights::Area => cut.leaves.iter().map(expected).collect(),
        Weights::Rehearsal => {
            let expected: Vec<u64> = cut.leaves.iter().map(expected).collect();
            rehearse::weights(facets, rules, &cut, expected, comm)
        }
    };
    let owners = partition::assign(&cut.leaves, &weights, division.partitioner, comm)?;
    cut.leaves.iter_mut().zip(owners).for_each(|(b, owner)| b.owner = owner);
    let starts = cut.starts(comm.rank());
    let Cut { internal, top, leaves, level_base, .. } = cut;
    let share = Ownership::new(comm.rank(), comm.size(), internal, leaves);
    share.check_invariants();
    Ok(Base { share, top, starts, level_base, work })
}

/// The level of base leaves that are small enough for a fair share even where the facets lie closest, by
/// the facets' area and the boxes' volume. Collective.
fn level_auto(facets: &[Facet], rules: &Rules, comm: &dyn Comm) -> Level {
    // Whole finest faces: a sum of integers is the same on all ranks.
    let face = (edge(rules.level_surface) as f64).powi(2);
    let area = comm.sum((area::total(facets) / face) as u64) as f64 * face;
    let side = |b: &ExtentBox, a: usize| (b.max[a] - b.min[a]) as f64;
    let volumes = rules.boxes.iter().map(|b| (0..3).map(|a| side(b, a)).product::<f64>());
    let volume = volumes.fold(0.0, f64::max);
    // Four sheets of facets in one octant are not unusual: wings, fins.
    let parts = (comm.size() as u64 * SHARE_PARTS * 4) as f64;
    let small = |l: &Level| {
        let h = edge(*l) as f64;
        h * h <= area / parts && (volume == 0.0 || h.powi(3) <= volume / parts)
    };
    (0..LEVEL_BASE_AUTO_MAX).find(small).unwrap_or(LEVEL_BASE_AUTO_MAX)
}

/// What all facets and boxes ask to be split down to `level`: exact above it. Collective.
fn mark(facets: &[Facet], rules: &Rules, level: Level, comm: &dyn Comm) -> (Tree, Work) {
    let boxes = rules.boxes.iter().map(|b| ExtentBox { level: b.level.min(level), ..*b });
    let depth = Depth { surface: rules.level_surface.min(level), boxes: boxes.collect() };
    let (mine, work) = refine(&Filed::new(facets), &depth, &[Start { level: 0, code: 0 }]);
    let mut words = Vec::new();
    for sets in [&mine.split, &mine.crossing] {
        for set in &sets[..=level as usize] {
            words.push(set.len() as u64);
            words.extend(set.bricks().flat_map(|b| [b.key, b.bits]));
        }
    }
    let all = comm.all_gather(&words);
    let mut rest: Vec<&[u64]> = all.iter().map(Vec::as_slice).collect();
    let mut tree = Tree::default();
    for sets in [&mut tree.split, &mut tree.crossing] {
        for set in &mut sets[..=level as usize] {
            // All ranks' bricks at once: a union per rank would copy the set as often as there are ranks.
            let mut bricks = Vec::new();
            for words in &mut rest {
                let (mine, behind) = words[1..].split_at(2 * words[0] as usize);
                bricks.extend(mine.chunks_exact(2).map(|w| Brick { key: w[0], bits: w[1] }));
                *words = behind;
            }
            *set = BrickSet::from_unsorted(bricks);
        }
    }
    (tree, work)
}

/// The octants above base leaves of one level.
fn uniform(marks: &Tree, level_base: Level) -> PerLevel {
    let mut internal = per_level();
    let above = ..level_base as usize;
    internal[above].clone_from_slice(&marks.split[above]);
    internal
}

/// The octants above base leaves, each of which is light enough, or of level `deepest`, or not split in T0.
fn adaptive(
    marks: &Tree,
    deepest: Level,
    expected: impl Fn(&BaseLeaf) -> u64,
    ranks: usize,
) -> PerLevel {
    let root = expected(&BaseLeaf { level: 0, code: 0, owner: 0 });
    let limit = root / (ranks as u64 * SHARE_PARTS);
    let mut internal = per_level();
    for l in 0..deepest {
        let mut heavy = BrickSet::default();
        let mut split = marks.split[l as usize].cursor();
        for b in Tree::exists(&internal, l) {
            for bit in crate::brickset::ones(b.bits & split.get(b.key)) {
                let code = b.key << 6 | u64::from(bit);
                if expected(&BaseLeaf { level: l, code, owner: 0 }) > limit {
                    heavy.push(b.key, 1 << bit);
                }
            }
        }
        internal[l as usize] = heavy;
    }
    internal
}

/// Cuts marks below the octants `internal`. Of what lies deeper only top bricks are known to all.
fn cut(marks: &Tree, internal: PerLevel, surface: Level) -> Cut {
    let level_base = internal.iter().rposition(|s| !s.is_empty()).map_or(0, |l| l as Level + 1);
    let mut top = Tree::default();
    let mut leaves = Vec::new();
    for l in 0..=level_base as usize {
        let is_top = |key: u64| l < 2 || internal[l - 2].contains(key);
        for b in marks.split[l].bricks().filter(|b| is_top(b.key)) {
            top.split[l].push(b.key, b.bits);
        }
        if l as Level >= surface {
            // A leaf that one rank's facets cross may be split by another's box or facets.
            let mut split = marks.split[l].cursor();
            for b in marks.crossing[l].bricks().filter(|b| is_top(b.key)) {
                top.crossing[l].push(b.key, b.bits & !split.get(b.key));
            }
        }
        let mut above = internal[l].cursor();
        for b in Tree::exists(&internal, l as Level) {
            let codes = crate::brickset::ones(b.bits & !above.get(b.key));
            let codes = codes.map(|bit| b.key << 6 | u64::from(bit));
            leaves.extend(codes.map(|code| BaseLeaf { level: l as Level, code, owner: 0 }));
        }
    }
    leaves.sort_unstable_by_key(|b| start57(b.level, b.code));
    let heavy = leaves.iter().map(|b| top.split[b.level as usize].contains(b.code)).collect();
    Cut { internal, top, leaves, heavy, level_base }
}

impl Cut {
    /// A rank's base leaves that are split in T0.
    fn starts(&self, rank: usize) -> Vec<Start> {
        let mine =
            self.leaves.iter().zip(&self.heavy).filter(|(b, heavy)| **heavy && b.owner == rank);
        mine.map(|(b, _)| Start { level: b.level, code: b.code }).collect()
    }
}

/// Leaves of the final mesh in the heaviest of this rank's base leaves; `split` is the graded tree.
pub fn cells_heaviest(
    split: &[BrickSet],
    deleted: &[BrickSet],
    share: &Ownership,
    rank: usize,
) -> u64 {
    let mut counts = vec![1i64; share.leaves().len()];
    let mut add = |l: Level, set: &BrickSet, each: i64| {
        for b in set.bricks() {
            // A top brick spans several base leaves; those are told octant by octant.
            let spans = l < 2 || share.internal()[l as usize - 2].contains(b.key);
            if !spans {
                let at = share.leaf_at(start57(l - 2, b.key));
                counts[at] += each * i64::from(b.bits.count_ones());
                continue;
            }
            for bit in crate::brickset::ones(b.bits) {
                let code = b.key << 6 | u64::from(bit);
                if !share.internal()[l as usize].contains(code) {
                    counts[share.leaf_at(start57(l, code))] += each;
                }
            }
        }
    };
    for l in 0..=LEVEL_MAX {
        add(l, &split[l as usize], 7);
        add(l, &deleted[l as usize], -1);
    }
    let mine = share.leaves().iter().zip(&counts).filter(|(b, _)| b.owner == rank);
    mine.map(|(_, n)| *n).max().unwrap_or(0).max(0) as u64
}

/// Pairs of base leaves that share part of a face, each once, the lower number first.
#[cfg_attr(not(feature = "metis"), allow(dead_code))]
pub(crate) fn face_neighbours(
    leaves: &[BaseLeaf],
    leaf_at: impl Fn(u64) -> usize,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, b) in leaves.iter().enumerate() {
        for axis in 0..3 {
            for up in [false, true] {
                let Some(n) = crate::octant::neighbour(b.level, b.code, axis, up) else {
                    continue;
                };
                let j = leaf_at(start57(b.level, n));
                // A finer neighbour finds this one itself.
                if leaves[j].level <= b.level {
                    pairs.push((i.min(j), i.max(j)));
                }
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Level-19 Morton code of the middle of a facet's extent, if that is in the root.
pub(crate) fn middle(f: &Facet) -> Option<u64> {
    let mid = std::array::from_fn(|a| {
        let (lo, hi) = f.range(a);
        (lo + hi) / 2
    });
    let inside = mid.iter().all(|c: &i64| (0..crate::octant::ROOT_EDGE).contains(c));
    inside.then(|| {
        crate::octant::morton(mid.map(|c| (c >> (crate::octant::ROOT_BITS - LEVEL_MAX)) as u32))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::position;

    #[test]
    fn cells_are_counted_by_base_leaf() {
        let set = |codes: &[u64]| {
            let bricks = codes.iter().map(|c| Brick { key: c >> 6, bits: 1 << (c & 63) });
            BrickSet::from_unsorted(bricks.collect())
        };
        let (mut internal, mut split, mut deleted) = (per_level(), per_level(), per_level());
        internal[0] = set(&[0]);
        // Octant 3 and two of its children are split, octant 5 alone; of the leaves below 3 two are deleted.
        for (l, codes) in [(0, &[0][..]), (1, &[3, 5]), (2, &[3 << 3, 3 << 3 | 6])] {
            split[l] = set(codes);
        }
        deleted[2] = set(&[3 << 3 | 1]);
        deleted[3] = set(&[3 << 6 | 7]);
        let leaves: Vec<BaseLeaf> =
            (0..8).map(|code| BaseLeaf { level: 1, code, owner: usize::from(code > 3) }).collect();
        let share = Ownership::new(0, 2, internal, leaves);
        assert_eq!(cells_heaviest(&split, &deleted, &share, 0), 1 + 7 + 14 - 2);
        assert_eq!(cells_heaviest(&split, &deleted, &share, 1), 8);
    }

    #[test]
    fn heavy_octants_are_split_and_light_ones_are_not() {
        let mut marks = Tree::default();
        marks.split[0] = BrickSet::from_unsorted(vec![Brick { key: 0, bits: 1 }]);
        marks.split[1] = BrickSet::from_unsorted(vec![Brick { key: 0, bits: 0b101 }]);
        let expected = |b: &BaseLeaf| match (b.level, b.code) {
            (0, _) => 6400,
            (1, 0) => 900,
            _ => 100,
        };
        // A share is 3,200 and a 16th of it 200: octant 2 is split in T0, but light.
        let internal = adaptive(&marks, 2, expected, 2);
        assert_eq!(internal[0].count(), 1);
        assert_eq!(internal[1].codes().collect::<Vec<_>>(), [0]);
        assert_eq!(cut(&marks, internal, 9).leaves.len(), 7 + 8);
    }

    #[test]
    fn neighbours_of_a_uniform_base_tree() {
        let leaves: Vec<BaseLeaf> =
            (0..64).map(|code| BaseLeaf { level: 2, code, owner: 0 }).collect();
        let pairs = face_neighbours(&leaves, |s| (s >> (3 * (LEVEL_MAX - 2))) as usize);
        assert_eq!(pairs.len(), 3 * 3 * 16);
        let apart = |a: usize, b: usize| -> i64 {
            let (p, q) = (position(a as u64), position(b as u64));
            (0..3).map(|i| (i64::from(p[i]) - i64::from(q[i])).abs()).sum()
        };
        assert!(pairs.iter().all(|&(a, b)| apart(a, b) == 1));
    }
}
