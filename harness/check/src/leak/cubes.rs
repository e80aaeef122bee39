//! Leaves that are split into ever smaller cubes, with the distance from each centre to the nearest facet.
//!
//! The *radius* of a cube is the greatest distance to a facet that any of its points can have: that of its centre plus
//! half of its diagonal. A ball that passes through cubes is never larger than the least of their radii, and the smaller
//! the cubes, the less the radii exceed the distances.
//!
//! Invariants: a cube is *live* unless it was split; `joined` of a live cube lists the live cubes and the other leaves
//! that share part of a face with it.

use std::cell::Cell;
use std::collections::HashMap;

use super::clearance::{Clearance, Point};
use super::leaves::Leaves;
use super::search::Graph;
use crate::geometry::distance::{dot, sub};
use contract::lattice::UNITS_PER_EDGE;

/// Bit of an entry of [`Cube::joined`] that refers to a leaf of which there are no cubes.
const LEAF: u32 = 1 << 31;

/// Half of a cube's diagonal in parts of half its edge: the square root of 3.
pub const DIAGONAL: f64 = 1.732_050_807_568_877_2;

#[derive(Debug)]
struct Cube {
    centre: Point,
    /// Half of the edge.
    half: f64,
    /// Distance from the centre to the nearest facet; NaN where it is not known yet.
    clearance: Cell<f64>,
    /// A distance that the clearance does not exceed.
    bound: f64,
    /// The first of the eight children, which are contiguous; 0 for a live cube.
    children: u32,
    joined: Vec<u32>,
}

impl Cube {
    fn shares_a_face(&self, centre: Point, half: f64) -> bool {
        let overlap = |a: usize| self.half + half - (self.centre[a] - centre[a]).abs();
        let [x, y, z] = [0, 1, 2].map(overlap);
        let touches = [x, y, z].iter().filter(|&&o| o == 0.0).count() == 1;
        touches && [x, y, z].iter().all(|&o| o >= 0.0)
    }
}

/// The cubes of some leaves, which need not be free. They are numbered from 0.
#[derive(Debug)]
pub struct Cubes<'a> {
    leaves: &'a Leaves<'a>,
    clearance: &'a Clearance<'a>,
    cubes: Vec<Cube>,
    /// The cubes that are as large as a leaf.
    whole: HashMap<u32, u32>,
}

impl<'a> Cubes<'a> {
    /// No cubes.
    pub fn new(leaves: &'a Leaves<'a>, clearance: &'a Clearance<'a>) -> Self {
        Self { leaves, clearance, cubes: Vec::new(), whole: HashMap::new() }
    }

    /// Makes a leaf a cube, unless it is one.
    pub fn adopt(&mut self, leaf: u32) {
        if self.whole.contains_key(&leaf) {
            return;
        }
        let cube = self.cubes.len() as u32;
        let (low, high) = self.leaves.octant(leaf).bounds();
        let (centre, half) = (self.leaves.position(leaf), (high[0] - low[0]) as f64 / 2.0);
        let mut joined = Vec::new();
        self.leaves.neighbours(leaf, &mut |next| match self.whole.get(&next) {
            None => joined.push(LEAF | next),
            Some(&whole) => self.touching(whole, centre, half, &mut |cube| joined.push(cube)),
        });
        for &next in joined.iter().filter(|&&next| next & LEAF == 0) {
            replace(&mut self.cubes[next as usize].joined, LEAF | leaf, &[cube]);
        }
        let clearance = Cell::new(f64::NAN);
        self.cubes.push(Cube {
            centre,
            half,
            clearance,
            bound: f64::INFINITY,
            children: 0,
            joined,
        });
        self.whole.insert(leaf, cube);
    }

    /// Whether a leaf was made a cube.
    pub fn is_adopted(&self, leaf: u32) -> bool {
        self.whole.contains_key(&leaf)
    }

    /// Replaces a live cube by its eight children.
    pub fn split(&mut self, cube: u32) {
        // A step changes the distance to the nearest facet by no more than its length.
        let bound = self.clearance(cube) + DIAGONAL * self.half(cube) / 2.0;
        let first = self.cubes.len() as u32;
        let parent = &mut self.cubes[cube as usize];
        parent.children = first;
        let (centre, half) = (parent.centre, parent.half / 2.0);
        let outer = std::mem::take(&mut parent.joined);
        for digit in 0..8u32 {
            let centre: Point =
                std::array::from_fn(|a| centre[a] + if digit >> a & 1 == 1 { half } else { -half });
            let joined = [1, 2, 4].map(|axis| first + (digit ^ axis)).to_vec();
            let clearance = Cell::new(f64::NAN);
            self.cubes.push(Cube { centre, half, clearance, bound, children: 0, joined });
        }
        for &next in &outer {
            let (position, size) = self.extent(next);
            let touching: Vec<u32> = (first..first + 8)
                .filter(|&child| self.cubes[child as usize].shares_a_face(position, size))
                .collect();
            for &child in &touching {
                self.cubes[child as usize].joined.push(next);
            }
            if next & LEAF == 0 {
                replace(&mut self.cubes[next as usize].joined, cube, &touching);
            }
        }
    }

    /// Centre and half of the edge of an entry of [`Cube::joined`].
    fn extent(&self, entry: u32) -> (Point, f64) {
        if entry & LEAF == 0 {
            let cube = &self.cubes[entry as usize];
            return (cube.centre, cube.half);
        }
        let leaf = entry & !LEAF;
        let (low, high) = self.leaves.octant(leaf).bounds();
        (self.leaves.position(leaf), (high[0] - low[0]) as f64 / 2.0)
    }

    /// The live cube with a point, if its leaf was adopted.
    pub fn at(&self, point: Point) -> Option<u32> {
        let leaf = self.leaves.locate(point.map(|c| c as i64));
        let mut cube = *self.whole.get(&leaf)?;
        loop {
            let Cube { centre, children, .. } = &self.cubes[cube as usize];
            if *children == 0 {
                return Some(cube);
            }
            let digit: u32 = (0..3).map(|a| u32::from(point[a] >= centre[a]) << a).sum();
            cube = children + digit;
        }
    }

    /// Calls `visit` with every live cube of an adopted leaf that shares part of a face with another leaf.
    pub fn facing(&self, leaf: u32, other: u32, visit: &mut impl FnMut(u32)) {
        let (centre, half) = self.extent(LEAF | other);
        self.touching(self.whole[&leaf], centre, half, visit);
    }

    fn touching(&self, cube: u32, centre: Point, half: f64, visit: &mut impl FnMut(u32)) {
        let this = &self.cubes[cube as usize];
        if !this.shares_a_face(centre, half) {
            return;
        }
        match this.children {
            0 => visit(cube),
            first => (first..first + 8).for_each(|child| self.touching(child, centre, half, visit)),
        }
    }

    /// Calls `visit` with every leaf without cubes that shares part of a face with a live cube.
    pub fn leaves_joined(&self, cube: u32, visit: &mut impl FnMut(u32)) {
        let joined = &self.cubes[cube as usize].joined;
        joined.iter().filter(|&&next| next & LEAF != 0).for_each(|&next| visit(next & !LEAF));
    }

    /// Distance from the centre of a cube to the nearest facet.
    pub fn clearance(&self, cube: u32) -> f64 {
        let Cube { centre, clearance, bound, .. } = &self.cubes[cube as usize];
        if clearance.get().is_nan() {
            clearance.set(self.clearance.at(*centre, *bound));
        }
        clearance.get()
    }

    /// The greatest distance to a facet that any point of a cube can have.
    pub fn radius(&self, cube: u32) -> f64 {
        self.clearance(cube) + DIAGONAL * self.half(cube)
    }

    /// Half of the edge of a cube.
    pub fn half(&self, cube: u32) -> f64 {
        self.cubes[cube as usize].half
    }

    /// The centre of the part of a face that two cubes share.
    pub fn shared_face_centre(&self, a: u32, b: u32) -> Point {
        let (a, b) = (&self.cubes[a as usize], &self.cubes[b as usize]);
        std::array::from_fn(|i| {
            let low = (a.centre[i] - a.half).max(b.centre[i] - b.half);
            let high = (a.centre[i] + a.half).min(b.centre[i] + b.half);
            (low + high) / 2.0
        })
    }
}

/// The live cubes.
impl Graph for Cubes<'_> {
    fn count(&self) -> usize {
        self.cubes.len()
    }

    fn position(&self, cube: u32) -> Point {
        self.cubes[cube as usize].centre
    }

    fn is_far(&self, cube: u32) -> bool {
        let Cube { centre, half, .. } = &self.cubes[cube as usize];
        centre.iter().any(|c| c - half <= 0.0 || c + half >= UNITS_PER_EDGE as f64)
    }

    fn joined(&self, cube: u32, visit: &mut impl FnMut(u32)) {
        let joined = &self.cubes[cube as usize].joined;
        joined.iter().filter(|&&next| next & LEAF == 0).for_each(|&next| visit(next));
    }
}

/// Replaces an entry of a list by others.
fn replace(list: &mut Vec<u32>, entry: u32, by: &[u32]) {
    list.retain(|&e| e != entry);
    list.extend(by);
}

/// The distance of two points.
pub fn length(a: Point, b: Point) -> f64 {
    let step = sub(a, b);
    dot(step, step).sqrt()
}
