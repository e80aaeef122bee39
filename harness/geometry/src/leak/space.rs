//! The cells of a base tree, which can be divided further, and the widest path through them.
//!
//! Invariants: the cells tile the root; two cells are joined if they share part of a face. A path enters open cells only: the free
//! leaves, and cells that were opened.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::tree::{FacetTree, Point};
use contract::failure::Failure;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::Octant;
use contract::word::{self, KEY_END, Side};

/// Bit of an entry that refers to a node; without it, the entry is the number of a cell.
const NODE: u32 = 1 << 31;

/// Bisections of the root to the edge of a lattice unit.
const DEPTH: u32 = UNITS_PER_EDGE.ilog2();

#[derive(Clone, Copy, Debug)]
struct Cell {
    low: [i32; 3],
    edge: i32,
    is_open: bool,
    /// Distance from the centre to the nearest facet; not a number before it is needed.
    clearance: f32,
}

/// The cells.
pub struct Space<'a> {
    cells: Vec<Cell>,
    nodes: Vec<[u32; 8]>,
    root: u32,
    /// The facets of the case.
    pub facets: &'a FacetTree,
}

/// The end of a path.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// The cell that contains a point.
    At(Point),
    /// Any cell at the root's boundary.
    Far,
}

impl<'a> Space<'a> {
    /// The leaves of a base tree, given by its sorted words.
    ///
    /// # Errors
    /// One sentence, if the words are not leaves that tile the root.
    pub fn new(words: &[u64], facets: &'a FacetTree) -> Result<Self, String> {
        let mut end = 0;
        for (i, &w) in words.iter().enumerate() {
            if word::fault(w).is_some() || word::key(w) != end || i >= NODE as usize {
                return Err(format!("the base tree is not a tree: leaf {i} is wrong"));
            }
            end += word::span(word::level(w));
        }
        if end != KEY_END {
            return Err("the base tree is not a tree: it does not fill the root".to_owned());
        }
        let cells = Vec::with_capacity(words.len());
        let mut space = Self { cells, nodes: Vec::new(), root: 0, facets };
        space.root = space.add(words, Octant::ROOT);
        Ok(space)
    }

    /// Adds the leaves in an octant and returns its entry.
    fn add(&mut self, words: &[u64], octant: Octant) -> u32 {
        if words.len() == 1 && word::level(words[0]) == octant.level {
            let ((low, high), is_open) = (octant.bounds(), word::side(words[0]) != Side::Crossing);
            let low = low.map(|c| c as i32);
            let edge = high[0] as i32 - low[0];
            self.cells.push(Cell { low, edge, is_open, clearance: f32::NAN });
            return self.cells.len() as u32 - 1;
        }
        let node = self.nodes.len();
        self.nodes.push([0; 8]);
        let mut rest = words;
        for digit in 0..8 {
            let child = octant.child(digit);
            let end = word::key_of(child.corner) + word::span(child.level);
            let (of_child, after) = rest.split_at(rest.partition_point(|&w| word::key(w) < end));
            self.nodes[node][usize::from(digit)] = self.add(of_child, child);
            rest = after;
        }
        NODE | node as u32
    }

    /// The cell that contains a point of the root.
    pub fn locate(&self, at: Point) -> u32 {
        let last = UNITS_PER_EDGE as f64 - 1.0;
        let at = at.to_array().map(|c| c.clamp(0.0, last) as i32);
        self.find(at, 1).0
    }

    /// The entry of the octant of this edge that contains a point, or of the cell that contains the octant; and the entry's
    /// place in a node.
    fn find(&self, at: [i32; 3], edge: i32) -> (u32, Option<(usize, usize)>) {
        let (mut entry, mut place, mut half) = (self.root, None, 1 << (DEPTH - 1));
        while entry & NODE != 0 && half >= edge {
            let digit = (0..3).map(|a| usize::from(at[a] & half != 0) << a).sum();
            let node = (entry & !NODE) as usize;
            (entry, place) = (self.nodes[node][digit], Some((node, digit)));
            half /= 2;
        }
        (entry, place)
    }

    /// Calls `visit` with every cell that shares part of a face with this one.
    pub fn neighbours(&self, cell: u32, visit: &mut impl FnMut(u32)) {
        let Cell { low, edge, .. } = self.cells[cell as usize];
        for axis in 0..3 {
            for (across, is_above) in [(low[axis] - 1, false), (low[axis] + edge, true)] {
                let mut at = low;
                at[axis] = across;
                if (0..UNITS_PER_EDGE).contains(&i64::from(across)) {
                    self.facing(self.find(at, edge).0, axis, !is_above, visit);
                }
            }
        }
    }

    /// The cells of an entry at its upper or lower face.
    fn facing(&self, entry: u32, axis: usize, is_upper: bool, visit: &mut impl FnMut(u32)) {
        if entry & NODE == 0 {
            return visit(entry);
        }
        for (digit, &child) in self.nodes[(entry & !NODE) as usize].iter().enumerate() {
            if (digit >> axis & 1 == 1) == is_upper {
                self.facing(child, axis, is_upper, visit);
            }
        }
    }

    /// Divides a cell into eight, which are as open as it was.
    pub fn split(&mut self, cell: u32) {
        let whole = self.cells[cell as usize];
        let half = whole.edge / 2;
        let child = |digit: usize| Cell {
            low: std::array::from_fn(|a| whole.low[a] + half * (digit >> a & 1) as i32),
            edge: half,
            clearance: f32::NAN,
            ..whole
        };
        let first = self.cells.len() as u32;
        let place = self.find(whole.low, whole.edge).1;
        self.cells[cell as usize] = child(0);
        self.cells.extend((1..8).map(child));
        let node = NODE | self.nodes.len() as u32;
        let added = |digit: u32| if digit == 0 { cell } else { first + digit - 1 };
        self.nodes.push(std::array::from_fn(|digit| added(digit as u32)));
        match place {
            Some((above, digit)) => self.nodes[above][digit] = node,
            None => self.root = node,
        }
    }

    /// Number of cells.
    pub fn count(&self) -> u32 {
        self.cells.len() as u32
    }

    /// Whether paths may enter a cell.
    pub fn is_open(&self, cell: u32) -> bool {
        self.cells[cell as usize].is_open
    }

    /// Lets paths enter a cell that facets cross: its parts that they do not touch become passable.
    pub fn open(&mut self, cell: u32) {
        self.cells[cell as usize].is_open = true;
    }

    /// The edge of a cell, in lattice units.
    pub fn edge(&self, cell: u32) -> f64 {
        self.cells[cell as usize].edge.into()
    }

    /// The centre of a cell.
    pub fn centre(&self, cell: u32) -> Point {
        let Cell { low, edge, .. } = self.cells[cell as usize];
        Point::from_array(low.map(|c| f64::from(c) + f64::from(edge) / 2.0))
    }

    /// The centre of the common part of two cells' faces.
    pub fn between(&self, a: u32, b: u32) -> Point {
        let [a, b] = [a, b].map(|cell| self.cells[cell as usize]);
        Point::from_array(std::array::from_fn(|i| {
            let (low, high) = (a.low[i].max(b.low[i]), (a.low[i] + a.edge).min(b.low[i] + b.edge));
            (f64::from(low) + f64::from(high)) / 2.0
        }))
    }

    fn is_far(&self, cell: u32) -> bool {
        let Cell { low, edge, .. } = self.cells[cell as usize];
        low.iter().any(|&c| c == 0 || i64::from(c + edge) == UNITS_PER_EDGE)
    }

    /// Distance from the centre of a cell to the nearest facet, as far as it is known.
    pub fn known_clearance(&self, cell: u32) -> Option<f64> {
        Some(f64::from(self.cells[cell as usize].clearance)).filter(|c| !c.is_nan())
    }

    /// Distance from the centre of a cell to the nearest facet.
    pub fn clearance(&mut self, cell: u32) -> f64 {
        if self.cells[cell as usize].clearance.is_nan() {
            self.cells[cell as usize].clearance = self.facets.distance(self.centre(cell)) as f32;
        }
        self.cells[cell as usize].clearance.into()
    }

    /// No ball of a greater radius has its centre in the cell.
    pub fn radius(&mut self, cell: u32) -> f64 {
        // Exceeds the rounding to f32.
        (self.clearance(cell) + self.half_diagonal(cell)) * (1.0 + 1e-6)
    }

    /// Distance from the centre of a cell to its corners.
    pub fn half_diagonal(&self, cell: u32) -> f64 {
        3f64.sqrt() / 2.0 * self.edge(cell)
    }

    /// The path between open cells whose least width is greatest, widths above `cap` being equal, and this width. Of paths that are
    /// wider than `cap` throughout, it is a short one that keeps away from facets. `None` if no path exists.
    ///
    /// # Errors
    /// If `stop` returns true.
    pub fn widest(
        &mut self,
        start: u32,
        goal: Goal,
        cap: f32,
        width: fn(&mut Self, u32) -> f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<(Vec<u32>, f32)>, Failure> {
        let end = match goal {
            Goal::At(at) => Some(self.locate(at)),
            Goal::Far => None,
        };
        let mut via = vec![start; self.cells.len()];
        let mut labels = vec![(-1f32, f32::INFINITY); self.cells.len()];
        let mut queue = BinaryHeap::new();
        labels[start as usize] = ((width(self, start) as f32).min(cap), 0.0);
        // The bit patterns of floats that are not negative are in the order of the floats.
        let key =
            |(least, cost): (f32, f32), cell| (least.to_bits(), Reverse(cost.to_bits()), cell);
        queue.push(key(labels[start as usize], start));
        let mut joined = Vec::new();
        while let Some((least, Reverse(cost), cell)) = queue.pop() {
            let label = (f32::from_bits(least), f32::from_bits(cost));
            if label != labels[cell as usize] {
                continue;
            }
            if end.map_or_else(|| self.is_far(cell), |end| cell == end) {
                let mut path = vec![cell];
                while path[path.len() - 1] != start {
                    path.push(via[path[path.len() - 1] as usize]);
                }
                path.reverse();
                return Ok(Some((path, label.0)));
            }
            if stop() {
                return Err(Failure::interrupted());
            }
            joined.clear();
            self.neighbours(cell, &mut |next| joined.push(next));
            for &next in &joined {
                if !self.is_open(next) {
                    continue;
                }
                let wide = width(self, next) as f32;
                let step = self.centre(cell).distance(self.centre(next)) as f32;
                // Up to twice its length or more where the step is as narrow as possible.
                let clearance = self.cells[next as usize].clearance;
                let detour = if cap.is_finite() { (cap / clearance).min(8.0) } else { 0.0 };
                let through = (label.0.min(wide), label.1 + step * (1.0 + detour));
                let best = labels[next as usize];
                if through.0 > best.0 || (through.0 == best.0 && through.1 < best.1) {
                    labels[next as usize] = through;
                    via[next as usize] = cell;
                    queue.push(key(through, next));
                }
            }
        }
        Ok(None)
    }
}
