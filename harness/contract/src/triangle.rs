//! Exact test whether a closed triangle and a closed box share a point.
//!
//! They do iff the box contains a corner of the triangle, or an edge of the triangle meets the box, or the box
//! intersects only the interior of the triangle. In the last case, the triangle contains the whole intersection
//! of its plane with the box, so any point of that intersection decides. The test takes the point on the box
//! diagonal that is most nearly parallel to the normal.

use crate::lattice::{FacetLattice, bounds, cross, difference, dot, edges, normal};

/// A facet with precomputed bounds, normal and height.
#[derive(Clone, Debug)]
pub struct Triangle {
    corners: FacetLattice,
    low: [i64; 3],
    high: [i64; 3],
    /// Not normalised. Zero iff the triangle is degenerate; components are at most 2^59 in magnitude.
    normal: [i64; 3],
    /// Inner product of the normal and any point of the plane.
    height: i128,
}

impl Triangle {
    /// Precomputes bounds, normal and height.
    pub fn new(corners: &FacetLattice) -> Self {
        let [low, high] = bounds(corners);
        let normal = normal(corners);
        Self { corners: *corners, low, high, normal, height: dot(normal, corners[0]) }
    }

    /// Whether the triangle shares a point with the closed box.
    pub fn meets(&self, low: [i64; 3], high: [i64; 3]) -> bool {
        if (0..3).any(|a| self.high[a] < low[a] || self.low[a] > high[a]) {
            return false;
        }
        let within = |v: &[i64; 3]| (0..3).all(|a| low[a] <= v[a] && v[a] <= high[a]);
        if self.corners.iter().any(within) {
            return true;
        }
        // If both ends of the diagonal along which the height increases most are on one side of the plane, so is the box.
        let up = |a: usize| self.normal[a] >= 0;
        let near = std::array::from_fn(|a| if up(a) { low[a] } else { high[a] });
        let far = std::array::from_fn(|a| if up(a) { high[a] } else { low[a] });
        let above = |point| dot(self.normal, point) - self.height;
        if above(near) > 0 || above(far) < 0 {
            return false;
        }
        edges(&self.corners).into_iter().any(|[from, to]| segment_meets(from, to, low, high))
            || self.pierced(near, far)
    }

    /// Whether the line through two points on opposite sides of the plane intersects the triangle: seen along
    /// the line, the three edges have the same orientation. A degenerate triangle has no interior.
    fn pierced(&self, near: [i64; 3], far: [i64; 3]) -> bool {
        if self.normal == [0; 3] {
            return false;
        }
        let along = difference(far, near);
        let spokes = self.corners.map(|v| difference(v, near));
        let turn = |i: usize, j: usize| dot(cross(spokes[i], spokes[j]), along).signum();
        let turns = [turn(0, 1), turn(1, 2), turn(2, 0)];
        !(turns.contains(&1) && turns.contains(&-1))
    }
}

/// Whether a segment meets a closed box: its intersections with the three slabs of the box have a common point.
/// Positions along the segment are fractions.
fn segment_meets(from: [i64; 3], to: [i64; 3], low: [i64; 3], high: [i64; 3]) -> bool {
    let (mut enter, mut leave) = ((0, 1), (1, 1));
    for a in 0..3 {
        let step = to[a] - from[a];
        if step == 0 {
            if from[a] < low[a] || from[a] > high[a] {
                return false;
            }
            continue;
        }
        let (first, last) = if step > 0 { (low[a], high[a]) } else { (high[a], low[a]) };
        let position = |plane: i64| ((plane - from[a]) * step.signum(), step.abs());
        let (first, last) = (position(first), position(last));
        enter = if less(enter, first) { first } else { enter };
        leave = if less(last, leave) { last } else { leave };
    }
    !less(leave, enter)
}

/// Compares fractions with positive denominators. On the lattice both products are less than 2^60.
fn less(a: (i64, i64), b: (i64, i64)) -> bool {
    a.0 * b.1 < b.0 * a.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LOW: [i64; 3] = [0; 3];
    const HIGH: [i64; 3] = [4; 3];

    fn meets(corners: FacetLattice) -> bool {
        Triangle::new(&corners).meets(LOW, HIGH)
    }

    #[test]
    fn corners_edges_interior_and_boundary_can_meet_the_box() {
        // A corner lies in the box; an edge crosses it; only the interior intersects it.
        assert!(meets([[1, 1, 1], [90, 90, 91], [90, 80, 70]]));
        assert!(meets([[-5, 2, 2], [9, 2, 3], [2, 90, 90]]));
        assert!(meets([[-90, -90, 2], [90, -90, 2], [0, 190, 3]]));
        // Contact with a face, with an edge, with a corner: the sets are closed.
        assert!(meets([[-90, -90, 4], [90, -90, 4], [0, 190, 4]]));
        assert!(meets([[4, 4, -9], [4, 4, 9], [90, 90, 0]]));
        assert!(meets([[4, 4, 4], [90, 5, 5], [5, 90, 5]]));
    }

    #[test]
    fn bounds_plane_and_edges_can_miss_the_box() {
        // Beside a face; plane beyond a corner; plane through the box, but not the triangle.
        assert!(!meets([[5, -9, -9], [5, 9, -9], [5, 0, 90]]));
        assert!(!meets([[13, 0, 0], [0, 13, 0], [0, 0, 13]]));
        assert!(!meets([[6, -9, 2], [90, 0, 2], [6, 9, 2]]));
        // The bounding boxes overlap, but an edge passes the box diagonally.
        assert!(!meets([[-1, 6, 2], [6, -1, 2], [9, 9, 2]].map(|v: [i64; 3]| [
            v[0] + 2,
            v[1] + 2,
            v[2]
        ])));
    }

    #[test]
    fn triangles_may_degenerate_to_segments_and_points() {
        assert!(meets([[4, 0, 4]; 3]));
        assert!(!meets([[5, 0, 4]; 3]));
        assert!(meets([[-2, -2, -2], [9, 9, 9], [-2, -2, -2]]));
        assert!(!meets([[-2, 7, 0], [7, 12, 0], [-2, 7, 0]]));
    }

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let (near, far) = (-(1 << 27), 1 << 28);
        // Its plane meets the root in the far corner only.
        let triangle = Triangle::new(&[[near, far, far], [far, near, far], [far, far, near]]);
        assert!(triangle.meets([0; 3], [1 << 27; 3]));
        assert!(!triangle.meets([0; 3], [(1 << 27) - 1; 3]));
    }

    /// Whether no plane separates the triangle from the box: normal to an axis, to the triangle, or to an axis and an edge.
    fn is_not_separated(t: &FacetLattice, low: [i64; 3], high: [i64; 3]) -> bool {
        let unit = |axis: usize| -> [i64; 3] { std::array::from_fn(|a| i64::from(a == axis)) };
        let edges = [difference(t[1], t[0]), difference(t[2], t[1]), difference(t[0], t[2])];
        let mixed = (0..9).map(|i| cross(unit(i / 3), edges[i % 3]));
        let mut normals = (0..3).map(unit).chain([cross(edges[0], edges[1])]).chain(mixed);
        normals.all(|n| {
            let of_box =
                (0..8).map(|i| dot(n, std::array::from_fn(|a| [low, high][i >> a & 1][a])));
            let (from, to) = of_box.fold((i128::MAX, i128::MIN), |(l, h), x| (l.min(x), h.max(x)));
            let of_corners = t.map(|v| dot(n, v));
            of_corners.iter().any(|&x| x <= to) && of_corners.iter().any(|&x| x >= from)
        })
    }

    proptest! {
        /// A point that lies in the triangle and in the box proves that they meet.
        #[test]
        fn a_common_point_implies_that_they_meet(
            corners in prop::array::uniform3(prop::array::uniform3(-12i64..=16)),
            (i, j) in (0i64..=12, 0i64..=12),
        ) {
            prop_assume!(i + j <= 12);
            let twelfths = |a: usize| corners[0][a] * (12 - i - j) + corners[1][a] * i + corners[2][a] * j;
            let within = (0..3).all(|a| (12 * LOW[a]..=12 * HIGH[a]).contains(&twelfths(a)));
            prop_assert!(!within || meets(corners));
        }

        #[test]
        fn they_meet_iff_no_plane_separates_them(
            corners in prop::array::uniform3(prop::array::uniform3(-6i64..=10)), kind in 0..6,
        ) {
            let [a, b, c] = corners;
            let corners = match kind {
                0 => [a, a, a],
                1 => [a, b, a],
                2 => [a, b, std::array::from_fn(|i| 2 * b[i] - a[i])],
                _ => [a, b, c],
            };
            prop_assert_eq!(meets(corners), is_not_separated(&corners, LOW, HIGH));
        }

        #[test]
        fn the_result_is_invariant_under_permutation_of_corners_and_axes(corners in prop::array::uniform3(prop::array::uniform3(-12i64..=16))) {
            let [a, b, c] = corners;
            prop_assert_eq!(meets([b, c, a]), meets(corners));
            prop_assert_eq!(meets([c, b, a]), meets(corners));
            prop_assert_eq!(meets(corners.map(|[x, y, z]| [y, z, x])), meets(corners));
            prop_assert_eq!(meets(corners.map(|[x, y, z]| [4 - x, y, z])), meets(corners));
        }
    }
}
