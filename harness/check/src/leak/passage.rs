//! The widest path through the free leaves of a base tree, described in the user's units.
//!
//! The radius of a leaf is the greatest distance to the nearest facet that any of its points can have: the distance from
//! its centre plus half of its diagonal. So a ball that passes through leaves is never larger than the least of their
//! radii. The path whose least radius is greatest is measured, its narrowest place is closed, and the search is repeated
//! until the least radius shows that no other opening is wider than the widest that was measured.
//!
//! An end near a facet is not an opening, so both ends are first moved from leaf to leaf to where the radius is greatest.

use super::clearance::{Clearance, Spot};
use super::leaves::Leaves;
use super::path::{Path, Route, Scratch};
use super::report::{Narrowest, Passage, Point, Spacing};
use super::search::{self, Goal, Graph, Interrupted, Memory};
use crate::geometry::distance::{dot, sub};
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;

/// Openings that are measured at most.
const OPENINGS_MAX: usize = 4;
/// Open space has at least this clearance, in radii of the balls that may pass. It is not measured, because a search is slow
/// where many facets are almost equally near.
const WIDE: f64 = 1.5;
/// Another opening is of interest if it is wider by this factor.
const WIDER: f64 = 1.005;

/// The widest path between ends that free leaves join.
///
/// # Errors
/// If `stop` returns true.
pub fn widest(
    case: &Case,
    level: u8,
    leaves: &Leaves,
    (start, goal): (u32, Goal),
    stop: &dyn Fn() -> bool,
) -> Result<Passage, Interrupted> {
    let clearance = Clearance::new(&case.facets_lattice);
    let mut field = Field { leaves, clearance: &clearance, radii: vec![f32::NAN; leaves.len()] };
    let approach = field.approach(start);
    let departure = match goal {
        Goal::Place(end) => field.approach(end),
        Goal::Far => Vec::new(),
    };
    let start = approach[approach.len() - 1];
    let inner_goal = departure.last().map_or(Goal::Far, |&end| Goal::Place(end));
    let mut best: Option<Path> = None;
    let (mut memory, mut scratch) = (Memory::default(), Scratch::default());
    // No path is wider than the first.
    let mut open = f64::INFINITY;
    for _ in 0..OPENINGS_MAX {
        let measured = best.as_ref().map_or(0.0, |path| path.throat().clearance);
        let wanted = WIDER * measured;
        // A path that is not wider is of no interest, so leaves that are not are not entered.
        let radius = |leaf, from| match field.radius(leaf, from) {
            radius if f64::from(radius) > wanted => radius,
            _ => -1.0,
        };
        let route = search::widest(leaves, start, inner_goal, radius, &mut memory, stop)?;
        let Some(route) = route else { break };
        let narrowest = field.narrowest(&route);
        let radius = f64::from(field.radii[narrowest as usize]);
        if radius <= wanted {
            break;
        }
        open = open.min(WIDE * radius);
        let inner = field.shortened(&route, narrowest, inner_goal, &mut memory, stop)?;
        let on = departure.iter().rev().skip(1);
        let whole: Vec<u32> = approach.iter().chain(&inner[1..]).chain(on).copied().collect();
        let approaches = [approach.len() - 1, departure.len().saturating_sub(1)];
        let route = Route { leaves: &whole, approaches, radius, wanted, open };
        let path = Path::through(leaves, &route, goal, &clearance, &mut scratch, stop)?;
        let is_end = path.is_narrowest_at_end();
        field.close(path.throat(), narrowest);
        if path.throat().clearance > measured {
            best = Some(path);
        }
        if is_end {
            break;
        }
    }
    Ok(described(case, level, &best.expect("free leaves join the ends"), &clearance))
}

/// The radii of leaves, computed when they are needed.
struct Field<'a> {
    leaves: &'a Leaves<'a>,
    clearance: &'a Clearance<'a>,
    /// NaN where unknown, negative where closed.
    radii: Vec<f32>,
}

impl Field<'_> {
    /// The radius of a leaf; `from` is a neighbour, or the leaf itself.
    fn radius(&mut self, leaf: u32, from: u32) -> f32 {
        /// Exceeds the rounding of radii to f32.
        const ROUNDING: f64 = 1.0 + 1e-6;
        let known = self.radii[leaf as usize];
        if !known.is_nan() {
            return known;
        }
        let (at, near) = (self.leaves.position(leaf), f64::from(self.radii[from as usize]));
        // A step changes the distance to the nearest facet by no more than its length.
        let step = sub(at, self.leaves.position(from));
        let bound = match near >= 0.0 {
            true => (near - self.half_diagonal(from) + dot(step, step).sqrt()) * ROUNDING,
            false => f64::INFINITY,
        };
        let radius = self.clearance.at(at, bound) + self.half_diagonal(leaf);
        self.radii[leaf as usize] = (radius * ROUNDING) as f32;
        self.radii[leaf as usize]
    }

    /// The leaves from one to a leaf whose radius no neighbour exceeds, each the neighbour of greatest radius of the one
    /// before it.
    fn approach(&mut self, leaf: u32) -> Vec<u32> {
        let (leaves, mut steps) = (self.leaves, vec![leaf]);
        loop {
            let here = steps[steps.len() - 1];
            let mut best = (self.radius(here, here), here);
            leaves.joined(here, &mut |next| {
                let radius = self.radius(next, here);
                if radius > best.0 {
                    best = (radius, next);
                }
            });
            if best.1 == here {
                return steps;
            }
            steps.push(best.1);
        }
    }

    fn half_diagonal(&self, leaf: u32) -> f64 {
        let (low, high) = self.leaves.octant(leaf).bounds();
        3f64.sqrt() / 2.0 * (high[0] - low[0]) as f64
    }

    fn narrowest(&self, route: &[u32]) -> u32 {
        let radius = |leaf: &u32| self.radii[*leaf as usize];
        let least = route.iter().copied().min_by(|a, b| radius(a).total_cmp(&radius(b)));
        least.expect("a route has leaves")
    }

    /// A route through the same narrowest leaf that is as short as its width allows.
    fn shortened(
        &mut self,
        route: &[u32],
        narrowest: u32,
        goal: Goal,
        memory: &mut Memory,
        stop: &dyn Fn() -> bool,
    ) -> Result<Vec<u32>, Interrupted> {
        let (leaves, least, start) = (self.leaves, self.radii[narrowest as usize], route[0]);
        let mut to = |goal| {
            let radius = |leaf, from| self.radius(leaf, from);
            search::shortest(leaves, narrowest, goal, least, radius, memory, stop)
        };
        let (Some(mut whole), Some(on)) = (to(Goal::Place(start))?, to(goal)?) else {
            unreachable!("the route itself joins its narrowest leaf with both ends")
        };
        whole.reverse();
        whole.extend(&on[1..]);
        Ok(whole)
    }

    /// Closes the leaves whose centres are in the ball at the narrowest place of a path, and one more leaf in any case.
    fn close(&mut self, throat: Spot, other: u32) {
        self.radii[other as usize] = -1.0;
        for leaf in 0..self.leaves.len() as u32 {
            let from = sub(self.leaves.position(leaf), throat.at);
            if dot(from, from) <= throat.clearance * throat.clearance {
                self.radii[leaf as usize] = -1.0;
            }
        }
    }
}

fn described(case: &Case, level: u8, path: &Path, clearance: &Clearance) -> Passage {
    /// Facets at the rim, in parts of the ball's radius, and for small balls in lattice units.
    const RIM: (f64, f64) = (0.02, 2.0);
    let scale = case.root.edge / UNITS_PER_EDGE as f64;
    let user = |at: [f64; 3]| {
        case.root.rounded(std::array::from_fn(|a| case.root.origin[a] + at[a] * scale))
    };
    let throat = path.throat();
    let width = 2.0 * throat.clearance * scale;
    let rim = clearance.facets_within(throat.at, throat.clearance * (1.0 + RIM.0) + RIM.1);
    let points: Vec<Point> = path
        .spots
        .iter()
        .map(|spot| Point { at: user(spot.at), width: 2.0 * spot.clearance * scale })
        .collect();
    let length = |pair: &[Point]| {
        let step = sub(pair[0].at, pair[1].at);
        dot(step, step).sqrt()
    };
    Passage {
        spacing: Spacing::of(level, &case.root),
        narrowest: Narrowest {
            at: user(throat.at),
            width,
            width_cells: width / Spacing::of(case.level_surface, &case.root).spacing,
            direction: path.direction(),
            touches: clearance.nearest(throat.at).map_or(user(throat.at), user),
            facets: rim.into_iter().map(|(facet, _)| facet).collect(),
            index: path.narrowest,
            is_end: path.is_narrowest_at_end(),
        },
        length: points.windows(2).map(length).sum(),
        points,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::words_of;

    #[test]
    fn the_leaves_in_the_ball_of_an_opening_are_closed_and_one_more() {
        let words = words_of(|o| o.level < 3);
        let leaves = Leaves::new(&words).unwrap();
        let clearance = Clearance::new(&[]);
        let mut field = Field { leaves: &leaves, clearance: &clearance, radii: vec![7.0; 512] };
        let edge = UNITS_PER_EDGE as f64 / 8.0;
        let centre = leaves.position(77);
        let at = [centre[0] + 0.25 * edge, centre[1], centre[2]];
        let clearance = 1.25 * edge;
        field.close(Spot { at, clearance, step: 1.0, apart: 0.0 }, 500);
        let offset = |leaf: u32| {
            let from = sub(leaves.position(leaf), centre);
            from.map(|c| (c / edge).round() as i32)
        };
        // A leaf on the sphere is closed.
        let closed = [
            [0, 0, 0],
            [1, 0, 0],
            [-1, 0, 0],
            [0, 1, 0],
            [0, -1, 0],
            [0, 0, 1],
            [0, 0, -1],
            [1, 1, 0],
            [1, -1, 0],
            [1, 0, 1],
            [1, 0, -1],
        ];
        for leaf in 0..512 {
            let expected = leaf == 500 || closed.contains(&offset(leaf));
            assert_eq!(field.radii[leaf as usize] == -1.0, expected, "{:?}", offset(leaf));
        }
    }
}
