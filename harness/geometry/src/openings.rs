//! Openings: connected sets of open edges, that is, of edges with one facet or its copies, apart from T-junctions.
//!
//! At a T-junction a vertex of one facet lies on an edge of another. Both facets have open edges there, but the surface has no
//! hole. Two open edges that leave a vertex in the same direction cancel along the shorter one, until no such
//! pair is left; what remains bounds openings.
//!
//! The free width of an opening is the least distance of two parallel lines that enclose its points, projected on the plane that they span.
//! A ball that is wider does not pass through a flat opening. Of another one, as of a slot around a pipe, it is an upper bound: two points can
//! go along both sides of the rim, from one end of a direction to the other, and always be in one plane normal to it; a ball that passes
//! between them is at most as wide as they are far apart, so as the rim seen along that direction.

use contract::lattice::{UNITS_PER_EDGE, sorted};
use contract::octant::LEVEL_MAX;
use contract::sets::Sets;
use parry3d_f64::bounding_volume::BoundingVolume as _;

use super::edges::{Edges, Use};
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::tree::{Aabb, Point};
use std::collections::HashSet;

/// A vertex this near to an edge lies on it, in lattice units. The finest cells are 256 units wide.
const TOLERANCE: f64 = 2.0;

/// All openings within the root, widest first: a hole, the rim of a sheet, or several that share a vertex; and the facets at those as wide as a cell.
pub fn openings(input: &Input, edges: &Edges, first: usize) -> (Finding, HashSet<u32>) {
    // Where all facets are copies of one, a surface ends of which every facet is there twice.
    let corners = |of: &Use| edges.corners[of.facet as usize].map(sorted);
    let is_open = |uses: &&[Use]| uses.iter().all(|of| corners(of) == corners(&uses[0]));
    let open = edges.iter().filter(is_open).map(|uses| uses[0]);
    let tolerance = TOLERANCE * input.case.root.edge / UNITS_PER_EDGE as f64;
    let (low, edge) = (input.case.root.origin, input.case.root.edge);
    let mut rims = uncancelled(open.collect(), &edges.points, tolerance);
    // Without a spacing, any may be chosen, up to the finest.
    let (near, finest) = (input.cell.unwrap_or(0.0), input.case.root.edge_of(LEVEL_MAX));
    // A box near by splits leaves beside it, too.
    let cell_in = |extent: &Aabb| input.cell_in(&extent.loosened(near)).unwrap_or(finest);
    // One opening from face to face of the root stays one.
    let mut sets = Sets::new(edges.points.len());
    rims.iter().for_each(|segment| sets.union(segment.ends[0], segment.ends[1]));
    // Where the root cuts a body, its boundary closes the body, also where no leaf fits between them.
    rims.retain(|rim| {
        let ends = rim.ends.map(|v| Point::from(edges.points[v as usize]));
        let cell = cell_in(&Aabb::from_points(ends));
        let is_beyond = |a: usize| {
            let at = ends.map(|end| end[a] - low[a]);
            at.iter().all(|at| *at < cell) || at.iter().all(|at| *at > edge - cell)
        };
        !(0..3).any(is_beyond)
    });
    let mut places = places(&rims, &edges.points, &mut sets);
    let width = |place: &Place| place.width.unwrap_or(0.0);
    places.sort_by(|(a, ..), (b, ..)| width(b).total_cmp(&width(a)).then(a.facets.cmp(&b.facets)));
    let leaks = |(place, extent, _): &&(Place, Aabb, Vec<u32>)| width(place) >= cell_in(extent);
    let torn = places.iter().filter(leaks).flat_map(|(.., facets)| facets).copied().collect();
    let finding = Finding {
        count: places.len() as u64,
        count_changing: places.iter().filter(leaks).count() as u64,
        places: places.into_iter().take(first).map(|(place, ..)| place).collect(),
        ..Finding::new(Kind::Openings)
    };
    (finding, torn)
}

/// The places of the segments of each set, with their bounding boxes, and all facets of each.
fn places(rims: &[Use], points: &[[f64; 3]], sets: &mut Sets) -> Vec<(Place, Aabb, Vec<u32>)> {
    let mut labelled: Vec<(u32, Use)> =
        rims.iter().map(|segment| (sets.root(segment.ends[0]), *segment)).collect();
    labelled.sort_unstable();
    let place = |component: &[(u32, Use)]| {
        let ends = component.iter().flat_map(|(_, segment)| segment.ends);
        let ends: Vec<[f64; 3]> = ends.map(|v| points[v as usize]).collect();
        let sum = |a: usize| ends.iter().map(|p| p[a]).sum::<f64>();
        let mut facets: Vec<u32> = component.iter().map(|(_, segment)| segment.facet).collect();
        facets.sort_unstable();
        facets.dedup();
        let centre = std::array::from_fn(|a| sum(a) / ends.len() as f64);
        let extent = Aabb::from_points(ends.iter().map(|&end| Point::from(end)));
        let (width, is_bound) = free_width(&ends);
        let place = Place::new(facets.clone(), centre);
        (Place { width: Some(width), is_bound, ..place }, extent, facets)
    };
    labelled.chunk_by(|a, b| a.0 == b.0).map(place).collect()
}

/// A vertex with more segments is left unchanged.
const SEGMENTS_MAX: usize = 256;

/// The segments that remain after cancellation. A vertex lies on a segment if it is within `tolerance` of it.
pub fn uncancelled(segments: Vec<Use>, points: &[[f64; 3]], tolerance: f64) -> Vec<Use> {
    let point = |v: u32| Point::from(points[v as usize]);
    let mut at: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (i, segment) in segments.iter().enumerate() {
        segment.ends.iter().for_each(|&v| at[v as usize].push(i as u32));
    }
    let mut segments: Vec<Option<Use>> = segments.into_iter().map(Some).collect();
    let mut waiting: Vec<u32> = (0..points.len() as u32).rev().collect();
    while let Some(v) = waiting.pop() {
        at[v as usize].retain(|&i| segments[i as usize].is_some_and(|s| s.ends.contains(&v)));
        let end = |i: u32| {
            let ends = segments[i as usize].expect("retained").ends;
            ends[usize::from(ends[0] == v)]
        };
        let along = |&i: &u32| (i, point(end(i)) - point(v));
        let leaving: Vec<(u32, Point)> = at[v as usize].iter().map(along).collect();
        let Some((long, short)) = overlap(&leaving, tolerance) else { continue };
        let (far, near) = (end(long), end(short));
        segments[short as usize] = None;
        let rest = segments[long as usize].filter(|_| far != near);
        segments[long as usize] = rest.map(|s| Use { ends: [near, far], ..s });
        at[near as usize].push(long);
        waiting.extend([v, near, far]);
    }
    segments.into_iter().flatten().collect()
}

/// Two of the segments that leave a vertex, with their vectors from it, in the same direction, the longer first.
fn overlap(leaving: &[(u32, Point)], tolerance: f64) -> Option<(u32, u32)> {
    if leaving.len() > SEGMENTS_MAX {
        return None;
    }
    for (n, &(i, p)) in leaving.iter().enumerate() {
        for &(j, q) in &leaving[n + 1..] {
            let is_longer = p.length_squared() >= q.length_squared();
            let (long, short) = if is_longer { (p, q) } else { (q, p) };
            let t = short.dot(long) / long.length_squared();
            if t > 0.0 && (short - t * long).length() <= tolerance {
                return Some(if is_longer { (i, j) } else { (j, i) });
            }
        }
    }
    None
}

/// Directions on either side of the middle one that are tried at once.
const STEPS: i32 = 200;
/// Times that directions are tried, the next time between the neighbours of the best. The first leaves an error of 4 % at most; the
/// others make it small where the best direction is not one of two that are nearly as good.
const ROUNDS: usize = 4;

/// Depth of a rim across its plane, in widths, from which on it is not flat. The rounding of vertices is less.
const FLAT: f64 = 1e-3;

/// The free width of a set of at least one point, the ends of segments in turn, or slightly more, and whether it is an upper bound, as the points are not in one plane.
fn free_width(points: &[[f64; 3]]) -> (f64, bool) {
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
        return (0.0, false);
    }
    let v = across / height;
    let extent = |along: Point| {
        let heights = points.iter().map(|&p| (p - from).dot(along));
        let (low, high) = heights.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let width = |angle: f64| extent(v * angle.cos() + u * angle.sin());
    // Across `v`, the points are at most twice as wide as the height; at a greater angle, `along` alone is wider.
    let (mut best, mut reach) = ((width(0.0), 0.0), (2.0 * height / length).min(1.0).asin());
    for _ in 0..ROUNDS {
        let angles =
            (-STEPS..=STEPS).map(|step| best.1 + reach * f64::from(step) / f64::from(STEPS));
        let tried = angles.map(|angle| (width(angle), angle));
        best = tried.fold(best, |best, next| if next.0 < best.0 { next } else { best });
        reach /= f64::from(STEPS);
    }
    if extent(u.cross(v)) <= FLAT * best.0 {
        return (best.0, false);
    }
    let seen_along = |u: Point| {
        let v = farthest(&|p| (p - from).reject_from_normalized(u)).normalize_or_zero();
        extent(v).hypot(extent(u.cross(v)))
    };
    let segments = points.chunks_exact(2).map(|ends| ends[1] - ends[0]);
    let longest = segments.max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(along);
    let between_lines = u * best.1.cos() - v * best.1.sin();
    let ways = [u, between_lines, longest.normalize_or(u)];
    (ways.map(seen_along).into_iter().fold(f64::MAX, f64::min), true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points on the x axis but the last.
    const POINTS: [[f64; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
    ];

    fn rest(ends: &[[u32; 2]]) -> Vec<[u32; 2]> {
        let sorted = |s: &Use| [s.ends[0].min(s.ends[1]), s.ends[0].max(s.ends[1])];
        let segments = ends.iter().map(|&ends| Use { ends, facet: 0, is_down: false }).collect();
        uncancelled(segments, &POINTS, 1e-9).iter().map(sorted).collect()
    }

    #[test]
    fn a_long_edge_cancels_with_its_parts() {
        assert_eq!(rest(&[[0, 4], [1, 0], [1, 3], [4, 3]]), [] as [[u32; 2]; 0]);
        // Both sides are divided, at different vertices.
        assert_eq!(rest(&[[0, 2], [2, 4], [0, 1], [1, 3], [3, 4]]), [] as [[u32; 2]; 0]);
    }

    #[test]
    fn a_missing_part_and_a_triangle_remain() {
        assert_eq!(rest(&[[0, 4], [0, 1], [3, 4]]), [[1, 3]]);
        assert_eq!(rest(&[[0, 4], [4, 5], [5, 0]]).len(), 3);
        // Opposite directions at vertex 2.
        assert_eq!(rest(&[[0, 2], [2, 4]]).len(), 2);
        // An edge across another one is no part of it, however short it is.
        let across = [[0, 1], [0, 5]].map(|ends| Use { ends, facet: 0, is_down: false });
        assert_eq!(uncancelled(across.to_vec(), &POINTS, 1.5).len(), 2);
    }

    fn circle(n: usize, radius: f64) -> Vec<[f64; 3]> {
        let point = |i: usize| {
            let (sin, cos) = (i as f64 * std::f64::consts::TAU / n as f64).sin_cos();
            [radius * cos, radius * sin * 0.6, radius * sin * 0.8]
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn a_slit_is_as_wide_as_its_short_side() {
        let slit = free_width(&[[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.0, 0.5], [0.0, 0.0, 0.5]]).0;
        assert!((slit - 0.5).abs() < 1e-9, "{slit}");
    }

    #[test]
    fn a_circle_is_as_wide_as_its_diameter_for_few_and_many_points() {
        for n in [64, 1000, 5000] {
            let width = free_width(&circle(n, 2.0)).0;
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
            let (found, is_bound) = free_width(&points);
            prop_assert!(!is_bound);
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
        let rim = free_width(&flat.map(|[x, y]| [f64::from(x), f64::from(y), 3.0])).0;
        // Of (-8, 4), (-7, 2) and (-2, -8), from (4, 4).
        assert!((rim - 24.0 / 5.0f64.sqrt()).abs() < 1e-9, "{rim:?}");
    }

    #[test]
    fn points_of_one_line_have_no_width() {
        let line = free_width(&[[0.0; 3], [0.1, 0.2, 0.3], [0.3, 0.6, 0.9]]);
        assert_eq!(line, (0.0, false));
        assert_eq!(free_width(&[[7.0; 3]; 2]), (0.0, false));
    }
}
