//! The points of a mesh as a tree, and their numbers.
//!
//! An octant has the points in it and on its low sides, so every point belongs to one octant of each level. Points on the high sides of
//! the root belong to octants beside it, which are children of an octant twice as large. As in [`super::tree`], equal subtrees are
//! stored once, and a child has the number of points in the children before it. A point at the minimum corner of an octant is the
//! octant's first, so a walk over cells that follows their points ([`Near`]) has the numbers of their corners without a search.
//!
//! Invariants: points are numbered in Morton order from 0; a node has a point other than its minimum corner, and follows its children.

use std::hash::BuildHasher;

use contract::octant::CELLS_PER_EDGE;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxBuildHasher;

use super::walk::Follow;
pub use crate::brick::Point;

/// Number of points that can be distinguished.
pub const POINTS_MAX: u64 = u32::MAX as u64;

/// The points of an octant without their numbers: 0 for none, 1 for its minimum corner only, or a node. The lowest bit is whether
/// the minimum corner is one of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Handle(u32);

/// The points of an octant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    points: Handle,
    /// Number of the first; in a node, counted from the node's own first point.
    first: u32,
}

/// The points.
#[derive(Debug, Default)]
pub struct Points {
    nodes: Vec<[Span; 8]>,
    root: Span,
}

impl Handle {
    /// No point.
    pub const NONE: Self = Self(0);

    /// The minimum corner, or no point.
    pub fn corner(has_corner: bool) -> Self {
        Self(u32::from(has_corner))
    }

    fn has_corner(self) -> bool {
        self.0 & 1 == 1
    }

    fn as_node(self) -> Option<usize> {
        (self.0 as usize / 2).checked_sub(1)
    }
}

impl Span {
    /// Number of the point at the octant's minimum corner, if it is a point.
    pub fn corner(self) -> Option<u32> {
        self.points.has_corner().then_some(self.first)
    }
}

/// Points under construction.
#[derive(Default)]
pub struct Builder {
    points: Points,
    /// Indices of the nodes.
    index: HashTable<u32>,
    /// Whether a node has more than [`POINTS_MAX`] points.
    has_too_many: bool,
}

impl Builder {
    /// The points of an octant whose children have these.
    pub fn intern(&mut self, children: [Handle; 8]) -> Handle {
        if children[0].as_node().is_none() && children[1..] == [Handle::NONE; 7] {
            return children[0];
        }
        let Self { points, index, has_too_many } = self;
        let hash = |of: &[Handle; 8]| FxBuildHasher.hash_one(of);
        let stored = |nodes: &[[Span; 8]], node: u32| nodes[node as usize].map(|c| c.points);
        let is_equal = |&node: &u32| stored(&points.nodes, node) == children;
        let hash_of = |&node: &u32| hash(&stored(&points.nodes, node));
        let node = match index.entry(hash(&children), is_equal, hash_of) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                let node = u32::try_from(points.nodes.len()).expect("fewer than 2^31 nodes");
                entry.insert(node);
                let mut first = 0;
                let spans = children.map(|of| {
                    let child = Span { points: of, first: first as u32 };
                    first += points.count_in(of);
                    child
                });
                points.nodes.push(spans);
                *has_too_many |= first > POINTS_MAX;
                node
            }
        };
        Handle(2 * (node + 1) + u32::from(children[0].has_corner()))
    }

    /// The points of the octant that is twice as large as the root; `None` if there are too many.
    pub fn finish(mut self, points: Handle) -> Option<Points> {
        self.points.nodes.shrink_to_fit();
        self.points.root = Span { points, first: 0 };
        (!self.has_too_many).then_some(self.points)
    }
}

impl Points {
    /// Number of points.
    pub fn count(&self) -> u64 {
        self.count_in(self.root.points)
    }

    fn count_in(&self, of: Handle) -> u64 {
        let Some(node) = of.as_node() else { return u64::from(of.has_corner()) };
        let last = self.nodes[node][7];
        u64::from(last.first) + self.count_in(last.points)
    }

    fn child(&self, of: Span, digit: usize) -> Span {
        match of.points.as_node() {
            Some(node) => {
                let child = self.nodes[node][digit];
                Span { first: of.first + child.first, ..child }
            }
            None if digit == 0 => of,
            None => Span::default(),
        }
    }

    /// Visits points, given by ascending numbers, in this order.
    ///
    /// # Errors
    /// The first error of `visit`.
    pub fn visit<E>(
        &self,
        numbers: impl Iterator<Item = u32>,
        visit: &mut impl FnMut(Point) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut numbers = numbers.peekable();
        let end = self.count() as u32;
        self.visit_in(self.root, ([0; 3], 2 * CELLS_PER_EDGE), end, &mut numbers, visit)
    }

    fn visit_in<E>(
        &self,
        of: Span,
        (corner, edge): (Point, u32),
        end: u32,
        numbers: &mut std::iter::Peekable<impl Iterator<Item = u32>>,
        visit: &mut impl FnMut(Point) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(node) = of.points.as_node() else {
            return if numbers.next_if(|&next| next < end).is_some() {
                visit(corner)
            } else {
                Ok(())
            };
        };
        for digit in 0..8 {
            let end = self.nodes[node].get(digit + 1).map_or(end, |next| of.first + next.first);
            if numbers.peek().is_some_and(|&next| next < end) {
                let corner =
                    std::array::from_fn(|a| corner[a] + edge / 2 * (digit as u32 >> a & 1));
                self.visit_in(self.child(of, digit), (corner, edge / 2), end, numbers, visit)?;
            }
        }
        Ok(())
    }

    /// The points near the root.
    pub fn near(&self) -> Near<'_> {
        Near { points: self, spans: std::array::from_fn(|digit| self.child(self.root, digit)) }
    }
}

/// The points of an octant and of the seven octants of the same level on its high sides: all that a cell can have.
#[derive(Clone, Copy, Debug)]
pub struct Near<'a> {
    points: &'a Points,
    /// Bit `a` of the index is set if the octant is on the high side along axis `a`.
    spans: [Span; 8],
}

impl Follow for Near<'_> {
    fn child(self, digit: usize) -> Self {
        let spans = std::array::from_fn(|offset| {
            // One bit per axis, and a carry to the octant on the high side.
            self.points.child(self.spans[digit & offset], digit ^ offset)
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
    /// The points on a quarter of the square, whose bits are those of its minimum corner.
    pub fn quarter(&self, quarter: usize) -> Self {
        let [u, v] = self.axes;
        let spans = std::array::from_fn(|corner| {
            let digit = quarter ^ corner;
            let digit = (digit & 1) << u | (digit >> 1) << v;
            self.points.child(self.spans[quarter & corner], digit)
        });
        Self { spans, ..*self }
    }

    /// Replaces `polygon` by the points on the square's edges: counterclockwise around the positive normal, or clockwise, from the minimum
    /// corner on. Points on an edge are those that bisect it, or bisect a half of it, and so on.
    pub fn polygon(&self, clockwise: bool, polygon: &mut Vec<u32>) {
        let [u, v] = self.axes;
        let corner = |i: usize| self.spans[i].corner().expect("the corners of a face are points");
        polygon.clear();
        polygon.push(corner(0));
        self.between(self.spans[0], u, polygon);
        polygon.push(corner(1));
        self.between(self.spans[1], v, polygon);
        polygon.push(corner(3));
        let begin = polygon.len();
        self.between(self.spans[2], u, polygon);
        polygon[begin..].reverse();
        polygon.push(corner(2));
        let begin = polygon.len();
        self.between(self.spans[0], v, polygon);
        polygon[begin..].reverse();
        if clockwise {
            polygon[1..].reverse();
        }
    }

    /// Appends the points between the ends of an octant's edge from its minimum corner along an axis.
    fn between(&self, of: Span, axis: usize, polygon: &mut Vec<u32>) {
        if of.points.as_node().is_none() {
            return;
        }
        let middle = self.points.child(of, 1 << axis);
        if let Some(number) = middle.corner() {
            self.between(self.points.child(of, 0), axis, polygon);
            polygon.push(number);
            self.between(middle, axis, polygon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_points_than_can_be_numbered_are_refused() {
        for (levels, count) in [(10, Some(1 << 30)), (11, None)] {
            let mut builder = Builder::default();
            let full =
                (0..levels).fold(Handle::corner(true), |child, _| builder.intern([child; 8]));
            assert_eq!(builder.finish(full).map(|points| points.count()), count);
        }
    }
}
