//! The cells of a base tree, which can be divided further, and the widest path through them.
//!
//! Invariants: the cells tile the root; two cells are joined if they share part of a face. A path enters open cells only: the free
//! leaves, and cells that were opened.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::iter::successors;

use super::{Ends, leaf_at};
use crate::tree::{FacetTree, Point};
use contract::failure::{Result, uninterrupted};
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::UNITS_PER_CELL;
use contract::sets::Sets;
use contract::word::{self, KEY_END, Order, Side};
use parry3d_f64::query::PointQuery as _;

/// A cell; lengths are in lattice units.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    low: [u32; 3],
    edge: u32,
    /// Whether no facet touches the leaf that it is part of.
    pub is_free: bool,
    /// Whether paths may enter it. Of a cell that facets cross, its parts that they do not touch become passable.
    pub is_open: bool,
    /// Distance from the centre to the nearest facet; not a number before it is needed.
    pub clearance: f32,
}

impl Cell {
    /// The edge length.
    pub fn edge(&self) -> f64 {
        self.edge.into()
    }

    /// The centre.
    pub fn centre(&self) -> Point {
        Point::from_array(self.low.map(|c| f64::from(c) + self.edge() / 2.0))
    }

    /// The radius of a ball that passes from the centre to a face, if this is as far from facets.
    pub fn shown(&self) -> f64 {
        f64::from(self.clearance) - self.edge() / 4.0
    }

    /// No ball of a greater radius has its centre in the cell.
    pub fn promised(&self) -> f64 {
        // Exceeds the rounding to f32.
        (f64::from(self.clearance) + self.half_diagonal()) * (1.0 + 1e-6)
    }

    /// Distance from the centre to the corners.
    pub fn half_diagonal(&self) -> f64 {
        3f64.sqrt() / 2.0 * self.edge()
    }
}

/// The cells.
pub struct Space<'a> {
    /// All of them.
    pub cells: Vec<Cell>,
    /// Indices of the cells by the Morton code of their minimum corner.
    order: BTreeMap<u128, u32>,
    /// The facets of the case.
    pub facets: &'a FacetTree,
    /// The words of the base tree.
    words: &'a [u64],
    /// The far field is the part of the root's boundary that is outside in the base tree of these words, and all of it without them.
    outside: Option<&'a [u64]>,
}

impl<'a> Space<'a> {
    /// The leaves of a base tree, given by its sorted words, and the base tree whose outside has the far field, if not all of the root's
    /// boundary is that.
    ///
    /// # Errors
    /// One sentence, if the words are not leaves that tile the root.
    pub fn new(
        words: &'a [u64],
        facets: &'a FacetTree,
        outside: Option<&'a [u64]>,
    ) -> Result<Self, String> {
        let mut linear = Order::default();
        let added = words.iter().try_for_each(|&word| linear.add(word));
        added.map_err(|why| format!("the base tree is not a tree: {why}"))?;
        if words.iter().map(|&word| word::span(word::level(word))).sum::<u64>() != KEY_END {
            return Err("the base tree is not a tree: it does not fill the root".to_owned());
        }
        let cell = |&word: &u64| {
            let (low, high) = word::octant(word).bounds();
            let (low, edge) = (low.map(|c| c as u32), (high[0] - low[0]) as u32);
            let is_free = !word::is_crossing(word);
            Cell { low, edge, is_free, is_open: is_free, clearance: f32::NAN }
        };
        let cells: Vec<Cell> = words.iter().map(cell).collect();
        let order = cells.iter().zip(0..).map(|(cell, i)| (key(cell.low), i)).collect();
        Ok(Self { cells, order, facets, words, outside })
    }

    /// The edge of the leaf that holds the point of the facets nearest to a place, at this distance: in a box, a leaf of the box.
    pub fn leaf_of_facet(&self, at: Point, distance: f64) -> f64 {
        let nearest = self.facets.triangle(self.facets.within(at, 1.05 * distance)[0]);
        let leaf = leaf_at(self.words, nearest.project_local_point(at, true).point);
        UNITS_PER_EDGE as f64 / f64::from(1u32 << word::level(leaf))
    }

    fn is_far(&self, cell: u32) -> bool {
        let cell = &self.cells[cell as usize];
        let is_outside = |words| word::side(leaf_at(words, cell.centre())) == Side::Outside;
        let is_at_face = |&c: &u32| c == 0 || i64::from(c + cell.edge) == UNITS_PER_EDGE;
        cell.low.iter().any(is_at_face) && self.outside.is_none_or(is_outside)
    }

    /// The leaves of each space that is outside at the root's boundary, by index, but for the largest of these spaces.
    pub fn cut(&self) -> Vec<Vec<u32>> {
        let word = |cell: &u32| self.words[*cell as usize];
        let is_outside = |cell: &u32| word::side(word(cell)) == Side::Outside;
        let all = || (0..self.words.len() as u32).filter(is_outside);
        let (mut sets, mut joined) = (Sets::new(self.words.len()), Vec::new());
        for cell in all() {
            self.neighbours(cell, &mut joined);
            joined.drain(..).filter(is_outside).for_each(|next| sets.union(cell, next));
        }
        let mut spaces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        all().for_each(|cell| spaces.entry(sets.root(cell)).or_default().push(cell));
        let is_cut = |of: &Vec<u32>| of.iter().any(|c| word::octant(word(c)).is_at_boundary());
        let mut spaces: Vec<_> = spaces.into_values().filter(is_cut).collect();
        let volume = |of: &Vec<u32>| of.iter().map(|c| word::span(word::level(word(c)))).sum();
        spaces.sort_by_key(|of| Reverse::<u64>(volume(of)));
        spaces.into_iter().skip(1).collect()
    }

    /// The cell that contains a point of the root.
    pub fn locate(&self, at: Point) -> u32 {
        self.at(at.to_array().map(|c| c.clamp(0.0, UNITS_PER_EDGE as f64 - 1.0) as u32))
    }

    fn at(&self, at: [u32; 3]) -> u32 {
        *self.order.range(..=key(at)).next_back().expect("the cells tile the root").1
    }

    /// Appends every cell that shares part of a face with this one.
    pub fn neighbours(&self, cell: u32, joined: &mut Vec<u32>) {
        let Cell { low, edge, .. } = self.cells[cell as usize];
        for axis in 0..3 {
            let across = [(1, low[axis].checked_sub(edge)), (0, Some(low[axis] + edge))];
            for (side, across) in across {
                if let Some(across) = across.filter(|&c| i64::from(c) < UNITS_PER_EDGE) {
                    let mut at = low;
                    at[axis] = across;
                    self.facing(at, edge, (axis, side), joined);
                }
            }
        }
    }

    /// Appends the cells in a cube, or the one around it, at its lower (0) or upper (1) face normal to an axis.
    fn facing(&self, low: [u32; 3], edge: u32, face: (usize, u32), joined: &mut Vec<u32>) {
        let cell = self.at(low);
        if self.cells[cell as usize].edge >= edge {
            return joined.push(cell);
        }
        for digit in (0..8).filter(|digit| digit >> face.0 & 1 == face.1) {
            self.facing(child(low, edge, digit), edge / 2, face, joined);
        }
    }

    /// Divides a cell into eight, which are as open as it was.
    pub fn split(&mut self, cell: u32) {
        let whole = self.cells[cell as usize];
        let parts: [Cell; 8] = std::array::from_fn(|digit| Cell {
            low: child(whole.low, whole.edge, digit as u32),
            edge: whole.edge / 2,
            clearance: f32::NAN,
            ..whole
        });
        self.cells[cell as usize] = parts[0];
        for part in &parts[1..] {
            self.order.insert(key(part.low), self.cells.len() as u32);
            self.cells.push(*part);
        }
    }

    /// No ball of a greater radius passes from one cell to another through the common part of their faces. It is not needed if one of them is
    /// free, because no wall lies in its faces.
    fn through(&self, a: u32, b: u32) -> f64 {
        let ends = [a, b].map(|cell| self.cells[cell as usize]);
        if ends.iter().any(|cell| cell.is_free) {
            return f64::INFINITY;
        }
        let half_diagonal = 0.5f64.sqrt() * ends[0].edge().min(ends[1].edge());
        (self.facets.distance(self.between(a, b)) + half_diagonal) * (1.0 + 1e-6)
    }

    /// The centre of the common part of two cells' faces.
    pub fn between(&self, a: u32, b: u32) -> Point {
        let [a, b] = [a, b].map(|cell| self.cells[cell as usize]);
        Point::from_array(std::array::from_fn(|i| {
            let (low, high) = (a.low[i].max(b.low[i]), (a.low[i] + a.edge).min(b.low[i] + b.edge));
            (f64::from(low) + f64::from(high)) / 2.0
        }))
    }

    /// [`Cell::promised`].
    pub fn radius(&mut self, cell: u32) -> f64 {
        let cell = &mut self.cells[cell as usize];
        if cell.clearance.is_nan() {
            cell.clearance = self.facets.distance(cell.centre()) as f32;
        }
        cell.promised()
    }

    /// The path between the cells of two ends, through open ones, whose least width is greatest, widths above `cap` being equal, and this
    /// width. Between cells that facets cross it is no more than what passes through their common face. Of paths that are wider than `cap`
    /// throughout, it is a short one that keeps away from facets. `None` if no path exists.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn widest(
        &mut self,
        (from, to): Ends,
        cap: f32,
        width: fn(&mut Self, u32) -> f64,
    ) -> Result<Option<(Vec<u32>, f32)>> {
        let (start, end) = (self.locate(from), to.map(|to| self.locate(to)));
        let mut via = vec![start; self.cells.len()];
        let mut labels = vec![(-1f32, f32::INFINITY); self.cells.len()];
        let mut queue = BinaryHeap::new();
        labels[start as usize] = ((width(self, start) as f32).min(cap), 0.0);
        // The bit patterns of floats that are not negative are in the order of the floats.
        let key = |(low, cost): (f32, f32), cell| (low.to_bits(), Reverse(cost.to_bits()), cell);
        queue.push(key(labels[start as usize], start));
        let mut joined = Vec::new();
        while let Some((least, Reverse(cost), cell)) = queue.pop() {
            let label = (f32::from_bits(least), f32::from_bits(cost));
            if label != labels[cell as usize] {
                continue;
            }
            if end.map_or_else(|| self.is_far(cell), |end| cell == end) {
                let before = |&cell: &u32| (cell != start).then(|| via[cell as usize]);
                let mut path: Vec<u32> = successors(Some(cell), before).collect();
                path.reverse();
                return Ok(Some((path, label.0)));
            }
            uninterrupted()?;
            joined.clear();
            self.neighbours(cell, &mut joined);
            joined.retain(|&next| self.cells[next as usize].is_open);
            for &next in &joined {
                let wide = width(self, next).min(self.through(cell, next)) as f32;
                let [here, there] = [cell, next].map(|cell| self.cells[cell as usize]);
                let step = here.centre().distance(there.centre()) as f32;
                // Up to twice its length or more where the step is as narrow as possible.
                let detour = if cap.is_finite() { (cap / there.clearance).min(8.0) } else { 0.0 };
                let reached = (label.0.min(wide), label.1 + step * (1.0 + detour));
                let best = labels[next as usize];
                if reached.0 > best.0 || (reached.0 == best.0 && reached.1 < best.1) {
                    labels[next as usize] = reached;
                    via[next as usize] = cell;
                    queue.push(key(reached, next));
                }
            }
        }
        Ok(None)
    }
}

/// The Morton code of a lattice unit.
fn key(at: [u32; 3]) -> u128 {
    const CELL: u32 = UNITS_PER_CELL as u32;
    let [of_cell, within] = [at.map(|c| c / CELL), at.map(|c| c % CELL)].map(word::key_of);
    u128::from(of_cell) << (3 * CELL.ilog2()) | u128::from(within)
}

/// The minimum corner of a child of a cube.
fn child(low: [u32; 3], edge: u32, digit: u32) -> [u32; 3] {
    std::array::from_fn(|axis| low[axis] + edge / 2 * (digit >> axis & 1))
}
