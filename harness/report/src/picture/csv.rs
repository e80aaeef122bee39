//! The data of a picture as CSV.

use super::Picture;
use crate::figure::csv::table;

/// Squares and segments, one per line: two opposite corners or ends in the user's units; for squares also the greatest value
/// of their leaves and the number of them. Comments at the head, starting with `#`, name the picture and its command.
pub fn csv(picture: &Picture) -> String {
    let head = format!("# {}\n# {}\n", picture.title(), picture.command);
    let ends = [0, 1].map(|end| picture.axes().map(|axis| format!("{axis}{end}")));
    let value = match picture.colour {
        super::Colour::Spacing => "level".to_owned(),
        colour => colour.to_string(),
    };
    let mut columns = vec!["shape"];
    columns.extend(ends.as_flattened().iter().map(String::as_str));
    columns.extend([value.as_str(), "cells"]);
    let row = |shape: &str, ends: [[f64; 2]; 2], value: String, cells: String| {
        let mut row = vec![shape.to_owned()];
        row.extend(ends.as_flattened().iter().map(f64::to_string));
        row.extend([value, cells]);
        row
    };
    let squares = picture.squares.squares.iter().map(|s| {
        let name = picture.key.iter().find(|e| e.value == s.value).map(|e| e.name.clone());
        let value = match picture.colour {
            super::Colour::Side => name.unwrap_or_default(),
            _ => s.value.to_string(),
        };
        row("square", picture.corners(s), value, s.leaves.to_string())
    });
    let segments = picture.section.iter().flatten();
    let segments = segments.map(|ends| row("section", *ends, String::new(), String::new()));
    head + &table(&columns, squares.chain(segments))
}
