//! A binary tree of bounding boxes over facets.
//!
//! Facets are sorted along the Morton curve of their centres, after the directions of their normals if asked, and grouped by `GROUP`; the groups are the
//! leaves of a complete tree. Every node encloses its facets and their unit normals in boxes.

use std::ops::Range;

use contract::lattice::FacetLattice;
use contract::octant::CELLS_PER_EDGE;
use contract::word;

use super::facets::{is_degenerate, normal};

/// Facets per leaf of the tree.
const GROUP: usize = 8;

/// The extent of some facets and of their normals.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Least coordinates, on the lattice.
    pub low: [i32; 3],
    /// Greatest coordinates, on the lattice.
    pub high: [i32; 3],
    /// Least components of the unit normals.
    pub normal_low: [f32; 3],
    /// Greatest components of the unit normals.
    pub normal_high: [f32; 3],
}

impl Bounds {
    const EMPTY: Self = Self {
        low: [i32::MAX; 3],
        high: [i32::MIN; 3],
        normal_low: [f32::INFINITY; 3],
        normal_high: [f32::NEG_INFINITY; 3],
    };

    fn of(facet: &FacetLattice) -> Self {
        let unit = unit_normal(facet).map(|x| x as f32);
        // Bounds on what was rounded.
        let [normal_low, normal_high] = [unit.map(f32::next_down), unit.map(f32::next_up)];
        let fold = |f: fn(i64, i64) -> i64| -> [i32; 3] {
            std::array::from_fn(|a| f(f(facet[0][a], facet[1][a]), facet[2][a]) as i32)
        };
        Self { low: fold(i64::min), high: fold(i64::max), normal_low, normal_high }
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|a| self.low[a].min(other.low[a])),
            high: std::array::from_fn(|a| self.high[a].max(other.high[a])),
            normal_low: std::array::from_fn(|a| self.normal_low[a].min(other.normal_low[a])),
            normal_high: std::array::from_fn(|a| self.normal_high[a].max(other.normal_high[a])),
        }
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

    /// The squared distance of the boxes, in lattice units.
    pub fn distance_squared(&self, other: &Self) -> f64 {
        let along = |a: usize| {
            let (p, q) = (self.low[a].into(), other.low[a].into());
            let gap: f64 = (f64::max(p, q)) - f64::from(self.high[a].min(other.high[a]));
            gap.max(0.0)
        };
        (0..3).map(|a| along(a) * along(a)).sum()
    }

    /// Bounds on the height of a point of the other box over a point of this one, along any normal of this one.
    pub fn height_range(&self, other: &Self) -> (f64, f64) {
        let (mut least, mut greatest) = (0.0, 0.0);
        for a in 0..3 {
            let from = f64::from(other.low[a]) - f64::from(self.high[a]);
            let to = f64::from(other.high[a]) - f64::from(self.low[a]);
            let (l, h) = (f64::from(self.normal_low[a]), f64::from(self.normal_high[a]));
            let products = [from * l, from * h, to * l, to * h];
            least += products.into_iter().fold(f64::INFINITY, f64::min);
            greatest += products.into_iter().fold(f64::NEG_INFINITY, f64::max);
        }
        (least, greatest)
    }

    /// A lower bound on the cosine between any normal of one and any normal of the other.
    pub fn cosine_min(&self, other: &Self) -> f32 {
        let along = |a: usize| {
            let (l, h) = (self.normal_low[a], self.normal_high[a]);
            let (m, n) = (other.normal_low[a], other.normal_high[a]);
            (l * m).min(l * n).min(h * m).min(h * n)
        };
        (0..3).map(along).sum()
    }
}

/// The unit normal of a facet; zero if the facet has no area.
pub fn unit_normal(facet: &FacetLattice) -> [f64; 3] {
    let n = normal(facet).map(|x| x as f64);
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|x| x / length) } else { [0.0; 3] }
}

/// The direction along an axis that is nearest to the normal, from 0 to 5.
fn direction(facet: &FacetLattice) -> u8 {
    let n = normal(facet);
    let longest = (0..3).fold(0, |a, b| if n[b].abs() > n[a].abs() { b } else { a });
    2 * longest as u8 + u8::from(n[longest] > 0)
}

/// The tree.
#[derive(Debug)]
pub struct Boxes {
    /// The facets, in the order of the tree.
    pub facets: Vec<u32>,
    /// Bounds of each of [`Self::facets`].
    pub bounds: Vec<Bounds>,
    /// The nodes in heap order: the children of node i are 2 i and 2 i + 1, and node 1 is the root.
    nodes: Vec<Bounds>,
    leaves: usize,
}

impl Boxes {
    /// The tree over those of at least one facet that have an area.
    pub fn new(lattice: &[FacetLattice]) -> Self {
        Self::of(lattice, |facet| !is_degenerate(facet), |_| 0)
    }

    /// The same tree, but facets with other normals are far apart in its order. On a wing that is thin, bounds on the normals
    /// of nodes would else be those of both its sides.
    pub fn by_normal(lattice: &[FacetLattice]) -> Self {
        Self::of(lattice, |facet| !is_degenerate(facet), direction)
    }

    /// The tree over all of at least one facet.
    pub fn of_all(lattice: &[FacetLattice]) -> Self {
        Self::of(lattice, |_| true, |_| 0)
    }

    fn of(
        lattice: &[FacetLattice],
        is_included: impl Fn(&FacetLattice) -> bool,
        class: impl Fn(&FacetLattice) -> u8,
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
        let leaves = facets.len().div_ceil(GROUP).next_power_of_two();
        let mut nodes = vec![Bounds::EMPTY; 2 * leaves];
        for (group, members) in bounds.chunks(GROUP).enumerate() {
            nodes[leaves + group] = members.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        }
        for i in (1..leaves).rev() {
            nodes[i] = nodes[2 * i].union(&nodes[2 * i + 1]);
        }
        Self { facets, bounds, nodes, leaves }
    }

    /// The groups: the bounds of each, and the positions of its facets.
    pub fn groups(&self) -> impl Iterator<Item = (&Bounds, Range<usize>)> {
        (0..self.facets.len().div_ceil(GROUP))
            .map(|g| (&self.nodes[self.leaves + g], self.members(g)))
    }

    fn members(&self, group: usize) -> Range<usize> {
        group * GROUP..((group + 1) * GROUP).min(self.facets.len())
    }

    /// Depth-first search from the root. `enter` is called with the bounds of a node, and with the positions of its
    /// facets if the node is a leaf; it returns whether to search the children. Of two children the one with the
    /// smaller `order` is searched first.
    pub fn search(
        &self,
        mut enter: impl FnMut(&Bounds, Option<Range<usize>>) -> bool,
        order: impl Fn(&Bounds) -> f64,
    ) {
        let mut stack = [0; 64];
        stack[0] = 1;
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let i = stack[size];
            let node = &self.nodes[i];
            if node.low[0] > node.high[0] {
                continue;
            }
            let is_leaf = i >= self.leaves;
            let members = is_leaf.then(|| self.members(i - self.leaves));
            if enter(node, members) && !is_leaf {
                let (a, b) = (2 * i, 2 * i + 1);
                let is_a_first = order(&self.nodes[a]) <= order(&self.nodes[b]);
                stack[size..size + 2].copy_from_slice(&if is_a_first { [b, a] } else { [a, b] });
                size += 2;
            }
        }
    }
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
