//! The points of a mesh and their numbers: the corners of cells, and of the squares into which their faces are split where cells are missing.
//!
//! Invariants: points ascend in Morton order; their numbers are their indices.

use contract::octant::CELLS_PER_EDGE;
use contract::word::{self, KEY_END};
use rustc_hash::FxHashMap;

use crate::front::polygons::hanging;
use crate::leaves::{Leaves, Point};
use crate::options::Options;
use crate::squares::{Square, squares};
use contract::failure::Failure;

/// Number of points that can be distinguished.
const POINTS_MAX: usize = u32::MAX as usize;

/// The points, as Morton codes with 20 bits per axis, and the number of each.
#[derive(Debug, Default)]
pub struct Points {
    keys: Vec<u64>,
    numbers: FxHashMap<u64, u32>,
}

/// The Morton code of a point.
fn key(point: Point) -> u64 {
    let beyond = |a: usize| u64::from(point[a] / CELLS_PER_EDGE) << a;
    ((beyond(0) | beyond(1) | beyond(2)) * KEY_END)
        | word::key_of(point.map(|c| c % CELLS_PER_EDGE))
}

impl Points {
    /// The points of the cells among leaves.
    ///
    /// # Errors
    /// If there are too many, or if the user interrupts.
    pub fn new(leaves: &Leaves, options: &Options) -> Result<Self, Failure> {
        let (mut numbers, mut of_cell) = (FxHashMap::default(), Vec::new());
        leaves.walk(options, &mut |_, around| {
            squares(leaves, around, &mut of_cell);
            let edge = around.octant.edge();
            let corner =
                |d: u32| std::array::from_fn(|a| around.octant.corner[a] + edge * (d >> a & 1));
            let of_boundary = of_cell.iter().filter(|square| square.across.as_cell().is_none());
            let points = (0..8).map(corner).chain(of_boundary.flat_map(Square::corners));
            numbers.extend(points.map(|point| (key(point), 0)));
            Ok(())
        })?;
        let mut keys: Vec<u64> = numbers.keys().copied().collect();
        keys.sort_unstable();
        if keys.len() > POINTS_MAX {
            return Err(Failure::input(format!(
                "a polyMesh can have {POINTS_MAX} points here: select fewer leaves"
            )));
        }
        numbers.extend(keys.iter().copied().zip(0..));
        Ok(Self { keys, numbers })
    }

    /// Number of points.
    pub fn count(&self) -> u32 {
        self.keys.len() as u32
    }

    /// The point with a number.
    pub fn at(&self, number: u32) -> Point {
        let key = self.keys[number as usize];
        let corner = word::corner_of(key % KEY_END);
        std::array::from_fn(|a| corner[a] + ((key / KEY_END) as u32 >> a & 1) * CELLS_PER_EDGE)
    }

    fn number(&self, point: Point) -> Option<u32> {
        self.numbers.get(&key(point)).copied()
    }

    /// Appends the numbers of the points on the edges of a square of a cell, around a normal that points away from the cell, the
    /// minimum corner first.
    pub fn polygon(&self, square: &Square, polygon: &mut Vec<u32>) {
        let mut corners = square.corners();
        if !square.is_high {
            corners[1..].reverse();
        }
        for (i, &corner) in corners.iter().enumerate() {
            polygon.push(self.number(corner).expect("the corners of a face are points"));
            hanging(corner, corners[(i + 1) % 4], &|point| self.number(point), polygon);
        }
    }
}
