//! The layer of time: baseline and candidate run interleaved, so that the load of the machine affects both equally.

use super::report::{Finding, Layer, LayerName, Verdict};
use super::rules::{Selected, TimeRules};
use super::subject::Baseline;
use super::{Bench, left_out};
use crate::statistics::comparison::{Comparison, Round, compare};
use crate::statistics::random::Random;
use crate::statistics::trimmed_mean;
use run::engine::failure::Failure;
use run::engine::interrupt;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::report::PhaseReport;
use run::engine::runner::{Completed, Engine};
use std::path::Path;

/// Compares the times of candidate and baseline.
pub fn layer(bench: &Bench, baseline: &Baseline) -> Layer {
    let subject = match baseline {
        Baseline::Program(subject) => subject,
        Baseline::Record(..) => {
            return left_out(
                LayerName::Time,
                "a record cannot be run, and times of different sessions are not comparable",
            );
        }
        Baseline::None => return left_out(LayerName::Time, "no baseline was given"),
    };
    let mut layer = Layer::new(LayerName::Time);
    for case in bench.cases_of(LayerName::Time) {
        if interrupt::requested() {
            break;
        }
        let found = match rounds(bench, &subject.engine, case) {
            Ok(timed) => judge(bench, case, &timed),
            Err(failure) if failure.is_interrupt() => break,
            Err(why) => Finding::without_numbers(
                &case.rule.name,
                "time",
                Verdict::Inconclusive,
                why.to_string(),
            ),
        };
        layer.findings.push(found);
    }
    layer
}

/// All rounds of a case.
struct Timed {
    rounds: Vec<Round>,
    /// The kind of time.
    what: &'static str,
    /// Logarithms of the ratio of candidate to baseline, by phase.
    phases: Vec<(String, Vec<f64>)>,
}

/// The three runs of a round.
const BASELINE: usize = 0;
const AGAIN: usize = 1;
const CANDIDATE: usize = 2;

fn rounds(bench: &Bench, baseline: &Engine, case: &Selected) -> Result<Timed, Failure> {
    let unusable = |why: String| baseline.unusable(why);
    let path = case.path.clone().map_err(unusable)?;
    let place = bench.enter("time").map_err(unusable)?;
    let path = baseline.prepare(&path, &place.join("case")).map_err(unusable)?;
    let engines = [baseline, baseline, &bench.candidate];
    // The first run reads program and geometry from disk and is not counted.
    let first = run(bench, baseline, &path)?;
    let also = run(bench, &bench.candidate, &path)?;
    let cpu = first.report.time_cpu_s().is_some() && also.report.time_cpu_s().is_some();
    let rules = &bench.rules.time;
    let budget_s = bench.options.budget_s.unwrap_or(rules.budget_s);
    let fit = budget_s / (2.0 * first.time_process_s + also.time_process_s).max(1e-6);
    let count = (fit as usize).clamp(rules.rounds_min, rules.rounds_max);
    let mut random = Random(bench.options.seed);
    let mut timed = Timed {
        rounds: Vec::with_capacity(count),
        what: if cpu { "CPU seconds" } else { "wall seconds" },
        phases: first.report.phases.iter().map(|phase| (phase.name.clone(), Vec::new())).collect(),
    };
    for _ in 0..count {
        let mut order = [BASELINE, AGAIN, CANDIDATE];
        random.shuffle(&mut order);
        let mut reports = [const { None }; 3];
        for index in order {
            reports[index] = Some(run(bench, engines[index], &path)?);
        }
        let [Some(a), Some(a_again), Some(b)] = reports else { unreachable!("each was run") };
        let time = |run: &Completed| {
            run.report.time_cpu_s().filter(|_| cpu).unwrap_or(run.time_process_s).max(1e-9).ln()
        };
        timed.rounds.push(Round { a: time(&a), a_again: time(&a_again), b: time(&b) });
        for (name, ratios) in &mut timed.phases {
            let of = |run: &Completed| {
                let phase = run.report.phases.iter().find(|phase| phase.name == *name);
                phase.map(PhaseReport::time_cpu_total_s)
            };
            if let (Some(a), Some(a_again), Some(b)) = (of(&a), of(&a_again), of(&b)) {
                ratios.push((2.0 * b.max(1e-9) / (a + a_again).max(1e-9)).ln());
            }
        }
    }
    Ok(timed)
}

fn run(bench: &Bench, engine: &Engine, case: &Path) -> Result<Completed, Failure> {
    let place = bench.enter("time/run").map_err(|why| engine.unusable(why))?;
    engine.run(case, &SERIAL, &RunOptions::new(&place, bench.options.limit))
}

fn judge(bench: &Bench, case: &Selected, timed: &Timed) -> Finding {
    let rules = &bench.rules.time;
    let found = compare(&timed.rounds, rules.alpha, bench.options.seed);
    let verdict = verdict(&found, rules);
    let mean = |of: &dyn Fn(&Round) -> f64| {
        let times: Vec<f64> = timed.rounds.iter().map(of).collect();
        trimmed_mean(&times).exp()
    };
    let percent = |ratio: f64| ratio * 100.0;
    let mut note = format!(
        "{} rounds, {}; 99 % interval {:+.1} to {:+.1} %, p = {:.5}; noise floor {:.1} %, minimum detectable effect {:.1} %",
        timed.rounds.len(),
        timed.what,
        percent(found.low),
        percent(found.high),
        found.p,
        percent(found.floor),
        percent(found.visible.max(rules.effect_min / 100.0)),
    );
    if matches!(verdict, Verdict::Regression | Verdict::Improvement) {
        note.push_str(&format!("; by phase: {}", phases(timed)));
    }
    Finding {
        baseline: Some(mean(&|round| (round.a + round.a_again) / 2.0)),
        candidate: Some(mean(&|round| round.b)),
        change_percent: Some(percent(found.effect)),
        ..Finding::without_numbers(&case.rule.name, "time", verdict, note)
    }
}

/// An effect with a p-value below this is not reported as unchanged.
const SUSPICIOUS: f64 = 0.01;

/// A change must be significant, and larger than both the noise floor and the effects of code alignment (`effect_min`). "Unchanged"
/// requires that an effect of `effect_wanted` would have been detected, lies outside the interval, and that no suspicious effect was
/// seen.
fn verdict(found: &Comparison, rules: &TimeRules) -> Verdict {
    let (least, wanted) = (rules.effect_min / 100.0, rules.effect_wanted / 100.0);
    // As a ratio, 1/3 less time equals 1/2 more time.
    let size = |effect: f64| if effect < 0.0 { 1.0 / (1.0 + effect) - 1.0 } else { effect };
    if found.p <= rules.alpha && size(found.effect) > found.floor.max(least) {
        return if found.effect > 0.0 { Verdict::Regression } else { Verdict::Improvement };
    }
    let suspicious = found.p <= SUSPICIOUS && size(found.effect) > least;
    let within = size(found.low) <= wanted && size(found.high) <= wanted;
    match found.visible <= wanted && within && !suspicious {
        true => Verdict::Unchanged,
        false => Verdict::Inconclusive,
    }
}

/// Returns the change of each phase as text.
fn phases(timed: &Timed) -> String {
    let changes =
        timed.phases.iter().filter(|(_, ratios)| !ratios.is_empty()).map(|(name, ratios)| {
            format!("{name} {:+.0} %", trimmed_mean(ratios).exp_m1() * 100.0)
        });
    changes.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let of = |found: Comparison| verdict(&found, &rules);
        assert_eq!(of(found), Verdict::Regression);
        assert_eq!(of(Comparison { effect: -0.08, ..found }), Verdict::Improvement);
        assert_eq!(of(Comparison { p: 0.02, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { p: 0.005, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { p: 0.02, high: 0.11, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { effect: 0.02, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { floor: 0.09, visible: 0.12, ..found }), Verdict::Inconclusive);
    }
}
