//! Moves the points of a path to the middle of a long passage.
//!
//! A grid is searched between the points where the path enters and leaves it. In a passage longer than the grid these lie off the
//! middle, like all points that are centres of leaves, and limit what the grid can find. So every point is moved to where
//! the passage is widest, in the plane across the path.

use super::clearance::{Clearance, PRECISION, Point, Spot, nearest};
use crate::geometry::distance::{Prepared, dot, length, sub};

/// Places that are tried around a point.
const AROUND: u32 = 16;

/// Angle between successive trials, so that no direction is missed: the golden angle.
const TURN: f64 = 2.399_963_229_728_653;

/// Moves of a point at most.
const MOVES_MAX: usize = 200;

/// A point moves by no more than this, in clearances.
const REACH: f64 = 2.0;

/// More facets than this near a point are searched in the tree.
const FACETS_FEW: usize = 1024;

/// Distance of successive points that need none between them, in clearances.
const GAP: f64 = 0.5;

/// Points between two, at most: 2^8 - 1.
const HALVINGS_MAX: u32 = 8;

/// Clearances near a point.
struct Near<'a> {
    clearance: &'a Clearance<'a>,
    centre: Point,
    /// The triangles that can be the nearest, with their distances from the centre, nearest first; none if they are many.
    triangles: Vec<(Prepared, f64)>,
    /// The triangle that refused a place last, and probably refuses the next.
    obstacle: usize,
}

impl Near<'_> {
    /// The clearance at a place if it is greater than `least`.
    fn beyond(&mut self, at: Point, least: f64) -> Option<f64> {
        let Some((obstacle, _)) = self.triangles.get(self.obstacle) else {
            return Some(self.clearance.at(at, f64::INFINITY))
                .filter(|&clearance| clearance > least);
        };
        if obstacle.squared(at) <= least * least {
            return None;
        }
        let triangles = self.triangles.iter().map(|(triangle, from)| (triangle, *from));
        let clearance = nearest(triangles, at, length(sub(at, self.centre)), least);
        clearance.map_err(|obstacle| self.obstacle = obstacle).ok()
    }
}

/// The point of greatest clearance near a point, in the plane through it that has this normal, or a point of at least the
/// clearance `open`, which is not exact. Every move ends in the ball around the point before it.
fn across(from: Point, normal: Point, open: f64, clearance: &Clearance) -> Spot {
    let start = clearance.at(from, f64::INFINITY);
    let triangles = clearance.near(from, REACH * start, open, FACETS_FEW);
    let triangles = triangles.unwrap_or_default();
    let mut near = Near { clearance, centre: from, triangles, obstacle: 0 };
    let [u, v] = plane(normal);
    let step_min = PRECISION / 2.0 * start;
    let mut best = Spot { at: from, clearance: start, step: step_min, apart: 0.0 };
    let (mut step, mut turn) = (start / 2.0, 0.0);
    for _ in 0..MOVES_MAX {
        if step < step_min || best.clearance >= open {
            break;
        }
        let before = best;
        for i in 0..AROUND {
            let angle = turn + f64::from(i) * std::f64::consts::TAU / f64::from(AROUND);
            let (sin, cos) = angle.sin_cos();
            let at = std::array::from_fn(|a| before.at[a] + step * (cos * u[a] + sin * v[a]));
            if length(sub(at, from)) <= REACH * start
                && let Some(clearance) = near.beyond(at, best.clearance)
            {
                best = Spot { at, clearance, step: step_min, apart: 0.0 };
            }
        }
        if best == before {
            step /= 2.0;
        }
        turn += TURN;
    }
    best
}

/// Two unit vectors across a direction.
fn plane(normal: Point) -> [Point; 2] {
    let least = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let u = unit(cross(normal, other));
    [u, unit(cross(normal, u))]
}

fn cross(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn unit(a: Point) -> Point {
    let length = dot(a, a).sqrt();
    if length > 0.0 { a.map(|c| c / length) } else { [0.0; 3] }
}

/// The widest place near a point, by moves in planes across the axes.
pub fn widest_near(at: Point, clearance: &Clearance) -> Spot {
    let mut best = across(at, [1.0, 0.0, 0.0], f64::INFINITY, clearance);
    for axis in [1, 2, 0, 1, 2] {
        let mut normal = [0.0; 3];
        normal[axis] = 1.0;
        best = across(best.at, normal, f64::INFINITY, clearance);
    }
    best
}

/// The path with points less than `below` from the facets moved to the middle, and with points between those that are far apart.
/// Clearances from `open` on are not exact.
pub fn centred(spots: &[Spot], below: f64, open: f64, clearance: &Clearance) -> Vec<Spot> {
    let passage = Passage { below, open, clearance };
    let mut path: Vec<Spot> = Vec::new();
    for (i, &spot) in spots.iter().enumerate() {
        let moved = passage.moved(spot, direction(spots, i));
        if let Some(&last) = path.last() {
            passage.fill(last, moved, HALVINGS_MAX, &mut path);
        }
        path.push(moved);
    }
    path
}

struct Passage<'a> {
    below: f64,
    open: f64,
    clearance: &'a Clearance<'a>,
}

impl Passage<'_> {
    fn moved(&self, spot: Spot, direction: Point) -> Spot {
        match spot.clearance < self.below {
            true => across(spot.at, direction, self.open, self.clearance),
            false => spot,
        }
    }

    /// Appends points between two, without them.
    fn fill(&self, from: Spot, to: Spot, halvings: u32, path: &mut Vec<Spot>) {
        let (gap, least) = (sub(to.at, from.at), from.clearance.min(to.clearance));
        if halvings == 0 || least >= self.below || length(gap) <= GAP * least {
            return;
        }
        let at = std::array::from_fn(|a| (from.at[a] + to.at[a]) / 2.0);
        let clearance = self.clearance.at(at, f64::INFINITY);
        let middle = self.moved(Spot { at, clearance, step: f64::INFINITY, apart: 0.0 }, gap);
        self.fill(from, middle, halvings - 1, path);
        path.push(middle);
        self.fill(middle, to, halvings - 1, path);
    }
}

/// The direction of the path at a point: between the points before and after it that are at least its clearance away.
fn direction(spots: &[Spot], i: usize) -> Point {
    let is_far = |spot: &&Spot| length(sub(spot.at, spots[i].at)) >= spots[i].clearance;
    let before = spots[..i].iter().rev().find(is_far).or(spots.first());
    let after = spots[i..].iter().find(is_far).or(spots.last());
    match (before, after) {
        (Some(before), Some(after)) => sub(after.at, before.at),
        _ => [1.0, 0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::FacetLattice;
    use proptest::prelude::*;

    /// The sides of a box with these edges and a corner in the origin.
    fn box_of(edges: [i64; 3]) -> Vec<FacetLattice> {
        let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 1 { edges[a] } else { 0 });
        let sides =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
        sides.into_iter().flat_map(halves).map(|facet| facet.map(corner)).collect()
    }

    proptest! {
        #[test]
        fn a_plane_has_two_unit_vectors_across_its_normal(normal in prop::array::uniform3(-9.0f64..9.0)) {
            let [u, v] = plane(normal);
            for (product, expected) in [
                (dot(u, u), 1.0), (dot(v, v), 1.0), (dot(u, v), 0.0), (dot(u, normal), 0.0), (dot(v, normal), 0.0),
            ] {
                prop_assert!((product - expected).abs() < 1e-9, "{u:?}, {v:?}");
            }
        }

        #[test]
        fn the_widest_place_near_a_point_is_as_wide_as_it_says_and_not_narrower_than_the_point(
            edges in prop::array::uniform3(9_000i64..11_000), at in prop::array::uniform3(0.2f64..0.8),
        ) {
            let facets = box_of(edges);
            let clearance = Clearance::new(&facets);
            let at = [0, 1, 2].map(|a| at[a] * edges[a] as f64);
            let (start, found) = (clearance.at(at, f64::INFINITY), widest_near(at, &clearance));
            prop_assert_eq!(found.clearance, clearance.at(found.at, f64::INFINITY));
            prop_assert!(found.clearance >= start, "{found:?} from {start}");
        }

        /// A path that enters and leaves a duct off its middle.
        #[test]
        fn a_path_through_a_duct_is_moved_to_its_middle(
            from in prop::array::uniform2(300.0f64..700.0), to in prop::array::uniform2(300.0f64..700.0),
        ) {
            let duct = &box_of([10_000, 1_000, 1_000])[..8];
            let clearance = Clearance::new(duct);
            let spot = |x: f64, [y, z]: [f64; 2]| {
                Spot { at: [x, y, z], clearance: clearance.at([x, y, z], f64::INFINITY), step: f64::INFINITY, apart: 0.0 }
            };
            let path = centred(&[spot(2_000.0, from), spot(8_000.0, to)], 600.0, f64::INFINITY, &clearance);
            prop_assert!(path.iter().all(|spot| spot.clearance > 498.0), "{path:?}");
            prop_assert!(path.windows(2).all(|pair| pair[0].at[0] < pair[1].at[0]), "{path:?}");
            let gaps = path.windows(2).map(|pair| length(sub(pair[1].at, pair[0].at)));
            prop_assert!(gaps.fold(0.0, f64::max) <= 0.5 * 500.0, "{path:?}");
            prop_assert!(path.len() < 60, "{} points", path.len());
            // What is wide enough stays.
            let ends = [spot(2_000.0, from), spot(8_000.0, to)];
            prop_assert_eq!(centred(&ends, 100.0, f64::INFINITY, &clearance), ends);
        }
    }
}
