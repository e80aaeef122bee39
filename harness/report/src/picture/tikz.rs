//! A picture for LaTeX, set in the fonts of the document: an axis of `pgfplots`.

use super::draw::{Layer, layers, outline};
use super::{Picture, plane_name};
use crate::figure::canvas::WIDTH;
use crate::figure::tex::{PREAMBLE, escape};
use std::fmt::Write;

/// Shapes of one path: TeX keeps a whole path in memory.
const SHAPES_PER_PATH: usize = 400;

/// Width of the window in units, of which the line has [`WIDTH`].
const WINDOW: f64 = 1360.0;

/// The picture as a `tikzpicture` as wide as a line. Shapes are below the axis, in a unit of their own: `pgfplots` would take ten times as
/// long for them.
pub fn tikz(picture: &Picture) -> String {
    let [low, high] = picture.window;
    let scale = WINDOW / (high[0] - low[0]);
    let at = |p: [f64; 2]| {
        let [x, y] = [0, 1].map(|i| (p[i].clamp(low[i], high[i]) - low[i]) * scale);
        format!("({},{})", tenth(x), tenth(y))
    };
    let line = f64::from(WIDTH);
    let mut out = format!(
        "% Requires {PREAMBLE}\n% {}\n% {}\n\\begin{{tikzpicture}}[x={unit}\\linewidth, y={unit}\\linewidth, line cap=round]\n",
        picture.title(),
        picture.command,
        unit = 1.0 / line
    );
    for Layer { fill, outline, squares } in layers(picture) {
        // A line of the same colour closes the seams between paths, which viewers show.
        let (edge, width) = outline.map_or((fill, 0.1), |outline| (outline, 0.2));
        for (name, [r, g, b]) in [("cell", fill), ("edge", edge)] {
            // Writing into a string cannot fail, here and below.
            let _ = writeln!(out, "\\definecolor{{{name}}}{{RGB}}{{{r},{g},{b}}}");
        }
        let command = format!("\\filldraw[fill=cell, draw=edge, line width={width}pt]");
        paths(&mut out, &command, &squares, |square| {
            let [from, to] = picture.corners(square).map(at);
            format!("{from} rectangle {to}")
        });
    }
    if let Some(section) = &picture.section {
        let command = "\\draw[black, line width=0.7pt]";
        paths(&mut out, command, section, |[from, to]| format!("{} -- {}", at(*from), at(*to)));
    }
    axis(&mut out, picture, [WINDOW, (high[1] - low[1]) * scale].map(|edge| edge / line));
    out + "\\end{tikzpicture}\n"
}

/// The axis and the legend; `edges` are those of the window in widths of a line.
fn axis(out: &mut String, picture: &Picture, edges: [f64; 2]) {
    let ([low, high], [x, y]) = (picture.window, picture.axes());
    let below = format!("{}; {}", plane_name(&picture.root, picture.slice), picture.count());
    let (entries, title) = picture.colour.legend(&picture.key);
    let _ = writeln!(
        out,
        "\\begin{{axis}}[\n  at={{(0,0)}}, anchor=south west, scale only axis, width={}\\linewidth, height={}\\linewidth, enlargelimits=false,\n  \
         xmin={}, xmax={}, ymin={}, ymax={}, scaled ticks=false, tick align=outside, tick pos=left,\n  \
         xlabel style={{align=center}}, xlabel={{{x}\\\\{}}}, ylabel={{{y}}},\n  \
         legend style={{at={{(0.5,1.03)}},anchor=south,legend columns=6,draw=none,font=\\footnotesize}}\n]\n\
         \\addlegendimage{{empty legend}}\\addlegendentry{{{}}}",
        edges[0],
        edges[1],
        low[0],
        high[0],
        low[1],
        high[1],
        escape(&below),
        escape(&title)
    );
    let rgb = |[r, g, b]: [u8; 3]| format!("{{rgb,255:red,{r};green,{g};blue,{b}}}");
    for (name, fill) in entries {
        let (fill, line, name) = (rgb(fill), rgb(outline(fill)), escape(name));
        let _ = writeln!(
            out,
            "\\addlegendimage{{area legend,fill={fill},draw={line}}}\\addlegendentry{{{name}}}"
        );
    }
    if picture.section.is_some() {
        out.push_str("\\addlegendimage{black,line legend}\\addlegendentry{geometry}\n");
    }
    out.push_str("\\end{axis}\n");
}

/// A coordinate to a tenth of a unit, without the digits that differences add.
fn tenth(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

fn paths<T>(out: &mut String, command: &str, shapes: &[T], shape: impl Fn(&T) -> String) {
    for shapes in shapes.chunks(SHAPES_PER_PATH) {
        let shapes: Vec<String> = shapes.iter().map(&shape).collect();
        let _ = writeln!(out, "{command} {};", shapes.join("\n "));
    }
}
