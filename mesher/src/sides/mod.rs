//! Sides: which leaves of the base tree are inside (the paper's section II.B: flood fill and rays).
//!
//! Non-crossing leaves that share part of a face belong to one component; a component has one side.
//! Inside a brick, components are floods by shifts; across bricks they are joined in a union-find
//! while walking the tree ([`components`]); across ranks by what neighbours tell each other of
//! their common faces ([`global`]); so components are those of the whole tree. Each is put to the ray
//! vote ([`rays`], [`vote`]).

pub mod components;
pub mod global;
pub mod nodes;
pub mod rays;
pub mod vote;

use crate::brick::Brick;
use crate::comm::Comm;
use crate::facet::Facet;
use crate::lattice::Keep;
use crate::octant::Level;
use crate::partition::ownership::Ownership;
use crate::tree::{LEVELS, PerLevel, Tree, per_level};

/// Sides of the base tree's leaves.
#[derive(Clone, Debug)]
pub struct Sides {
    /// Non-crossing leaves that are inside.
    pub inside: PerLevel,
    /// Non-crossing leaves that are not kept; filled for the `keep` asked for.
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
    /// How many.
    pub count: u64,
    /// Centroid of the first candidate of one of them (the first by level and Morton code), in lattice units.
    pub example: [i64; 3],
}

/// Decides all sides. `facets` are this rank's share of the geometry, each facet on one rank.
/// Collective.
pub fn decide(
    tree: &Tree,
    ownership: &Ownership,
    facets: &[Facet],
    keep: Keep,
    comm: &dyn Comm,
) -> Sides {
    let mut nodes = nodes::Nodes::new(tree, ownership);
    let mut local = components::join(&nodes, ownership);
    let faces = std::mem::take(&mut local.faces);
    let classes = local.classes();
    let names = global::names(&nodes, tree, ownership, faces, &classes, comm);
    let candidates = vote::candidates(&nodes, tree, &classes.of, &names, ownership);
    // Of the largest thing in memory, the components are left.
    nodes.forget_links();

    let verdict = vote::decide(&candidates, facets, comm);
    let inside: Vec<bool> = names.iter().map(|n| verdict.inside.contains(n)).collect();
    let mut is_inside = Vec::with_capacity(classes.of.len());
    is_inside.extend(classes.of.iter().map(|&c| inside[c as usize]));
    drop(classes);
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
