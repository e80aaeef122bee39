//! PNG and PDF from SVG, with the shipped typeface only, so that they look the same on every machine.

use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// DejaVu Sans, Latin part; its licence is beside it.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-latin.ttf");

/// PNG's pixels per SVG's.
const ZOOM: f32 = 1.0;

fn tree(svg: &str) -> Result<usvg::Tree, String> {
    let mut options =
        usvg::Options { font_family: super::canvas::FONT.into(), ..usvg::Options::default() };
    Arc::make_mut(&mut options.fontdb).load_font_data(FONT.to_vec());
    usvg::Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

/// The figure as PNG, on white.
///
/// # Errors
/// Where `svg` is none.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let tree = tree(svg)?;
    let size = tree.size();
    let side = |length: f32| (length * ZOOM).ceil() as u32;
    let mut pixels =
        tiny_skia::Pixmap::new(side(size.width()), side(size.height())).ok_or("it has no size")?;
    pixels.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, tiny_skia::Transform::from_scale(ZOOM, ZOOM), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

/// The figure as PDF with its text as text.
///
/// # Errors
/// Where `svg` is none.
pub fn pdf(svg: &str) -> Result<Vec<u8>, String> {
    let tree = tree(svg)?;
    svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions::default())
        .map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::figure::{Body, How};
    use super::super::paint::{svg, tests};
    use super::*;

    #[test]
    fn both_formats_come_out_with_their_words() {
        let drawn = svg(&tests::figure(Body::Points(vec![tests::series(How::Measured)])));
        let image = png(&drawn).unwrap();
        assert_eq!(&image[1..4], b"PNG");
        // Without its words the image would be another one.
        let silent = png(&drawn.replace("speedup", "").replace("ranks", "")).unwrap();
        assert_ne!(image, silent);
        let page = pdf(&drawn).unwrap();
        assert!(page.starts_with(b"%PDF"));
        assert!(page.windows(10).any(|w| w == b"DejaVuSans"), "the typeface is in the file");
    }
}
