//! The widest path between two places and its narrowest place: to 5 %, unless many places are equally narrow.
//!
//! The *radius* of a cell is the distance from its centre to the nearest facet plus half of its diagonal: no larger ball has its centre in
//! the cell. The path whose least radius is greatest bounds the balls that pass. Along a leg of length l between points of clearance a and
//! b, the clearance is at least (a + b - l) / 2, which shows which ball does pass. Where the two differ by more than 5 %, the cells of the
//! leg are divided, and those near it that promise this ball but do not show it, and the path is searched again.
//!
//! An opening of fewer than 3.5 cells can have the centre of its ball in a leaf that facets cross. Such leaves are opened near the
//! narrow places of the path: their parts that no facet touches are passable. As a wall may lie in the common face of two of them, the ball
//! must fit through that as well.
//!
//! An end near a facet is not an opening. So the path first leads away from the facets, until no place near it is farther from them, and
//! the width counts from there.

use super::report::{Narrowest, Passage, Point as Stop, Spacing};
use super::space::{Cell, Space};
use super::{Ends, to_user};
use crate::tree::{FacetTree, Point};
use contract::case::Case;
use contract::failure::Result;
use contract::lattice::UNITS_PER_EDGE;
use contract::manifest::ExtentBox;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::query::PointQuery as _;
use std::collections::BTreeSet;

/// Ratio of the bounds on the width, at most.
const PRECISION: f64 = 1.05;
/// Cells of a smaller half diagonal, in radii of the ball that passes, show the clearance to `PRECISION`.
const SMALL: f64 = 0.015;
/// Searches in which all places are measured. After them, and once a ball passes, so that no path leads through a wall, only the narrow
/// places of the last path are, and the upper bound stays: along a slit that is equally wide everywhere, each search would otherwise lead to
/// the next place. Ten times as many are the most, once a ball passes.
const SEARCHES_MAX: usize = 30;
/// Times that crossed leaves are opened.
const OPENED_MAX: usize = 6;

/// The part of a path along which the width counts.
struct Way {
    points: Vec<Place>,
    /// No ball of a greater radius passes on any path.
    bound: f64,
}

/// A point of a path.
struct Place {
    at: Point,
    clearance: f64,
    /// The cell of the leg that begins there, or of the path's end.
    cell: u32,
}

impl Way {
    /// Index of the point of least clearance.
    fn narrowest(&self) -> usize {
        let clearance = |&i: &usize| self.points[i].clearance;
        let least = (0..self.points.len()).min_by(|a, b| clearance(a).total_cmp(&clearance(b)));
        least.expect("a path has points")
    }

    fn clearance(&self) -> f64 {
        self.points[self.narrowest()].clearance
    }

    /// The radius of the ball that the bound promises, but for the precision.
    fn wanted(&self) -> f64 {
        self.bound / PRECISION
    }

    /// The first points of the legs along which this ball is not shown to pass.
    fn narrow(&self) -> impl Iterator<Item = &Place> {
        // The last point is a leg of no length.
        let legs = self.points.iter().zip(self.points[1..].iter().chain(self.points.last()));
        legs.filter(|(from, to)| passing(from, to) < self.wanted()).map(|(from, _)| from)
    }

    /// Whether a cell is within two radii of these points.
    fn near(&self) -> impl Fn(&Cell) -> bool {
        let (narrow, reach) = (self.narrow().map(|p| p.at).collect::<Vec<_>>(), 2.0 * self.bound);
        move |cell| narrow.iter().any(|at| cell.centre().distance(*at) < reach)
    }

    /// The radius of a ball that passes along all legs.
    fn passing(&self) -> f64 {
        self.points.windows(2).map(|leg| passing(&leg[0], &leg[1])).fold(self.clearance(), f64::min)
    }
}

/// The radius of a ball that passes along a leg.
fn passing(from: &Place, to: &Place) -> f64 {
    (from.clearance + to.clearance - from.at.distance(to.at)) / 2.0
}

/// A search between two places.
struct Search<'a> {
    space: Space<'a>,
    ends: Ends,
}

/// The widest path between two points, or to the far field, which free leaves of the base tree of this level join: the cells of `space`.
///
/// # Errors
/// If the user interrupts.
pub fn widest((case, level): (&Case, u8), space: Space, (from, to): Ends) -> Result<Passage> {
    let (facets, before) = (space.facets, approach(&space, from));
    let after: Vec<Point> = to.map(|to| approach(&space, to)).unwrap_or_default();
    let mut search = Search { space, ends: (before[before.len() - 1], after.last().copied()) };
    let mut way = search.converge()?;
    for _ in 0..OPENED_MAX {
        let Place { at, clearance, .. } = way.points[way.narrowest()];
        let leaf = search.space.leaf_of_facet(at, clearance);
        if clearance > 3f64.sqrt() * leaf || !search.open_near(&way, leaf) {
            break;
        }
        way = search.converge()?;
        if way.clearance() < PRECISION * clearance {
            break;
        }
    }
    Ok(described((case, facets), level, &way, (&before, &after)))
}

/// The way from a point of a free leaf, in legs along the axes through free leaves, to where no step leads farther from the facets. A step is
/// a leg or, where two or three walls are equally near and no single leg leads away from all, a leg along each of two or three axes.
fn approach(space: &Space, from: Point) -> Vec<Point> {
    let (mut points, mut clearance) = (vec![from], space.facets.distance(from));
    let mut step = clearance / 2.0;
    let is_free = |at: Point| {
        root().contains_local_point(at) && space.cells[space.locate(at) as usize].is_open
    };
    let signs = |i: u32| Point::from_array([i % 3, i / 3 % 3, i / 9].map(|c| f64::from(c) - 1.0));
    let directions: Vec<Point> = (0..27).filter_map(|i| signs(i).try_normalize()).collect();
    while step > SMALL * clearance {
        let at = points[points.len() - 1];
        let way = |d: Point| [at, at + d * Point::X, at + d.with_z(0.0), at + d];
        let is_open = |leg: &[Point]| is_free(leg[1]) && is_free(leg[0].midpoint(leg[1]));
        let ways = directions.iter().map(|&d| way(d * step));
        let open = ways.filter(|way| way.windows(2).all(is_open));
        let reached = open.map(|way| (space.facets.distance(way[3]), way));
        match reached.filter(|to| to.0 > clearance).max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((distance, way)) => {
                points.extend(&way[1..]);
                points.dedup();
                (clearance, step) = (distance, distance / 2.0);
            }
            None => step /= 2.0,
        }
    }
    points
}

/// The root as a box.
fn root() -> Aabb {
    Aabb::new(Point::ZERO, Point::splat(UNITS_PER_EDGE as f64))
}

impl Search<'_> {
    /// The widest path.
    fn converge(&mut self) -> Result<Way> {
        let (mut cap, mut searches, mut bound) = (f32::INFINITY, 0, None);
        loop {
            let found = self.space.widest(self.ends, cap, Space::radius)?;
            let (cells, width) = found.expect("free leaves join the ends");
            if width < cap {
                // The shortest of the paths that are as wide is searched next.
                cap = width;
                continue;
            }
            searches += 1;
            let way = Way { points: self.points(&cells), bound: f64::from(cap) };
            if bound.is_none() && searches >= SEARCHES_MAX && way.passing() > 0.0 {
                bound = Some(way.bound);
                // Of the cells that may be narrow, only those of the path and near its narrow places are measured further.
                let (near, wanted) = (way.near(), way.wanted());
                for (i, cell) in (0..).zip(&mut self.space.cells) {
                    cell.is_open &= cell.shown() >= wanted || near(cell) || cells.contains(&i);
                }
            }
            if searches >= 10 * SEARCHES_MAX && way.passing() > 0.0 || !self.divide(&way) {
                return Ok(Way { bound: bound.unwrap_or(way.bound), ..way });
            }
        }
    }

    /// The points of a path through cells.
    fn points(&self, cells: &[u32]) -> Vec<Place> {
        let centre = |cell: u32| self.space.cells[cell as usize].centre();
        let mut points = vec![(self.ends.0, cells[0])];
        for (i, &cell) in cells.iter().enumerate() {
            points.push((centre(cell), cell));
            let next = cells.get(i + 1);
            points.extend(next.map(|&next| (self.space.between(cell, next), next)));
        }
        let end = cells[cells.len() - 1];
        // To the far field, the nearest point of the root's boundary.
        let far = || root().project_local_point(centre(end), false).point;
        points.push((self.ends.1.unwrap_or_else(far), end));
        points.dedup_by_key(|(at, _)| *at);
        let place = |(at, cell)| Place { at, clearance: self.space.facets.distance(at), cell };
        points.into_iter().map(place).collect()
    }

    /// Divides the cells in which a path may be too narrow for the ball that its bound promises, and those near its narrow legs that
    /// promise this ball but do not show it: along a slit, many are equally wide. Returns whether there are any.
    fn divide(&mut self, way: &Way) -> bool {
        let near = way.near();
        let cells = self.space.cells.iter().zip(0..).filter(|(cell, _)| {
            let is_doubtful = cell.shown() < way.wanted() && cell.promised() >= way.bound;
            cell.is_open && is_doubtful && near(cell)
        });
        let mut divided: BTreeSet<u32> = cells.map(|(_, i)| i).collect();
        divided.extend(way.narrow().map(|place| place.cell));
        divided.retain(|&i| {
            let cell = &self.space.cells[i as usize];
            cell.half_diagonal() > SMALL * way.bound && cell.edge() > 1.0
        });
        divided.iter().for_each(|&cell| self.space.split(cell));
        !divided.is_empty()
    }

    /// Opens the crossed leaves near the narrow places of a path. Returns whether there are any.
    fn open_near(&mut self, way: &Way, leaf: f64) -> bool {
        // The ball of an opening of 3.5 cells has its centre no farther from the path.
        const REACH: f64 = 2.5;
        const NARROW: f64 = 1.2;
        let limit = NARROW * way.clearance();
        let narrow: Vec<&Place> = way.points.iter().filter(|p| p.clearance < limit).collect();
        let is_near = |at: Point| narrow.iter().any(|p| p.at.distance(at) < REACH * leaf);
        let mut is_any = false;
        for cell in self.space.cells.iter_mut().filter(|cell| !cell.is_open) {
            cell.is_open = cell.is_free || is_near(cell.centre());
            is_any |= cell.is_open && !cell.is_free;
        }
        is_any
    }
}

/// The path in the user's units, with the ways from its start and to its end, which lead to its first and from its last point.
fn described(
    (case, facets): (&Case, &FacetTree),
    level: u8,
    way: &Way,
    (before, after): (&[Point], &[Point]),
) -> Passage {
    /// Facets at the rim, in radii of the ball.
    const RIM: f64 = 1.05;
    let (unit, narrowest) = (case.root.edge / UNITS_PER_EDGE as f64, way.narrowest());
    let Place { at, clearance, .. } = way.points[narrowest];
    let first = before.len() - 1;
    let inner = (first, first + way.points.len() - 1);
    // A path to the far field counts to its end.
    let last = if after.is_empty() { 0 } else { way.points.len() - 1 };
    let stop = |at| Stop { at: to_user(&case.root, at), width: 2.0 * unit * facets.distance(at) };
    let inside = way.points.iter().map(|place| place.at);
    let points =
        before[..first].iter().copied().chain(inside).chain(after.iter().rev().skip(1).copied());
    let width = 2.0 * unit * clearance;
    let is_met = |b: &&ExtentBox| {
        b.is_in_root()
            && (0..3).all(|a| {
                (b.min[a] as f64) < at[a] + clearance && at[a] - clearance < b.max[a] as f64
            })
    };
    let boxes = case.boxes.iter().filter(is_met).map(|b| case.root.edge_of(b.level));
    Passage {
        spacing: Spacing::of(level, &case.root),
        narrowest: Narrowest {
            at: to_user(&case.root, at),
            width,
            width_min: 2.0 * unit * way.passing(),
            width_max: 2.0 * unit * way.bound,
            width_cells: width / case.root.edge_of(case.level_surface),
            cell_of_boxes: boxes.fold(f64::INFINITY, f64::min),
            facets: facets.within(at, RIM * clearance),
            index: first + narrowest,
            is_end: [0, last].iter().any(|&end| way.points[end].clearance <= PRECISION * clearance),
        },
        inner,
        points: points.map(stop).collect(),
    }
}
