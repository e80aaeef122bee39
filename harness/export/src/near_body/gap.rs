//! The gap between a front and the wall: the distance from each face to the nearest facet.
//!
//! Distances are those of the facets on the lattice, on which the mesh was made; a vertex is at most half a lattice unit along each axis
//! from where the user put it. The least distance of a face is positive, because no facet touches a leaf on a side.

use check::leak::clearance::{Clearance, Point};
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::UNITS_PER_CELL;

use super::front::Face;
use crate::error::ExportError;

/// The distances of a face from the wall, in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Least distance of any point of the face.
    pub least: f64,
    /// Distance of its centre.
    pub centre: f64,
}

/// The gap of each face; infinite if the case has no facets.
///
/// # Errors
/// The first error of `check`, which is called from time to time.
pub fn gaps(
    case: &Case,
    faces: &[Face],
    check: &dyn Fn() -> Result<(), ExportError>,
) -> Result<Vec<Gap>, ExportError> {
    let clearance = Clearance::new(&case.facets_lattice);
    let unit = case.root.edge / UNITS_PER_EDGE as f64;
    let mut gaps = Vec::with_capacity(faces.len());
    // Consecutive faces are close to each other, so the distance of one bounds that of the next.
    let mut last: Option<(Point, f64)> = None;
    for (index, face) in faces.iter().enumerate() {
        if index % (1 << 12) == 0 {
            check()?;
        }
        let corners = face.corners().map(|c| c.map(|c| (i64::from(c) * UNITS_PER_CELL) as f64));
        let middle = std::array::from_fn(|a| f64::midpoint(corners[0][a], corners[2][a]));
        let bound = last.map_or(f64::INFINITY, |(at, distance)| {
            let squared: f64 = (0..3).map(|a| (at[a] - middle[a]).powi(2)).sum();
            distance + squared.sqrt()
        });
        let centre = clearance.at(middle, bound);
        let least = clearance.at_square(&corners, centre);
        gaps.push(Gap { least: least * unit, centre: centre * unit });
        last = Some((middle, centre));
    }
    Ok(gaps)
}
