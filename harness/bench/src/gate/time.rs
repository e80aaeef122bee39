//! The layer of time: baseline and candidate run interleaved, so that the load of the machine affects both equally, serially and
//! on the real ranks of the rules.
//!
//! The CPU time and the wall time of the whole process are compared, seen from outside. Those of all cases are tested together:
//! [`adjusted`] controls the rate of false discoveries. Which phase a change is in, counters and instructions show.
//!
//! A change is measured once more with fresh runs, and is one only if both measurements agree. They are independent, so each is tested
//! at the square root of `alpha`: that finds smaller changes than one measurement at `alpha`, and few gates measure twice.

use super::Bench;
use super::measures::LayerName;
use super::numbers::{other_mesh, prefix};
use super::report::{GateFinding, Layer, Verdict};
use super::rules::{GateCase, TimeRules};
use crate::emptied;
use run::engine::failure::Failure;
use run::engine::interrupt;
use run::engine::layout::{Layout, Ranks, RunOptions};
use statistics::comparison::{Comparison, Round, adjusted, compare, trimmed_mean};
use statistics::random::Random;

/// CPU time of the whole process.
pub const CPU: &str = "CPU time";
/// Wall time of the whole process.
pub const WALL: &str = "wall time";

/// The candidate's place in a round, after two of the baseline.
const CANDIDATE: usize = 2;

/// A time that the gate compares, over all rounds of a case on some ranks.
struct Quantity {
    /// Its name in the report.
    metric: String,
    /// Logarithms of its times.
    rounds: Vec<Round>,
    /// The comparison of its rounds; its p-value is adjusted for all quantities of all cases.
    found: Comparison,
    /// The effect that a first measurement found, if this is the second.
    first: Option<f64>,
}

/// Compares the times of candidate and baseline.
pub(super) fn layer(bench: &Bench, layer: &mut Layer) {
    if bench.baseline.is_none() {
        layer.left_out = Some("no baseline was given".to_owned());
        return;
    }
    let rules = &bench.rules.time;
    let mut measured: Vec<(&GateCase, Ranks, Times)> = Vec::new();
    for case in bench.cases_of(LayerName::Time) {
        let on = |ranks| (case, ranks, rounds(bench, case, ranks, false));
        measured.extend(layouts(case).map(on));
    }
    // All quantities of all cases are tested together.
    let mut all: Vec<_> = measured.iter_mut().flat_map(|of| &mut of.2).flatten().collect();
    let p_values = adjusted(&all.iter().map(|quantity| quantity.found.p).collect::<Vec<f64>>());
    all.iter_mut().zip(p_values).for_each(|(quantity, p)| quantity.found.p = p);
    for (case, ranks, times) in measured {
        let confirmed = times.and_then(|times| {
            if !times.iter().any(|quantity| quantity.is_change(rules)) {
                return Ok(times);
            }
            let both = times.into_iter().zip(rounds(bench, case, ranks, true)?);
            Ok(both.map(|(first, again)| first.confirmed_by(again, rules)).collect())
        });
        match confirmed {
            Ok(all) => layer.findings.extend(all.iter().map(|of| of.finding(&case.name, rules))),
            Err(_) if interrupt::requested() => {}
            Err((verdict, note)) => {
                let metric = format!("{}time", prefix(ranks));
                layer.findings.push(GateFinding::noted(&case.name, &metric, verdict, note));
            }
        }
    }
}

/// The ranks on which a case is timed.
fn layouts(case: &GateCase) -> impl Iterator<Item = Ranks> {
    case.layouts().filter(|ranks| !matches!(ranks, Ranks::Simulated { .. }))
}

/// The CPU times and the wall times of a case, or why it has none, with the verdict on that: the baseline fails, the candidate alone, or
/// their meshes differ.
type Times = Result<Vec<Quantity>, (Verdict, String)>;

/// Runs all rounds of a case: of the first measurement, or of the second.
fn rounds(bench: &Bench, case: &GateCase, ranks: Ranks, again: bool) -> Times {
    let baseline = &bench.baseline.as_ref().expect("times are compared with a baseline").engine;
    let failed = |index, why: Failure| match index {
        CANDIDATE => (Verdict::Regression, format!("the candidate has no result: {why}")),
        _ => (Verdict::Missing, format!("the baseline has no result: {why}")),
    };
    let path = bench.prepare(baseline, case, "time").map_err(|why| failed(0, why))?;
    let run = |index: usize| {
        let engine = if index == CANDIDATE { &bench.candidate.engine } else { baseline };
        let place = emptied(bench.place.join("time/run"), engine).map_err(|e| failed(index, e))?;
        let options = RunOptions::new(&place, bench.options.timeout);
        engine.run(&path, &Layout::on(ranks), &options).map_err(|why| failed(index, why))
    };
    // The first run reads program and geometry from disk and is not counted.
    let runs = [run(0)?, run(CANDIDATE)?];
    let meshes = runs.each_ref().map(|of| (of.report.digest.as_deref(), Some(of.report.cells)));
    other_mesh(meshes, bench.options.accept_meshes).map_or(Ok(()), Err)?;
    let [first, also] = runs.map(|run| run.finished);
    let rules = &bench.rules.time;
    let budget_s = bench.options.budget.map_or(rules.budget_s, |budget| budget.as_secs_f64());
    let fit = budget_s / (2.0 * first.time_wall_s + also.time_wall_s).max(1e-6);
    let count = (fit as usize).clamp(rules.rounds_min, rules.rounds_max);
    let seed = bench.options.seed.wrapping_add(u64::from(again));
    let mut random = Random(seed);
    let [mut cpu, mut wall] = [(); 2].map(|()| vec![[0.0; 3]; count]);
    for round in 0..count {
        let mut order = [0, 1, 2];
        random.shuffle(&mut order);
        for index in order {
            let run = run(index)?.finished;
            // A microsecond is the resolution of the clocks.
            cpu[round][index] = run.time_cpu_s.max(1e-6).ln();
            wall[round][index] = run.time_wall_s.max(1e-6).ln();
        }
    }
    let kinds = [(CPU, cpu), (WALL, wall)];
    let tests = kinds.len() * bench.cases_of(LayerName::Time).flat_map(layouts).count();
    let quantity = |(name, rounds): (&str, Vec<Round>)| {
        let found = compare(&rounds, rules.alpha.sqrt(), tests, seed);
        Quantity { metric: format!("{}{name}", prefix(ranks)), rounds, found, first: None }
    };
    Ok(kinds.map(quantity).into())
}

/// The size of an effect: as a ratio, 1/3 less time equals 1/2 more time.
fn size(effect: f64) -> f64 {
    if effect < 0.0 { 1.0 / (1.0 + effect) - 1.0 } else { effect }
}

impl Quantity {
    /// Times of baseline and candidate, in seconds. That of the candidate follows from the effect: means of their own would
    /// discard other rounds at their ends than the mean of the differences does, and could have a ratio of the other sign.
    fn times(&self) -> [f64; 2] {
        let baseline = trimmed_mean(self.rounds.iter().map(|r| (r[0] + r[1]) / 2.0)).exp();
        [baseline, baseline * (1.0 + self.found.effect)]
    }

    /// Returns the second measurement of a change, and else the first. Its p-value becomes that of both: two are at most x with
    /// probability x squared.
    fn confirmed_by(self, mut again: Self, rules: &TimeRules) -> Self {
        if !self.is_change(rules) {
            return self;
        }
        again.found.p = again.found.p.max(self.found.p).powi(2);
        Self { first: Some(self.found.effect), ..again }
    }

    fn is_change(&self, rules: &TimeRules) -> bool {
        matches!(self.verdict(rules), Verdict::Regression | Verdict::Improvement)
    }

    fn finding(&self, case: &str, rules: &TimeRules) -> GateFinding {
        let Comparison { low, high, p, floor, visible, .. } = self.found;
        let visible = visible.max(rules.effect_min / 100.0);
        let [low, high, floor, visible] = [low, high, floor, visible].map(|ratio| ratio * 100.0);
        let p = if p < 0.001 { format!("{p:.0e}") } else { format!("{p:.3}") };
        let mut note = format!(
            "{} rounds; 99 % interval {low:+.1} to {high:+.1} %, p = {p} among all times; noise floor {floor:.1} %, minimum \
             detectable effect {visible:.1} %",
            self.rounds.len()
        );
        let verdict = self.verdict(rules);
        if let Some(first) = self.first {
            let answer = if self.is_change(rules) { "confirms" } else { "does not confirm" };
            let first = first * 100.0;
            note += &format!("; a second measurement, which {answer} {first:+.1} % in the first");
        }
        GateFinding::noted(case, &self.metric, verdict, note).of_values(self.times())
    }

    /// A change is significant, larger than both the noise floor and the effects of code alignment (`effect_min`), of the same
    /// sign in both measurements, and the interval of the second is beyond 0. "Unchanged" requires that an effect of `effect_wanted` would have been detected, lies outside the
    /// interval, and that no significant effect was seen.
    fn verdict(&self, rules: &TimeRules) -> Verdict {
        let found = &self.found;
        let (least, wanted) = (rules.effect_min / 100.0, rules.effect_wanted / 100.0);
        let level = if self.first.is_some() { rules.alpha } else { rules.alpha.sqrt() };
        let is_significant = found.p <= level && size(found.effect) > least;
        let (is_sure, is_slower) = (found.low > 0.0 || found.high < 0.0, found.effect > 0.0);
        let is_confirmed = self.first.is_none_or(|first| is_sure && (first > 0.0) == is_slower);
        if is_significant && size(found.effect) > found.floor && is_confirmed {
            return if is_slower { Verdict::Regression } else { Verdict::Improvement };
        }
        let within = size(found.low) <= wanted && size(found.high) <= wanted;
        let is_known = found.visible <= wanted && within && !is_significant;
        if is_known { Verdict::Unchanged } else { Verdict::Inconclusive }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_verdict_needs_significance_and_size() {
        let rules = TimeRules::default();
        let found = Comparison {
            effect: 0.08,
            p: 0.0005,
            floor: 0.02,
            visible: 0.05,
            low: 0.06,
            high: 0.1,
        };
        let quantity = |found: Comparison| Quantity {
            metric: CPU.to_owned(),
            rounds: Vec::new(),
            found,
            first: None,
        };
        let of = |found: Comparison| quantity(found).verdict(&rules);
        assert_eq!(of(found), Verdict::Regression);
        assert_eq!(of(Comparison { effect: -0.08, ..found }), Verdict::Improvement);
        assert_eq!(of(Comparison { p: 0.3, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { floor: 0.081, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { p: 0.3, high: 0.11, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { effect: 0.009, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { floor: 0.09, visible: 0.12, ..found }), Verdict::Inconclusive);
        let twice = |again| quantity(found).confirmed_by(quantity(again), &rules).verdict(&rules);
        assert_eq!(twice(found), Verdict::Regression);
        assert_eq!(twice(Comparison { p: 0.04, ..found }), Verdict::Unchanged);
        assert_eq!(twice(Comparison { effect: 0.0, p: 1.0, ..found }), Verdict::Unchanged);
        assert_eq!(twice(Comparison { effect: -0.08, ..found }), Verdict::Inconclusive);
        assert_eq!(twice(Comparison { floor: 0.09, ..found }), Verdict::Inconclusive);
        assert_eq!(twice(Comparison { low: -0.006, ..found }), Verdict::Inconclusive);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// Of rounds of which half are disturbed, the means of both programs may have the other order than the effect.
        #[test]
        fn the_times_have_the_ratio_of_the_effect(rounds in prop::collection::vec(prop::array::uniform3(0.0..2.0f64), 8..20)) {
            let found = compare(&rounds, 0.01, 1, 1);
            let (metric, effect) = (CPU.to_owned(), found.effect);
            let times = Quantity { metric, rounds, found, first: None }.times();
            prop_assert!((times[1] / times[0] - 1.0 - effect).abs() < 1e-9);
        }
    }
}
