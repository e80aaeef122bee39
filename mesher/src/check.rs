//! Checks of the invariants at the end of each phase, on all ranks.
//!
//! [`debug_check`] runs them in debug builds, and in release builds with `--check`. Invariants of sets and trees are checked next
//! to their definitions; those that need other ranks, or the sets of several modules, are here. Each check is a
//! simple traversal, and takes memory proportional to the sets that it checks. All functions are collective, and panic if an
//! invariant is violated. Messages of checks are not counted.

use crate::brick::{self, Brick};
use crate::brickset::BrickSet;
use crate::comm::{Comm, MessageBuffer};
use crate::facet::{Facet, crossed};
use crate::ingest::Slice;
use crate::lattice::Rules;
use crate::leaves::Totals;
use crate::mesh::{Mesh, Options};
use crate::octant::{LEVEL_MAX, Level, morton, path, position};
use crate::partition::ownership::{Ownership, Placement};
use crate::refine::owners_reached;
use crate::sides::Sides;
use crate::stream::Counts;
use crate::tree::{PerLevel, Tree, check_existing, check_split};
use crate::write::Written;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};

/// Whether checks run: in debug builds, and in release builds if the options ask for them.
pub fn is_on(options: &Options) -> bool {
    cfg!(debug_assertions) || options.check
}

/// Runs a check if checks [are on](is_on). Its messages are not counted. Collective if the check is.
pub fn debug_check(options: &Options, comm: &dyn Comm, mut check: impl FnMut()) {
    if is_on(options) {
        comm.uncounted(&mut check);
    }
}

/// The slices of all ranks are contiguous and add up to the total.
pub fn slices(slice: &Slice, comm: &dyn Comm) {
    let all = comm.all_gather(&[slice.first, slice.facets.len() as u64, slice.total]);
    let mut end = 0;
    for &[first, count, total] in all.words().as_chunks().0 {
        assert_eq!((first, total), (end, slice.total), "slices of facets must be contiguous");
        end += count;
    }
    assert_eq!(end, slice.total, "slices of facets must add up to the total");
}

/// All ranks have the same rules.
pub fn rules(rules: &Rules, comm: &dyn Comm) {
    // Formatted floating-point numbers round-trip.
    same(&format!("{rules:?}"), "rules", comm);
}

/// All ranks have the same map from octants to owners.
pub fn ownership(ownership: &Ownership, comm: &dyn Comm) {
    let intervals: Vec<_> = ownership.intervals().collect();
    let ends: u64 = comm.sum(intervals.iter().map(|i| i.end - i.start).sum());
    assert_eq!(ends, 1 << (3 * LEVEL_MAX), "the intervals of all ranks must tile the curve");
    for i in intervals {
        assert_eq!(ownership.owner_at(i.start), comm.rank(), "a rank must own its intervals");
    }
    let boundaries: Vec<_> = ownership.boundaries().collect();
    same(&boundaries, "partition boundaries", comm);
}

/// A value has the same hash on all ranks.
fn same(value: &impl Hash, name: &str, comm: &dyn Comm) {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    let all = comm.all_gather(&[hasher.finish()]);
    assert!(
        all.words().iter().all(|h| *h == all.words()[0]),
        "{name} must be the same on all ranks"
    );
}

/// Each facet is on all ranks that own an octant that its extent reaches, and on no other, once.
pub fn facets(slice: &[Facet], routed: &[Facet], ownership: &Ownership, comm: &dyn Comm) {
    let owners = |f: &Facet| {
        let mut owners = BTreeSet::new();
        let extent = std::array::from_fn(|a| f.range(a));
        if crossed(f, [0; 3], 0) & 1 == 1 {
            owners_reached(ownership, &extent, 0, 0, &mut |owner| _ = owners.insert(owner));
        }
        owners
    };
    let reaches = |f: &Facet| owners(f).contains(&comm.rank());
    assert!(routed.iter().all(reaches), "a rank's facets must reach its octants");
    let sent = comm.sum(slice.iter().map(|f| owners(f).len() as u64).sum());
    let received = comm.sum(routed.len() as u64);
    assert_eq!(sent, received, "facets must be on all ranks whose octants they reach");
}

/// The invariants of T0, and that it is linear and complete.
pub fn base_tree(tree: &Tree, rules: &Rules, ownership: &Ownership, comm: &dyn Comm) {
    tree.check_invariants(rules, ownership);
    replicas(&[&tree.split, &tree.crossing], ownership, comm);
    is_complete(&tree.split, ownership, comm);
}

/// Inside and deleted leaves are leaves of T0 that do not cross, as `keep` asks for them; results are the same on all ranks.
pub fn sides(sides: &Sides, tree: &Tree, ownership: &Ownership, comm: &dyn Comm) {
    sides.check_invariants(tree, ownership);
    replicas(&[&sides.inside, &sides.deleted], ownership, comm);
    same(&format!("{:?}", (sides.rays, sides.summary)), "results of sides", comm);
}

/// The graded tree is a tree, contains the splits `base` of T0, splits no deleted leaf, and is balanced.
pub fn graded(mesh: &Mesh, base: Option<&PerLevel>, comm: &dyn Comm) {
    let Mesh { split, crossing, sides, ownership, .. } = mesh;
    check_split(split);
    for sets in [crossing, &sides.deleted] {
        check_existing(split, sets, "has no split parent");
    }
    for (l, set) in split.iter().enumerate() {
        let mut cursor = set.cursor();
        for b in sides.deleted[l].bricks() {
            assert_eq!(b.bits & cursor.get(b.key), 0, "level {l}: deleted leaves must not split");
        }
        let mut cursor = set.cursor();
        for b in base.iter().flat_map(|base| base[l].bricks()) {
            let lost = b.bits & !cursor.get(b.key);
            assert_eq!(lost, 0, "level {l}: octants split in T0 must be split in the graded tree");
        }
    }
    replicas(&[split, crossing, &sides.inside, &sides.deleted], ownership, comm);
    is_complete(split, ownership, comm);
    is_balanced(split, &sides.deleted, ownership, comm);
}

/// Every rank that holds a brick has the same octants in it; no other rank has any.
fn replicas(sets: &[&PerLevel], ownership: &Ownership, comm: &dyn Comm) {
    let mut out = Vec::new();
    for (number, set) in sets.iter().enumerate() {
        for (l, b) in (0..).zip(*set).flat_map(|(l, set)| set.bricks().map(move |b| (l, b))) {
            let placement = ownership.placement(l, b.key);
            let is_held = !matches!(placement, Placement::Remote(_));
            assert!(is_held, "level {l}: a rank must hold the bricks that it has");
            if placement != Placement::Local {
                let id = (number as u64) << 5 | u64::from(l);
                out.push((ownership.owner(l, b.key), [id, b.key, b.bits]));
            }
        }
    }
    let received = comm.sparse_all_to_all(MessageBuffer::of_entries(out));
    let mut all: BTreeMap<[u64; 2], Vec<u64>> = BTreeMap::new();
    for &[id, key, bits] in received.words().as_chunks().0 {
        all.entry([id, key]).or_default().push(bits);
    }
    for ([id, key], bits) in all {
        let l = (id & 31) as Level;
        let equal = bits.len() == ownership.holders(l, key) && bits.iter().all(|b| *b == bits[0]);
        assert!(equal, "level {l}: replicas of a brick must be equal on all ranks that hold it");
    }
}

/// The leaves of all ranks tile the root: as no octant is split without its parent, their volumes must add up.
fn is_complete(split: &PerLevel, ownership: &Ownership, comm: &dyn Comm) {
    let mut volume = 0;
    for l in 0..=LEVEL_MAX {
        let mut cursor = split[l as usize].cursor();
        for b in Tree::exists(split, l) {
            let leaves = b.bits & !cursor.get(b.key);
            volume += if ownership.owns(l, b.key) { volume_of(l, leaves) } else { 0 };
        }
    }
    assert_eq!(comm.sum(volume), volume_of(0, 1), "leaves must tile the root");
}

/// The volume of some octants of a level, in octants of level 19.
fn volume_of(l: Level, octants: u64) -> u64 {
    u64::from(octants.count_ones()) << (3 * (LEVEL_MAX - l))
}

/// Kept leaves that touch differ by one level at most. A leaf of level l in a brick touches octants of level l - 2 that are the
/// brick itself or touch it: they must be split, or lie in a deleted leaf.
fn is_balanced(split: &PerLevel, deleted: &PerLevel, ownership: &Ownership, comm: &dyn Comm) {
    for l in 2..=LEVEL_MAX {
        let above = &split[l as usize - 2];
        let (mut splits, mut deletions) =
            (split[l as usize].cursor(), deleted[l as usize].cursor());
        let (mut near, mut touched) = (above.cursor(), Vec::new());
        for b in Tree::exists(split, l).filter(|b| ownership.owns(l, b.key)) {
            let leaves = b.bits & !splits.get(b.key) & !deletions.get(b.key);
            let near = near.get(b.key >> 6);
            // Most octants touched are split, and most are in the same brick as the one that touches them.
            let is_split = |code: u64| match code >> 6 == b.key >> 6 {
                true => near >> (code & 63) & 1 == 1,
                false => above.contains(code),
            };
            let unknown = octants_touched(l - 2, b.key, leaves).filter(|q| !is_split(*q));
            touched.extend(unknown.map(as_brick));
        }
        let ([touched], _) =
            ownership.redistribute(l - 2, [BrickSet::from_unsorted(touched)], comm);
        for code in touched.without(above).codes() {
            let is_deleted = |m: Level| deleted[m as usize].contains(code >> (3 * (l - 2 - m)));
            assert!(
                (0..=l - 2).any(is_deleted),
                "octant {} of level {} must be split: a leaf two levels deeper touches it",
                path(l - 2, code),
                l - 2
            );
        }
    }
}

/// The octants of level `l` that touch some octants two levels deeper, which lie in octant `code`, from outside of it.
fn octants_touched(l: Level, code: u64, inner: u64) -> impl Iterator<Item = u64> {
    let p = position(code).map(i64::from);
    let steps = if inner == 0 { 0..0 } else { 0..27 };
    steps.filter_map(move |k: i64| {
        let step = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
        let facing = (0..3).fold(inner, |bits, a| match step[a] {
            -1 => bits & brick::AXES[a][0],
            1 => bits & brick::AXES[a][3],
            _ => bits,
        });
        let q: [i64; 3] = std::array::from_fn(|a| p[a] + step[a]);
        let in_root = q.iter().all(|c| (0..1 << l).contains(c));
        (step != [0; 3] && facing != 0 && in_root).then(|| morton(q.map(|c| c as u32)))
    })
}

fn as_brick(code: u64) -> Brick {
    Brick { key: code >> 6, bits: 1 << (code & 63) }
}

/// The leaves of each rank are linear, and equal in number to the counts. With the deleted ones, those of all ranks tile the root.
pub fn leaves(mesh: &Mesh, counts: &Counts, written: &Written, comm: &dyn Comm) {
    let (mut end, mut number, mut volume) = (0, 0, 0);
    let Ok(_) = mesh.leaves().emit(|words| {
        end = is_linear(end, words);
        number += words.len() as u64;
        volume += words.iter().map(|w| volume_of(level_of(*w), 1)).sum::<u64>();
        Ok::<(), std::convert::Infallible>(())
    });
    assert_eq!((counts.total(), written.leaves), (number, number), "counts must add up");
    let mut add = |sets: &PerLevel| {
        for (l, b) in (0..).zip(sets).flat_map(|(l, set)| set.bricks().map(move |b| (l, b))) {
            volume += if mesh.ownership.owns(l, b.key) { volume_of(l, b.bits) } else { 0 };
        }
    };
    if !mesh.is_base {
        add(&mesh.sides.deleted);
        if !mesh.rules.keep_crossing {
            add(&mesh.crossing);
        }
    }
    assert_eq!(comm.sum(volume), volume_of(0, 1), "leaves and deleted leaves must tile the root");
}

/// Leaves are in order and do not overlap: each begins at the end of the one before it or after that. The first begins at `end` or
/// after it. Returns the end of the last.
fn is_linear(end: u64, words: &[u64]) -> u64 {
    words.iter().fold(end, |end, w| {
        assert!(w >> 7 >= end, "leaves must be in order and must not overlap");
        (w >> 7) + volume_of(level_of(*w), 1)
    })
}

fn level_of(word: u64) -> Level {
    (word >> 2 & 31) as Level
}

/// The numbers of leaves by level, by rank and of this rank add up.
pub fn totals(totals: &Totals, written: &Written, comm: &dyn Comm) {
    let by_rank: u64 = totals.parts.iter().map(|p| p[0]).sum();
    assert_eq!(totals.counts.total(), by_rank, "leaves by level and by rank must add up");
    assert_eq!(totals.parts[comm.rank()][0], written.leaves, "parts must be in the order of ranks");
}

#[cfg(test)]
mod tests;
