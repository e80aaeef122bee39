//! The self test on meshes of the reference: the responsible check reports every corruption, also of leaves in a larger mesh whose
//! many parts interleave, as ranks of a large run write them.

use crate::support;
use check::audit::audit_against;
use check::promises::Promises;
use check::selftest::{self, Kill, Mutant, Mutation, SelftestCase, SelftestReport};
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Tree};
use contract::testing::assert_text;
use contract::word;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The smallest mesh and the deepest: no search for a place to corrupt may leave the levels or the leaves.
const EXTREMES: [(&str, &str); 2] = [
    (
        "one leaf",
        "spacing_min = 8.0\nlayer_cells_min = 2\nkeep = \"all\"\nroot = { origin = [-4.0, -4.0, -4.0], edge = 8.0 }\n\
         generator = { shape = \"cube\", facets = 12 }\n",
    ),
    (
        "deepest level",
        "spacing_min = 1.0\nlayer_cells_min = 2\nkeep = \"all\"\nroot = { origin = [-3.5, -3.5, -3.5], edge = 524288.0 }\n\
         generator = { shape = \"cube\", facets = 12 }\n",
    ),
];

/// Every corruption that applies to a case is reported, by the checks and with the findings of the expected table, and the correct
/// mesh is not.
fn assert_reported(name: &str) {
    let scratch = tempfile::tempdir().unwrap();
    let mut report = selftest::run(&[support::built_in(name)], scratch.path()).unwrap();
    for finding in report.kills.iter_mut().filter_map(|kill| kill.finding.as_mut()) {
        *finding = finding.replace(&*scratch.path().to_string_lossy(), "SCRATCH");
    }
    let text = table(&report);
    println!("{report}");
    assert!(report.alarms.is_empty() && report.kills.iter().all(Kill::killed));
    let mut expected = include_str!("expected/reports.txt").split("== ");
    if expected.find_map(|part| part.strip_prefix(&format!("{name}\n"))) != Some(&text) {
        let found = std::env::temp_dir().join(format!("{name}.txt"));
        std::fs::write(&found, text).unwrap();
        panic!("{} differs from its part of tests/checks/expected/reports.txt", found.display());
    }
}

/// The trials, with the checks that reported each and the first finding of the expected one, and the report.
fn table(report: &SelftestReport) -> String {
    let mut text = String::new();
    let heads = ("corruption", "case", "expected");
    let width = |of: fn(&Kill) -> usize, head: &str| {
        report.kills.iter().map(of).fold(head.len(), usize::max)
    };
    let (name, case) = (width(|k| k.mutant.name.len(), heads.0), width(|k| k.case.len(), heads.1));
    text +=
        &format!("{:name$}  {:case$}  {:10}  {:8}  reported by\n", heads.0, heads.1, heads.2, "");
    for kill in &report.kills {
        let verdict = if kill.killed() { "killed" } else { "SURVIVED" };
        let by = kill.caught_by.join(", ");
        let audit =
            match kill.audit_caught_by.as_slice() {
                [] => String::new(),
                by => format!("; audit: {}", by.join(", ")),
            } + if kill.whole_audit_missed { "; missed by the audit with the case" } else { "" };
        let Kill { mutant: Mutant { name: mutant, expected, .. }, case: on, .. } = kill;
        text += &format!("{mutant:name$}  {on:case$}  {expected:10}  {verdict:8}  {by}{audit}\n");
        if let Some(finding) = &kill.finding {
            text += &format!("{:name$}  first finding: {}\n", "", one_line(finding));
        }
    }
    text + &report.to_string()
}

/// The beginning of a finding, on one line: some findings quote whole manifests.
fn one_line(finding: &str) -> String {
    const SHOWN: usize = 160;
    let flat = finding.replace('\n', " ");
    if flat.chars().count() <= SHOWN {
        flat
    } else {
        flat.chars().take(SHOWN).collect::<String>() + "..."
    }
}

#[test]
fn every_corruption_of_an_outer_flow_is_reported() {
    assert_reported("outside");
}

#[test]
fn every_corruption_of_an_inner_flow_is_reported() {
    assert_reported("inside");
}

#[test]
fn every_corruption_of_a_mesh_of_both_sides_is_reported() {
    assert_reported("all");
}

#[test]
fn every_corruption_of_a_mesh_with_boxes_is_reported() {
    assert_reported("boxes");
}

#[test]
fn every_corruption_of_a_mesh_with_enclosed_components_is_reported() {
    assert_reported("enclosed");
}

#[test]
fn every_corruption_of_a_mesh_with_seeds_is_reported() {
    assert_reported("seeds");
}

/// Otherwise a corruption could lose its effect, or change so much that any check reports it.
#[test]
fn every_corruption_changes_the_leaves_and_files_that_are_listed() {
    let mut lines = Vec::new();
    let built_in = selftest::cases();
    let built_in = built_in.iter().map(|(name, text)| (&name[..], &text[..]));
    let texts = built_in.chain(EXTREMES);
    let cases: Vec<SelftestCase> =
        texts.map(|(name, text)| in_parts(support::selftest_case(name, text))).collect();
    for mutant in selftest::catalogue() {
        let before = lines.len();
        for case in &cases {
            if let Some(mutation) = mutant.make(case) {
                lines.push(format!(
                    "{}, {}: {}",
                    mutant.name,
                    case.case.name,
                    effect(case, &mutation)
                ));
            }
        }
        assert!(lines.len() > before, "{} applies to no case", mutant.name);
    }
    assert_text(&(lines.join("\n") + "\n"), "tests/checks/expected/corruptions.txt");
}

/// The case with its mesh in three parts that interleave.
fn in_parts(case: SelftestCase) -> SelftestCase {
    let mut parts = vec![Vec::new(); 3];
    case.mesh.words.iter().for_each(|&w| parts[(w >> 58) as usize % 3].push(w));
    SelftestCase { mesh: case.mesh.with_parts(parts), ..case }
}

/// What a corruption changes: leaves, keys of the manifest, leaves of T0, files.
fn effect(correct: &SelftestCase, mutation: &Mutation) -> String {
    let mut parts = Vec::new();
    let (correct, tree) = (correct.set(mutation.tree), mutation.tree);
    let what = if tree == Tree::Base { "leaves of T0" } else { "leaves" };
    parts.extend(leaves(what, &correct.words, &mutation.mesh.words));
    parts.extend(keys(&correct.manifest, &mutation.mesh.manifest, !parts.is_empty()));
    if mutation.mesh.parts.iter().any(|part| !part.is_sorted()) {
        parts.push("a part is not sorted".to_owned());
    }
    if let Some(tamper) = mutation.tamper {
        let dir = tempfile::tempdir().unwrap();
        mutation.mesh.write(dir.path()).unwrap();
        let before = files(dir.path());
        tamper(dir.path()).unwrap();
        let after = files(dir.path());
        let names: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
        let bytes =
            |of: &Files, name| of.get(name).map_or("no".to_owned(), |f| f.len().to_string());
        let differing = names.into_iter().filter(|&name| before.get(name) != after.get(name));
        let file = |name| {
            format!("{name} has {} bytes instead of {}", bytes(&after, name), bytes(&before, name))
        };
        parts.extend(differing.map(file));
    }
    parts.join("; ")
}

/// The number of leaves that were removed and added, and the first of them.
fn leaves(what: &str, before: &[u64], after: &[u64]) -> Option<String> {
    let mut counts: BTreeMap<u64, i64> = BTreeMap::new();
    before.iter().for_each(|&word| *counts.entry(word).or_default() -= 1);
    after.iter().for_each(|&word| *counts.entry(word).or_default() += 1);
    counts.retain(|_, count| *count != 0);
    let sum = |sign: i64| counts.values().map(|count| (sign * count).max(0)).sum::<i64>();
    let first = *counts.keys().next()?;
    let (octant, side) = (word::octant(first).path(), first & word::SIDE_BITS);
    let (removed, added) = (sum(-1), sum(1));
    Some(format!("{removed} {what} removed, {added} added, from {octant} with side {side} on"))
}

/// The keys of the manifest that differ, without those that follow from the leaves if these differ.
fn keys(before: &Manifest, after: &Manifest, leaves_differ: bool) -> Option<String> {
    let [before, after] = [before, after].map(|m| serde_json::to_value(m).unwrap());
    let of_leaves =
        ["leaves", "leaves_by_level", "leaves_by_side", "digest", "octant_digests", "parts"];
    let names: BTreeSet<&String> =
        [&before, &after].iter().flat_map(|m| m.as_object().unwrap().keys()).collect();
    let differing: Vec<&str> = names
        .into_iter()
        .map(String::as_str)
        .filter(|&name| before.get(name) != after.get(name))
        .filter(|name| !(leaves_differ && of_leaves.contains(name)))
        .collect();
    (!differing.is_empty()).then(|| format!("manifest: {}", differing.join(", ")))
}

type Files = BTreeMap<String, Vec<u8>>;

fn files(dir: &Path) -> Files {
    let entries = std::fs::read_dir(dir).unwrap().map(Result::unwrap);
    let file = |entry: std::fs::DirEntry| {
        (entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).unwrap())
    };
    entries.map(file).collect()
}

/// The faces of the cube bisect octants, so that eight siblings are crossing.
const CUBE: &str = "spacing_min = 0.05\nlayer_cells_min = 3\n[root]\norigin = [-3.45, -3.45, -3.45]\nedge = 6.4\n\
                    [generator]\nshape = \"cube\"\nfacets = 12\n";
const PARTS: usize = 16;
/// Leaves that follow each other in a part: an odd number, so that siblings are in two parts.
const INTERVAL: usize = 173;

fn in_many_parts(set: &LeafSet) -> LeafSet {
    let mut parts = vec![Vec::new(); PARTS];
    for (i, interval) in set.words.chunks(INTERVAL).enumerate() {
        parts[i % PARTS].extend_from_slice(interval);
    }
    set.with_parts(parts)
}

/// The checks with findings.
fn found(set: &LeafSet, case: Option<&Case>) -> Vec<&'static str> {
    let dir = tempfile::tempdir().unwrap();
    set.write(dir.path()).unwrap();
    let definition = Promises::of_definition();
    let report = audit_against(dir.path(), case, &definition);
    report.checks.iter().filter(|check| !check.holds()).map(|check| check.name).collect()
}

#[test]
fn every_corruption_of_leaves_is_found_in_many_parts() {
    let mut correct = support::selftest_case("outside", CUBE);
    assert!(correct.mesh.words.len() > 20_000);
    correct.mesh = in_many_parts(&correct.mesh);
    assert_eq!(found(&correct.mesh, Some(&correct.case)), [""; 0]);
    assert_eq!(
        (found(&correct.base, None), found(&correct.base, Some(&correct.case))),
        (vec![], vec!["files"])
    );
    let mut planted = 0;
    for mutant in selftest::catalogue() {
        let Some(mutation) = mutant.make(&correct) else { continue };
        if mutation.tree == Tree::Base || mutation.mesh.words == correct.mesh.words {
            continue;
        }
        planted += 1;
        let wrong = in_many_parts(&mutation.mesh);
        let (alone, whole) = (found(&wrong, None), found(&wrong, Some(&correct.case)));
        assert!(!mutant.audit || alone.contains(&mutant.expected), "{}: {alone:?}", mutant.name);
        assert!(!whole.is_empty(), "{}", mutant.name);
    }
    assert!(planted > 25, "{planted}");
}
