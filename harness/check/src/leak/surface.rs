//! Whether the facets form a closed surface between two places, which then no path joins at any spacing.

use crate::geometry::shells::{find, unite};
use crate::oracle::watertight::is_watertight;
use contract::case::Case;
use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use contract::parity::Parity;
use std::collections::{BTreeMap, HashMap};

/// Vertices that are nearer than this along each axis, in lattice units, may be taken for one: an eighth of the finest cell.
const WELD: i64 = 32;

/// Whether a closed surface separates the centres of two free leaves at every spacing; `to` is `None` for the root's boundary.
///
/// A gap between vertices that is far narrower than the finest cell does not count. A path of free leaves leads through the
/// centres of leaves and of shared faces, so it stays half an edge of the finest cell, 128 units, away from all facets. Welding
/// moves no point of a facet by more than sqrt(3) times `WELD`, 56 units, so the path does not meet the welded surface either.
pub fn separates(case: &Case, from: [i64; 3], to: Option<[i64; 3]>) -> bool {
    is_separated(&case.facets_lattice, from, to)
        || is_separated(&welded(&case.facets_lattice), from, to)
}

/// The facets with each vertex replaced by an earlier one that is near, without those that lose their area by that.
fn welded(facets: &[FacetLattice]) -> Vec<FacetLattice> {
    let mut kept: HashMap<[i64; 3], Vec<[i64; 3]>> = HashMap::new();
    let mut weld = |vertex: [i64; 3]| {
        let block = vertex.map(|c| c.div_euclid(WELD));
        let is_near = |other: &[i64; 3]| (0..3).all(|a| (other[a] - vertex[a]).abs() <= WELD);
        let around = (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let near = around.filter_map(|offset| {
            let of_block = kept.get(&std::array::from_fn(|a| block[a] + offset[a]))?;
            of_block.iter().copied().find(is_near)
        });
        let found = near.min();
        found.unwrap_or_else(|| {
            kept.entry(block).or_default().push(vertex);
            vertex
        })
    };
    let welded = facets.iter().map(|facet| facet.map(&mut weld));
    welded.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// Whether a closed surface separates two lattice points off the facets.
///
/// If every edge belongs to an even number of facets, all curves from a point to another one that avoid the facets'
/// edges cross the same number of facets modulo two. If that number is odd, no curve avoids the facets. This is tried with every
/// shell, the facets that shared edges connect, because two shells around a point, as of a hollow body, have an even number. The result is
/// exact, but false does not mean that a path exists: an open sheet or several surfaces together can separate places too.
fn is_separated(facets: &[FacetLattice], from: [i64; 3], to: Option<[i64; 3]>) -> bool {
    let interior = 1..UNITS_PER_EDGE;
    shells(facets).into_iter().any(|facets| {
        let is_interior = || facets.iter().flatten().flatten().all(|c| interior.contains(c));
        // Without facets at the root's boundary, all of it is outside.
        if (to.is_none() && !is_interior()) || !is_watertight(&facets) {
            return false;
        }
        let parity = Parity::new(&facets);
        let is_odd = |at| parity.inside(at)[0];
        is_odd(from) != to.is_some_and(is_odd)
    })
}

/// The facets by the shells that shared edges make of them.
fn shells(facets: &[FacetLattice]) -> Vec<Vec<FacetLattice>> {
    let mut parents: Vec<u32> = (0..facets.len() as u32).collect();
    let mut first_at: HashMap<[[i64; 3]; 2], u32> = HashMap::new();
    for (facet, &[a, b, c]) in (0u32..).zip(facets) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let first = *first_at.entry([from.min(to), from.max(to)]).or_insert(facet);
            unite(&mut parents, first, facet);
        }
    }
    let mut shells: BTreeMap<u32, Vec<FacetLattice>> = BTreeMap::new();
    for (facet, corners) in (0u32..).zip(facets) {
        shells.entry(find(&mut parents, facet)).or_default().push(*corners);
    }
    shells.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron in a root of edge 8, without the facets from number `count`.
    fn tetrahedron(count: usize) -> Case {
        let [a, b, c, d] = [[1.0f32; 3], [7.0, 1.0, 1.0], [1.0, 7.0, 1.0], [1.0, 1.0, 7.0]];
        let facets = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
        let text = "spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
        Case::from_parts(text, facets[..count].to_vec()).unwrap()
    }

    #[test]
    fn a_closed_surface_separates_inside_from_outside_and_nothing_else() {
        let closed = tetrahedron(4);
        let (inside, outside) = ([2 << 24; 3], [6 << 24; 3]);
        assert!(separates(&closed, inside, None));
        assert!(
            separates(&closed, inside, Some(outside)) && separates(&closed, outside, Some(inside))
        );
        assert!(!separates(&closed, outside, None));
        assert!(!separates(&closed, inside, Some([3 << 23; 3])));
        assert!(!separates(&tetrahedron(3), inside, None));
    }

    #[test]
    fn a_crack_far_narrower_than_the_finest_cell_is_closed_at_every_spacing() {
        let (inside, far) = ([2 << 24; 3], None);
        for (gap, is_closed) in [(1, true), (WELD, true), (WELD + 1, false)] {
            let mut cracked = tetrahedron(4);
            cracked.facets_lattice[3][0][2] += gap;
            assert!(!is_separated(&cracked.facets_lattice, inside, far));
            assert_eq!(separates(&cracked, inside, far), is_closed, "{gap}");
        }
    }

    #[test]
    fn welding_moves_a_vertex_to_an_earlier_one_and_drops_facets_that_lose_their_area() {
        let [a, b, c, d] = [[0; 3], [1000, 0, 0], [0, 1000, 0], [0, 0, 1000]];
        let near = |[x, y, z]: [i64; 3]| [x + WELD, y - WELD, z];
        assert_eq!(welded(&[[a, b, c], [near(b), d, near(a)]]), [[a, b, c], [b, d, a]]);
        for thin in [[a, near(a), d], [d, a, near(a)], [near(a), d, a], [a, near(a), near(a)]] {
            assert_eq!(welded(&[[a, b, c], thin]), [[a, b, c]]);
        }
        for axis in 0..3 {
            for by in [-WELD, -1, 1, WELD] {
                let mut near = b;
                near[axis] += by;
                assert_eq!(welded(&[[a, b, c], [near, d, a]]), [[a, b, c], [b, d, a]]);
            }
            for by in [-WELD - 1, WELD + 1] {
                let mut apart = b;
                apart[axis] += by;
                assert_eq!(welded(&[[a, b, c], [apart, d, a]]), [[a, b, c], [apart, d, a]]);
            }
        }
    }

    #[test]
    fn each_of_two_shells_separates_a_cavity_from_the_outside() {
        let mut hollow = tetrahedron(4);
        let cavity = hollow.facets_lattice.clone();
        let shrunk = |corner: [i64; 3]| corner.map(|c| (3 << 23) + c / 16);
        hollow.facets_lattice.extend(cavity.iter().map(|facet| facet.map(shrunk)));
        let inner = cavity[0].map(shrunk);
        let in_cavity = std::array::from_fn(|a| inner[0][a] + (1 << 18));
        assert!(separates(&hollow, in_cavity, None));
        assert!(separates(&hollow, in_cavity, Some([2 << 24; 3])));
        assert!(!separates(&hollow, [2 << 24, 3 << 23, 2 << 24], Some([2 << 24; 3])));
    }

    #[test]
    fn facets_at_the_boundary_of_the_root_prove_nothing_about_the_far_field() {
        let mut case = tetrahedron(4);
        for corner in case.facets_lattice.iter_mut().flatten() {
            corner[0] -= 1 << 24;
        }
        assert!(!separates(&case, [1 << 23, 2 << 24, 2 << 24], None));
    }
}
