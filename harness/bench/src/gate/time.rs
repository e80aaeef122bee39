//! The layer of time: baseline and candidate run interleaved, so that the load of the machine affects both equally, serially and
//! on the real ranks of the rules.
//!
//! Three kinds of quantities are compared: the CPU time and the wall time of the whole process, seen from outside, and the
//! CPU time of every phase that the program reports, with what lies outside all phases. All of them are tested together:
//! [`adjusted`] controls the rate of false discoveries.

use super::Bench;
use super::measures::LayerName;
use super::numbers::prefix;
use super::phases::{self, CPU, OUTSIDE, Quantity, WALL, size};
use super::report::{GateFinding, Layer, Verdict};
use super::rules::{Selected, TimeRules};
use super::subject::Baseline;
use crate::statistics::comparison::{Round, compare};
use crate::statistics::false_discovery::adjusted;
use crate::statistics::random::Random;
use run::engine::failure::Failure;
use run::engine::layout::{Layout, Ranks};
use run::engine::options::RunOptions;
use run::engine::report::PhaseReport;
use run::engine::runner::{Completed, Engine};
use std::path::Path;

/// Compares the times of candidate and baseline.
pub fn layer(bench: &Bench, layer: &mut Layer) {
    let left_out = match &bench.baseline {
        Baseline::Program(subject) => return compared(bench, &subject.engine, layer),
        Baseline::Record(..) => {
            "a record cannot be run, and times of different sessions are not comparable"
        }
        Baseline::None => "no baseline was given",
    };
    layer.left_out = Some(left_out.to_owned());
}

fn compared(bench: &Bench, baseline: &Engine, layer: &mut Layer) {
    let rules = &bench.rules.time;
    let mut measured: Vec<Vec<Quantity>> = Vec::new();
    'all: for case in bench.cases_of(LayerName::Time) {
        for ranks in case.layouts().filter(|ranks| !matches!(ranks, Ranks::Simulated { .. })) {
            match rounds(bench, baseline, case, ranks) {
                Ok(times) => measured.push(times),
                Err(failure) if failure.is_interrupt() => break 'all,
                Err(why) => {
                    let (name, metric) = (&case.rule.name, format!("{}time", prefix(ranks)));
                    let why = why.to_string();
                    layer.findings.push(GateFinding::noted(name, &metric, Verdict::Missing, why));
                }
            }
        }
    }
    // All quantities of all cases are tested together.
    let p_values: Vec<f64> = measured.iter().flatten().map(|quantity| quantity.found.p).collect();
    for (quantity, p) in measured.iter_mut().flatten().zip(adjusted(&p_values)) {
        quantity.found.p = p;
    }
    for times in &measured {
        let (whole, phases) = times.split_at(2);
        layer.findings.extend(whole.iter().map(|quantity| whole_finding(quantity, rules)));
        layer.findings.extend(phases::findings(&whole[0], phases, rules));
    }
}

/// Runs all rounds of a case: the two times of the process, then the phases that both programs report, by name.
fn rounds(
    bench: &Bench,
    baseline: &Engine,
    case: &Selected,
    ranks: Ranks,
) -> Result<Vec<Quantity>, Failure> {
    let path = bench.prepare(baseline, case, "time")?;
    let engines = [baseline, baseline, &bench.candidate];
    // The first run reads program and geometry from disk and is not counted.
    let first = run(bench, baseline, &path, ranks)?;
    let also = run(bench, &bench.candidate, &path, ranks)?;
    let rules = &bench.rules.time;
    let budget_s = bench.options.budget.unwrap_or(rules.budget_s);
    let fit = budget_s / (2.0 * first.time_process_s + also.time_process_s).max(1e-6);
    let count = (fit as usize).clamp(rules.rounds_min, rules.rounds_max);
    let mut random = Random(bench.options.seed);
    let mut names = vec![CPU, WALL];
    if first.report.time_cpu_s().is_some() && also.report.time_cpu_s().is_some() {
        let of_candidate = |p: &&PhaseReport| also.report.phases.iter().any(|o| o.name == p.name);
        let both = first.report.phases.iter().filter(of_candidate);
        names.extend(both.map(|phase| phase.name.as_str()));
        names.push(OUTSIDE);
    }
    let mut times: Vec<(String, Vec<Round>)> =
        names.into_iter().map(|name| (name.to_owned(), Vec::new())).collect();
    for _ in 0..count {
        let mut order = [0, 1, 2];
        random.shuffle(&mut order);
        let mut runs = [const { None }; 3];
        for index in order {
            runs[index] = Some(run(bench, engines[index], &path, ranks)?);
        }
        let runs = runs.map(|run| run.expect("each was run"));
        for (name, rounds) in &mut times {
            // A microsecond is the resolution of the clocks.
            rounds.push(runs.each_ref().map(|run| seconds(run, name).max(1e-6).ln()));
        }
    }
    let quantity = |(name, rounds): (String, Vec<Round>)| {
        let metric = match name.as_str() {
            CPU | WALL => name.clone(),
            OUTSIDE => format!("CPU time {OUTSIDE}"),
            phase => format!("CPU time in {phase}"),
        };
        let (case, metric) = (case.rule.name.clone(), format!("{}{metric}", prefix(ranks)));
        let found = compare(&rounds, rules.alpha, bench.options.seed);
        Quantity { case, metric, rounds, found }
    };
    Ok(times.into_iter().map(quantity).collect())
}

fn run(bench: &Bench, engine: &Engine, case: &Path, ranks: Ranks) -> Result<Completed, Failure> {
    let place = bench.enter(engine, "time/run")?;
    engine.run(case, &Layout::on(ranks), &RunOptions::new(&place, bench.options.limit()))
}

/// A quantity of one run, in seconds.
fn seconds(run: &Completed, name: &str) -> f64 {
    match name {
        CPU => run.time_process_cpu_s,
        WALL => run.time_process_s,
        OUTSIDE => run.time_process_cpu_s - run.report.time_cpu_s().unwrap_or(0.0),
        _ => {
            let of_phase = run.report.phases.iter().filter(|phase| phase.name == name);
            of_phase.map(PhaseReport::time_cpu_total_s).sum()
        }
    }
}

/// The finding for a time of the whole process.
fn whole_finding(quantity: &Quantity, rules: &TimeRules) -> GateFinding {
    let note = format!(
        "{} rounds; {}, minimum detectable effect {:.1} %",
        quantity.rounds.len(),
        quantity.certainty(),
        100.0 * quantity.found.visible.max(rules.effect_min / 100.0)
    );
    quantity.finding(verdict(quantity, rules), note)
}

/// An effect with a p-value below this is not reported as unchanged.
const SUSPICIOUS: f64 = 0.01;

/// "Unchanged" requires that an effect of `effect_wanted` would have been detected, lies outside the interval, and that no suspicious
/// effect was seen.
fn verdict(quantity: &Quantity, rules: &TimeRules) -> Verdict {
    let found = &quantity.found;
    if quantity.is_changed(rules) {
        return if found.effect > 0.0 { Verdict::Regression } else { Verdict::Improvement };
    }
    let (least, wanted) = (rules.effect_min / 100.0, rules.effect_wanted / 100.0);
    let suspicious = found.p <= SUSPICIOUS && size(found.effect) > least;
    let within = size(found.low) <= wanted && size(found.high) <= wanted;
    match found.visible <= wanted && within && !suspicious {
        true => Verdict::Unchanged,
        false => Verdict::Inconclusive,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::comparison::Comparison;

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
        let of = |found: Comparison| {
            let (case, metric) = ("c".to_owned(), CPU.to_owned());
            verdict(&Quantity { case, metric, rounds: Vec::new(), found }, &rules)
        };
        assert_eq!(of(found), Verdict::Regression);
        assert_eq!(of(Comparison { effect: -0.08, ..found }), Verdict::Improvement);
        assert_eq!(of(Comparison { p: 0.02, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { p: 0.005, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { p: 0.02, high: 0.11, ..found }), Verdict::Inconclusive);
        assert_eq!(of(Comparison { effect: 0.02, ..found }), Verdict::Unchanged);
        assert_eq!(of(Comparison { floor: 0.09, visible: 0.12, ..found }), Verdict::Inconclusive);
    }
}
