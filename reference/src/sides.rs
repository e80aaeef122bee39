//! Sides: a flood fill over faces finds the components, and either rays or seeds, points in the flow that the user gives, decide the side
//! of each. With them the kept region is known: the leaves that gradation refines.

use crate::case_file::{Enclosed, Keep};
use crate::error::Error;
use crate::lattice::{Facet, Input, Seed, location};
use crate::octant::{Extent, Octant, ROOT_EDGE, Side};
use crate::ray;
use crate::tree::{Index, Tree};
use serde::Serialize;
use std::collections::HashSet;

/// Maximum number of leaves of a component whose rays are cast.
const CANDIDATES_MAX: usize = 32;

/// A component of T0: leaves that no facet crosses, connected through shared parts of faces.
#[derive(Clone, Debug)]
pub struct Component {
    /// Its leaves, coarsest first, those of the same level by key.
    pub leaves: Vec<Index>,
    /// The side of all its leaves.
    pub side: Side,
    /// Whether a majority of rays decided, because no candidate's six rays agreed.
    pub is_ambiguous: bool,
}

/// Summary of the components that a majority of rays decided, because no candidate's six rays
/// agreed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambiguous {
    /// Number of such components.
    pub components: u64,
    /// Centroid of the coarsest leaf of these components, the first by key among leaves of the same
    /// level, in the user's unit.
    pub example: [f64; 3],
}

impl Ambiguous {
    /// The summary; `None` if no component is ambiguous.
    #[must_use]
    pub fn of(tree: &Tree, input: &Input, components: &[Component]) -> Option<Self> {
        let ambiguous: Vec<_> = components.iter().filter(|c| c.is_ambiguous).collect();
        let example = example(tree, input, &ambiguous)?;
        Some(Self { components: ambiguous.len() as u64, example })
    }
}

/// Sets the side of every leaf that is not `Crossing` to the side of its component, and returns the
/// components. Rays decide if `seeds` is empty.
///
/// # Errors
/// A seed lies outside the root or in a crossing leaf.
pub fn assign(tree: &mut Tree, input: &Input, seeds: &[Seed]) -> Result<Vec<Component>, Error> {
    let seeded = seeded_leaves(tree, input, seeds)?;
    let mut assigned = Vec::new();
    for mut leaves in components(tree) {
        leaves.sort_by_cached_key(|&leaf| tree.octant(leaf).coarsest_first());
        let Verdict { side, unanimous } = if seeded.is_empty() {
            let candidates = leaves.iter().take(CANDIDATES_MAX).map(|&leaf| tree.octant(leaf));
            vote(candidates, &input.facets)
        } else {
            let is_flow = seeded.iter().any(|leaf| leaves.contains(leaf));
            Verdict { side: side_of_flow(is_flow, input.keep), unanimous: true }
        };
        leaves.iter().for_each(|&leaf| tree.set_side(leaf, side));
        assigned.push(Component { leaves, side, is_ambiguous: !unanimous });
    }
    Ok(assigned)
}

/// The side of a component where seeds decide.
fn side_of_flow(is_flow: bool, keep: Keep) -> Side {
    match (keep, is_flow) {
        (Keep::Inside, true) | (Keep::Outside | Keep::All, false) => Side::Inside,
        (Keep::Inside, false) | (Keep::Outside | Keep::All, true) => Side::Outside,
    }
}

/// The centroid of the coarsest leaf of `components`, the first by key among leaves of the same
/// level, in the user's unit; `None` without components.
#[must_use]
pub fn example(tree: &Tree, input: &Input, components: &[&Component]) -> Option<[f64; 3]> {
    let first = components.iter().map(|component| tree.octant(component.leaves[0]));
    let octant = first.min_by_key(Octant::coarsest_first)?;
    Some(location(&input.root, octant.centroid()))
}

/// The components, each a set of leaves.
fn components(tree: &Tree) -> Vec<Vec<Index>> {
    let mut components = Vec::new();
    let leaves: Vec<Index> = tree.leaves().collect();
    let mut reached = vec![false; leaves.iter().max().map_or(0, |last| last + 1)];
    for start in leaves {
        if reached[start] || tree.side(start) == Side::Crossing {
            continue;
        }
        reached[start] = true;
        let mut component = vec![start];
        let mut visited = 0;
        while let Some(&leaf) = component.get(visited) {
            visited += 1;
            for neighbour in tree.face_neighbours(leaf) {
                if !reached[neighbour] && tree.side(neighbour) != Side::Crossing {
                    reached[neighbour] = true;
                    component.push(neighbour);
                }
            }
        }
        components.push(component);
    }
    components
}

struct Verdict {
    side: Side,
    /// Whether some candidate's six rays agreed.
    unanimous: bool,
}

/// The first candidate whose six rays agree decides. If there is none, the majority of all rays
/// decides, and a tie means outside.
fn vote(candidates: impl Iterator<Item = Octant>, facets: &[Facet]) -> Verdict {
    let (mut rays, mut rays_odd) = (0, 0);
    for candidate in candidates {
        let point = candidate.centroid();
        let odd = (0..3).flat_map(|axis| ray::parities(facets, point, axis)).filter(|&odd| odd);
        match odd.count() {
            0 => return Verdict { side: Side::Outside, unanimous: true },
            6 => return Verdict { side: Side::Inside, unanimous: true },
            some => rays_odd += some,
        }
        rays += 6;
    }
    let side = if 2 * rays_odd > rays { Side::Inside } else { Side::Outside };
    Verdict { side, unanimous: false }
}

/// The leaf that contains each seed, in the order of the seeds.
///
/// # Errors
/// A seed lies outside the root or in a crossing leaf.
fn seeded_leaves(tree: &Tree, input: &Input, seeds: &[Seed]) -> Result<Vec<Index>, Error> {
    let mut leaves = Vec::new();
    for (index, seed) in seeds.iter().enumerate() {
        match leaf_at(tree, seed.point) {
            Some(leaf) if tree.side(leaf) != Side::Crossing => leaves.push(leaf),
            crossing => {
                let (nearest, seed) = (nearest_centroid(tree, input, seed), seed.given);
                return Err(match crossing {
                    Some(_) => Error::SeedCrossing { index, seed, nearest },
                    None => Error::SeedOutside { index, seed, nearest },
                });
            }
        }
    }
    Ok(leaves)
}

/// The leaf whose half-open cube contains a lattice point; `None` outside the root. Corners are
/// integers, so the unit cube at the point lies in one leaf.
pub(crate) fn leaf_at(tree: &Tree, point: [i64; 3]) -> Option<Index> {
    let cube = Extent { min: point, max: point.map(|x| x + 1) };
    tree.leaves_meeting(cube).next()
}

/// The centroid, in the user's unit, of the leaf that no facet crosses and whose centroid is
/// nearest to the seed, clamped to the root. Of several, the coarsest leaf, then the first by key.
/// `None` if facets cross every leaf.
fn nearest_centroid(tree: &Tree, input: &Input, seed: &Seed) -> Option<[f64; 3]> {
    let point = seed.point.map(|x| x.clamp(0, ROOT_EDGE));
    let free = tree.leaves().filter(|&leaf| tree.side(leaf) != Side::Crossing);
    let nearest = free.map(|leaf| tree.octant(leaf)).min_by_key(|octant| {
        let centroid = octant.centroid();
        let square: i64 = (0..3).map(|a| (centroid[a] - point[a]).pow(2)).sum();
        (square, octant.coarsest_first())
    })?;
    Some(location(&input.root, nearest.centroid()))
}

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
