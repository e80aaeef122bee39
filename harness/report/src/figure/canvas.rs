//! A drawing as SVG. `plotters` draws axes, lines, markers and text; shapes of which there may be thousands are one path for each colour,
//! below what `plotters` draws.

use super::palette::{MARKERS, colour};
use maud::html;
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::fmt::Write;

/// Width of every figure in the units of its coordinates.
pub const WIDTH: u32 = 1600;
/// The typeface, which is in `font/`.
pub const FONT: &str = "DejaVu Sans";
/// Height of the text.
pub const SIZE: f64 = 42.0;

/// Width of a symbol in a legend, with the space beside it.
pub const SYMBOL: f64 = 80.0;
/// Distance of lines of text.
pub const LINE: f64 = SIZE + 8.0;

/// Colour of axes and text: that of the page's text where the drawing is part of a page, else black.
pub const INK: &str = "currentColor";
/// Colour of grid lines.
pub const FAINT: RGBColor = RGBColor(170, 170, 170);

/// Dashes and gaps of a line; `None` for a solid one.
pub type Dashes = Option<(u32, u32)>;
/// Dashes of a theoretical bound, and of the first reference line.
pub const DOTTED: Dashes = Some((14, 10));
/// Dashes of a series that is not measured.
pub const DASHED: Dashes = Some((22, 15));

/// A point on the page.
pub type At = (f64, f64);

/// Why drawing cannot fail.
const DRAWN: &str = "a string accepts every element";

/// Height of the page while it is drawn on; its own is known when all is drawn.
const HEIGHT_MAX: u32 = 1 << 14;

/// A drawing; the origin is the upper left corner.
pub struct Canvas<'a> {
    /// What `plotters` draws on.
    pub area: DrawingArea<SVGBackend<'a>, Shift>,
    /// Shapes as text.
    below: String,
    above: String,
}

/// The document of what `paint` draws, which returns its height; `title` describes it to those who do not see it.
pub fn document(title: &str, paint: impl FnOnce(&mut Canvas) -> u32) -> String {
    let mut lines = String::new();
    let (height, below, above) = {
        let area = SVGBackend::with_string(&mut lines, (WIDTH, HEIGHT_MAX)).into_drawing_area();
        let mut canvas = Canvas { area, below: String::new(), above: String::new() };
        let height = paint(&mut canvas);
        canvas.area.present().expect(DRAWN);
        (height, canvas.below, canvas.above)
    };
    let (_, lines) = lines.split_once('\n').expect("an element begins the document");
    let lines = lines.trim_end().strip_suffix("</svg>").expect("it ends the document");
    let lines = lines.replace("\"#000000\"", &format!("\"{INK}\"")).replace(" opacity=\"1\"", "");
    // A text is on the line of its element.
    let lines = lines.replace("\n</text>", "</text>");
    let end = |line: &str| if line.starts_with("<text") { "" } else { "\n" };
    let lines: String = lines.lines().flat_map(|line| [line, end(line)]).collect();
    let content = maud::PreEscaped(format!("\n{below}{lines}{above}"));
    let document = html! {
        svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label=(title) width=(WIDTH) height=(height)
            viewBox=(format!("0 0 {WIDTH} {height}")) font-family=(FONT) font-size=(SIZE) { (content) }
    };
    document.into_string() + "\n"
}

fn pixel((x, y): At) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

/// The font of all text.
pub fn font() -> TextStyle<'static> {
    // plotters divides the size by this factor in SVG.
    (FONT, SIZE * 1.24).into_font().color(&BLACK)
}

/// Estimated width of a text; exact widths depend on the reader's fonts.
pub fn width(text: &str) -> f64 {
    text.chars().count() as f64 * SIZE * 0.56
}

impl Canvas<'_> {
    /// Draws a line through points.
    pub fn line(&self, points: &[At], colour: RGBColor, width: u32, dashes: Dashes) {
        let style = colour.stroke_width(width);
        let points: Vec<(i32, i32)> = points.iter().copied().map(pixel).collect();
        match dashes {
            None => self.area.draw(&PathElement::new(points, style)),
            Some((dash, gap)) => self.area.draw(&DashedPathElement::new(points, dash, gap, style)),
        }
        .expect(DRAWN);
    }

    /// Draws the frame of a rectangle given by two opposite corners.
    pub fn frame(&self, (x0, y0): At, (x1, y1): At) {
        self.line(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], BLACK, 2, None);
    }

    /// Draws a bar, filled with its colour or with a tint of it: bars with odd styles are lighter, so that neighbours differ in grey too.
    pub fn bar(&self, from: At, to: At, style: usize) {
        let ink = colour(style);
        let fill = ink.mix(if style % 2 == 1 { 0.35 } else { 1.0 }).filled();
        self.area.draw(&Rectangle::new([pixel(from), pixel(to)], fill)).expect(DRAWN);
        let corners = [from, (to.0, from.1), to, (from.0, to.1), from];
        self.line(&corners, ink, 2, None);
    }

    /// Draws the marker of a style, filled or hollow.
    pub fn marker(&self, (x, y): At, style: usize, filled: bool) {
        let corners: &[At] = match style % MARKERS {
            1 => &[(-11.0, -11.0), (11.0, -11.0), (11.0, 11.0), (-11.0, 11.0)],
            2 => &[(0.0, -15.0), (14.0, 11.0), (-14.0, 11.0)],
            3 => &[(0.0, -16.0), (16.0, 0.0), (0.0, 16.0), (-16.0, 0.0)],
            4 => &[(0.0, 15.0), (14.0, -11.0), (-14.0, -11.0)],
            5 => &[(-14.0, -5.0), (0.0, -15.0), (14.0, -5.0), (9.0, 12.0), (-9.0, 12.0)],
            _ => &[],
        };
        let ink = colour(style);
        if corners.is_empty() {
            let shape = if filled { ink.filled() } else { ink.stroke_width(4) };
            return self
                .area
                .draw(&Circle::new(pixel((x, y)), if filled { 14 } else { 12 }, shape))
                .expect(DRAWN);
        }
        let mut points: Vec<At> = corners.iter().map(|c| (x + c.0, y + c.1)).collect();
        if filled {
            let corners: Vec<(i32, i32)> = points.iter().copied().map(pixel).collect();
            self.area.draw(&Polygon::new(corners, ink.filled())).expect(DRAWN);
        }
        // Twice the first edge, so that the corner where the line ends is like the others.
        points.extend_from_within(..2);
        self.line(&points, ink, 4, None);
    }

    /// Draws a legend in as many rows as it needs, the first of which begins at `start` and the others at `left`: beside every name the
    /// symbol of its index, which `symbol` draws at its left end. Returns its lower end.
    pub fn legend(
        &mut self,
        [left, start]: [f64; 2],
        names: &[&str],
        symbol: impl Fn(&mut Self, At, usize),
    ) -> f64 {
        let (mut x, mut y) = (start, 36.0);
        for (i, name) in names.iter().enumerate() {
            let entry = SYMBOL + width(name) + 50.0;
            if x > left && x + entry > f64::from(WIDTH) {
                (x, y) = (left, y + LINE);
            }
            symbol(self, (x, y), i);
            self.text(name, (x + SYMBOL, y));
            x += entry;
        }
        y + 40.0
    }

    /// Draws a text that starts at a point.
    pub fn text(&self, text: &str, at: At) {
        self.write(text, at, Pos::new(HPos::Left, VPos::Center));
    }

    /// Draws a text that is centred below a point.
    pub fn text_below(&self, text: &str, at: At) {
        self.write(text, at, Pos::new(HPos::Center, VPos::Top));
    }

    fn write(&self, text: &str, at: At, pos: Pos) {
        self.area.draw(&Text::new(text, pixel(at), font().pos(pos))).expect(DRAWN);
    }

    // Many shapes of one colour are one path, below all else. Coordinates are rounded to a tenth of a unit.

    fn path(&mut self, path: &str, style: &str) {
        // Writing into a string cannot fail.
        let _ = writeln!(self.below, "<path d=\"{path}\" {style}/>");
    }

    /// Rectangles of one colour without seams between neighbours: corner and size of each.
    pub fn fill(&mut self, rectangles: &[[f64; 4]], colour: &str) {
        self.path(
            &rectangle_path(rectangles),
            &format!("fill=\"{colour}\" shape-rendering=\"crispEdges\""),
        );
    }

    /// Outlined rectangles of one colour.
    pub fn outlined(&mut self, rectangles: &[[f64; 4]], fill: &str, stroke: &str) {
        self.path(
            &rectangle_path(rectangles),
            &format!("fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"0.7\""),
        );
    }

    /// Segments of one colour and width, with round ends.
    pub fn segments(&mut self, segments: &[[At; 2]], colour: &str, width: f64) {
        let path = |[p, q]: &[At; 2]| {
            let [x0, y0, x1, y1] = [p.0, p.1, q.0, q.1].map(round);
            format!("M{x0} {y0}L{x1} {y1}")
        };
        let path: String = segments.iter().map(path).collect();
        self.path(&path, &format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linecap=\"round\""));
    }

    /// A note that is shown while the pointer is near a point.
    pub fn note(&mut self, (x, y): At, note: &str) {
        let circle = html! { circle cx=(round(x)) cy=(round(y)) r="16" fill-opacity="0" { title { (note) } } };
        self.above += &(circle.into_string() + "\n");
    }
}

/// A coordinate to a tenth of a unit.
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
