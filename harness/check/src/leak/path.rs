//! A path as points with the free width at each, and its narrowest place.
//!
//! The free width at a point is the diameter of the largest ball centred there that no facet enters: twice the distance
//! to the nearest facet.

use super::clearance::{Clearance, Point};
use super::cubes::{Cubes, length};
use super::field::Widest;
use super::search::{Graph, nearest_boundary};
use crate::geometry::distance::sub;

/// A point and its distance to the nearest facet, in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The point.
    pub at: Point,
    /// The distance: half the free width.
    pub clearance: f64,
}

/// A path from its first to its last point.
#[derive(Clone, Debug)]
pub struct Path {
    /// The points, at least one.
    pub spots: Vec<Spot>,
    /// Index of the narrowest, the points of the approaches excepted.
    pub narrowest: usize,
    /// Whether the narrowest place is as wide as the widest near an end, so that there is no opening between the ends.
    pub is_narrowest_at_end: bool,
}

impl Path {
    /// The path through the centres of cubes and of the faces that they share. It begins with the approach to the widest
    /// place near the start and ends with that to the goal, backwards; without a goal it ends on the root's boundary.
    pub fn through(
        cubes: &Cubes,
        path: &[u32],
        clearance: &Clearance,
        (start, goal): (&Widest, Option<&Widest>),
    ) -> Self {
        /// The width is known to this part.
        const PRECISION: f64 = 0.005;
        let spot = |at| Spot { at, clearance: clearance.at(at, f64::INFINITY) };
        let mut spots: Vec<Spot> = start.way.iter().copied().map(spot).collect();
        let first = spots.len();
        for (i, &cube) in path.iter().enumerate() {
            spots.push(spot(cubes.position(cube)));
            if let Some(&next) = path.get(i + 1) {
                spots.push(spot(cubes.shared_face_centre(cube, next)));
            }
        }
        let last = spots.len() - 1;
        let narrowest =
            (first..=last).min_by(|&i, &j| spots[i].clearance.total_cmp(&spots[j].clearance));
        let narrowest = narrowest.expect("a path has cubes");
        match goal {
            Some(goal) => spots.extend(goal.way.iter().rev().copied().map(spot)),
            None => spots.push(spot(nearest_boundary(spots[last].at))),
        }
        let at_ends = goal.map_or(start.clearance, |goal| start.clearance.min(goal.clearance));
        let is_narrowest_at_end = spots[narrowest].clearance >= (1.0 - PRECISION) * at_ends;
        Self { spots, narrowest, is_narrowest_at_end }
    }

    /// The narrowest place.
    pub fn throat(&self) -> Spot {
        self.spots[self.narrowest]
    }

    /// The direction of the path at its narrowest place, a unit vector: from where it enters the surroundings to where
    /// it leaves them.
    pub fn direction(&self) -> Point {
        let throat = self.throat();
        let is_near = |spot: &Spot| length(spot.at, throat.at) <= throat.clearance / 2.0;
        let (before, after) = self.spots.split_at(self.narrowest);
        let from = before.iter().rev().find(|spot| !is_near(spot)).or(before.first());
        let to = after.iter().find(|spot| !is_near(spot)).or(after.last());
        let ends = [from, to].map(|spot| spot.map_or(throat.at, |spot| spot.at));
        let (step, long) = (sub(ends[1], ends[0]), length(ends[0], ends[1]));
        if long > 0.0 { step.map(|c| c / long) } else { [1.0, 0.0, 0.0] }
    }
}
