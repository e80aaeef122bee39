//! The model of a figure: axes, series of points, stacked bars or cells of a map, vertical lines. SVG ([`svg`], by `plotters`) is drawn from it, PNG and PDF from the SVG
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

use std::collections::BTreeSet;

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    pub log: bool,
    /// Positions of the ticks; chosen from the range if empty.
    pub ticks: Vec<f64>,
    /// Lower and upper end; chosen from the data if absent.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    pub fn log(label: &str) -> Self {
        Self { log: true, ..Self::linear(label) }
    }

    /// A linear axis that starts at zero.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), log: false, ticks: Vec::new(), range: None }
    }

    pub fn with_ticks(self, ticks: Vec<f64>) -> Self {
        Self { ticks, ..self }
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
}

impl Provenance {
    /// The word for legends and tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Oversubscribed => "oversubscribed",
            Self::Projected => "projected",
            Self::Cited => "cited",
            Self::Bound => "bound",
        }
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

/// Points with one name in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    pub provenance: Provenance,
    /// Whether consecutive points are joined by a line.
    pub joined: bool,
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
        Self { name: name.to_owned(), provenance, joined: true, points, notes: Vec::new(), style }
    }

    pub fn not_joined(self) -> Self {
        Self { joined: false, ..self }
    }
}

/// Stacked bars from left to right, one below the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Names of the bars, from top to bottom.
    pub names: Vec<String>,
    /// Segments from left to right: name, and one value per bar.
    pub segments: Vec<(String, Vec<f64>)>,
    pub provenance: Provenance,
}

/// A vertical line, such as a change point. Those of the same name have one entry in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    pub name: String,
    pub x: f64,
    /// Index of the colour.
    pub style: usize,
}

/// Greatest number of bars that have names.
const LINES: usize = 12;

/// A figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of its files, without the extension.
    pub id: String,
    /// Heading. It is not drawn, because journals require it in the caption.
    pub title: String,
    /// Quantities, sample sizes, intervals and the meaning of hollow markers.
    pub caption: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    pub bars: Option<Bars>,
    pub marks: Vec<Mark>,
    pub map: Option<Map>,
    /// Height in units of which the width has [`canvas::WIDTH`]; without effect on a map.
    pub height: u32,
}

impl Figure {
    /// A figure of the usual height without vertical lines.
    pub fn new(
        id: String,
        title: String,
        caption: String,
        [x, y]: [Axis; 2],
        series: Vec<Series>,
    ) -> Self {
        let (bars, marks, map) = (None, Vec::new(), None);
        Self { id, title, caption, x, y, series, bars, marks, map, height: 1040 }
    }

    /// The axes with their ends and ticks.
    fn scales(&self) -> [Scale; 2] {
        let marks = self.marks.iter().map(|mark| mark.x);
        if let Some(bars) = &self.bars {
            let total = |i: usize| bars.segments.iter().map(|(_, values)| values[i]).sum();
            let ends = (0..bars.names.len()).map(total).chain(marks);
            return [Scale::of(&self.x, ends), Scale::of_names(&bars.names, LINES)];
        }
        let all = || self.series.iter().flat_map(|s| &s.points);
        let values = all().flat_map(|p| [p.y, p.low, p.high]);
        [Scale::of(&self.x, all().map(|p| p.x).chain(marks)), Scale::of(&self.y, values)]
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
    for name in names {
        let plain = name.clone();
        let mut number = 1;
        while !taken.insert(name.clone()) {
            number += 1;
            *name = format!("{plain}-{number}");
        }
    }
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
        for axis in [&figure.x, &figure.y] {
            assert!(!axis.label.is_empty(), "figure {id}: an axis has no label");
        }
        assert!(figure.marks.iter().all(|m| m.x.is_finite()), "figure {id}: a mark is nowhere");
        figure.series.iter().for_each(|s| check_series(figure, s));
        if let Some(bars) = &figure.bars {
            let values = bars.segments.iter().flat_map(|(_, values)| values);
            let is_length = |v: &f64| v.is_finite() && *v >= 0.0;
            assert!({ values }.all(is_length), "figure {id}: a bar has no length");
            let is_complete = |(_, values): &(String, Vec<f64>)| values.len() == bars.names.len();
            assert!(bars.segments.iter().all(is_complete), "figure {id}: a bar lacks a segment");
        }
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
    }
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
        Figure::new(
            "speedup".into(),
            "Speedup".into(),
            "Speedup & <more>, n = 6.".into(),
            [Axis::log("ranks").with_ticks(vec![1.0, 2.0, 4.0]), Axis::log("speedup")],
            series,
        )
    }

    pub(crate) fn bars() -> Figure {
        let segments = vec![("read".into(), vec![1.0, 2.0]), ("grade".into(), vec![3.0, 0.0])];
        let names = vec!["1".into(), "2".into()];
        let bars = Bars { names, segments, provenance: Provenance::Projected };
        let marks = vec![Mark { name: "mean, 3".into(), x: 3.0, style: 6 }];
        let [x, y] = ["s", "ranks"].map(Axis::linear);
        Figure { bars: Some(bars), marks, x, y, ..figure(Vec::new()) }
    }

    pub(crate) fn series(provenance: Provenance) -> Series {
        let points =
            [1.0, 2.0, 4.0].map(|x| Point { low: x * 0.9, high: x * 1.1, ..Point::exact(x, x) });
        let name = format!("UAV, {}", provenance.word());
        Series::new(&name, provenance, 0, points.to_vec())
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
        assert_noticed("nowhere", |f| {
            f.marks.push(Mark { name: "m".into(), x: f64::NAN, style: 0 })
        });
        let change = |of: fn(&mut Vec<f64>)| {
            move |f: &mut Figure| {
                let mut bars = samples::bars().bars;
                bars.iter_mut().for_each(|bars| of(&mut bars.segments[0].1));
                f.bars = bars;
            }
        };
        check_invariants(&[samples::bars()]);
        assert_noticed("no length", change(|values| values[1] = -1.0));
        assert_noticed("lacks a segment", change(|values| values.truncate(1)));
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
