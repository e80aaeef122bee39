//! The position of the body in the root.

use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use serde::Serialize;

use super::finding::{Finding, Kind, Place};
use super::input::Input;

/// The bounding box and its distances from the root's faces.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extent {
    /// Least coordinates, in the user's units.
    pub low: [f64; 3],
    /// Greatest coordinates, in the user's units.
    pub high: [f64; 3],
    /// Least distance to a face of the root, negative if the body extends beyond it, in the user's units.
    pub margin: f64,
}

/// The extent of at least one facet.
pub fn extent(input: &Input) -> Extent {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for vertex in input.facets.as_flattened() {
        for a in 0..3 {
            low[a] = low[a].min(vertex[a].into());
            high[a] = high[a].max(vertex[a].into());
        }
    }
    let root = &input.root;
    let margin = |a: usize| (low[a] - root.origin[a]).min(root.origin[a] + root.edge - high[a]);
    let margin = (0..3).map(margin).fold(f64::INFINITY, f64::min);
    Extent { low, high, margin }
}

/// Facets with a point beyond the root, and facets that touch the root's boundary from within; on the lattice.
pub fn findings(input: &Input, first: usize) -> [Finding; 2] {
    let mut findings = [Kind::OutsideRoot, Kind::TouchingRoot].map(Finding::new);
    for (i, facet) in input.lattice.iter().enumerate() {
        let at = match margin(facet) {
            ..0 => 0,
            0 => 1,
            1.. => continue,
        };
        findings[at].add(first, || Place::new(vec![i as u32], input.centroid(i as u32)));
    }
    findings
}

/// The least distance of a corner to a face of the root, negative beyond it.
fn margin(facet: &FacetLattice) -> i64 {
    let corners = facet.as_flattened().iter();
    corners.map(|&c| c.min(UNITS_PER_EDGE - c)).fold(i64::MAX, i64::min)
}
