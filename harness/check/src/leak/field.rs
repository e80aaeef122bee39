//! The free leaves of a base tree with their radii, which are computed when they are needed, and the cubes of the leaves
//! near the narrow places of the paths that were found so far.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

use super::clearance::{Clearance, Point};
use super::cubes::{Cubes, DIAGONAL, length};
use super::leaves::Leaves;
use super::refine::Ends;
use super::search::{self, Goal, Graph, Interrupted};

/// Places are the free leaves, by number, and after all leaves the cubes. A leaf of which there are cubes is no place.
#[derive(Debug)]
pub struct Field<'a> {
    leaves: &'a Leaves<'a>,
    clearance: &'a Clearance<'a>,
    /// The cubes.
    pub cubes: Cubes<'a>,
    /// Distances from the centres of leaves to the nearest facet, rounded up; NaN where unknown, and infinite where they exceed
    /// `wide`.
    distances: Vec<f32>,
    /// A distance that is presumably not exceeded at the narrowest place of any path.
    wide: f64,
}

/// A point where the free width is greatest, and the way there.
#[derive(Clone, Debug, PartialEq)]
pub struct Widest {
    /// The points from the given one to the widest.
    pub way: Vec<Point>,
    /// Half of the free width at the last point.
    pub clearance: f64,
}

impl Widest {
    /// The point.
    pub fn at(&self) -> Point {
        self.way[self.way.len() - 1]
    }
}

impl<'a> Field<'a> {
    /// The field of a base tree of this level.
    pub fn new(leaves: &'a Leaves<'a>, level: u8, clearance: &'a Clearance<'a>) -> Self {
        /// In leaves. A base tree is searched that is two levels finer than the coarsest that joins the ends, and an opening
        /// wider than 2 sqrt(3) leaves joins them.
        const WIDE: f64 = 15.0;
        let (cubes, distances) = (Cubes::new(leaves, clearance), vec![f32::NAN; leaves.len()]);
        Self { leaves, clearance, cubes, distances, wide: WIDE * EDGE / f64::from(1u32 << level) }
    }

    /// The leaves of a widest path and its least radius; `None` if no path has a least radius of at least `wanted`.
    ///
    /// # Errors
    /// If `stop` returns true.
    pub fn widest(
        &mut self,
        ends: Ends,
        wanted: f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<(Vec<u32>, f64)>, Interrupted> {
        let Some(route) = self.route(ends, wanted, stop)? else { return Ok(None) };
        let count = self.leaves.len() as u32;
        let radius = |&place: &u32| match place.checked_sub(count) {
            Some(cube) => self.cubes.radius(cube),
            None => f64::from(self.distances[place as usize]) + self.half_diagonal(place),
        };
        let least = route.iter().map(radius).fold(f64::INFINITY, f64::min);
        if least.is_infinite() {
            self.wide = f64::INFINITY;
            self.distances.fill(f32::NAN);
            return self.widest(ends, wanted, stop);
        }
        let leaf = |place: u32| match place.checked_sub(count) {
            Some(cube) => self.leaves.locate(self.cubes.position(cube).map(|c| c as i64)),
            None => place,
        };
        let mut leaves: Vec<u32> = route.into_iter().map(leaf).collect();
        leaves.dedup();
        Ok(Some((leaves, least)))
    }

    /// The places of a widest path.
    fn route(
        &mut self,
        (start, goal): Ends,
        wanted: f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<u32>>, Interrupted> {
        let from = self.place(start);
        let to = goal.map_or(Goal::Far, |at| Goal::Place(self.place(at)));
        let mut distances = std::mem::take(&mut self.distances);
        let radius = |place, near| {
            let radius = self.radius(place, near, wanted, &mut distances);
            if radius >= wanted { radius as f32 } else { -1.0 }
        };
        let route = search::widest(&*self, from, to, radius, stop);
        self.distances = distances;
        route
    }

    /// Makes cubes of the leaves of a route, and of all leaves near those in which the route is narrower than twice its
    /// least radius.
    pub fn adopt(&mut self, route: &[u32], radius: f64) {
        /// Radius of the surroundings, in least radii.
        const REACH: f64 = 2.0;
        let is_narrow = |leaf: &u32| {
            self.clearance.at(self.leaves.position(*leaf), f64::INFINITY) < 2.0 * radius
        };
        let narrow: Vec<u32> = route.iter().copied().filter(is_narrow).collect();
        route.iter().for_each(|&leaf| self.cubes.adopt(leaf));
        let mut seen: HashSet<u32> = narrow.iter().copied().collect();
        let mut heap: BinaryHeap<_> = narrow.into_iter().map(|leaf| (Reverse(0), leaf)).collect();
        while let Some((Reverse(distance), leaf)) = heap.pop() {
            let distance = f64::from_bits(distance);
            self.cubes.adopt(leaf);
            self.leaves.neighbours(leaf, &mut |next| {
                let through =
                    distance + length(self.leaves.position(leaf), self.leaves.position(next));
                if through - self.half_diagonal(next) <= REACH * radius && seen.insert(next) {
                    heap.push((Reverse(through.to_bits()), next));
                }
            });
        }
    }

    /// The way from a point in a free leaf to where no point nearby has a greater free width.
    pub fn approach(&self, from: Point) -> Widest {
        /// The last step in parts of the clearance, and the least gain in parts of a step.
        const PRECISION: f64 = 1e-3;
        let at = |leaf| self.clearance.at(self.leaves.position(leaf), f64::INFINITY);
        let mut leaf = self.leaves.locate(from.map(|c| c as i64));
        let (mut way, mut best) = (vec![from, self.leaves.position(leaf)], at(leaf));
        loop {
            let mut wider = None;
            self.joined(leaf, &mut |next| {
                if self.clearance.is_free(self.leaves.position(next), best * (1.0 + PRECISION)) {
                    (best, wider) = (at(next), Some(next));
                }
            });
            let Some(next) = wider else { break };
            way.push(super::leaves::shared_face_centre(
                &self.leaves.octant(leaf),
                &self.leaves.octant(next),
            ));
            way.push(self.leaves.position(next));
            leaf = next;
        }
        // A step of at most half of the clearance meets no facet.
        let mut step = best / 2.0;
        while step > PRECISION * best {
            let here = way[way.len() - 1];
            let wider = directions().map(|d| std::array::from_fn(|a| here[a] + step * d[a])).find(
                |there: &Point| {
                    let there = *there;
                    let is_inside = there.iter().all(|c| (0.0..=EDGE).contains(c));
                    let is_wider = || self.clearance.is_free(there, best + PRECISION * step);
                    let leaf = || self.leaves.locate(there.map(|c| c as i64));
                    is_inside && is_wider() && self.leaves.is_free(leaf())
                },
            );
            match wider {
                Some(there) => {
                    best = self.clearance.at(there, best + 2.0 * step);
                    way.push(there);
                }
                None => step /= 2.0,
            }
        }
        Widest { way, clearance: best }
    }

    /// The leaf or cube with a point.
    fn place(&self, at: Point) -> u32 {
        match self.cubes.at(at) {
            Some(cube) => self.leaves.len() as u32 + cube,
            None => self.leaves.locate(at.map(|c| c as i64)),
        }
    }

    /// The radius of a place, or a bound of it that is less than `wanted`. `near` is a neighbour whose radius is known, or
    /// the place itself.
    fn radius(&self, place: u32, near: u32, wanted: f64, distances: &mut [f32]) -> f64 {
        /// Exceeds the rounding of distances to f32.
        const ROUNDING: f64 = 1.0 + 1e-6;
        let count = self.leaves.len() as u32;
        if let Some(cube) = place.checked_sub(count) {
            return self.cubes.radius(cube);
        }
        let half_diagonal = self.half_diagonal(place);
        let known = distances[place as usize];
        if !known.is_nan() {
            return f64::from(known) + half_diagonal;
        }
        let at = self.leaves.position(place);
        let distance_near = match near.checked_sub(count) {
            Some(cube) => self.cubes.clearance(cube),
            None if near == place => f64::INFINITY,
            None => f64::from(distances[near as usize]),
        };
        // A step changes the distance to the nearest facet by no more than its length.
        let bound = (distance_near + length(at, self.position(near))) * ROUNDING;
        if bound + half_diagonal < wanted {
            return bound + half_diagonal;
        }
        let distance = match bound > self.wide && self.clearance.is_free(at, self.wide) {
            true => f32::INFINITY,
            false => (self.clearance.at(at, bound) * ROUNDING) as f32,
        };
        distances[place as usize] = distance;
        f64::from(distance) + half_diagonal
    }

    fn half_diagonal(&self, leaf: u32) -> f64 {
        let (low, high) = self.leaves.octant(leaf).bounds();
        DIAGONAL / 2.0 * (high[0] - low[0]) as f64
    }
}

const EDGE: f64 = contract::lattice::UNITS_PER_EDGE as f64;

/// Unit vectors to the neighbours in a cubic grid.
fn directions() -> impl Iterator<Item = Point> {
    let steps = (0..27).filter(|&i| i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
    steps.map(|step| {
        let squared: i32 = step.iter().map(|c| c * c).sum();
        step.map(|c| f64::from(c) / f64::from(squared).sqrt())
    })
}

impl Graph for Field<'_> {
    fn count(&self) -> usize {
        self.leaves.len() + self.cubes.count()
    }

    fn position(&self, place: u32) -> Point {
        match place.checked_sub(self.leaves.len() as u32) {
            Some(cube) => self.cubes.position(cube),
            None => self.leaves.position(place),
        }
    }

    fn is_far(&self, place: u32) -> bool {
        match place.checked_sub(self.leaves.len() as u32) {
            Some(cube) => self.cubes.is_far(cube),
            None => self.leaves.is_far(place),
        }
    }

    fn joined(&self, place: u32, visit: &mut impl FnMut(u32)) {
        let count = self.leaves.len() as u32;
        if let Some(cube) = place.checked_sub(count) {
            self.cubes.joined(cube, &mut |next| visit(count + next));
            let mut leaf = |leaf| {
                if self.leaves.is_free(leaf) {
                    visit(leaf);
                }
            };
            return self.cubes.leaves_joined(cube, &mut leaf);
        }
        self.leaves.neighbours(place, &mut |next| {
            if self.cubes.is_adopted(next) {
                self.cubes.facing(next, place, &mut |cube| visit(count + cube));
            } else if self.leaves.is_free(next) {
                visit(next);
            }
        });
    }
}
