//! A figure as SVG: frame, axes, legend, data.
//!
//! Axes and legend are our own: plotters drops ticks of logarithmic axes (see `scale`), puts the legend inside the
//! frame in one column, where it hides data, and breaks no labels of bars.

use super::canvas::{Anchor, Canvas, DASHED, DOTTED, FAINT, INK, SIZE, WIDTH, width};
use super::palette::{colour, hex};
use super::scale::Scale;
use super::{Axis, Bars, Body, Figure, Mark, Provenance, Series, heat, tick_label};

/// Usual height of a figure.
pub const HEIGHT: u32 = 1040;

/// The figure as an SVG document.
pub fn svg(figure: &Figure) -> String {
    let mut canvas = Canvas::new(&figure.id);
    match &figure.body {
        Body::Points { series, marks } => points(&mut canvas, figure, series, marks),
        Body::Bars(bars) => draw_bars(&mut canvas, figure, bars),
        Body::HeatMap(map) => heat::draw(&mut canvas, figure, map),
    }
    canvas.document(&figure.title, figure.height)
}

/// The rectangle that contains the data.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    /// Additional space between the lower edge and the label of the axis.
    below: f64,
}

impl Frame {
    fn x(&self, position: f64) -> f64 {
        self.left + (self.right - self.left) * position
    }

    fn y(&self, position: f64) -> f64 {
        self.bottom - (self.bottom - self.top) * position
    }
}

/// The symbol beside a name in the legend.
enum Symbol<'a> {
    Series(&'a Series),
    Mark(usize),
    Bar(usize),
    /// Index of a reference line.
    Reference(usize),
}

fn points(canvas: &mut Canvas, figure: &Figure, series: &[Series], marks: &[Mark]) {
    let mut entries: Vec<(&str, Symbol)> =
        series.iter().map(|s| (s.name.as_str(), Symbol::Series(s))).collect();
    for mark in marks {
        if !entries.iter().any(|(name, _)| *name == mark.name) {
            entries.push((&mark.name, Symbol::Mark(mark.style)));
        }
    }
    let all = || series.iter().flat_map(|s| s.points.iter());
    let x = Scale::of(&figure.x, all().map(|p| p.x));
    let y = Scale::of(&figure.y, all().flat_map(|p| [p.y, p.low, p.high]));
    let widest = y.ticks.iter().map(|tick| width(&tick_label(*tick))).fold(0.0, f64::max);
    let frame = frame(canvas, figure, &entries, LEFT.max(BESIDE_TICKS + widest));
    axes(canvas, &frame, (&figure.x, &x), (&figure.y, &y));
    for mark in marks {
        let at = frame.x(x.position(mark.x));
        let ends = [(at, frame.top), (at, frame.bottom)];
        canvas.line(&ends, &hex(colour(mark.style)), 4.0, None);
    }
    for s in series {
        draw_series(canvas, &frame, s, &x, &y);
    }
}

fn draw_series(canvas: &mut Canvas, frame: &Frame, s: &Series, x: &Scale, y: &Scale) {
    let at = |px: f64, py: f64| (frame.x(x.position(px)), frame.y(y.position(py)));
    let line: Vec<(f64, f64)> = s.points.iter().map(|p| at(p.x, p.y)).collect();
    if s.provenance == Provenance::Bound {
        return canvas.line(&line, INK, 3.0, Some(DOTTED));
    }
    let ink = hex(colour(s.style));
    if s.joined && line.len() > 1 {
        canvas.line(&line, &ink, 4.0, (!s.provenance.is_solid()).then_some(DASHED));
    }
    for (i, p) in s.points.iter().enumerate() {
        let (low, high) = (at(p.x, p.low), at(p.x, p.high));
        if low.1 - high.1 > 2.0 {
            canvas.line(&[low, high], &ink, 4.0, None);
            for end in [low, high] {
                canvas.line(&[(end.0 - 10.0, end.1), (end.0 + 10.0, end.1)], &ink, 4.0, None);
            }
        }
        let note = s.notes.get(i).map(String::as_str);
        canvas.marker(line[i], s.style, s.provenance.is_solid(), note);
    }
}

/// Dashes of a reference line, which differ from those of the next.
fn reference_dashes(index: usize) -> &'static str {
    [DOTTED, "40 20", "6 6"][index % 3]
}

/// Usual left edge of the data.
const LEFT: f64 = 230.0;

/// Space for the label of the vertical axis.
const BESIDE_TICKS: f64 = 130.0;

/// Width of a symbol in the legend.
const SYMBOL: f64 = 80.0;

/// Draws the legend above the data, in as many rows as it needs, and returns the rectangle that is left for the data.
fn frame(canvas: &mut Canvas, figure: &Figure, entries: &[(&str, Symbol)], left: f64) -> Frame {
    let right = f64::from(WIDTH) - 40.0;
    let (mut x, mut y) = (left, 36.0);
    for (name, symbol) in entries {
        let entry = SYMBOL + width(name) + 60.0;
        if x > left && x + entry > right {
            (x, y) = (left, y + SIZE + 14.0);
        }
        draw_symbol(canvas, (x, y), symbol);
        canvas.text(name, (x + SYMBOL, y), Anchor::Start);
        x += entry;
    }
    Frame { left, right, top: y + 46.0, bottom: f64::from(figure.height) - 150.0, below: 0.0 }
}

fn draw_symbol(canvas: &mut Canvas, (x, y): (f64, f64), symbol: &Symbol) {
    let (line, middle) = ([(x, y), (x + SYMBOL - 18.0, y)], (x + (SYMBOL - 18.0) / 2.0, y));
    match symbol {
        Symbol::Reference(index) => canvas.line(&line, INK, 3.0, Some(reference_dashes(*index))),
        Symbol::Series(s) if s.provenance == Provenance::Bound => {
            canvas.line(&line, INK, 3.0, Some(DOTTED));
        }
        Symbol::Series(s) => {
            let solid = s.provenance.is_solid();
            if s.joined {
                canvas.line(&line, &hex(colour(s.style)), 4.0, (!solid).then_some(DASHED));
            }
            canvas.marker(middle, s.style, solid, None);
        }
        Symbol::Mark(style) => {
            let ends = [(middle.0, y - 18.0), (middle.0, y + 18.0)];
            canvas.line(&ends, &hex(colour(*style)), 4.0, None);
        }
        Symbol::Bar(style) => {
            canvas.bar((x + 12.0, y - 16.0), (x + SYMBOL - 22.0, y + 16.0), *style);
        }
    }
}

fn axes(canvas: &mut Canvas, frame: &Frame, x: (&Axis, &Scale), y: (&Axis, &Scale)) {
    for t in &y.1.ticks {
        let at = frame.y(y.1.position(*t));
        canvas.line(&[(frame.left, at), (frame.right, at)], FAINT, 1.0, None);
        canvas.line(&[(frame.left - 12.0, at), (frame.left, at)], INK, 2.0, None);
        canvas.text(&tick_label(*t), (frame.left - 20.0, at), Anchor::End);
    }
    for t in &y.1.minor {
        let at = frame.y(y.1.position(*t));
        canvas.line(&[(frame.left - 6.0, at), (frame.left, at)], INK, 2.0, None);
    }
    for t in &x.1.ticks {
        let at = frame.x(x.1.position(*t));
        canvas.line(&[(at, frame.top), (at, frame.bottom)], FAINT, 1.0, None);
        canvas.line(&[(at, frame.bottom), (at, frame.bottom + 12.0)], INK, 2.0, None);
        canvas.text(&tick_label(*t), (at, frame.bottom + 22.0), Anchor::Below);
    }
    for t in &x.1.minor {
        let at = frame.x(x.1.position(*t));
        canvas.line(&[(at, frame.bottom), (at, frame.bottom + 6.0)], INK, 2.0, None);
    }
    canvas.frame((frame.left, frame.top), (frame.right, frame.bottom));
    let middle = ((frame.left + frame.right) / 2.0, (frame.top + frame.bottom) / 2.0);
    canvas.text(&x.0.label, (middle.0, frame.bottom + frame.below + 82.0), Anchor::Below);
    canvas.text(&y.0.label, (50.0, middle.1), Anchor::Turned);
}

fn draw_bars(canvas: &mut Canvas, figure: &Figure, bars: &Bars) {
    (0..bars.segments.len()).filter(|s| s % 2 == 1).for_each(|s| canvas.define_hatching(s));
    let segments = bars.segments.iter().enumerate();
    let references = bars.references.iter().enumerate();
    let entries: Vec<(&str, Symbol)> = segments
        .map(|(style, s)| (s.0.as_str(), Symbol::Bar(style)))
        .chain(references.map(|(i, r)| (r.0.as_str(), Symbol::Reference(i))))
        .collect();
    let mut frame = frame(canvas, figure, &entries, LEFT);
    let count = bars.categories.len();
    let step = (frame.right - frame.left) / count.max(1) as f64;
    let labels = labels(&bars.categories, step);
    frame.below = labels.iter().map(Vec::len).max().unwrap_or(1).saturating_sub(1) as f64 * LINE;
    frame.bottom -= frame.below;
    let total = |i: usize| bars.segments.iter().map(|s| s.1[i]).sum::<f64>();
    let y = Scale::of(&figure.y, (0..count).map(total).chain(bars.references.iter().map(|r| r.1)));
    let categories = Scale::of(&figure.x, []).without_ticks();
    axes(canvas, &frame, (&figure.x, &categories), (&figure.y, &y));
    let gap = if count > 20 { 0.1 } else { 0.2 };
    for i in 0..count {
        let left = frame.left + step * (i as f64 + gap);
        let right = frame.left + step * (i as f64 + 1.0 - gap);
        let mut sum = 0.0;
        for (style, (_, values)) in bars.segments.iter().enumerate() {
            let (top, bottom) = (frame.y(y.position(sum + values[i])), frame.y(y.position(sum)));
            if bottom > top {
                canvas.bar((left, top), (right, bottom), style);
            }
            sum += values[i];
        }
        for (line, text) in labels[i].iter().enumerate() {
            let at = ((left + right) / 2.0, frame.bottom + 22.0 + LINE * line as f64);
            canvas.text(text, at, Anchor::Below);
        }
    }
    for (i, (_, level)) in bars.references.iter().enumerate() {
        let at = frame.y(y.position(*level));
        canvas.line(&[(frame.left, at), (frame.right, at)], INK, 3.0, Some(reference_dashes(i)));
    }
}

/// Distance of the lines of a label.
const LINE: f64 = SIZE + 4.0;

/// The lines of the label below every bar. Labels too long for their bars are broken at spaces; where that does not
/// suffice, only every second, third ... bar has one.
fn labels(names: &[String], step: f64) -> Vec<Vec<String>> {
    let widest = |all: &[Vec<String>]| all.iter().flatten().map(|w| width(w)).fold(0.0, f64::max);
    let (gap, gap_broken) = (16.0, 4.0);
    let whole: Vec<Vec<String>> = names.iter().map(|n| vec![n.clone()]).collect();
    let broken: Vec<Vec<String>> =
        names.iter().map(|n| n.split(' ').map(str::to_owned).collect()).collect();
    let mut chosen = if widest(&whole) + gap <= step { whole } else { broken };
    let every = ((widest(&chosen) + gap_broken) / step).ceil().max(1.0) as usize;
    chosen.iter_mut().enumerate().filter(|(i, _)| i % every != 0).for_each(|(_, l)| l.clear());
    chosen
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::*;

    #[test]
    fn measured_points_are_filled_and_projected_ones_hollow() {
        let circles = |provenance, kind: &str| {
            let svg = svg(&figure(Body::points(vec![series(provenance)])));
            svg.lines().filter(|l| l.starts_with("<circle") && l.contains(kind)).count()
        };
        // Three points and the legend.
        let counts =
            |provenance| (circles(provenance, "fill=\"#"), circles(provenance, "fill=\"none\""));
        assert_eq!(counts(Provenance::Measured), (4, 0));
        assert_eq!(counts(Provenance::Projected), (0, 4));
    }

    #[test]
    fn text_is_escaped_and_points_have_their_notes() {
        let mut noted = series(Provenance::Measured);
        noted.name = "a < b".into();
        noted.notes = vec!["first & <best>".into()];
        let svg = svg(&figure(Body::points(vec![noted])));
        assert!(
            svg.contains("a &lt; b") && svg.contains("<title>first &amp; &lt;best&gt;</title>")
        );
        assert!(
            svg.contains("viewBox=\"0 0 1600 1040\"") && svg.contains("aria-label=\"Speedup\"")
        );
    }

    #[test]
    fn marks_of_one_name_share_an_entry_of_the_legend() {
        let mark = |x| Mark { name: "increase".into(), x, style: 1 };
        let body = Body::Points {
            series: vec![series(Provenance::Measured)],
            marks: vec![mark(1.5), mark(3.0)],
        };
        let svg = svg(&figure(body));
        assert_eq!(svg.matches("increase").count(), 1);
        assert_eq!(svg.matches("stroke=\"#D55E00\"").count(), 3);
    }

    #[test]
    fn labels_are_wrapped_before_they_are_omitted() {
        let names: Vec<String> = ["metis unit", "morton area"].map(str::to_owned).to_vec();
        assert_eq!(labels(&names, 500.0), [vec!["metis unit"], vec!["morton area"]]);
        let broken = [vec!["metis", "unit"], vec!["morton", "area"]];
        assert_eq!(labels(&names, 228.0), broken);
        assert_eq!(labels(&names, 120.0), [vec!["metis", "unit"], vec![]]);
    }

    #[test]
    fn segments_are_stacked_and_empty_ones_are_not_drawn() {
        let bars = Bars {
            categories: vec!["1".into(), "2".into()],
            segments: vec![("read".into(), vec![1.0, 2.0]), ("grade".into(), vec![3.0, 0.0])],
            references: vec![("mean".into(), 3.0)],
            provenance: Provenance::Projected,
        };
        let svg = svg(&Figure { y: Axis::linear("s"), ..figure(Body::Bars(bars)) });
        assert!(svg.contains(">grade<") && svg.contains(">mean<"));
        // Three segments, two entries of the legend, and the rectangle of the hatching.
        assert_eq!(svg.matches("<rect").count(), 6, "{svg}");
    }
}
