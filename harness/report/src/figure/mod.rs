//! The model of a figure: axes, series, bars. SVG ([`svg`], by `plotters`) and CSV ([`csv`]) are produced from it, PNG and PDF
//! from the SVG, and an axis of `pgfplots` that reads the CSV ([`tex`]).
//!
//! Invariants: every value states its provenance; points are joined only where interpolation between them is
//! meaningful; captions state the confidence intervals.

pub(crate) mod axes;
pub mod canvas;
pub mod check;
pub mod csv;
pub mod palette;
#[cfg(feature = "figures")]
pub mod raster;
pub(crate) mod scale;
pub mod svg;
pub mod tex;

pub use scale::tick_label;

use std::collections::BTreeSet;

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Whether the axis is logarithmic.
    pub log: bool,
    /// Positions of the ticks; chosen from the range if empty.
    pub ticks: Vec<f64>,
    /// Lower and upper end; chosen from the data if absent.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self { label: label.to_owned(), log: true, ticks: Vec::new(), range: None }
    }

    /// A linear axis that starts at zero.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), log: false, ticks: Vec::new(), range: None }
    }

    /// The same axis with ticks at the given positions.
    pub fn with_ticks(self, ticks: Vec<f64>) -> Self {
        Self { ticks, ..self }
    }
}

/// How a value was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// Measured with at most one rank per core; markers are filled.
    Measured,
    /// Measured with more ranks than cores; markers are hollow.
    Oversubscribed,
    /// Projected from simulated ranks and a network model; markers are hollow.
    Projected,
    /// Quoted from a publication; markers are hollow.
    Cited,
    /// A theoretical bound: a line without markers.
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

    /// Whether markers are filled and lines solid.
    pub fn is_solid(self) -> bool {
        self == Self::Measured
    }
}

/// A point with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Abscissa.
    pub x: f64,
    /// Median.
    pub y: f64,
    /// Lower end of the confidence interval; `y` without one.
    pub low: f64,
    /// Upper end of the confidence interval; `y` without one.
    pub high: f64,
    /// Number of measured values that the median is taken of; 0 if nothing was measured.
    pub count: usize,
    /// Probability that the interval contains the true median.
    pub coverage: f64,
}

impl Point {
    /// A point without an interval.
    pub fn exact(x: f64, y: f64) -> Self {
        Self { x, y, low: y, high: y, count: 0, coverage: 0.0 }
    }
}

/// Points with one name in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// How the values were obtained.
    pub provenance: Provenance,
    /// Whether consecutive points are joined by a line.
    pub joined: bool,
    /// The points in ascending `x`.
    pub points: Vec<Point>,
    /// A description of each point, shown under the pointer; empty for none.
    pub notes: Vec<String>,
    /// Index of colour and marker in the palette.
    pub style: usize,
}

impl Series {
    /// A joined series without notes.
    pub fn new(name: &str, provenance: Provenance, style: usize, points: Vec<Point>) -> Self {
        Self { name: name.to_owned(), provenance, joined: true, points, notes: Vec::new(), style }
    }

    /// The same series without lines between its points.
    pub fn not_joined(self) -> Self {
        Self { joined: false, ..self }
    }
}

/// A vertical line, such as a change point.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Name in the legend; marks of the same name have one entry.
    pub name: String,
    /// Abscissa.
    pub x: f64,
    /// Index of the colour in the palette.
    pub style: usize,
}

/// Stacked bars.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Names of the bars.
    pub categories: Vec<String>,
    /// Segments from bottom to top: name, and one value per bar.
    pub segments: Vec<(String, Vec<f64>)>,
    /// Horizontal reference lines: name and level.
    pub references: Vec<(String, f64)>,
    /// How the values were obtained.
    pub provenance: Provenance,
}

/// The data of a figure.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Points over a numerical axis.
    Points {
        /// The series.
        series: Vec<Series>,
        /// The vertical lines.
        marks: Vec<Mark>,
    },
    /// Bars over categories.
    Bars(Bars),
}

impl Body {
    /// Series without marks.
    pub fn points(series: Vec<Series>) -> Self {
        Self::Points { series, marks: Vec::new() }
    }
}

/// Usual height of a figure.
const HEIGHT: u32 = 1040;

/// A figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of its files, without the extension.
    pub id: String,
    /// Heading. It is not drawn, because journals require it in the caption.
    pub title: String,
    /// Quantities, sample sizes, intervals and the meaning of hollow markers.
    pub caption: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The data.
    pub body: Body,
    /// Height in units of which the width has [`canvas::WIDTH`].
    pub height: u32,
}

impl Figure {
    /// A figure of the usual height.
    pub fn new(id: String, title: String, caption: String, [x, y]: [Axis; 2], body: Body) -> Self {
        Self { id, title, caption, x, y, body, height: HEIGHT }
    }
}

/// The text as a part of a file's name, of an address and of a label: characters other than `a` to `z`, `A` to `Z`, digits, `.`, `-`
/// and `_` become `-`.
pub fn file_name(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    text.chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}

impl Figure {
    /// The figure without the points at which a logarithmic axis is not defined, such as a time that was measured as 0. The caption states
    /// how many there are.
    pub fn without_zeros(mut self) -> Self {
        let (x, y) = (self.x.log, self.y.log);
        let Body::Points { series, .. } = &mut self.body else { return self };
        let mut zeros = 0;
        for Series { points, .. } in series {
            let before = points.len();
            points.retain(|p| (!x || p.x > 0.0) && (!y || p.y > 0.0));
            zeros += before - points.len();
        }
        if zeros > 0 {
            self.caption += &format!(" The axes cannot show {zeros} values of 0.");
        }
        self
    }
}

/// Makes names different from each other: the second of a name ends in `-2`.
pub fn name_apart<'a>(names: impl Iterator<Item = &'a mut String>) {
    let mut taken = BTreeSet::new();
    for name in names {
        let plain = name.clone();
        let numbered = (2..).map(|n| format!("{plain}-{n}"));
        let mut free = std::iter::once(plain.clone()).chain(numbered);
        *name =
            free.find(|name| taken.insert(name.clone())).expect("there are always more numbers");
    }
}

#[cfg(test)]
pub(crate) mod samples {
    use super::*;

    pub(crate) fn figure(body: Body) -> Figure {
        Figure {
            id: "speedup".into(),
            title: "Speedup".into(),
            caption: "Speedup & <more>, n = 6.".into(),
            x: Axis::log("ranks").with_ticks(vec![1.0, 2.0, 4.0]),
            y: Axis::log("speedup"),
            body,
            height: HEIGHT,
        }
    }

    pub(crate) fn series(provenance: Provenance) -> Series {
        let points = [1.0, 2.0, 4.0].map(|x| Point {
            low: x * 0.9,
            high: x * 1.1,
            count: 6,
            coverage: 0.97,
            ..Point::exact(x, x)
        });
        let name = format!("UAV, {}", provenance.word());
        Series::new(&name, provenance, 0, points.to_vec())
    }
}
