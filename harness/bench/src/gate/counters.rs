//! The layer of exact counters: the counters of the program and the digest, serially and on simulated ranks.

use super::measures::{CaseMeasures, Measures};
use super::report::{Finding, Layer, LayerName, Verdict};
use super::rules::{Selected, Tolerance};
use super::subject::Baseline;
use super::{Bench, left_out};
use check::promises::Independence;
use run::engine::failure::{End, Failure};
use run::engine::interrupt;
use run::engine::layout::{Layout, Ranks};
use run::engine::options::RunOptions;
use run::engine::runner::Engine;

/// Any seed will do: counters must not depend on the schedule, and both programs run with the same one.
const SEED: u64 = 1;

/// Compares the counters of candidate and baseline.
pub fn layer(bench: &Bench, baseline: &Baseline, measures: &mut Measures) -> Layer {
    let mut layer = Layer::new(LayerName::Counters);
    for case in bench.cases_of(LayerName::Counters) {
        if interrupt::requested() {
            break;
        }
        let name = &case.rule.name;
        let findings = match count(bench, &bench.candidate, case) {
            Ok(candidate) => {
                let entry = measures.case(name);
                entry.digest.clone_from(&candidate.digest);
                entry.exact.clone_from(&candidate.exact);
                against(bench, baseline, case, &candidate)
            }
            Err(why) if matches!(why.end, End::Missing(_)) => {
                return left_out(LayerName::Counters, why.to_string());
            }
            Err(why) => {
                vec![Finding::without_numbers(name, "runs", Verdict::Regression, why.to_string())]
            }
        };
        layer.findings.extend(findings);
        let engine = bench.candidate.description();
        if !case.rule.ranks.is_empty() && engine.run.simulated.is_none() {
            let why =
                format!("the description of {} has no command for simulated ranks", engine.name);
            layer.findings.push(Finding::without_numbers(
                name,
                "ranks",
                Verdict::Inconclusive,
                why,
            ));
        }
    }
    layer
}

fn against(
    bench: &Bench,
    baseline: &Baseline,
    case: &Selected,
    candidate: &CaseMeasures,
) -> Vec<Finding> {
    let name = &case.rule.name;
    let inconclusive =
        |why: String| vec![Finding::without_numbers(name, "baseline", Verdict::Inconclusive, why)];
    let counted;
    let old = match baseline {
        Baseline::None => return Vec::new(),
        Baseline::Record(_, record) => match record.cases.get(name) {
            Some(old) => old,
            None => return inconclusive("the record does not contain this case".into()),
        },
        Baseline::Program(subject) => match count(bench, &subject.engine, case) {
            Ok(old) => {
                counted = old;
                &counted
            }
            Err(why) => return inconclusive(format!("the baseline has no result: {why}")),
        },
    };
    compare(case, old, candidate, &bench.rules.tolerance)
}

/// Counts of one program on one case. Digests of all rank counts must be the same if the engine promises that.
fn count(bench: &Bench, engine: &Engine, case: &Selected) -> Result<CaseMeasures, Failure> {
    let unusable = |why: String| engine.unusable(why);
    let path = case.path.clone().map_err(unusable)?;
    let place = bench.enter("counters").map_err(unusable)?;
    let path = engine.prepare(&path, &place.join("case")).map_err(unusable)?;
    let simulated = case.rule.ranks.iter().map(|&ranks| Ranks::Simulated { ranks, seed: SEED });
    let mut measures = CaseMeasures::default();
    for ranks in std::iter::once(Ranks::Serial).chain(simulated) {
        let place = bench.enter("counters/run").map_err(unusable)?;
        let options = RunOptions::new(&place, bench.options.limit);
        let report = match engine.run(&path, &Layout::on(ranks), &options) {
            Ok(completed) => completed.report,
            // The counters of the serial run do not need simulated ranks.
            Err(why) if matches!(why.end, End::Missing(_)) && ranks != Ranks::Serial => continue,
            Err(why) => return Err(why),
        };
        let prefix = match ranks {
            Ranks::Serial => String::new(),
            Ranks::Simulated { ranks, .. } | Ranks::Mpi(ranks) => format!("{ranks} ranks/"),
        };
        let serial = measures.digest.get_or_insert(report.digest.clone());
        let independent = engine.description().promises.is_independent_of(Independence::Ranks);
        if *serial != report.digest && independent {
            let digest = report.digest;
            let why = format!("on {ranks} has digest {digest}, which differs from the serial one");
            return Err(unusable(why));
        }
        if ranks == Ranks::Serial {
            measures.exact.insert("cells".into(), report.cells);
        }
        let counters = report.counters.into_iter();
        let total =
            |(name, ranks): (String, Vec<u64>)| (format!("{prefix}{name}"), ranks.iter().sum());
        measures.exact.extend(counters.map(total));
    }
    Ok(measures)
}

/// Compares all counters of both sides. A different digest or number of cells means a different mesh; the layer of
/// correctness decides whether it is correct.
fn compare(
    case: &Selected,
    old: &CaseMeasures,
    new: &CaseMeasures,
    tolerance: &Tolerance,
) -> Vec<Finding> {
    let name = &case.rule.name;
    let mut findings = Vec::new();
    let shown = |digest: &Option<String>| digest.clone().unwrap_or_else(|| "none".into());
    let (verdict, note) = match old.digest == new.digest {
        true => (Verdict::Unchanged, shown(&new.digest)),
        false => (
            Verdict::Changed,
            format!("different mesh: {} was {}", shown(&new.digest), shown(&old.digest)),
        ),
    };
    findings.push(Finding::without_numbers(name, "digest", verdict, note));
    let mut names: Vec<&String> = old.exact.keys().chain(new.exact.keys()).collect();
    names.sort();
    names.dedup();
    for metric in names {
        let finding = match (old.exact.get(metric), new.exact.get(metric)) {
            (Some(&old), Some(&new)) => {
                let found = Finding::exact(
                    name,
                    metric,
                    old,
                    new,
                    tolerance.of_metric(&case.rule, metric, tolerance.counters),
                );
                match metric == "cells" || metric.ends_with("leaves") {
                    true => not_work(found),
                    false => found,
                }
            }
            (None, Some(new)) => {
                Finding::without_numbers(name, metric, Verdict::Changed, format!("new, {new}"))
            }
            (Some(old), _) => Finding::without_numbers(
                name,
                metric,
                Verdict::Changed,
                format!("removed, was {old}"),
            ),
            (None, None) => continue,
        };
        findings.push(finding);
    }
    findings
}

/// The size of the mesh is a result, not a cost: a change is neither better nor worse.
fn not_work(finding: Finding) -> Finding {
    match finding.verdict {
        Verdict::Unchanged => finding,
        _ => Finding { verdict: Verdict::Changed, note: "different mesh".into(), ..finding },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::rules::CaseRule;

    fn measures(digest: &str, exact: &[(&str, u64)]) -> CaseMeasures {
        let exact = exact.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect();
        CaseMeasures { digest: Some(digest.into()), exact, ..CaseMeasures::default() }
    }

    #[test]
    fn every_change_is_shown_and_only_growth_fails() {
        let text = "name = 'c'\nlayers = []\ntolerance = { messages = 10.0 }";
        let rule: CaseRule = toml::from_str(text).unwrap();
        let case = Selected { rule, path: Ok("c.toml".into()) };
        let old =
            measures("aa", &[("cells", 8), ("rays", 6), ("4 ranks/messages", 10), ("words", 5)]);
        let new =
            measures("bb", &[("cells", 9), ("rays", 5), ("4 ranks/messages", 11), ("hops", 1)]);
        let verdicts: Vec<(String, Verdict)> = compare(&case, &old, &new, &Tolerance::default())
            .into_iter()
            .map(|finding| (finding.metric, finding.verdict))
            .collect();
        let expected = [
            ("digest", Verdict::Changed),
            ("4 ranks/messages", Verdict::Changed),
            ("cells", Verdict::Changed),
            ("hops", Verdict::Changed),
            ("rays", Verdict::Improvement),
            ("words", Verdict::Changed),
        ];
        assert_eq!(verdicts, expected.map(|(name, verdict)| (name.to_owned(), verdict)));
        let grown = compare(&case, &old, &measures("aa", &[("rays", 7)]), &Tolerance::default());
        assert!(grown.iter().any(|f| f.metric == "rays" && f.verdict == Verdict::Regression));
    }
}
