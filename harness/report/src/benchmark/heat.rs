//! Draws square matrices as heat maps, side by side: colours, and rectangles of one colour.
//!
//! Invariants: more is darker, so that the order survives in grey; what is not in the matrix has no colour but
//! the ground's; the scale is logarithmic and ends at powers of ten, which its bar shows.

use super::canvas::{Anchor, Canvas, HEIGHT, INK, SIZE, WIDTH};
use super::figure::{Axis, Figure, Heat, Layer, short};
use super::scale::Scale;
use plotters::style::RGBColor;

/// Number of colours.
pub const STEPS: usize = 24;

/// Cividis from its light end to its dark one: made to look alike with and without deficiencies of colour vision.
const CIVIDIS: [[u8; 3]; 7] = [
    [255, 234, 70],
    [211, 193, 100],
    [166, 157, 117],
    [124, 123, 120],
    [87, 92, 109],
    [35, 62, 108],
    [0, 32, 77],
];

/// A step's colour, from 0 to [`STEPS`] - 1.
pub fn shade(step: usize) -> [u8; 3] {
    let at = step.min(STEPS - 1) as f64 / (STEPS - 1) as f64 * (CIVIDIS.len() - 1) as f64;
    let from = (at as usize).min(CIVIDIS.len() - 2);
    let part = at - from as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(CIVIDIS[from][i]), f64::from(CIVIDIS[from + 1][i]));
        (a + (b - a) * part).round() as u8
    })
}

/// Where the scale of a layer begins and ends: powers of ten around its values.
pub fn ends(layer: &Layer) -> (f64, f64) {
    let values = || layer.cells.iter().map(|c| c.2).filter(|v| *v > 0.0);
    let least = values().fold(f64::INFINITY, f64::min);
    let most = values().fold(0.0, f64::max);
    if most <= 0.0 {
        return (1.0, 10.0);
    }
    let low = least.log10().floor() as i32;
    (10f64.powi(low), 10f64.powi((most.log10().ceil() as i32).max(low + 1)))
}

/// Neighbours in a row with the same colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The row, from 0.
    pub row: usize,
    /// The first column.
    pub first: usize,
    /// The column after the last.
    pub end: usize,
    /// The colour.
    pub step: usize,
}

/// A layer's cells that have a colour, neighbours of one colour together.
pub fn spans(layer: &Layer) -> Vec<Span> {
    let (low, high) = ends(layer);
    let step = |value: f64| {
        let part = (value / low).ln() / (high / low).ln();
        ((part * STEPS as f64) as usize).min(STEPS - 1)
    };
    let mut cells: Vec<_> = layer.cells.iter().filter(|c| c.2 > 0.0).collect();
    cells.sort_by_key(|c| (c.0, c.1));
    let mut out: Vec<Span> = Vec::new();
    for &&(row, column, value) in &cells {
        let step = step(value);
        match out.last_mut() {
            Some(s) if (s.row, s.end, s.step) == (row, column, step) => s.end += 1,
            _ => out.push(Span { row, first: column, end: column + 1, step }),
        }
    }
    out
}

/// About four ticks along a matrix's side.
pub fn ticks(side: usize) -> Vec<usize> {
    (0..side).step_by(side.div_ceil(4).max(1)).collect()
}

/// Edge of a map, in pixels: a multiple of 16, 32 and 64 ranks.
const EDGE: i32 = 576;
const TOP: i32 = 30;
/// Space at the left of a map, for its labels.
const LEFT: i32 = 180;

/// Paints the layers beside each other, each with its scale below it.
pub fn paint(canvas: &Canvas, figure: &Figure, heat: &Heat) {
    let column = WIDTH as i32 / heat.layers.len().max(1) as i32;
    for (i, layer) in heat.layers.iter().enumerate() {
        let left = column * i as i32 + LEFT;
        map(canvas, figure, heat.side, layer, left);
        bar(canvas, layer, left);
    }
}

fn map(canvas: &Canvas, figure: &Figure, side: usize, layer: &Layer, left: i32) {
    let at = |i: usize| (i as f64 / side.max(1) as f64 * f64::from(EDGE)).round() as i32;
    // The ground is white on a dark page, too: colours are told from it and from each other.
    canvas.fill((left, TOP), (left + EDGE, TOP + EDGE), RGBColor(255, 255, 255));
    for s in spans(layer) {
        let [r, g, b] = shade(s.step);
        let (from, to) =
            ((left + at(s.first), TOP + at(s.row)), (left + at(s.end), TOP + at(s.row + 1)));
        canvas.fill(from, to, RGBColor(r, g, b));
    }
    frame(canvas, (left, TOP), (left + EDGE, TOP + EDGE));
    for t in ticks(side) {
        let middle = (at(t) + at(t + 1)) / 2;
        let (x, y) = (left + middle, TOP + middle);
        canvas.line(&[(x, TOP + EDGE), (x, TOP + EDGE + 12)], INK, 2, None);
        canvas.text(&t.to_string(), (x, TOP + EDGE + 20), Anchor::Below);
        canvas.line(&[(left - 12, y), (left, y)], INK, 2, None);
        canvas.text(&t.to_string(), (left - 20, y), Anchor::Right);
    }
    canvas.text(&figure.x.label, (left + EDGE / 2, TOP + EDGE + 74), Anchor::Below);
    canvas.text(&figure.y.label, (left - 100, TOP + EDGE / 2), Anchor::Turned);
}

fn frame(canvas: &Canvas, (x0, y0): (i32, i32), (x1, y1): (i32, i32)) {
    canvas.line(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], INK, 2, None);
}

/// The scale: all colours, ticks at powers of ten, the quantity.
fn bar(canvas: &Canvas, layer: &Layer, left: i32) {
    let (y0, y1) = (HEIGHT as i32 - 250, HEIGHT as i32 - 200);
    let at = |part: f64| left + (part * f64::from(EDGE)).round() as i32;
    for step in 0..STEPS {
        let [r, g, b] = shade(step);
        let part = |i: usize| at(i as f64 / STEPS as f64);
        canvas.fill((part(step), y0), (part(step + 1), y1), RGBColor(r, g, b));
    }
    frame(canvas, (left, y0), (left + EDGE, y1));
    let scale = Scale::of(&Axis { range: Some(ends(layer)), ..Axis::log("") }, &[]);
    // Labels of many decades would run into each other.
    let every = scale.ticks.len().div_ceil(5).max(1);
    for (i, t) in scale.ticks.iter().enumerate() {
        let x = at(scale.at(*t));
        canvas.line(&[(x, y1), (x, y1 + 12)], INK, 2, None);
        if i % every == 0 {
            canvas.text(&short(*t), (x, y1 + 20), Anchor::Below);
        }
    }
    canvas.text(&layer.label, (left + EDGE / 2, y1 + 20 + SIZE + 18), Anchor::Below);
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::benchmark::figure::{Body, Claims};

    pub(crate) fn layer(cells: &[(usize, usize, f64)]) -> Layer {
        Layer { label: "bytes".into(), cells: cells.to_vec() }
    }

    pub(crate) fn figure() -> Figure {
        let cells = [(0, 1, 10.0), (0, 2, 11.0), (2, 0, 1e6)];
        let heat = Heat { side: 3, layers: vec![layer(&cells)], command: "mesher a,b".into() };
        Figure {
            id: "messages".into(),
            title: "Messages".into(),
            caption: "On 3 simulated ranks, without collective calls.".into(),
            x: Axis::linear("to rank"),
            y: Axis::linear("from rank"),
            body: Body::Heat(heat),
            claims: Claims { deterministic: true, ..Claims::default() },
        }
    }

    #[test]
    fn more_is_darker_in_grey_too() {
        let grey = |[r, g, b]: [u8; 3]| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let greys: Vec<f64> = (0..STEPS).map(|s| grey(shade(s))).collect();
        assert!(greys.windows(2).all(|w| w[0] > w[1] + 2.0), "{greys:?}");
        // The least is told from nothing, which is white.
        assert!(greys[0] < 235.0 && greys[STEPS - 1] < 40.0);
    }

    #[test]
    fn neighbours_of_one_colour_are_one_rectangle() {
        let layer = layer(&[(0, 1, 10.0), (0, 2, 11.0), (0, 4, 11.0), (1, 0, 1e5), (1, 1, 0.0)]);
        assert_eq!(ends(&layer), (10.0, 1e5));
        let [a, b, c] = spans(&layer)[..] else { panic!("{:?}", spans(&layer)) };
        assert_eq!((a.row, a.first, a.end, a.step), (0, 1, 3, 0));
        assert_eq!((b.first, b.end), (4, 5));
        assert_eq!((c.row, c.first, c.step), (1, 0, STEPS - 1));
    }

    #[test]
    fn one_value_has_a_scale_too() {
        assert_eq!(ends(&layer(&[(0, 1, 100.0)])), (100.0, 1000.0));
        assert_eq!(ends(&layer(&[])), (1.0, 10.0));
        assert_eq!(ticks(64), [0, 16, 32, 48]);
        assert_eq!(ticks(3), [0, 1, 2]);
    }

    #[test]
    fn maps_are_drawn_with_their_scales() {
        let svg = crate::benchmark::paint::svg(&figure());
        let fills = |colour: &str| svg.matches(&format!("fill=\"{colour}\"")).count();
        // The ground, and of both ends' colours a cell and a piece of the scale.
        assert_eq!(fills("#FFFFFF"), 1, "{svg}");
        assert_eq!(fills("#00204D"), 2);
        for word in ["from rank", "to rank", "bytes", "10⁵"] {
            assert!(svg.contains(word), "{word}");
        }
    }
}
