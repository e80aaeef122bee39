//! The points of a mesh and their numbers: the corners of cells, and of the squares into which their faces are split where cells are missing.
//!
//! An octant has the points in it and on its low sides, an interval of all points in Morton order. Points on the high sides of
//! the root belong to octants beside it, which are children of an octant twice as large. A point at the minimum corner of an octant is the
//! octant's first, so a walk over cells that follows their points ([`Near`]) finds their corners in short intervals.
//!
//! Invariants: points ascend in Morton order; their numbers are their indices.

use contract::octant::CELLS_PER_EDGE;
use contract::word::{self, KEY_END};

use super::leaves::{Follow, Leaves};
use super::squares::squares;
pub use crate::brick::Point;
use crate::error::ExportError;
use crate::options::Options;

/// Number of points that can be distinguished.
const POINTS_MAX: usize = u32::MAX as usize;
/// Cells whose points are sorted at once.
const CHUNK: u32 = 1 << 12;

/// The points, as Morton codes with 20 bits per axis.
#[derive(Debug, Default)]
pub struct Points(Vec<u64>);

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
    pub fn new(leaves: &Leaves, options: &Options) -> Result<Self, ExportError> {
        let (mut keys, mut begin, mut of_cell) = (Vec::new(), 0, Vec::new());
        leaves.walk((), options, &mut |number, around| {
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
            return Err(ExportError::Request(format!(
                "a polyMesh can have {POINTS_MAX} points here: select fewer leaves"
            )));
        }
        Ok(Self(keys))
    }

    /// Number of points.
    pub fn count(&self) -> u32 {
        self.0.len() as u32
    }

    /// The point with a number.
    pub fn at(&self, number: u32) -> Point {
        let key = self.0[number as usize];
        let corner = word::corner_of(key % KEY_END);
        std::array::from_fn(|a| corner[a] + ((key / KEY_END) as u32 >> a & 1) * CELLS_PER_EDGE)
    }

    /// The points of a child, which has this level, of an octant.
    fn child(&self, of: Span, level: u8, digit: usize) -> Span {
        if of.begin == of.end {
            return of;
        }
        let (span, keys) = (word::span(level), &self.0[of.begin as usize..of.end as usize]);
        let low = (keys[0] & !(8 * span - 1)) + digit as u64 * span;
        let before = |key_end: u64| of.begin + keys.partition_point(|&key| key < key_end) as u32;
        Span { begin: before(low), end: before(low + span) }
    }

    /// The number of the point at the minimum corner of an octant of this level, if it is a point.
    fn corner(&self, of: Span, level: u8) -> Option<u32> {
        let has_corner =
            of.begin < of.end && self.0[of.begin as usize].is_multiple_of(word::span(level));
        has_corner.then_some(of.begin)
    }

    /// The points near the root.
    pub fn near(&self) -> Near<'_> {
        let all = Span { begin: 0, end: self.count() };
        Near { points: self, spans: std::array::from_fn(|digit| self.child(all, 0, digit)) }
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

/// An interval of points.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    begin: u32,
    end: u32,
}

/// The points of an octant and of the seven octants of the same level on its high sides: all that a cell can have.
#[derive(Clone, Copy, Debug)]
pub struct Near<'a> {
    points: &'a Points,
    /// Bit `a` of the index is set if the octant is on the high side along axis `a`.
    spans: [Span; 8],
}

impl Follow for Near<'_> {
    fn child(self, level: u8, digit: usize) -> Self {
        let spans = std::array::from_fn(|offset| {
            // One bit per axis, and a carry to the octant on the high side.
            self.points.child(self.spans[digit & offset], level, digit ^ offset)
        });
        Self { spans, ..self }
    }
}

/// The points at the corners of a square on a face of an octant, and of those between them.
#[derive(Clone, Copy, Debug)]
pub struct OnFace<'a> {
    points: &'a Points,
    /// The axes of the square.
    axes: [usize; 2],
    /// The octants, of the square's edge, that have its corners as minimum corners: first minimum, then along the first axis, the second and both.
    spans: [Span; 4],
}

impl<'a> Near<'a> {
    /// The points on the face on the low or high side of an axis.
    pub fn on_face(&self, axis: usize, is_high: bool) -> OnFace<'a> {
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        let at = |corner: usize| {
            usize::from(is_high) << axis | (corner & 1) << axes[0] | (corner >> 1) << axes[1]
        };
        OnFace { points: self.points, axes, spans: std::array::from_fn(|c| self.spans[at(c)]) }
    }
}

impl OnFace<'_> {
    /// The points on a quarter of the square, whose bits are those of its minimum corner and which has this level.
    pub fn quarter(&self, level: u8, quarter: usize) -> Self {
        let [u, v] = self.axes;
        let spans = std::array::from_fn(|corner| {
            let digit = quarter ^ corner;
            let digit = (digit & 1) << u | (digit >> 1) << v;
            self.points.child(self.spans[quarter & corner], level, digit)
        });
        Self { spans, ..*self }
    }

    /// Appends the points on the edges of the square, which has this level: counterclockwise around the positive normal, or clockwise, from the
    /// minimum corner on. Points on an edge are those that bisect it, or bisect a half of it, and so on.
    pub fn polygon(&self, level: u8, clockwise: bool, polygon: &mut Vec<u32>) {
        let [u, v] = self.axes;
        let first = polygon.len();
        // Corner at which an edge begins, its axis, and the edge's direction around the square.
        for (corner, begin, axis, is_forward) in
            [(0, 0, u, true), (1, 1, v, true), (3, 2, u, false), (2, 0, v, false)]
        {
            let number = self.points.corner(self.spans[corner], level);
            polygon.push(number.expect("the corners of a face are points"));
            let between = polygon.len();
            self.between(self.spans[begin], level, axis, polygon);
            if !is_forward {
                polygon[between..].reverse();
            }
        }
        if clockwise {
            polygon[first + 1..].reverse();
        }
    }

    /// Appends the points between the ends of the edge of an octant, of this level, from its minimum corner along an axis.
    fn between(&self, of: Span, level: u8, axis: usize, polygon: &mut Vec<u32>) {
        let others = of.end - of.begin - u32::from(self.points.corner(of, level).is_some());
        if others == 0 {
            return;
        }
        let level = level + 1;
        let middle = self.points.child(of, level, 1 << axis);
        if let Some(number) = self.points.corner(middle, level) {
            self.between(self.points.child(of, level, 0), level, axis, polygon);
            polygon.push(number);
            self.between(middle, level, axis, polygon);
        }
    }
}
