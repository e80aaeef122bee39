//! The position of the body in the root.

use contract::lattice::UNITS_PER_EDGE;
use serde::Serialize;

use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::tree::{Aabb, Point, bounds};

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
    let Aabb { mins, maxs } = bounds(&input.facets);
    let origin = Point::from(input.root.origin);
    let margin = (mins - origin).min(origin + Point::splat(input.root.edge) - maxs).min_element();
    Extent { low: mins.to_array(), high: maxs.to_array(), margin }
}

/// Facets with a point beyond the root, and facets that touch the root's boundary from within; on the lattice.
pub fn findings(input: &Input, first: usize) -> [Finding; 2] {
    let mut findings = [Kind::OutsideRoot, Kind::TouchingRoot].map(Finding::new);
    for (i, facet) in input.facets_lattice.iter().enumerate() {
        let corners = facet.as_flattened().iter();
        let margin = corners.map(|&c| c.min(UNITS_PER_EDGE - c)).fold(i64::MAX, i64::min);
        let at = match margin {
            ..0 => 0,
            0 => 1,
            1.. => continue,
        };
        findings[at].add(first, || Place::new(vec![i as u32], input.centroid(i as u32)));
    }
    findings
}
