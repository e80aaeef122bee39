//! A binary tree of bounding boxes over facets.
//!
//! Facets are sorted along the Morton curve of their centres, after a class if there are classes. A node with more
//! than `GROUP` facets, or with facets that are far apart, is split where the highest bit changes in which their codes differ, so that the centres of a node are within
//! one cell of the curve; nodes of equal numbers of facets would contain jumps of the curve, and be many times larger.

#[cfg(test)]
mod tests;

use std::num::NonZero;
use std::ops::Range;

use contract::lattice::FacetLattice;
use contract::octant::CELLS_PER_EDGE;
use contract::word;

use super::facets::{is_degenerate, normal};

/// Maximum number of facets per leaf of the tree.
pub const GROUP: usize = 8;

/// A leaf of several facets is larger than the largest of them by at most this factor: few facets that are far apart, such as those
/// of a class that is rare, would be near all others.
const SPREAD_MAX: i64 = 6;

/// The extent of some facets.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Least coordinates, on the lattice.
    pub low: [i32; 3],
    /// Greatest coordinates, on the lattice.
    pub high: [i32; 3],
}

impl Bounds {
    const EMPTY: Self = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };

    fn of(facet: &FacetLattice) -> Self {
        let fold = |f: fn(i64, i64) -> i64| -> [i32; 3] {
            std::array::from_fn(|a| f(f(facet[0][a], facet[1][a]), facet[2][a]) as i32)
        };
        Self { low: fold(i64::min), high: fold(i64::max) }
    }

    /// The extent of the facets of both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|a| self.low[a].min(other.low[a])),
            high: std::array::from_fn(|a| self.high[a].max(other.high[a])),
        }
    }

    /// The sum of the lengths of the edges.
    fn size(&self) -> i64 {
        (0..3).map(|a| i64::from(self.high[a]) - i64::from(self.low[a])).sum()
    }

    /// Whether the closed boxes share a point.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|a| self.low[a] <= other.high[a] && other.low[a] <= self.high[a])
    }

    /// The squared distance from a box with these corners, in lattice units.
    pub fn distance_squared_to_box(&self, low: [f64; 3], high: [f64; 3]) -> f64 {
        let along = |a: usize| {
            let (from, to) = (f64::from(self.low[a]), f64::from(self.high[a]));
            (from - high[a]).max(low[a] - to).max(0.0)
        };
        (0..3).map(|a| along(a) * along(a)).sum()
    }
}

/// The unit normal of a facet; zero if the facet has no area.
pub fn unit_normal(facet: &FacetLattice) -> [f64; 3] {
    let n = normal(facet).map(|x| x as f64);
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|x| x / length) } else { [0.0; 3] }
}

/// A node: some facets that are contiguous in the order of the tree.
#[derive(Debug)]
struct Node {
    bounds: Bounds,
    /// Positions of its facets.
    members: Range<u32>,
    /// The second child; the first one follows the node. None for a leaf.
    second: Option<NonZero<u32>>,
}

/// The tree.
#[derive(Debug)]
pub struct Boxes {
    /// The facets, in the order of the tree.
    pub facets: Vec<u32>,
    /// Bounds of each of [`Self::facets`].
    pub bounds: Vec<Bounds>,
    /// The nodes, each before those below it; the first one is the root.
    nodes: Vec<Node>,
}

impl Boxes {
    /// The tree over those of at least one facet that have an area.
    pub fn new(lattice: &[FacetLattice]) -> Self {
        Self::of(lattice, |facet| !is_degenerate(facet), |_| 0)
    }

    /// The same tree, but facets of other classes are far apart in its order.
    pub fn by_class(lattice: &[FacetLattice], class: impl Fn(&FacetLattice) -> u16) -> Self {
        Self::of(lattice, |facet| !is_degenerate(facet), class)
    }

    /// The tree over all of at least one facet.
    pub fn of_all(lattice: &[FacetLattice]) -> Self {
        Self::of(lattice, |_| true, |_| 0)
    }

    fn of(
        lattice: &[FacetLattice],
        is_included: impl Fn(&FacetLattice) -> bool,
        class: impl Fn(&FacetLattice) -> u16,
    ) -> Self {
        let code = codes(lattice);
        let key = |(i, facet): (usize, &FacetLattice)| {
            u128::from(class(facet)) << 96 | u128::from(code(facet)) << 32 | i as u128
        };
        let included = lattice.iter().enumerate().filter(|(_, facet)| is_included(facet));
        let mut keys: Vec<u128> = included.map(key).collect();
        keys.sort_unstable();
        let facets: Vec<u32> = keys.iter().map(|&key| key as u32).collect();
        let bounds: Vec<Bounds> =
            facets.iter().map(|&f| Bounds::of(&lattice[f as usize])).collect();
        let mut boxes = Self { facets, bounds, nodes: Vec::with_capacity(keys.len() / 2 + 1) };
        boxes.add_node(&keys, 0..keys.len());
        boxes
    }

    /// Adds the node of a range of positions, and those below it. Returns its bounds.
    fn add_node(&mut self, keys: &[u128], range: Range<usize>) -> Bounds {
        let i = self.nodes.len();
        let members = range.start as u32..range.end as u32;
        self.nodes.push(Node { bounds: Bounds::EMPTY, members, second: None });
        let leaf = (range.len() <= GROUP).then(|| &self.bounds[range.clone()]);
        let bounds = if let Some(bounds) = leaf.and_then(bounds_of_leaf) {
            bounds
        } else {
            let bit = (keys[range.start] ^ keys[range.end - 1]).ilog2();
            let split =
                range.start + keys[range.clone()].partition_point(|key| key >> bit & 1 == 0);
            let first = self.add_node(keys, range.start..split);
            self.nodes[i].second = NonZero::new(self.nodes.len() as u32);
            first.union(&self.add_node(keys, split..range.end))
        };
        self.nodes[i].bounds = bounds;
        bounds
    }

    /// The groups: the bounds of each, and the positions of its facets.
    pub fn groups(&self) -> impl Iterator<Item = (&Bounds, Range<usize>)> {
        let leaves = self.nodes.iter().filter(|node| node.second.is_none());
        leaves.map(|node| (&node.bounds, members(node)))
    }

    /// Number of nodes; the root is node 0.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The bounds of a node.
    pub fn bounds(&self, node: usize) -> &Bounds {
        &self.nodes[node].bounds
    }

    /// The positions of a node's facets.
    pub fn members(&self, node: usize) -> Range<usize> {
        members(&self.nodes[node])
    }

    /// The children of a node; none for a leaf.
    pub fn children(&self, node: usize) -> Option<[usize; 2]> {
        self.nodes[node].second.map(|second| [node + 1, second.get() as usize])
    }

    /// Depth-first search from the root. `enter` is called with the bounds of a node and their `order`, and with the positions of
    /// its facets if the node is a leaf; it returns whether to search the children. Of two children the one with the smaller
    /// `order` is searched first.
    pub fn search(
        &self,
        mut enter: impl FnMut(&Bounds, f64, Option<Range<usize>>) -> bool,
        order: impl Fn(&Bounds) -> f64,
    ) {
        if self.facets.is_empty() {
            return;
        }
        // A node has fewer than 128 above it, each of which splits its keys at a lower bit.
        let mut stack = [(0.0, 0); 128];
        stack[0].0 = order(self.bounds(0));
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let (at, i) = stack[size];
            let children = self.children(i);
            let members = children.is_none().then(|| self.members(i));
            if enter(self.bounds(i), at, members)
                && let Some(children) = children
            {
                let [a, b] = children.map(|child| (order(self.bounds(child)), child));
                stack[size..size + 2].copy_from_slice(&if a.0 <= b.0 { [b, a] } else { [a, b] });
                size += 2;
            }
        }
    }
}

/// The bounds of some facets; none if they are too far apart for a leaf.
fn bounds_of_leaf(facets: &[Bounds]) -> Option<Bounds> {
    let bounds = facets.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
    let largest = facets.iter().map(Bounds::size).max().unwrap_or(0);
    (facets.len() < 2 || bounds.size() <= SPREAD_MAX * largest).then_some(bounds)
}

fn members(node: &Node) -> Range<usize> {
    node.members.start as usize..node.members.end as usize
}

/// The Morton code of every facet's centre, in a grid of 2^19 cells along the longest edge of the bounding box.
fn codes(lattice: &[FacetLattice]) -> impl Fn(&FacetLattice) -> u64 + use<> {
    let centre = |facet: &FacetLattice, a: usize| facet[0][a] + facet[1][a] + facet[2][a];
    let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
    for facet in lattice {
        for a in 0..3 {
            low[a] = low[a].min(centre(facet, a));
            high[a] = high[a].max(centre(facet, a));
        }
    }
    let longest = (0..3).map(|a| high[a] - low[a]).fold(1, i64::max);
    let cell = longest / i64::from(CELLS_PER_EDGE) + 1;
    move |facet| word::key_of(std::array::from_fn(|a| ((centre(facet, a) - low[a]) / cell) as u32))
}
