//! A path as points with the free width at each, and its narrowest place.
//!
//! The free width at a point is the diameter of the largest ball centred there that no facet enters: twice the distance
//! to the nearest facet. The centres of leaves are not the middle of an opening, so the narrowest point and its
//! surroundings are replaced by the widest path through a cubic grid. That is repeated with finer grids until the
//! narrowest point of the path is one of the finest grid: its ball is the largest that passes.

#[cfg(test)]
mod tests;

use super::clearance::{Clearance, PRECISION, Point, Spot};
use super::grid::{Distances, Grid, STEPS};
use super::leaves::{Leaves, shared_face_centre};
use super::middle;
use super::search::{self, Goal, Graph, Interrupted, Memory, nearest_boundary};
use crate::geometry::distance::{length, sub};

/// Grids that are searched at most.
const GRIDS_MAX: usize = 150;

/// An opening that needs more grids than this is a passage: every place of it is almost the narrowest.
const GRIDS_FEW: usize = 16;

/// A path from its first to its last point.
#[derive(Clone, Debug)]
pub struct Path {
    /// The points, at least one.
    pub spots: Vec<Spot>,
    /// Index of the narrowest, the points of the approaches excepted.
    pub narrowest: usize,
    /// Numbers of points at the start and at the end that only lead away from the facets.
    approaches: [usize; 2],
}

/// The leaves of a path.
#[derive(Clone, Copy, Debug)]
pub struct Route<'a> {
    /// The leaves, each of which shares part of a face with the next.
    pub leaves: &'a [u32],
    /// Numbers of leaves at the start and at the end that only lead away from the facets.
    pub approaches: [usize; 2],
    /// No ball of a greater radius passes.
    pub radius: f64,
    /// Open space: greater clearances are not measured in grids.
    pub open: f64,
    /// The narrowest place is found to full precision only if its ball's radius may be at least this.
    pub wanted: f64,
}

impl Path {
    /// The path through leaves: through their centres and the centres of the shared faces, and through grids where it is
    /// narrow. A path to the far field ends on the root's boundary.
    ///
    /// # Errors
    /// If `stop` returns true.
    pub fn through(
        leaves: &Leaves,
        route: &Route,
        goal: Goal,
        clearance: &Clearance,
        scratch: &mut Scratch,
        stop: &dyn Fn() -> bool,
    ) -> Result<Self, Interrupted> {
        /// Edge of the first grid, in radii.
        const EDGE: f64 = 6.0;
        /// Ratio of the steps of successive grids.
        const FINER: f64 = 2.0;
        let mut path = Self {
            spots: raw(leaves, route.leaves, goal, clearance),
            narrowest: 0,
            approaches: route.approaches.map(|count| 2 * count),
        };
        // No ball of a greater radius passes the grids.
        let mut bound = f64::INFINITY;
        let (mut is_centred, mut are_ends_wide) = (false, false);
        for grids in 1..=GRIDS_MAX {
            path.narrowest = path.find_narrowest();
            let spot = path.throat();
            let step = (spot.step / FINER).min(EDGE * route.radius / f64::from(2 * STEPS));
            if !are_ends_wide && path.reaches_end(f64::from(STEPS) * step) {
                path.widen_ends(goal, clearance);
                are_ends_wide = true;
                continue;
            }
            let is_precise = bound <= (1.0 + 3f64.sqrt() * PRECISION) * spot.passing();
            let is_fine = spot.step <= PRECISION * spot.clearance;
            if path.is_narrowest_at_end() || is_precise || is_fine || bound < route.wanted {
                break;
            }
            let Some(found) = path.widen(step, route.open, clearance, scratch, stop)? else {
                break;
            };
            if !is_centred && (found.is_at_end || grids > GRIDS_FEW) {
                path.centre(bound.min(route.radius), route.open, clearance);
                is_centred = true;
                continue;
            }
            // The points of a grid nearest to those of a path are a path through the grid, half a step's diagonal away at most. As much
            // again for the grid's own ends, which need not lie in the middle of a passage.
            bound = bound.min(found.least + 3f64.sqrt() * step);
        }
        path.narrowest = path.find_narrowest();
        path.measure_open(route.open, clearance);
        Ok(path)
    }

    /// The narrowest place.
    pub fn throat(&self) -> Spot {
        self.spots[self.narrowest]
    }

    /// Whether the narrowest place is an end of the path and not an opening.
    pub fn is_narrowest_at_end(&self) -> bool {
        let (first, last) = self.inner();
        self.narrowest == first || self.narrowest == last
    }

    /// The first and the last index without the approaches.
    fn inner(&self) -> (usize, usize) {
        (self.approaches[0], self.spots.len() - 1 - self.approaches[1])
    }

    /// The direction of the path at its narrowest place, a unit vector: from where it enters the surroundings to where
    /// it leaves them.
    pub fn direction(&self) -> Point {
        let (first, last) = self.surroundings(self.throat().clearance / 2.0);
        let (from, to) = (first.saturating_sub(1), (last + 1).min(self.spots.len() - 1));
        let step = sub(self.spots[to].at, self.spots[from].at);
        let length = length(step);
        if length > 0.0 { step.map(|c| c / length) } else { [1.0, 0.0, 0.0] }
    }

    fn find_narrowest(&self) -> usize {
        let passing = |i: &usize| self.spots[*i].passing();
        let (first, last) = self.inner();
        let least = (first..=last).min_by(|i, j| passing(i).total_cmp(&passing(j)));
        least.expect("a path has points")
    }

    /// The first and the last index of the points around the narrowest one that are in a cube around it.
    fn surroundings(&self, half: f64) -> (usize, usize) {
        let centre = self.throat().at;
        let is_near = |i: &usize| (0..3).all(|a| (self.spots[*i].at[a] - centre[a]).abs() <= half);
        let (begin, end) = self.inner();
        let first = (begin..self.narrowest).rev().take_while(is_near).last();
        let last = (self.narrowest + 1..=end).take_while(is_near).last();
        (first.unwrap_or(self.narrowest), last.unwrap_or(self.narrowest))
    }

    /// Measures the clearances of points in open space.
    fn measure_open(&mut self, open: f64, clearance: &Clearance) {
        for spot in self.spots.iter_mut().filter(|spot| spot.clearance >= open) {
            spot.clearance = clearance.at(spot.at, f64::INFINITY);
        }
    }

    /// Whether an end is among the points in a cube around the narrowest one.
    fn reaches_end(&self, half: f64) -> bool {
        let (first, last) = self.surroundings(half);
        first == self.inner().0 || last == self.inner().1
    }

    /// Moves the ends, approaches excepted, to the widest places near them: the centre of a leaf is rarely one.
    fn widen_ends(&mut self, goal: Goal, clearance: &Clearance) {
        let (first, last) = self.inner();
        let ends = [Some(first), (goal != Goal::Far && last != first).then_some(last)];
        for end in ends.into_iter().flatten() {
            self.spots[end] = middle::widest_near(self.spots[end].at, clearance);
        }
    }

    /// Moves points less than `below` from the facets to the middle of a passage, unless that makes the path narrower.
    fn centre(&mut self, below: f64, open: f64, clearance: &Clearance) {
        let (first, last) = self.inner();
        let least = |spots: &[Spot]| spots.iter().map(Spot::passing).fold(f64::INFINITY, f64::min);
        let centred = middle::centred(&self.spots[first..=last], below, open, clearance);
        if least(&centred) > least(&self.spots[first..=last]) {
            self.spots.splice(first..=last, centred);
        }
    }

    /// Replaces the narrowest point and its surroundings by the widest path through a grid around it. `None` if there is no path.
    fn widen(
        &mut self,
        step: f64,
        open: f64,
        clearance: &Clearance,
        Scratch { known, memory }: &mut Scratch,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Widest>, Interrupted> {
        let grid = Grid { centre: self.throat().at, step };
        let (first, last) = self.surroundings(f64::from(STEPS) * step);
        let (from, to) = (grid.nearest(self.spots[first].at), grid.nearest(self.spots[last].at));
        known.clear(grid.count());
        let mut distances = Distances::new(&grid, clearance, open);
        let mut width = |place: u32, _: u32| {
            known.get_or_insert_with(place, || {
                let free = distances.at(place);
                // Balls at neighbours must overlap, so that no facet is between them.
                if free > step { free as f32 } else { -1.0 }
            })
        };
        let goal = Goal::Place(to);
        let Some(widest) = search::widest(&grid, from, goal, &mut width, memory, stop)? else {
            return Ok(None);
        };
        // Through a slit the widest path leads to and fro: each of its points is almost the narrowest and would need grids.
        let least = widest.iter().map(|&place| width(place, place)).fold(f32::INFINITY, f32::min);
        let route = search::shortest(&grid, from, goal, least, &mut width, memory, stop)?;
        let route = route.expect("the widest path is as wide");
        // An end from a coarser grid is no limit if the grid's path is wider than before.
        let is_stuck = least <= self.throat().clearance as f32 * (1.0 + 1e-6);
        let ends = [(from, self.spots[first]), (to, self.spots[last])];
        let is_at_end = ends
            .iter()
            .any(|&(end, spot)| width(end, end) <= least && (is_stuck || spot.step.is_infinite()));
        // Points near the grid's edge depend on where the path enters it, so they are not final.
        let coarse = self.spots[first].step.max(self.spots[last].step);
        let spot = |&place: &u32| Spot {
            at: grid.position(place),
            clearance: f64::from(width(place, place)),
            step: if Grid::is_inner(place) { step } else { coarse },
            apart: 3f64.sqrt() * step,
        };
        let widened: Vec<Spot> = route.iter().map(spot).collect();
        let (begin, end) = self.inner();
        let replaced = first + usize::from(first == begin)..last + usize::from(last != end);
        self.spots.splice(replaced, widened);
        Ok(Some(Widest { least: f64::from(least), is_at_end }))
    }
}

/// What a grid's path shows.
struct Widest {
    /// Its least clearance.
    least: f64,
    /// Whether that is at one of its ends, which were given, so that a wider path may pass elsewhere.
    is_at_end: bool,
}

/// Memory of searches through grids.
#[derive(Debug, Default)]
pub struct Scratch {
    known: Known,
    memory: Memory,
}

/// Distances of the points of a grid, as far as they are known.
#[derive(Debug, Default)]
struct Known {
    /// NaN where unknown.
    values: Vec<f32>,
    entered: Vec<u32>,
}

impl Known {
    fn clear(&mut self, count: usize) {
        self.values.resize(count, f32::NAN);
        for place in self.entered.drain(..) {
            self.values[place as usize] = f32::NAN;
        }
    }

    fn get_or_insert_with(&mut self, place: u32, compute: impl FnOnce() -> f32) -> f32 {
        if self.values[place as usize].is_nan() {
            self.values[place as usize] = compute();
            self.entered.push(place);
        }
        self.values[place as usize]
    }
}

fn raw(leaves: &Leaves, route: &[u32], goal: Goal, clearance: &Clearance) -> Vec<Spot> {
    let mut points: Vec<Point> = Vec::new();
    for (i, &leaf) in route.iter().enumerate() {
        points.push(leaves.position(leaf));
        if let Some(&next) = route.get(i + 1) {
            points.push(shared_face_centre(&leaves.octant(leaf), &leaves.octant(next)));
        }
    }
    if goal == Goal::Far {
        points.push(nearest_boundary(points[points.len() - 1]));
    }
    let spot = |at| Spot {
        at,
        clearance: clearance.at(at, f64::INFINITY),
        step: f64::INFINITY,
        apart: 0.0,
    };
    points.into_iter().map(spot).collect()
}
