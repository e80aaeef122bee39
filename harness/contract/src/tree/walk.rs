//! Depth-first over all leaves, in Morton order.

use super::{Hood, Kind, Tree};

/// Visits every leaf with its hood, except below octants that `enter` declines.
pub fn walk(tree: &Tree, enter: &mut dyn FnMut(&Hood) -> bool, leaf: &mut dyn FnMut(&Hood, Kind)) {
    visit(tree, &Hood::root(tree), enter, leaf);
}

fn visit(
    tree: &Tree,
    hood: &Hood,
    enter: &mut dyn FnMut(&Hood) -> bool,
    leaf: &mut dyn FnMut(&Hood, Kind),
) {
    let at = hood.centre();
    if let Some(kind) = at.as_leaf() {
        leaf(hood, kind);
    } else if at.is_node() && enter(hood) {
        (0..8).for_each(|d| visit(tree, &hood.child(tree, d), enter, leaf));
    }
}
