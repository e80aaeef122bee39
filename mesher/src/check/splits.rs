//! Splits by their definition: those of T0 octant by octant from the root, and those of gradation, where every octant is split that a rule
//! asks for, and no other.
//!
//! For T0, the test of facets against octants and the descent share no code with refinement, routing and extent boxes. For gradation, each
//! octant of a layer is reached by steps from one octant to the next, and messages go to owners alone: nothing is shared with tiles, whole
//! groups and redistribution.

use super::{beside, is_in_leaf, require, to_owners};
use crate::Mesh;
use crate::partition::ownership::Ownership;
use crate::sides::Base;
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::facet::Facet;
use bricks::octant::{Level, corner, edge, path, start57};
use bricks::tree::{PerLevel, Tree};
use ranks::Comm;
use std::ops::Range;

/// A rank has every facet whose extent reaches an octant that it owns, once, but those that miss the root.
pub fn routed(facets: &[Facet], all: &[Facet], ownership: &Ownership) {
    let octants = ownership.octants();
    let reaches = |f: &&Facet| {
        let extent: [_; 3] = std::array::from_fn(|a| bounds(f, a));
        let meets = |&(l, code): &(Level, u64)| {
            let (min, h) = (corner(l, code), edge(l));
            (0..3).all(|a| extent[a].start <= min[a] + h && extent[a].end >= min[a])
        };
        octants.iter().any(meets) && touches(f, [0; 3], edge(0))
    };
    let mut found: Vec<_> = facets.iter().map(|f| f.v).collect();
    let mut wanted: Vec<_> = all.iter().filter(reaches).map(|f| f.v).collect();
    found.sort_unstable();
    wanted.sort_unstable();
    assert!(found == wanted, "a rank must have the facets that reach its octants, each once");
}

/// The tree is T0 wherever this rank owns a part of it.
pub fn tree(base: &Base) {
    let own: Vec<Range<u64>> = base.ownership.intervals().collect();
    octant(base, &own, (0, 0), &(0..base.facets.len() as u32).collect::<Vec<u32>>());
}

/// Compares an octant of T0 and its descendants, given the facets that cross its parent and this rank's part of the curve.
fn octant(base: &Base, own: &[Range<u64>], (l, code): (Level, u64), near: &[u32]) {
    let (start, end) = (start57(l, code), start57(l, code + 1));
    if !own.iter().any(|own| own.start < end && start < own.end) {
        return;
    }
    let (min, h) = (corner(l, code), edge(l));
    let crosses = |i: &u32| touches(&base.facets[*i as usize], min, h);
    let facets: Vec<u32> = near.iter().copied().filter(crosses).collect();
    let is_boxed = base.rules.boxes.iter().any(|b| {
        b.level > l
            && (0..3).all(|a| b.min[a] < b.max[a] && b.min[a] < min[a] + h && b.max[a] > min[a])
    });
    let is_split = is_boxed || l < base.rules.level_surface && !facets.is_empty();
    let is_crossing = !is_split && !facets.is_empty();
    let of = |set: &[bricks::brickset::BrickSet]| set[l as usize].contains(code);
    assert_eq!(
        (of(&base.tree.split), of(&base.tree.crossing)),
        (is_split, is_crossing),
        "octant {} of level {l}: split and crossing by the definition",
        path(l, code)
    );
    if is_split {
        (0..8).for_each(|child| octant(base, own, (l + 1, code << 3 | child), &facets));
    }
}

fn bounds(f: &Facet, axis: usize) -> Range<i64> {
    let c = f.v.map(|v| i64::from(v[axis]));
    c[0].min(c[1]).min(c[2])..c[0].max(c[1]).max(c[2])
}

type Vector = [i64; 3];

fn dot(a: Vector, b: Vector) -> i128 {
    let product = |i: usize| i128::from(a[i]) * i128::from(b[i]);
    product(0) + product(1) + product(2)
}

fn cross(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

/// Whether the closed facet and the closed cube with minimum corner `min` and edge `h` share a point: no separating axis exists.
/// The terms are below 2^93, and those of an axis below 2^60.
fn touches(f: &Facet, min: [i64; 3], h: i64) -> bool {
    let apart = |a: usize| {
        let extent = bounds(f, a);
        extent.end < min[a] || extent.start > min[a] + h
    };
    if (0..3).any(apart) {
        return false;
    }
    let v = f.v.map(|p| [0, 1, 2].map(|a| i64::from(p[a]) - min[a]));
    let edges = [0, 1, 2].map(|i| [0, 1, 2].map(|a| v[(i + 1) % 3][a] - v[i][a]));
    let meet = |axis: Vector| {
        let at = v.map(|p| dot(axis, p));
        let sum = |sign: i64| axis.iter().map(|c| (sign * c).max(0)).sum::<i64>();
        let reach = |sign: i64| i128::from(sum(sign)) * i128::from(h);
        at.iter().any(|x| *x <= reach(1)) && at.iter().any(|x| *x >= -reach(-1))
    };
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    meet(cross(edges[0], edges[1]))
        && units.iter().all(|u| edges.iter().all(|e| meet(cross(*u, *e))))
}

/// The splits of the mesh follow from those of T0, `base`: layers of every level are thick enough, kept leaves that touch differ by one
/// level at most, and no octant is split without need. Collective.
pub fn gradation(mesh: &Mesh, base: &PerLevel, comm: &dyn Comm) {
    let Mesh { rules, split, crossing, sides, ownership, .. } = mesh;
    let owned = |l: Level, set: &BrickSet| -> BrickSet { ownership.owned(l, set).collect() };
    let gather = |l: Level, set: BrickSet| to_owners(set, l, ownership, comm);
    // The kept leaves among some octants of level l.
    let leaves = |l: Level, octants: BrickSet| {
        octants.without(&split[l as usize]).without(&sides.deleted()[l as usize])
    };
    let deepest = rules.level_deepest();
    let is_right = split[deepest as usize..].iter().all(BrickSet::is_empty);
    assert!(is_right, "no rule asks for level {deepest}");
    let mut touched = BrickSet::EMPTY;
    for l in (1..=deepest).rev() {
        let above = &split[l as usize - 1];
        // What is split before the layer of this level: these octants' children are its sources.
        let mut asked = owned(l, &split[l as usize]).coarsen();
        asked = asked.union(touched).union(owned(l - 1, &base[l as usize - 1]));
        if l == rules.level_surface && !rules.keep_crossing && rules.layer_cells_min < 3 {
            for m in (l..).take_while(|m| (*m as usize) < crossing.len()) {
                let near = dilated(owned(m, &crossing[m as usize]), m, 1);
                asked = asked.union((l..=m).fold(near, |set, _| set.coarsen()));
            }
        }
        let asked = gather(l - 1, asked);
        let mut before = above.cursor();
        let mut groups = asked.clone();
        groups.retain(|b| b.bits & before.get(b.key));
        let children = gather(l, BrickSet::from_unsorted(groups.child_bricks().collect()));
        let layer = dilated(leaves(l, children), l, rules.layer_cells_min - 1).coarsen();
        let asked = asked.union(gather(l - 1, layer));
        if let Some(code) = owned(l - 1, above).without(&asked).codes().next() {
            panic!("octant {} of level {} is split without need", path(l - 1, code), l - 1);
        }
        for code in asked.without(above).codes() {
            let is_deleted = is_in_leaf(sides.deleted(), l - 1, code);
            require(is_deleted, l - 1, code, "must be split for a layer or balance");
        }
        let all = owned(l, &BrickSet::from_unsorted(Tree::exists(split, l).collect()));
        touched = dilated(leaves(l, all), l, 1).coarsen().coarsen();
    }
}

/// The octants of level `l` within `radius` of some: one axis and one step after the other.
fn dilated(mut set: BrickSet, l: Level, radius: u32) -> BrickSet {
    for axis in 0..3 {
        for _ in 0..radius.min(1 << l) {
            let before = set.count();
            let steps = |b: Brick| beside(l, b, axis).chain([b]);
            let reached = set.bricks().flat_map(steps).filter(|b| b.bits != 0).collect();
            set = BrickSet::from_unsorted(reached);
            if set.count() == before {
                break;
            }
        }
    }
    set
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::facet::crossed;
    use proptest::prelude::*;

    proptest! {
        /// Two tests of facets against octants: on a coarse grid of vertices, where most facets touch octants exactly.
        #[test]
        fn both_tests_of_facets_against_octants_agree(
            v in prop::array::uniform3(prop::array::uniform3(-6i32..=14)),
            noise in prop::array::uniform3(prop::array::uniform3(-1i32..=1)),
        ) {
            let unit = 1 << 24;
            let at = |i: usize| std::array::from_fn(|a| v[i][a] * unit / 2 + noise[i][a]);
            let f = Facet { v: std::array::from_fn(at) };
            let mask = crossed(&f, [0; 3], 3);
            for code in 0..64 {
                prop_assert_eq!(mask >> code & 1 == 1, touches(&f, corner(3, code), edge(3)), "{}", code);
            }
        }
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let touched = |a: &[i128]| {
            let v = [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32));
            vec![touches(&Facet { v }, [9, 10, 11].map(|i| a[i] as i64), a[12] as i64).into()]
        };
        crate::values::compare("src/check/splits.rs", &[("touches", &touched)]);
    }
}
