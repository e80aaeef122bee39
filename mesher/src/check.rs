//! Checks of the invariants at the end of each phase, on all ranks.
//!
//! [`Job::check`](crate::Job::check) runs them in debug builds, and in release builds with `--check`. Invariants of sets and trees are checked next
//! to their definitions; those that need other ranks, or the sets of several modules, are here. What a phase computes is compared with
//! its definition, literally: the lattice, T0 and gradation ([`splits`]) and sides ([`sides`](mod@sides)). A check takes
//! memory proportional to the sets that it checks and to all facets. All functions are collective, and panic if an
//! invariant is violated. Messages of checks are not counted.

pub mod sides;
pub mod splits;

use crate::input::case::Case;
use crate::input::ingest::Slice;
use crate::input::lattice::Root;
use crate::input::quantise::Quantised;
use crate::mesh::Mesh;
use crate::output::stream::{Counts, total};
use crate::partition::ownership::{OWNERS_MANY, Ownership};
use crate::record::Options;
use crate::sides::{Base, Sides};
use bricks::brick::{self, Brick};
use bricks::brickset::BrickSet;
use bricks::octant::{LEVEL_MAX, Level, ROOT_EDGE, neighbour, path, start57};
use bricks::tree::{PerLevel, check_octants, check_split};
use ranks::{Comm, MessageBuffer, first_other, gather, uncounted};
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher, Hash};
use std::iter::once;

/// Splits from which on debug builds leave out the checks that take more memory than the mesh. `--check` always runs them.
const SPLITS_MANY: u64 = 1 << 16;

/// Whether the checks run that take more memory than the mesh. Collective.
pub fn is_whole(options: &Options, split: &PerLevel, comm: &dyn Comm) -> bool {
    let splits = || uncounted(comm, || comm.sum(split.iter().map(BrickSet::count).sum()));
    options.check || options.checks() && splits() < SPLITS_MANY
}

/// The slices of all ranks are contiguous and add up to the total.
pub fn slices(slice: &Slice, comm: &dyn Comm) {
    let mut end = 0;
    let mine = [slice.first, slice.facets.len() as u64, slice.total];
    for [first, count, total] in gather(comm, &[mine]) {
        assert_eq!((first, total), (end, slice.total), "slices of facets must be contiguous");
        end += count;
    }
    assert_eq!(end, slice.total, "slices of facets must add up to the total");
}

/// All ranks have the same map from octants to owners.
pub fn ownership(ownership: &Ownership, comm: &dyn Comm) {
    let intervals: Vec<_> = ownership.intervals().collect();
    let ends: u64 = comm.sum(intervals.iter().map(|i| i.end - i.start).sum());
    assert_eq!(ends, 1 << (3 * LEVEL_MAX), "the intervals of all ranks must tile the curve");
    for i in intervals {
        assert_eq!(ownership.owner_at(i.start), comm.rank(), "a rank must own its intervals");
    }
    same(&ownership.boundaries(), "partition boundaries", comm);
}

/// A value has the same hash on all ranks.
fn same(value: &impl Hash, name: &str, comm: &dyn Comm) {
    assert_eq!(first_other(comm, value), None, "{name} must be the same on all ranks");
}

/// All ranks have the same rules. These and the facets are those of the case, each coordinate on the nearest lattice point, of two the
/// even one.
pub fn lattice(given: &[geometries::Facet], case: &Case, quantised: &Quantised, comm: &dyn Comm) {
    let Quantised { rules, facets, .. } = quantised;
    // Formatted floating-point numbers round-trip.
    same(&format!("{rules:?}"), "rules", comm);
    let Root { origin, edge } = rules.root;
    let is_nearest = |x: f64, a: usize, q: f64| {
        let off = ((x - origin[a]) * (ROOT_EDGE as f64 / edge) - q).abs();
        off < 0.5 || off == 0.5 && q % 2.0 == 0.0
    };
    assert_eq!(given.len(), facets.len(), "each facet must be on the lattice");
    for (given, f) in given.iter().zip(facets) {
        let is_right = |(p, q): (&[f32; 3], &[i32; 3])| {
            (0..3).all(|a| is_nearest(f64::from(p[a]), a, f64::from(q[a])))
        };
        assert!(given.iter().zip(&f.v).all(is_right), "{given:?} must not be {f:?} on the lattice");
    }
    for (seed, given) in rules.seeds.iter().zip(&case.seeds) {
        let is_right = (0..3).all(|a| is_nearest(given[a], a, seed.lattice[a] as f64));
        // It is refused wherever it lies on the lattice, which may be as far away as integers go.
        let is_far = (0..3).any(|a| (given[a] - origin[a]).abs() > 2.0 * edge);
        let is_right = if is_far { !seed.is_in_root() } else { is_right };
        assert!(is_right, "seed {given:?} must not be at {:?}", seed.lattice);
    }
    let cells = |l: Level| edge / 2f64.powi(l as i32);
    let is_level =
        |l: Level, spacing: f64| cells(l) <= spacing && (l == 0 || cells(l - 1) > spacing);
    assert!(is_level(rules.level_surface, case.spacing_min), "level {}", rules.level_surface);
    for (on_lattice, given) in rules.boxes.iter().zip(&case.boxes) {
        let ends = [(on_lattice.min, given.min), (on_lattice.max, given.max)];
        let is_end = |q: i64, x: f64, a: usize| {
            is_nearest(x, a, q as f64)
                || q == 0 && x <= origin[a]
                || q == ROOT_EDGE && x >= origin[a] + edge
        };
        let is_right = ends.iter().all(|(q, x)| (0..3).all(|a| is_end(q[a], x[a], a)))
            && is_level(on_lattice.level, given.spacing);
        assert!(is_right, "{given:?} must not be {on_lattice:?} on the lattice");
    }
}

/// T0 is what the facets, here those of all ranks, and the boxes ask for; replicas agree.
pub fn base_tree(base: &Base) {
    base.tree.check_structure();
    replicas(&[&base.tree.split, &base.tree.crossing], base.ownership, base.comm);
    splits::tree(base);
}

/// Inside and deleted leaves are leaves of T0 that do not cross, as `keep` and seeds ask for them; results are the same on all ranks.
pub fn sides(sides: &Sides, base: &Base) {
    sides.check_invariants(base.tree);
    replicas(&[&sides.stored], base.ownership, base.comm);
    same(&format!("{:?}", (sides.rays, sides.summary)), "results of sides", base.comm);
    sides::seeds(sides, base);
}

/// The tree is linear, replicas agree, and no deleted leaf is split.
pub fn graded(mesh: &Mesh, comm: &dyn Comm) {
    let Mesh { split, crossing, sides, ownership, .. } = mesh;
    check_split(split);
    check_octants(split, crossing, &[], "is crossing, but has no split parent");
    check_octants(split, sides.deleted(), &[split], "is deleted, but no leaf");
    replicas(&[split, crossing, &sides.stored], ownership, comm);
}

/// A number that any change of the mesh changes, whatever the partition. Collective.
pub fn fingerprint(mesh: &Mesh, comm: &dyn Comm) -> u64 {
    let Mesh { split, crossing, sides, ownership, .. } = mesh;
    let hasher = BuildHasherDefault::<DefaultHasher>::new();
    let mut sum = 0u64;
    for (number, sets) in [split, crossing, &sides.stored].into_iter().enumerate() {
        for (l, b) in bricks_of(sets).filter(|(l, b)| ownership.owns(*l, b.key)) {
            sum = sum.wrapping_add(hasher.hash_one((number, l, b.key, b.bits)));
        }
    }
    comm.sum(sum)
}

/// The bricks of all levels, each with its level.
fn bricks_of(sets: &PerLevel) -> impl Iterator<Item = (Level, Brick)> {
    (0..).zip(sets).flat_map(|(l, set)| set.bricks().map(move |b| (l, b)))
}

/// Every rank that holds a brick has the same octants in it; no other rank has any. Owners and holders are found by the boundaries
/// alone.
fn replicas(sets: &[&PerLevel], ownership: &Ownership, comm: &dyn Comm) {
    let boundaries = ownership.boundaries();
    // The owner of a brick, and all ranks that hold it.
    let holders = |l: Level, key: u64| -> (usize, BTreeSet<usize>) {
        let up = 3 * (LEVEL_MAX + 2 - l);
        let (start, end) = if l < 2 { (0, u64::MAX) } else { (key << up, (key + 1) << up) };
        let first = boundaries.partition_point(|b| b.0 <= start) - 1;
        let within = boundaries[first..].iter().take_while(|b| b.0 < end);
        let owners: Vec<usize> = within.map(|b| b.1).collect();
        let is_full = ownership.is_everywhere(l) || owners.len() >= OWNERS_MANY;
        (owners[0], if is_full { (0..comm.size()).collect() } else { owners.into_iter().collect() })
    };
    let mut out = Vec::new();
    for (number, set) in sets.iter().enumerate() {
        for (l, b) in bricks_of(set) {
            let (owner, holders) = holders(l, b.key);
            let is_held = holders.contains(&comm.rank());
            assert!(is_held, "level {l}: a rank must hold the bricks that it has");
            let is_owned = owner == comm.rank();
            assert_eq!(ownership.owns(l, b.key), is_owned, "level {l}: the owner of a brick");
            if holders.len() > 1 {
                out.push((owner, [(number as u64) << 5 | u64::from(l), b.key, b.bits]));
            }
        }
    }
    let received = comm.sparse_all_to_all(MessageBuffer::of_entries(out));
    let mut all: BTreeMap<[u64; 2], Vec<u64>> = BTreeMap::new();
    for [id, key, bits] in received.values::<[u64; 3]>() {
        all.entry([id, key]).or_default().push(bits);
    }
    for ([id, key], bits) in all {
        let l = (id & 31) as Level;
        let equal = bits.len() == holders(l, key).1.len() && bits.iter().all(|b| *b == bits[0]);
        assert!(equal, "level {l}: replicas of a brick must be equal on all ranks that hold it");
    }
}

/// The octants of all ranks in the bricks that this rank owns. Collective.
fn to_owners(set: BrickSet, l: Level, ownership: &Ownership, comm: &dyn Comm) -> BrickSet {
    let entry = |b: Brick| (ownership.owner(l, b.key), [b.key, b.bits]);
    let entries = MessageBuffer::of_entries(set.bricks().map(entry).collect());
    BrickSet::from_unsorted(comm.sparse_all_to_all(entries).values())
}

/// The octants one step along an axis from those of a brick of level `l`. Some of the bricks may be empty.
fn beside(l: Level, b: Brick, axis: usize) -> impl Iterator<Item = Brick> {
    let step = move |up| {
        let within = brick::moved(b.bits, axis, up) & brick::valid(l);
        let next = if l < 2 { None } else { neighbour(l - 2, b.key, axis, up) };
        let across = if next.is_some() { brick::across(b.bits, axis, up) } else { 0 };
        [Brick { bits: within, ..b }, Brick { key: next.unwrap_or(b.key), bits: across }]
    };
    [false, true].into_iter().flat_map(step)
}

/// Panics with the place of an octant unless it is right.
#[track_caller]
fn require(is_right: bool, l: Level, code: u64, violation: &str) {
    assert!(is_right, "octant {} of level {l} {violation}", path(l, code));
}

/// Whether an octant is one of some leaves or lies in one.
fn is_in_leaf(leaves: &PerLevel, l: Level, code: u64) -> bool {
    (0..=l).any(|m| leaves[m as usize].contains(code >> (3 * (l - m))))
}

/// The leaves of each rank are linear, and equal in number to the counts. With the deleted ones, those of all ranks tile the root.
pub fn leaves(mesh: &Mesh, counts: &Counts, comm: &dyn Comm) {
    let (mut end, mut number, mut volume) = (0, 0, 0);
    let Ok(_) = mesh.emit(|words| {
        end = is_linear(end, words);
        number += words.len() as u64;
        volume += words.iter().map(|w| volume_of(*w)).sum::<u64>();
        Ok::<(), std::convert::Infallible>(())
    });
    assert_eq!(total(counts), number, "counts must add up");
    let dropped = mesh.drops_crossing().then_some(&mesh.crossing);
    // T0 has no deleted leaves.
    let left_out = once(mesh.sides.deleted()).chain(dropped).flat_map(bricks_of);
    let owned = left_out.filter(|(l, b)| mesh.ownership.owns(*l, b.key));
    volume += owned.map(|(l, b)| start57(l, b.bits.count_ones().into())).sum::<u64>();
    assert_eq!(comm.sum(volume), start57(0, 1), "leaves and deleted leaves must tile the root");
}

/// Leaves are in order and do not overlap: each begins at the end of the one before it or after that. The first begins at `end` or
/// after it. Returns the end of the last.
fn is_linear(end: u64, words: &[u64]) -> u64 {
    words.iter().fold(end, |end, w| {
        assert!(w >> 7 >= end, "leaves must be in order and must not overlap");
        (w >> 7) + volume_of(*w)
    })
}

/// The volume of a leaf, in octants of level 19.
fn volume_of(word: u64) -> u64 {
    start57((word >> 2 & 31) as Level, 1)
}

#[cfg(test)]
mod tests;
