//! A figure as SVG: legend, axes, data. The legend is above the data in as many rows as it needs, so that it hides none.

use super::axes::{BELOW, ToPage, axes, left, range};
use super::canvas::{At, Canvas, INK, Line, SYMBOL, WIDTH, colour, document};
use super::{Figure, Mark, Provenance, Series};

/// Length of a line in the legend.
const LENGTH: f64 = SYMBOL - 18.0;
/// Space at the right of the data.
const RIGHT: f64 = 40.0;
/// Width of lines of data.
const WIDE: f64 = 4.0;

/// The figure as an SVG document.
pub fn svg(figure: &Figure) -> String {
    document(&figure.title, |canvas| {
        draw(canvas, figure);
        f64::from(figure.height)
    })
}

fn draw(canvas: &mut Canvas, figure: &Figure) {
    let Figure { x, y, series, .. } = figure;
    let mut marks: Vec<&Mark> = Vec::new();
    for mark in &figure.marks {
        if !marks.iter().any(|other| other.name == mark.name) {
            marks.push(mark);
        }
    }
    let all = || series.iter().flat_map(|s| s.points.iter());
    let ends = [range(x, all().map(|p| p.x)), range(y, all().flat_map(|p| [p.y, p.low, p.high]))];
    let left = left(y, &ends[1]);
    let names = series.iter().map(|s| &*s.name).chain(marks.iter().map(|m| &*m.name));
    let names: Vec<&str> = names.collect();
    let top = canvas.legend([left; 2], &names, |canvas, (x, y), i| {
        let middle = x + LENGTH / 2.0;
        match series.get(i) {
            Some(s) => {
                draw_line(canvas, s, &[(x, y), (x + LENGTH, y)]);
                draw_marker(canvas, s, (middle, y));
            }
            None => draw_mark(
                canvas,
                marks[i - series.len()],
                [y - 18.0, y + 18.0].map(|y| (middle, y)),
            ),
        }
    });
    let frame = ((left, top), (WIDTH - RIGHT, f64::from(figure.height) - BELOW));
    let to_page = axes(canvas, [x, y], ends.clone(), frame, true);
    for mark in &figure.marks {
        draw_mark(canvas, mark, [ends[1].start, ends[1].end].map(|y| to_page(mark.x, y)));
    }
    series.iter().for_each(|s| draw_series(canvas, s, &to_page));
}

fn draw_mark(canvas: &mut Canvas, mark: &Mark, ends: [At; 2]) {
    canvas.line(&ends, Line { colour: &colour(mark.style), width: WIDE, dashes: "" });
}

fn draw_line(canvas: &mut Canvas, s: &Series, points: &[At]) {
    let colour = colour(s.style);
    let line = match s.provenance {
        Provenance::Bound => Line { colour: INK, width: 3.0, dashes: "14 10" },
        Provenance::Measured => Line { colour: &colour, width: WIDE, dashes: "" },
        _ => Line { colour: &colour, width: WIDE, dashes: "22 15" },
    };
    if s.joined {
        canvas.line(points, line);
    }
}

fn draw_marker(canvas: &mut Canvas, s: &Series, at: At) {
    if s.provenance != Provenance::Bound {
        canvas.marker(at, s.style, s.provenance == Provenance::Measured);
    }
}

fn draw_series(canvas: &mut Canvas, s: &Series, to_page: &ToPage) {
    let at: Vec<At> = s.points.iter().map(|p| to_page(p.x, p.y)).collect();
    if at.len() > 1 {
        draw_line(canvas, s, &at);
    }
    let line = Line { colour: &colour(s.style), width: WIDE, dashes: "" };
    for (i, p) in s.points.iter().enumerate() {
        let [low, high] = [p.low, p.high].map(|y| to_page(p.x, y));
        if low.1 - high.1 > 2.0 {
            canvas.line(&[low, high], line);
            for (x, y) in [low, high] {
                canvas.line(&[(x - 10.0, y), (x + 10.0, y)], line);
            }
        }
        draw_marker(canvas, s, at[i]);
        if let Some(note) = s.notes.get(i) {
            canvas.note(at[i], note);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::*;

    #[test]
    fn measured_points_are_filled_and_projected_ones_hollow() {
        let circles = |provenance, kind: &str| {
            let svg = svg(&figure(vec![series(provenance)]));
            svg.lines().filter(|l| l.starts_with("<circle") && l.contains(kind)).count()
        };
        // Three points and the legend.
        let counts =
            |provenance| (circles(provenance, "fill=\"#"), circles(provenance, "fill=\"none\""));
        assert_eq!(counts(Provenance::Measured), (4, 0));
        assert_eq!(counts(Provenance::Projected), (0, 4));
        assert_eq!(counts(Provenance::Bound), (0, 0));
    }

    #[test]
    fn text_is_escaped_and_points_have_their_notes() {
        let mut noted = series(Provenance::Measured);
        noted.name = "a < b".into();
        noted.notes = vec!["first & <best>".into()];
        let svg = svg(&figure(vec![noted]));
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
        let shown = figure(vec![series(Provenance::Measured)]);
        let svg = svg(&Figure { marks: vec![mark(1.5), mark(3.0)], ..shown });
        assert_eq!(svg.matches("increase").count(), 1);
        assert_eq!(svg.matches("stroke=\"#D55E00\"").count(), 3);
    }
}
