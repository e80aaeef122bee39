//! The properties that a mesh must have, as numbers.

use contract::case::Case;
use contract::lattice::Root;
use contract::manifest::{Enclosed, ExtentBox, Keep, Manifest, Sides};
use contract::octant::Octant;
use contract::tree::Kind;
use contract::word::Side;

/// The required properties of a mesh, from its case or, in an audit, from its manifest.
#[derive(Clone, Debug, PartialEq)]
pub struct Terms {
    /// The root cube, for coordinates in findings.
    pub root: Root,
    /// D: the level of crossing leaves.
    pub level_surface: u8,
    /// n: minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// The side that is kept.
    pub keep: Keep,
    /// Whether crossing leaves are kept.
    pub keep_crossing: bool,
    /// Extent boxes on the lattice.
    pub boxes: Vec<ExtentBox>,
    /// Seeds on the lattice.
    pub seeds: Vec<[i64; 3]>,
    /// The treatment of enclosed components.
    pub enclosed: Enclosed,
    /// Whether the sides in the leaf words have a meaning.
    pub sides: Sides,
}

impl Terms {
    /// The requirements of a case.
    pub fn of_case(case: &Case) -> Self {
        Self {
            root: case.root,
            level_surface: case.level_surface,
            layer_cells_min: case.layer_cells_min,
            keep: case.keep,
            keep_crossing: case.keep_crossing,
            boxes: case.boxes.clone(),
            seeds: case.seeds_lattice.clone(),
            enclosed: case.enclosed,
            sides: Sides::Known,
        }
    }

    /// The requirements that a manifest states.
    pub fn of_manifest(manifest: &Manifest) -> Self {
        Self {
            root: manifest.root,
            level_surface: manifest.level_surface,
            layer_cells_min: manifest.layer_cells_min,
            keep: manifest.keep,
            keep_crossing: manifest.keep_crossing,
            boxes: manifest.boxes.clone(),
            seeds: manifest.seeds.clone(),
            enclosed: manifest.enclosed,
            sides: manifest.sides,
        }
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

    /// Whether a box requires leaves finer than the surface. Gradation may then refine crossing leaves.
    pub fn has_box_finer_than_surface(&self) -> bool {
        self.boxes.iter().any(|b| b.level > self.level_surface)
    }

    /// A box that requires the octant to be split.
    pub fn box_that_splits(&self, octant: &Octant) -> Option<&ExtentBox> {
        self.boxes.iter().find(|b| b.level > octant.level && b.meets(octant))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terms() -> Terms {
        let mut manifest = contract::testing::leaf_set(vec![]).manifest;
        (manifest.root.edge, manifest.level_surface) = (2.0, 3);
        Terms::of_manifest(&manifest)
    }

    #[test]
    fn sides_are_kept_as_the_case_requires() {
        let kinds = |keep, keep_crossing| {
            [0, 1, 2].map(|kind| Terms { keep, keep_crossing, ..terms() }.keeps(kind))
        };
        assert_eq!(kinds(Keep::Outside, true), [true, false, true]);
        assert_eq!(kinds(Keep::Outside, false), [true, false, false]);
        assert_eq!(kinds(Keep::Inside, false), [false, true, false]);
        assert_eq!(kinds(Keep::All, false), [true, true, false]);
        assert_eq!(kinds(Keep::All, true), [true, true, true]);
        let flow = |keep| Terms { keep, ..terms() }.side_of_flow();
        assert_eq!(
            [Keep::Outside, Keep::Inside, Keep::All].map(flow),
            [Side::Outside, Side::Inside, Side::Outside]
        );
        let deletes = Terms { keep: Keep::Outside, ..terms() };
        assert!(deletes.deletes_enclosed() && !terms().deletes_enclosed());
        assert!(!Terms { seeds: vec![[0; 3]], ..deletes.clone() }.deletes_enclosed());
        assert!(!Terms { enclosed: Enclosed::Keep, ..deletes }.deletes_enclosed());
    }

    #[test]
    fn a_box_splits_octants_that_it_meets_and_that_are_coarser() {
        let extent = |level| ExtentBox { min: [0; 3], max: [1 << 20; 3], level };
        let with = |level| Terms { boxes: vec![extent(1), extent(level)], ..terms() };
        let near = Octant::ROOT.child(0).child(0);
        assert_eq!(with(3).box_that_splits(&near), Some(&extent(3)));
        assert_eq!(with(2).box_that_splits(&near), None);
        assert_eq!(with(3).box_that_splits(&Octant::ROOT.child(0).child(1)), None);
        assert!(with(4).has_box_finer_than_surface() && !with(3).has_box_finer_than_surface());
    }

    #[test]
    fn places_are_the_same_up_to_rounding() {
        let same = |by: f64| {
            (0..3)
                .map(|axis| {
                    let mut moved = [1.0; 3];
                    moved[axis] += by;
                    terms().same_place([1.0; 3], moved)
                })
                .collect::<Vec<_>>()
        };
        assert_eq!([same(1e-9), same(-1e-9)], [[true; 3], [true; 3]]);
        assert_eq!([same(3e-9), same(-3e-9)], [[false; 3], [false; 3]]);
    }
}
