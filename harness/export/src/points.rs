//! Points without duplicates, numbered in the order in which they were added, and the polygons that join them.

use contract::lattice::{Root, cross};
use contract::octant::UNITS_PER_CELL;
use rustc_hash::FxHashMap;

/// A point, in level-19 cells from the root's minimum corner: up to `CELLS_PER_EDGE`, inclusive.
pub type Point = [u32; 3];

/// A point in the user's units.
pub fn to_user(point: &Point, root: &Root) -> [f64; 3] {
    root.to_user(point.map(|c| i64::from(c) * UNITS_PER_CELL))
}

/// The points.
#[derive(Debug, Default)]
pub struct Points {
    /// The points in the order of their numbers.
    pub all: Vec<Point>,
    numbers: FxHashMap<Point, u32>,
}

impl Points {
    /// Returns the number of a point, which is added if it is new. 2^32 points, which would take far more than 100 GB, are a panic.
    pub fn add(&mut self, point: Point) -> u32 {
        let next = u32::try_from(self.all.len()).expect("fewer than 2^32 points");
        let number = *self.numbers.entry(point).or_insert(next);
        if number == next {
            self.all.push(point);
        }
        number
    }

    /// Removes all points. Their memory remains.
    pub fn clear(&mut self) {
        self.all.clear();
        self.numbers.clear();
    }

    /// Twice the area vector of a polygon of these points, in level-19 cells.
    pub fn area(&self, polygon: &[u32]) -> [i64; 3] {
        let corner = |number: u32| self.all[number as usize].map(i64::from);
        let products = edges(polygon).map(|(p, q)| cross(corner(p), corner(q)));
        products.fold([0; 3], |sum, product| std::array::from_fn(|a| sum[a] + product[a]))
    }

    /// Appends the points within an edge, in order: those that bisect it, or bisect a half of it, and so on. Squares are aligned with the
    /// oct-tree, so where there are any, one is the middle.
    fn hanging(&self, from: Point, to: Point, polygon: &mut Vec<u32>) {
        let middle: Point = std::array::from_fn(|a| u32::midpoint(from[a], to[a]));
        let number = self.numbers.get(&middle).filter(|_| middle != from && middle != to);
        if let Some(&number) = number {
            self.hanging(from, middle, polygon);
            polygon.push(number);
            self.hanging(middle, to, polygon);
        }
    }
}

/// The edges of a polygon, each from one corner to the next.
pub fn edges(polygon: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    let corners = polygon.iter().copied();
    corners.clone().zip(corners.cycle().skip(1))
}

/// Polygons, each by the numbers of the points around it.
#[derive(Clone, Debug, Default)]
pub struct Polygons {
    /// The corners of all polygons, one polygon after the other.
    pub corners: Vec<u32>,
    /// One past the last corner of each polygon.
    pub ends: Vec<u64>,
}

impl Polygons {
    /// Adds a square with these corners and the points on its edges, the first corner first.
    pub fn push(&mut self, points: &Points, corners: [Point; 4]) {
        for (i, corner) in corners.iter().enumerate() {
            self.corners.push(points.numbers[corner]);
            points.hanging(*corner, corners[(i + 1) % 4], &mut self.corners);
        }
        self.ends.push(self.corners.len() as u64);
    }

    /// The corners of each polygon.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let begins = std::iter::once(&0).chain(&self.ends);
        begins.zip(&self.ends).map(|(&begin, &end)| &self.corners[begin as usize..end as usize])
    }
}
