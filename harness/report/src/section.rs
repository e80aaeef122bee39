//! Sections of boxes and facets with a rectangular window in a plane.

type Point = [f64; 3];

/// A point in a plane's coordinates.
pub type Planar = [f64; 2];

/// A rectangle in a plane.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Its centre.
    pub centre: Point,
    /// Unit vectors in the plane, perpendicular to each other.
    pub axes: [Point; 2],
    /// Half of its edge along each axis.
    pub half: [f64; 2],
}

impl Window {
    /// A point's projection on the plane, relative to the centre.
    pub fn project(&self, at: Point) -> Planar {
        self.axes.map(|axis| dot(sub(at, self.centre), axis))
    }

    /// The polygon in which the plane cuts a box, within the window; empty if it misses the window.
    pub fn of_box(&self, low: Point, high: Point) -> Vec<Planar> {
        let [h, v] = self.half;
        let mut polygon = vec![[-h, -v], [h, -v], [h, v], [-h, v]];
        for a in 0..3 {
            let along =
                |p: Planar| self.centre[a] + p[0] * self.axes[0][a] + p[1] * self.axes[1][a];
            polygon = clipped(&polygon, |p| along(p) - low[a]);
            polygon = clipped(&polygon, |p| high[a] - along(p));
        }
        polygon
    }

    /// The segment in which the plane cuts a facet, within the window; `None` if it misses the window.
    pub fn of_facet(&self, facet: [Point; 3]) -> Option<[Planar; 2]> {
        let [u, v] = self.axes;
        let normal = std::array::from_fn(|a| {
            u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3]
        });
        let height = facet.map(|corner| dot(sub(corner, self.centre), normal));
        let mut ends = Vec::new();
        for i in 0..3 {
            let (j, p, q) = ((i + 1) % 3, facet[i], facet[(i + 1) % 3]);
            if (height[i] < 0.0) != (height[j] < 0.0) {
                let t = height[i] / (height[i] - height[j]);
                ends.push(self.project(std::array::from_fn(|a| p[a] + t * (q[a] - p[a]))));
            }
        }
        self.of_segment([*ends.first()?, *ends.get(1)?])
    }

    /// The part of a segment in the plane that is in the window.
    pub fn of_segment(&self, [from, to]: [Planar; 2]) -> Option<[Planar; 2]> {
        let (mut start, mut end) = (0.0f64, 1.0f64);
        for a in 0..2 {
            for sign in [-1.0, 1.0] {
                // Inside where `inside` is not negative.
                let inside = |p: Planar| self.half[a] - sign * p[a];
                let (first, last) = (inside(from), inside(to));
                if first < 0.0 && last < 0.0 {
                    return None;
                }
                let crossing = first / (first - last);
                if first < 0.0 {
                    start = start.max(crossing);
                } else if last < 0.0 {
                    end = end.min(crossing);
                }
            }
        }
        let at = |t: f64| [0, 1].map(|a| from[a] + t * (to[a] - from[a]));
        (start <= end).then(|| [at(start), at(end)])
    }
}

/// The part of a convex polygon where a linear function is not negative (Sutherland and Hodgman).
fn clipped(polygon: &[Planar], inside: impl Fn(Planar) -> f64) -> Vec<Planar> {
    let mut kept = Vec::new();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (at_p, at_q) = (inside(p), inside(q));
        if at_p >= 0.0 {
            kept.push(p);
        }
        if (at_p >= 0.0) != (at_q >= 0.0) {
            let t = at_p / (at_p - at_q);
            kept.push([0, 1].map(|a| p[a] + t * (q[a] - p[a])));
        }
    }
    kept
}

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Point, b: Point) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Window =
        Window { centre: [0.5; 3], axes: [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]], half: [2.0; 2] };

    fn area(polygon: &[Planar]) -> f64 {
        let next = |i: usize| polygon[(i + 1) % polygon.len()];
        let sum: f64 = (0..polygon.len())
            .map(|i| polygon[i][0] * next(i)[1] - next(i)[0] * polygon[i][1])
            .sum();
        sum / 2.0
    }

    #[test]
    fn an_oblique_plane_cuts_a_cube_in_a_polygon() {
        // The plane leaves the unit cube through its upper and lower face: 1 / 0.8 long.
        assert!((area(&WINDOW.of_box([0.0; 3], [1.0; 3])) - 1.25).abs() < 1e-12);
        assert!((area(&WINDOW.of_box([-9.0; 3], [9.0; 3])) - 16.0).abs() < 1e-12);
        assert!(WINDOW.of_box([3.0, 0.0, 0.0], [4.0, 1.0, 1.0]).is_empty());
    }

    #[test]
    fn a_facet_is_cut_in_a_segment_that_ends_at_the_window() {
        // In the plane x = 1, far beyond the window.
        let facet = [[1.0, -90.0, -90.0], [1.0, 90.0, -90.0], [1.0, 0.0, 90.0]];
        let [p, q] = WINDOW.of_facet(facet).unwrap();
        assert!((p[0] - 0.5).abs() < 1e-9 && (q[0] - 0.5).abs() < 1e-9);
        assert!(((p[1] - q[1]).abs() - 4.0).abs() < 1e-9, "{p:?} {q:?}");
        assert!(WINDOW.of_facet(facet.map(|[_, y, z]| [4.0, y, z])).is_none());
        assert!(WINDOW.of_facet(facet.map(|[x, y, z]| [x, y, z + 300.0])).is_none());
    }
}
