//! The page of a drawing: its typeface, colours, and the places of a legend.

/// Width of every figure in the units of its coordinates.
pub const WIDTH: f64 = 1600.0;
/// The typeface, which is in `font/`.
pub const FONT: &str = "DejaVu Sans";
/// Height of the text.
pub const SIZE: f64 = 42.0;
/// Width of a symbol in a legend, with the space beside it.
pub const SYMBOL: f64 = 80.0;
/// Distance of lines of text.
const LEADING: f64 = SIZE + 8.0;

/// Space at the right of the data.
pub const RIGHT: f64 = 40.0;
/// Space between the label of the vertical axis and the edge of the page.
pub const EDGE: f64 = 10.0;

/// Colour of axes and text: that of the page's text where the drawing is part of a page, else black.
pub const INK: &str = "currentColor";
/// Distinguishable with every kind of colour vision (Okabe and Ito), the first ones also in grey.
pub const COLOURS: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [90, 90, 90],
];

/// A colour in the notation of SVG.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Estimated width of a text; exact widths depend on the reader's fonts.
pub fn width(text: &str) -> f64 {
    text.chars().count() as f64 * SIZE * 0.58
}

/// The left ends of the entries of a legend, which has as many rows as it needs, and its lower end. Names are beside symbols.
pub fn legend(left: f64, names: &[&str]) -> (Vec<(i32, i32)>, f64) {
    let (mut x, mut y, mut places) = (left, 36.0, Vec::new());
    for name in names {
        let entry = SYMBOL + width(name);
        if x > left && x + entry > WIDTH {
            (x, y) = (left, y + LEADING);
        }
        places.push((x as i32, y as i32));
        x += entry + 40.0;
    }
    (places, y + 40.0)
}
