//! Crossing: whether a closed facet and a closed box share a point, exactly.
//!
//! The facet is cut down to the part within the box's x range, that to the part within its y range;
//! what is left is convex, so its z coordinates are one interval, to be compared with the box's.
//! A cut part is kept as points whose convex hull it is. Facets that are points or segments need no
//! care: they are hulls too.
//!
//! Cut points are fractions, and stay small enough for i128. Facet coordinates are at most 2^28 in
//! absolute value and box planes lie within [0, 2^27], so a point's distance from a plane is at most
//! 2^28, and a coordinate over denominator w has a numerator of at most 2^28 w.
//!
//! | | denominator | numerator | distance from a plane, times the denominator |
//! |---|---|---|---|
//! | vertex | 1 | 2^28 | 2^28 |
//! | after the cut in x | 2^29 | 2^57 | 2^57 |
//! | after the cut in y | 2 * 2^29 * 2^57 = 2^87 | 2^115 | 2^115 |
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

    /// How far the point is above the plane `x[axis] = plane`, times w.
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
    let cut_x = cut(&vertices, 0, extent);
    let cut_xy = cut(&cut_x, 1, extent);
    cut_xy.iter().any(|p| p.above(2, extent.min[2]) >= 0)
        && cut_xy.iter().any(|p| p.above(2, extent.max[2]) <= 0)
}

/// Most octants that a facet is tried against are nowhere near it; this is only to be quick.
fn bounds_touch(facet: &Facet, extent: &Extent) -> bool {
    (0..3).all(|a| {
        facet.iter().any(|v| v[a] >= extent.min[a]) && facet.iter().any(|v| v[a] <= extent.max[a])
    })
}

/// Points whose convex hull is the part of the hull of `points` within the extent along `axis`.
///
/// A corner of that part is a corner of the whole, or lies where an edge of the whole meets one of
/// the two planes; and every edge of a hull joins two of its points.
fn cut(points: &[Point], axis: usize, extent: &Extent) -> Vec<Point> {
    let planes = [extent.min[axis], extent.max[axis]];
    let within = |p: &&Point| p.above(axis, planes[0]) >= 0 && p.above(axis, planes[1]) <= 0;
    let mut part: Vec<Point> = points.iter().filter(within).copied().collect();
    for (i, p) in points.iter().enumerate() {
        for q in &points[..i] {
            for plane in planes {
                let (above_p, above_q) = (p.above(axis, plane), q.above(axis, plane));
                if above_p.signum() * above_q.signum() < 0 {
                    part.push(between(p, above_q.abs(), q, above_p.abs()));
                }
            }
        }
    }
    part
}

/// The point `(weight_p p + weight_q q) / (weight_p + weight_q)` in homogeneous coordinates.
fn between(p: &Point, weight_p: i128, q: &Point, weight_q: i128) -> Point {
    let sum = |x: i128, y: i128| weight_p * x + weight_q * y;
    Point {
        numerator: std::array::from_fn(|a| sum(p.numerator[a], q.numerator[a])),
        w: sum(p.w, q.w),
    }
}
