//! The free width of an opening: the least distance of two parallel lines that enclose its points, projected on the plane that they span.
//! A ball that is wider does not pass through a flat opening.

use super::tree::Point;

/// Directions on either side of the middle one that are tried at once.
const STEPS: i32 = 200;
/// Times that directions are tried, the next time between the neighbours of the best. The first leaves an error of 4 % at most; the
/// others make it small where the best direction is not one of two that are nearly as good.
const ROUNDS: usize = 4;

/// The width of a set of at least one point, or slightly more.
pub fn width(points: &[[f64; 3]]) -> f64 {
    let points: Vec<Point> = points.iter().map(|&p| Point::from(p)).collect();
    let farthest = |offset: &dyn Fn(Point) -> Point| {
        let offsets = points.iter().map(|&p| offset(p));
        offsets.max_by(|a, b| a.length().total_cmp(&b.length())).expect("at least one point")
    };
    let from = points[0] + farthest(&|p| p - points[0]);
    let along = farthest(&|p| p - from);
    let u = along.normalize_or_zero();
    let across = farthest(&|p| (p - from).reject_from_normalized(u));
    let (length, height) = (along.length(), across.length());
    // Rounding leaves points of one line at a distance from it.
    if height <= 1e-12 * length {
        return 0.0;
    }
    let v = across / height;
    let width = |angle: f64| {
        let heights = points.iter().map(|&p| (p - from).dot(v * angle.cos() + u * angle.sin()));
        let (low, high) = heights.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    // Across `v`, the points are at most twice as wide as the height; at a greater angle, `along` alone is wider.
    let (mut best, mut reach) = ((width(0.0), 0.0), (2.0 * height / length).min(1.0).asin());
    for _ in 0..ROUNDS {
        let angles =
            (-STEPS..=STEPS).map(|step| best.1 + reach * f64::from(step) / f64::from(STEPS));
        let tried = angles.map(|angle| (width(angle), angle));
        best = tried.fold(best, |best, next| if next.0 < best.0 { next } else { best });
        reach /= f64::from(STEPS);
    }
    best.0
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
        assert!((slit - 0.5).abs() < 1e-9, "{slit}");
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
        fn the_width_of_flat_points_is_at_most_4_percent_above_that_of_a_search_among_all_pairs(
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
            let range = expected - 1e-9..=1.04 * expected + 1e-9;
            prop_assert!(range.contains(&found), "{} instead of {}", found, expected);
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
