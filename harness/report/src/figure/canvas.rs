//! A drawing as SVG: lines, markers, polygons, text, a legend.

use maud::{PreEscaped, html};
use std::fmt::Write;

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

/// A point on the page; the origin is the upper left corner.
pub type At = (f64, f64);

/// How a line is drawn.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    pub colour: &'a str,
    pub width: f64,
    /// Lengths of dashes and gaps; empty for a solid line.
    pub dashes: &'a str,
}

/// The point of a text that is given.
#[derive(Clone, Copy, PartialEq)]
pub enum Anchor {
    /// The middle of its left end.
    Start,
    Middle,
    /// The middle of its right end.
    End,
    /// The middle of a text that is read upwards.
    Upwards,
}

/// A colour in the notation of SVG.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Estimated width of a text; exact widths depend on the reader's fonts.
pub fn width(text: &str) -> f64 {
    text.chars().count() as f64 * SIZE * 0.58
}

/// The left ends of the symbols of a legend, which has as many rows as it needs, the first of which begins at `start` and the others at
/// `left`; and its lower end. Names are beside the symbols.
pub fn legend([left, start]: [f64; 2], names: &[&str]) -> (Vec<At>, f64) {
    let (mut x, mut y) = (start, 36.0);
    let mut places = Vec::new();
    for name in names {
        let entry = SYMBOL + width(name);
        if x > left && x + entry > WIDTH {
            (x, y) = (left, y + LEADING);
        }
        places.push((x, y));
        x += entry + 40.0;
    }
    (places, y + 40.0)
}

/// The elements that are drawn so far, each on a line.
pub struct Canvas(String);

/// The document of what `paint` draws, which returns its height; `title` describes it to those who do not see it.
pub fn document(title: &str, paint: impl FnOnce(&mut Canvas) -> f64) -> String {
    let mut canvas = Canvas("\n".to_owned());
    let height = paint(&mut canvas).ceil();
    let document = html! {
        svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label=(title) width=(WIDTH) height=(height)
            viewBox=(format!("0 0 {WIDTH} {height}")) font-family=(FONT) font-size=(SIZE) fill=(INK) stroke-linejoin="round" { (PreEscaped(canvas.0)) }
    };
    document.into_string() + "\n"
}

impl Canvas {
    /// Adds elements.
    pub fn add(&mut self, element: &str) {
        self.0 += element;
        self.0.push('\n');
    }

    pub fn line(&mut self, points: &[At], line: Line) {
        self.lines(&[points], line);
    }

    pub fn lines<T: AsRef<[At]>>(&mut self, lines: &[T], line: Line) {
        let d: String = lines.iter().map(|points| path(points.as_ref())).collect();
        let Line { colour, width, dashes } = line;
        let ends = match dashes {
            "" => "stroke-linecap=\"round\"".to_owned(),
            dashes => format!("stroke-dasharray=\"{dashes}\""),
        };
        self.add(&format!(
            "<path d=\"{d}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" {ends}/>"
        ));
    }

    /// Draws polygons of one colour, with outlines unless there is no colour for them. Without outlines, no seams are between neighbours.
    pub fn polygons<T: AsRef<[At]>>(&mut self, polygons: &[T], fill: &str, outline: Option<&str>) {
        if polygons.is_empty() {
            return;
        }
        let d: String = polygons.iter().map(|polygon| path(polygon.as_ref()) + "z").collect();
        let style = match outline {
            Some(colour) => {
                format!("stroke=\"{colour}\" stroke-width=\"0.7\"")
            }
            None => "shape-rendering=\"crispEdges\"".to_owned(),
        };
        self.add(&format!("<path d=\"{d}\" fill=\"{fill}\" {style}/>"));
    }

    pub fn text(&mut self, text: &str, (x, y): At, anchor: Anchor) {
        let (side, turned) = match anchor {
            Anchor::Start => (None, None),
            Anchor::Middle => (Some("middle"), None),
            Anchor::End => (Some("end"), None),
            Anchor::Upwards => {
                (Some("middle"), Some(format!("rotate(-90 {} {})", round(x), round(y))))
            }
        };
        // The middle of a digit is at its baseline.
        let baseline = round(y + SIZE * 0.36);
        let text = html! { text x=(round(x)) y=(baseline) text-anchor=[side] transform=[turned] { (text) } };
        self.add(&text.into_string());
    }
}

/// A coordinate to a tenth of a unit.
fn round(value: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (value * 10.0).round() / 10.0 + 0.0
}

/// Points in the notation of paths.
fn path(points: &[At]) -> String {
    let mut out = String::new();
    for (i, &(x, y)) in points.iter().enumerate() {
        // Writing into a string cannot fail.
        let _ = write!(out, "{}{} {}", if i == 0 { 'M' } else { 'L' }, round(x), round(y));
    }
    out
}
