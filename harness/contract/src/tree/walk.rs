//! Depth-first traversal of all leaves, in Morton order.

use super::{Kind, Neighbourhood, Tree};

/// Visits every leaf with its neighbourhood.
pub fn walk(tree: &Tree, leaf: &mut dyn FnMut(&Neighbourhood, Kind)) {
    visit(tree, &Neighbourhood::root(tree), leaf);
}

fn visit(tree: &Tree, neighbourhood: &Neighbourhood, leaf: &mut dyn FnMut(&Neighbourhood, Kind)) {
    let handle = neighbourhood.centre();
    if let Some(kind) = handle.as_leaf() {
        leaf(neighbourhood, kind);
    } else if handle.is_node() {
        (0..8).for_each(|d| visit(tree, &neighbourhood.child(tree, d), leaf));
    }
}
