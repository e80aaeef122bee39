//! The layers of numbers with a tolerance: counters and peak memory of the program, serially and on ranks, and what valgrind
//! counts. Numbers are compared by name; one that the candidate no longer has is missing, and a new one is a change.

use super::Bench;
use super::measures::{CaseMeasures, LayerName, Measures};
use super::report::{GateFinding, Layer, Verdict, change_percent};
use super::rules::{GateCase, Tolerance};
use super::subject::Counted;
use crate::emptied;
use check::promises::Independence;
use contract::number::grouped;
use run::engine::failure::Failure;
use run::engine::layout::{Layout, Ranks, RunOptions, SERIAL};
use run::engine::process::{self, Watch};
use run::engine::runner::Engine;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The number of cells, which is known of every program.
const CELLS: &str = "cells";
/// The counter of the cells of every rank.
const LEAVES: &str = "leaves";
/// Peak memory of all ranks together.
pub const MEMORY: &str = "peak_rss_bytes";
/// Growth of the memory that is never reported: addresses and the sharing of pages make that much difference.
const MEMORY_NOISE_BYTES: u64 = 1 << 20;
/// How often memory that grew is measured again at most, in both programs.
const CONFIRMATIONS: usize = 5;
const VALGRIND: &str = "valgrind";
const INSTRUCTIONS: &str = "instructions";

/// Compares the numbers of a layer.
pub(super) fn layer(bench: &Bench, measures: &mut Measures, layer: &mut Layer) {
    let name = layer.name;
    if name == LayerName::Instructions && run::engine::paths::on_path(VALGRIND).is_none() {
        layer.left_out = Some("valgrind is not on the PATH".to_owned());
        return;
    }
    for case in bench.cases_of(name) {
        let old = bench.baseline.as_ref().map(|subject| bench.measured(subject, case, name));
        let new = bench.measured(&bench.candidate, case, name);
        if new.as_ref().is_err_and(Failure::is_interrupt) {
            break;
        }
        if let Ok(new) = &new {
            let of_case = measures.cases.entry(case.name.clone()).or_default();
            match name {
                LayerName::Instructions => of_case.counted.clone_from(&new.counted),
                // This layer and another one before that of instructions are of the same runs.
                _ => of_case.clone_from(new),
            }
        }
        let found = match (old, new) {
            (Some(Ok(old)), Ok(new)) => judged(bench, case, name, [old, new]),
            (None, Ok(new)) => {
                let compared = new.of_layer(name).len() as u64;
                let verdict = if compared == 0 { Verdict::Missing } else { Verdict::Measured };
                let why = format!("{compared} quantities");
                let found = GateFinding::noted(&case.name, &name.to_string(), verdict, why);
                Ok(vec![GateFinding { compared, ..found }])
            }
            (Some(Err(why)), Ok(_)) => Err((Verdict::Missing, "the baseline has no", why)),
            (Some(Err(_)), Err(why)) => Err((Verdict::Missing, "neither program has a", why)),
            (_, Err(why)) => Err((Verdict::Regression, "the candidate has no", why)),
        };
        layer.findings.extend(found.unwrap_or_else(|(verdict, who, why)| {
            vec![GateFinding::noted(&case.name, "runs", verdict, format!("{who} result: {why}"))]
        }));
    }
}

/// Why there is nothing to compare: the verdict, whose result is missing, and the cause.
type NoResult = (Verdict, &'static str, Failure);

/// The findings on two measurements of a case. Sampling misses some peaks of memory and invents none, so growth counts only if the highest
/// of several runs has it.
fn judged(
    bench: &Bench,
    case: &GateCase,
    layer: LayerName,
    mut pair: [CaseMeasures; 2],
) -> Result<Vec<GateFinding>, NoResult> {
    let is_accepted = bench.options.accept_meshes;
    let compared = |[old, new]: &[CaseMeasures; 2]| {
        compare(&case.name, layer, [old, new], &bench.rules.tolerance, is_accepted)
    };
    let mut findings = compared(&pair);
    let of_runs = if layer == LayerName::Memory { CONFIRMATIONS } else { 0 };
    for _ in 0..of_runs {
        if !findings.iter().any(|finding| finding.verdict == Verdict::Regression) {
            break;
        }
        let subjects = bench.baseline.iter().chain([&bench.candidate]);
        let repeated = [
            (Verdict::Missing, "a repetition of the baseline has no"),
            (Verdict::Regression, "a repetition has no"),
        ];
        for ((of, subject), (verdict, who)) in pair.iter_mut().zip(subjects).zip(repeated) {
            let again = count(bench, &subject.engine, case).map_err(|why| (verdict, who, why))?;
            for (metric, bytes) in again.memory {
                let highest = of.memory.entry(metric).or_default();
                *highest = bytes.max(*highest);
            }
        }
        findings = compared(&pair);
    }
    Ok(findings)
}

/// Compares two measurements of a case. If both together have numbers beside the cells, they must share one of them.
fn compare(
    case: &str,
    layer: LayerName,
    [old, new]: [&CaseMeasures; 2],
    tolerance: &Tolerance,
    is_accepted: bool,
) -> Vec<GateFinding> {
    let noted = |metric: &str, verdict, note| GateFinding::noted(case, metric, verdict, note);
    if let (Some(one), Some(other)) = (&old.geometry, &new.geometry)
        && one != other
    {
        let why = format!("other facets were read: their digest is {other}, and was {one}");
        return vec![noted("geometry", Verdict::Missing, why)];
    }
    let meshes = [old, new].map(|of| (of.digest.as_deref(), of.exact.get(CELLS).copied()));
    if let Some((verdict, why)) = other_mesh(meshes, is_accepted) {
        return vec![noted("digest", verdict, why)];
    }
    let mesh = (layer == LayerName::Counters).then(|| same_mesh(case, [&old.digest, &new.digest]));
    let mut findings: Vec<GateFinding> = mesh.flatten().into_iter().collect();
    let [old, new] = [old, new].map(|of| of.of_layer(layer));
    let names: BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    let is_shared = |name: &String| old.contains_key(name) && new.contains_key(name);
    let mut counters = names.iter().filter(|name| **name != CELLS).peekable();
    if names.is_empty() || counters.peek().is_some() && !counters.any(|name| is_shared(name)) {
        let why = format!("no quantity but {CELLS} is in both programs' reports");
        findings.push(noted(&layer.to_string(), Verdict::Missing, why));
    }
    findings.extend(names.into_iter().map(|metric| match [old, new].map(|of| of.get(metric)) {
        [Some(&old), Some(&new)] => {
            let tolerance = tolerance.of_metric(metric, layer);
            let (verdict, note) = verdict(layer, metric, [old, new], tolerance);
            noted(metric, verdict, note).of_values([old as f64, new as f64])
        }
        [Some(old), None] => noted(metric, Verdict::Missing, gone(old)),
        [None, new] => noted(metric, Verdict::Changed, format!("new, {}", new.unwrap_or(&0))),
    }));
    findings
}

/// The digest and the number of cells of a mesh, as far as they are known.
pub(super) type Mesh<'a> = (Option<&'a str>, Option<u64>);

/// Why numbers of two programs are not comparable: their meshes have different digests, or different numbers of cells and not both a digest.
/// The layer of correctness decides which of them is correct.
pub(super) fn other_mesh([old, new]: [Mesh; 2], is_accepted: bool) -> Option<(Verdict, String)> {
    let (what, old, new) = match (old, new) {
        ((Some(old), _), (Some(new), _)) => ("digest", old.to_owned(), new.to_owned()),
        ((_, Some(old @ 1..)), (_, Some(new @ 1..))) => ("cells", grouped(old), grouped(new)),
        _ => return None,
    };
    let why = "the mesh is another one, so that its numbers are not comparable";
    let verdict = if is_accepted { Verdict::Accepted } else { Verdict::Missing };
    (old != new).then(|| (verdict, format!("{why}: {what} {new}, and {old} in the baseline")))
}

/// The finding on a digest that is the same if both sides have one. `None` if neither has.
fn same_mesh(case: &str, digests: [&Option<String>; 2]) -> Option<GateFinding> {
    let (verdict, note) = match digests {
        [None, None] => return None,
        [Some(_), Some(new)] => (Verdict::Unchanged, new.clone()),
        [Some(old), None] => (Verdict::Missing, gone(old)),
        [None, Some(new)] => (Verdict::Changed, format!("new, {new}")),
    };
    let compared = digests.iter().all(|digest| digest.is_some()).into();
    Some(GateFinding { compared, ..GateFinding::noted(case, "digest", verdict, note) })
}

/// What is said of a quantity that the candidate no longer has.
fn gone(old: impl Display) -> String {
    format!("the candidate does not report it; it was {old}")
}

/// The verdict on a number with a tolerance in percent, and the reason.
fn verdict(layer: LayerName, metric: &str, values: [u64; 2], tolerance: f64) -> (Verdict, String) {
    let [old, new] = values;
    let change = change_percent(old as f64, new as f64);
    // Rounding: 11 / 10 - 1 exceeds 0.1 in binary.
    let is_within = change.is_some_and(|by| by.abs() <= tolerance + 1e-9);
    let is_noise = layer == LayerName::Memory && new.saturating_sub(old) <= MEMORY_NOISE_BYTES;
    match () {
        () if old == new => (Verdict::Unchanged, String::new()),
        // The size of the mesh is a result, not a cost: a change is neither better nor worse.
        () if matches!(metric.rsplit('/').next(), Some(CELLS | LEAVES)) => {
            (Verdict::Changed, "another number of leaves".to_owned())
        }
        () if is_within && layer == LayerName::Counters => {
            (Verdict::Changed, format!("within the tolerance of {tolerance} %"))
        }
        () if new < old && !is_within => (Verdict::Improvement, String::new()),
        // Noise within the tolerance is not worth a line.
        () if is_within || is_noise => (Verdict::Unchanged, String::new()),
        () => (Verdict::Regression, format!("exceeds the tolerance of {tolerance} %")),
    }
}

/// Counters and memory of a program on a case. Digests of all rank counts must be the same if the engine promises that.
pub(super) fn count(bench: &Bench, engine: &Engine, case: &GateCase) -> Counted {
    let path = bench.prepare(engine, case, "counters")?;
    let mut measures = CaseMeasures::default();
    for ranks in case.layouts() {
        let place = emptied(bench.place.join("counters/run"), engine)?;
        let options = RunOptions::new(&place, bench.options.timeout);
        let report = engine.run(&path, &Layout::on(ranks), &options)?.report;
        let independent = engine.description.promises.is_independent_of(Independence::Ranks);
        // Of a report without a digest, the layer of correctness compares the mesh.
        if let Some(digest) = &report.digest {
            let all = measures.digest.get_or_insert(digest.clone());
            if all != digest {
                if independent {
                    let why = "which differs from the serial one";
                    return Err(engine.unusable(format!("on {ranks} has digest {digest}, {why}")));
                }
                // The numbers of all meshes are compared together.
                *all += &format!(", {digest} on {ranks}");
            }
        }
        let prefix = prefix(ranks);
        if ranks == Ranks::Serial {
            measures.exact.insert(CELLS.into(), report.cells);
            measures.geometry = report.geometry.as_ref().map(|geometry| geometry.digest.clone());
        }
        let bytes = report.peak_rss_bytes_total();
        measures.memory.extend((bytes > 0).then(|| (format!("{prefix}{MEMORY}"), bytes)));
        let is_of_ranks = |of: &&Vec<u64>| of.len() > 1 && of.len() == ranks.count();
        // The same leaves on fewer of the ranks take longer.
        let most = report.counters.get(LEAVES).filter(is_of_ranks).and_then(|of| of.iter().max());
        measures.exact.extend(most.map(|most| (format!("{prefix}{LEAVES}_max"), *most)));
        for (name, of) in report.counters {
            // A list without a rank counts nothing, not 0.
            let Some(most) = of.iter().max() else { continue };
            let of_all = if name.ends_with("_max") { *most } else { of.iter().sum() };
            measures.exact.insert(format!("{prefix}{name}"), of_all);
        }
    }
    Ok(measures)
}

/// The beginning of the names of quantities on these ranks.
pub(super) fn prefix(ranks: Ranks) -> String {
    match ranks {
        Ranks::Serial => String::new(),
        Ranks::Simulated { ranks, .. } => format!("{ranks} ranks/"),
        Ranks::Mpi(ranks) => format!("{ranks} MPI ranks/"),
    }
}

/// Instructions of a serial run under valgrind, of all its processes. They do not depend on the load of
/// the machine, so a difference of a percent is significant.
pub(super) fn instructions(bench: &Bench, engine: &Engine, case: &GateCase) -> Counted {
    let path = bench.prepare(engine, case, "instructions")?;
    let place = bench.place.join("instructions");
    let profiles = emptied(place.join("profiles"), engine)?;
    // Without output files, the count is that of meshing alone.
    let options = RunOptions { report: false, ..RunOptions::new(&place, bench.options.timeout) };
    let plain = engine.command(&path, &SERIAL, &options)?;
    let mut command = Command::new(VALGRIND);
    // The program may be started by a script, and may start others.
    command.args(["--tool=callgrind", "--compress-pos=no", "--trace-children=yes"]);
    command.arg(format!("--callgrind-out-file={}/callgrind.out.%p", profiles.display()));
    command.arg(plain.get_program()).args(plain.get_args());
    command.envs(plain.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let counted = process::run(&mut command, &Watch::new(VALGRIND, bench.options.timeout, &place));
    // A program that fails without valgrind, too, states the cause; else it reports of which mesh the count is. It may need an empty place.
    let again = place.join("again");
    let options = RunOptions::new(&again, bench.options.timeout);
    let report = engine.run(&path, &SERIAL, &options)?.report;
    counted?;
    match counted_by_all(&profiles) {
        Ok(0) => Err(engine.unusable("has no profile with costs by valgrind".to_owned())),
        Ok(count) => Ok(CaseMeasures {
            digest: report.digest,
            exact: [(CELLS.to_owned(), report.cells)].into(),
            counted: [(INSTRUCTIONS.to_owned(), count)].into(),
            ..CaseMeasures::default()
        }),
        Err(error) => Err(engine.unusable(format!("left no profile: {error}"))),
    }
}

/// The instructions of all processes, each with a profile. One that was replaced by another program has none.
fn counted_by_all(profiles: &Path) -> io::Result<u64> {
    let count = |path: PathBuf| fs::read_to_string(path).map(|profile| instructions_in(&profile));
    fs::read_dir(profiles)?.map(|entry| count(entry?.path())).sum()
}

/// The total of a profile of callgrind, in its last line.
fn instructions_in(profile: &str) -> u64 {
    let total = profile.lines().rev().find_map(|line| line.strip_prefix("totals:"));
    total.and_then(|total| total.trim().parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::measures::Numbers;
    use super::*;

    fn numbers(of: &[(&str, u64)]) -> Numbers {
        of.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect()
    }

    fn verdicts(layer: LayerName, old: &Numbers, new: &Numbers) -> Vec<(String, Verdict)> {
        let tolerance = Tolerance { memory: 0.0, ..Tolerance::default() };
        let tolerance = Tolerance { of: [("messages".to_owned(), 10.0)].into(), ..tolerance };
        let [old, new] = [old, new].map(|numbers| CaseMeasures {
            exact: numbers.clone(),
            memory: numbers.clone(),
            ..CaseMeasures::default()
        });
        let found = compare("c", layer, [&old, &new], &tolerance, false);
        found.into_iter().map(|finding| (finding.metric, finding.verdict)).collect()
    }

    #[test]
    fn every_change_is_shown_and_only_growth_and_loss_fail() {
        let mut old = numbers(&[("cells", 9), ("rays", 6), ("4 ranks/messages", 10)]);
        old.extend(numbers(&[("8 ranks/messages", 12), ("by/phase", 3), ("words", 5)]));
        let new = numbers(&[("cells", 9), ("rays", 5), ("4 ranks/messages", 11), ("hops", 1)]);
        let expected = [
            ("4 ranks/messages", Verdict::Changed),
            ("8 ranks/messages", Verdict::Missing),
            ("by/phase", Verdict::Missing),
            ("cells", Verdict::Unchanged),
            ("hops", Verdict::Changed),
            ("rays", Verdict::Improvement),
            ("words", Verdict::Missing),
        ];
        let found = verdicts(LayerName::Counters, &old, &new);
        assert_eq!(found, expected.map(|(name, verdict)| (name.to_owned(), verdict)));
        let grown = verdicts(LayerName::Counters, &old, &numbers(&[("rays", 7)]));
        assert!(grown.contains(&("rays".to_owned(), Verdict::Regression)));
    }

    #[test]
    fn numbers_of_another_mesh_are_not_comparable() {
        let of = |digest: Option<&str>, cells| CaseMeasures {
            digest: digest.map(str::to_owned),
            exact: numbers(&[("cells", cells), ("words", cells)]),
            memory: numbers(&[(MEMORY, cells << 20)]),
            counted: numbers(&[(INSTRUCTIONS, cells)]),
            ..CaseMeasures::default()
        };
        for (old, new, holds) in [
            (of(Some("a"), 80), of(Some("b"), 40), false),
            (of(Some("a"), 80), of(Some("b"), 80), false),
            (of(None, 80), of(Some("b"), 40), false),
            (of(None, 80), of(None, 40), false),
            (of(Some("a"), 80), of(Some("a"), 80), true),
            (of(None, 80), of(Some("b"), 80), true),
            (of(None, 0), of(None, 40), true),
        ] {
            for layer in [LayerName::Counters, LayerName::Memory, LayerName::Instructions] {
                let found = compare("c", layer, [&old, &new], &Tolerance::default(), false);
                let is_missing = found.iter().all(|finding| finding.verdict == Verdict::Missing);
                assert_eq!(is_missing, !holds, "{layer}: {found:?}");
                assert!(holds || found[0].note.contains("the mesh is another one"), "{found:?}");
            }
        }
    }

    #[test]
    fn programs_that_share_no_counter_are_not_compared() {
        let missing = ("counters".to_owned(), Verdict::Missing);
        let of = |old: &[(&str, u64)], new: &[(&str, u64)]| {
            verdicts(LayerName::Counters, &numbers(old), &numbers(new)).contains(&missing)
        };
        assert!(of(&[], &[("cells", 1), ("rays", 2)]), "a record without counters");
        assert!(of(&[("cells", 1), ("rays", 2)], &[("cells", 1)]), "counters that are gone");
        assert!(of(&[("cells", 1), ("rays", 2)], &[("cells", 1), ("hops", 2)]));
        assert!(!of(&[("cells", 1)], &[("cells", 1)]), "a program that counts nothing else");
        assert!(!of(&[("rays", 1), ("words", 2)], &[("rays", 1), ("hops", 2)]));
    }

    #[test]
    fn only_growth_beyond_the_tolerance_is_a_regression() {
        let of = |values, tolerance| verdict(LayerName::Counters, "m", values, tolerance).0;
        assert_eq!(of([100, 100], 0.0), Verdict::Unchanged);
        assert_eq!(of([100, 101], 0.0), Verdict::Regression);
        assert_eq!(of([100, 101], 1.5), Verdict::Changed);
        assert_eq!(of([100, 99], 0.0), Verdict::Improvement);
        assert_eq!(of([0, 0], 0.0), Verdict::Unchanged);
        assert_eq!(of([0, 1], 50.0), Verdict::Regression);
        // Of leaves, their number is no cost; what is done to them is one.
        let of = |name| verdict(LayerName::Counters, name, [100, 200], 0.0).0;
        assert_eq!(["4 ranks/leaves", "cells"].map(of), [Verdict::Changed; 2]);
        assert_eq!(of("4 ranks/visited_leaves"), Verdict::Regression);
    }

    #[test]
    fn a_profile_has_its_total_at_its_end() {
        let text = "version: 1\nevents: Ir\nsummary: 9\n\nfn=(1) main\n12 3\ntotals: 116\n";
        assert_eq!((instructions_in(text), instructions_in("events: Ir\n")), (116, 0));
    }

    #[test]
    fn memory_may_grow_by_noise_only() {
        let verdict = |old: u64, new: u64| {
            let of = |bytes| numbers(&[("2 MPI ranks/peak_rss_bytes", bytes)]);
            verdicts(LayerName::Memory, &of(old), &of(new))[0].1
        };
        assert_eq!(verdict(6 << 20, 7 << 20), Verdict::Unchanged);
        assert_eq!(verdict(6 << 20, 8 << 20), Verdict::Regression);
        assert_eq!(verdict(8 << 20, 6 << 20), Verdict::Improvement);
    }
}
