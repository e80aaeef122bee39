//! A second implementation of the whole algorithm, on a dense grid of the finest cells: crossing by
//! separating axes, flood fill cell by cell, refinement cell by cell.
use super::{ROOT_EDGE, crosses_by_axes, parities_by_areas, spacing};
use reference::sides::{Components, EnclosedComponents};
use reference::{BoxSpec, Case, Enclosed, Keep};

pub const OUTSIDE: u64 = 0;
pub const INSIDE: u64 = 1;
pub const CROSSING: u64 = 2;

pub type Facet = [[i64; 3]; 3];

/// A grid of cells of level `finest`. Each cell stores the level and the side of the leaf that
/// contains it.
pub struct Dense {
    pub finest: u32,
    pub cells: Vec<Cell>,
}

#[derive(Clone, Copy)]
pub struct Cell {
    pub index: [i64; 3],
    pub level: u32,
    pub side: u64,
    pub kept: bool,
}

impl Dense {
    fn new(finest: u32) -> Self {
        let n = 1_i64 << finest;
        let cell = |i: i64| Cell {
            index: [i % n, i / n % n, i / n / n],
            level: 0,
            side: OUTSIDE,
            kept: true,
        };
        Self { finest, cells: (0..n * n * n).map(cell).collect() }
    }

    fn cell(&mut self, index: [i64; 3]) -> Option<&mut Cell> {
        let n = 1 << self.finest;
        let exists = index.iter().all(|x| (0..n).contains(x));
        exists.then(|| &mut self.cells[(index[0] + n * (index[1] + n * index[2])) as usize])
    }

    /// The edge, in cells, and the minimum corner of the leaf that contains a cell.
    fn leaf(&self, cell: Cell) -> (i64, [i64; 3]) {
        let edge = 1 << (self.finest - cell.level);
        (edge, cell.index.map(|x| x / edge * edge))
    }

    /// One cell of every leaf: the one in its minimum corner.
    pub fn leaves(&self) -> Vec<Cell> {
        self.cells.iter().copied().filter(|&cell| self.leaf(cell).1 == cell.index).collect()
    }

    /// The leaves that consist of `cells`, coarsest first, then by key.
    fn leaves_among(&self, cells: &[Cell]) -> Vec<Cell> {
        let mut leaves = cells.to_vec();
        leaves.retain(|&cell| self.leaf(cell).1 == cell.index);
        leaves.sort_by_key(|&leaf| (leaf.level, self.word(leaf)));
        leaves
    }

    fn centroid(&self, leaf: Cell) -> [i64; 3] {
        let (min, max) = self.extent(leaf);
        std::array::from_fn(|a| (min[a] + max[a]) / 2)
    }

    /// Whether one of the cells contains a lattice point.
    pub fn contain(&self, cells: &[Cell], point: [f64; 3]) -> bool {
        let edge = (ROOT_EDGE >> self.finest) as f64;
        cells.iter().any(|cell| (0..3).all(|a| cell.index[a] as f64 == (point[a] / edge).floor()))
    }

    /// Changes all cells of a leaf.
    fn change(&mut self, leaf: Cell, change: impl Fn(&mut Cell)) {
        let (edge, min) = self.leaf(leaf);
        for index in indices_between(min, min.map(|x| x + edge)) {
            change(self.cell(index).unwrap());
        }
    }

    /// Splits the kept leaves that contain cells from `min` to `max` until they have at least
    /// `level`.
    fn refine(&mut self, min: [i64; 3], max: [i64; 3], level: u32) {
        let n = 1 << self.finest;
        for index in indices_between(min.map(|x| x.max(0)), max.map(|x| x.min(n))) {
            while let Some(&mut cell) = self.cell(index)
                && cell.kept
                && cell.level < level
            {
                self.change(cell, |cell| cell.level += 1);
            }
        }
    }

    /// The words of the leaves that satisfy `wanted`, in ascending order.
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
                let digit = leaf.index[a] as u64 >> bit & 1;
                key |= digit << (3 * (bit + 19 - self.finest) + a as u32);
            }
        }
        key << 7 | u64::from(leaf.level) << 2 | leaf.side
    }

    /// The minimum and the maximum corner of a leaf, in lattice units.
    fn extent(&self, leaf: Cell) -> ([i64; 3], [i64; 3]) {
        let unit = ROOT_EDGE >> self.finest;
        let (edge, min) = self.leaf(leaf);
        (min.map(|x| x * unit), min.map(|x| (x + edge) * unit))
    }
}

fn indices_between(min: [i64; 3], max: [i64; 3]) -> Vec<[i64; 3]> {
    let mut indices = Vec::new();
    for z in min[2]..max[2] {
        for y in min[1]..max[1] {
            indices.extend((min[0]..max[0]).map(|x| [x, y, z]));
        }
    }
    indices
}

/// The base tree, with crossing leaves marked: splits level by level wherever a rule requires it.
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

/// The components: cells that no facet crosses, connected over faces.
pub fn components(dense: &mut Dense) -> Vec<Vec<Cell>> {
    let mut reached: std::collections::HashSet<[i64; 3]> =
        dense.cells.iter().filter(|cell| cell.side == CROSSING).map(|cell| cell.index).collect();
    let mut components = Vec::new();
    for start in dense.cells.clone() {
        if !reached.insert(start.index) {
            continue;
        }
        let mut component = vec![start];
        let mut visited = 0;
        while visited < component.len() {
            for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                let mut index = component[visited].index;
                index[axis] += step;
                if let Some(&mut cell) = dense.cell(index)
                    && reached.insert(index)
                {
                    component.push(cell);
                }
            }
            visited += 1;
        }
        components.push(component);
    }
    components
}

/// Sets the sides of the leaves that do not cross and returns the number of ambiguous components.
pub fn assign_sides(dense: &mut Dense, case: &Case, facets: &[Facet]) -> u64 {
    let mut ambiguous = 0;
    for component in components(dense) {
        let side = if case.seeds.is_empty() {
            let [odd, rays] = vote(dense, &component, facets);
            ambiguous += u64::from(0 < odd && odd < rays);
            if 2 * odd > rays { INSIDE } else { OUTSIDE }
        } else {
            let is_flow = case.seeds.iter().any(|&seed| dense.contain(&component, seed));
            if is_flow == (case.keep == Keep::Inside) { INSIDE } else { OUTSIDE }
        };
        for cell in component {
            dense.cell(cell.index).unwrap().side = side;
        }
    }
    ambiguous
}

/// The numbers of odd rays and of all rays that decide the side of a component: those of the first
/// leaf whose rays agree, or else those of all candidates.
fn vote(dense: &Dense, component: &[Cell], facets: &[Facet]) -> [usize; 2] {
    let mut odd_of_all = 0;
    let candidates = dense.leaves_among(component);
    let candidates = &candidates[..candidates.len().min(32)];
    for &leaf in candidates {
        let centroid = dense.centroid(leaf);
        let odd = (0..3).flat_map(|a| parities_by_areas(facets, centroid, a)).filter(|&odd| odd);
        let odd = odd.count();
        if odd == 0 || odd == 6 {
            return [odd, 6];
        }
        odd_of_all += odd;
    }
    [odd_of_all, 6 * candidates.len()]
}

/// Marks the kept region and returns the numbers of components.
pub fn keep(dense: &mut Dense, case: &Case) -> Components {
    for cell in &mut dense.cells {
        cell.kept = match case.keep {
            Keep::Outside => cell.side != INSIDE,
            Keep::Inside => cell.side != OUTSIDE,
            Keep::All => true,
        };
    }
    let (outside, inside): (Vec<_>, Vec<_>) =
        components(dense).into_iter().partition(|component| component[0].side == OUTSIDE);
    let (outside_count, inside) = (outside.len() as u64, inside.len() as u64);
    let last = (1 << dense.finest) - 1;
    let (enclosed, far_field): (Vec<_>, Vec<_>) = outside
        .into_iter()
        .partition(|component| component.iter().flat_map(|c| c.index).all(|x| 0 < x && x < last));
    let applies = case.keep == Keep::Outside
        && case.seeds.is_empty()
        && case.enclosed == Enclosed::Delete
        && !far_field.is_empty();
    let enclosed = if applies { enclosed } else { Vec::new() };
    let cells = enclosed.concat();
    for cell in &cells {
        dense.cell(cell.index).unwrap().kept = false;
    }
    let leaves = dense.leaves_among(&cells);
    let centroid = |&leaf: &Cell| dense.centroid(leaf).map(|x| x as f64);
    Components {
        outside: outside_count,
        inside,
        enclosed: EnclosedComponents {
            count: enclosed.len() as u64,
            leaves: leaves.len() as u64,
            example: leaves.first().map(centroid),
        },
    }
}

/// Gradation of the kept leaves, section 6 of the definition.
pub fn grade(dense: &mut Dense, n: i64, keep_crossing: bool, level_surface: u32) {
    if !keep_crossing && n < 3 {
        for leaf in dense.leaves().into_iter().filter(|leaf| leaf.side == CROSSING) {
            refine_touching(dense, leaf, level_surface);
        }
    }
    for level in (1..=dense.finest).rev() {
        for leaf in kept_of_level(dense, level) {
            let (edge, min) = dense.leaf(leaf);
            let margin = (n - 1) * edge;
            dense.refine(min.map(|x| x - margin), min.map(|x| x + edge + margin), level);
        }
        for leaf in kept_of_level(dense, level) {
            refine_touching(dense, leaf, level - 1);
        }
    }
}

/// Refines the leaves that touch `leaf`. Each of them contains one of the cells around it.
fn refine_touching(dense: &mut Dense, leaf: Cell, level: u32) {
    let (edge, min) = dense.leaf(leaf);
    dense.refine(min.map(|x| x - 1), min.map(|x| x + edge + 1), level);
}

fn kept_of_level(dense: &Dense, level: u32) -> Vec<Cell> {
    let mut leaves = dense.leaves();
    leaves.retain(|leaf| leaf.kept && leaf.level == level);
    leaves
}
