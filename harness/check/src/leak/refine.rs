//! The widest path through cubes, which are split where the path is narrow until its width is known.
//!
//! No ball larger than the least radius of the cubes on the path passes; a ball as large as the least clearance does. Where
//! the two differ too much, only the cubes between both sides of the narrow place are split: those on the paths with the
//! fewest and smallest cubes whose centres are narrower than wanted. So the work grows with the size of the opening in
//! final cubes and not with the space around it. Tolerances go from coarse to fine, because the least radius is far too
//! great while the cubes are large.
//!
//! A slit is equally wide at many places, all of which would have to be split to prove which is widest. So the path is first
//! found to [`PROVEN`]; then only the surroundings of its narrowest place are split further.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

use super::clearance::{Clearance, Point};
use super::cubes::{Cubes, DIAGONAL, length};
use super::search::{self, Goal, Graph, Interrupted};

/// Tolerances of the width of the whole path, each of which is reached before the next. A path of tolerance t has a clearance
/// of at least 1 - 2.2 t times the least radius.
const TOLERANCES: [f64; 4] = [0.3, 0.06, 0.015, 0.005];

/// Tolerances near its narrowest place, each in smaller surroundings than the one before, but the last: it is for long narrow
/// places, where the path is too far from the middle at the edge of small surroundings.
const TOLERANCES_NEAR: [f64; 4] = [0.02, 0.006, 0.002, 0.004];

/// No path is wider than the path returned by more than this factor, apart from what is reported.
pub const PROVEN: f64 = 1.0 / (1.0 - 2.2 * TOLERANCES[2]);

/// Places of a path at which it is widened, at most.
const PLACES_MAX: usize = 100;

/// Cubes are split if they are on a path that has at most this times the least length in narrow cubes.
const SLACK: f64 = 1.2;

/// After so many more cubes, the width of the whole path is not proven further: up to [`PROVEN`], and to the last tolerance.
const CUBES_MAX: [usize; 2] = [3 << 13, 1 << 16];

/// The cubes of a path, each of which shares part of a face with the next.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The cubes, from the start to the goal.
    pub cubes: Vec<u32>,
    /// No ball with a greater radius passes through the adopted leaves.
    pub radius: f64,
    /// The tolerance of the whole path.
    tolerance: f64,
}

impl Refined {
    /// Whether no path is wider by more than [`PROVEN`].
    pub fn is_proven(&self) -> bool {
        self.tolerance <= TOLERANCES[2]
    }
}

/// Between which points a path leads; without an end, to the far field.
pub type Ends = (Point, Option<Point>);

/// The widest path through adopted leaves from the cube with one point to the cube with the other. `None` if no ball with a
/// radius of at least `wanted` passes.
///
/// # Errors
/// If `stop` returns true.
pub fn widest(
    cubes: &mut Cubes,
    clearance: &Clearance,
    ends: Ends,
    wanted: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Refined>, Interrupted> {
    /// Radii of the surroundings in clearances. Away from the narrowest place of a hole, the clearance grows with the square of
    /// the distance, so these are twice the square root of the tolerance before.
    const REACH: [f64; 4] = [0.49, 0.28, 0.155, 1.4];
    /// A place is long if the path is not wider than this factor at this distance, in clearances.
    const LONG: (f64, f64) = (1.03, 0.5);
    let everywhere = Place { centre: ends.0, reach: f64::INFINITY, around: HashSet::new() };
    let found = to_tolerances((cubes, clearance), ends, &TOLERANCES, &everywhere, wanted, stop)?;
    let Some(mut refined) = found else { return Ok(None) };
    let done = TOLERANCES_NEAR.iter().take_while(|&&t| t >= refined.tolerance).count();
    // Centres of places and the number of tolerances reached there.
    let mut best = (0.0, Vec::new());
    let mut known: Vec<(Point, usize)> = Vec::new();
    for _ in 0..PLACES_MAX {
        let path = &refined.cubes;
        let spot = |i: usize| {
            let own = (cubes.position(path[i]), cubes.clearance(path[i]));
            let Some(&next) = path.get(i + 1) else { return own };
            let face = cubes.shared_face_centre(path[i], next);
            let at_face = clearance.at(face, own.1 + cubes.half(path[i]) * DIAGONAL);
            if at_face < own.1 { (face, at_face) } else { own }
        };
        let spots: Vec<(Point, f64)> = (0..path.len()).map(spot).collect();
        let order = |&a: &usize, &b: &usize| spots[a].1.total_cmp(&spots[b].1);
        let throat = (0..path.len()).min_by(order).expect("a path has cubes");
        let (centre, least) = spots[throat];
        if least > best.0 {
            best = (least, path.clone());
        }
        let reach = |stage: usize| REACH[stage] * least;
        let is_known =
            |&&(at, stage): &&(Point, usize)| length(at, centre) < reach(stage - 1) / 2.0;
        let stage = known.iter().filter(is_known).map(|known| known.1).max().unwrap_or(done);
        let Some(&tolerance) = TOLERANCES_NEAR.get(stage) else { break };
        let is_long = |spot: &(Point, f64)| {
            spot.1 <= LONG.0 * least && length(spot.0, centre) > LONG.1 * least
        };
        if stage + 1 == TOLERANCES_NEAR.len() && !spots.iter().any(is_long) {
            break;
        }
        known.push((centre, stage + 1));
        let next = path.get(throat + 1).map_or(0.0, |&next| cubes.half(next));
        let largest = DIAGONAL * cubes.half(path[throat]).max(next);
        let reach = reach(stage) + 3.0 * largest;
        let mut place = Place { centre, reach, around: HashSet::new() };
        place.around = path.iter().copied().filter(|&cube| !place.has(cubes, cube)).collect();
        let is_inside = |i: &usize| !place.around.contains(&path[*i]);
        let first = (0..path.len()).find(is_inside).and_then(|i| i.checked_sub(1));
        let last = (0..path.len()).rfind(is_inside).map(|i| i + 1).filter(|&i| i < path.len());
        let at = |i: usize| cubes.position(path[i]);
        let ends_near = (first.map_or(ends.0, at), last.map(at).or(ends.1));
        let found =
            to_tolerances((cubes, clearance), ends_near, &[tolerance], &place, least, stop)?;
        let Some(near) = found else { break };
        let (first, last) = (first.unwrap_or(0), last.unwrap_or(path.len() - 1));
        refined.cubes.splice(first..=last, near.cubes);
    }
    Ok(Some(Refined { cubes: best.1, ..refined }))
}

/// The widest path to the last of some tolerances; only cubes at a place are split.
fn to_tolerances(
    (cubes, clearance): (&mut Cubes, &Clearance),
    ends: Ends,
    tolerances: &[f64],
    place: &Place,
    wanted: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Refined>, Interrupted> {
    let count = cubes.count();
    let mut tolerances = tolerances.iter().copied().peekable();
    let mut tolerance = tolerances.next().expect("at least one tolerance");
    let mut reached = 1.0;
    loop {
        let width = |cube, _| place.radius(cubes, cube) as f32;
        let (from, to) = in_cubes(cubes, ends);
        let Some(path) = search::widest(cubes, from, to, width, stop)? else { return Ok(None) };
        let radius = path.iter().map(|&c| place.radius(cubes, c)).fold(f64::INFINITY, f64::min);
        if radius < wanted {
            return Ok(None);
        }
        let [radius_least, clearance_least] = [0.25, 2.0].map(|t| radius * (1.0 - t * tolerance));
        // A place that was widened before must not become narrower again.
        let clearance_least = match place.around.is_empty() {
            true => clearance_least,
            false => clearance_least.max(0.998 * wanted),
        };
        let narrow = Narrow { radius: radius_least, clearance: clearance_least, place };
        while let Some(mut split) = narrow.between(cubes, ends, stop)? {
            let is_full = place.around.is_empty()
                && cubes.count() - count > CUBES_MAX[usize::from(tolerance < TOLERANCES[2])];
            if split.is_empty() {
                reached = tolerance;
            }
            if split.is_empty() && !is_full && tolerances.peek().is_some() {
                tolerance = tolerances.next().expect("there is another");
                break;
            }
            if split.is_empty() || is_full {
                let path = narrow.path(cubes, ends, stop)?;
                split = blocked(cubes, clearance, &path, radius * (1.0 - 2.2 * tolerance));
                split.retain(|&cube| place.has(cubes, cube));
                if split.is_empty() || is_full {
                    return Ok(Some(Refined { cubes: path, radius, tolerance: reached }));
                }
            }
            split.into_iter().for_each(|cube| cubes.split(cube));
        }
    }
}

/// Where cubes are split: a ball.
#[derive(Debug)]
struct Place {
    centre: Point,
    /// Its radius.
    reach: f64,
    /// Cubes outside of it that the path may pass.
    around: HashSet<u32>,
}

impl Place {
    /// Whether the whole of a cube is in the ball.
    fn has(&self, cubes: &Cubes, cube: u32) -> bool {
        length(cubes.position(cube), self.centre) + DIAGONAL * cubes.half(cube) <= self.reach
    }

    /// The radius of a cube at this place; infinite around it, or -1 where the path may not pass.
    fn radius(&self, cubes: &Cubes, cube: u32) -> f64 {
        match self.has(cubes, cube) {
            true => cubes.radius(cube),
            false if self.around.contains(&cube) => f64::INFINITY,
            false => -1.0,
        }
    }
}

/// Cubes on the path within which a segment of the path is nearer to a facet than `least`.
fn blocked(cubes: &Cubes, clearance: &Clearance, path: &[u32], least: f64) -> Vec<u32> {
    let mut blocked = Vec::new();
    for pair in path.windows(2) {
        let at = cubes.shared_face_centre(pair[0], pair[1]);
        let face = (at, clearance.at(at, f64::INFINITY));
        for &cube in pair {
            let centre = (cubes.position(cube), cubes.clearance(cube));
            if blocked.last() != Some(&cube) && !is_clear(clearance, centre, face, least) {
                blocked.push(cube);
            }
        }
    }
    blocked
}

/// Whether no facet is nearer than `least` to a segment, whose ends are given with their clearance. Dips of a thousandth
/// are overlooked.
fn is_clear(clearance: &Clearance, a: (Point, f64), b: (Point, f64), least: f64) -> bool {
    let apart = length(a.0, b.0);
    if a.1 < least || b.1 < least {
        return false;
    }
    if a.1 + b.1 - apart >= 2.0 * least || apart <= least * 1e-3 {
        return true;
    }
    let at: Point = std::array::from_fn(|i| (a.0[i] + b.0[i]) / 2.0);
    let middle = (at, clearance.at(at, a.1 + apart));
    is_clear(clearance, a, middle, least) && is_clear(clearance, middle, b, least)
}

fn in_cubes(cubes: &Cubes, (start, goal): Ends) -> (u32, Goal) {
    let cube = |at| cubes.at(at).expect("the leaves of the ends were adopted");
    (cube(start), goal.map_or(Goal::Far, |at| Goal::Place(cube(at))))
}

/// What is wanted of cubes: a path through cubes of at least this radius and, if possible, of at least this clearance.
struct Narrow<'a> {
    radius: f64,
    clearance: f64,
    place: &'a Place,
}

impl Narrow<'_> {
    /// The cubes to split: none if a path through cubes with the clearance joins the ends. `None` if no path through cubes
    /// with the radius does.
    fn between(
        &self,
        cubes: &Cubes,
        ends: Ends,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<u32>>, Interrupted> {
        if stop() {
            return Err(Interrupted);
        }
        let (from, to) = in_cubes(cubes, ends);
        let there = self.lengths(cubes, vec![from], f64::INFINITY);
        let goals: Vec<u32> = match to {
            Goal::Place(cube) => vec![cube],
            Goal::Far => (0..there.len() as u32).filter(|&c| cubes.is_far(c)).collect(),
        };
        let goals: Vec<u32> =
            goals.into_iter().filter(|&c| there[c as usize].is_finite()).collect();
        let least = goals.iter().map(|&c| there[c as usize]).fold(f64::INFINITY, f64::min);
        if least.is_infinite() {
            return Ok(None);
        }
        if least == 0.0 {
            return Ok(Some(Vec::new()));
        }
        let back = self.lengths(cubes, goals, SLACK * least);
        let is_between = |&cube: &u32| {
            let (there, back, own) =
                (there[cube as usize], back[cube as usize], self.length(cubes, cube));
            own.is_some_and(|own| own > 0.0 && there + back - own <= SLACK * least)
        };
        let reached = (0..there.len() as u32).filter(|&c| back[c as usize].is_finite());
        Ok(Some(reached.filter(is_between).collect()))
    }

    /// The length of a path in a cube that counts: 0 if the cube's centre is wide enough, `None` if no point of it is.
    fn length(&self, cubes: &Cubes, cube: u32) -> Option<f64> {
        if !self.place.has(cubes, cube) {
            return self.place.around.contains(&cube).then_some(0.0);
        }
        match cubes.clearance(cube) {
            wide if wide >= self.clearance => Some(0.0),
            _ if cubes.radius(cube) >= self.radius => Some(2.0 * cubes.half(cube)),
            _ => None,
        }
    }

    /// The least length in narrow cubes of the paths from some cubes to every cube; infinite where it exceeds `most`.
    fn lengths(&self, cubes: &Cubes, from: Vec<u32>, most: f64) -> Vec<f64> {
        let mut lengths = vec![f64::INFINITY; cubes.count()];
        let mut heap = BinaryHeap::new();
        for cube in from {
            if let Some(own) = self.length(cubes, cube) {
                lengths[cube as usize] = own;
                heap.push((Reverse(own.to_bits()), cube));
            }
        }
        while let Some((Reverse(length), cube)) = heap.pop() {
            let length = f64::from_bits(length);
            if length > lengths[cube as usize] {
                continue;
            }
            cubes.joined(cube, &mut |next| {
                if lengths[next as usize] <= length {
                    return;
                }
                let Some(own) = self.length(cubes, next) else { return };
                let through = length + own;
                if through < lengths[next as usize] && through <= most {
                    lengths[next as usize] = through;
                    heap.push((Reverse(through.to_bits()), next));
                }
            });
        }
        lengths
    }

    /// A short path through cubes with the clearance or, if they do not join the ends, with the radius.
    fn path(
        &self,
        cubes: &Cubes,
        ends: Ends,
        stop: &dyn Fn() -> bool,
    ) -> Result<Vec<u32>, Interrupted> {
        let (from, to) = in_cubes(cubes, ends);
        let clear = |cube, _| match self.length(cubes, cube) {
            Some(0.0) => cubes.clearance(cube).max(self.clearance) as f32,
            _ => -1.0,
        };
        if let Some(path) = search::shortest(cubes, from, to, self.clearance as f32, clear, stop)? {
            return Ok(path);
        }
        let width = |cube, _| match self.place.has(cubes, cube) || self.place.around.contains(&cube)
        {
            true => cubes.clearance(cube) as f32,
            false => -1.0,
        };
        let path = search::widest(cubes, from, to, width, stop)?;
        Ok(path.expect("the leaves are joined"))
    }
}
