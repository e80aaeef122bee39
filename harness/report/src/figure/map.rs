//! Maps: cells in a plane and the section of a body, on axes of one scale.
//!
//! `plotters` draws their axes and legend, and this file what is between them: `plotters` knows whole points of the page only, and an element per cell
//! would make large files.

use super::axes::{BELOW, Scale};
use super::canvas::{INK, RIGHT, WIDTH, hex};
use std::collections::BTreeSet;
use std::ops::Range;

/// Greatest height of a map: it and its margins fit on a page.
pub const MAP_HEIGHT_MAX: f64 = 1650.0;
/// Space below the horizontal axis of a map, for its caption.
pub const CAPTION: f64 = 80.0;

/// Cells of one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Fill {
    pub colour: [u8; 3],
    pub is_outlined: bool,
    /// Lower left and upper right corner of every cell.
    pub cells: Vec<[[f64; 2]; 2]>,
}

/// Cells in a plane and the section of a body, on axes of one scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// What colours show.
    pub title: String,
    /// Names of the colours.
    pub key: Vec<(String, [u8; 3])>,
    /// The cells, the last ones over the first.
    pub fills: Vec<Fill>,
    /// The segments of the section, if the body is known.
    pub section: Option<Vec<[[f64; 2]; 2]>>,
    /// A line below the axes.
    pub caption: String,
}

/// The height of the page of a map, and the space at its right: its axes have one scale.
pub fn size(x: &Scale, y: &Scale, top: f64) -> (u32, f64) {
    let [across, up] = [x, y].map(|scale| scale.ends.end - scale.ends.start);
    let scale = ((WIDTH - y.left() - RIGHT) / across).min(MAP_HEIGHT_MAX / up);
    let height = top + (up * scale).round() + BELOW + CAPTION;
    (height as u32, (WIDTH - y.left() - across * scale).round())
}

/// The elements of the cells, of the section, which a light line separates from dark cells, and of a frame, in these columns and rows of the page.
pub fn paint(
    map: &Map,
    [x, y]: [&Range<f64>; 2],
    (columns, rows): (Range<i32>, Range<i32>),
) -> Vec<String> {
    let [left, right, top, bottom] =
        [columns.start, columns.end, rows.start, rows.end].map(f64::from);
    let at = |[u, v]: [f64; 2]| {
        let across = (u - x.start) / (x.end - x.start) * (right - left);
        let up = (v - y.start) / (y.end - y.start) * (bottom - top);
        // To a tenth of a unit. Adding zero turns -0 into 0.
        [left + across, bottom - up].map(|value| (value * 10.0).round() / 10.0 + 0.0)
    };
    let rectangle = |corners: &[[f64; 2]; 2]| {
        let [[left, bottom], [right, top]] = corners.map(at);
        format!("M{left} {bottom}H{right}V{top}H{left}z")
    };
    let mut painted = Vec::new();
    for Fill { colour, is_outlined, cells } in &map.fills {
        let d: String = cells.iter().map(rectangle).collect();
        let edges = match is_outlined {
            true => format!(r#"stroke="{}" stroke-width="0.7""#, hex(outline(*colour))),
            // Without seams between neighbours.
            false => r#"shape-rendering="crispEdges""#.to_owned(),
        };
        painted.push(format!(r#"<path d="{d}" fill="{}" {edges}/>"#, hex(*colour)));
    }
    let segment = |ends: &[[f64; 2]; 2]| {
        let [[x, y], [to_x, to_y]] = ends.map(at);
        (x != to_x || y != to_y).then(|| format!("M{x} {y}L{to_x} {to_y}"))
    };
    // Facets that are small on the page have many equal segments, or none.
    let segments: BTreeSet<String> = map.section.iter().flatten().filter_map(segment).collect();
    let d: String = segments.into_iter().collect();
    let lines = [("#FFFFFF", 5.0), ("#000000", 2.5)].into_iter().filter(|_| !d.is_empty());
    for (colour, width) in lines {
        let line = format!(r#"stroke="{colour}" stroke-width="{width}" stroke-linecap="round""#);
        painted.push(format!(r#"<path d="{d}" fill="none" {line}/>"#));
    }
    let frame = rectangle(&[[x.start, y.start], [x.end, y.end]]);
    painted.push(format!(r#"<path d="{frame}" fill="none" stroke="{INK}" stroke-width="2"/>"#));
    painted
}

/// The colour of outlines around a fill: the same hue, so that small cells look like those of the legend.
pub fn outline(fill: [u8; 3]) -> [u8; 3] {
    let is_light = fill.iter().map(|&c| u32::from(c)).sum::<u32>() > 360;
    fill.map(|c| if is_light { c / 2 } else { c / 2 + 105 })
}
