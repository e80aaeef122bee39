//! discretize's TreeMesh: the text of `write_UBC` and the JSON of `save`.
//!
//! The smallest cells must be equal cubes. Their numbers along the axes may differ; the root is the least cube with the
//! same origin whose edge is a power of two of them.
//!
//! The text has the number of smallest cells along the axes, the top south-west corner, the edges of the smallest cell,
//! the number of cells, and per cell its first index along each axis, from 1 and from the top downward along z, and its
//! edge in smallest cells. It rounds the corner to four decimals and the edges to three; a root given with `--root` that agrees
//! with the rounded one replaces it. The JSON gives the centre of each cell in halves of smallest cells, and its level.

use super::cells::Cells;
use super::{ImportError, Request, refuse_sides};
use crate::files;
use crate::lattice::Root;
use crate::octant::CELLS_PER_EDGE;
use serde::Deserialize;
use std::path::Path;

/// Rounding errors of `write_UBC`: half a unit of the last decimal of the corner, and of the smallest edge.
const ROUNDING_CORNER: f64 = 0.5e-4;
const ROUNDING_EDGE: f64 = 0.5e-3;

/// The smallest cells.
struct Grid {
    /// Number along each axis.
    shape: [u64; 3],
    origin: [f64; 3],
    edge: f64,
}

/// A mesh in JSON. Unknown keys are those of other mesh types or of later versions.
#[derive(Deserialize)]
struct TreeMesh {
    h: Vec<Vec<f64>>,
    #[serde(alias = "x0")]
    origin: Vec<f64>,
    cell_state: CellState,
}

#[derive(Deserialize)]
struct CellState {
    indexes: Vec<[i64; 3]>,
    levels: Vec<i64>,
}

/// Reads a mesh.
///
/// # Errors
/// If the file cannot be read or is damaged, or if the smallest cells are not equal cubes.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    refuse_sides(request, "discretize's file")?;
    let text = files::read_text(path)?;
    match text.trim_start().starts_with('{') {
        true => from_json(&text),
        false => from_ubc(&text, request.root),
    }
}

impl Grid {
    /// A grid whose cells are cubes, and not too many.
    fn new(shape: [u64; 3], origin: [f64; 3], edges: [f64; 3]) -> Result<Self, ImportError> {
        let edge = edges[0];
        if edges.iter().any(|e| (e - edge).abs() > 1e-6 * edge) || edge <= 0.0 || !edge.is_finite()
        {
            return Err(ImportError::content(format!(
                "has smallest cells with the edges {edges:?}: only cubes can be leaves of an oct-tree"
            )));
        }
        if shape.iter().any(|n| !(1..=u64::from(CELLS_PER_EDGE)).contains(n)) {
            return Err(ImportError::content(format!(
                "has {shape:?} smallest cells along the axes, and from 1 to {CELLS_PER_EDGE} are possible"
            )));
        }
        Ok(Self { shape, origin, edge })
    }

    fn root(&self) -> Root {
        let along = self.shape.iter().fold(1, |most, n| most.max(n.next_power_of_two()));
        Root { origin: self.origin, edge: self.edge * along as f64 }
    }

    /// The cells with these minimum corners and edges, in smallest cells from the origin.
    fn cells(&self, of: impl Iterator<Item = ([f64; 3], f64)>) -> Cells {
        let mut cells = Cells { root: Some(self.root()), ..Cells::default() };
        for (first, edge) in of {
            let corner = [0, 1, 2].map(|a| self.origin[a] + first[a] * self.edge);
            cells.push(corner, edge * self.edge);
        }
        cells
    }
}

fn from_json(text: &str) -> Result<Cells, ImportError> {
    let mesh: TreeMesh = serde_json::from_str(text).map_err(|error| {
        ImportError::content(format!("is not a three-dimensional TreeMesh in JSON: {error}"))
    })?;
    let (Ok(h), Ok(origin)) =
        (<[Vec<f64>; 3]>::try_from(mesh.h), <[f64; 3]>::try_from(mesh.origin))
    else {
        return Err(ImportError::content("has a number of dimensions other than three"));
    };
    let CellState { indexes, levels } = mesh.cell_state;
    if indexes.len() != levels.len() {
        return Err(ImportError::content(format!(
            "has {} indexes of cells and {} levels",
            indexes.len(),
            levels.len()
        )));
    }
    for (axis, widths) in h.iter().enumerate() {
        let Some(&first) = widths.first() else { continue };
        if let Some(other) = widths.iter().find(|&&w| (w - first).abs() > 1e-6 * first) {
            return Err(ImportError::content(format!(
                "has widths {first} and {other} along axis {}: an oct-tree of cubes has equal smallest cells",
                axis + 1
            )));
        }
    }
    let shape = [0, 1, 2].map(|a| h[a].len() as u64);
    let grid = Grid::new(shape, origin, [0, 1, 2].map(|a| h[a].first().copied().unwrap_or(0.0)))?;
    // A centre is an odd number of half edges from the origin, so its lowest bit gives the edge.
    let cell = |centre: &[i64; 3]| {
        let edge = (centre[0] & centre[0].wrapping_neg()) as f64;
        (centre.map(|c| (c as f64 - edge) / 2.0), edge)
    };
    let mut cells = grid.cells(indexes.iter().map(cell));
    cells.levels = Some(levels);
    Ok(cells)
}

fn from_ubc(text: &str, requested: Option<Root>) -> Result<Cells, ImportError> {
    let mut lines = (1..).zip(text.lines()).filter_map(|(number, line)| {
        let content = line.split('!').next().unwrap_or_default().trim();
        (!content.is_empty()).then_some((number, content))
    });
    let mut next = |what: &str| {
        lines.next().ok_or_else(|| {
            ImportError::content(format!("ends before {what}: it is not a UBC oct-tree mesh"))
        })
    };
    // The first line may continue with the extent of a core region.
    let shape = numbers::<u64>(next("the numbers of cells")?)?;
    let top = fixed(numbers::<f64>(next("the top corner")?)?, "the top corner")?;
    let edges = fixed(
        numbers::<f64>(next("the edges of the smallest cell")?)?,
        "the edges of the smallest cell",
    )?;
    let [count] = fixed(numbers::<u64>(next("the number of cells")?)?, "the number of cells")?;
    let shape = shape
        .first_chunk()
        .copied()
        .ok_or_else(|| ImportError::content("has fewer than three numbers of cells"))?;
    let mut grid = Grid::new(shape, top, edges)?;
    grid.origin[2] -= shape[2] as f64 * grid.edge;
    // Indices begin at 1; those along z count from the top downward.
    let above = shape[2] as f64 + 1.0;
    let mut rows = Vec::new();
    for line in lines {
        let [i, j, k, edge] = fixed(numbers::<f64>(line)?, "a cell")?;
        rows.push(([i - 1.0, j - 1.0, above - k - edge], edge));
    }
    if rows.len() as u64 != count {
        return Err(ImportError::content(format!(
            "states {count} cells and has {}: it is incomplete",
            rows.len()
        )));
    }
    if let Some(root) = requested.filter(|root| agrees(root, &grid)) {
        let along = grid.root().edge / grid.edge;
        (grid.origin, grid.edge) = (root.origin, root.edge / along);
    }
    Ok(grid.cells(rows.into_iter()))
}

/// Whether a root is that of the grid before the file rounded it.
fn agrees(root: &Root, grid: &Grid) -> bool {
    let along = grid.root().edge / grid.edge;
    let near = |a: f64, b: f64, by: f64| (a - b).abs() <= by * 1.001;
    let vertical = ROUNDING_CORNER + grid.shape[2] as f64 * ROUNDING_EDGE;
    near(root.edge, grid.root().edge, along * ROUNDING_EDGE)
        && (0..2).all(|a| near(root.origin[a], grid.origin[a], ROUNDING_CORNER))
        && near(root.origin[2], grid.origin[2], vertical)
}

/// The numbers of a line.
fn numbers<T: std::str::FromStr>((line, text): (usize, &str)) -> Result<Vec<T>, ImportError> {
    let parse = |field: &str| {
        field.parse().map_err(|_| {
            ImportError::content(format!(
                "line {line} has {field:?}, which is not a valid number there"
            ))
        })
    };
    text.split_whitespace().map(parse).collect()
}

fn fixed<T, const N: usize>(numbers: Vec<T>, what: &str) -> Result<[T; N], ImportError> {
    let found = numbers.len();
    numbers
        .try_into()
        .map_err(|_| ImportError::content(format!("has {found} numbers for {what}, which has {N}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file has the upper end of z: its corner follows from all of the rounded edges.
    #[test]
    fn a_root_is_that_of_a_grid_if_rounding_explains_the_difference() {
        let grid = Grid { shape: [8; 3], origin: [1.0, 2.0, 3.0], edge: 0.25 };
        let exact = grid.root();
        assert!(agrees(&exact, &grid));
        let along = |axis: usize, by: f64| {
            let mut root = exact;
            root.origin[axis] += by;
            agrees(&root, &grid)
        };
        for (axis, most) in
            [(0, ROUNDING_CORNER), (1, ROUNDING_CORNER), (2, ROUNDING_CORNER + 8.0 * ROUNDING_EDGE)]
        {
            for sign in [1.0, -1.0] {
                assert!(
                    along(axis, 0.99 * sign * most) && !along(axis, 1.01 * sign * most),
                    "{axis}"
                );
            }
        }
        let with_edge = |by: f64| agrees(&Root { edge: exact.edge + by, ..exact }, &grid);
        assert!(with_edge(0.99 * 8.0 * ROUNDING_EDGE) && !with_edge(1.01 * 8.0 * ROUNDING_EDGE));
    }
}
