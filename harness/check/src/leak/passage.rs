//! The widest path through the free leaves of a base tree, described in the user's units.
//!
//! The width of a leaf is the free width at its centre, which differs from the free width of the opening by up to the
//! leaf's diagonal. So the widest path through the leaves is measured, its narrowest place is closed, and the search is
//! repeated until no other opening can be wider than the widest that was measured.

use super::clearance::Clearance;
use super::leaves::{Leaves, centre};
use super::path::Path;
use super::report::{Narrowest, Passage, Point, Spacing};
use super::search::{self, Goal, Interrupted};
use crate::geometry::distance::{dot, sub};
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;

/// Openings that are measured at most.
const OPENINGS_MAX: usize = 8;

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
    let mut field = Field { leaves, clearance: &clearance, known: vec![f32::NAN; leaves.len()] };
    let mut best: Option<Path> = None;
    for _ in 0..OPENINGS_MAX {
        let Some(route) = search::widest(leaves, start, goal, |l, from| field.at(l, from), stop)?
        else {
            break;
        };
        let measured = best.as_ref().map_or(0.0, |path| path.throat().clearance);
        let narrowest = field.narrowest(&route);
        if field.most(narrowest) <= measured {
            break;
        }
        let route = field.shortened(&route, narrowest, goal, stop)?;
        let path = Path::through(leaves, &route, goal, &clearance);
        field.close(&path);
        let is_last = path.is_narrowest_at_end();
        if path.throat().clearance > measured {
            best = Some(path);
        }
        if is_last {
            break;
        }
    }
    Ok(described(case, level, &best.expect("free leaves join the ends"), &clearance))
}

/// Distances from the centres of leaves to the nearest facet, computed when they are needed.
struct Field<'a> {
    leaves: &'a Leaves<'a>,
    clearance: &'a Clearance<'a>,
    /// NaN where unknown, negative where closed.
    known: Vec<f32>,
}

impl Field<'_> {
    /// The distance from a leaf's centre; `from` is a neighbour, or the leaf itself.
    fn at(&mut self, leaf: u32, from: u32) -> f32 {
        /// Exceeds the rounding of distances to f32.
        const ROUNDING: f64 = 1.0 + 1e-6;
        let known = self.known[leaf as usize];
        if !known.is_nan() {
            return known;
        }
        let (at, near) = (self.centre(leaf), self.known[from as usize]);
        // A step changes the distance to the nearest facet by no more than its length.
        let step = sub(at, self.centre(from));
        let bound = match near >= 0.0 {
            true => (f64::from(near) + dot(step, step).sqrt()) * ROUNDING,
            false => f64::INFINITY,
        };
        self.known[leaf as usize] = self.clearance.at(at, bound) as f32;
        self.known[leaf as usize]
    }

    fn centre(&self, leaf: u32) -> [f64; 3] {
        centre(&self.leaves.octant(leaf))
    }

    fn narrowest(&mut self, route: &[u32]) -> u32 {
        let least = route.iter().copied().min_by(|&a, &b| self.at(a, a).total_cmp(&self.at(b, b)));
        least.expect("a route has leaves")
    }

    /// The greatest distance to the nearest facet that a point of a leaf can have.
    fn most(&self, leaf: u32) -> f64 {
        let (low, high) = self.leaves.octant(leaf).bounds();
        f64::from(self.known[leaf as usize]) + 3f64.sqrt() / 2.0 * (high[0] - low[0]) as f64
    }

    /// A route through the same narrowest leaf that is as short as its width allows.
    fn shortened(
        &mut self,
        route: &[u32],
        narrowest: u32,
        goal: Goal,
        stop: &dyn Fn() -> bool,
    ) -> Result<Vec<u32>, Interrupted> {
        let (leaves, least, start) = (self.leaves, self.known[narrowest as usize], route[0]);
        let mut to = |goal| {
            search::shortest(leaves, narrowest, goal, least, |l, from| self.at(l, from), stop)
        };
        let (Some(mut whole), Some(on)) = (to(Goal::Leaf(start))?, to(goal)?) else {
            unreachable!("the route itself joins its narrowest leaf with both ends")
        };
        whole.reverse();
        whole.extend(&on[1..]);
        Ok(whole)
    }

    /// Closes the leaves in the ball at the narrowest place of a path.
    fn close(&mut self, path: &Path) {
        let throat = path.throat();
        for leaf in 0..self.leaves.len() as u32 {
            let from = sub(self.centre(leaf), throat.at);
            if dot(from, from) <= throat.clearance * throat.clearance {
                self.known[leaf as usize] = -1.0;
            }
        }
    }
}

fn described(case: &Case, level: u8, path: &Path, clearance: &Clearance) -> Passage {
    /// Facets at the rim, in parts of the ball's radius, and for small balls in lattice units.
    const RIM: (f64, f64) = (0.02, 2.0);
    let scale = case.root.edge / UNITS_PER_EDGE as f64;
    let user = |at: [f64; 3]| std::array::from_fn(|a| case.root.origin[a] + at[a] * scale);
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
            direction: path.direction,
            touches: clearance.nearest(throat.at).map_or(user(throat.at), user),
            facets: rim.into_iter().map(|(facet, _)| facet).collect(),
            index: path.narrowest,
            is_end: path.is_narrowest_at_end(),
        },
        length: points.windows(2).map(length).sum(),
        points,
    }
}
