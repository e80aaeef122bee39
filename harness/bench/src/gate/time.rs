//! The layer of time: baseline and candidate run interleaved, so that the load of the machine affects both equally, serially and
//! on the real ranks of the rules.
//!
//! Three kinds of quantities are compared: the CPU time and the wall time of the whole process, seen from outside, and the
//! CPU time of every phase that the program reports, with what lies outside all phases. All of them are tested together:
//! [`adjusted`] controls the rate of false discoveries.

use super::Bench;
use super::measures::LayerName;
use super::numbers::prefix;
use super::phases::{self, CPU, OUTSIDE, Quantity, WALL, certainty, size};
use super::report::{GateFinding, Layer, Verdict};
use super::rules::{Selected, TimeRules};
use super::subject::Baseline;
use crate::statistics::comparison::{Comparison, Round, compare};
use crate::statistics::false_discovery::adjusted;
use crate::statistics::random::Random;
use run::engine::failure::Failure;
use run::engine::interrupt;
use run::engine::layout::{Layout, Ranks};
use run::engine::options::RunOptions;
use run::engine::report::PhaseReport;
use run::engine::runner::{Completed, Engine};
use std::path::Path;

/// The times of a case on some ranks.
struct Timed<'a> {
    case: &'a str,
    ranks: Ranks,
    quantities: Vec<Quantity>,
}

/// Compares the times of candidate and baseline.
pub fn layer(bench: &Bench, layer: &mut Layer) {
    let why = match &bench.baseline {
        Baseline::Program(subject) => return compared(bench, &subject.engine, layer),
        Baseline::Record(..) => {
            "a record cannot be run, and times of different sessions are not comparable"
        }
        Baseline::None => "no baseline was given",
    };
    layer.left_out = Some(why.to_owned());
}

fn compared(bench: &Bench, baseline: &Engine, layer: &mut Layer) {
    let mut measured = Vec::new();
    for case in bench.cases_of(LayerName::Time) {
        let name = &case.rule.name;
        for ranks in case.layouts().filter(|ranks| !matches!(ranks, Ranks::Simulated { .. })) {
            if interrupt::requested() {
                break;
            }
            match rounds(bench, baseline, case, ranks) {
                Ok(quantities) => measured.push(Timed { case: name, ranks, quantities }),
                Err(failure) if failure.is_interrupt() => break,
                Err(why) => {
                    let (metric, why) = (format!("{}time", prefix(ranks)), why.to_string());
                    layer.findings.push(GateFinding::noted(name, &metric, Verdict::Missing, why));
                }
            }
        }
    }
    layer.findings.extend(judged(bench, &mut measured));
}

/// The three runs of a round.
const BASELINE: usize = 0;
const AGAIN: usize = 1;
const CANDIDATE: usize = 2;

/// Runs all rounds of a case: the two times of the process, then the phases that both programs report.
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
    let mut quantities = vec![Quantity::new(CPU), Quantity::new(WALL)];
    if first.report.time_cpu_s().is_some() && also.report.time_cpu_s().is_some() {
        let of_candidate = |p: &&PhaseReport| also.report.phases.iter().any(|o| o.name == p.name);
        let both = first.report.phases.iter().filter(of_candidate);
        quantities.extend(both.map(|phase| Quantity::new(&phase.name)));
        quantities.push(Quantity::new(OUTSIDE));
    }
    for _ in 0..count {
        let mut order = [BASELINE, AGAIN, CANDIDATE];
        random.shuffle(&mut order);
        let mut runs = [const { None }; 3];
        for index in order {
            runs[index] = Some(run(bench, engines[index], &path, ranks)?);
        }
        let [Some(a), Some(a_again), Some(b)] = runs else { unreachable!("each was run") };
        for quantity in &mut quantities {
            // A microsecond is the resolution of the clocks.
            let of = |run: &Completed| seconds(run, &quantity.name).max(1e-6).ln();
            quantity.rounds.push(Round { a: of(&a), a_again: of(&a_again), b: of(&b) });
        }
    }
    Ok(quantities)
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

/// Tests all quantities of all cases together.
fn judged(bench: &Bench, measured: &mut [Timed]) -> Vec<GateFinding> {
    let rules = &bench.rules.time;
    let quantities = || measured.iter().flat_map(|timed| &timed.quantities);
    let compared: Vec<Comparison> = quantities()
        .map(|quantity| compare(&quantity.rounds, rules.alpha, bench.options.seed))
        .collect();
    let p_values: Vec<f64> = compared.iter().map(|found| found.p).collect();
    let all = measured.iter_mut().flat_map(|timed| &mut timed.quantities);
    for ((quantity, found), p) in all.zip(compared).zip(adjusted(&p_values)) {
        quantity.found = Some(Comparison { p, ..found });
    }
    let of_case = |Timed { case, ranks, quantities }: &Timed| {
        let (whole, phases) = quantities.split_at(2);
        let prefix = prefix(*ranks);
        let mut findings: Vec<GateFinding> = whole
            .iter()
            .filter_map(|quantity| whole_finding(case, &prefix, quantity, rules))
            .collect();
        findings.extend(phases::findings(case, &prefix, &whole[0], phases, rules));
        findings
    };
    measured.iter().flat_map(of_case).collect()
}

/// The finding for a time of the whole process.
fn whole_finding(
    case: &str,
    prefix: &str,
    quantity: &Quantity,
    rules: &TimeRules,
) -> Option<GateFinding> {
    let found = quantity.found?;
    let note = format!(
        "{} rounds; {}, minimum detectable effect {:.1} %",
        quantity.rounds.len(),
        certainty(&found),
        100.0 * found.visible.max(rules.effect_min / 100.0)
    );
    let metric = format!("{prefix}{}", quantity.name);
    Some(GateFinding::of_values(case, &metric, verdict(&found, rules), quantity.times(), note))
}

/// An effect with a p-value below this is not reported as unchanged.
const SUSPICIOUS: f64 = 0.01;

/// A change must be significant, and larger than both the noise floor and the effects of code alignment (`effect_min`). "Unchanged"
/// requires that an effect of `effect_wanted` would have been detected, lies outside the interval, and that no suspicious effect was
/// seen.
fn verdict(found: &Comparison, rules: &TimeRules) -> Verdict {
    let (least, wanted) = (rules.effect_min / 100.0, rules.effect_wanted / 100.0);
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
