//! Whether two facets are opposite, and how far apart.
//!
//! Two facets are opposite if they have no common vertex and do not meet, their normals differ by at least 120 degrees,
//! and the shortest line between them is within 60 degrees of both normals. They are a wall if each is on the inner
//! side of the other, and a gap if each is on the outer side, by the winding of the file. Limits and other pairs of values
//! are those of walls, then of gaps.

use contract::lattice::FacetLattice;

use super::boxes::unit_normal;
use super::distance::{dot, nearest, sub};

/// The cosine of 60 degrees.
pub const COSINE: f64 = 0.5;

/// An upper bound on the rounding error of a cosine.
const ROUNDING: f64 = 1e-9;

type Corners = [[f64; 3]; 3];

/// A facet on the lattice.
struct Triangle {
    corners: Corners,
    normal: [f64; 3],
}

impl Triangle {
    /// A facet with an area.
    fn new(facet: &FacetLattice) -> Self {
        Self { corners: corners(facet), normal: unit_normal(facet) }
    }

    /// Whether another facet, whose squared distance is at least `squared_min`, may be a wall or a gap within the squared
    /// limits, by the heights of its corners over the plane of this one.
    fn may_oppose(&self, other: &Corners, squared_min: f64, limits: [f64; 2]) -> [bool; 2] {
        let [a, b, c] = other.map(|v| dot(sub(v, self.corners[0]), self.normal));
        let (least, greatest) = (a.min(b).min(c), a.max(b).max(c));
        let along = is_along(least, greatest, squared_min);
        // A facet that is wholly on one side of a plane is no nearer to the other facet than to the plane.
        [
            along[0] && (greatest >= 0.0 || greatest * greatest < limits[0]),
            along[1] && (least <= 0.0 || least * least < limits[1]),
        ]
    }
}

fn corners(facet: &FacetLattice) -> Corners {
    facet.map(|v| v.map(|c| c as f64))
}

/// Whether a line of at least this squared length may be within 60 degrees of a normal, downward or upward, if it ends
/// between two heights over the plane where it begins.
fn is_along(least: f64, greatest: f64, squared_min: f64) -> [bool; 2] {
    let height_squared = (COSINE - ROUNDING).powi(2) * squared_min;
    [
        least <= 0.0 && least * least >= height_squared,
        greatest >= 0.0 && greatest * greatest >= height_squared,
    ]
}

fn both(a: [bool; 2], b: [bool; 2]) -> [bool; 2] {
    [a[0] && b[0], a[1] && b[1]]
}

/// The side and the squared distance of two facets if they are opposite and nearer than the squared limit of that side,
/// provided that they have no common vertex and do not meet. `squared_min` is a lower bound on their squared distance.
pub fn opposite(
    f: &FacetLattice,
    g: &FacetLattice,
    squared_min: f64,
    limits: [f64; 2],
) -> Option<(usize, f64)> {
    let f = Triangle::new(f);
    let may = f.may_oppose(&corners(g), squared_min, limits);
    if may == [false; 2] {
        return None;
    }
    let g = Triangle::new(g);
    let back = g.may_oppose(&f.corners, squared_min, limits);
    if both(may, back) == [false; 2] || dot(f.normal, g.normal) > -COSINE {
        return None;
    }
    let (squared, p, q) = nearest(&f.corners, &g.corners);
    let line = sub(q, p);
    let (along_f, along_g) = (dot(line, f.normal), dot(line, g.normal));
    let least = COSINE * squared.sqrt();
    let side = usize::from(along_f > 0.0);
    let is_between = along_f.signum() != along_g.signum();
    let is_along = along_f.abs() >= least && along_g.abs() >= least && is_between;
    (is_along && squared < limits[side]).then_some((side, squared))
}
