//! Tables of cells: columns x, y and z, and either `level` or `edge`.

use super::cells::Cells;
use super::{ImportError, Position, Request, side};
use crate::lattice::Root;
use crate::octant::LEVEL_MAX;

/// Index arrays without a root are positions in the unit cube.
const UNIT: Root = Root { origin: [0.0; 3], edge: 1.0 };

/// The columns that give the size of a cell.
enum Size {
    /// Levels of this root.
    Level(usize, Root),
    Edge(usize),
}

/// The cells of a table whose number in row r and column c is `value(r, c)`.
///
/// # Errors
/// If a column is missing, if there are levels and no root, or if a row is not a cell.
pub(super) fn cells(
    names: &[String],
    rows: usize,
    value: &dyn Fn(usize, usize) -> f64,
    request: &Request,
) -> Result<Cells, ImportError> {
    let column = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let required = |name: &str| {
        column(name).ok_or_else(|| {
            ImportError::content(format!(
                "has no column {name}: its columns are {}",
                names.join(", ")
            ))
        })
    };
    let xyz = [required("x")?, required("y")?, required("z")?];
    let size = match (column("level"), column("edge")) {
        (Some(level), _) => Size::Level(level, root(request)?),
        (None, Some(_)) if request.position == Position::Index => {
            return Err(ImportError::content("positions by index need a column level"));
        }
        (None, Some(edge)) => Size::Edge(edge),
        (None, None) => return Err(required("level").unwrap_err()),
    };
    let sides = request.sides.as_deref().map(required).transpose()?;
    let mut cells = Cells::default();
    for row in 0..rows {
        let edge = edge(&size, row, value)?;
        let at = xyz.map(|column| value(row, column));
        let corner = match (request.position, &size) {
            (Position::Index, Size::Level(_, root)) => {
                [0, 1, 2].map(|a| root.origin[a] + at[a] * edge)
            }
            (Position::Centre, _) => at.map(|c| c - edge / 2.0),
            _ => at,
        };
        cells.push(corner, edge);
    }
    cells.sides = sides
        .map(|column| (0..rows).map(|row| side(value(row, column), row)).collect())
        .transpose()?;
    if let Size::Level(_, root) = size {
        cells.root = Some(root);
    }
    Ok(cells)
}

/// The root that the levels of a table refer to.
fn root(request: &Request) -> Result<Root, ImportError> {
    let unit = (request.position == Position::Index).then_some(UNIT);
    request.root.or(unit).ok_or_else(|| {
        ImportError::content(
            "has levels, which give no edges without a root: give it with --root X,Y,Z,EDGE or --case CASE",
        )
    })
}

fn edge(size: &Size, row: usize, value: &dyn Fn(usize, usize) -> f64) -> Result<f64, ImportError> {
    match *size {
        Size::Edge(column) => Ok(value(row, column)),
        Size::Level(column, root) => {
            let level = value(row, column);
            if level.fract() != 0.0 || !(0.0..=f64::from(LEVEL_MAX)).contains(&level) {
                return Err(ImportError::content(format!(
                    "cell {row} has the level {level}, and levels are whole numbers from 0 to {LEVEL_MAX}"
                )));
            }
            Ok(root.edge / f64::from(1u32 << level as u32))
        }
    }
}
