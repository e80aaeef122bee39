//! Sides: a flood fill over faces finds the components, and either rays or seeds decide the side of
//! each.
use crate::case::Keep;
use crate::error::Error;
use crate::lattice::{Facet, Input, location};
use crate::octant::{Extent, Octant, Side};
use crate::tree::{Index, Tree};
use crate::{ray, seeds};

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
/// components.
///
/// # Errors
/// Those of [`seeds::leaves`].
pub fn assign(tree: &mut Tree, input: &Input) -> Result<Vec<Component>, Error> {
    let seeded = seeds::leaves(tree, input)?;
    let mut assigned = Vec::new();
    for mut leaves in components(tree) {
        leaves.sort_by_cached_key(|&leaf| tree.octant(leaf).coarsest_first());
        let verdict = if seeded.is_empty() {
            let candidates = leaves.iter().take(CANDIDATES_MAX).map(|&leaf| tree.octant(leaf));
            vote(candidates, &input.facets)
        } else {
            let is_flow = seeded.iter().any(|leaf| leaves.contains(leaf));
            Verdict { side: side_of_flow(is_flow, input.keep), unanimous: true }
        };
        for &leaf in &leaves {
            tree.set_side(leaf, verdict.side);
        }
        let Verdict { side, unanimous } = verdict;
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
    let leaves = tree.leaves();
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
            for neighbour in face_neighbours(tree, leaf) {
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

/// The leaves that share part of a face with `leaf`: those that meet the faces of its cube
/// thickened outwards by one lattice unit, which is less than the edge of any leaf.
fn face_neighbours(tree: &Tree, leaf: Index) -> Vec<Index> {
    let Extent { min, max } = tree.octant(leaf).extent();
    let mut neighbours = Vec::new();
    for axis in 0..3 {
        let mut below = Extent { min, max };
        (below.min[axis], below.max[axis]) = (min[axis] - 1, min[axis]);
        let mut above = Extent { min, max };
        (above.min[axis], above.max[axis]) = (max[axis], max[axis] + 1);
        neighbours.extend(tree.leaves_meeting(&below));
        neighbours.extend(tree.leaves_meeting(&above));
    }
    neighbours
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
            0 => {
                return Verdict { side: Side::Outside, unanimous: true };
            }
            6 => {
                return Verdict { side: Side::Inside, unanimous: true };
            }
            some => rays_odd += some,
        }
        rays += 6;
    }
    let side = if 2 * rays_odd > rays { Side::Inside } else { Side::Outside };
    Verdict { side, unanimous: false }
}
