//! Whether two facets are opposite, and how far apart.
//!
//! Two facets are opposite if they have no common vertex and do not meet, their normals differ by at least 120 degrees,
//! and the shortest line between them is within 60 degrees of both normals. They are a wall if each is on the inner
//! side of the other, and a gap if each is on the outer side, by the winding of the file. Limits and other pairs of values
//! are those of walls, then of gaps.

use contract::lattice::FacetLattice;

use super::boxes::{Bounds, greater, less, unit_normal};
use super::distance::{dot, nearest, sub};

/// The cosine of 60 degrees.
const COSINE: f64 = 0.5;

/// What rounding may take from a lower bound on the height of one facet over the other, as a part of their distance.
const ROUNDING: f64 = 1e-9;

/// A facet on the lattice.
pub struct Triangle {
    corners: [[f64; 3]; 3],
    normal: [f64; 3],
}

impl Triangle {
    /// A facet with an area.
    pub fn new(facet: &FacetLattice) -> Self {
        Self { corners: facet.map(|v| v.map(|c| c as f64)), normal: unit_normal(facet) }
    }

    /// Least and greatest height of the other facet over the plane of this one.
    fn heights(&self, other: &Self) -> (f64, f64) {
        let [a, b, c] = other.corners.map(|v| dot(sub(v, self.corners[0]), self.normal));
        (less(less(a, b), c), greater(greater(a, b), c))
    }
}

/// Whether normals of two nodes may differ by 120 degrees.
pub fn is_averted(a: &Bounds, b: &Bounds) -> bool {
    // Sums of f32 are rounded.
    f64::from(a.cosine_min(b)) <= 1e-5 - COSINE
}

/// Whether facets of two nodes may be opposite and nearer than the squared limits.
pub fn may_oppose(a: &Bounds, b: &Bounds, limits: [f64; 2]) -> bool {
    if !is_averted(a, b) {
        return false;
    }
    let squared = a.distance_squared(b);
    let mut may = limits.map(|limit| squared < limit);
    if may == [false; 2] {
        return false;
    }
    // The shortest line is no shorter than this, and is within 60 degrees of the normals of both: each facet is as far below
    // the other one, or above it.
    let height = (COSINE - ROUNDING) * squared.sqrt();
    for (from, to) in [(a, b), (b, a)] {
        let (least, greatest) = from.height_range(to);
        may = [may[0] && least <= -height, may[1] && greatest >= height];
        if may == [false; 2] {
            return false;
        }
    }
    true
}

/// The side and the squared distance of two facets if they are opposite and nearer than the squared limit of that side,
/// provided that they have no common vertex and do not meet. `squared_min` is a lower bound on their squared distance.
pub fn opposite(
    f: &Triangle,
    g: &Triangle,
    squared_min: f64,
    limits: [f64; 2],
) -> Option<(usize, f64)> {
    if dot(f.normal, g.normal) > -COSINE {
        return None;
    }
    let height = (COSINE - ROUNDING) * squared_min.sqrt();
    let mut may = limits.map(|limit| squared_min < limit);
    for (from, to) in [(f, g), (g, f)] {
        let (least, greatest) = from.heights(to);
        // A facet that is wholly on one side of a plane is no nearer to the other facet than to the plane.
        let is_near = [
            greatest >= 0.0 || greatest * greatest < limits[0],
            least <= 0.0 || least * least < limits[1],
        ];
        may =
            [may[0] && least <= -height && is_near[0], may[1] && greatest >= height && is_near[1]];
        if may == [false; 2] {
            return None;
        }
    }
    let (squared, p, q) = nearest(&f.corners, &g.corners);
    let line = sub(q, p);
    let (along_f, along_g) = (dot(line, f.normal), dot(line, g.normal));
    let least = COSINE * squared.sqrt();
    let side = usize::from(along_f > 0.0);
    let is_along = along_f.abs() >= least && along_g.abs() >= least && along_f * along_g < 0.0;
    (is_along && squared < limits[side]).then_some((side, squared))
}
