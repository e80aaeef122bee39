//! Exact test whether a closed facet and a closed box share a point.
//!
//! The facet is clipped to the x range of the box, and the result to the y range. The clipped facet
//! is convex, so its z coordinates form one interval, which is compared with the z range of the
//! box. A clipped facet is represented by points whose convex hull it is. Facets that degenerate to
//! points or segments are convex hulls too and need no special case.
//!
//! The coordinates of clipped points are fractions. Facet coordinates lie in [-2^27, 2^28] and
//! box planes in [0, 2^27], so the distance of a point from a plane is at most 2^28, and a
//! coordinate with denominator w has a numerator of at most 2^28 w. Upper bounds:
//!
//! | | denominator | numerator | distance from a plane, times the denominator |
//! |---|---|---|---|
//! | vertex | 1 | 2^28 | 2^28 |
//! | clipped in x | 2^29 | 2^57 | 2^57 |
//! | clipped in x and y | 2 * 2^29 * 2^57 = 2^87 | 2^115 | 2^115 |
//!
//! The first two fit i64. Of a point clipped in x and y only the distances from two planes are
//! needed, which fit i128.
use crate::lattice::Facet;
use crate::octant::Extent;

/// The point (x, y, z) / w, with w positive.
#[derive(Clone, Copy)]
struct Point {
    numerator: [i64; 3],
    w: i64,
}

impl Point {
    /// Signed distance of the point above the plane `x[axis] = plane`, times w.
    fn above(&self, axis: usize, plane: i64) -> i64 {
        self.numerator[axis] - plane * self.w
    }
}

/// Whether the closed triangle `facet` and the closed box `extent` share at least one point.
#[must_use]
pub fn crosses(facet: &Facet, extent: &Extent) -> bool {
    // For speed only: most facets are smaller than most of the octants that they cross.
    let inside = |v: &[i64; 3]| (0..3).all(|a| (extent.min[a]..=extent.max[a]).contains(&v[a]));
    if facet.iter().any(inside) {
        return true;
    }
    let vertices = facet.map(|numerator| Point { numerator, w: 1 });
    // A triangle between two parallel planes has at most five corners.
    let (mut clipped, mut corners) = ([vertices[0]; 5], 0);
    clip(&vertices, 0, extent, |[p, q], [weight_p, weight_q]| {
        let sum = |x: i64, y: i64| weight_p * x + weight_q * y;
        let numerator = std::array::from_fn(|a| sum(p.numerator[a], q.numerator[a]));
        clipped[corners] = Point { numerator, w: sum(p.w, q.w) };
        corners += 1;
    });
    let (mut reaches_up, mut reaches_down) = (false, false);
    clip(&clipped[..corners], 1, extent, |points, weights| {
        let above = |plane| {
            let term = |i: usize| i128::from(weights[i]) * i128::from(points[i].above(2, plane));
            term(0) + term(1)
        };
        reaches_up |= above(extent.min[2]) >= 0;
        reaches_down |= above(extent.max[2]) <= 0;
    });
    reaches_up && reaches_down
}

/// Visits points whose convex hull is the hull of `points` clipped to the range of the extent along
/// `axis`. Each is a mean of two of `points` in homogeneous coordinates, given with its weights.
///
/// A corner of the clipped hull is either a corner of the hull or the intersection of an edge of
/// the hull with one of the two planes, and every edge of the hull joins two of `points`.
fn clip(
    points: &[Point],
    axis: usize,
    extent: &Extent,
    mut visit: impl FnMut([&Point; 2], [i64; 2]),
) {
    let planes = [extent.min[axis], extent.max[axis]];
    for (i, p) in points.iter().enumerate() {
        let above_p = planes.map(|plane| p.above(axis, plane));
        if above_p[0] >= 0 && above_p[1] <= 0 {
            visit([p, p], [1, 0]);
        }
        for q in &points[..i] {
            for (plane, above_p) in planes.into_iter().zip(above_p) {
                let above_q = q.above(axis, plane);
                if above_p.signum() * above_q.signum() < 0 {
                    visit([p, q], [above_q.abs(), above_p.abs()]);
                }
            }
        }
    }
}
