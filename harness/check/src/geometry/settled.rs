//! The facets that have an opposite one within a cell.
//!
//! The search ends for a facet with its first opposite one, and where all facets of two nodes are opposite, for all of them at once.

use super::bundles::Verdicts;
use super::least::Least;
use super::pairs::Pairs;
use super::patches::GROUP;

/// The facets that have an opposite one.
pub struct Settled<'a> {
    pairs: &'a Pairs<'a>,
    /// Whether a facet has no opposite one yet, as wall and as gap, by position in the tree.
    open: Vec<[bool; 2]>,
    /// Whether any of a node's facets has none.
    open_nodes: Vec<[bool; 2]>,
    /// Upper bounds on the least distances.
    least: [Least; 2],
    /// Pairs of nodes and pairs of facets examined: the work of the search, which a test pins.
    pub examined: [u64; 2],
}

impl<'a> Settled<'a> {
    /// Searches all pairs. The bounds on distances are those of the narrowest `first` places.
    pub fn new(pairs: &'a Pairs<'a>, first: usize) -> Self {
        let mut settled = Self {
            pairs,
            open: vec![[true; 2]; pairs.patches.facets()],
            open_nodes: vec![[true; 2]; pairs.patches.nodes()],
            least: [0, 1].map(|_| Least::new(first, f64::INFINITY)),
            examined: [0; 2],
        };
        if pairs.patches.nodes() > 0 {
            settled.visit(0, 0, [true; 2]);
        }
        settled
    }

    /// Number of facets that have an opposite one.
    pub fn count(&self, side: usize) -> u64 {
        self.open.iter().filter(|open| !open[side]).count() as u64
    }

    /// Whether the facet at a position has an opposite one.
    pub fn is_settled(&self, position: usize, side: usize) -> bool {
        !self.open[position][side]
    }

    /// Exclusive upper bound on the squared distances of the narrowest places.
    pub fn bound(&self, side: usize) -> f64 {
        // Above the errors of bounds.
        self.least[side].bound * (1.0 + 1e-6)
    }

    /// Searches the pairs of a facet of node `a` and a facet of node `b`, which may be walls, gaps or both. Returns whether a
    /// facet was settled.
    fn visit(&mut self, a: usize, b: usize, may: [bool; 2]) -> bool {
        let patches = self.pairs.patches;
        self.examined[0] += 1;
        let may = both(may, either(self.open_nodes[a], self.open_nodes[b]));
        if may == [false; 2] {
            return false;
        }
        let [x, y] = [a, b].map(|node| &patches.node(node).bundle);
        let verdict = x.verdicts(y, self.limits(may));
        let mut may = [verdict.may[0][0] > 0.0, verdict.may[1][0] > 0.0];
        may[0] = may[0] && self.pairs.may_be_walls(a, b);
        let mut has_settled = false;
        for side in [0, 1] {
            let must = may[side] && verdict.must[side][0] > 0.0;
            if must && (side == 1 || self.pairs.have_shells(a, b)) {
                self.settle(a, side, verdict.squared_max[0]);
                self.settle(b, side, verdict.squared_max[0]);
                (may[side], has_settled) = (false, true);
            }
        }
        if may == [false; 2] {
            return has_settled;
        }
        has_settled |= match (patches.children(a), patches.children(b)) {
            (None, None) => self.visit_leaves(a, b, may),
            (Some([p, q]), _) if a == b => {
                self.visit(p, p, may) | self.visit(q, q, may) | self.visit(p, q, may)
            }
            (Some(children), None) => self.visit_children(children, b, may),
            (Some(children), Some(_)) if x.size() > y.size() => {
                self.visit_children(children, b, may)
            }
            (_, Some(children)) => self.visit_children(children, a, may),
        };
        if has_settled {
            self.update(a);
            self.update(b);
        }
        has_settled
    }

    /// The nearer child comes first: what it settles need not be searched in the other one.
    fn visit_children(&mut self, [a, b]: [usize; 2], other: usize, may: [bool; 2]) -> bool {
        let [p, q] = [a, b].map(|child| {
            let patches = self.pairs.patches;
            patches.node(child).bundle.distance_of_middles(&patches.node(other).bundle)
        });
        let [near, far] = if p <= q { [a, b] } else { [b, a] };
        self.visit(near, other, may) | self.visit(far, other, may)
    }

    fn visit_leaves(&mut self, a: usize, b: usize, may: [bool; 2]) -> bool {
        let patches = self.pairs.patches;
        let [ours, others] = [patches.members(a), patches.members(b)];
        let near = self.candidates(a, b, may);
        if near == [0; 2] {
            return false;
        }
        let others_near = self.candidates(b, a, may);
        let mut has_settled = false;
        for (turn, i) in ours.enumerate() {
            let open = self.open_mask(b);
            let lanes = [0, 1].map(|side| match near[side] >> turn & 1 == 1 {
                true if self.open[i][side] => others_near[side],
                true => others_near[side] & open[side],
                false => 0,
            });
            if lanes == [0; 2] {
                continue;
            }
            let limits = self.limits(lanes.map(|lanes| lanes != 0));
            let one = patches.leaf(a).one(turn);
            let verdicts = patches.leaf(b).verdicts(&one, limits);
            // Every facet begins with another one, so that most of them find one that is not settled yet.
            for at in (turn..others.len()).chain(0..turn.min(others.len())) {
                let j = others.start + at;
                let may = [0, 1].map(|s| lanes[s] >> at & 1 == 1 && verdicts.may[s][at] > 0.0);
                if may != [false; 2] && (a != b || i < j) {
                    has_settled |= self.compare([i, j], may, &verdicts, at);
                }
            }
        }
        has_settled
    }

    /// Which facets of leaf `a` may be opposite to one of leaf `b`: a bit for each, as wall and as gap.
    fn candidates(&self, a: usize, b: usize, may: [bool; 2]) -> [u8; 2] {
        let patches = self.pairs.patches;
        let all = mask(patches.members(a).len(), |_| true);
        if a == b {
            return may.map(|may| if may { all } else { 0 });
        }
        let verdicts = patches.leaf(a).verdicts(&patches.node(b).bundle, self.limits(may));
        [0, 1].map(|side| all & mask(GROUP, |i| verdicts.may[side][i] > 0.0))
    }

    /// Which facets of a leaf have no opposite one yet, as wall and as gap.
    fn open_mask(&self, leaf: usize) -> [u8; 2] {
        let open = &self.open[self.pairs.patches.members(leaf)];
        [0, 1].map(|side| mask(open.len(), |i| open[i][side]))
    }

    /// Settles the facets at two positions if they are opposite. Returns whether they are.
    fn compare(
        &mut self,
        [i, j]: [usize; 2],
        may: [bool; 2],
        verdicts: &Verdicts<GROUP>,
        at: usize,
    ) -> bool {
        self.examined[1] += 1;
        let mut may = both(may, either(self.open[i], self.open[j]));
        may[0] = may[0] && self.pairs.may_be_wall(i, j);
        if may == [false; 2] {
            return false;
        }
        let found =
            match [0, 1].into_iter().find(|&side| may[side] && verdicts.must[side][at] > 0.0) {
                Some(side) => Some((side, verdicts.squared_max[at])),
                None => {
                    let squared_min = f64::from(verdicts.squared_min[at]);
                    let found = self.pairs.opposite([i, j], squared_min, self.limits(may));
                    found.map(|(side, squared)| (side, squared as f32))
                }
            };
        let Some((side, squared)) = found else { return false };
        self.settle_facet(i, side, squared);
        self.settle_facet(j, side, squared);
        true
    }

    fn limits(&self, may: [bool; 2]) -> [f64; 2] {
        let limit = |may: bool| if may { self.pairs.limit } else { 0.0 };
        [limit(may[0]), limit(may[1])]
    }

    /// Settles the facets of a node, each of which has an opposite one within this distance.
    fn settle(&mut self, node: usize, side: usize, squared_max: f32) {
        if !std::mem::take(&mut self.open_nodes[node][side]) {
            return;
        }
        if let Some([a, b]) = self.pairs.patches.children(node) {
            self.settle(a, side, squared_max);
            self.settle(b, side, squared_max);
            return;
        }
        for i in self.pairs.patches.members(node) {
            self.settle_facet(i, side, squared_max);
        }
    }

    fn settle_facet(&mut self, i: usize, side: usize, squared: f32) {
        if std::mem::take(&mut self.open[i][side]) {
            self.least[side].add(f64::from(squared));
        }
    }

    /// Updates what is known of a node from those below it.
    fn update(&mut self, node: usize) {
        self.open_nodes[node] = match self.pairs.patches.children(node) {
            Some([a, b]) => either(self.open_nodes[a], self.open_nodes[b]),
            None => self.pairs.patches.members(node).map(|i| self.open[i]).fold([false; 2], either),
        };
    }
}

/// The bits of the lowest `count` numbers for which a condition holds.
fn mask(count: usize, holds: impl Fn(usize) -> bool) -> u8 {
    (0..count).fold(0, |mask, i| mask | u8::from(holds(i)) << i)
}

fn both(a: [bool; 2], b: [bool; 2]) -> [bool; 2] {
    [a[0] & b[0], a[1] & b[1]]
}

fn either(a: [bool; 2], b: [bool; 2]) -> [bool; 2] {
    [a[0] | b[0], a[1] | b[1]]
}
