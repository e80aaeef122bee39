//! A figure as SVG: frame, axes, legend, data.
//!
//! The legend is above the data in as many columns as fit, because that of `plotters` is within the frame, where it hides data.

use super::axes::{BELOW, ToPage, axes, left};
use super::canvas::*;
use super::palette::colour;
use super::scale::range;
use super::{Axis, Bars, Body, Figure, Mark, Provenance, Series};
use plotters::style::colors::BLACK;

/// The figure as an SVG document.
pub fn svg(figure: &Figure) -> String {
    document(&figure.title, |canvas| {
        match &figure.body {
            Body::Points { series, marks } => points(canvas, figure, series, marks),
            Body::Bars(bars) => draw_bars(canvas, figure, bars),
        }
        figure.height
    })
}

/// A name in the legend, and what draws the symbol beside it at its left end.
type Entry<'a> = (&'a str, Box<dyn Fn(&Canvas, At) + 'a>);

/// Length of a line in the legend.
const LENGTH: f64 = SYMBOL - 18.0;
/// Up to this number of bars, each has a label.
const STAGGERED_MAX: usize = 12;
/// Space at the right of the data.
const RIGHT: f64 = 40.0;

/// Draws the legend, and returns its lower end.
fn legend(canvas: &mut Canvas, left: f64, entries: &[Entry]) -> f64 {
    let names: Vec<&str> = entries.iter().map(|entry| entry.0).collect();
    canvas.legend([left; 2], &names, |canvas, at, i| entries[i].1(canvas, at))
}

fn of_series(s: &Series) -> Entry<'_> {
    let symbol = |canvas: &Canvas, (x, y): At| {
        let (ends, solid) = ([(x, y), (x + LENGTH, y)], s.provenance.is_solid());
        if s.provenance == Provenance::Bound {
            return canvas.line(&ends, BLACK, 3, DOTTED);
        }
        if s.joined {
            canvas.line(&ends, colour(s.style), 4, if solid { None } else { DASHED });
        }
        canvas.marker((x + LENGTH / 2.0, y), s.style, solid);
    };
    (&s.name, Box::new(symbol))
}

fn of_mark(mark: &Mark) -> Entry<'_> {
    let symbol = |canvas: &Canvas, (x, y): At| {
        let ends = [y - 18.0, y + 18.0].map(|y| (x + LENGTH / 2.0, y));
        canvas.line(&ends, colour(mark.style), 4, None);
    };
    (&mark.name, Box::new(symbol))
}

/// Dashes of a reference line, which differ from those of the next.
fn reference_dashes(index: usize) -> Dashes {
    [DOTTED, Some((40, 20)), Some((6, 6))][index % 3]
}

fn points(canvas: &mut Canvas, figure: &Figure, series: &[Series], marks: &[Mark]) {
    let mut entries: Vec<Entry> = series.iter().map(of_series).collect();
    for mark in marks {
        if !entries.iter().any(|(name, _)| *name == mark.name) {
            entries.push(of_mark(mark));
        }
    }
    let all = || series.iter().flat_map(|s| s.points.iter());
    let x = range(&figure.x, all().map(|p| p.x));
    let y = range(&figure.y, all().flat_map(|p| [p.y, p.low, p.high]));
    let left = left(&figure.y, &y);
    let (top, bottom) = (legend(canvas, left, &entries), f64::from(figure.height) - BELOW);
    let to_page = axes(
        canvas,
        [&figure.x, &figure.y],
        [x, y.clone()],
        ((left, top), (f64::from(WIDTH) - RIGHT, bottom)),
        true,
    );
    for mark in marks {
        let ends = [y.start, y.end].map(|y| to_page(mark.x, y));
        canvas.line(&ends, colour(mark.style), 4, None);
    }
    series.iter().for_each(|s| draw_series(canvas, s, &to_page));
}

fn draw_series(canvas: &mut Canvas, s: &Series, to_page: &ToPage) {
    let at: Vec<At> = s.points.iter().map(|p| to_page(p.x, p.y)).collect();
    if s.provenance == Provenance::Bound {
        return canvas.line(&at, BLACK, 3, DOTTED);
    }
    let (ink, solid) = (colour(s.style), s.provenance.is_solid());
    if s.joined && at.len() > 1 {
        canvas.line(&at, ink, 4, if solid { None } else { DASHED });
    }
    for (i, p) in s.points.iter().enumerate() {
        let [low, high] = [p.low, p.high].map(|y| to_page(p.x, y));
        if low.1 - high.1 > 2.0 {
            canvas.line(&[low, high], ink, 4, None);
            for end in [low, high] {
                canvas.line(&[(end.0 - 10.0, end.1), (end.0 + 10.0, end.1)], ink, 4, None);
            }
        }
        canvas.marker(at[i], s.style, solid);
        if let Some(note) = s.notes.get(i) {
            canvas.note(at[i], note);
        }
    }
}

fn draw_bars(canvas: &mut Canvas, figure: &Figure, bars: &Bars) {
    let mut entries: Vec<Entry> = Vec::new();
    for (style, (name, _)) in bars.segments.iter().enumerate() {
        let bar = move |canvas: &Canvas, (x, y): At| {
            canvas.bar((x + 12.0, y - 16.0), (x + SYMBOL - 22.0, y + 16.0), style)
        };
        entries.push((name, Box::new(bar)));
    }
    for (i, (name, _)) in bars.references.iter().enumerate() {
        let line = move |canvas: &Canvas, (x, y): At| {
            canvas.line(&[(x, y), (x + LENGTH, y)], BLACK, 3, reference_dashes(i))
        };
        entries.push((name, Box::new(line)));
    }
    let total = |i: usize| bars.segments.iter().map(|s| s.1[i]).sum::<f64>();
    let (count, right) = (bars.categories.len(), f64::from(WIDTH) - RIGHT);
    let y = range(&figure.y, (0..count).map(total).chain(bars.references.iter().map(|r| r.1)));
    let left = left(&figure.y, &y);
    let top = legend(canvas, left, &entries);
    let labels = labels(&bars.categories, (right - left) / count.max(1) as f64);
    let lines = labels.iter().map(Vec::len).max().unwrap_or(1).saturating_sub(1) as f64;
    let bottom = f64::from(figure.height) - BELOW - lines * LINE;
    // The names of the bars are below the axis in place of ticks, and its label is below them.
    let unnamed = Axis { label: " ".to_owned(), ticks: vec![f64::NAN], ..Axis::linear("") };
    let ends = [0.0..count.max(1) as f64, y.clone()];
    let to_page = axes(canvas, [&unnamed, &figure.y], ends, ((left, top), (right, bottom)), true);
    let gap = if count > 20 { 0.1 } else { 0.2 };
    for (i, names) in labels.iter().enumerate() {
        let (begin, end, mut sum) = (i as f64 + gap, (i + 1) as f64 - gap, 0.0);
        for (style, (_, values)) in bars.segments.iter().enumerate() {
            if values[i] > 0.0 {
                canvas.bar(to_page(begin, sum + values[i]), to_page(end, sum), style);
            }
            sum += values[i];
        }
        let (x, _) = to_page(i as f64 + 0.5, 0.0);
        for (line, name) in names.iter().enumerate() {
            canvas.text_below(name, (x, bottom + 22.0 + LINE * line as f64));
        }
    }
    for (i, (_, level)) in bars.references.iter().enumerate() {
        let ends = [0.0, count as f64].map(|x| to_page(x, *level));
        canvas.line(&ends, BLACK, 3, reference_dashes(i));
    }
    let below = (left.midpoint(right), bottom + 82.0 + lines * LINE);
    canvas.text_below(&figure.x.label, below);
}

/// The lines of the label below every bar. Labels too long for their bars are broken at spaces; where that does not suffice, those of
/// neighbouring bars are on different lines. Only every second, third ... of many bars has one.
fn labels(names: &[String], step: f64) -> Vec<Vec<String>> {
    let widest = |all: &[Vec<String>]| all.iter().flatten().map(|w| width(w)).fold(0.0, f64::max);
    let whole: Vec<Vec<String>> = names.iter().map(|n| vec![n.clone()]).collect();
    let broken: Vec<Vec<String>> =
        names.iter().map(|n| n.split(' ').map(str::to_owned).collect()).collect();
    let mut chosen = if widest(&whole) + 16.0 <= step { whole } else { broken };
    let every = ((widest(&chosen) + 4.0) / step).ceil().max(1.0) as usize;
    let lines = chosen.iter().map(Vec::len).max().unwrap_or(0);
    for (i, label) in chosen.iter_mut().enumerate() {
        match names.len() <= STAGGERED_MAX {
            true => drop(label.splice(0..0, vec![String::new(); i % every * lines])),
            false if i % every != 0 => label.clear(),
            false => {}
        }
    }
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
        assert_eq!(labels(&names, 120.0), [vec!["metis", "unit"], vec!["", "", "morton", "area"]]);
        let ranks: Vec<String> = (100..164).map(|rank| rank.to_string()).collect();
        assert_eq!(labels(&ranks, 30.0)[..2], [vec!["100"], vec![]]);
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
        // Three segments and two entries of the legend.
        assert_eq!(svg.matches("<rect").count(), 5, "{svg}");
    }
}
