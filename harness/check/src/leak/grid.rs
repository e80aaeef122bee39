//! A cubic grid of points with their distances to the nearest facet.

use super::clearance::{Clearance, Point};
use super::search::Graph;
use crate::geometry::distance::{length, sub};

/// Half of a grid's edge, in steps.
pub const STEPS: i32 = 16;

/// A cubic grid of points, each joined to the 26 around it.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// The point in the middle.
    pub centre: Point,
    /// Distance of neighbours along an axis.
    pub step: f64,
}

/// Distances from the points of a grid to the nearest facet. The points of a block share the search for facets that can be the
/// nearest.
#[derive(Debug)]
pub struct Distances<'a> {
    grid: &'a Grid,
    clearance: &'a Clearance<'a>,
    blocks: Vec<Option<Block>>,
}

/// A cube of [`BLOCK`]^3 points of a grid.
#[derive(Clone, Debug)]
struct Block {
    centre: Point,
    /// The facets that can be the nearest of its points, with their distances from the centre; none if they are many.
    near: Vec<(u32, f64)>,
}

/// Points of a block along an edge.
const BLOCK: i32 = 4;

/// Blocks of a grid along an edge.
const BLOCKS: i32 = (SIDE + BLOCK - 1) / BLOCK;

impl<'a> Distances<'a> {
    /// No distance is known yet.
    pub fn new(grid: &'a Grid, clearance: &'a Clearance<'a>) -> Self {
        let blocks = vec![None; (BLOCKS * BLOCKS * BLOCKS) as usize];
        Self { grid, clearance, blocks }
    }

    /// Distance from a point to the nearest facet; `bound` is an upper bound that the caller knows.
    pub fn at(&mut self, place: u32, bound: f64) -> f64 {
        let [x, y, z] = Grid::indices(place).map(|i| i / BLOCK);
        let Self { grid, clearance, blocks } = self;
        let block = blocks[((z * BLOCKS + y) * BLOCKS + x) as usize]
            .get_or_insert_with(|| Block::new([x, y, z], grid, clearance));
        let point = grid.position(place);
        match block.near.is_empty() {
            true => clearance.at(point, bound),
            false => clearance.among(&block.near, point, length(sub(point, block.centre))),
        }
    }
}

impl Block {
    fn new(indices: [i32; 3], grid: &Grid, clearance: &Clearance) -> Self {
        /// A list of more facets takes longer than a search for the nearest of all.
        const FACETS_FEW: usize = 128;
        let half = f64::from(BLOCK - 1) / 2.0;
        let centre = std::array::from_fn(|a| {
            grid.centre[a] + (f64::from(indices[a] * BLOCK - STEPS) + half) * grid.step
        });
        let mut near = clearance.near(centre, 3f64.sqrt() * half * grid.step);
        if near.len() > FACETS_FEW {
            near = Vec::new();
        }
        Self { centre, near }
    }
}

/// Points of a grid along an edge.
const SIDE: i32 = 2 * STEPS + 1;

impl Grid {
    /// The point nearest to a position.
    pub fn nearest(&self, at: Point) -> u32 {
        let index = |a: usize| {
            let steps = ((at[a] - self.centre[a]) / self.step).round() as i32;
            steps.clamp(-STEPS, STEPS) + STEPS
        };
        ((index(2) * SIDE + index(1)) * SIDE + index(0)) as u32
    }

    /// Whether a place is far from the grid's edge.
    pub fn is_inner(place: u32) -> bool {
        Self::indices(place).iter().all(|i| (i - STEPS).abs() <= STEPS * 3 / 4)
    }

    fn indices(place: u32) -> [i32; 3] {
        let place = place as i32;
        [place % SIDE, place / SIDE % SIDE, place / SIDE / SIDE]
    }
}

impl Graph for Grid {
    fn count(&self) -> usize {
        (SIDE * SIDE * SIDE) as usize
    }

    fn position(&self, place: u32) -> Point {
        let indices = Self::indices(place);
        std::array::from_fn(|a| self.centre[a] + f64::from(indices[a] - STEPS) * self.step)
    }

    fn is_far(&self, _: u32) -> bool {
        false
    }

    fn joined(&self, place: u32, visit: &mut impl FnMut(u32)) {
        let [x, y, z] = Self::indices(place);
        let around = |i: i32| (i - 1).max(0)..=(i + 1).min(SIDE - 1);
        for k in around(z) {
            for j in around(y) {
                for i in around(x) {
                    if (i, j, k) != (x, y, z) {
                        visit(((k * SIDE + j) * SIDE + i) as u32);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::FacetLattice;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_of_grid_points_are_those_of_a_search_among_all_facets(
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0i64..4000)), 1..300),
            centre in prop::array::uniform3(0.0f64..4000.0), step in 0.01f64..100.0
        ) {
            let clearance = Clearance::new(&facets as &[FacetLattice]);
            let grid = Grid { centre, step };
            let mut distances = Distances::new(&grid, &clearance);
            for place in (0..grid.count() as u32).step_by(977) {
                let expected = clearance.at(grid.position(place), f64::INFINITY);
                prop_assert_eq!(distances.at(place, f64::INFINITY), expected);
            }
        }
    }
}
