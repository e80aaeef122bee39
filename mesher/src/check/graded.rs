//! Gradation by its definition: every octant is split that a rule asks for, and no other. Each octant of a layer is reached by steps
//! from one octant to the next, and messages go to owners alone: nothing is shared with tiles, whole groups and redistribution.

use super::{beside, is_in_leaf, require, to_owners};
use crate::mesh::Mesh;
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::octant::{Level, path};
use bricks::tree::{PerLevel, Tree};
use ranks::Comm;

/// The splits of the mesh follow from those of T0, `base`: layers of every level are thick enough, kept leaves that touch differ by one
/// level at most, and no octant is split without need. Collective.
pub fn gradation(mesh: &Mesh, base: &PerLevel, comm: &dyn Comm) {
    let Mesh { rules, split, crossing, sides, ownership, .. } = mesh;
    let owned = |l: Level, set: &BrickSet| -> BrickSet {
        set.bricks().filter(|b| ownership.owns(l, b.key)).collect()
    };
    let gather = |l: Level, set: BrickSet| to_owners(set, l, ownership, comm);
    // The kept leaves among some octants of level l.
    let leaves = |l: Level, octants: BrickSet| {
        octants.without(&split[l as usize]).without(&sides.deleted()[l as usize])
    };
    let deepest = rules.level_deepest();
    assert!(
        split[deepest as usize..].iter().all(BrickSet::is_empty),
        "no rule asks for level {deepest}"
    );
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
        touched =
            if l > 1 { dilated(leaves(l, all), l, 1).coarsen().coarsen() } else { BrickSet::EMPTY };
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
