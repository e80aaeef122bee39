//! The plane of a picture, and the surface of a body in a view in three dimensions.
//!
//! Triangles are painted from the farthest to the nearest. Large ones are divided, so that one of them is either before or behind the
//! slice, and the order by centroids is right. Vertices are rounded to points of the page, which leaves no gaps: triangles that
//! become lines are left out, and of those at one place the nearest is kept.

use super::Planar;
use contract::case::Facet;
use geometry::tree::Point;

/// Greatest number of triangles: about three megabytes of SVG.
const FACES_MAX: usize = 40_000;
/// Edges of the largest triangle in an edge of the window.
const DIVISIONS: f64 = 32.0;
/// Points of the page in an edge of the window.
const POINTS: f64 = 1600.0;

/// How space is shown on the plane of the picture: the directions to the right, upwards and towards the reader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection([[f64; 3]; 3]);

/// A triangle in the plane of the picture, its corners counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Its corners.
    pub corners: [Planar; 3],
    /// 0 where light falls along it, 1 where it falls on it.
    pub light: f64,
    /// Whether it is before the slice.
    pub is_before: bool,
}

impl Projection {
    /// From the left, from above and from the front, each by an angle of less than 60 degrees: every plane normal to an axis is visible.
    pub const OBLIQUE: Self = Self([[0.81, -0.59, 0.0], [0.31, 0.42, 0.85], [-0.5, -0.69, 0.52]]);

    /// Along the normal of two axes.
    pub fn along(axes: [usize; 2]) -> Self {
        let unit = |axis: usize| std::array::from_fn(|a| if a == axis { 1.0 } else { 0.0 });
        Self([unit(axes[0]), unit(axes[1]), unit(3 - axes[0] - axes[1])])
    }

    /// A point in the plane of the picture.
    pub fn planar(&self, at: [f64; 3]) -> Planar {
        [0, 1].map(|i| (0..3).map(|a| self.0[i][a] * at[a]).sum())
    }

    fn toward(&self) -> Point {
        Point::from_array(self.0[2])
    }
}

/// The faces of the facets in a window from the farthest to the nearest, before and behind a plane at a coordinate of an axis.
pub fn surface(
    facets: &[Facet],
    window: &[[f64; 3]; 2],
    (axis, plane): (usize, f64),
    projection: &Projection,
) -> Vec<Face> {
    let edge = (0..3).map(|a| window[1][a] - window[0][a]).fold(0.0, f64::max);
    let toward = projection.toward();
    let light = (toward * 2.0 + Point::new(0.6, -0.5, 1.0)).normalize();
    let mut parts = Vec::new();
    for facet in facets {
        let corners = facet.map(|corner| Point::from_array(corner.map(f64::from)));
        divide(corners, window, (axis, plane), edge / DIVISIONS, &mut parts);
    }
    let mut step = edge / POINTS;
    loop {
        let seen = |&[a, b, c]: &[Point; 3]| {
            let rounded =
                |p: Point| projection.planar(p.to_array()).map(|c| (c / step).round() as i64);
            let mut at = [a, b, c].map(rounded);
            let side = |i: usize| [0, 1].map(|k| at[i][k] - at[0][k]);
            let area = side(1)[0] * side(2)[1] - side(1)[1] * side(2)[0];
            if area < 0 {
                at.swap(1, 2);
            }
            let centroid = (a + b + c) / 3.0;
            let face = Face {
                corners: at.map(|corner| corner.map(|c| c as f64 * step)),
                light: (b - a).cross(c - a).normalize_or_zero().dot(light).abs(),
                is_before: (centroid[axis] - plane) * toward[axis] > 0.0,
            };
            at.sort_unstable();
            (area != 0).then_some((at, centroid.dot(toward), face))
        };
        let mut faces: Vec<_> = parts.iter().filter_map(seen).collect();
        faces.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        faces.dedup_by_key(|(at, ..)| *at);
        if faces.len() <= FACES_MAX {
            faces.sort_by(|a, b| a.1.total_cmp(&b.1));
            return faces.into_iter().map(|(.., face)| face).collect();
        }
        step *= 2.0;
    }
}

/// The parts of a triangle that meet the window, whose edges have at most this length, or a tenth of it where the plane cuts them.
fn divide(
    corners: [Point; 3],
    window: &[[f64; 3]; 2],
    (axis, plane): (usize, f64),
    length: f64,
    parts: &mut Vec<[Point; 3]>,
) {
    let is_beside = |a: usize| {
        corners.iter().all(|c| c[a] < window[0][a]) || corners.iter().all(|c| c[a] > window[1][a])
    };
    if (0..3).any(is_beside) {
        return;
    }
    let edge = |i: usize| (corners[(i + 1) % 3] - corners[i]).length();
    let longest = (0..3).max_by(|&i, &j| edge(i).total_cmp(&edge(j))).unwrap_or(0);
    let is_before = corners.map(|c| c[axis] < plane);
    let is_cut = is_before.contains(&true) && is_before.contains(&false);
    if edge(longest) <= if is_cut { length / 10.0 } else { length } {
        return parts.push(corners);
    }
    let [a, b, c] = [0, 1, 2].map(|i| corners[(longest + i) % 3]);
    let middle = (a + b) / 2.0;
    divide([a, middle, c], window, (axis, plane), length, parts);
    divide([middle, b, c], window, (axis, plane), length, parts);
}
