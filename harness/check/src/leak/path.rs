//! A path through leaves as points with the free width at each, and its narrowest place.
//!
//! The free width at a point is the diameter of the largest ball centred there that no facet enters: twice the distance
//! to the nearest facet. Centres of leaves are not the middle of an opening, so points in narrow places are moved
//! across the path to where the ball is largest. The narrowest place is then the least of these balls along the path:
//! the largest ball that passes the opening.

use super::clearance::{Clearance, Point};
use super::leaves::{Leaves, centre, nearest_boundary, shared_face_centre};
use super::search::Goal;
use crate::geometry::distance::{along, cross, dot, sub};
use contract::lattice::UNITS_PER_EDGE;

/// A point and its distance to the nearest facet, in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The point.
    pub at: Point,
    /// The distance: half the free width.
    pub clearance: f64,
}

/// Precision of centred points and of the narrowest place, in parts of the clearance.
pub const PRECISION: f64 = 1e-3;

/// Points wider than this multiple of the narrowest one stay where they are.
const NARROW: f64 = 4.0;

/// A path from its first to its last point.
#[derive(Clone, Debug)]
pub struct Path {
    /// The points, at least one.
    pub spots: Vec<Spot>,
    /// Index of the narrowest.
    pub narrowest: usize,
    /// Unit vector across the opening, in the direction in which the path passes the narrowest place.
    pub direction: Point,
}

impl Path {
    /// The path through leaves, each of which shares part of a face with the next: through their centres and the
    /// centres of the shared faces, centred where it is narrow. A path to the far field ends on the root's boundary.
    pub fn through(leaves: &Leaves, path: &[u32], goal: Goal, clearance: &Clearance) -> Self {
        let mut spots = raw(leaves, path, goal, clearance);
        centre_narrow_spots(&mut spots, clearance);
        insert_narrower_spots(&mut spots, clearance);
        let narrowest = narrowest_of(&spots);
        let mut direction = direction_at(&spots, narrowest);
        if narrowest > 0 && narrowest + 1 < spots.len() {
            (spots[narrowest], direction) = throat(spots[narrowest], direction, clearance);
        }
        Self { spots, narrowest, direction }
    }

    /// The narrowest place.
    pub fn throat(&self) -> Spot {
        self.spots[self.narrowest]
    }

    /// Whether the narrowest place is an end of the path and not an opening.
    pub fn is_narrowest_at_end(&self) -> bool {
        self.narrowest == 0 || self.narrowest + 1 == self.spots.len()
    }
}

fn raw(leaves: &Leaves, path: &[u32], goal: Goal, clearance: &Clearance) -> Vec<Spot> {
    let mut points: Vec<Point> = Vec::new();
    for (i, &leaf) in path.iter().enumerate() {
        let octant = leaves.octant(leaf);
        points.push(centre(&octant));
        if let Some(&next) = path.get(i + 1) {
            points.push(shared_face_centre(&octant, &leaves.octant(next)));
        }
    }
    if goal == Goal::Far {
        points.push(nearest_boundary(points[points.len() - 1]));
    }
    points.into_iter().map(|at| Spot { at, clearance: clearance.at(at, f64::INFINITY) }).collect()
}

fn narrowest_of(spots: &[Spot]) -> usize {
    let least = (0..spots.len()).min_by(|&i, &j| spots[i].clearance.total_cmp(&spots[j].clearance));
    least.expect("a path has points")
}

/// Moves the narrow points, except the ends, across the path to where they are widest.
fn centre_narrow_spots(spots: &mut [Spot], clearance: &Clearance) {
    let limit = NARROW * spots[narrowest_of(spots)].clearance;
    let centred: Vec<Spot> = (0..spots.len())
        .map(|i| {
            let is_end = i == 0 || i + 1 == spots.len();
            match is_end || spots[i].clearance > limit {
                true => spots[i],
                false => centred(spots[i], direction_at(spots, i), clearance),
            }
        })
        .collect();
    spots.copy_from_slice(&centred);
}

/// Inserts points where the path is narrower between two points than anywhere else.
fn insert_narrower_spots(spots: &mut Vec<Spot>, clearance: &Clearance) {
    const ROUNDS: usize = 6;
    for _ in 0..ROUNDS {
        let least = spots[narrowest_of(spots)].clearance * (1.0 - PRECISION);
        let mut refined = vec![spots[0]];
        for i in 1..spots.len() {
            let (a, b) = (spots[i - 1], spots[i]);
            let step = sub(b.at, a.at);
            let at = along(a.at, step, 0.5);
            let bound = a.clearance.min(b.clearance) + dot(step, step).sqrt() / 2.0;
            let middle = Spot { at, clearance: clearance.at(at, bound) };
            // A facet on the segment itself would stop a move across it.
            if middle.clearance < least && middle.clearance > 0.0 {
                refined.push(centred(middle, step, clearance));
            }
            refined.push(b);
        }
        if refined.len() == spots.len() {
            return;
        }
        *spots = refined;
    }
}

/// The direction of the path at a point, a unit vector.
fn direction_at(spots: &[Spot], i: usize) -> Point {
    const REACH: usize = 2;
    let (from, to) = (i.saturating_sub(REACH), (i + REACH).min(spots.len() - 1));
    unit(sub(spots[to].at, spots[from].at))
}

/// The widest point that is reached by moves across a direction, at most a few clearances away.
fn centred(from: Spot, direction: Point, clearance: &Clearance) -> Spot {
    const DIRECTIONS: usize = 16;
    const ROUNDS: usize = 200;
    // An angle that never repeats, so that a narrow range of better directions is found in the end.
    const TURN: f64 = 0.618_033_988_749_894_8;
    let [u, v] = plane(direction);
    let reach = NARROW * from.clearance;
    let mut best = from;
    let mut step = from.clearance / 2.0;
    for round in 0..ROUNDS {
        if step <= PRECISION / 8.0 * best.clearance {
            break;
        }
        let before = best.clearance;
        for k in 0..DIRECTIONS {
            let turn = k as f64 + round as f64 * TURN;
            let (sin, cos) = (turn * std::f64::consts::TAU / DIRECTIONS as f64).sin_cos();
            let at = along(along(best.at, u, step * cos), v, step * sin);
            let moved = sub(at, from.at);
            if dot(moved, moved) > reach * reach || !is_in_root(at) {
                continue;
            }
            let reached = clearance.at(at, best.clearance + step);
            if reached > best.clearance {
                best = Spot { at, clearance: reached };
            }
        }
        if best.clearance <= before * (1.0 + PRECISION / 100.0) {
            step /= 2.0;
        }
    }
    best
}

/// The narrowest place near a centred point, and the direction across it.
///
/// In a family of parallel planes, each of which the path crosses, the least of the largest balls centred in a plane
/// passes the opening. A family that is oblique to the opening yields larger balls, never smaller ones, so of several
/// families the least counts.
fn throat(from: Spot, direction: Point, clearance: &Clearance) -> (Spot, Point) {
    let mut best = (from, direction);
    for family in std::iter::once(direction).chain(FAMILIES.map(unit)) {
        // A family that contains the path's direction does not cross it.
        let along_path = dot(family, direction);
        if along_path.abs() < 0.3 {
            continue;
        }
        let family = family.map(|c| c * along_path.signum());
        let found = least_along(from, family, clearance);
        if found.clearance < best.0.clearance * (1.0 - PRECISION / 100.0) {
            best = (found, family);
        }
    }
    best
}

/// Directions of planes that are tried at the narrowest place: axes and diagonals.
const FAMILIES: [Point; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// The narrowest of the points that are centred in planes across a direction, within one clearance of `from`: coarse
/// steps to both sides, each from the point before it, then a golden-section search.
fn least_along(from: Spot, direction: Point, clearance: &Clearance) -> Spot {
    const STEPS: usize = 8;
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let reach = from.clearance;
    let start = centred(from, direction, clearance);
    let at_offset = |near: Spot, offset: f64| {
        let at = along(near.at, direction, offset);
        let moved = Spot { at, clearance: clearance.at(at, near.clearance + offset.abs()) };
        match is_in_root(at) && moved.clearance > 0.0 {
            true => centred(moved, direction, clearance),
            false => near,
        }
    };
    let step = reach / STEPS as f64;
    let mut line = vec![start];
    for sign in [-1.0, 1.0] {
        line.reverse();
        for _ in 0..STEPS {
            line.push(at_offset(line[line.len() - 1], sign * step));
        }
    }
    let middle = narrowest_of(&line);
    let (mut best, mut low, mut high) = (line[middle], -step, step);
    let near = line[middle];
    let sample = |offset: f64| at_offset(near, offset);
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut at_a, mut at_b) = (sample(a), sample(b));
    while high - low > PRECISION * reach {
        for spot in [at_a, at_b] {
            if spot.clearance < best.clearance {
                best = spot;
            }
        }
        if at_a.clearance < at_b.clearance {
            (high, b, at_b) = (b, a, at_a);
            a = high - GOLDEN * (high - low);
            at_a = sample(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + GOLDEN * (high - low);
            at_b = sample(b);
        }
    }
    best
}

fn is_in_root(at: Point) -> bool {
    at.iter().all(|c| (0.0..=UNITS_PER_EDGE as f64).contains(c))
}

/// Two unit vectors perpendicular to a direction and to each other.
fn plane(direction: Point) -> [Point; 2] {
    let size = |a: &usize| direction[*a].abs();
    let axis = (0..3).min_by(|a, b| size(a).total_cmp(&size(b))).expect("three axes");
    let mut along_axis = [0.0; 3];
    along_axis[axis] = 1.0;
    let u = unit(cross(direction, along_axis));
    [u, cross(unit(direction), u)]
}

fn unit(a: Point) -> Point {
    let length = dot(a, a).sqrt();
    if length > 0.0 { a.map(|c| c / length) } else { [1.0, 0.0, 0.0] }
}
