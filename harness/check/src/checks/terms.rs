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
