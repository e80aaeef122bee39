//! The model of a figure: axes, series of points, of lines and of stacked bars, or cells of a map. SVG ([`svg`], by `plotters`) is drawn from it, PNG and PDF from the SVG
//! ([`format`](mod@format)), and for LaTeX the values as CSV and an axis of `pgfplots` that reads them ([`latex`]).
//!
//! Points are joined only where interpolation between them is meaningful; captions state the confidence intervals. The rest of the invariants is asserted before
//! figures are drawn ([`check_invariants`]):
//!
//! - Names of figures are those of files and differ; axes have labels.
//! - Numbers are finite; a point is within its interval; on a logarithmic axis it is positive, because it would be missing there.
//! - Bars have a value for each name and segment, and none is negative.
//! - A point above the ideal line has a reason in the caption.

pub mod axes;
pub mod canvas;
pub mod format;
pub mod latex;
pub mod map;
pub mod svg;
#[cfg(all(test, feature = "figures"))]
pub(crate) mod tests;

use axes::Scale;
pub use axes::tick_label;
use map::Map;

use contract::number::numbered;
use std::collections::BTreeSet;

/// An axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    pub log: bool,
    /// Positions of the ticks; chosen from the range if empty.
    pub ticks: Vec<f64>,
    /// Lower and upper end; chosen from the data if absent.
    pub range: Option<(f64, f64)>,
    /// Names of bars, from top to bottom; empty for an axis of numbers.
    pub names: Vec<String>,
}

impl Axis {
    pub fn log(label: &str) -> Self {
        Self { log: true, ..Self::linear(label) }
    }

    /// A linear axis that starts at zero.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), ..Self::default() }
    }

    fn shows(&self, value: f64) -> bool {
        value.is_finite() && (!self.log || value > 0.0)
    }
}

/// How a value was obtained. Markers of measured values are filled, all others hollow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// With at most one rank per core.
    Measured,
    /// With more ranks than cores.
    Oversubscribed,
    /// From simulated ranks and a network model.
    Projected,
    /// Quoted from a publication.
    Cited,
    /// A theoretical bound, or a mean: a line without markers.
    Bound,
    /// Of a model: a line without markers, whose intervals are an area around it.
    Modelled,
}

impl Provenance {
    /// The word for legends and tables.
    pub fn word(self) -> &'static str {
        ["measured", "oversubscribed", "projected", "cited", "bound", "modelled"][self as usize]
    }
}

/// A point with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    /// Median.
    pub y: f64,
    /// Lower end of the confidence interval; `y` without one.
    pub low: f64,
    /// Upper end of the confidence interval; `y` without one.
    pub high: f64,
}

impl Point {
    /// A point without an interval.
    pub fn exact(x: f64, y: f64) -> Self {
        Self { x, y, low: y, high: y }
    }
}

/// How the points of a series are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// With markers, and lines between consecutive points.
    Joined,
    /// With markers only.
    Scattered,
    /// As a line without markers, such as a change point.
    Line,
    /// As the segments of stacked bars: `x` is a length, and `y` the index of the bar's name on the axis.
    Bars,
}

/// Points with one name in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    pub provenance: Provenance,
    pub kind: Kind,
    /// The points in ascending `x`.
    pub points: Vec<Point>,
    /// A description of each point, shown under the pointer; empty for none.
    pub notes: Vec<String>,
    /// Index of colour and marker.
    pub style: usize,
}

impl Series {
    /// A joined series without notes.
    pub fn new(name: &str, provenance: Provenance, style: usize, points: Vec<Point>) -> Self {
        let (name, kind, notes) = (name.to_owned(), Kind::Joined, Vec::new());
        Self { name, provenance, kind, points, notes, style }
    }

    /// A vertical line between these ends of an axis.
    pub fn vertical(name: &str, style: usize, x: f64, (low, high): (f64, f64)) -> Self {
        let points = [low, high].map(|y| Point::exact(x, y)).to_vec();
        Self::new(name, Provenance::Bound, style, points).drawn_as(Kind::Line)
    }

    pub fn drawn_as(self, kind: Kind) -> Self {
        Self { kind, ..self }
    }
}

/// A figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Name of its files, without the extension.
    pub id: String,
    /// Heading. It is not drawn, because journals require it in the caption.
    pub title: String,
    /// Quantities, sample sizes, intervals and the meaning of hollow markers.
    pub caption: String,
    pub x: Axis,
    pub y: Axis,
    /// Those of one name have one entry in the legend.
    pub series: Vec<Series>,
    pub map: Option<Map>,
    /// Whether it is about half as high as usual.
    pub is_flat: bool,
}

impl Figure {
    /// The axes with their ends and ticks.
    fn scales(&self) -> [Scale; 2] {
        let all = || self.series.iter().flat_map(|s| s.points.iter().map(move |p| (s.kind, p)));
        let (bars, others): (Vec<_>, Vec<_>) = all().partition(|(kind, _)| *kind == Kind::Bars);
        let total = |bar: f64| bars.iter().filter(|(_, p)| p.y == bar).map(|(_, p)| p.x).sum();
        let totals = (0..self.y.names.len()).map(|i| total(i as f64));
        let x = Scale::of(&self.x, others.iter().map(|(_, p)| p.x).chain(totals));
        [x, Scale::of(&self.y, others.iter().flat_map(|(_, p)| [p.y, p.low, p.high]))]
    }

    /// The figure without the points at which a logarithmic axis is not defined, such as a time that was measured as 0. The caption states
    /// how many there are.
    pub fn without_zeros(mut self) -> Self {
        let mut zeros = 0;
        for series in &mut self.series {
            let before = series.points.len();
            series.points.retain(|p| !(self.x.log && p.x == 0.0 || self.y.log && p.y == 0.0));
            zeros += before - series.points.len();
        }
        if zeros > 0 {
            self.caption += &format!(" The axes cannot show {zeros} values of 0.");
        }
        self
    }
}

/// The text as a part of a file's name, of an address and of a label: characters other than `a` to `z`, `A` to `Z`, digits, `.`, `-`
/// and `_` become `-`.
pub fn file_name(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    text.chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}

/// Makes names different from each other: the second of a name ends in `-2`.
pub fn name_apart<'a>(names: impl Iterator<Item = &'a mut String>) {
    let mut taken = BTreeSet::new();
    names.for_each(|name| *name = numbered(name, '-', |free| taken.insert(free.clone())));
}

/// Asserts the invariants of the figures of a report.
///
/// # Panics
/// If one is violated.
pub fn check_invariants(figures: &[Figure]) {
    let names: BTreeSet<&str> = figures.iter().map(|f| f.id.as_str()).collect();
    assert_eq!(names.len(), figures.len(), "two figures have one name: {names:?}");
    for figure in figures {
        let id = &figure.id;
        assert!(!id.is_empty() && *id == file_name(id), "figure {id:?}: not a name of a file");
        let are_labelled = [&figure.x, &figure.y].iter().all(|axis| !axis.label.is_empty());
        assert!(are_labelled, "figure {id}: an axis has no label");
        figure.series.iter().for_each(|s| check_series(figure, s));
        check_ideal(figure);
    }
}

fn check_series(figure: &Figure, s: &Series) {
    let name = format!("figure {}, {}", figure.id, s.name);
    for p in &s.points {
        let is_shown = figure.x.shows(p.x) && figure.y.shows(p.y);
        let is_finite = p.low.is_finite() && p.high.is_finite();
        assert!(is_shown && is_finite, "{name}: the axes cannot show {p:?}");
        assert!(p.low <= p.y && p.y <= p.high, "{name}: {p:?} is outside of its interval");
        assert!(s.kind != Kind::Bars || p.x >= 0.0, "{name}: {p:?} has no length");
    }
    let is_complete = s.kind != Kind::Bars || s.points.len() == figure.y.names.len();
    assert!(is_complete, "{name}: a bar lacks a segment");
}

/// A line through the two ends of the ideal, straight on logarithmic axes.
fn check_ideal(figure: &Figure) {
    let all = &figure.series;
    let ideal = all.iter().find(|s| s.provenance == Provenance::Bound && s.name == "ideal");
    let Some([from, to]) = ideal.map(|s| &s.points[..]) else { return };
    let slope = if to.x > from.x { (to.y / from.y).ln() / (to.x / from.x).ln() } else { 0.0 };
    let is_above = |p: &Point| p.y > 1.0005 * from.y * (p.x / from.x).powf(slope);
    let above = all.iter().flat_map(|s| &s.points).find(|p| is_above(p));
    assert!(
        above.is_none() || figure.caption.contains("above 1"),
        "figure {}: {above:?} is above the ideal line, and the caption gives no reason",
        figure.id
    );
}

#[cfg(test)]
pub mod samples {
    use super::*;

    pub(crate) fn figure(series: Vec<Series>) -> Figure {
        Figure {
            id: "speedup".into(),
            title: "Speedup".into(),
            caption: "Speedup & <more>, n = 6.".into(),
            x: Axis { ticks: vec![1.0, 2.0, 4.0], ..Axis::log("ranks") },
            y: Axis::log("speedup"),
            series,
            ..Figure::default()
        }
    }

    pub(crate) fn bars() -> Figure {
        let names = vec!["1".into(), "2".into()];
        let segment = |name: &str, style: usize, lengths: [f64; 2]| {
            let points = [0, 1].map(|i| Point::exact(lengths[i], i as f64)).to_vec();
            Series::new(name, Provenance::Projected, style, points).drawn_as(Kind::Bars)
        };
        let mean = Series::vertical("mean, 3", 6, 3.0, (-0.5, 1.5));
        let series = vec![segment("read", 0, [1.0, 2.0]), segment("grade", 1, [3.0, 0.0]), mean];
        let [x, y] = ["s", "ranks"].map(Axis::linear);
        Figure { x, y: Axis { names, ..y }, ..figure(series) }
    }

    pub(crate) fn series(provenance: Provenance) -> Series {
        let points =
            [1.0, 2.0, 4.0].map(|x| Point { low: x * 0.9, high: x * 1.1, ..Point::exact(x, x) });
        Series::new(&format!("UAV, {}", provenance.word()), provenance, 0, points.to_vec())
    }
}

#[cfg(test)]
mod invariants {
    use super::samples::{figure, series};
    use super::*;
    use proptest::prelude::*;

    fn points() -> Figure {
        figure(vec![series(Provenance::Measured), series(Provenance::Projected)])
    }

    /// Asserts that a change of a figure is noticed, and for the stated reason.
    fn assert_noticed(why: &str, change: impl Fn(&mut Figure)) {
        check_invariants(&[points()]);
        let mut changed = points();
        change(&mut changed);
        let caught = std::panic::catch_unwind(|| check_invariants(&[changed])).unwrap_err();
        let message = caught.downcast_ref::<String>().expect("a message with values");
        assert!(message.contains(why), "{message}");
    }

    #[test]
    fn planted_wrong_figures_are_noticed() {
        assert_noticed("not a name of a file", |f| f.id = "two words".into());
        assert_noticed("no label", |f| f.y.label.clear());
        assert_noticed("cannot show", |f| f.series[0].points[1].y = f64::NAN);
        assert_noticed("cannot show", |f| f.series[1].points[0] = Point::exact(1.0, 0.0));
        assert_noticed("outside of its interval", |f| f.series[0].points[1].y = 9.0);
        assert_noticed("cannot show", |f| {
            f.series.push(Series::vertical("m", 0, f64::NAN, (1.0, 2.0)))
        });
        check_invariants(&[samples::bars()]);
        let wrong_bars = |change: fn(&mut Vec<Point>)| {
            move |f: &mut Figure| {
                *f = samples::bars();
                change(&mut f.series[0].points);
            }
        };
        assert_noticed("no length", wrong_bars(|points| points[1].x = -1.0));
        assert_noticed("lacks a segment", wrong_bars(|points| points.truncate(1)));
        assert_noticed("gives no reason", |f| {
            let ends = [1.0, 4.0].map(|x| Point::exact(x, x / 2.0)).to_vec();
            f.series.push(Series::new("ideal", Provenance::Bound, 0, ends));
        });
    }

    proptest! {
        /// Any names of cases, engines and series: file names and references within a drawing stay intact.
        #[test]
        fn names_are_plain_and_differ(names in proptest::collection::vec("[a ./\"é<&-]{0,3}", 1..12)) {
            let mut all: Vec<Figure> =
                names.iter().map(|name| Figure { id: file_name(&format!("rate-{name}")), ..points() }).collect();
            name_apart(all.iter_mut().map(|figure| &mut figure.id));
            check_invariants(&all);
        }
    }

    #[test]
    #[should_panic(expected = "two figures have one name")]
    fn a_figure_that_would_overwrite_another_is_noticed() {
        check_invariants(&[points(), points()]);
    }

    #[test]
    fn values_that_a_logarithmic_axis_cannot_show_are_counted() {
        let mut shown = points();
        shown.series[0].points[0] = Point::exact(1.0, 0.0);
        let shown = shown.without_zeros();
        assert_eq!(shown.series[0].points.len(), 2);
        assert!(shown.caption.ends_with("cannot show 1 values of 0."));
    }
}
