//! Searches for the widest and for a short path in a graph: the free leaves of a base tree, joined where they share part
//! of a face, or the points of a grid.

use std::collections::BinaryHeap;

use contract::lattice::UNITS_PER_EDGE;

/// Places, numbered from 0, some of which are joined.
pub trait Graph {
    /// Number of places.
    fn count(&self) -> usize;
    /// Position of a place, in lattice units.
    fn position(&self, place: u32) -> [f64; 3];
    /// Whether a place is at the root's boundary.
    fn is_far(&self, place: u32) -> bool;
    /// Calls `visit` with every place that is joined to this one.
    fn joined(&self, place: u32, visit: &mut impl FnMut(u32));
}

/// The end of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// A place.
    Place(u32),
    /// Any place at the root's boundary.
    Far,
}

impl Goal {
    fn is_reached(self, graph: &impl Graph, place: u32) -> bool {
        match self {
            Self::Place(goal) => place == goal,
            Self::Far => graph.is_far(place),
        }
    }

    /// The point of the goal nearest to a point, or its position.
    fn nearest(self, graph: &impl Graph, at: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Place(goal) => graph.position(goal),
            Self::Far => nearest_boundary(at),
        }
    }
}

/// The search was interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

const NONE: u32 = u32::MAX;

/// Memory of searches in one graph, or in graphs of one size. What a search has not reached costs the next one nothing.
#[derive(Debug, Default)]
pub struct Memory {
    /// The place before each on the best path to it; [`NONE`] for a place that was not reached.
    via: Vec<u32>,
    /// The cost of this path, in searches for a short one.
    costs: Vec<f32>,
    reached: Vec<u32>,
}

impl Memory {
    fn clear(&mut self, count: usize) {
        if self.via.len() != count {
            (self.via, self.costs) = (vec![NONE; count], vec![f32::INFINITY; count]);
        }
        for place in self.reached.drain(..) {
            (self.via[place as usize], self.costs[place as usize]) = (NONE, f32::INFINITY);
        }
    }

    /// Enters a place into the paths.
    fn reach(&mut self, place: u32, via: u32, cost: f32) {
        if self.via[place as usize] == NONE {
            self.reached.push(place);
        }
        (self.via[place as usize], self.costs[place as usize]) = (via, cost);
    }

    /// The places from the start, which is its own predecessor, to a place.
    fn path(&self, mut place: u32) -> Vec<u32> {
        let mut path = vec![place];
        while self.via[place as usize] != place {
            place = self.via[place as usize];
            path.push(place);
        }
        path.reverse();
        path
    }
}

/// The path from `start` to the goal whose least `width` is greatest; `None` if there is no path. `width` is called with
/// a place and a neighbour reached before (`start` itself for the first). A place with a negative width is not entered.
///
/// Places are taken in order of the least width of the best path to them, so the first path to a place is one of the
/// widest (Dijkstra's algorithm with the minimum in place of the sum). Of equal ones the widest place is taken first, so
/// that the search makes for open space once it has passed the narrowest place.
///
/// # Errors
/// If `stop` returns true.
pub fn widest(
    graph: &impl Graph,
    start: u32,
    goal: Goal,
    mut width: impl FnMut(u32, u32) -> f32,
    memory: &mut Memory,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<u32>>, Interrupted> {
    memory.clear(graph.count());
    let mut heap = BinaryHeap::new();
    memory.reach(start, start, 0.0);
    // The bit patterns of floats that are not negative are in the order of the floats.
    let first = width(start, start).to_bits();
    heap.push((first, first, start));
    while let Some((least, _, place)) = heap.pop() {
        if goal.is_reached(graph, place) {
            return Ok(Some(memory.path(place)));
        }
        if stop() {
            return Err(Interrupted);
        }
        graph.joined(place, &mut |next| {
            if memory.via[next as usize] == NONE {
                memory.reach(next, place, 0.0);
                let own = width(next, place);
                if own >= 0.0 {
                    heap.push((least.min(own.to_bits()), own.to_bits(), next));
                }
            }
        });
    }
    Ok(None)
}

/// A path among the places of at least the width `least`, of at most `GREED` times the least cost; `None` if there is none.
/// A step costs its length, and up to twice as much where the place that it enters is narrow, so that the path keeps away from
/// facets where that is not a detour (the A* algorithm).
///
/// # Errors
/// If `stop` returns true.
pub fn shortest(
    graph: &impl Graph,
    start: u32,
    goal: Goal,
    least: f32,
    mut width: impl FnMut(u32, u32) -> f32,
    memory: &mut Memory,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<u32>>, Interrupted> {
    memory.clear(graph.count());
    let at = |place: u32| graph.position(place);
    let remaining = |place: u32| GREED * distance(at(place), goal.nearest(graph, at(place)));
    let mut heap = BinaryHeap::new();
    memory.reach(start, start, 0.0);
    heap.push((std::cmp::Reverse(remaining(start).to_bits()), 0, start));
    while let Some((_, cost, place)) = heap.pop() {
        let cost = f32::from_bits(cost);
        if goal.is_reached(graph, place) {
            return Ok(Some(memory.path(place)));
        }
        if cost > memory.costs[place as usize] {
            continue;
        }
        if stop() {
            return Err(Interrupted);
        }
        let here = at(place);
        graph.joined(place, &mut |next| {
            if memory.costs[next as usize] <= cost {
                return;
            }
            let wide = width(next, place);
            if wide < least {
                return;
            }
            let narrow = least / wide.max(f32::MIN_POSITIVE);
            let through = cost + distance(here, at(next)) * (1.0 + narrow);
            if through < memory.costs[next as usize] {
                memory.reach(next, place, through);
                let estimate = through + remaining(next);
                heap.push((std::cmp::Reverse(estimate.to_bits()), through.to_bits(), next));
            }
        });
    }
    Ok(None)
}

/// Factor of the distance to the goal in the estimated cost of a path: the mean cost of a step per length.
const GREED: f32 = 1.5;

/// The point of the root's boundary nearest to a point of the root, in lattice units.
pub fn nearest_boundary(at: [f64; 3]) -> [f64; 3] {
    let edge = UNITS_PER_EDGE as f64;
    let faces = (0..3).flat_map(|axis| [(axis, 0.0), (axis, edge)]);
    let distance = |&(axis, face): &(usize, f64)| (at[axis] - face).abs();
    let nearest = faces.min_by(|p, q| distance(p).total_cmp(&distance(q)));
    let (axis, face) = nearest.expect("a cube has faces");
    let mut on_face = at;
    on_face[axis] = face;
    on_face
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::super::leaves::Leaves;
    use super::*;
    use contract::octant::Octant;
    use contract::testing::words_with_sides;
    use contract::word::Side;
    use proptest::prelude::*;

    const NEVER: &dyn Fn() -> bool = &|| false;

    /// A random tree with random crossing leaves, and a random width for every leaf.
    fn random(seed: u64) -> Vec<u64> {
        let pick = |o: &Octant, salt: u64| {
            let key = contract::word::key_of(o.corner) << 5 | u64::from(o.level);
            (contract::digest::mix(key ^ seed.wrapping_mul(salt)) >> 100) as u64
        };
        let side = |o: &Octant| if pick(o, 7) % 3 == 0 { Side::Crossing } else { Side::Outside };
        words_with_sides(|o| o.level < 3 && pick(o, 3) % 5 < 3, |o| Some(side(o)))
    }

    fn width_of(leaf: u32) -> f32 {
        ((leaf.wrapping_mul(2654435761) >> 8) % 50) as f32
    }

    /// The least width of the widest paths to all leaves, by relaxation until nothing changes.
    fn relaxed(leaves: &Leaves, start: u32) -> Vec<f32> {
        let mut best = vec![-1.0f32; leaves.len()];
        best[start as usize] = width_of(start);
        loop {
            let mut changed = false;
            for leaf in (0..leaves.len() as u32).filter(|&l| leaves.is_free(l)) {
                leaves.neighbours(leaf, &mut |next| {
                    if leaves.is_free(next) {
                        let through = best[next as usize].min(width_of(leaf));
                        changed |= through > best[leaf as usize];
                        best[leaf as usize] = best[leaf as usize].max(through);
                    }
                });
            }
            if !changed {
                return best;
            }
        }
    }

    fn least_width(path: &[u32]) -> f32 {
        path.iter().map(|&l| width_of(l)).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn a_search_ends_when_it_is_interrupted_unless_it_is_there() {
        let words = contract::testing::words_of(|o| o.level < 2);
        let leaves = Leaves::new(&words).unwrap();
        let (stop, memory): (&dyn Fn() -> bool, _) = (&|| true, &mut Memory::default());
        let width = |_, _| 1.0;
        for (goal, expected) in [(63, Err(Interrupted)), (0, Ok(Some(vec![0])))] {
            let goal = Goal::Place(goal);
            assert_eq!(widest(&leaves, 0, goal, width, memory, stop), expected);
            assert_eq!(shortest(&leaves, 0, goal, 1.0, width, memory, stop), expected);
        }
    }

    #[test]
    fn a_step_costs_twice_its_length_where_it_is_as_narrow_as_possible() {
        // Two ways around the middle of 4 x 4 x 4 leaves: the one of wide leaves is as long, and cheaper.
        let words = contract::testing::words_of(|o| o.level < 2);
        let leaves = Leaves::new(&words).unwrap();
        let at = |x: u32, y: u32| {
            let half = 0.5 * UNITS_PER_EDGE as f64 / 4.0;
            leaves.locate([x, y, 0].map(|i| ((2 * i + 1) as f64 * half) as i64))
        };
        let (start, goal) = (at(0, 0), Goal::Place(at(3, 3)));
        for wide in [[at(1, 0), at(2, 0), at(3, 0)], [at(0, 1), at(0, 2), at(0, 3)]] {
            let width = |place, _| if wide.contains(&place) { 8.0 } else { 1.0 };
            let memory = &mut Memory::default();
            let path = shortest(&leaves, start, goal, 1.0, width, memory, NEVER).unwrap().unwrap();
            assert!(path.len() == 7 && wide.iter().all(|leaf| path.contains(leaf)), "{path:?}");
        }
    }

    #[test]
    fn the_nearest_point_of_the_boundary_is_on_the_nearest_face() {
        let edge = UNITS_PER_EDGE as f64;
        assert_eq!(nearest_boundary([5.0, 7.0, 9.0]), [0.0, 7.0, 9.0]);
        assert_eq!(nearest_boundary([edge - 5.0, 7.0, 9.0]), [edge, 7.0, 9.0]);
        assert_eq!(nearest_boundary([10.0, 7.0, edge - 6.0]), [10.0, 7.0, edge]);
        assert_eq!(nearest_boundary([10.0, 1.0, edge - 6.0]), [10.0, 0.0, edge - 6.0]);
    }

    proptest! {
        #[test]
        fn the_widest_path_is_as_wide_as_relaxation_finds(seed in any::<u64>()) {
            let words = random(seed);
            let leaves = Leaves::new(&words).unwrap();
            let free: Vec<u32> = (0..leaves.len() as u32).filter(|&l| leaves.is_free(l)).collect();
            prop_assume!(!free.is_empty());
            let start = free[seed as usize % free.len()];
            let best = relaxed(&leaves, start);
            let mut memory = Memory::default();
            for &goal in free.iter().step_by(1 + free.len() / 20) {
                let found = widest(&leaves, start, Goal::Place(goal), |l, _| width_of(l), &mut memory, NEVER).unwrap();
                prop_assert_eq!(found.is_some(), best[goal as usize] >= 0.0);
                let Some(path) = found else { continue };
                prop_assert_eq!((path[0], path[path.len() - 1]), (start, goal));
                let least = least_width(&path);
                prop_assert_eq!(least, best[goal as usize]);
                // A short path has the same ends and is as wide.
                let short = shortest(&leaves, start, Goal::Place(goal), least, |l, _| width_of(l), &mut memory, NEVER);
                let short = short.unwrap().unwrap();
                prop_assert!(short[1..].iter().all(|&l| width_of(l) >= least));
                for path in [path, short] {
                    let is_joined = path.windows(2).all(|pair| {
                        let mut joined = false;
                        leaves.neighbours(pair[0], &mut |next| joined |= next == pair[1]);
                        joined && leaves.is_free(pair[1])
                    });
                    prop_assert!(is_joined);
                }
            }
        }
    }
}
