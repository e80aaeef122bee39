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
/// Cells whose points are sorted at once.
const CHUNK: u32 = 1 << 12;

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
        let (mut keys, mut begin, mut of_cell) = (Vec::new(), 0, Vec::new());
        leaves.walk(options, &mut |number, around| {
            squares(leaves, around, &mut of_cell);
            let edge = around.octant.edge();
            let corner = |d: u32| {
                key(std::array::from_fn(|a| around.octant.corner[a] + edge * (d >> a & 1)))
            };
            keys.extend((0..8).map(corner));
            let of_boundary = of_cell.iter().filter(|square| square.across.as_cell().is_none());
            keys.extend(of_boundary.flat_map(|square| square.corners().map(key)));
            // Most points are those of cells that follow each other.
            if number % CHUNK == CHUNK - 1 {
                begin = sort_from(&mut keys, begin);
            }
            Ok(())
        })?;
        sort_from(&mut keys, begin);
        // Sorted runs are merged.
        keys.sort();
        keys.dedup();
        if keys.len() > POINTS_MAX {
            return Err(Failure::input(format!(
                "a polyMesh can have {POINTS_MAX} points here: select fewer leaves"
            )));
        }
        let numbers = keys.iter().copied().zip(0..).collect();
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

/// Sorts the keys from an index on, without repetitions; returns their new number.
fn sort_from(keys: &mut Vec<u64>, begin: usize) -> usize {
    let mut last = keys.split_off(begin);
    last.sort_unstable();
    last.dedup();
    keys.append(&mut last);
    keys.len()
}
