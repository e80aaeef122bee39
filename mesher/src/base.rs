//! The base tree and its partition (the paper's sections II.A and III): the top of T0, cut at
//! `level_base`, whose leaves are dealt out to the ranks; and the facets' journey to them.
//!
//! Every rank marks the octants that its share of the facets asks to split; the union of the marks is
//! the same tree for all.

use crate::brick::Brick;
use crate::brickset::BrickSet;
use crate::comm::Comm;
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::Rules;
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::partition::{self, Partitioner, Weights};
use crate::share::{BaseLeaf, Ownership};
use crate::tree::{PerLevel, Tree, per_level};
use crate::voxelise::{Depth, Filed, Home, Start, Work, reaches, refine};

/// Base leaves with children per rank that an automatic `level_base` aims at: enough for a cut to
/// find equal shares, few enough that what everyone holds stays small.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// Deepest automatic `level_base`.
const LEVEL_BASE_AUTO_MAX: Level = 10;

/// How to divide the work. Without effect on the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Who cuts the base tree.
    pub partitioner: Partitioner,
    /// What a base leaf weighs.
    pub weights: Weights,
    /// Level at which the tree is cut into base leaves; chosen by the number of ranks if none.
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
    /// Level at which the tree was cut.
    pub level_base: Level,
    /// Work done.
    pub work: Work,
}

/// Builds the base tree and deals it out. Collective.
pub fn build(
    facets: &[Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Base, Error> {
    let deepest = rules.level_deepest();
    let mark_level = match division.level_base {
        Some(l) => (l + 1).min(deepest.max(1)),
        None => deepest.clamp(1, LEVEL_BASE_AUTO_MAX),
    };
    let (marks, work) = mark(facets, rules, mark_level, comm);
    let level_base = match division.level_base {
        Some(_) => mark_level - 1,
        None => {
            let enough = SPLIT_LEAVES_PER_RANK * comm.size() as u64;
            (0..mark_level)
                .find(|&l| marks.split[l as usize].count() >= enough)
                .unwrap_or(mark_level - 1)
        }
    };
    let (internal, top, mut leaves) = cut(&marks, level_base, rules.level_surface);
    let split = |b: &BaseLeaf| top.split[b.level as usize].contains(b.code);
    let heavy: Vec<bool> = leaves.iter().map(split).collect();
    let weights = partition::weigh(&leaves, &heavy, facets, rules, division.weights, comm);
    let owners = partition::assign(&leaves, &weights, division.partitioner, comm)?;
    leaves.iter_mut().zip(owners).for_each(|(b, owner)| b.owner = owner);
    let mine = leaves.iter().zip(&heavy).filter(|(b, heavy)| **heavy && b.owner == comm.rank());
    let starts = mine.map(|(b, _)| Start { level: b.level, code: b.code }).collect();
    let share = Ownership::new(comm.rank(), comm.size(), internal, leaves);
    share.check_invariants();
    Ok(Base { share, top, starts, level_base, work })
}

/// What all facets and boxes ask to be split down to `level`: exact above it. Collective.
fn mark(facets: &[Facet], rules: &Rules, level: Level, comm: &dyn Comm) -> (Tree, Work) {
    let boxes =
        rules.boxes.iter().map(|b| crate::lattice::ExtentBox { level: b.level.min(level), ..*b });
    let depth = Depth { surface: rules.level_surface.min(level), boxes: boxes.collect() };
    let (mine, work) = refine(&Filed::new(facets), &depth, &[Start { level: 0, code: 0 }]);
    let mut words = Vec::new();
    for sets in [&mine.split, &mine.crossing] {
        for set in &sets[..=level as usize] {
            words.push(set.len() as u64);
            words.extend(set.bricks().iter().flat_map(|b| [b.key, b.bits]));
        }
    }
    let mut tree = Tree::default();
    for theirs in comm.all_gather(&words) {
        let mut at = theirs.as_slice();
        for sets in [&mut tree.split, &mut tree.crossing] {
            for set in &mut sets[..=level as usize] {
                let count = at[0] as usize;
                let bricks =
                    at[1..1 + 2 * count].chunks_exact(2).map(|w| Brick { key: w[0], bits: w[1] });
                *set = std::mem::take(set).union(BrickSet::from_unsorted(bricks.collect()));
                at = &at[1 + 2 * count..];
            }
        }
    }
    (tree, work)
}

/// Cuts marks at `level_base`: the octants above, what is known of T0, and the base leaves in order.
fn cut(marks: &Tree, level_base: Level, surface: Level) -> (PerLevel, Tree, Vec<BaseLeaf>) {
    let mut internal = per_level();
    let mut top = Tree::default();
    let mut leaves = Vec::new();
    for l in 0..=level_base as usize {
        top.split[l] = marks.split[l].clone();
        if l as Level >= surface {
            // A leaf that one rank's facets cross may be split by another's box or facets.
            let mut split = marks.split[l].cursor();
            for b in marks.crossing[l].bricks() {
                top.crossing[l].push(b.key, b.bits & !split.get(b.key));
            }
        }
        let split_below = l < level_base as usize;
        if split_below {
            internal[l] = marks.split[l].clone();
        }
        for b in Tree::exists(&marks.split, l as Level) {
            let bits = if split_below { b.bits & !marks.split[l].get(b.key) } else { b.bits };
            let codes = crate::brickset::ones(bits).map(|bit| b.key << 6 | u64::from(bit));
            leaves.extend(codes.map(|code| BaseLeaf { level: l as Level, code, owner: 0 }));
        }
    }
    leaves.sort_unstable_by_key(|b| start57(b.level, b.code));
    (internal, top, leaves)
}

/// Brings every facet to the owners of the base leaves that its extent reaches. Collective.
pub fn route(facets: &[Facet], share: &Ownership, comm: &dyn Comm) -> Vec<Facet> {
    let mut packed: Vec<Vec<Facet>> = vec![Vec::new(); comm.size()];
    let mut last = vec![u64::MAX; comm.size()];
    for (i, f) in (0u64..).zip(facets) {
        let Some(home) = Home::of(f) else { continue };
        let first = share.leaf_at(home.start());
        let end = home.start() + (1 << (3 * (LEVEL_MAX - home.level())));
        for b in &share.leaves()[first..] {
            if start57(b.level, b.code) >= end {
                break;
            }
            let there =
                b.level <= home.level() || reaches(f, &Start { level: b.level, code: b.code });
            if there && std::mem::replace(&mut last[b.owner], i) != i {
                packed[b.owner].push(*f);
            }
        }
    }
    let mut mine = std::mem::take(&mut packed[comm.rank()]);
    let out = packed.iter().map(|facets| facets.iter().flat_map(pack).collect());
    for (_, words) in comm.exchange(out.enumerate().collect()) {
        mine.extend(words.chunks_exact(5).map(unpack));
    }
    mine
}

/// Nine coordinates in five words.
fn pack(f: &Facet) -> [u64; 5] {
    let c = f.v.as_flattened();
    std::array::from_fn(|i| {
        u64::from(c[2 * i] as u32) | u64::from(c.get(2 * i + 1).map_or(0, |v| *v as u32)) << 32
    })
}

fn unpack(words: &[u64]) -> Facet {
    let at = |i: usize| (words[i / 2] >> (32 * (i % 2))) as u32 as i32;
    Facet { v: std::array::from_fn(|v| std::array::from_fn(|a| at(3 * v + a))) }
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
    fn facets_survive_the_journey() {
        let f = Facet { v: [[-5, 1 << 28, 0], [7, -(1 << 27), 3], [i32::MAX, i32::MIN, -1]] };
        assert_eq!(unpack(&pack(&f)), f);
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
