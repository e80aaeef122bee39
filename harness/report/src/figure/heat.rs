//! Matrices as heat maps, side by side, as drawings and as images.
//!
//! Invariants: larger values are darker, so that the order survives in grey; zero has the colour of the background; the
//! colour scale is logarithmic and ends at powers of ten.

use super::canvas::{Anchor, Canvas, INK, SIZE, WIDTH};
use super::palette::{SHADES, hex, shade};
use super::scale::Scale;
use super::{Axis, Figure, HeatMap, Layer, tick_label};

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

/// About four ticks along the side of a matrix.
pub fn ticks(order: usize) -> Vec<usize> {
    (0..order).step_by(order.div_ceil(4).max(1)).collect()
}

/// Pixels per entry and direction of an image. More than one, because some viewers smooth small images.
const ZOOM: usize = 8;

/// A layer as PNG without axes.
///
/// # Panics
/// If an entry is outside of the matrix.
pub fn png(order: usize, layer: &Layer) -> Vec<u8> {
    // The last colour of the palette is the background.
    let mut pixels = vec![SHADES as u8; order * order];
    shades(layer).for_each(|(row, column, shade)| pixels[row * order + column] = shade as u8);
    let zoomed = |row: &[u8]| -> Vec<u8> {
        row.iter().flat_map(|&pixel| [pixel; ZOOM]).collect::<Vec<u8>>().repeat(ZOOM)
    };
    let image: Vec<u8> = pixels.chunks(order.max(1)).flat_map(zoomed).collect();
    let palette: Vec<u8> = (0..SHADES).flat_map(shade).chain([255; 3]).collect();
    let side = (order.max(1) * ZOOM) as u32;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    encoder.set_compression(png::Compression::Best);
    encoder.set_filter(png::FilterType::Up);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&image));
    written.expect("memory accepts an image of the stated size");
    bytes
}

/// Edge of a map: a multiple of 16, 32 and 64 ranks.
const EDGE: f64 = 576.0;
const TOP: f64 = 30.0;
/// Space for labels at the left of a map.
const LEFT: f64 = 180.0;

/// Draws the layers side by side, each with its colour scale below it.
pub fn draw(canvas: &mut Canvas, figure: &Figure, map: &HeatMap) {
    let column = f64::from(WIDTH) / map.layers.len().max(1) as f64;
    for (i, layer) in map.layers.iter().enumerate() {
        let left = column * i as f64 + LEFT;
        draw_layer(canvas, figure, map.order, layer, left);
        draw_scale(canvas, layer, left, f64::from(figure.height) - 250.0);
    }
}

fn draw_layer(canvas: &mut Canvas, figure: &Figure, order: usize, layer: &Layer, left: f64) {
    let side = EDGE / order.max(1) as f64;
    // White on a dark page too: the shades are chosen for it.
    canvas.fill(&[[left, TOP, EDGE, EDGE]], "#FFFFFF");
    // One element per shade instead of one per entry keeps the file small.
    let mut of_shade = vec![Vec::new(); SHADES];
    for (row, column, shade) in shades(layer) {
        of_shade[shade].push([left + column as f64 * side, TOP + row as f64 * side, side, side]);
    }
    for (i, rectangles) in of_shade.iter().enumerate().filter(|(_, r)| !r.is_empty()) {
        canvas.fill(rectangles, &hex(shade(i)));
    }
    canvas.frame((left, TOP), (left + EDGE, TOP + EDGE));
    let bottom = TOP + EDGE;
    for t in ticks(order) {
        let middle = (t as f64 + 0.5) * side;
        let (x, y) = (left + middle, TOP + middle);
        canvas.line(&[(x, bottom), (x, bottom + 12.0)], INK, 2.0, None);
        canvas.text(&t.to_string(), (x, bottom + 20.0), Anchor::Below);
        canvas.line(&[(left - 12.0, y), (left, y)], INK, 2.0, None);
        canvas.text(&t.to_string(), (left - 20.0, y), Anchor::End);
    }
    canvas.text(&figure.x.label, (left + EDGE / 2.0, bottom + 74.0), Anchor::Below);
    canvas.text(&figure.y.label, (left - 100.0, TOP + EDGE / 2.0), Anchor::Turned);
}

/// All shades, ticks at powers of ten, and the quantity.
fn draw_scale(canvas: &mut Canvas, layer: &Layer, left: f64, top: f64) {
    let (height, step) = (50.0, EDGE / SHADES as f64);
    for i in 0..SHADES {
        canvas.fill(&[[left + i as f64 * step, top, step, height]], &hex(shade(i)));
    }
    let bottom = top + height;
    canvas.frame((left, top), (left + EDGE, bottom));
    let scale = Scale::of(&Axis { range: Some(range(layer)), ..Axis::log("") }, []);
    // Labels of many decades would overlap.
    let every = scale.ticks.len().div_ceil(5).max(1);
    for (i, t) in scale.ticks.iter().enumerate() {
        let x = left + scale.position(*t) * EDGE;
        canvas.line(&[(x, bottom), (x, bottom + 12.0)], INK, 2.0, None);
        if i % every == 0 {
            canvas.text(&tick_label(*t), (x, bottom + 20.0), Anchor::Below);
        }
    }
    canvas.text(&layer.label, (left + EDGE / 2.0, bottom + SIZE + 38.0), Anchor::Below);
}

#[cfg(test)]
mod tests {
    use super::super::samples::heat_map;
    use super::super::{Body, svg};
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
        assert_eq!(ticks(64), [0, 16, 32, 48]);
        assert_eq!(ticks(3), [0, 1, 2]);
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

    #[test]
    fn a_decoder_finds_the_entries_in_the_image() {
        let Body::HeatMap(map) = heat_map().body else { panic!("not a heat map") };
        let bytes = png(map.order, &map.layers[0]);
        let mut decoder = png::Decoder::new(&bytes[..]);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut image = vec![0; reader.output_buffer_size()];
        let info = reader.next_frame(&mut image).unwrap();
        assert_eq!((info.width, info.height), (24, 24));
        let colour = |row: usize, column: usize| {
            let start = 3 * (row * 24 + column);
            <[u8; 3]>::try_from(&image[start..start + 3]).unwrap()
        };
        assert_eq!(colour(3, 12), shade(0));
        assert_eq!(colour(20, 4), shade(SHADES - 1));
        assert_eq!(colour(0, 0), [255; 3]);
    }
}
