//! Gradation: for each level from the finest to the coarsest, a layer around every cell, then
//! balance.
use crate::lattice::Input;
use crate::octant::{LEVEL_MAX, Octant, Side};
use crate::tree::Tree;

/// Refines the kept leaves of `tree` until layers are at least `layer_cells_min` cells thick and
/// the levels of touching leaves differ by at most one.
pub fn grade(tree: &mut Tree, input: &Input) {
    if !input.keep_crossing && input.layer_cells_min < 3 {
        extra_layer(tree, input.level_surface);
    }
    let deepest = tree.kept_leaves(LEVEL_MAX).map(|(leaf, _)| leaf.level).max().unwrap_or(0);
    for level in (1..=deepest).rev() {
        layer(tree, level, input.layer_cells_min);
        balance(tree, level);
    }
}

/// Refines every kept leaf that touches a crossing leaf to the level of the surface. The crossing
/// leaves will be deleted and no longer contribute to the thickness of the layer.
fn extra_layer(tree: &mut Tree, level_surface: u32) {
    let leaves = tree.kept_leaves(LEVEL_MAX);
    let leaves: Vec<_> = leaves.filter(|&(_, side)| side == Side::Crossing).collect();
    for (leaf, _) in leaves {
        tree.refine(&leaf.extent().enlarged(1), level_surface);
    }
}

/// Refines everything kept within `layer_cells_min` - 1 cells of a leaf of this level to this
/// level.
fn layer(tree: &mut Tree, level: u32, layer_cells_min: u32) {
    for source in leaves_of_level(tree, level) {
        // Fewer than 2^32 cells of at most 2^27 units each fit i64.
        let margin = i64::from(layer_cells_min - 1) * source.edge();
        tree.refine(&source.extent().enlarged(margin), level);
    }
}

/// Refines every kept leaf that touches a leaf of this level until it is at most one level coarser.
fn balance(tree: &mut Tree, level: u32) {
    for source in leaves_of_level(tree, level) {
        tree.refine(&source.extent().enlarged(1), level - 1);
    }
}

/// The kept leaves of a level at this moment. The caller refines while it iterates over them, and
/// leaves made by that refinement must not become sources.
fn leaves_of_level(tree: &Tree, level: u32) -> Vec<Octant> {
    tree.kept_leaves(level).map(|(leaf, _)| leaf).filter(|leaf| leaf.level == level).collect()
}
