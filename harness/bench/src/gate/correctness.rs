//! The layer of correctness: `harness verify` on candidate and baseline and the gate's cases, serially and on the ranks of the rules.
//!
//! A mesher whose baseline fails checks passes if it fails none that the baseline holds, and none with more findings. A check that had
//! nothing to check is compared only if the baseline's had nothing either: what a mesh no longer states cannot be found wrong.

use super::Bench;
use super::measures::LayerName;
use super::report::{CHECKS, GateFinding, Layer, Verdict};
use super::rules::GateCase;
use check::checks::CHECKS as CHECKS_OF_MESHES;
use contract::failure::{Failure, Result};
use run::engine::runner::{Engine, Programs};
use run::verify::options::Options;
use run::verify::report::{CaseReport, Check, Outcome, RUNS};
use run::verify::verify;
use std::cmp::Ordering;

/// Verifies both programs on the cases of this layer: every check of what it promises. Oracles and p4est are left to
/// `harness verify`.
///
/// # Errors
/// If verification cannot start.
pub fn layer(bench: &Bench, layer: &mut Layer) -> Result<()> {
    for case in bench.cases_of(LayerName::Correctness) {
        let report = verified(bench, &bench.candidate.engine, case)?;
        let baseline = bench.baseline.as_ref().map(|it| verified(bench, &it.engine, case));
        layer.findings.extend(findings(case, &report, baseline.transpose()?.as_ref()));
    }
    Ok(())
}

/// Verifies a program on a case.
fn verified(bench: &Bench, engine: &Engine, case: &GateCase) -> Result<CaseReport> {
    let mut programs = Programs { engine: engine.clone(), ..bench.programs.clone() };
    // Ranks that stay save nothing in one run per number of ranks, and an older program may not know their option.
    programs.engine.description.run.serve.clear();
    let options = Options {
        timeout: bench.options.timeout,
        // The files of a case that fails end with the gate.
        out: Some(bench.place.join("correctness")),
        no_mpi: case.mpi.is_empty(),
        ranks: Some(case.mpi.clone()),
        // `harness verify` varies the partition.
        partitioners: Some(vec!["morton".to_owned()]),
        level_bases: Some(vec!["auto".to_owned()]),
        ..Options::of_leaves_alone(vec![case.file.to_string_lossy().into_owned()])
    };
    let mut cases = verify(&options, &programs)?.cases.into_iter();
    cases.next().ok_or_else(|| Failure::input(format!("{} was not verified", case.name)))
}

/// A finding for each check that was run, and for the serial mesh or a number of ranks without one.
fn findings(
    GateCase { name: case, mpi, .. }: &GateCase,
    report: &CaseReport,
    baseline: Option<&CaseReport>,
) -> Vec<GateFinding> {
    if let Some(why) = &report.input_error {
        return vec![GateFinding::noted(case, CHECKS, Verdict::Regression, why)];
    }
    let mut all = Vec::new();
    for ranks in std::iter::once(None).chain(mpi.iter().copied().map(Some)) {
        let checks = || report.checks.iter().filter(|check| check.ranks == ranks);
        let of_ranks = CaseReport { checks: checks().cloned().collect(), ..CaseReport::default() };
        if !of_ranks.is_checked() {
            let metric = ranks.map_or(CHECKS.into(), |ranks| format!("{ranks} MPI ranks/{CHECKS}"));
            let why = checks().next().map_or("no check was run", first_line);
            all.push(GateFinding::noted(case, &metric, Verdict::Missing, why));
        }
        all.extend(checks().filter_map(|check| finding(case, check, baseline)));
    }
    // The reference makes no large mesh, for instance.
    let is_gone = |old: &Check| report.checks.iter().all(|new| key(new) != key(old));
    let is_lost = |old: &&Check| is_of_mesh(old) && count(old).is_some() && is_gone(old);
    let lost: Vec<_> = baseline.iter().flat_map(|of| &of.checks).filter(is_lost).map(key).collect();
    if !lost.is_empty() && all.iter().all(|finding| finding.verdict < Verdict::Missing) {
        let why = format!("only the baseline's mesh has these checks: {}", lost.join(", "));
        all.push(GateFinding::noted(case, CHECKS, Verdict::Missing, why));
    }
    all
}

fn is_of_mesh(check: &Check) -> bool {
    CHECKS_OF_MESHES.iter().any(|of_mesh| of_mesh.name == check.name)
}

/// The comparison of a check; `None` of one that was left out.
fn finding(case: &str, check: &Check, baseline: Option<&CaseReport>) -> Option<GateFinding> {
    let (metric, why) = (key(check), first_line(check));
    let noted = |verdict, note: String| GateFinding::noted(case, &metric, verdict, note);
    let before = baseline.and_then(|report| report.checks.iter().find(|old| key(old) == metric));
    let old = before.and_then(count);
    let Some(new) = count(check) else {
        let note = || format!("the baseline's is checked, and the candidate's is not: {why}");
        return (is_of_mesh(check) && old.is_some()).then(|| noted(Verdict::Missing, note()));
    };
    let verdict = match new.cmp(&old.unwrap_or(0)) {
        Ordering::Less => Verdict::Improvement,
        Ordering::Equal if old.is_none() => Verdict::Measured,
        Ordering::Equal => Verdict::Unchanged,
        Ordering::Greater => Verdict::Regression,
    };
    Some(match (baseline, old) {
        (None, _) => GateFinding { compared: 1, ..noted(verdict, why.to_owned()) },
        (_, Some(1..)) if check.name == RUNS => {
            let who = if new > 0 { "neither program makes" } else { "the baseline does not make" };
            let why = before.filter(|old| old.failed()).map_or(why, first_line);
            noted(Verdict::Missing, format!("{who} a mesh: {why}"))
        }
        (_, None) => {
            let ended = before.map_or("its verification ended before", first_line);
            let why = if why.is_empty() { ended } else { why };
            noted(verdict, format!("the baseline's was not checked: {why}"))
        }
        (_, Some(old)) => noted(verdict, why.to_owned()).of_values([old, new].map(|n| n as f64)),
    })
}

fn key(check: &Check) -> String {
    format!("{}: {}", check.subject, check.name)
}

/// Why a check fails, or was left out.
fn first_line(check: &Check) -> &str {
    match &check.outcome {
        Outcome::Fail { why } | Outcome::LeftOut { why } => why.lines().next().unwrap_or_default(),
        _ => "",
    }
}

/// The number of findings of a check, at least 1 if it fails; `None` if it was left out.
fn count(check: &Check) -> Option<u64> {
    match check.outcome {
        Outcome::LeftOut { .. } => None,
        Outcome::Fail { .. } => Some(check.findings.max(1)),
        _ => Some(0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The case, on these ranks of MPI.
    fn on(mpi: &[usize]) -> GateCase {
        GateCase { name: "c".to_owned(), mpi: mpi.to_vec(), ..GateCase::default() }
    }

    fn case(failed: &[(&str, u64)]) -> CaseReport {
        let check = |&(name, findings): &(&str, u64)| Check {
            findings,
            ..Check::new("serial", name, Outcome::fail("here\nthere"))
        };
        let mut checks: Vec<Check> = failed.iter().map(check).collect();
        for name in ["layer", "spacing", "balance"] {
            if failed.iter().all(|(other, _)| *other != name) {
                checks.push(Check::new("serial", name, Outcome::held(1)));
            }
        }
        CaseReport { name: "c".into(), checks, ..CaseReport::default() }
    }

    /// The worst finding.
    fn against(case: &CaseReport, baseline: &CaseReport) -> GateFinding {
        let all = findings(&on(&[]), case, Some(baseline));
        all.into_iter().max_by_key(|finding| finding.verdict).unwrap()
    }

    #[test]
    fn a_baseline_without_a_mesh_is_compared_with_nothing() {
        let checks = vec![Check::new("serial", RUNS, Outcome::fail("it crashes"))];
        let baseline = CaseReport { name: "c".into(), checks, ..CaseReport::default() };
        let mut candidate = case(&[]);
        candidate.checks.push(Check::new("serial", RUNS, Outcome::held(2)));
        let all = findings(&on(&[]), &candidate, Some(&baseline));
        assert!(all.iter().all(|finding| finding.compared == 0), "{all:?}");
        let other = all.iter().find(|finding| finding.metric == "serial: layer").unwrap();
        assert!(other.note.ends_with("not checked: its verification ended before"), "{other:?}");
        let worst = all.iter().max_by_key(|finding| finding.verdict).unwrap();
        assert_eq!(worst.verdict, Verdict::Missing);
        assert_eq!(worst.note, "the baseline does not make a mesh: it crashes");
        let worse = against(&case(&[("layer", 7)]), &baseline);
        assert_eq!((worse.verdict, worse.compared), (Verdict::Regression, 0));
    }

    #[test]
    fn a_check_that_only_the_baseline_has_is_missing() {
        let mut baseline = case(&[]);
        baseline.checks.push(Check::new("base tree", "identical", Outcome::held(1)));
        let worst = against(&case(&[]), &baseline);
        assert_eq!(worst.verdict, Verdict::Missing);
        assert!(worst.note.ends_with("has these checks: base tree: identical"), "{worst:?}");
        // What is worse needs no such line.
        let all = findings(&on(&[]), &case(&[("layer", 1)]), Some(&baseline));
        assert!(all.iter().all(|finding| finding.verdict != Verdict::Missing), "{all:?}");
    }

    #[test]
    fn only_new_and_more_findings_are_a_regression() {
        let baseline = case(&[("layer", 7), ("spacing", 2)]);
        let of = |failed: &[(&str, u64)]| against(&case(failed), &baseline).verdict;
        assert_eq!(of(&[("layer", 7), ("spacing", 2)]), Verdict::Unchanged);
        assert_eq!(of(&[("layer", 6), ("spacing", 2)]), Verdict::Unchanged);
        assert_eq!(of(&[("layer", 8), ("spacing", 1)]), Verdict::Regression);
        assert_eq!(of(&[("layer", 1), ("sides", 1)]), Verdict::Regression);
        let better = findings(&on(&[]), &case(&[("layer", 6)]), Some(&baseline));
        let improved = better.iter().filter(|found| found.verdict == Verdict::Improvement);
        assert_eq!(improved.count(), 2);
        let worse = against(&case(&[("sides", 1)]), &baseline);
        assert_eq!(
            (worse.metric.as_str(), worse.note.as_str()),
            ("serial: sides", "the baseline's was not checked: here")
        );
    }

    #[test]
    fn without_a_baseline_a_failed_check_is_a_regression() {
        let verdicts = |of: &CaseReport| -> Vec<Verdict> {
            findings(&on(&[]), of, None).iter().map(|found| found.verdict).collect()
        };
        assert_eq!(verdicts(&case(&[])), [Verdict::Measured; 3]);
        assert!(verdicts(&case(&[("layer", 1)])).contains(&Verdict::Regression));
    }

    #[test]
    fn a_check_that_the_baseline_has_and_the_candidate_leaves_out_is_missing() {
        let (all, mut without) = (case(&[]), case(&[]));
        without.checks[0].outcome = Outcome::left_out("the sides of the leaves are unknown");
        let missing = against(&without, &all);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(missing.metric, "serial: layer");
        assert!(missing.note.ends_with("the sides of the leaves are unknown"), "{}", missing.note);
        assert_eq!(against(&without, &without).verdict, Verdict::Unchanged);
        assert_eq!(against(&all, &without).verdict, Verdict::Unchanged);
        let mut none = case(&[]);
        none.checks.iter_mut().for_each(|check| check.outcome = Outcome::left_out("no mesh"));
        assert_eq!(against(&none, &none).verdict, Verdict::Missing, "nothing was checked");
        let ranks = findings(&on(&[2]), &all, Some(&all));
        assert!(ranks.iter().any(|found| found.metric == "2 MPI ranks/checks"), "{ranks:?}");
    }

    #[test]
    fn two_programs_without_a_mesh_cannot_be_compared() {
        let without = case(&[(RUNS, 1)]);
        let missing = against(&without, &without);
        assert_eq!((missing.verdict, missing.compared), (Verdict::Missing, 0));
        assert_eq!(against(&without, &case(&[])).verdict, Verdict::Regression);
    }
}
