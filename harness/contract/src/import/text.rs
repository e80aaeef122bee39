//! Tables in text: one cell per line, fields separated by commas, semicolons or white space.
//!
//! A first line that is not numeric names the columns; without one they are x, y, z, level, 4, 5, ... Lines that begin
//! with `#` are comments.

use super::cells::Cells;
use super::{ImportError, Request, table};
use crate::files;
use std::path::Path;

/// Reads a table.
///
/// # Errors
/// If the file cannot be read, a line has another number of fields than the first, or a field is not a number.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    let text = files::read_text(path)?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !is_comment(line)).peekable();
    let Some(&(number, first)) = lines.peek() else {
        return Err(ImportError::content("has no cells"));
    };
    let columns = fields(first).count();
    if columns == 0 {
        return Err(ImportError::content(format!("line {number} has separators, but no fields")));
    }
    let named = fields(first).next().is_some_and(|field| field.parse::<f64>().is_err());
    let names = if named { fields(first).map(str::to_owned).collect() } else { names(columns) };
    if named {
        lines.next();
    }
    let mut values = Vec::new();
    for (line, text) in lines {
        for field in fields(text) {
            values.push(field.parse::<f64>().map_err(|_| {
                ImportError::content(format!("line {line} has {field:?}, which is not a number"))
            })?);
        }
        let found = fields(text).count();
        if found != columns {
            return Err(ImportError::content(format!(
                "line {line} has {found} fields, but line {number} has {columns}"
            )));
        }
    }
    let rows = values.len() / columns;
    table::cells(&names, rows, &|row, column| values[row * columns + column], request)
}

/// Names of the columns of a table without names.
pub(super) fn names(columns: usize) -> Vec<String> {
    let name =
        |i: usize| ["x", "y", "z", "level"].get(i).map_or(i.to_string(), |&name| name.to_owned());
    (0..columns).map(name).collect()
}

/// The fields of a line.
pub(super) fn fields(line: &str) -> impl Iterator<Item = &str> {
    let separator = |c: char| c == ',' || c == ';' || c.is_whitespace();
    line.split(separator).map(|field| field.trim_matches('"')).filter(|field| !field.is_empty())
}

/// Whether a line holds no cell.
pub(super) fn is_comment(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::Position;
    use crate::import::testing::file_of;
    use crate::lattice::Root;
    use crate::word::Side;

    const ROOT: Root = Root { origin: [-1.0, 0.0, 0.0], edge: 2.0 };

    fn read_with(text: &str, request: &Request) -> Result<Cells, ImportError> {
        read(file_of(text.as_bytes()).path(), request)
    }

    fn rooted() -> Request {
        Request { root: Some(ROOT), ..Request::default() }
    }

    #[test]
    fn columns_are_found_by_name_or_by_their_order() {
        let expected = read_with("-1,0,0,1\n0,0,0,2\n", &rooted()).unwrap();
        assert_eq!(expected.corners, [[-1.0, 0.0, 0.0], [0.0; 3]]);
        assert_eq!(expected.edges, [1.0, 0.5]);
        let request = Request { sides: Some("body".into()), ..rooted() };
        let text = "# a comment\n\"Level\"; body ;z;y;x\n1;2;0;0;-1\n\n2;0;0;0;0\n";
        let named = read_with(text, &request).unwrap();
        assert_eq!(named.sides, Some(vec![Side::Crossing, Side::Outside]));
        assert_eq!(Cells { sides: None, ..named }, expected);
    }

    #[test]
    fn centres_and_indices_are_converted_to_corners() {
        let corners = read_with("-1 0 0 1\n0 1 0 1\n", &rooted()).unwrap();
        let of = |position, text| read_with(text, &Request { position, ..rooted() }).unwrap();
        assert_eq!(of(Position::Centre, "-0.5 0.5 0.5 1\n0.5 1.5 0.5 1\n"), corners);
        assert_eq!(of(Position::Index, "0 0 0 1\n1 1 0 1\n"), corners);
        let unit = Request { position: Position::Index, ..Request::default() };
        assert_eq!(read_with("1 1 1 1\n", &unit).unwrap().corners, [[0.5; 3]]);
    }

    #[test]
    fn edges_need_no_root() {
        let cells = read_with("x y z edge\n0 0 0 0.5\n", &Request::default()).unwrap();
        assert_eq!((cells.edges, cells.root), (vec![0.5], None));
    }

    #[test]
    fn unusable_tables_are_one_sentence_each() {
        let refused = |text, request: &Request| read_with(text, request).unwrap_err().to_string();
        let cases = [
            ("", "has no cells"),
            ("# a comment\n,;\n", "line 2 has separators, but no fields"),
            ("0,0,0,1\n0,0,1\n", "line 2 has 3 fields, but line 1 has 4"),
            ("0,0,0,1\n0,0,zero,1\n", "line 2 has \"zero\", which is not a number"),
            ("x,y,level\n0,0,1\n", "has no column z: its columns are x, y, level"),
            ("x,y,z\n0,0,0\n", "has no column level"),
            ("0,0,0,1.5\n", "cell 0 has the level 1.5"),
            ("0,0,0,-1\n", "cell 0 has the level -1"),
            ("0,0,0,20\n", "cell 0 has the level 20"),
            ("0,0,0,nan\n", "cell 0 has the level NaN"),
        ];
        for (text, expected) in cases {
            let message = refused(text, &rooted());
            assert!(message.contains(expected), "{message}");
        }
        assert!(refused("0,0,0,1\n", &Request::default()).contains("--root"));
        let sides = Request { sides: Some("side".into()), ..rooted() };
        assert!(refused("x,y,z,level,side\n0,0,0,1,3\n", &sides).contains("cell 0 has the side 3"));
        assert!(refused("0,0,0,1\n", &sides).contains("has no column side"));
    }
}
