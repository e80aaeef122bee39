//! Whether the facets form a closed surface between two places, which then no path joins at any spacing.

use crate::edges::Edges;
use crate::shells::Shells;
use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use contract::parity::Parity;
use rustc_hash::FxHashMap;

/// Vertices that are nearer than this along each axis, in lattice units, may be taken for one: an eighth of the finest cell.
const WELD: i64 = 32;

/// Edge of the blocks in which vertices are searched for, in lattice units: a multiple of [`WELD`].
const BLOCK: i64 = 32 * WELD;

/// Whether a closed surface separates the centres of two free leaves at every spacing; `to` is `None` for the root's boundary.
///
/// A gap between vertices that is far narrower than the finest cell does not count. A path of free leaves leads through the
/// centres of leaves and of shared faces, so it stays half an edge of the finest cell, 128 units, away from all facets. Welding
/// moves no point of a facet by more than sqrt(3) times `WELD`, 56 units, so the path does not meet the welded surface either.
pub fn separates(facets: &[FacetLattice], from: [i64; 3], to: Option<[i64; 3]>) -> bool {
    is_separated(facets, from, to) || {
        let welded = welded(facets);
        welded != facets && is_separated(&welded, from, to)
    }
}

/// The facets with each vertex replaced by an earlier one that is near, without those that lose their area by that.
fn welded(facets: &[FacetLattice]) -> Vec<FacetLattice> {
    let mut kept: FxHashMap<[i64; 3], Vec<[i64; 3]>> = FxHashMap::default();
    let mut search = |vertex: [i64; 3]| {
        let is_near = |other: &[i64; 3]| (0..3).all(|a| (other[a] - vertex[a]).abs() <= WELD);
        // Of the blocks that a vertex near this one can be in, there is mostly one.
        let block = |offset: i64| vertex.map(|c| (c + offset).div_euclid(BLOCK));
        let (low, high) = (block(-WELD), block(WELD));
        let mut found = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let of_block = kept.get(&[x, y, z]).into_iter().flatten();
                    found = of_block.copied().filter(is_near).chain(found).min();
                }
            }
        }
        found.unwrap_or_else(|| {
            kept.entry(block(0)).or_default().push(vertex);
            vertex
        })
    };
    let mut known: FxHashMap<[i64; 3], [i64; 3]> = FxHashMap::default();
    let mut weld = |vertex: [i64; 3]| *known.entry(vertex).or_insert_with(|| search(vertex));
    let welded = facets.iter().map(|facet| facet.map(&mut weld));
    welded.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// Whether a closed surface separates two lattice points off the facets.
///
/// If every edge belongs to an even number of facets, all curves from a point to another one that avoid the facets'
/// edges cross the same number of facets modulo two. If that number is odd, no curve avoids the facets. This is tried with every
/// shell, because two shells around a point, as of a hollow body, have an even number. The result is exact, but false does not mean that a
/// path exists: an open sheet or several surfaces together can separate places too.
fn is_separated(facets: &[FacetLattice], from: [i64; 3], to: Option<[i64; 3]>) -> bool {
    let interior = 1..UNITS_PER_EDGE;
    let shells = Shells::new(&Edges::on_lattice(facets), facets);
    let mut closed = vec![Vec::new(); shells.all.len()];
    for (facet, corners) in facets.iter().enumerate() {
        let shell = shells.of(facet) as usize;
        if shells.all.get(shell).is_some_and(|shell| shell.is_closed) {
            closed[shell].push(*corners);
        }
    }
    closed.into_iter().filter(|facets| !facets.is_empty()).any(|facets| {
        // Without facets at the root's boundary, all of it is outside.
        if to.is_none() && !facets.iter().flatten().flatten().all(|c| interior.contains(c)) {
            return false;
        }
        let parity = Parity::new(&facets);
        let is_odd = |at| parity.inside(at)[0];
        is_odd(from) != to.is_some_and(is_odd)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;

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
        assert!(separates(&closed.facets_lattice, inside, None));
        assert!(
            separates(&closed.facets_lattice, inside, Some(outside))
                && separates(&closed.facets_lattice, outside, Some(inside))
        );
        assert!(!separates(&closed.facets_lattice, outside, None));
        assert!(!separates(&closed.facets_lattice, inside, Some([3 << 23; 3])));
        assert!(!separates(&tetrahedron(3).facets_lattice, inside, None));
    }

    #[test]
    fn a_crack_far_narrower_than_the_finest_cell_is_closed_at_every_spacing() {
        let (inside, far) = ([2 << 24; 3], None);
        for (gap, is_closed) in [(1, true), (WELD, true), (WELD + 1, false)] {
            let mut cracked = tetrahedron(4);
            cracked.facets_lattice[3][0][2] += gap;
            assert!(!is_separated(&cracked.facets_lattice, inside, far));
            assert_eq!(separates(&cracked.facets_lattice, inside, far), is_closed, "{gap}");
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
        assert!(separates(&hollow.facets_lattice, in_cavity, None));
        assert!(separates(&hollow.facets_lattice, in_cavity, Some([2 << 24; 3])));
        assert!(!separates(
            &hollow.facets_lattice,
            [2 << 24, 3 << 23, 2 << 24],
            Some([2 << 24; 3])
        ));
    }

    #[test]
    fn facets_at_the_boundary_of_the_root_prove_nothing_about_the_far_field() {
        let mut case = tetrahedron(4);
        for corner in case.facets_lattice.iter_mut().flatten() {
            corner[0] -= 1 << 24;
        }
        assert!(!separates(&case.facets_lattice, [1 << 23, 2 << 24, 2 << 24], None));
    }
}
