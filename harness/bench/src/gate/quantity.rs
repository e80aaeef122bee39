//! A time that the gate compares, over all rounds of a case.

use crate::statistics::comparison::{Comparison, Round};
use crate::statistics::trimmed_mean;

/// CPU time of the whole process.
pub const CPU: &str = "CPU time";
/// Wall time of the whole process.
pub const WALL: &str = "wall time";

/// CPU time of the process outside all phases that it reports: before the first, between them, after the last.
pub const OUTSIDE: &str = "outside the phases";

/// A quantity of all rounds of a case.
#[derive(Debug)]
pub(super) struct Quantity {
    /// [`CPU`], [`WALL`], [`OUTSIDE`], or the name of a phase.
    pub name: String,
    /// Logarithms of its times.
    pub rounds: Vec<Round>,
    /// The comparison of its rounds; its p-value is adjusted for all quantities of all cases.
    pub found: Option<Comparison>,
}

impl Quantity {
    /// A quantity without rounds.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), rounds: Vec::new(), found: None }
    }

    /// Mean times of baseline and candidate, in seconds.
    pub fn means(&self) -> (f64, f64) {
        let mean = |of: &dyn Fn(&Round) -> f64| {
            trimmed_mean(&self.rounds.iter().map(of).collect::<Vec<f64>>()).exp()
        };
        (mean(&|round| (round.a + round.a_again) / 2.0), mean(&|round| round.b))
    }
}

/// The certainty of an effect, as text.
pub(super) fn certainty(found: &Comparison) -> String {
    let percent = |ratio: f64| ratio * 100.0;
    format!(
        "99 % interval {:+.1} to {:+.1} %, p = {:.5} among all times; noise floor {:.1} %",
        percent(found.low),
        percent(found.high),
        found.p,
        percent(found.floor)
    )
}

/// The size of an effect: as a ratio, 1/3 less time equals 1/2 more time.
pub(super) fn size(effect: f64) -> f64 {
    if effect < 0.0 { 1.0 / (1.0 + effect) - 1.0 } else { effect }
}
