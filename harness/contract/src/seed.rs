//! The leaf of T0 at a point, for seeds, which must not lie in crossing leaves (reference/DEFINITION.md, section 4).

use crate::lattice::FacetLattice;
use crate::manifest::ExtentBox;
use crate::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL};
use crate::triangle::Triangle;

/// What determines T0.
pub(crate) struct BaseTree<'a> {
    /// The body on the lattice.
    pub facets: &'a [FacetLattice],
    /// D: the level of crossing leaves.
    pub level: u8,
    /// The extent boxes.
    pub boxes: &'a [ExtentBox],
}

impl BaseTree<'_> {
    /// The leaf of T0 that contains a lattice point of the root's half-open cube, and the first facet that crosses it.
    ///
    /// If a rule of section 3 requires the split of an octant, it requires the split of its ancestors, so the leaf is
    /// the first octant on the way down that no rule splits.
    pub fn leaf_at(&self, point: [i64; 3]) -> (Octant, Option<usize>) {
        let cell = Octant { corner: point.map(|q| (q / UNITS_PER_CELL) as u32), level: LEVEL_MAX };
        let numbered = |(i, facet): (usize, &FacetLattice)| (i, Triangle::new(facet));
        let mut crossing: Vec<(usize, Triangle)> =
            self.facets.iter().enumerate().map(numbered).collect();
        let mut octant = Octant::ROOT;
        loop {
            let (low, high) = octant.bounds();
            crossing.retain(|(_, facet)| facet.meets(low, high));
            let by_surface = !crossing.is_empty() && octant.level < self.level;
            let by_box = || self.boxes.iter().any(|b| b.level > octant.level && b.meets(&octant));
            if !by_surface && !by_box() {
                return (octant, crossing.first().map(|(i, _)| *i));
            }
            octant = cell.ancestor(octant.level + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lattice units of a root of edge 8 per unit of length.
    const UNIT: f64 = 16_777_216.0;

    /// Whether a facet in the plane x = 0.5 crosses the leaf at a point, at a spacing of one or, in a box that is the
    /// root, of a quarter.
    fn is_crossing(at: [f64; 3], is_fine: bool) -> bool {
        let on_lattice = |p: [f64; 3]| p.map(|c| (c * UNIT) as i64);
        let facet = [[0.5, 1.0, 1.0], [0.5, 3.0, 1.0], [0.5, 1.0, 3.0]].map(on_lattice);
        let fine = ExtentBox { min: [0; 3], max: on_lattice([8.0; 3]), level: 5 };
        let boxes = if is_fine { vec![fine] } else { vec![] };
        let base = BaseTree { facets: &[facet], level: 3, boxes: &boxes };
        base.leaf_at(on_lattice(at)).1.is_some()
    }

    #[test]
    fn leaves_are_closed() {
        // The facet's corner at y = 1 crosses the leaves below it, too.
        for at in [[0.1, 1.5, 1.5], [0.9, 2.9, 1.1], [0.1, 0.1, 1.1]] {
            assert!(is_crossing(at, false), "{at:?}");
        }
        for at in [[1.0, 1.5, 1.5], [0.1, 4.5, 1.5], [7.9, 7.9, 7.9]] {
            assert!(!is_crossing(at, false), "{at:?}");
        }
    }

    #[test]
    fn a_box_makes_the_leaf_at_a_point_smaller() {
        assert!(!is_crossing([0.1, 1.5, 1.5], true));
        assert!(is_crossing([0.4, 1.5, 1.5], true));
    }

    #[test]
    fn a_leaf_has_the_level_of_the_surface_or_of_the_finest_box_that_it_meets() {
        let on_lattice = |p: [f64; 3]| p.map(|c| (c * UNIT) as i64);
        let facet = [[0.5, 1.0, 1.0], [0.5, 3.0, 1.0], [0.5, 1.0, 3.0]].map(on_lattice);
        let extent =
            |level| ExtentBox { min: on_lattice([6.0; 3]), max: on_lattice([7.0; 3]), level };
        let boxes = [extent(4), extent(2)];
        let base = BaseTree { facets: &[facet], level: 3, boxes: &boxes };
        let level = |at| base.leaf_at(on_lattice(at)).0.level;
        assert_eq!([level([0.4, 1.5, 1.5]), level([6.1; 3]), level([5.9; 3])], [3, 4, 2]);
        assert_eq!(base.leaf_at(on_lattice([6.1; 3])).0.corner, [12 << 15; 3]);
    }
}
