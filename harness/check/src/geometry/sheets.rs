//! Thin sheets: [`opposite`] facets less than one cell apart.
//!
//! Every facet with an opposite one counts once as a wall and once as a gap. The places are pairs of a facet and its nearest
//! opposite one.
//!
//! Pairs of facets are searched through pairs of nodes of the tree, twice. The first search ends for a facet with its first
//! opposite one, since the nearest does not matter to the count. It bounds the distances of the narrowest places, and the second
//! search finds the nearest opposite facets within this bound.

use contract::lattice::UNITS_PER_EDGE;

use super::boxes::{Bounds, Boxes};
use super::distance::nearest;
use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::intersections::{Relation, relation};
use super::opposite::{Triangle, is_averted, may_oppose, opposite};
use super::shells::Shells;

/// An opposite facet.
#[derive(Clone, Copy)]
struct Opposite {
    squared: f64,
    facet: u32,
}

/// Two opposite facets, the lower one first.
struct Sheet {
    squared: f64,
    facets: [u32; 2],
}

/// Thin walls and thin gaps, narrowest first.
pub fn sheets(
    input: &Input,
    (edges, shells): (&Edges, &Shells),
    boxes: &Boxes,
    cell: f64,
    first: usize,
) -> [Finding; 2] {
    let unit = input.root.edge / UNITS_PER_EDGE as f64;
    let none = vec![[None; 2]; boxes.facets.len()];
    let limits = vec![[(cell / unit).powi(2); 2]; none.len()];
    let limits_of_nodes = Vec::new();
    let mut search = Search {
        input,
        edges,
        shells,
        boxes,
        limits,
        limits_of_nodes,
        found: none,
        is_first: true,
    };
    search.run();
    let counts = [0, 1].map(|side| search.found.iter().filter(|f| f[side].is_some()).count());
    let bounds = [0, 1].map(|side| bound(&search.found, side, first));
    for (limits, found) in search.limits.iter_mut().zip(&search.found) {
        *limits = [0, 1].map(|side| found[side].map_or(0.0, |o| o.squared.min(bounds[side])));
    }
    search.is_first = false;
    search.run();
    [Kind::ThinWalls, Kind::ThinGaps].map(|kind| {
        let side = usize::from(kind == Kind::ThinGaps);
        let places = narrowest(boxes, &search.found, side, bounds[side]);
        let places = places.iter().take(first).map(|sheet| place(input, sheet, unit)).collect();
        Finding { count: counts[side] as u64, places, ..Finding::new(kind) }
    })
}

/// Exclusive upper bound on the squared distances of the first places. A place is listed for at most two facets.
fn bound(found: &[[Option<Opposite>; 2]], side: usize, first: usize) -> f64 {
    let mut squares: Vec<f64> = found.iter().filter_map(|f| Some(f[side]?.squared)).collect();
    let Some(last) = first.checked_mul(2).filter(|&n| n < squares.len()) else {
        return f64::INFINITY;
    };
    squares.select_nth_unstable_by(last, f64::total_cmp).1.next_up()
}

/// The pairs of a facet and its nearest opposite one within the bound, narrowest first.
fn narrowest(
    boxes: &Boxes,
    found: &[[Option<Opposite>; 2]],
    side: usize,
    bound: f64,
) -> Vec<Sheet> {
    let nearest = boxes.facets.iter().zip(found).filter_map(|(&f, found)| {
        let Opposite { squared, facet: g } = found[side].filter(|o| o.squared < bound)?;
        Some(Sheet { squared, facets: [f.min(g), f.max(g)] })
    });
    let mut sheets: Vec<Sheet> = nearest.collect();
    sheets.sort_by(|a, b| a.squared.total_cmp(&b.squared).then(a.facets.cmp(&b.facets)));
    sheets.dedup_by_key(|sheet| sheet.facets);
    sheets
}

fn place(input: &Input, sheet: &Sheet, unit: f64) -> Place {
    let [a, b] = sheet.facets.map(|f| input.lattice[f as usize].map(|v| v.map(|c| c as f64)));
    let (_, p, q) = nearest(&a, &b);
    let at = std::array::from_fn(|x| ((p[x] + q[x]) / 2.0).round() as i64);
    let width = sheet.squared.sqrt() * unit;
    Place {
        width: Some(width),
        width_cells: input.in_cells(width),
        ..Place::new(sheet.facets.into(), input.root.to_user(at))
    }
}

/// A search for opposite facets.
struct Search<'a> {
    input: &'a Input,
    edges: &'a Edges,
    shells: &'a Shells,
    boxes: &'a Boxes,
    /// An opposite facet must be nearer than this squared distance, as wall and as gap, by position in the tree.
    limits: Vec<[f64; 2]>,
    /// The greatest limits of each node's facets, or greater ones.
    limits_of_nodes: Vec<[f64; 2]>,
    /// The nearest opposite facets seen, as wall and as gap, by position in the tree.
    found: Vec<[Option<Opposite>; 2]>,
    /// Whether the search ends for a facet with its first opposite one.
    is_first: bool,
}

impl Search<'_> {
    fn run(&mut self) {
        self.limits_of_nodes = vec![[0.0; 2]; self.boxes.nodes()];
        // Children follow their parents.
        (0..self.boxes.nodes()).rev().for_each(|node| self.update(node));
        self.visit(0, 0, [true; 2]);
    }

    /// Searches the pairs of a facet of node `a` and a facet of node `b`, which may be walls, gaps or both. Returns whether a
    /// limit fell.
    fn visit(&mut self, a: usize, b: usize, may: [bool; 2]) -> bool {
        let [x, y] = [a, b].map(|node| self.boxes.bounds(node));
        let limits = either(self.limits_of_nodes[a], self.limits_of_nodes[b]);
        let may = may_oppose(x, y, only(may, limits));
        if may == [false; 2] {
            return false;
        }
        let has_fallen = match (self.boxes.children(a), self.boxes.children(b)) {
            (None, None) => self.visit_leaves(a, b, may),
            (Some([p, q]), _) if a == b => {
                self.visit(p, p, may) | self.visit(q, q, may) | self.visit(p, q, may)
            }
            (Some(children), None) => self.visit_children(children, b, may),
            (Some(children), Some(_)) if size(x) > size(y) => self.visit_children(children, b, may),
            (_, Some(children)) => self.visit_children(children, a, may),
        };
        if has_fallen {
            self.update(a);
            self.update(b);
        }
        has_fallen
    }

    /// The nearer child comes first: what it finds lowers the limits for the other one.
    fn visit_children(&mut self, [a, b]: [usize; 2], other: usize, may: [bool; 2]) -> bool {
        let to = self.boxes.bounds(other);
        let [p, q] = [a, b].map(|child| distance_of_centres(self.boxes.bounds(child), to));
        let [near, far] = if p <= q { [a, b] } else { [b, a] };
        self.visit(near, other, may) | self.visit(far, other, may)
    }

    fn visit_leaves(&mut self, a: usize, b: usize, may: [bool; 2]) -> bool {
        let mut has_fallen = false;
        for (turn, i) in self.boxes.members(a).enumerate() {
            let limits = only(may, either(self.limits[i], self.limits_of_nodes[b]));
            let may = may_oppose(&self.boxes.bounds[i], self.boxes.bounds(b), limits);
            if may == [false; 2] {
                continue;
            }
            let f = self.boxes.facets[i] as usize;
            let triangle = Triangle::new(&self.input.lattice[f]);
            let others = self.boxes.members(b);
            // Every facet begins with another one, so that most of them find one that is not settled yet.
            let first = others.start + turn % others.len();
            for j in (first..others.end).chain(others.start..first) {
                if a != b || i < j {
                    has_fallen |= self.compare(i, &triangle, j, may);
                }
            }
        }
        has_fallen
    }

    /// Updates what is known of two facets, at positions `i` and `j`. Returns whether a limit fell.
    fn compare(&mut self, i: usize, triangle: &Triangle, j: usize, may: [bool; 2]) -> bool {
        let limits = only(may, either(self.limits[i], self.limits[j]));
        let [x, y] = [i, j].map(|i| &self.boxes.bounds[i]);
        if limits == [0.0; 2] || !is_averted(x, y) {
            return false;
        }
        let squared_min = x.distance_squared(y);
        if squared_min >= limits[0].max(limits[1]) {
            return false;
        }
        let [f, g] = [i, j].map(|i| self.boxes.facets[i] as usize);
        let [a, b] = [f, g].map(|f| &self.input.lattice[f]);
        let Some((side, squared)) = opposite(triangle, b, squared_min, limits) else {
            return false;
        };
        // Two solids that overlap have inner sides that face each other, but no wall.
        if side == 0 && self.shells.are_of_different_solids(f, g) {
            return false;
        }
        let shares_vertex =
            self.edges.corners[f].iter().any(|vertex| self.edges.corners[g].contains(vertex));
        if shares_vertex || relation(a, b, true) != Relation::Disjoint {
            return false;
        }
        let mut has_fallen = false;
        for (i, facet) in [(i, g), (j, f)] {
            if squared < self.limits[i][side] {
                self.found[i][side] = Some(Opposite { squared, facet: facet as u32 });
                self.limits[i][side] = if self.is_first { 0.0 } else { squared };
                has_fallen = true;
            }
        }
        has_fallen
    }

    /// The limits of a node from those below it.
    fn update(&mut self, node: usize) {
        self.limits_of_nodes[node] = match self.boxes.children(node) {
            Some([a, b]) => either(self.limits_of_nodes[a], self.limits_of_nodes[b]),
            None => self.boxes.members(node).map(|i| self.limits[i]).fold([0.0; 2], either),
        };
    }
}

/// The limits where facets may be opposite, 0 elsewhere.
fn only(may: [bool; 2], limits: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|side| if may[side] { limits[side] } else { 0.0 })
}

fn either(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|side| a[side].max(b[side]))
}

/// The sum of a box's edge lengths.
fn size(a: &Bounds) -> i64 {
    (0..3).map(|x| i64::from(a.high[x]) - i64::from(a.low[x])).sum()
}

/// Twice the distance of the boxes' centres, along the axes.
fn distance_of_centres(a: &Bounds, b: &Bounds) -> i64 {
    let centre = |bounds: &Bounds, x: usize| i64::from(bounds.low[x]) + i64::from(bounds.high[x]);
    (0..3).map(|x| (centre(a, x) - centre(b, x)).abs()).sum()
}
