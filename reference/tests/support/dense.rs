//! The whole algorithm a second time, on a dense grid of the finest cells: crossing by separating axes,
//! components cell by cell, refinement cell by cell.
use super::{ROOT_EDGE, crosses_by_axes, parities_by_areas, spacing};
use reference::{BoxSpec, Case};

pub const OUTSIDE: u64 = 0;
pub const INSIDE: u64 = 1;
pub const CROSSING: u64 = 2;

pub type Facet = [[i64; 3]; 3];

/// A grid of the finest cells, each knowing the leaf that it is part of.
pub struct Dense {
    pub finest: u32,
    pub cells: Vec<Cell>,
}

#[derive(Clone, Copy)]
pub struct Cell {
    pub at: [i64; 3],
    pub level: u32,
    pub side: u64,
    pub kept: bool,
}

impl Dense {
    fn new(finest: u32) -> Self {
        let n = 1_i64 << finest;
        let cell = |i: i64| Cell {
            at: [i % n, i / n % n, i / n / n],
            level: 0,
            side: OUTSIDE,
            kept: true,
        };
        Self { finest, cells: (0..n * n * n).map(cell).collect() }
    }

    fn cell(&mut self, at: [i64; 3]) -> Option<&mut Cell> {
        let n = 1 << self.finest;
        let inside = at.iter().all(|x| (0..n).contains(x));
        inside.then(|| &mut self.cells[(at[0] + n * (at[1] + n * at[2])) as usize])
    }

    /// The leaf's edge in cells, and its minimum corner.
    pub fn leaf(&self, cell: Cell) -> (i64, [i64; 3]) {
        let edge = 1 << (self.finest - cell.level);
        (edge, cell.at.map(|x| x / edge * edge))
    }

    /// One cell of every leaf: the one in the minimum corner.
    pub fn leaves(&self) -> Vec<Cell> {
        self.cells.iter().copied().filter(|&cell| self.leaf(cell).1 == cell.at).collect()
    }

    /// Changes all cells of a leaf.
    fn change(&mut self, leaf: Cell, change: impl Fn(&mut Cell)) {
        let (edge, min) = self.leaf(leaf);
        for at in cells_between(min, min.map(|x| x + edge)) {
            change(self.cell(at).unwrap());
        }
    }

    /// Splits the kept leaves around the cells from `min` to `max` until those cells are of `level`.
    fn refine(&mut self, min: [i64; 3], max: [i64; 3], level: u32) {
        let n = 1 << self.finest;
        for at in cells_between(min.map(|x| x.max(0)), max.map(|x| x.min(n))) {
            while let Some(&mut cell) = self.cell(at)
                && cell.kept
                && cell.level < level
            {
                self.change(cell, |cell| cell.level += 1);
            }
        }
    }

    pub fn words(&self, wanted: impl Fn(Cell) -> bool) -> Vec<u64> {
        let leaves = self.leaves().into_iter().filter(|&leaf| wanted(leaf));
        let mut words: Vec<u64> = leaves.map(|leaf| self.word(leaf)).collect();
        words.sort_unstable();
        words
    }

    fn word(&self, leaf: Cell) -> u64 {
        let mut key = 0;
        for bit in 0..self.finest {
            for a in 0..3 {
                let digit = leaf.at[a] as u64 >> bit & 1;
                key |= digit << (3 * (bit + 19 - self.finest) + a as u32);
            }
        }
        key << 7 | u64::from(leaf.level) << 2 | leaf.side
    }

    /// In lattice units.
    fn extent(&self, leaf: Cell) -> ([i64; 3], [i64; 3]) {
        let unit = ROOT_EDGE >> self.finest;
        let (edge, min) = self.leaf(leaf);
        (min.map(|x| x * unit), min.map(|x| (x + edge) * unit))
    }
}

fn cells_between(min: [i64; 3], max: [i64; 3]) -> Vec<[i64; 3]> {
    let mut cells = Vec::new();
    for z in min[2]..max[2] {
        for y in min[1]..max[1] {
            cells.extend((min[0]..max[0]).map(|x| [x, y, z]));
        }
    }
    cells
}

/// Splits what must be, level by level, until nothing must; then says which leaves cross.
pub fn base(case: &Case, facets: &[Facet], finest: u32, level_surface: u32) -> Dense {
    let mut dense = Dense::new(finest);
    let crossed = |min, max| facets.iter().any(|f| crosses_by_axes(f, min, max));
    let meets = |spec: &BoxSpec, min: [i64; 3], max: [i64; 3]| {
        (0..3).all(|a| (min[a] as f64) < spec.max[a] && spec.min[a] < max[a] as f64)
    };
    for level in 0..finest {
        for leaf in dense.leaves().into_iter().filter(|leaf| leaf.level == level) {
            let (min, max) = dense.extent(leaf);
            let boxed = case.boxes.iter().any(|b| b.spacing < spacing(level) && meets(b, min, max));
            if boxed || (level < level_surface && crossed(min, max)) {
                dense.change(leaf, |cell| cell.level += 1);
            }
        }
    }
    for leaf in dense.leaves() {
        let (min, max) = dense.extent(leaf);
        if crossed(min, max) {
            dense.change(leaf, |cell| cell.side = CROSSING);
        }
    }
    dense
}

/// Spreads from cell to cell; returns the number of ambiguous components.
pub fn assign_sides(dense: &mut Dense, facets: &[Facet]) -> u64 {
    let mut ambiguous = 0;
    let mut reached: std::collections::HashSet<[i64; 3]> =
        dense.cells.iter().filter(|cell| cell.side == CROSSING).map(|cell| cell.at).collect();
    for start in dense.cells.clone() {
        if !reached.insert(start.at) {
            continue;
        }
        let mut component = vec![start];
        let mut done = 0;
        while done < component.len() {
            for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                let mut at = component[done].at;
                at[axis] += step;
                if let Some(&mut cell) = dense.cell(at)
                    && reached.insert(at)
                {
                    component.push(cell);
                }
            }
            done += 1;
        }
        let mut candidates = component.clone();
        candidates.retain(|&cell| dense.leaf(cell).1 == cell.at);
        candidates.sort_by_key(|&leaf| (leaf.level, dense.word(leaf)));
        candidates.truncate(32);
        let votes: Vec<usize> = candidates
            .iter()
            .map(|&leaf| {
                let (min, max) = dense.extent(leaf);
                let centroid = std::array::from_fn(|a| (min[a] + max[a]) / 2);
                (0..3)
                    .flat_map(|a| parities_by_areas(facets, centroid, a))
                    .filter(|&odd| odd)
                    .count()
            })
            .collect();
        let decided = votes.iter().copied().find(|&odd| odd == 0 || odd == 6);
        ambiguous += u64::from(decided.is_none());
        let (odd, rays) = decided.map_or((votes.iter().sum(), 6 * votes.len()), |odd| (odd, 6));
        let side = if odd > rays - odd { INSIDE } else { OUTSIDE };
        for cell in component {
            dense.cell(cell.at).unwrap().side = side;
        }
    }
    ambiguous
}

pub fn grade(dense: &mut Dense, n: i64, keep_crossing: bool, level_surface: u32) {
    if !keep_crossing && n < 3 {
        for leaf in dense.leaves().into_iter().filter(|leaf| leaf.side == CROSSING) {
            touching(dense, leaf, level_surface);
        }
    }
    for level in (1..=dense.finest).rev() {
        for leaf in kept_of_level(dense, level) {
            let (edge, min) = dense.leaf(leaf);
            let margin = (n - 1) * edge;
            dense.refine(min.map(|x| x - margin), min.map(|x| x + edge + margin), level);
        }
        for leaf in kept_of_level(dense, level) {
            touching(dense, leaf, level - 1);
        }
    }
}

/// What touches a leaf holds one of the finest cells around it.
fn touching(dense: &mut Dense, leaf: Cell, level: u32) {
    let (edge, min) = dense.leaf(leaf);
    dense.refine(min.map(|x| x - 1), min.map(|x| x + edge + 1), level);
}

fn kept_of_level(dense: &Dense, level: u32) -> Vec<Cell> {
    let mut leaves = dense.leaves();
    leaves.retain(|leaf| leaf.kept && leaf.level == level);
    leaves
}
