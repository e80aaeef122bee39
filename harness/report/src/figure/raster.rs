//! PNG and PDF from SVG, with the typeface in `font/` only, so that they look the same on every machine.

use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// DejaVu Sans, Latin part; its licence is in the same directory.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-latin.ttf");

fn tree(svg: &str) -> Result<usvg::Tree, String> {
    let mut options =
        usvg::Options { font_family: super::canvas::FONT.into(), ..usvg::Options::default() };
    Arc::make_mut(&mut options.fontdb).load_font_data(FONT.to_vec());
    usvg::Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

/// The figure as PNG, on white, with one pixel per unit of the SVG's coordinates.
///
/// # Errors
/// If `svg` is not an SVG document.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let tree = tree(svg)?;
    let size = tree.size().to_int_size();
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).ok_or("the size is 0")?;
    pixels.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, tiny_skia::Transform::identity(), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

/// The figure as PDF, whose text remains text.
///
/// # Errors
/// If `svg` is not an SVG document.
pub fn pdf(svg: &str) -> Result<Vec<u8>, String> {
    let tree = tree(svg)?;
    svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions::default())
        .map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::super::svg::svg;
    use super::super::{Body, Provenance};
    use super::*;

    #[test]
    fn png_and_pdf_contain_the_text() {
        let drawn = svg(&figure(Body::points(vec![series(Provenance::Measured)])));
        let image = png(&drawn).unwrap();
        assert_eq!(&image[1..4], b"PNG");
        let without_text = png(&drawn.replace(">speedup<", "><").replace(">ranks<", "><")).unwrap();
        assert_ne!(image, without_text);
        let page = pdf(&drawn).unwrap();
        assert!(page.starts_with(b"%PDF"));
        assert!(page.windows(10).any(|w| w == b"DejaVuSans"), "the typeface is in the file");
    }
}
