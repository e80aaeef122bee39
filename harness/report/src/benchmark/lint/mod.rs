//! Checks figures and record by the twelve rules of Hoefler and Belli, "Scientific Benchmarking of Parallel Computing
//! Systems" (SC15).

mod figure;
mod record;

use crate::figure::Figure;
use bench::experiments::entry::Line;

/// Whether a rule is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The rule is kept.
    Kept,
    /// The rule is broken.
    Broken,
}

/// A rule applied to a figure or to the record.
#[derive(Clone, Debug, PartialEq)]
pub struct Ruling {
    /// Number of the rule, 1 to 12.
    pub rule: usize,
    /// Identifier of the figure; "record" or "all figures" for findings about these.
    pub about: String,
    /// Whether the rule is kept.
    pub verdict: Verdict,
    /// The reason in a sentence.
    pub why: String,
}

impl Ruling {
    fn new(rule: usize, about: &str, verdict: Verdict, why: impl Into<String>) -> Self {
        Self { rule, about: about.to_owned(), verdict, why: why.into() }
    }
}

/// The rules in short.
pub const RULES: [&str; 12] = [
    "speedup: state the base case and its absolute performance",
    "state the reason for using a part of a benchmark or of a system only",
    "summarise costs by the arithmetic and rates by the harmonic mean",
    "do not average ratios",
    "state whether values are deterministic; give confidence intervals if not",
    "do not assume normality without a test",
    "compare nondeterministic values by sound statistics",
    "choose mean, median or another quantile by the question",
    "document all factors and the whole setup",
    "state how parallel time was measured and summarised",
    "show upper bounds of performance",
    "plot what interpretation needs; join points only where interpolation is valid",
];

/// Rules that every figure keeps because of the way in which this report computes its values.
const KEPT: [(usize, &str); 5] = [
    (3, "costs are summarised by medians; rates are cells over a median time"),
    (4, "ratios are ratios of medians; none is an average of ratios"),
    (6, "intervals are order statistics of the median and assume no distribution"),
    (
        8,
        "users of a batch program wait for its median run time; ranks are summarised by maximum and mean, because the slowest rank determines the time",
    ),
    (
        10,
        "run time is that of the slowest rank from reading to the last leaf, without barriers between phases; useful time is CPU time outside communication",
    ),
];

/// Applies the rules to every figure and to the record, ordered by rule.
pub fn lint(figures: &[Figure], lines: &[Line]) -> Vec<Ruling> {
    let mut findings: Vec<Ruling> = figures.iter().flat_map(figure::findings).collect();
    findings.extend(record::findings(lines));
    findings.extend(KEPT.map(|(rule, why)| Ruling::new(rule, "all figures", Verdict::Kept, why)));
    findings.sort_by_key(|f| f.rule);
    findings
}
