//! The formats of a drawing. PNG and PDF are made from the SVG, with the typeface in `font/` only, so that they look the same on every machine.

use std::path::Path;

/// Makes a file of a format from an SVG document; fails if it is none.
pub type Format = fn(&str) -> Result<Vec<u8>, String>;

/// The formats that were compiled, with the ends of their files' names: scalable vector graphics; an image on white, with one pixel per unit
/// of the SVG's coordinates; a page whose text remains text.
pub const FORMATS: &[(&str, Format)] = &[
    ("svg", |svg| Ok(svg.into())),
    #[cfg(feature = "figures")]
    ("png", rendered::png),
    #[cfg(feature = "figures")]
    ("pdf", rendered::pdf),
];

/// The format that a file name states.
///
/// # Errors
/// One sentence, if it states none that was compiled.
pub fn format_of(path: &Path) -> Result<Format, String> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let known = FORMATS.iter().find(|(name, _)| extension.eq_ignore_ascii_case(name));
    let why = match cfg!(feature = "figures") {
        true => "the file name of a picture must end in .svg, .png or .pdf",
        false => "a harness without the feature figures draws .svg only",
    };
    known.map(|(_, format)| *format).ok_or_else(|| format!("{}: {why}", path.display()))
}

#[cfg(feature = "figures")]
pub(super) mod rendered {
    use crate::figure::canvas::FONT;
    use regex::bytes::{Captures, Regex};
    use resvg::{tiny_skia, usvg};
    use std::sync::Arc;

    /// DejaVu Sans, Latin part; its licence is in the same directory.
    const FONT_FILE: &[u8] = include_bytes!("font/DejaVuSans-latin.ttf");

    pub fn tree(svg: &str) -> Result<usvg::Tree, String> {
        let mut options = usvg::Options { font_family: FONT.into(), ..usvg::Options::default() };
        Arc::make_mut(&mut options.fontdb).load_font_data(FONT_FILE.to_vec());
        usvg::Tree::from_str(svg, &options).map_err(|error| error.to_string())
    }

    pub fn png(svg: &str) -> Result<Vec<u8>, String> {
        let tree = tree(svg)?;
        let size = tree.size().to_int_size();
        let pixels = tiny_skia::Pixmap::new(size.width(), size.height());
        let mut pixels = pixels.ok_or("the size is 0")?;
        pixels.fill(tiny_skia::Color::WHITE);
        resvg::render(&tree, tiny_skia::Transform::identity(), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| error.to_string())
    }

    pub fn pdf(svg: &str) -> Result<Vec<u8>, String> {
        let (conversion, page) = Default::default();
        let made = svg2pdf::to_pdf(&tree(svg)?, conversion, page);
        // The resources of a page have a random order. Those of one kind are lines in sequence, which keep their length.
        let resources = Regex::new(r"(?m-u)(?:^ +/[a-z]+[0-9]+ [0-9]+ 0 R\n)+").expect("constant");
        let sorted = |found: &Captures| {
            let mut lines: Vec<&[u8]> = found[0].split_inclusive(|byte| *byte == b'\n').collect();
            lines.sort_unstable();
            lines.concat()
        };
        made.map(|pdf| resources.replace_all(&pdf, sorted).into())
            .map_err(|error| error.to_string())
    }
}
