//! A cubic grid of points with their distances to the nearest facet.

use super::clearance::{Clearance, Point, ROUNDING, nearest};
use super::search::Graph;
use crate::geometry::distance::{Prepared, length, sub};

/// Half of a grid's edge, in steps.
pub const STEPS: i32 = 8;

/// A cubic grid of points, each joined to the 26 around it.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// The point in the middle.
    pub centre: Point,
    /// Distance of neighbours along an axis.
    pub step: f64,
}

/// Distances from the points of a grid to the nearest facet. The points of a block share the search for facets that can be the
/// nearest, and so do the blocks where these are few.
#[derive(Debug)]
pub struct Distances<'a> {
    grid: &'a Grid,
    clearance: &'a Clearance<'a>,
    /// Greater distances are not measured.
    open: f64,
    /// The facets that can be the nearest of any point, with their distances from the grid's centre, nearest first. If they are many, those
    /// of the blocks, with their distances from these.
    triangles: Vec<(Prepared, f64)>,
    /// Whether [`Self::triangles`] are of the whole grid.
    is_shared: bool,
    blocks: Vec<Option<Block>>,
}

/// A cube of [`BLOCK`]^3 points of a grid.
#[derive(Clone, Debug)]
struct Block {
    centre: Point,
    /// The triangles that can be the nearest of its points, with their distances from the centre, nearest first; `None` if they
    /// are many.
    near: Option<Vec<(u32, f64)>>,
}

/// Points of a block along an edge.
const BLOCK: i32 = 4;

/// Half of a block's edge, in steps.
const BLOCK_HALF: f64 = (BLOCK - 1) as f64 / 2.0;

/// Blocks of a grid along an edge.
const BLOCKS: i32 = (SIDE + BLOCK - 1) / BLOCK;

/// A list of more facets takes longer than a search for the nearest of all.
const FACETS_FEW: usize = 128;

impl<'a> Distances<'a> {
    /// No distance is known yet.
    pub fn new(grid: &'a Grid, clearance: &'a Clearance<'a>, open: f64) -> Self {
        let blocks = vec![None; (BLOCKS * BLOCKS * BLOCKS) as usize];
        let radius = 3f64.sqrt() * f64::from(STEPS) * grid.step;
        let triangles = clearance.near(grid.centre, radius, open, FACETS_FEW);
        let is_shared = triangles.is_some();
        Self { grid, clearance, open, triangles: triangles.unwrap_or_default(), is_shared, blocks }
    }

    /// Distance from a point to the nearest facet, or `open` if it is greater.
    pub fn at(&mut self, place: u32) -> f64 {
        let indices = Grid::indices(place).map(|i| i / BLOCK);
        let [x, y, z] = indices;
        let block = ((z * BLOCKS + y) * BLOCKS + x) as usize;
        if self.blocks[block].is_none() {
            self.blocks[block] = Some(self.block(indices));
        }
        let point = self.grid.position(place);
        match &self.blocks[block] {
            Some(Block { centre, near: Some(near) }) => {
                let triangles = near.iter().map(|&(i, from)| (&self.triangles[i as usize].0, from));
                nearest(triangles, point, length(sub(point, *centre)), 0.0)
                    .unwrap_or(0.0)
                    .min(self.open)
            }
            _ => self.clearance.at(point, self.open).min(self.open),
        }
    }

    fn block(&mut self, indices: [i32; 3]) -> Block {
        let Grid { centre, step } = *self.grid;
        let centre: Point = std::array::from_fn(|a| {
            centre[a] + (f64::from(indices[a] * BLOCK - STEPS) + BLOCK_HALF) * step
        });
        let radius = 3f64.sqrt() * BLOCK_HALF * step;
        if !self.is_shared {
            let near = self.clearance.near(centre, radius, self.open, FACETS_FEW);
            let first = self.triangles.len() as u32;
            let near = near.map(|near| {
                self.triangles.extend(&near);
                (first..).zip(near).map(|(i, (_, from))| (i, from)).collect()
            });
            return Block { centre, near };
        }
        // As in `Clearance::near`, which searches for the same among all facets.
        let (mut near, mut reach) = (Vec::new(), self.open + radius + ROUNDING);
        let offset = length(sub(centre, self.grid.centre));
        for (i, (triangle, from)) in (0u32..).zip(&self.triangles) {
            if from - offset > reach {
                break;
            }
            let from = triangle.squared(centre).sqrt();
            reach = reach.min(from + 2.0 * radius + ROUNDING);
            near.push((i, from));
        }
        near.retain(|&(_, from)| from <= reach);
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        Block { centre, near: Some(near) }
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
            centre in prop::array::uniform3(0.0f64..4000.0), step in 0.01f64..100.0, is_repeated in any::<bool>(),
            open in prop_oneof![Just(f64::INFINITY), 0.0f64..2000.0],
        ) {
            // More facets may be near a point than are searched one by one.
            let copies = if is_repeated { 2 * FACETS_FEW } else { 0 };
            let facets: Vec<FacetLattice> =
                facets.iter().copied().chain(std::iter::repeat_n(facets[0], copies)).collect();
            let clearance = Clearance::new(&facets);
            let grid = Grid { centre, step };
            let mut distances = Distances::new(&grid, &clearance, open);
            for place in (0..grid.count() as u32).step_by(97) {
                let expected = clearance.at(grid.position(place), f64::INFINITY).min(open);
                let found = distances.at(place);
                prop_assert!((found - expected).abs() <= 1e-9 * expected, "{} for {}", found, expected);
                prop_assert!(!grid.is_far(place));
            }
        }
    }
}
