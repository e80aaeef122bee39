//! Sides: which leaves of the base tree are inside the geometry (the paper's section II.B: flood fill
//! and rays).
//!
//! Non-crossing leaves that share part of a face belong to one component, and a component has one side.
//! Within a brick, local components are flood fills by shifts. Across bricks a union-find merges them
//! in a walk of the tree ([`components`]). Across ranks they receive common labels, by messages about
//! the faces between ranks ([`global`]). Each component is then put to a vote of rays ([`rays`],
//! [`vote`]).
//!
//! Invariants of [`Sides`]:
//! - `inside` and `deleted` hold non-crossing leaves of the base tree;
//! - `deleted` is empty if everything is kept, and `inside` is empty otherwise: only the set that the
//!   following phases need is stored;
//! - leaves that share part of a face are on the same side.

pub mod components;
pub mod global;
pub mod nodes;
pub mod rays;
pub mod vote;

use crate::brick::{self, Brick};
use crate::comm::Comm;
use crate::facet::Facet;
use crate::lattice::Keep;
use crate::octant::Level;
use crate::partition::ownership::Ownership;
use crate::tree::{LEVELS, PerLevel, Tree, assert_none, per_level};

/// Sides of the base tree's leaves.
#[derive(Clone, Debug)]
pub struct Sides {
    /// Non-crossing leaves that are inside, if everything is kept.
    pub inside: PerLevel,
    /// Non-crossing leaves that are not kept.
    pub deleted: PerLevel,
    /// Number of components, over all ranks.
    pub components: u64,
    /// Components that were decided by majority.
    pub ambiguous: Option<Ambiguous>,
    /// Rays cast, over all ranks.
    pub rays: u64,
}

/// Components whose rays did not agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ambiguous {
    /// Number of such components.
    pub count: u64,
    /// Centroid, in lattice units, of the first candidate leaf of all of them, by level and Morton code.
    pub example: [i64; 3],
}

/// Decides the sides of all leaves. `facets` are this rank's slice of the geometry: each facet is on exactly
/// one rank. Collective.
pub fn decide(
    tree: &Tree,
    ownership: &Ownership,
    facets: &[Facet],
    keep: Keep,
    comm: &dyn Comm,
) -> Sides {
    let mut nodes = nodes::Nodes::new(tree, ownership);
    if cfg!(debug_assertions) {
        nodes.check_invariants();
    }
    let mut local = components::merge(&nodes, ownership);
    let faces = std::mem::take(&mut local.faces);
    let merged = local.numbered();
    let labels = global::labels(&nodes, tree, ownership, faces, &merged, comm);
    let candidates = vote::candidates(&nodes, tree, &merged.of, &labels, ownership);
    nodes.drop_links();

    let verdict = vote::decide(&candidates, facets, comm);
    let inside: Vec<bool> = labels.iter().map(|n| verdict.inside.contains(n)).collect();
    let mut is_inside = Vec::with_capacity(merged.of.len());
    is_inside.extend(merged.of.iter().map(|&c| inside[c as usize]));
    drop(merged);
    let mut sides = Sides {
        inside: per_level(),
        deleted: per_level(),
        components: verdict.components,
        ambiguous: verdict.ambiguous,
        rays: verdict.rays,
    };
    for l in 0..LEVELS as Level {
        for (n, Brick { key, .. }) in (0..).zip(Tree::exists(&tree.split, l)) {
            let (mut open, mut within) = (0, 0);
            for (c, part) in nodes.components(l, n) {
                open |= part;
                within |= if is_inside[c as usize] { part } else { 0 };
            }
            let (found, deleted) = match keep {
                Keep::All => (within, 0),
                Keep::Outside => (0, within),
                Keep::Inside => (0, open & !within),
            };
            sides.inside[l as usize].push(key, found);
            sides.deleted[l as usize].push(key, deleted);
        }
    }
    sides
}

impl Sides {
    /// Checks the invariants on the bricks that this rank holds; one side per component as far as a
    /// component lies within a brick.
    ///
    /// # Panics
    /// If an invariant is violated; the message names it, the level and an octant.
    pub fn check_invariants(&self, tree: &Tree, keep: Keep, ownership: &Ownership) {
        let (stored, empty) = match keep {
            Keep::All => (&self.inside, &self.deleted),
            Keep::Outside | Keep::Inside => (&self.deleted, &self.inside),
        };
        tree.check_open_leaves(stored, "has a side, but is no leaf off the surface");
        for l in 0..LEVELS as Level {
            for b in empty[l as usize].bricks() {
                assert_none(
                    l,
                    b.key,
                    b.bits,
                    "is in the set that this choice of sides leaves empty",
                );
            }
            let mut stored = stored[l as usize].cursor();
            for b in nodes::open_bricks(tree, ownership, l) {
                let side = stored.get(b.key);
                let wrong = brick::spread_faces(side) & b.open & !side;
                assert_none(l, b.key, wrong, "is on another side than a leaf across a face");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brickset::tests::set;
    use crate::comm::Solo;
    use crate::tree::tests::small;

    /// Sides of a tree without facets: all leaves that do not cross are outside.
    fn decided(keep: Keep) -> (Tree, Sides) {
        let tree = small();
        let sides = decide(&tree, &Ownership::solo(), &[], keep, &Solo);
        sides.check_invariants(&tree, keep, &Ownership::solo());
        (tree, sides)
    }

    #[test]
    #[should_panic(expected = "octant 0.0.0 of level 3 has a side, but is no leaf off the surface")]
    fn a_side_of_a_crossing_leaf_is_found() {
        let (tree, mut sides) = decided(Keep::Outside);
        sides.deleted[3] = set(&[0]);
        sides.check_invariants(&tree, Keep::Outside, &Ownership::solo());
    }

    #[test]
    #[should_panic(expected = "octant 2 of level 1 is in the set that this choice of sides leaves")]
    fn an_inside_leaf_of_a_mesh_that_keeps_the_outside_is_found() {
        let (tree, mut sides) = decided(Keep::Outside);
        sides.inside[1] = set(&[2]);
        sides.check_invariants(&tree, Keep::Outside, &Ownership::solo());
    }

    #[test]
    #[should_panic(expected = "octant 3 of level 1 is on another side than a leaf across a face")]
    fn a_component_with_two_sides_is_found() {
        let (tree, mut sides) = decided(Keep::All);
        sides.inside[1] = set(&[1]);
        sides.check_invariants(&tree, Keep::All, &Ownership::solo());
    }
}
