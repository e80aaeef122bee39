//! The free width of an opening: the least width of the convex hull of its points, projected on the plane that they span. A ball that is
//! wider does not pass through a flat opening.

use super::tree::Point;

/// Of more vertices of a hull, only some are used, evenly spread.
const VERTICES_MAX: usize = 1024;

/// The width of a set of at least one point.
pub fn width(points: &[[f64; 3]]) -> f64 {
    let points: Vec<Point> = points.iter().map(|&p| Point::from(p)).collect();
    let (from, to) = farthest(&points);
    let diameter = from.distance(to);
    if diameter == 0.0 {
        return 0.0;
    }
    let u = (to - from) / diameter;
    let across = |p: &Point| (*p - from) - (*p - from).dot(u) * u;
    let far = points.iter().map(across).max_by(|a, b| a.length().total_cmp(&b.length()));
    let far = far.expect("at least one point");
    let height = far.length();
    // Rounding leaves points of one line at a distance from it.
    if height <= 1e-12 * diameter {
        return 0.0;
    }
    let v = far / height;
    let flat = points.iter().map(|p| [(*p - from).dot(u), (*p - from).dot(v)]).collect();
    width_of_hull(&hull(flat), diameter)
}

/// Two points neither of which has a farther one than the other.
fn farthest(points: &[Point]) -> (Point, Point) {
    let from = |p: Point| {
        let farthest = points.iter().max_by(|a, b| p.distance(**a).total_cmp(&p.distance(**b)));
        *farthest.expect("at least one point")
    };
    let (mut p, mut q) = (points[0], from(points[0]));
    loop {
        let next = from(q);
        if next.distance(q) <= p.distance(q) {
            return (p, q);
        }
        (p, q) = (q, next);
    }
}

/// The convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let mut hull: Vec<[f64; 2]> = Vec::new();
    let forward: Vec<_> = points.clone();
    points.reverse();
    for chain in [forward, points] {
        let start = hull.len();
        for p in chain {
            while hull.len() >= start + 2
                && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
    }
    hull
}

/// The least distance of two parallel lines that enclose a convex polygon of this diameter; one of them contains an edge.
fn width_of_hull(hull: &[[f64; 2]], diameter: f64) -> f64 {
    let vertices: Vec<_> = hull.iter().step_by(hull.len().div_ceil(VERTICES_MAX)).collect();
    let across = |i: usize| {
        let (p, q) = (vertices[i], vertices[(i + 1) % vertices.len()]);
        let length = (q[0] - p[0]).hypot(q[1] - p[1]);
        // The direction of a shorter edge is a rounding error.
        if length <= 1e-9 * diameter {
            return f64::INFINITY;
        }
        let heights = vertices.iter().map(|r| turn(*p, *q, **r) / length);
        let (low, high) = heights.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    (0..vertices.len()).map(across).fold(f64::INFINITY, f64::min)
}

/// Twice the signed area of a triangle.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn circle(n: usize, radius: f64) -> Vec<[f64; 3]> {
        let point = |i: usize| {
            let (sin, cos) = (i as f64 * std::f64::consts::TAU / n as f64).sin_cos();
            [radius * cos, radius * sin * 0.6, radius * sin * 0.8]
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn a_slit_is_as_wide_as_its_short_side() {
        let slit = width(&[[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.0, 0.5], [0.0, 0.0, 0.5]]);
        assert!((slit - 0.5).abs() < 1e-12, "{slit}");
    }

    #[test]
    fn a_circle_is_as_wide_as_its_diameter_for_few_and_many_points() {
        for n in [64, 1000, 5000] {
            let width = width(&circle(n, 2.0));
            assert!((3.96..=4.0 + 1e-12).contains(&width), "{n}: {width}");
        }
    }

    proptest! {
        /// The least distance of two parallel lines, one through two of the points, with all points between them.
        #[test]
        fn the_width_of_flat_points_is_that_of_a_search_among_all_pairs(
            flat in prop::collection::vec(prop::array::uniform2(-9i32..9), 1..14), turn in 0usize..3,
        ) {
            let flat: Vec<[f64; 2]> = flat.into_iter().map(|p| p.map(f64::from)).collect();
            let mut least = f64::INFINITY;
            for (i, &p) in flat.iter().enumerate() {
                for &q in &flat[i + 1..] {
                    let length = (q[0] - p[0]).hypot(q[1] - p[1]);
                    let heights: Vec<f64> = flat.iter().map(|&r| turn_of(p, q, r) / length).collect();
                    let (low, high) = heights.iter().fold((0.0f64, 0.0f64), |(l, h), &x| (l.min(x), h.max(x)));
                    if length > 0.0 && low.abs().min(high) < 1e-9 {
                        least = least.min(high - low);
                    }
                }
            }
            let points: Vec<[f64; 3]> = flat.iter().map(|&[x, y]| {
                let mut at = [x, y, 3.0];
                at.rotate_left(turn);
                at
            }).collect();
            let found = width(&points);
            let expected = if least.is_finite() { least } else { 0.0 };
            prop_assert!((found - expected).abs() < 1e-9, "{} instead of {}", found, expected);
        }
    }

    fn turn_of(p: [f64; 2], q: [f64; 2], r: [f64; 2]) -> f64 {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    }

    #[test]
    fn a_rim_with_three_points_on_a_line_is_as_wide_as_the_others_are_far_from_it() {
        let flat = [[-3, -6], [-8, 4], [-2, -8], [4, 4], [6, -8], [-7, 2]];
        let rim = width(&flat.map(|[x, y]| [f64::from(x), f64::from(y), 3.0]));
        // Of (-8, 4), (-7, 2) and (-2, -8), from (4, 4).
        assert!((rim - 24.0 / 5.0f64.sqrt()).abs() < 1e-9, "{rim:?}");
    }

    #[test]
    fn points_of_one_line_have_no_width() {
        let line = width(&[[0.0; 3], [0.1, 0.2, 0.3], [0.3, 0.6, 0.9]]);
        assert_eq!(line, 0.0);
        assert_eq!(width(&[[7.0; 3]; 2]), 0.0);
    }
}
