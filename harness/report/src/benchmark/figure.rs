//! What a figure shows, apart from how it is drawn.
//!
//! Invariants: every value carries how it was come by; points are joined only where what lies between them
//! means something; a figure's caption tells what its bars of uncertainty are.

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Logarithmic.
    pub log: bool,
    /// Where ticks are; chosen by range if empty.
    pub ticks: Vec<f64>,
    /// Ends, where they are not to follow from the data.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self { label: label.to_owned(), log: true, ticks: Vec::new(), range: None }
    }

    /// A linear axis that begins at zero.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), log: false, ticks: Vec::new(), range: None }
    }

    /// With ticks where they are told.
    pub fn with_ticks(self, ticks: Vec<f64>) -> Self {
        Self { ticks, ..self }
    }
}

/// How a value was come by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// On cores of its own: drawn solid.
    Measured,
    /// With more ranks than cores: hollow.
    Oversubscribed,
    /// From simulated ranks and a model of messages: hollow.
    Projected,
    /// Somebody else's, from a text: hollow.
    Cited,
    /// What could be at best: a line without markers.
    Bound,
}

impl How {
    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Oversubscribed => "oversubscribed",
            Self::Projected => "projected",
            Self::Cited => "cited",
            Self::Bound => "bound",
        }
    }

    /// Whether markers are filled.
    pub fn is_solid(self) -> bool {
        self == Self::Measured
    }
}

/// A point with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where.
    pub x: f64,
    /// Median.
    pub y: f64,
    /// Lower end of the interval; `y` where there is none.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Number of values behind it; 0 where it is no measurement.
    pub count: usize,
    /// Probability that the interval contains the true median.
    pub coverage: f64,
}

impl Point {
    /// A point that is exact, or of which no more is known.
    pub fn bare(x: f64, y: f64) -> Self {
        Self { x, y, low: y, high: y, count: 0, coverage: 0.0 }
    }
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// For the legend.
    pub name: String,
    /// How its values were come by.
    pub how: How,
    /// Whether points are joined.
    pub joined: bool,
    /// Its points, by growing x.
    pub points: Vec<Point>,
    /// Which colour and marker; those of the number's place in the palette.
    pub look: usize,
}

/// Bars, one above the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Names of the bars.
    pub categories: Vec<String>,
    /// Parts of all bars, from below: name and one value per bar.
    pub parts: Vec<(String, Vec<f64>)>,
    /// A level to compare with, and its name.
    pub lines: Vec<(String, f64)>,
    /// How the values were come by.
    pub how: How,
}

/// Square matrices, side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Heat {
    /// Number of rows, and of columns.
    pub side: usize,
    /// The matrices.
    pub layers: Vec<Layer>,
    /// The command whose run they are of.
    pub command: String,
}

/// A matrix of which most may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Quantity and unit.
    pub label: String,
    /// Row, column and value.
    pub cells: Vec<(usize, usize, f64)>,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Points over an axis.
    Points(Vec<Series>),
    /// Bars over names.
    Bars(Bars),
    /// Matrices in colours; the first row is on top.
    Heat(Heat),
}

/// A figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of its files.
    pub id: String,
    /// For headings; not drawn, as journals want it in the caption.
    pub title: String,
    /// What is seen, n, intervals, what is hollow.
    pub caption: String,
    /// Across.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// What is drawn.
    pub body: Body,
    /// What the lint asks about.
    pub claims: Claims,
}

/// What a figure claims, for the lint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Claims {
    /// It shows ratios to a base case: which, and how fast that is.
    pub base_case: Option<String>,
    /// It shows ratios.
    pub shows_ratios: bool,
    /// It shows how something scales with ranks.
    pub shows_scaling: bool,
    /// It compares alternatives.
    pub compares: bool,
    /// Its values repeat exactly.
    pub deterministic: bool,
}

impl Figure {
    /// All points, with how they were come by.
    pub fn points(&self) -> Vec<(How, Point)> {
        match &self.body {
            Body::Points(all) => {
                all.iter().flat_map(|s| s.points.iter().map(|p| (s.how, *p))).collect()
            }
            Body::Bars(_) | Body::Heat(_) => Vec::new(),
        }
    }
}

/// Superscripts, for powers of ten.
const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// A number for an axis: plain where that is short, else with a power of ten.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let exponent = value.abs().log10().floor();
    if (-3.0..5.0).contains(&exponent) {
        let digits = (2.0 - exponent).clamp(0.0, 6.0) as usize;
        let text = format!("{value:.digits$}");
        return match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        };
    }
    let mantissa = value / 10f64.powf(exponent);
    let raised: String = format!("{exponent:.0}")
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |d| RAISED[d as usize]))
        .collect();
    match (mantissa * 100.0).round() / 100.0 {
        1.0 => format!("10{raised}"),
        m => format!("{m}·10{raised}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.05, "0.05"),
            (2.5, "2.5"),
            (1024.0, "1024"),
            (1e6, "10⁶"),
            (5e7, "5·10⁷"),
            (1e-6, "10⁻⁶"),
            (0.001, "0.001"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
