//! Exact test whether a closed facet and a closed box share a point.
//!
//! The facet is clipped to the x range of the box, and the result to the y range. The clipped facet
//! is convex, so its z coordinates form one interval, which is compared with the z range of the
//! box. A clipped facet is represented by points whose convex hull it is. Facets that degenerate to
//! points or segments are convex hulls too and need no special case.
//!
//! The coordinates of clipped points are fractions that fit i128. Facet coordinates are at most
//! 2^28 in absolute value and box planes lie in [0, 2^27], so the distance of a point from a plane
//! is at most 2^28, and a coordinate with denominator w has a numerator of at most 2^28 w. Upper
//! bounds:
//!
//! | | denominator | numerator | distance from a plane, times the denominator |
//! |---|---|---|---|
//! | vertex | 1 | 2^28 | 2^28 |
//! | clipped in x | 2^29 | 2^57 | 2^57 |
//! | clipped in x and y | 2 * 2^29 * 2^57 = 2^87 | 2^115 | 2^115 |
use crate::lattice::Facet;
use crate::octant::Extent;

/// The point (x, y, z) / w, with w positive.
#[derive(Clone, Copy)]
struct Point {
    numerator: [i128; 3],
    w: i128,
}

impl Point {
    fn of_vertex(vertex: [i64; 3]) -> Self {
        Self { numerator: vertex.map(i128::from), w: 1 }
    }

    /// Signed distance of the point above the plane `x[axis] = plane`, times w.
    fn above(&self, axis: usize, plane: i64) -> i128 {
        self.numerator[axis] - i128::from(plane) * self.w
    }
}

/// Whether the closed triangle `facet` and the closed box `extent` share at least one point.
#[must_use]
pub fn crosses(facet: &Facet, extent: &Extent) -> bool {
    if !bounds_touch(facet, extent) {
        return false;
    }
    let vertices = facet.map(Point::of_vertex);
    let clipped_x = clip(&vertices, 0, extent);
    let clipped_xy = clip(&clipped_x, 1, extent);
    clipped_xy.iter().any(|p| p.above(2, extent.min[2]) >= 0)
        && clipped_xy.iter().any(|p| p.above(2, extent.max[2]) <= 0)
}

/// Whether the bounding box of the facet touches the box. For speed only: most octants that a facet
/// is tested against are far away from it.
fn bounds_touch(facet: &Facet, extent: &Extent) -> bool {
    (0..3).all(|a| {
        facet.iter().any(|v| v[a] >= extent.min[a]) && facet.iter().any(|v| v[a] <= extent.max[a])
    })
}

/// Points whose convex hull is the hull of `points` clipped to the range of the extent along
/// `axis`.
///
/// A corner of the clipped hull is either a corner of the hull or the intersection of an edge of
/// the hull with one of the two planes, and every edge of the hull joins two of `points`.
fn clip(points: &[Point], axis: usize, extent: &Extent) -> Vec<Point> {
    let planes = [extent.min[axis], extent.max[axis]];
    let within = |p: &&Point| p.above(axis, planes[0]) >= 0 && p.above(axis, planes[1]) <= 0;
    let mut clipped: Vec<Point> = points.iter().filter(within).copied().collect();
    for (i, p) in points.iter().enumerate() {
        for q in &points[..i] {
            for plane in planes {
                let (above_p, above_q) = (p.above(axis, plane), q.above(axis, plane));
                if above_p.signum() * above_q.signum() < 0 {
                    clipped.push(weighted_mean(p, above_q.abs(), q, above_p.abs()));
                }
            }
        }
    }
    clipped
}

/// The point `(weight_p p + weight_q q) / (weight_p + weight_q)` in homogeneous coordinates.
fn weighted_mean(p: &Point, weight_p: i128, q: &Point, weight_q: i128) -> Point {
    let sum = |x: i128, y: i128| weight_p * x + weight_q * y;
    Point {
        numerator: std::array::from_fn(|a| sum(p.numerator[a], q.numerator[a])),
        w: sum(p.w, q.w),
    }
}
