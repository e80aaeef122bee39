//! What the inputs in a manifest require of a mesh (reference/DEFINITION.md, sections 3 to 5).

use crate::lattice::FacetLattice;
use crate::manifest::{Enclosed, ExtentBox, Keep, Manifest, Tree};
use crate::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL};
use crate::tree::Kind;
use crate::triangle::Triangle;
use crate::word::Side;

impl Manifest {
    /// The inputs as far as they concern the leaves: T0 precedes deletion.
    pub fn of_leaves(&self) -> Self {
        let of_base = Self { keep: Keep::All, keep_crossing: true, ..self.clone() };
        if self.tree == Tree::Base { of_base } else { self.clone() }
    }

    /// Whether leaves of this kind belong in the final mesh.
    pub fn keeps(&self, kind: Kind) -> bool {
        match self.keep {
            _ if kind == Side::Crossing as Kind => self.keep_crossing,
            Keep::Outside => kind == Side::Outside as Kind,
            Keep::Inside => kind == Side::Inside as Kind,
            Keep::All => true,
        }
    }

    /// The side of components with a seed, if there are seeds. All other components have the other side.
    pub fn side_of_flow(&self) -> Side {
        if self.keep == Keep::Inside { Side::Inside } else { Side::Outside }
    }

    /// Whether outside components that the far field does not reach are deleted.
    pub fn deletes_enclosed(&self) -> bool {
        self.keep == Keep::Outside && self.seeds.is_empty() && self.enclosed == Enclosed::Delete
    }

    /// Whether two points in the user's units are the same: lattice coordinates are exact, but those in the user's
    /// units are rounded.
    pub fn same_place(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|axis| (a[axis] - b[axis]).abs() <= 1e-9 * self.root.edge)
    }

    /// Deepest level that the surface or a box requires.
    pub fn level_deepest(&self) -> u8 {
        let boxes = self.boxes.iter().filter(|b| b.is_in_root());
        boxes.map(|b| b.level).fold(self.level_surface, u8::max)
    }

    /// Whether a box requires leaves finer than the surface. Gradation may then refine crossing leaves.
    pub fn has_box_finer_than_surface(&self) -> bool {
        self.level_deepest() > self.level_surface
    }

    /// A box that requires the octant to be split.
    pub fn box_that_splits(&self, octant: &Octant) -> Option<&ExtentBox> {
        self.boxes.iter().find(|b| b.level > octant.level && b.meets(octant))
    }

    /// The leaf of T0 that contains a lattice point of the root's half-open cube, and the first facet that crosses it.
    ///
    /// If a rule of section 3 requires the split of an octant, it requires the split of its ancestors, so the leaf is
    /// the first octant on the way down that no rule splits.
    pub fn base_leaf_at(&self, at: [i64; 3], facets: &[FacetLattice]) -> (Octant, Option<usize>) {
        let cell = Octant { corner: at.map(|q| (q / UNITS_PER_CELL) as u32), level: LEVEL_MAX };
        let mut crossing: Vec<_> = facets.iter().map(Triangle::new).enumerate().collect();
        let mut octant = Octant::ROOT;
        loop {
            let (low, high) = octant.bounds();
            crossing.retain(|(_, facet)| facet.meets(low, high));
            let by_surface = !crossing.is_empty() && octant.level < self.level_surface;
            if !by_surface && self.box_that_splits(&octant).is_none() {
                return (octant, crossing.first().map(|(i, _)| *i));
            }
            octant = cell.ancestor(octant.level + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs() -> Manifest {
        let mut manifest = crate::testing::leaf_set(vec![]).manifest;
        (manifest.root.edge, manifest.level_surface) = (2.0, 3);
        manifest
    }

    #[test]
    fn sides_are_kept_as_the_case_requires() {
        let kinds = |keep, keep_crossing| {
            [0, 1, 2].map(|kind| Manifest { keep, keep_crossing, ..inputs() }.keeps(kind))
        };
        assert_eq!(kinds(Keep::Outside, true), [true, false, true]);
        assert_eq!(kinds(Keep::Outside, false), [true, false, false]);
        assert_eq!(kinds(Keep::Inside, false), [false, true, false]);
        assert_eq!(kinds(Keep::All, false), [true, true, false]);
        assert_eq!(kinds(Keep::All, true), [true, true, true]);
        let flow = |keep| Manifest { keep, ..inputs() }.side_of_flow();
        assert_eq!(
            [Keep::Outside, Keep::Inside, Keep::All].map(flow),
            [Side::Outside, Side::Inside, Side::Outside]
        );
        let deletes = Manifest { keep: Keep::Outside, ..inputs() };
        assert!(deletes.deletes_enclosed() && !inputs().deletes_enclosed());
        assert!(!Manifest { seeds: vec![[0; 3]], ..deletes.clone() }.deletes_enclosed());
        assert!(!Manifest { enclosed: Enclosed::Keep, ..deletes }.deletes_enclosed());
    }

    #[test]
    fn a_box_splits_octants_that_it_meets_and_that_are_coarser() {
        let extent = |level| ExtentBox { min: [0; 3], max: [1 << 20; 3], level };
        let with = |level| Manifest { boxes: vec![extent(1), extent(level)], ..inputs() };
        let near = Octant::ROOT.child(0).child(0);
        assert_eq!(with(3).box_that_splits(&near), Some(&extent(3)));
        assert_eq!(with(2).box_that_splits(&near), None);
        assert_eq!(with(3).box_that_splits(&Octant::ROOT.child(0).child(1)), None);
        assert!(with(4).has_box_finer_than_surface() && !with(3).has_box_finer_than_surface());
        // One beyond the root, on the lattice.
        let beyond = ExtentBox { min: [1 << 27, 0, 0], max: [1 << 27; 3], level: 9 };
        assert_eq!(Manifest { boxes: vec![beyond], ..inputs() }.level_deepest(), 3);
    }

    #[test]
    fn places_are_the_same_up_to_rounding() {
        let same = |by: f64| {
            (0..3)
                .map(|axis| {
                    let mut moved = [1.0; 3];
                    moved[axis] += by;
                    inputs().same_place([1.0; 3], moved)
                })
                .collect::<Vec<_>>()
        };
        assert_eq!([same(1e-9), same(-1e-9)], [[true; 3], [true; 3]]);
        assert_eq!([same(3e-9), same(-3e-9)], [[false; 3], [false; 3]]);
    }
}
