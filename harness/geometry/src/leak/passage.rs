//! The widest path between two places and its narrowest place, to 5 %.
//!
//! The *radius* of a cell is the distance from its centre to the nearest facet plus half of its diagonal: no larger ball has its centre in
//! the cell. The path whose least radius is greatest bounds the balls that pass; the clearance along its legs, measured, shows which ball
//! does pass. Where the two differ by more than 5 %, the cells near the leg that promise more than their centres have are divided, and the
//! path is searched again.
//!
//! An opening of fewer than 3.5 cells can have the centre of its ball in a leaf that facets cross. Such leaves are opened near the
//! narrow places of the path: their parts that no facet touches are passable.
//!
//! An end near a facet is not an opening. So the path first leads away from the facets, until no place near it is farther from them, and
//! the width counts from there.

use super::ends::to_user;
use super::report::{Narrowest, Passage, Point as Stop, Spacing};
use super::space::{Goal, Space};
use crate::tree::{FacetTree, Point};
use contract::case::Case;
use contract::failure::Failure;
use contract::lattice::UNITS_PER_EDGE;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::query::PointQuery as _;

/// Ratio of the bounds on the width, at most.
const PRECISION: f64 = 1.05;
/// The clearance along a leg is measured to this part of it.
const MARCH: f64 = 0.01;
/// Cells of a smaller half diagonal, in radii of the ball that passes, show the clearance to `PRECISION`.
const SMALL: f64 = 0.015;
/// Searches for the widest path, at most. If they do not suffice, as along a slit in which many places are equally narrow, the bounds on
/// the width are wider apart than 5 %.
const SEARCHES_MAX: usize = 300;
/// Times that crossed leaves are opened.
const OPENED_MAX: usize = 6;

/// A path: points, and whether the width counts along the leg that begins at each of them.
struct Way {
    points: Vec<Point>,
    /// The first and the last point of the part that counts.
    inner: (usize, usize),
    /// Cell of each leg of the part that counts.
    cells: Vec<u32>,
    /// Least clearance on each leg of this part, and where it is.
    least: Vec<(f64, Point)>,
}

impl Way {
    /// The least clearance, and the leg.
    fn narrowest(&self) -> (f64, usize) {
        let legs = self.least.iter().enumerate().map(|(leg, &(least, _))| (least, leg));
        legs.min_by(|a, b| a.0.total_cmp(&b.0)).expect("a path has legs")
    }
}

/// A search between two places.
struct Search<'a> {
    facets: &'a FacetTree,
    space: Space<'a>,
    from: Vec<Point>,
    /// Empty for the far field.
    to: Vec<Point>,
    /// Number of searches so far.
    searches: usize,
    stop: &'a dyn Fn() -> bool,
}

/// The widest path between two points, or to the far field, which free leaves of the base tree of this level join.
///
/// # Errors
/// If `stop` returns true.
pub fn widest(
    (case, facets): (&Case, &FacetTree),
    (level, words): (u8, &[u64]),
    (from, to): (Point, Option<Point>),
    stop: &dyn Fn() -> bool,
) -> Result<Passage, Failure> {
    let mut space = Space::new(words, facets).expect("the tree was searched before");
    let from = approach(&mut space, from);
    let to = to.map_or(Vec::new(), |to| approach(&mut space, to));
    let mut search = Search { facets, space, from, to, searches: 0, stop };
    let leaf = UNITS_PER_EDGE as f64 / f64::from(1u32 << level);
    let (mut way, mut bound) = search.converge()?;
    for _ in 0..OPENED_MAX {
        let before = way.narrowest().0;
        if before > 3f64.sqrt() * leaf || !search.open_near(&way, leaf) {
            break;
        }
        (way, bound) = search.converge()?;
        if way.narrowest().0 < PRECISION * before {
            break;
        }
    }
    Ok(described(case, facets, level, &way, bound, search.to.is_empty()))
}

/// The way from a point to where no neighbouring leaf is farther from the facets: the point, and centres with the faces between them.
fn approach(space: &mut Space, from: Point) -> Vec<Point> {
    let (mut cell, mut points) = (space.locate(from), vec![from]);
    loop {
        points.push(space.centre(cell));
        let mut joined = Vec::new();
        space.neighbours(cell, &mut |next| joined.push(next));
        joined.retain(|&next| space.is_open(next));
        let clearance = |space: &mut Space, cell| (space.clearance(cell), cell);
        let best = joined.into_iter().map(|next| clearance(space, next));
        match best.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((clearance, next)) if clearance > space.clearance(cell) => {
                points.push(space.between(cell, next));
                cell = next;
            }
            _ => break,
        }
    }
    // On, from the centre of this leaf, in smaller and smaller steps.
    let mut at = points[points.len() - 1];
    let mut clearance = space.clearance(cell);
    let mut step = space.edge(cell) / 4.0;
    while step > SMALL * clearance {
        let moves = [Point::X, Point::Y, Point::Z]
            .into_iter()
            .flat_map(|axis| [at - axis * step, at + axis * step]);
        let open = moves.filter(|&to| is_in_root(to) && space.is_open(space.locate(to)));
        let best =
            open.map(|to| (space.facets.distance(to), to)).max_by(|a, b| a.0.total_cmp(&b.0));
        match best.filter(|best| best.0 > clearance) {
            Some(best) => {
                (clearance, at) = best;
                points.push(at);
            }
            None => step /= 2.0,
        }
    }
    points
}

fn is_in_root(at: Point) -> bool {
    at.min_element() >= 0.0 && at.max_element() <= UNITS_PER_EDGE as f64
}

impl Search<'_> {
    /// The widest path, and the radius that no ball on another path exceeds.
    fn converge(&mut self) -> Result<(Way, f64), Failure> {
        let start = self.from[self.from.len() - 1];
        let goal = self.to.last().map_or(Goal::Far, |&to| Goal::At(to));
        let mut cap = f32::INFINITY;
        loop {
            let first = self.space.locate(start);
            let found = self.space.widest(first, goal, cap, Space::radius, self.stop)?;
            let (cells, width) = found.expect("free leaves join the ends");
            if width < cap {
                // The shortest of the paths that are as wide is searched next.
                cap = width;
                continue;
            }
            self.searches += 1;
            let (way, bound) = (self.way(&cells), f64::from(cap));
            if self.searches >= SEARCHES_MAX || !self.divide(&way, bound) {
                return Ok((way, bound));
            }
        }
    }

    /// The path through cells, from and to the points that were given.
    fn way(&self, cells: &[u32]) -> Way {
        let mut points = self.from.clone();
        let first = points.len() - 1;
        let mut of_legs = Vec::new();
        let mut add = |point: Point, cell: u32| {
            if point != points[points.len() - 1] {
                points.push(point);
                of_legs.push(cell);
            }
        };
        for (i, &cell) in cells.iter().enumerate() {
            add(self.space.centre(cell), cell);
            if let Some(&next) = cells.get(i + 1) {
                add(self.space.between(cell, next), cell);
            }
        }
        let end = cells[cells.len() - 1];
        add(self.to.last().copied().unwrap_or_else(|| at_boundary(self.space.centre(end))), end);
        let inner = (first, points.len() - 1);
        points.extend(self.to.iter().rev().skip(1));
        let legs = points[inner.0..=inner.1].windows(2);
        let mut least: Vec<_> =
            legs.map(|leg| least_between(self.facets, leg[0], leg[1])).collect();
        if least.is_empty() {
            // Both ends lead to one place.
            of_legs.push(end);
            least.push((self.facets.distance(points[inner.0]), points[inner.0]));
        }
        Way { points, inner, cells: of_legs, least }
    }

    /// Divides the cells that promise a ball of this radius but do not have it, near the legs that do not let it pass. Returns whether there
    /// are any.
    fn divide(&mut self, way: &Way, radius: f64) -> bool {
        let wanted = radius / PRECISION / (1.0 - MARCH);
        let is_narrow = |leg: &usize| way.least[*leg].0 < wanted;
        let narrow: Vec<usize> = (0..way.least.len()).filter(is_narrow).collect();
        let is_near =
            |at: Point| narrow.iter().any(|&leg| at.distance(way.least[leg].1) < 2.0 * radius);
        let mut divided: Vec<u32> = narrow
            .iter()
            .flat_map(|&leg| {
                // The cells of the legs before and after it too: a leg begins and ends on their faces.
                way.cells[leg.saturating_sub(1)..(leg + 2).min(way.cells.len())].iter().copied()
            })
            .collect();
        if !narrow.is_empty() {
            divided.extend((0..self.space.count()).filter(|&cell| {
                let promises = self.space.known_clearance(cell).is_some_and(|clearance| {
                    clearance < wanted && clearance + self.space.half_diagonal(cell) >= radius
                });
                promises && self.space.is_open(cell) && is_near(self.space.centre(cell))
            }));
        }
        divided.sort_unstable();
        divided.dedup();
        divided.retain(|&cell| {
            self.space.half_diagonal(cell) > SMALL * radius && self.space.edge(cell) > 1.0
        });
        divided.iter().for_each(|&cell| self.space.split(cell));
        !divided.is_empty()
    }

    /// Opens the crossed leaves near the narrow places of a path. Returns whether there are any.
    fn open_near(&mut self, way: &Way, leaf: f64) -> bool {
        // The ball of an opening of 3.5 cells has its centre no farther from the path.
        const REACH: f64 = 2.5;
        const NARROW: f64 = 1.2;
        let limit = NARROW * way.narrowest().0;
        let narrow: Vec<Point> = way.least.iter().filter(|l| l.0 < limit).map(|l| l.1).collect();
        let is_near = |at: Point| narrow.iter().any(|n| n.distance(at) < REACH * leaf);
        let near = |cell: &u32| !self.space.is_open(*cell) && is_near(self.space.centre(*cell));
        let closed: Vec<u32> = (0..self.space.count()).filter(near).collect();
        closed.iter().for_each(|&cell| self.space.open(cell));
        !closed.is_empty()
    }
}

/// The least clearance on a segment, within [`MARCH`], and where it is.
fn least_between(facets: &FacetTree, from: Point, to: Point) -> (f64, Point) {
    let length = from.distance(to);
    let (mut best, mut along) = ((f64::INFINITY, from), 0.0);
    loop {
        let at = from + (to - from) * (along / length).min(1.0);
        let clearance = facets.distance(at);
        if clearance < best.0 {
            best = (clearance, at);
        }
        if along >= length || best.0 <= 1.0 {
            return best;
        }
        // No nearer point is between here and there than `MARCH` allows.
        along = (along + clearance - (1.0 - MARCH) * best.0).min(length);
    }
}

/// The point of the root's boundary nearest to a point of the root.
fn at_boundary(at: Point) -> Point {
    let root = Aabb::new(Point::ZERO, Point::splat(UNITS_PER_EDGE as f64));
    root.project_local_point(at, false).point
}

/// The path in the user's units.
fn described(
    case: &Case,
    facets: &FacetTree,
    level: u8,
    way: &Way,
    bound: f64,
    is_far: bool,
) -> Passage {
    /// Facets at the rim, in radii of the ball.
    const RIM: f64 = 1.05;
    let unit = case.root.edge / UNITS_PER_EDGE as f64;
    let user = |at: Point| to_user(&case.root, at);
    let (clearance, leg) = way.narrowest();
    let at = way.least[leg].1;
    let mut points = way.points.clone();
    let mut index = way.inner.0 + leg;
    let mut inner = way.inner;
    if at != points[index] {
        index += 1;
        if points.get(index) != Some(&at) {
            points.insert(index, at);
            inner.1 += 1;
        }
    }
    let ends = if is_far { vec![inner.0] } else { vec![inner.0, inner.1] };
    let is_end = ends.iter().any(|&end| facets.distance(points[end]) <= PRECISION * clearance);
    let rim = facets.within(at, RIM * clearance);
    let points: Vec<Stop> = points
        .iter()
        .map(|&at| Stop { at: user(at), width: 2.0 * unit * facets.distance(at) })
        .collect();
    let width = 2.0 * unit * clearance;
    Passage {
        spacing: Spacing::of(level, &case.root),
        narrowest: Narrowest {
            at: user(at),
            width,
            width_min: (1.0 - MARCH) * width,
            width_max: 2.0 * unit * bound,
            width_cells: width / Spacing::of(case.level_surface, &case.root).spacing,
            facets: rim.into_iter().map(|(facet, _)| facet).collect(),
            index,
            is_end,
        },
        inner,
        points,
    }
}
