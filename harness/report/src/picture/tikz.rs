//! A picture as PGF/TikZ, so that it is set in the fonts of the document. Requires `\usepackage{tikz}`.

use super::Picture;
use super::draw::draw;
use super::sheet::Sheet;
use crate::figure::canvas::{Anchor, INK, WIDTH};
use crate::figure::tex::escape;
use std::fmt::Write;

/// The picture as a `tikzpicture` as wide as a line.
pub fn tikz(picture: &Picture) -> String {
    let mut sheet = Tikz { body: String::new(), colours: Vec::new() };
    draw(picture, &mut sheet);
    let mut text = String::from("% Requires \\usepackage{tikz}\n");
    // Writing into a string cannot fail, here and below.
    let _ = writeln!(text, "% {}\n% {}", picture.title(), picture.command);
    let unit = 1.0 / f64::from(WIDTH);
    let _ = writeln!(
        text,
        "\\begin{{tikzpicture}}[x={unit}\\linewidth, y=-{unit}\\linewidth, line cap=round, font=\\footnotesize]"
    );
    for (i, colour) in sheet.colours.iter().enumerate() {
        let _ = writeln!(text, "\\definecolor{{picture{i}}}{{HTML}}{{{}}}", &colour[1..]);
    }
    text + &sheet.body + "\\end{tikzpicture}\n"
}

/// Shapes of one path: TeX keeps a whole path in memory.
const SHAPES_PER_PATH: usize = 400;

struct Tikz {
    body: String,
    /// The colours, in the notation of SVG.
    colours: Vec<String>,
}

impl Tikz {
    /// The name of a colour.
    fn colour(&mut self, colour: &str) -> String {
        if colour == INK {
            return "black".to_owned();
        }
        let known = self.colours.iter().position(|c| c == colour);
        let index = known.unwrap_or_else(|| {
            self.colours.push(colour.to_owned());
            self.colours.len() - 1
        });
        format!("picture{index}")
    }

    fn path<T>(&mut self, command: &str, shapes: &[T], shape: impl Fn(&T) -> String) {
        for shapes in shapes.chunks(SHAPES_PER_PATH) {
            let shapes: Vec<String> = shapes.iter().map(&shape).collect();
            let _ = writeln!(self.body, "{command} {};", shapes.join("\n "));
        }
    }
}

/// The width of a line on a page 160 mm wide.
fn points(width: f64) -> f64 {
    (width * 455.0 / f64::from(WIDTH) * 100.0).round() / 100.0
}

/// A coordinate to a tenth of a unit, without the digits that differences add.
fn tenth(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

impl Sheet for Tikz {
    fn rectangles(&mut self, rectangles: &[[f64; 4]], fill: &str, outline: Option<&str>) {
        let fill = self.colour(fill);
        // A line of the same colour closes the seams between paths, which viewers show.
        let (draw, width) = outline.map_or((fill.clone(), 0.1), |o| (self.colour(o), 0.2));
        let command = format!("\\filldraw[fill={fill}, draw={draw}, line width={width}pt]");
        self.path(&command, rectangles, |r| {
            let [x, y, width, height] = r.map(tenth);
            format!("({x},{y}) rectangle +({width},{height})")
        });
    }

    fn segments(&mut self, segments: &[[(f64, f64); 2]], colour: &str, width: f64) {
        let command = format!("\\draw[{}, line width={}pt]", self.colour(colour), points(width));
        self.path(&command, segments, |[p, q]| {
            format!("({},{}) -- ({},{})", tenth(p.0), tenth(p.1), tenth(q.0), tenth(q.1))
        });
    }

    fn text(&mut self, text: &str, (x, y): (f64, f64), anchor: Anchor) {
        let place = match anchor {
            Anchor::Start => "anchor=west",
            Anchor::Below => "anchor=north",
            Anchor::End => "anchor=east",
            Anchor::Turned => "rotate=90, anchor=south",
        };
        let text = escape(text);
        let (x, y) = (tenth(x), tenth(y));
        let _ = writeln!(self.body, "\\node[{place}, inner sep=0pt] at ({x},{y}) {{{text}}};");
    }
}
