//! Matrices as heat maps, side by side.
//!
//! Invariants: larger values are darker, so that the order survives in grey; zero has the colour of the background; the
//! colour scale is logarithmic and ends at powers of ten.

use super::axes::axes;
use super::canvas::{Canvas, SIZE, WIDTH};
use super::palette::{SHADES, hex, shade};
use super::{Axis, Figure, HeatMap, Layer};

/// Ends of the colour scale of a layer: powers of ten that enclose its values.
pub fn range(layer: &Layer) -> (f64, f64) {
    let values = || layer.entries.iter().map(|e| e.2).filter(|v| *v > 0.0);
    let (min, max) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
    if max <= 0.0 {
        return (1.0, 10.0);
    }
    let low = min.log10().floor() as i32;
    (10f64.powi(low), 10f64.powi((max.log10().ceil() as i32).max(low + 1)))
}

/// Row, column and shade of every entry that is not zero.
fn shades(layer: &Layer) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
    let (low, high) = range(layer);
    let shade = move |value: f64| {
        let fraction = (value / low).ln() / (high / low).ln();
        ((fraction * SHADES as f64) as usize).min(SHADES - 1)
    };
    layer.entries.iter().filter(|e| e.2 > 0.0).map(move |&(row, column, v)| (row, column, shade(v)))
}

/// Edge of a map: a multiple of 16, 32 and 64 ranks.
const EDGE: f64 = 576.0;
const TOP: f64 = 30.0;
/// Space at the right of the last map, for half of a label.
const RIGHT: f64 = 20.0;
/// Space for labels at the left of a map.
const LEFT: f64 = 190.0;

/// Draws the layers side by side, each with its colour scale below it.
pub fn draw(canvas: &mut Canvas, figure: &Figure, map: &HeatMap) {
    let column = (f64::from(WIDTH) - RIGHT) / map.layers.len().max(1) as f64;
    for (i, layer) in map.layers.iter().enumerate() {
        let left = column * i as f64 + LEFT;
        draw_layer(canvas, figure, map.order, layer, left);
        draw_scale(canvas, layer, left, f64::from(figure.height) - 5.4 * SIZE);
    }
}

fn draw_layer(canvas: &mut Canvas, figure: &Figure, order: usize, layer: &Layer, left: f64) {
    let side = EDGE / order.max(1) as f64;
    // White on a dark page too: the shades are chosen for it.
    canvas.fill(&[[left, TOP, EDGE, EDGE]], "#FFFFFF");
    let mut of_shade = vec![Vec::new(); SHADES];
    for (row, column, shade) in shades(layer) {
        of_shade[shade].push([left + column as f64 * side, TOP + row as f64 * side, side, side]);
    }
    for (i, rectangles) in of_shade.iter().enumerate().filter(|(_, r)| !r.is_empty()) {
        canvas.fill(rectangles, &hex(shade(i)));
    }
    // The middle of an entry has its number.
    let ticks = (0..order).step_by(order.div_ceil(4).max(1)).map(|t| t as f64);
    let ticks: Vec<f64> = ticks.collect();
    let [x, y] = [&figure.x, &figure.y].map(|axis| axis.clone().with_ticks(ticks.clone()));
    let (first, last) = (-0.5, order as f64 - 0.5);
    let _ = axes(
        canvas,
        [&x, &y],
        [first..last, last..first],
        ((left, TOP), (left + EDGE, TOP + EDGE)),
        false,
    );
}

/// All shades, ticks at powers of ten, and the quantity.
fn draw_scale(canvas: &mut Canvas, layer: &Layer, left: f64, top: f64) {
    let (height, step) = (50.0, EDGE / SHADES as f64);
    for i in 0..SHADES {
        canvas.fill(&[[left + i as f64 * step, top, step, height]], &hex(shade(i)));
    }
    let (low, high) = range(layer);
    let decades = (high / low).log10().round() as i32;
    // Labels of many decades would overlap.
    let powers = (0..=decades).step_by(decades.unsigned_abs().div_ceil(4).max(1) as usize);
    let ticks = powers.map(|power| low * 10f64.powi(power)).collect();
    let x = Axis { ticks, ..Axis::log(&layer.label) };
    let y = Axis { ticks: vec![f64::NAN], ..Axis::linear("") };
    let _ = axes(
        canvas,
        [&x, &y],
        [low..high, 1.0..0.0],
        ((left, top), (left + EDGE, top + height)),
        false,
    );
}

#[cfg(test)]
mod tests {
    use super::super::samples::heat_map;
    use super::super::svg;
    use super::*;

    fn layer(entries: &[(usize, usize, f64)]) -> Layer {
        Layer { label: "bytes".into(), entries: entries.to_vec() }
    }

    #[test]
    fn shades_are_logarithmic_and_zero_has_none() {
        let layer = layer(&[(0, 1, 10.0), (0, 2, 1e3), (1, 0, 1e5), (1, 1, 0.0)]);
        assert_eq!(range(&layer), (10.0, 1e5));
        let all: Vec<_> = shades(&layer).collect();
        assert_eq!(all, [(0, 1, 0), (0, 2, SHADES / 2), (1, 0, SHADES - 1)]);
    }

    #[test]
    fn one_value_and_no_values_have_a_range() {
        assert_eq!(range(&layer(&[(0, 1, 100.0)])), (100.0, 1000.0));
        assert_eq!(range(&layer(&[])), (1.0, 10.0));
    }

    #[test]
    fn the_drawing_has_one_element_per_shade() {
        let svg = svg::svg(&heat_map());
        let fills = |colour: &str| svg.matches(&format!("fill=\"{colour}\"")).count();
        assert_eq!(fills("#FFFFFF"), 1, "{svg}");
        // Of either end of the scale: its entries together, and a part of the colour scale.
        assert_eq!((fills("#FFEA46"), fills("#00204D")), (2, 2));
        for text in ["from rank", "to rank", "bytes", "10⁵"] {
            assert!(svg.contains(&format!(">{text}<")), "{text} is missing in\n{svg}");
        }
    }
}
