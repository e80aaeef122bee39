//! Sides: a flood fill over faces finds the components, and rays decide the side of each.
use crate::lattice::{Facet, Input, location};
use crate::octant::{Extent, Octant, Side};
use crate::ray;
use crate::tree::{Index, Tree};

/// Maximum number of leaves of a component whose rays are cast.
const CANDIDATES_MAX: usize = 32;

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

/// Sets the side of every leaf that is not `Crossing` to the side of its component. Returns the
/// ambiguous components, `None` if there are none.
pub fn assign(tree: &mut Tree, input: &Input) -> Option<Ambiguous> {
    let mut ambiguous: Vec<Octant> = Vec::new();
    for mut component in components(tree) {
        component.sort_by_cached_key(|&leaf| coarsest_first(&tree.octant(leaf)));
        let candidates = component.iter().take(CANDIDATES_MAX).map(|&leaf| tree.octant(leaf));
        let verdict = vote(candidates, &input.facets);
        if !verdict.unanimous {
            ambiguous.push(tree.octant(component[0]));
        }
        for leaf in component {
            tree.set_side(leaf, verdict.side);
        }
    }
    let example = ambiguous.iter().min_by_key(|octant| coarsest_first(octant))?;
    let components = ambiguous.len() as u64;
    Some(Ambiguous { components, example: location(&input.root, example.centroid()) })
}

fn coarsest_first(octant: &Octant) -> (u32, u64) {
    (octant.level, octant.key())
}

/// The components: sets of leaves that no facet crosses, connected through shared parts of faces.
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
