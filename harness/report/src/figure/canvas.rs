//! Lines, markers and text as elements of an SVG document.

use super::palette::{MARKERS, colour, hex};
use maud::{Markup, html};

/// Width of every figure in the units of its coordinates.
pub const WIDTH: u32 = 1600;
/// The typeface, which is in `font/`.
pub const FONT: &str = "DejaVu Sans";
/// Height of the text.
pub const SIZE: f64 = 42.0;

/// Colour of axes and text: that of the page's text where the drawing is part of a page, else black.
pub const INK: &str = "currentColor";
/// Colour of grid lines.
pub const FAINT: &str = "#AAAAAA";
/// Dashes of a theoretical bound, and of the first reference line.
pub const DOTTED: &str = "14 10";
/// Dashes of a series that is not measured.
pub const DASHED: &str = "22 15";

/// Position of a text relative to its point.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// The text starts at the point.
    Start,
    /// The text is centred below the point.
    Below,
    /// The text ends at the point.
    End,
    /// The text is turned upwards and centred above the point.
    Turned,
}

/// An SVG document under construction; each element is on a line of its own. The origin is the upper left corner.
pub struct Canvas {
    /// Identifier of the figure: on one page, identifiers of patterns must differ.
    id: String,
    elements: String,
}

impl Canvas {
    /// An empty canvas.
    pub fn new(id: &str) -> Self {
        Self { id: id.to_owned(), elements: String::new() }
    }

    /// The document with the given height; `title` describes it to those who do not see it.
    pub fn document(self, title: &str, height: u32) -> String {
        let content = maud::PreEscaped(format!("\n{}", self.elements));
        let document = html! {
            svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label=(title) width=(WIDTH) height=(height)
                viewBox=(format!("0 0 {WIDTH} {height}")) font-family=(FONT) font-size=(SIZE) { (content) }
        };
        document.into_string() + "\n"
    }

    fn put(&mut self, element: Markup) {
        self.elements.push_str(&element.0);
        self.elements.push('\n');
    }

    /// A line through points, solid or with dashes.
    pub fn line(&mut self, points: &[(f64, f64)], colour: &str, width: f64, dashes: Option<&str>) {
        self.put(html! {
            polyline points=(coordinates(points)) fill="none" stroke=(colour) stroke-width=(width)
                stroke-dasharray=[dashes] {}
        });
    }

    /// The frame of a rectangle given by two opposite corners.
    pub fn frame(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) {
        self.line(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], INK, 2.0, None);
    }

    /// The marker of a style, filled or hollow, with a note that is shown under the pointer.
    pub fn marker(&mut self, (x, y): (f64, f64), style: usize, filled: bool, note: Option<&str>) {
        let corners: &[(f64, f64)] = match style % MARKERS {
            1 => &[(-11.0, -11.0), (11.0, -11.0), (11.0, 11.0), (-11.0, 11.0)],
            2 => &[(0.0, -15.0), (14.0, 11.0), (-14.0, 11.0)],
            3 => &[(0.0, -16.0), (16.0, 0.0), (0.0, 16.0), (-16.0, 0.0)],
            4 => &[(0.0, 15.0), (14.0, -11.0), (-14.0, -11.0)],
            5 => &[(-14.0, -5.0), (0.0, -15.0), (14.0, -5.0), (9.0, 12.0), (-9.0, 12.0)],
            _ => &[],
        };
        let ink = hex(colour(style));
        let fill = if filled { ink.as_str() } else { "none" };
        let title = html! { @if let Some(note) = note { title { (note) } } };
        if corners.is_empty() {
            return self.put(html! {
                circle cx=(round(x)) cy=(round(y)) r="12" fill=(fill) stroke=(ink) stroke-width="4" { (title) }
            });
        }
        let points: Vec<(f64, f64)> = corners.iter().map(|p| (x + p.0, y + p.1)).collect();
        self.put(html! {
            polygon points=(coordinates(&points)) fill=(fill) stroke=(ink) stroke-width="4" { (title) }
        });
    }

    /// Defines the hatching of bars of a style. Bars with odd styles are hatched so that neighbours differ in grey
    /// too.
    pub fn define_hatching(&mut self, style: usize) {
        let ink = hex(colour(style));
        self.put(html! {
            pattern id=(self.hatching(style)) width="18" height="18" patternUnits="userSpaceOnUse" {
                rect width="18" height="18" fill=(ink) fill-opacity="0.35" {}
                path d="M-4 4L4 -4M0 18L18 0M14 22L22 14" stroke=(ink) stroke-width="3" {}
            }
        });
    }

    fn hatching(&self, style: usize) -> String {
        format!("{}-hatching-{style}", self.id)
    }

    /// A bar of a style, given by its upper left and lower right corner.
    pub fn bar(&mut self, from: (f64, f64), to: (f64, f64), style: usize) {
        let ink = hex(colour(style));
        let fill =
            if style % 2 == 1 { format!("url(#{})", self.hatching(style)) } else { ink.clone() };
        self.put(html! {
            rect x=(round(from.0)) y=(round(from.1)) width=(round(to.0 - from.0)) height=(round(to.1 - from.1))
                fill=(fill) stroke=(ink) stroke-width="2" {}
        });
    }

    /// Rectangles of one colour as one element: lower corner and size of each.
    pub fn fill(&mut self, rectangles: &[[f64; 4]], colour: &str) {
        let path = rectangle_path(rectangles);
        // Without smoothing, neighbours have no seam between them.
        self.put(html! { path d=(path) fill=(colour) shape-rendering="crispEdges" {} });
    }

    /// Outlined rectangles of one colour as one element: lower corner and size of each.
    pub fn outlined(&mut self, rectangles: &[[f64; 4]], fill: &str, stroke: &str) {
        let path = rectangle_path(rectangles);
        self.put(html! { path d=(path) fill=(fill) stroke=(stroke) stroke-width="0.7" {} });
    }

    /// Segments as one element, with round ends.
    pub fn segments(&mut self, segments: &[[(f64, f64); 2]], colour: &str, width: f64) {
        let path = |[p, q]: &[(f64, f64); 2]| {
            let [x0, y0, x1, y1] = [p.0, p.1, q.0, q.1].map(round);
            format!("M{x0} {y0}L{x1} {y1}")
        };
        let path: String = segments.iter().map(path).collect();
        self.put(html! {
            path d=(path) fill="none" stroke=(colour) stroke-width=(width) stroke-linecap="round" {}
        });
    }

    /// Outlined polygons as one element.
    pub fn polygons(&mut self, polygons: &[Vec<(f64, f64)>], fill: &str, stroke: &str) {
        let path = |polygon: &Vec<(f64, f64)>| format!("M{}z", coordinates(polygon));
        let path: String = polygons.iter().map(path).collect();
        self.put(html! { path d=(path) fill=(fill) stroke=(stroke) stroke-width="1.5" {} });
    }

    /// A text.
    pub fn text(&mut self, text: &str, (x, y): (f64, f64), anchor: Anchor) {
        let (x, y) = (round(x), round(y));
        let (align, shift) = match anchor {
            Anchor::Start => ("start", "0.36em"),
            Anchor::Below => ("middle", "0.76em"),
            Anchor::End => ("end", "0.36em"),
            Anchor::Turned => ("middle", "0"),
        };
        let turn = matches!(anchor, Anchor::Turned).then(|| format!("rotate(-90 {x} {y})"));
        self.put(html! {
            text x=(x) y=(y) dy=(shift) text-anchor=(align) fill=(INK) transform=[turn] { (text) }
        });
    }
}

/// Coordinates to a tenth of a unit.
fn round(value: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (value * 10.0).round() / 10.0 + 0.0
}

fn rectangle_path(rectangles: &[[f64; 4]]) -> String {
    let path = |rectangle: &[f64; 4]| {
        let [x, y, width, height] = rectangle.map(round);
        format!("M{x} {y}h{width}v{height}h-{width}z")
    };
    rectangles.iter().map(path).collect()
}

fn coordinates(points: &[(f64, f64)]) -> String {
    let pairs: Vec<String> =
        points.iter().map(|p| format!("{},{}", round(p.0), round(p.1))).collect();
    pairs.join(" ")
}

/// Estimated width of a text; exact widths depend on the reader's fonts.
pub fn width(text: &str) -> f64 {
    text.chars().count() as f64 * SIZE * 0.5
}
