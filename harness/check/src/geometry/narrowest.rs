//! The narrowest pairs of a facet and its nearest opposite one, among the facets that have one.
//!
//! Pairs of nodes are visited in the order of lower bounds on their distances, so that few are visited that are farther apart than
//! the places to list.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;

use super::least::Least;
use super::pairs::Pairs;
use super::settled::Settled;

/// Two opposite facets, the lower one first.
pub struct Sheet {
    /// Their squared distance, in lattice units.
    pub squared: f64,
    /// Their numbers.
    pub facets: [u32; 2],
}

/// Maximum number of pairs of nodes that wait. Where nearly all of a body is equally thin, those beyond it are visited at once: many
/// more would have to be visited in any order.
const QUEUE_MAX: usize = 1 << 14;

/// Two nodes, first in order the bits of a lower bound on their squared distance.
type Visit = Reverse<(u64, [u32; 2], [bool; 2])>;

/// A search for the narrowest pairs.
pub struct Narrowest<'a> {
    pairs: &'a Pairs<'a>,
    /// An opposite facet must be nearer than this squared distance, as wall and as gap, by position in the tree.
    limits: Vec<[f64; 2]>,
    /// The greatest limits of each node's facets, or greater ones.
    limits_of_nodes: Vec<[f64; 2]>,
    /// The node above each node.
    parents: Vec<u32>,
    least: [Least; 2],
    /// The squared distance and number of the nearest opposite facet seen, as wall and as gap, by position in the tree.
    found: [FxHashMap<u32, (f64, u32)>; 2],
    queue: BinaryHeap<Visit>,
    /// Pairs of nodes and pairs of facets examined: the work of the search, which a test pins.
    pub examined: [u64; 2],
}

impl<'a> Narrowest<'a> {
    /// Searches the nearest opposite ones of settled facets, as far as the narrowest `first` places depend on them.
    pub fn new(pairs: &'a Pairs<'a>, settled: &Settled, first: usize) -> Self {
        let patches = pairs.patches;
        let limit = |i: usize, side: usize| match settled.is_settled(i, side) {
            true => pairs.limit,
            false => 0.0,
        };
        let mut parents = vec![0; patches.nodes()];
        for node in 0..patches.nodes() {
            patches.children(node).into_iter().flatten().for_each(|c| parents[c] = node as u32);
        }
        let mut narrowest = Self {
            pairs,
            limits: (0..patches.facets()).map(|i| [limit(i, 0), limit(i, 1)]).collect(),
            limits_of_nodes: vec![[0.0; 2]; patches.nodes()],
            parents,
            least: [0, 1].map(|side| Least::new(first, settled.bound(side))),
            found: Default::default(),
            queue: BinaryHeap::new(),
            examined: [0; 2],
        };
        // Children follow their parents.
        for node in (0..patches.nodes()).rev() {
            narrowest.limits_of_nodes[node] = narrowest.limits_below(node);
        }
        if patches.nodes() > 0 {
            narrowest.push(0, 0, [true; 2]);
        }
        while let Some(Reverse((bits, [a, b], may))) = narrowest.queue.pop() {
            narrowest.visit(f64::from_bits(bits), [a as usize, b as usize], may);
        }
        narrowest
    }

    /// The pairs found, as walls and as gaps, narrowest first.
    pub fn sheets(&self) -> [Vec<Sheet>; 2] {
        [0, 1].map(|side| {
            let sheet = |(&i, &(squared, g)): (&u32, &(f64, u32))| {
                let f = self.pairs.patches.number(i as usize);
                Sheet { squared, facets: [f.min(g), f.max(g)] }
            };
            let mut sheets: Vec<Sheet> = self.found[side].iter().map(sheet).collect();
            sheets.sort_by(|a, b| a.squared.total_cmp(&b.squared).then(a.facets.cmp(&b.facets)));
            sheets.dedup_by_key(|sheet| sheet.facets);
            sheets
        })
    }

    /// Adds the pairs of a facet of node `a` and a facet of node `b`, which may be walls, gaps or both.
    fn push(&mut self, a: usize, b: usize, may: [bool; 2]) {
        self.examined[0] += 1;
        let limits = self.limits(may, self.limits_of_nodes[a], self.limits_of_nodes[b]);
        if limits == [0.0; 2] {
            return;
        }
        let patches = self.pairs.patches;
        let squared_min = patches.patch(a).squared_min(patches.patch(b));
        let may = [may[0] && self.pairs.may_be_walls(a, b), may[1]];
        let limits = [0, 1].map(|side| match may[side] && squared_min < limits[side] {
            true => limits[side],
            false => 0.0,
        });
        let verdict = patches.node(a).bundle.verdicts(&patches.node(b).bundle, limits);
        let may = verdict.may.map(|[may]| may > 0.0);
        if may == [false; 2] {
            return;
        }
        if self.queue.len() < QUEUE_MAX {
            self.queue.push(Reverse((squared_min.to_bits(), [a as u32, b as u32], may)));
        } else {
            self.visit(squared_min, [a, b], may);
        }
    }

    fn visit(&mut self, squared_min: f64, [a, b]: [usize; 2], may: [bool; 2]) {
        let limits = self.limits(may, self.limits_of_nodes[a], self.limits_of_nodes[b]);
        let may = limits.map(|limit| squared_min < limit);
        if may == [false; 2] {
            return;
        }
        let patches = self.pairs.patches;
        match (patches.children(a), patches.children(b)) {
            (None, None) => self.visit_leaves(a, b, may),
            (Some([p, q]), _) if a == b => {
                [(p, p), (q, q), (p, q)].into_iter().for_each(|(a, b)| self.push(a, b, may));
            }
            (Some(children), other) => {
                let is_larger = patches.node(a).bundle.size() > patches.node(b).bundle.size();
                let (children, other) = match other {
                    Some(others) if !is_larger => (others, a),
                    _ => (children, b),
                };
                children.into_iter().for_each(|child| self.push(child, other, may));
            }
            (None, Some(children)) => {
                children.into_iter().for_each(|child| self.push(child, a, may));
            }
        }
    }

    fn visit_leaves(&mut self, a: usize, b: usize, may: [bool; 2]) {
        let patches = self.pairs.patches;
        let (x, others) = (patches.leaf(a), patches.members(b));
        let mut has_fallen = false;
        let limits = self.limits(may, self.limits_of_nodes[a], self.limits_of_nodes[b]);
        let near = x.verdicts(&patches.node(b).bundle, limits);
        for (turn, i) in patches.members(a).enumerate() {
            if a != b && near.may[0][turn] <= 0.0 && near.may[1][turn] <= 0.0 {
                continue;
            }
            let limits = self.limits(may, self.limits[i], self.limits_of_nodes[b]);
            let verdicts = patches.leaf(b).verdicts(&x.one(turn), limits);
            for (at, j) in others.clone().enumerate().filter(|&(_, j)| a != b || i < j) {
                let may = verdicts.may.map(|may| may[at] > 0.0);
                if may != [false; 2] {
                    has_fallen |= self.compare([i, j], f64::from(verdicts.squared_min[at]), may);
                }
            }
        }
        if has_fallen {
            self.update(a);
            self.update(b);
        }
    }

    /// Updates what is known of the facets at two positions. Returns whether a limit fell.
    fn compare(&mut self, [i, j]: [usize; 2], squared_min: f64, may: [bool; 2]) -> bool {
        self.examined[1] += 1;
        let may = [may[0] && self.pairs.may_be_wall(i, j), may[1]];
        let limits = self.limits(may, self.limits[i], self.limits[j]);
        if limits == [0.0; 2] {
            return false;
        }
        let Some((side, squared)) = self.pairs.opposite([i, j], squared_min, limits) else {
            return false;
        };
        let patches = self.pairs.patches;
        self.note(i, side, (squared, patches.number(j)))
            | self.note(j, side, (squared, patches.number(i)))
    }

    /// Notes an opposite facet of the one at position `i`. Returns whether it is the nearest so far.
    fn note(&mut self, i: usize, side: usize, (squared, facet): (f64, u32)) -> bool {
        if squared >= self.limits[i][side] {
            return false;
        }
        self.limits[i][side] = squared;
        if self.found[side].insert(i as u32, (squared, facet)).is_none() {
            self.least[side].add(squared);
        }
        true
    }

    /// The limits of pairs that may be walls and gaps, from those of either facet.
    fn limits(&self, may: [bool; 2], a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|side| match may[side] {
            true => a[side].max(b[side]).min(self.least[side].bound),
            false => 0.0,
        })
    }

    /// Updates the limits of a leaf and of those above it.
    fn update(&mut self, mut node: usize) {
        loop {
            let limits = self.limits_below(node);
            if limits == std::mem::replace(&mut self.limits_of_nodes[node], limits) || node == 0 {
                return;
            }
            node = self.parents[node] as usize;
        }
    }

    fn limits_below(&self, node: usize) -> [f64; 2] {
        let greater = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        match self.pairs.patches.children(node) {
            Some([a, b]) => greater(self.limits_of_nodes[a], self.limits_of_nodes[b]),
            None => {
                self.pairs.patches.members(node).map(|i| self.limits[i]).fold([0.0; 2], greater)
            }
        }
    }
}
