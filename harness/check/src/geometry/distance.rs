//! The distance of two triangles that do not intersect, and of a point from a triangle, in f64.

type Point = [f64; 3];
type Triangle = [Point; 3];

/// Squared distance, and a nearest point of each triangle.
pub fn nearest(a: &Triangle, b: &Triangle) -> (f64, Point, Point) {
    let mut best = (f64::INFINITY, a[0], b[0]);
    let mut keep = |p: Point, q: Point| {
        let d = sub(q, p);
        let squared = dot(d, d);
        if squared < best.0 {
            best = (squared, p, q);
        }
    };
    for i in 0..3 {
        for j in 0..3 {
            let (p, q) = segments(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]);
            keep(p, q);
        }
        if let Some(foot) = foot(a[i], b) {
            keep(a[i], foot);
        }
        if let Some(foot) = foot(b[i], a) {
            keep(foot, b[i]);
        }
    }
    best
}

/// Squared distance of a point from a triangle, which may have no area, and the nearest point of the triangle.
pub fn from_point(p: Point, t: &Triangle) -> (f64, Point) {
    Prepared::new(t).nearest(p)
}

/// A triangle, which may have no area, prepared for the distances of many points.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    corners: Triangle,
    edges: [Point; 3],
    /// Inverse squared length of each edge; 0 for an edge without length.
    inverses: [f64; 3],
    /// In the plane, normal to each edge, towards the third corner.
    inward: [Point; 3],
    normal: Point,
    /// Squared length of the normal; 0 where the triangle is so thin that its edges are as near as its plane and its
    /// normal is mostly rounding error.
    normal_squared: f64,
}

impl Prepared {
    /// Prepares a triangle.
    pub fn new(t: &Triangle) -> Self {
        let edges: [Point; 3] = std::array::from_fn(|i| sub(t[(i + 1) % 3], t[i]));
        let normal = cross(edges[0], edges[1]);
        let normal_squared = dot(normal, normal);
        let squares = edges.map(|e| dot(e, e));
        let is_thin = normal_squared <= 1e-20 * squares[0] * squares[2];
        Self {
            corners: *t,
            edges,
            inverses: squares.map(|squared| if squared > 0.0 { squared.recip() } else { 0.0 }),
            inward: edges.map(|e| cross(normal, e)),
            normal,
            normal_squared: if is_thin { 0.0 } else { normal_squared },
        }
    }

    /// Squared distance of a point.
    pub fn squared(&self, p: Point) -> f64 {
        let from = self.corners.map(|corner| sub(p, corner));
        if self.is_over(&from) {
            let height = dot(from[0], self.normal);
            return height * height / self.normal_squared;
        }
        (0..3).map(|i| self.edge_distance(i, from[i]).0).fold(f64::INFINITY, f64::min)
    }

    /// Squared distance of a point, and the nearest point of the triangle.
    pub fn nearest(&self, p: Point) -> (f64, Point) {
        let from = self.corners.map(|corner| sub(p, corner));
        if self.is_over(&from) {
            let height = dot(from[0], self.normal);
            let foot = along(p, self.normal, -height / self.normal_squared);
            return (height * height / self.normal_squared, foot);
        }
        let on_edge = |i: usize| {
            let (squared, s) = self.edge_distance(i, from[i]);
            (squared, along(self.corners[i], self.edges[i], s))
        };
        let nearest = (0..3).map(on_edge).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.expect("a triangle has edges")
    }

    /// Whether the foot of the perpendicular from a point, given relative to the corners, is in the triangle.
    fn is_over(&self, from: &[Point; 3]) -> bool {
        self.normal_squared > 0.0 && (0..3).all(|i| dot(from[i], self.inward[i]) >= 0.0)
    }

    /// Squared distance to an edge of a point, given relative to its first corner, and the part of the edge before
    /// the nearest point.
    fn edge_distance(&self, i: usize, from: Point) -> (f64, f64) {
        let s = (dot(from, self.edges[i]) * self.inverses[i]).clamp(0.0, 1.0);
        let off = along(from, self.edges[i], -s);
        (dot(off, off), s)
    }
}

/// Squared distance of a square from a triangle that it does not intersect. The square has its corners in order around it, and
/// lies in a plane normal to an axis; the triangle may have no area.
pub fn from_square(corners: &[Point; 4], t: &Triangle) -> f64 {
    let bound = |a: usize, fold: fn(f64, f64) -> f64| corners.iter().map(|c| c[a]).reduce(fold);
    let clamped = |p: Point| -> Point {
        std::array::from_fn(|a| {
            let (low, high) = (bound(a, f64::min), bound(a, f64::max));
            p[a].clamp(low.expect("four corners"), high.expect("four corners"))
        })
    };
    let squared = |p: Point, q: Point| dot(sub(p, q), sub(p, q));
    let of_corners = corners.iter().map(|&corner| from_point(corner, t).0);
    let of_vertices = t.iter().map(|&vertex| squared(vertex, clamped(vertex)));
    let mut best = of_corners.chain(of_vertices).fold(f64::INFINITY, f64::min);
    for i in 0..4 {
        // An edge without length is a vertex.
        for j in (0..3).filter(|&j| t[j] != t[(j + 1) % 3]) {
            let (p, q) = segments(corners[i], corners[(i + 1) % 4], t[j], t[(j + 1) % 3]);
            best = best.min(squared(p, q));
        }
    }
    best
}

/// Nearest points of two segments (Ericson, Real-Time Collision Detection, section 5.1.9).
fn segments(p: Point, p_end: Point, q: Point, q_end: Point) -> (Point, Point) {
    let (d, e, r) = (sub(p_end, p), sub(q_end, q), sub(p, q));
    let (dd, ee, de) = (dot(d, d), dot(e, e), dot(d, e));
    let (dr, er) = (dot(d, r), dot(e, r));
    let determinant = dd * ee - de * de;
    let clamp = |x: f64| x.clamp(0.0, 1.0);
    let mut s = if determinant > 0.0 { clamp((de * er - dr * ee) / determinant) } else { 0.0 };
    let mut t = (de * s + er) / ee;
    if t < 0.0 {
        (s, t) = (clamp(-dr / dd), 0.0);
    } else if t > 1.0 {
        (s, t) = (clamp((de - dr) / dd), 1.0);
    }
    (along(p, d, s), along(q, e, t))
}

/// The foot of the perpendicular from a point on a triangle's plane, if it is in the triangle. None where the triangle
/// is so thin that its edges are as near and its normal is mostly rounding error.
fn foot(p: Point, t: &Triangle) -> Option<Point> {
    let (u, v) = (sub(t[1], t[0]), sub(t[2], t[0]));
    let n = cross(u, v);
    if dot(n, n) <= 1e-20 * dot(u, u) * dot(v, v) {
        return None;
    }
    let within = |i: usize| dot(cross(sub(t[(i + 1) % 3], t[i]), sub(p, t[i])), n) >= 0.0;
    let height = dot(sub(p, t[0]), n) / dot(n, n);
    (0..3).all(within).then(|| along(p, n, -height))
}

/// The point at `t` times a vector from a point.
pub fn along(p: Point, d: Point, t: f64) -> Point {
    std::array::from_fn(|a| p[a] + t * d[a])
}

/// Difference of two points.
pub fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Scalar product.
pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Length of a vector.
pub fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Vector product.
pub fn cross(u: Point, v: Point) -> Point {
    std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        u[b] * v[c] - u[c] * v[b]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn distances_of_parallel_faces_and_of_crossing_edges() {
        let a = [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]];
        let above = [[1.0, 1.0, 3.0], [2.0, 1.0, 4.0], [1.0, 2.0, 4.0]];
        assert_eq!(nearest(&a, &above), (9.0, [1.0, 1.0, 0.0], [1.0, 1.0, 3.0]));
        let across = [[4.0, -9.0, 2.0], [4.0, 9.0, 2.0], [4.0, 0.0, 9.0]];
        assert_eq!(nearest(&a, &across).0, 4.0);
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_in_its_interior_on_an_edge_or_a_corner() {
        let t = [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]];
        assert_eq!(from_point([1.0, 2.0, 3.0], &t), (9.0, [1.0, 2.0, 0.0]));
        assert_eq!(from_point([3.0, -4.0, 3.0], &t), (25.0, [3.0, 0.0, 0.0]));
        assert_eq!(from_point([-3.0, -4.0, 0.0], &t), (25.0, [0.0, 0.0, 0.0]));
        assert_eq!(from_point([8.0, 8.0, 0.0], &t), (32.0, [4.0, 4.0, 0.0]));
        let segment = [[0.0; 3], [4.0, 0.0, 0.0], [0.0; 3]];
        assert_eq!(from_point([2.0, 3.0, 0.0], &segment), (9.0, [2.0, 0.0, 0.0]));
        assert_eq!(from_point([2.0, 3.0, 6.0], &[[0.0; 3]; 3]).0, 49.0);
    }

    /// The facets of random squares: at any distance, or touching the square's plane.
    fn square() -> impl Strategy<Value = [Point; 4]> {
        (prop::array::uniform3(-9.0f64..9.0), 0.1f64..9.0, 0usize..3).prop_map(
            |(at, edge, axis)| {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(along_u, along_v)| {
                    let mut corner = at;
                    corner[u] += along_u * edge;
                    corner[v] += along_v * edge;
                    corner
                })
            },
        )
    }

    proptest! {
        /// The two triangles of a square, which `nearest` measures otherwise.
        #[test]
        fn the_distance_of_a_square_is_that_of_its_nearer_half(
            square in square(), t in prop::array::uniform3(prop::array::uniform3(-9.0f64..9.0)), kind in 0..4
        ) {
            let shifted = t.map(|[x, y, z]| [x + 40.0, y, z]);
            let t = match kind {
                0 => [shifted[0]; 3],
                1 => [shifted[0], shifted[1], shifted[0]],
                _ => shifted,
            };
            let [a, b, c, d] = square;
            let expected = if kind == 0 {
                // `nearest` needs edges; the foot of a point is in one of the halves.
                from_point(t[0], &[a, b, c]).0.min(from_point(t[0], &[a, c, d]).0)
            } else {
                nearest(&[a, b, c], &t).0.min(nearest(&[a, c, d], &t).0)
            };
            prop_assert!((from_square(&square, &t) - expected).abs() <= 1e-9 * expected);
        }

        #[test]
        fn no_points_of_two_segments_are_nearer_than_the_nearest(
            p in prop::array::uniform2(point()), q in prop::array::uniform2(point()), is_parallel in any::<bool>(),
        ) {
            let q = if is_parallel { [q[0], along(q[0], sub(p[1], p[0]), 0.7)] } else { q };
            prop_assume!(p[0] != p[1] && q[0] != q[1]);
            let (on_p, on_q) = segments(p[0], p[1], q[0], q[1]);
            let least = length(sub(on_p, on_q));
            for ([from, to], at) in [(p, on_p), (q, on_q)] {
                let detour = length(sub(at, from)) + length(sub(to, at)) - length(sub(to, from));
                prop_assert!(detour.abs() < 1e-9, "{:?} is not on its segment", at);
            }
            let part = |i: i32| f64::from(i) / 20.0;
            for (i, j) in (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j))) {
                let a = along(p[0], sub(p[1], p[0]), part(i));
                let b = along(q[0], sub(q[1], q[0]), part(j));
                prop_assert!(least <= length(sub(a, b)) + 1e-9, "{:?} and {:?} are nearer", a, b);
            }
        }

        /// Two points of convex sets are nearest iff the planes through them, normal to their difference, separate the sets.
        #[test]
        fn nearest_points_lie_in_their_triangles_and_separate_them(
            a in prop::array::uniform3(point()), b in prop::array::uniform3(point()), is_parallel in any::<bool>(),
        ) {
            let b = if is_parallel { a } else { b }.map(|[x, y, z]| [x + 20.0, y, z]);
            prop_assume!([&a, &b].iter().all(|t| (0..3).all(|i| t[i] != t[(i + 1) % 3])));
            let (squared, p, q) = nearest(&a, &b);
            prop_assert!((dot(sub(p, q), sub(p, q)) - squared).abs() <= 1e-9 * squared);
            prop_assert!(is_within(p, &a) && is_within(q, &b));
            let is_beyond = |v: &Point, at: Point, to: Point| dot(sub(*v, at), sub(to, at)) <= 1e-6;
            prop_assert!(a.iter().all(|v| is_beyond(v, p, q)) && b.iter().all(|v| is_beyond(v, q, p)));
        }

        #[test]
        fn no_corner_lies_before_the_plane_through_the_nearest_point(
            p in point(), t in prop::array::uniform3(point()), kind in 0..4,
        ) {
            let t = match kind {
                0 => [t[0]; 3],
                1 => [t[0], t[1], t[0]],
                2 => [t[0], t[1], along(t[0], sub(t[1], t[0]), 0.5)],
                _ => t,
            };
            let (squared, foot) = from_point(p, &t);
            prop_assert!((Prepared::new(&t).squared(p) - squared).abs() <= 1e-9 * squared);
            prop_assert!((dot(sub(p, foot), sub(p, foot)) - squared).abs() <= 1e-9 * (1.0 + squared));
            prop_assert!(is_within(foot, &t));
            prop_assert!(t.iter().all(|v| dot(sub(*v, foot), sub(p, foot)) <= 1e-6));
        }
    }

    /// Often with coordinates that coincide with others.
    fn point() -> impl Strategy<Value = Point> {
        let coordinate = prop_oneof![(-9i32..=9).prop_map(f64::from), -9.0..9.0];
        prop::array::uniform3(coordinate)
    }

    /// Whether a point is in a triangle: the triangles that it forms with the edges have no greater area together. A triangle
    /// without area is its longest edge.
    fn is_within(p: Point, t: &Triangle) -> bool {
        let edges = [0, 1, 2].map(|i| (t[i], t[(i + 1) % 3]));
        let area = |a: Point, b: Point, c: Point| length(cross(sub(b, a), sub(c, a)));
        let parts: f64 = edges.iter().map(|&(a, b)| area(p, a, b)).sum();
        let whole = area(t[0], t[1], t[2]);
        let is_on = |&(a, b): &(Point, Point)| {
            length(sub(a, p)) + length(sub(b, p)) <= length(sub(a, b)) + 1e-6
        };
        parts <= whole + 1e-6 && (whole > 1e-3 || edges.iter().any(is_on))
    }
}
