//! The self test at scale, with meshes that are small enough for every test run.

use crate::support;
use check::selftest::scale::{self, Options, Source};
use check::selftest::{self, SelftestCase, SelftestReport};
use contract::testing::assert_text;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Every corruption that a mesh can have applies to at least one of these cases. The first has more than 20 000
/// leaves.
const CASES: [(&str, &str); 6] = [
    // The faces of the cube bisect octants, so that eight siblings are crossing.
    (
        "outside",
        "spacing_min = 0.05\nlayer_cells_min = 3\n[root]\norigin = [-3.45, -3.45, -3.45]\nedge = 6.4\n\
         [generator]\nshape = \"cube\"\nfacets = 12\n",
    ),
    ("inside", include_str!("../../../selftest-cases/inside.toml")),
    ("all", include_str!("../../../selftest-cases/all.toml")),
    ("boxes", include_str!("../../../selftest-cases/boxes.toml")),
    ("enclosed", include_str!("../../../selftest-cases/enclosed.toml")),
    ("seeds", include_str!("../../../selftest-cases/seeds.toml")),
];

fn written(name: &str, correct: &SelftestCase, place: &Path) -> Source {
    let write = |what: &str, set: &contract::leafset::LeafSet| {
        let dir = place.join(format!("{name}-{what}"));
        std::fs::create_dir(&dir).unwrap();
        set.write(&dir).unwrap();
        dir
    };
    let (mesh, base) = (write("mesh", &correct.mesh), write("base", &correct.base));
    Source { name: name.to_owned(), mesh, base: Some(base) }
}

fn run(sources: &[Source], seed: u64, jobs: usize) -> SelftestReport {
    let scratch = tempfile::tempdir().unwrap();
    let options = Options { seed, jobs, interrupted: || false };
    let trials = sources.len() * selftest::catalogue().len();
    let finished = AtomicUsize::new(0);
    let progress = |done: usize, all: usize| {
        assert!(all == trials && (1..=all).contains(&done), "{done} of {all}");
        finished.fetch_add(1, Ordering::Relaxed);
    };
    let report = scale::run(sources, &options, scratch.path(), &progress).unwrap();
    let finished = finished.into_inner();
    // A mesh that is already wrong is not tried.
    assert!(
        finished == trials || report.kills.is_empty() && finished == 0,
        "{finished} of {trials}"
    );
    let left: Vec<_> = std::fs::read_dir(scratch.path()).unwrap().collect();
    assert!(left.is_empty(), "scratch files remain: {left:?}");
    report
}

#[test]
fn every_corruption_that_a_mesh_can_have_is_planted_and_reported() {
    let place = tempfile::tempdir().unwrap();
    let sources = CASES.map(|(name, text)| {
        let correct = support::selftest_case(name, text);
        let leaves = correct.mesh.words.len();
        assert!(name != "outside" || leaves > 20_000, "{leaves}");
        written(name, &correct, place.path())
    });
    let report = run(&sources, 1, 2);
    println!("{report}");
    assert!(report.holds(), "{report}");
    for mutant in selftest::catalogue() {
        let planted = report.kills.iter().any(|kill| kill.mutant == mutant.name);
        assert!(planted || !mutant.audit, "{} was not planted", mutant.name);
        let of_base =
            mutant.name.contains("T0") && report.left_out.iter().any(|l| l.0 == mutant.name);
        assert!(planted || of_base, "{} was left out", mutant.name);
    }
    for (name, reason) in &report.left_out {
        assert!(!reason.contains("unknown"), "T0 is known, {name}: {reason}");
    }
    // Manifests agree with corrupted leaves, so no digest shows the corruption.
    let of_leaves = |kill: &&selftest::Kill| {
        !["manifest", "files"].contains(&kill.expected) && !kill.mutant.starts_with("part ")
    };
    for kill in report.kills.iter().filter(of_leaves).filter(|k| !k.mutant.starts_with("manifest"))
    {
        assert!(!kill.audit_caught_by.contains(&"manifest"), "{}: {:?}", kill.mutant, kill.finding);
    }
}

#[test]
fn a_mesh_without_its_base_tree_is_corrupted_in_every_other_way() {
    let place = tempfile::tempdir().unwrap();
    let correct = support::selftest_case(CASES[3].0, CASES[3].1);
    let source = Source { base: None, ..written("boxes", &correct, place.path()) };
    let report = run(&[source], 1, 1);
    assert!(report.holds(), "{report}");
    assert!(report.kills.len() > 30, "{report}");
    assert_text(&report.to_string(), "tests/checks/expected/at-scale-without-base.txt");
    for (name, reason) in &report.left_out {
        assert!(!name.starts_with("T0 ") || reason.contains("T0"), "{name}: {reason}");
    }
}

#[test]
fn windows_depend_on_the_seed_and_not_on_the_number_of_jobs() {
    let place = tempfile::tempdir().unwrap();
    let (name, text) = CASES[0];
    let source = [written(name, &support::selftest_case(name, text), place.path())];
    let (one, two, other) = (run(&source, 1, 1), run(&source, 1, 2), run(&source, 2, 2));
    assert_eq!(one.to_string(), two.to_string());
    assert_ne!(one.to_string(), other.to_string());
}

#[test]
fn a_mesh_that_is_already_wrong_fails_the_self_test() {
    let place = tempfile::tempdir().unwrap();
    let (name, text) = CASES[2];
    let correct = support::selftest_case(name, text);
    let mut wrong_manifest = correct.clone();
    wrong_manifest.mesh.manifest.leaves_by_side.crossing += 1;
    let mut unsorted = correct;
    unsorted.mesh.parts[0].reverse();
    for (name, correct, check) in
        [("wrong-manifest", wrong_manifest, "manifest"), ("unsorted", unsorted, "linear")]
    {
        let report = run(&[written(name, &correct, place.path())], 1, 1);
        assert!(!report.holds() && report.kills.is_empty());
        assert!(report.alarms.iter().any(|alarm| alarm.contains(check)), "{:?}", report.alarms);
    }
}
