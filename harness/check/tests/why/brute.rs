//! What splits an octant, by the definition: slow, simple, and without the search structures of the library.

use contract::case::Case;
use contract::manifest::Manifest;
use contract::octant::Octant;
use contract::triangle::Triangle;

/// All that decides chains in a mesh whose crossing leaves are kept.
pub struct Brute<'a> {
    pub case: &'a Case,
    pub terms: Manifest,
}

impl Brute<'_> {
    /// Whether T0 splits an octant.
    pub fn base_splits(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        let crossed = || self.case.facets_lattice.iter().any(|f| Triangle::new(f).meets(low, high));
        self.terms.box_that_splits(octant).is_some()
            || octant.level < self.terms.level_surface && crossed()
    }

    /// Whether a leaf forces an octant to split by its layer, and by balance.
    pub fn forces(&self, leaf: &Octant, octant: &Octant) -> (bool, bool) {
        let distance = octant.distance(leaf);
        let reach = i64::from(self.terms.layer_cells_min - 1) * i64::from(leaf.edge());
        let is_finer = leaf.level > octant.level && !octant.contains(leaf);
        (is_finer && distance < reach, is_finer && leaf.level > octant.level + 1 && distance == 0)
    }
}
