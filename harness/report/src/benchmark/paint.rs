//! Draws a figure: frame, axes, legend, data.

use super::canvas::{Anchor, Canvas, FAINT, HEIGHT, INK, SIZE, WIDTH, colour, draw, width};
use super::figure::{Axis, Bars, Body, Figure, How, Series, short};
use super::heat;
use super::scale::Scale;

/// Where the data is.
struct Frame {
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
    /// Additional space between the lower edge and the axis's label.
    below: i32,
}

impl Frame {
    fn across(&self, part: f64) -> i32 {
        self.left + (f64::from(self.right - self.left) * part).round() as i32
    }

    fn up(&self, part: f64) -> i32 {
        self.bottom - (f64::from(self.bottom - self.top) * part).round() as i32
    }
}

/// The figure as an SVG document.
pub fn svg(figure: &Figure) -> String {
    draw(|canvas| match &figure.body {
        Body::Points(series) => points(canvas, figure, series),
        Body::Bars(bars) => paint_bars(canvas, figure, bars),
        Body::Heat(heat) => heat::paint(canvas, figure, heat),
    })
}

fn points(canvas: &Canvas, figure: &Figure, series: &[Series]) {
    let entries: Vec<(&str, Mark)> = series
        .iter()
        .map(|s| (s.name.as_str(), Mark::Series { look: s.look, how: s.how, joined: s.joined }))
        .collect();
    let frame = frame(canvas, &entries);
    let all = || series.iter().flat_map(|s| s.points.iter());
    let x = Scale::of(&figure.x, &all().map(|p| p.x).collect::<Vec<_>>());
    let heights: Vec<f64> = all().flat_map(|p| [p.y, p.low, p.high]).collect();
    let y = Scale::of(&figure.y, &heights);
    axes(canvas, &frame, (&figure.x, &x), (&figure.y, &y));
    for s in series {
        paint_series(canvas, &frame, s, &x, &y);
    }
}

fn paint_series(canvas: &Canvas, frame: &Frame, s: &Series, x: &Scale, y: &Scale) {
    let at = |px: f64, py: f64| (frame.across(x.at(px)), frame.up(y.at(py)));
    let line: Vec<(i32, i32)> = s.points.iter().map(|p| at(p.x, p.y)).collect();
    if s.how == How::Bound {
        return canvas.line(&line, INK, 3, Some(14));
    }
    if s.joined && line.len() > 1 {
        canvas.line(&line, colour(s.look), 4, (!s.how.is_solid()).then_some(22));
    }
    for p in &s.points {
        let (low, high) = (at(p.x, p.low), at(p.x, p.high));
        if low.1 - high.1 > 2 {
            canvas.line(&[low, high], colour(s.look), 4, None);
            for end in [low, high] {
                canvas.line(&[(end.0 - 10, end.1), (end.0 + 10, end.1)], colour(s.look), 4, None);
            }
        }
        canvas.marker(at(p.x, p.y), s.look, s.how.is_solid());
    }
}

/// What a legend shows beside a name.
enum Mark {
    Series {
        look: usize,
        how: How,
        joined: bool,
    },
    Bar {
        look: usize,
    },
    /// The how-manieth of the levels to compare with.
    Line(usize),
}

/// Dashes of a level to compare with; those of two levels are told apart.
fn dash(nth: usize) -> i32 {
    [14, 40, 6][nth % 3]
}

/// Space of a mark in the legend.
const MARK: i32 = 80;

/// Draws the legend above the data, as many rows as it takes; what is left for the data.
fn frame(canvas: &Canvas, entries: &[(&str, Mark)]) -> Frame {
    let (left, right) = (190, WIDTH as i32 - 40);
    let (mut x, mut y) = (left, 36);
    for (name, mark) in entries {
        let wide = MARK + width(name) + 40;
        if x > left && x + wide > right {
            (x, y) = (left, y + SIZE + 14);
        }
        legend_mark(canvas, (x, y), mark);
        canvas.text(name, (x + MARK, y), Anchor::Left);
        x += wide;
    }
    Frame { left, right, top: y + 46, bottom: HEIGHT as i32 - 150, below: 0 }
}

fn legend_mark(canvas: &Canvas, (x, y): (i32, i32), mark: &Mark) {
    let (from, to, middle) = ((x, y), (x + MARK - 18, y), (x + (MARK - 18) / 2, y));
    match mark {
        Mark::Line(nth) => canvas.line(&[from, to], INK, 3, Some(dash(*nth))),
        Mark::Series { how: How::Bound, .. } => canvas.line(&[from, to], INK, 3, Some(14)),
        Mark::Series { look, how, joined } => {
            if *joined {
                canvas.line(&[from, to], colour(*look), 4, (!how.is_solid()).then_some(22));
            }
            canvas.marker(middle, *look, how.is_solid());
        }
        Mark::Bar { look } => canvas.bar((x + 12, y - 16), (x + MARK - 22, y + 16), *look),
    }
}

fn axes(canvas: &Canvas, frame: &Frame, x: (&Axis, &Scale), y: (&Axis, &Scale)) {
    for t in &y.1.ticks {
        let at = frame.up(y.1.at(*t));
        canvas.line(&[(frame.left, at), (frame.right, at)], FAINT, 1, None);
        canvas.line(&[(frame.left - 12, at), (frame.left, at)], INK, 2, None);
        canvas.text(&short(*t), (frame.left - 20, at), Anchor::Right);
    }
    for t in &y.1.minor {
        let at = frame.up(y.1.at(*t));
        canvas.line(&[(frame.left - 6, at), (frame.left, at)], INK, 2, None);
    }
    for t in &x.1.ticks {
        let at = frame.across(x.1.at(*t));
        canvas.line(&[(at, frame.top), (at, frame.bottom)], FAINT, 1, None);
        canvas.line(&[(at, frame.bottom), (at, frame.bottom + 12)], INK, 2, None);
        canvas.text(&short(*t), (at, frame.bottom + 22), Anchor::Below);
    }
    for t in &x.1.minor {
        let at = frame.across(x.1.at(*t));
        canvas.line(&[(at, frame.bottom), (at, frame.bottom + 6)], INK, 2, None);
    }
    border(canvas, frame, &x.0.label, &y.0.label);
}

/// Frame and labels.
fn border(canvas: &Canvas, frame: &Frame, x: &str, y: &str) {
    let corners = [
        (frame.left, frame.top),
        (frame.right, frame.top),
        (frame.right, frame.bottom),
        (frame.left, frame.bottom),
        (frame.left, frame.top),
    ];
    canvas.line(&corners, INK, 2, None);
    canvas.text(
        x,
        ((frame.left + frame.right) / 2, frame.bottom + frame.below + 82),
        Anchor::Below,
    );
    canvas.text(y, (62, (frame.top + frame.bottom) / 2), Anchor::Turned);
}

fn paint_bars(canvas: &Canvas, figure: &Figure, bars: &Bars) {
    let named = |(i, part): (usize, &'_ (String, Vec<f64>))| (i, part.0.clone());
    let names: Vec<(usize, String)> = bars.parts.iter().enumerate().map(named).collect();
    let mut entries: Vec<(&str, Mark)> =
        names.iter().map(|(look, name)| (name.as_str(), Mark::Bar { look: *look })).collect();
    entries.extend(bars.lines.iter().enumerate().map(|(i, l)| (l.0.as_str(), Mark::Line(i))));
    let mut frame = frame(canvas, &entries);
    let step = f64::from(frame.right - frame.left) / bars.categories.len().max(1) as f64;
    let labels = labels(&bars.categories, step);
    let below = labels.iter().map(Vec::len).max().unwrap_or(1).saturating_sub(1) as i32 * LINE;
    frame.bottom -= below;
    frame.below = below;
    let total = |i: usize| bars.parts.iter().map(|p| p.1[i]).sum::<f64>();
    let count = bars.categories.len();
    let heights = (0..count).map(total).chain(bars.lines.iter().map(|l| l.1)).collect::<Vec<_>>();
    let y = Scale::of(&figure.y, &heights);
    let names = Scale::of(&figure.x, &[]).bare();
    axes(canvas, &frame, (&figure.x, &names), (&figure.y, &y));
    let gap = if count > 20 { 0.1 } else { 0.2 };
    for i in 0..count {
        let left = f64::from(frame.left) + step * (i as f64 + gap);
        let right = f64::from(frame.left) + step * (i as f64 + 1.0 - gap);
        let mut below = 0.0;
        for (look, (_, values)) in bars.parts.iter().enumerate() {
            let (y0, y1) = (frame.up(y.at(below + values[i])), frame.up(y.at(below)));
            if y1 > y0 {
                canvas.bar((left as i32, y0), (right as i32, y1), look);
            }
            below += values[i];
        }
        let middle = ((left + right) / 2.0) as i32;
        for (line, words) in (0..).zip(&labels[i]) {
            canvas.text(words, (middle, frame.bottom + 22 + LINE * line), Anchor::Below);
        }
    }
    for (i, (_, level)) in bars.lines.iter().enumerate() {
        let at = frame.up(y.at(*level));
        canvas.line(&[(frame.left, at), (frame.right, at)], INK, 3, Some(dash(i)));
    }
}

/// From one line of a bar's name to the next.
const LINE: i32 = SIZE + 4;

/// The lines below every bar. Names too long for their bars are broken at spaces; where that does not suffice, they
/// are left out evenly.
fn labels(names: &[String], step: f64) -> Vec<Vec<String>> {
    let widest = |all: &[Vec<String>]| all.iter().flatten().map(|w| width(w)).max().unwrap_or(0);
    // Between names in one line there is a gap; words of their own lines need hardly any.
    let [gap, narrow] = [16, 4];
    let whole: Vec<Vec<String>> = names.iter().map(|n| vec![n.clone()]).collect();
    let broken: Vec<Vec<String>> =
        names.iter().map(|n| n.split(' ').map(str::to_owned).collect()).collect();
    let mut chosen = if f64::from(widest(&whole) + gap) <= step { whole } else { broken };
    let every = (f64::from(widest(&chosen) + narrow) / step).ceil().max(1.0) as usize;
    chosen.iter_mut().enumerate().filter(|(i, _)| i % every != 0).for_each(|(_, l)| l.clear());
    chosen
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::figure::{Claims, Point};
    use super::*;

    pub(crate) fn figure(body: Body) -> Figure {
        Figure {
            id: "speedup".into(),
            title: "Speedup".into(),
            caption: "Speedup & <more>, n = 6.".into(),
            x: Axis::log("ranks").with_ticks(vec![1.0, 2.0, 4.0]),
            y: Axis::log("speedup"),
            body,
            claims: Claims::default(),
        }
    }

    pub(crate) fn series(how: How) -> Series {
        let points = [1.0, 2.0, 4.0].map(|x| Point {
            low: x * 0.9,
            high: x * 1.1,
            count: 6,
            coverage: 0.97,
            ..Point::bare(x, x)
        });
        Series {
            name: format!("UAV, {}", how.word()),
            how,
            joined: true,
            points: points.to_vec(),
            look: 0,
        }
    }

    #[test]
    fn solid_and_hollow_markers_differ() {
        let solid = svg(&figure(Body::Points(vec![series(How::Measured)])));
        let hollow = svg(&figure(Body::Points(vec![series(How::Projected)])));
        let circles = |svg: &str, kind: &str| {
            svg.lines().filter(|l| l.starts_with("<circle") && l.contains(kind)).count()
        };
        // Three points and the legend.
        assert_eq!((circles(&solid, "fill=\"#"), circles(&solid, "fill=\"none\"")), (4, 0));
        assert_eq!((circles(&hollow, "fill=\"#"), circles(&hollow, "fill=\"none\"")), (0, 4));
        assert!(solid.contains("ranks") && solid.contains("UAV, measured"));
    }

    #[test]
    fn names_are_broken_before_they_are_left_out() {
        let names: Vec<String> = ["metis unit", "morton rehearsal"].map(str::to_owned).to_vec();
        assert_eq!(labels(&names, 500.0), [vec!["metis unit"], vec!["morton rehearsal"]]);
        let broken = [vec!["metis", "unit"], vec!["morton", "rehearsal"]];
        assert_eq!(labels(&names, 228.0), broken);
        assert_eq!(labels(&names, 120.0), [vec!["metis", "unit"], vec![]]);
    }

    #[test]
    fn bars_stand_on_each_other() {
        let bars = Bars {
            categories: vec!["1".into(), "2".into()],
            parts: vec![("read".into(), vec![1.0, 2.0]), ("grade".into(), vec![3.0, 0.0])],
            lines: vec![("mean".into(), 3.0)],
            how: How::Projected,
        };
        let svg = svg(&Figure { y: Axis::linear("s"), ..figure(Body::Bars(bars)) });
        assert!(svg.contains("grade") && svg.contains("mean"));
        let shown =
            |kind: &str| svg.lines().filter(|l| l.starts_with("<rect") && l.contains(kind)).count();
        // An empty part draws nothing: three bars, and two entries of the legend.
        assert_eq!(shown("fill=\"none\""), 5, "{svg}");
    }
}
