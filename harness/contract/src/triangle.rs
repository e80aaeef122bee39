//! Whether a closed triangle and a closed octant share a point, exactly.
//!
//! By containment: they do iff a corner of the triangle lies in the box, or an edge of the triangle
//! meets the box, or the box pierces the triangle's inside. In the last case the plane's section of
//! the box lies in the triangle as a whole, so any one point of it decides; the box's diagonal that
//! runs most nearly along the normal provides it.

use crate::lattice::FacetLattice;

/// A facet with what every test needs.
#[derive(Clone, Debug)]
pub struct Triangle {
    corners: FacetLattice,
    low: [i64; 3],
    high: [i64; 3],
    /// Zero iff degenerate. At most 2^59 in size.
    normal: [i64; 3],
    /// Height of the plane along the normal.
    height: i128,
}

impl Triangle {
    /// Prepares a facet.
    pub fn new(corners: &FacetLattice) -> Self {
        let pick = |f: fn(i64, i64) -> i64| -> [i64; 3] {
            std::array::from_fn(|a| f(f(corners[0][a], corners[1][a]), corners[2][a]))
        };
        let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let height = dot(normal, corners[0]);
        Self { corners: *corners, low: pick(i64::min), high: pick(i64::max), normal, height }
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
        // The box's corners nearest to and farthest along the normal: if the plane passes by, so
        // does the triangle.
        let (near, far) = self.diagonal(low, high);
        let (below, above) =
            (dot(self.normal, near) - self.height, dot(self.normal, far) - self.height);
        if below > 0 || above < 0 {
            return false;
        }
        let [a, b, c] = self.corners;
        segment_meets(a, b, low, high)
            || segment_meets(b, c, low, high)
            || segment_meets(c, a, low, high)
            || self.pierced(near, far)
    }

    /// The box's diagonal along which the height grows most.
    fn diagonal(&self, low: [i64; 3], high: [i64; 3]) -> ([i64; 3], [i64; 3]) {
        let up = |a: usize| self.normal[a] >= 0;
        let near = std::array::from_fn(|a| if up(a) { low[a] } else { high[a] });
        let far = std::array::from_fn(|a| if up(a) { high[a] } else { low[a] });
        (near, far)
    }

    /// Whether the line through two points, which cross the plane, goes through the triangle: seen
    /// along the line, the three edges turn the same way. Degenerate triangles have only edges.
    fn pierced(&self, near: [i64; 3], far: [i64; 3]) -> bool {
        if self.normal == [0; 3] {
            return false;
        }
        let along = sub(far, near);
        let spokes = self.corners.map(|v| sub(v, near));
        let turn = |i: usize, j: usize| dot(cross(spokes[i], spokes[j]), along).signum();
        let turns = [turn(0, 1), turn(1, 2), turn(2, 0)];
        !(turns.contains(&1) && turns.contains(&-1))
    }
}

/// Whether a segment meets a closed box: the stretches of it between each pair of the box's planes
/// have a point in common. Positions along the segment are fractions, compared by cross products.
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
        let at = |plane: i64| ((plane - from[a]) * step.signum(), step.abs());
        enter = if less(enter, at(first)) { at(first) } else { enter };
        leave = if less(at(last), leave) { at(last) } else { leave };
    }
    !less(leave, enter)
}

/// Comparison of fractions with positive denominators; both terms stay below 2^60 on the lattice.
fn less(a: (i64, i64), b: (i64, i64)) -> bool {
    a.0 * b.1 < b.0 * a.1
}

fn sub(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(u: [i64; 3], v: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        u[b] * v[c] - u[c] * v[b]
    })
}

fn dot(a: [i64; 3], b: [i64; 3]) -> i128 {
    (0..3).map(|i| i128::from(a[i]) * i128::from(b[i])).sum()
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
    fn each_way_to_meet() {
        // A corner within, an edge through, the inside pierced.
        assert!(meets([[1, 1, 1], [90, 90, 91], [90, 80, 70]]));
        assert!(meets([[-5, 2, 2], [9, 2, 3], [2, 90, 90]]));
        assert!(meets([[-90, -90, 2], [90, -90, 2], [0, 190, 3]]));
        // In the plane of a face, at an edge, at a corner: closed sets share their boundary.
        assert!(meets([[-90, -90, 4], [90, -90, 4], [0, 190, 4]]));
        assert!(meets([[4, 4, -9], [4, 4, 9], [90, 90, 0]]));
        assert!(meets([[4, 4, 4], [90, 5, 5], [5, 90, 5]]));
    }

    #[test]
    fn each_way_to_miss() {
        // Beside a face; plane above a corner; plane through the box but the triangle elsewhere.
        assert!(!meets([[5, -9, -9], [5, 9, -9], [5, 0, 90]]));
        assert!(!meets([[13, 0, 0], [0, 13, 0], [0, 0, 13]]));
        assert!(!meets([[6, -9, 2], [90, 0, 2], [6, 9, 2]]));
        // The bounding box covers the box, an edge passes it diagonally.
        assert!(!meets([[-1, 6, 2], [6, -1, 2], [9, 9, 2]].map(|v: [i64; 3]| [
            v[0] + 2,
            v[1] + 2,
            v[2]
        ])));
    }

    #[test]
    fn points_and_segments_are_triangles_too() {
        assert!(meets([[4, 0, 4]; 3]));
        assert!(!meets([[5, 0, 4]; 3]));
        assert!(meets([[-2, -2, -2], [9, 9, 9], [-2, -2, -2]]));
        assert!(!meets([[-2, 7, 0], [7, 12, 0], [-2, 7, 0]]));
    }

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let (near, far) = (-(1 << 27), 1 << 28);
        // Its plane passes through the far corner of the root, and through nothing else of it.
        let triangle = Triangle::new(&[[near, far, far], [far, near, far], [far, far, near]]);
        assert!(triangle.meets([0; 3], [1 << 27; 3]));
        assert!(!triangle.meets([0; 3], [(1 << 27) - 1; 3]));
    }

    proptest! {
        /// A point of the triangle that lies in the box proves that they meet.
        #[test]
        fn whatever_holds_a_common_point_meets(
            corners in prop::array::uniform3(prop::array::uniform3(-12i64..=16)),
            (i, j) in (0i64..=12, 0i64..=12),
        ) {
            prop_assume!(i + j <= 12);
            let twelfths = |a: usize| corners[0][a] * (12 - i - j) + corners[1][a] * i + corners[2][a] * j;
            let within = (0..3).all(|a| (12 * LOW[a]..=12 * HIGH[a]).contains(&twelfths(a)));
            prop_assert!(!within || meets(corners));
        }

        /// Nothing depends on the order of corners or the names of axes.
        #[test]
        fn corners_and_axes_may_be_permuted(corners in prop::array::uniform3(prop::array::uniform3(-12i64..=16))) {
            let [a, b, c] = corners;
            prop_assert_eq!(meets([b, c, a]), meets(corners));
            prop_assert_eq!(meets([c, b, a]), meets(corners));
            prop_assert_eq!(meets(corners.map(|[x, y, z]| [y, z, x])), meets(corners));
            prop_assert_eq!(meets(corners.map(|[x, y, z]| [4 - x, y, z])), meets(corners));
        }
    }
}
