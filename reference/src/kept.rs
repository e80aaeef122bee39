//! The kept region: the leaves that gradation refines.
use crate::case::{Enclosed, Keep};
use crate::lattice::Input;
use crate::octant::{Octant, ROOT_EDGE, Side};
use crate::sides::{Component, example};
use crate::tree::{Index, Tree};
use serde::Serialize;
use std::collections::HashSet;

/// The numbers of components of T0, as the manifest contains them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Components {
    /// Outside components, including the enclosed ones.
    pub outside: u64,
    /// Inside components.
    pub inside: u64,
    /// Outside components that were deleted because they do not reach the boundary of the root.
    pub enclosed: EnclosedComponents,
}

/// Summary of the enclosed components.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EnclosedComponents {
    /// Number of components.
    pub count: u64,
    /// Number of their leaves.
    pub leaves: u64,
    /// Centroid of their coarsest leaf, the first by key among leaves of the same level, in the
    /// user's unit; `None` without enclosed components.
    pub example: Option<[f64; 3]>,
}

impl Components {
    /// The numbers of these components.
    #[must_use]
    pub fn of(tree: &Tree, input: &Input, components: &[Component]) -> Self {
        let of_side = |side| components.iter().filter(|c| c.side == side).count() as u64;
        let enclosed = enclosed(tree, input, components);
        Self {
            outside: of_side(Side::Outside),
            inside: of_side(Side::Inside),
            enclosed: EnclosedComponents {
                count: enclosed.len() as u64,
                leaves: enclosed.iter().map(|component| component.leaves.len() as u64).sum(),
                example: example(tree, input, &enclosed),
            },
        }
    }
}

/// Deletes every leaf that is not in the kept region.
pub fn delete_the_rest(tree: &mut Tree, input: &Input, components: &[Component]) {
    let enclosed = enclosed(tree, input, components);
    let enclosed: HashSet<Index> = enclosed.iter().flat_map(|c| c.leaves.clone()).collect();
    tree.delete(|leaf, side| !input.keep.keeps(side) || enclosed.contains(&leaf));
}

/// The outside components that are deleted because they do not reach the boundary of the root. If no
/// outside component reaches it, there is no far field, and nothing is enclosed.
fn enclosed<'a>(tree: &Tree, input: &Input, components: &'a [Component]) -> Vec<&'a Component> {
    let applies =
        input.keep == Keep::Outside && input.seeds.is_empty() && input.enclosed == Enclosed::Delete;
    let outside = components.iter().filter(|component| component.side == Side::Outside);
    let (far_field, enclosed): (Vec<_>, Vec<_>) = outside.partition(|component| {
        component.leaves.iter().any(|&leaf| is_at_boundary(&tree.octant(leaf)))
    });
    if applies && !far_field.is_empty() { enclosed } else { Vec::new() }
}

/// Whether the octant has a face on the boundary of the root.
fn is_at_boundary(octant: &Octant) -> bool {
    let extent = octant.extent();
    extent.min.contains(&0) || extent.max.contains(&ROOT_EDGE)
}
