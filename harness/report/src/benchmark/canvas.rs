//! Lines, markers and words as SVG, through plotters' SVG backend.
//!
//! Coordinates are pixels of a canvas large enough that rounding to whole ones is not seen.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of every figure.
pub const WIDTH: u32 = 1600;
/// Height of every figure.
pub const HEIGHT: u32 = 1040;
/// The typeface, shipped in `font/`.
pub const FONT: &str = "DejaVu Sans";
/// Size of letters.
pub const SIZE: i32 = 42;

/// Colours that are told apart with every kind of colour vision (Okabe and Ito), the first ones also in grey.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
];

/// The colour of a look.
pub fn colour(look: usize) -> RGBColor {
    PALETTE[look % PALETTE.len()]
}

/// Ink: the page turns it into the colour of its text.
pub const INK: RGBColor = BLACK;
/// Lines behind the data.
pub const FAINT: RGBColor = RGBColor(170, 170, 170);

/// Where a word stands relative to its point.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// The point is left of it.
    Left,
    /// It is centred below the point.
    Below,
    /// The point is right of it.
    Right,
    /// It is turned upwards, centred.
    Turned,
}

/// A figure being drawn.
pub struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

/// Draws on a new canvas; the SVG document.
pub fn draw(paint: impl FnOnce(&Canvas)) -> String {
    let mut svg = String::new();
    let canvas =
        Canvas { area: SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)).into_drawing_area() };
    paint(&canvas);
    canvas.area.present().expect("a string can always be written");
    drop(canvas);
    svg
}

impl Canvas<'_> {
    /// A line through points; dashed with dashes of a length, or whole.
    pub fn line(&self, points: &[(i32, i32)], colour: RGBColor, width: u32, dash: Option<i32>) {
        let style = colour.stroke_width(width);
        match dash {
            None => self.put(PathElement::new(points.to_vec(), style)),
            Some(length) => {
                points.windows(2).for_each(|w| self.dashes(w[0], w[1], style, f64::from(length)));
            }
        }
    }

    fn dashes(&self, from: (i32, i32), to: (i32, i32), style: ShapeStyle, length: f64) {
        let (dx, dy) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
        let whole = dx.hypot(dy).max(1.0);
        let at = |d: f64| {
            let part = (d / whole).min(1.0);
            (from.0 + (dx * part).round() as i32, from.1 + (dy * part).round() as i32)
        };
        for i in 0..(whole / length / 1.7).ceil() as usize {
            let start = i as f64 * length * 1.7;
            self.put(PathElement::new(vec![at(start), at(start + length)], style));
        }
    }

    /// A look's marker, solid or hollow.
    pub fn marker(&self, (x, y): (i32, i32), look: usize, solid: bool) {
        let r = 13;
        let corners: &[(i32, i32)] = match look % 6 {
            1 => &[(-11, -11), (11, -11), (11, 11), (-11, 11)],
            2 => &[(0, -15), (14, 11), (-14, 11)],
            3 => &[(0, -16), (16, 0), (0, 16), (-16, 0)],
            4 => &[(0, 15), (14, -11), (-14, -11)],
            5 => &[(-14, -5), (0, -15), (14, -5), (9, 12), (-9, 12)],
            _ => &[],
        };
        let c = colour(look);
        if corners.is_empty() {
            let style = if solid { c.filled() } else { c.stroke_width(5) };
            return self.put(Circle::new((x, y), r, style));
        }
        let mut points: Vec<(i32, i32)> = corners.iter().map(|p| (x + p.0, y + p.1)).collect();
        if solid {
            return self.put(Polygon::new(points, c.filled()));
        }
        points.push(points[0]);
        points.push(points[1]);
        self.put(PathElement::new(points, c.stroke_width(5)));
    }

    /// A filled rectangle; every second look is hatched, so that neighbours differ in grey, too.
    pub fn bar(&self, (x0, y0): (i32, i32), (x1, y1): (i32, i32), look: usize) {
        let c = colour(look);
        self.put(Rectangle::new(
            [(x0, y0), (x1, y1)],
            c.mix(if look % 2 == 1 { 0.35 } else { 1.0 }).filled(),
        ));
        if look % 2 == 1 {
            self.hatch((x0, y0), (x1, y1), c);
        }
        self.put(Rectangle::new([(x0, y0), (x1, y1)], c.stroke_width(2)));
    }

    /// A filled rectangle without an edge.
    pub fn fill(&self, from: (i32, i32), to: (i32, i32), colour: RGBColor) {
        self.put(Rectangle::new([from, to], colour.filled()));
    }

    /// Diagonals within a rectangle.
    fn hatch(&self, (x0, y0): (i32, i32), (x1, y1): (i32, i32), c: RGBColor) {
        let mut d = 0;
        while d < (x1 - x0) + (y1 - y0) {
            // The line x + y = x0 + y0 + d, cut off at the sides.
            let a = (x0 + (d - (y1 - y0)).max(0), y0 + d.min(y1 - y0));
            let b = (x0 + d.min(x1 - x0), y0 + (d - (x1 - x0)).max(0));
            self.put(PathElement::new(vec![a, b], c.stroke_width(3)));
            d += 18;
        }
    }

    /// Words.
    pub fn text(&self, words: &str, at: (i32, i32), anchor: Anchor) {
        let (h, v) = match anchor {
            Anchor::Left => (HPos::Left, VPos::Center),
            Anchor::Below => (HPos::Center, VPos::Top),
            Anchor::Right => (HPos::Right, VPos::Center),
            Anchor::Turned => (HPos::Center, VPos::Bottom),
        };
        let style = (FONT, SIZE).into_text_style(&self.area).color(&INK).pos(Pos::new(h, v));
        let style = match anchor {
            Anchor::Turned => style.transform(FontTransform::Rotate270),
            _ => style,
        };
        self.put(Text::new(words.to_owned(), at, style));
    }

    fn put<E>(&self, element: E)
    where
        E: for<'b> Drawable<SVGBackend<'b>>,
        for<'b> &'b E: PointCollection<'b, (i32, i32)>,
    {
        self.area.draw(&element).expect("a string can always be written");
    }
}

/// About how wide words are, for legends.
pub fn width(words: &str) -> i32 {
    (words.chars().count() as f64 * f64::from(SIZE) * 0.50) as i32
}
