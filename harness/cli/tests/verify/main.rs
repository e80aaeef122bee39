//! `harness verify` as a user or a CI system sees it: exit codes, reports, hangs, what is left behind.
//!
//! Mesher, reference and `mpirun` are played by shell scripts, so that each can be made to fail in its way. The
//! case is the smallest there is: a cube within a root that is one single crossing leaf.

mod fixture;

use fixture::{Fixture, HANGS, HOLDS, REFUSES};
use quick_junit::{Report, TestCaseStatus};
use std::fs;

#[test]
fn all_holds() {
    let fixture = Fixture::new();
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(done.code, 0, "{}", done.printed);
    assert!(done.printed.contains("all hold"), "{}", done.printed);
    assert!(fixture.left_behind().is_empty(), "{:?}", fixture.left_behind());
}

#[test]
fn what_was_not_done_is_said_in_every_form() {
    let fixture = Fixture::new();
    let done = fixture.verify(&["--no-mpi", "--junit", "junit.xml", "--json", "report.json"]);
    assert!(done.printed.contains("left out: mpi because --no-mpi was given"), "{}", done.printed);
    assert!(done.printed.contains("left out: p4est because there is no"), "{}", done.printed);
    let junit = Report::deserialize_from_str(&fixture.read("junit.xml")).unwrap();
    let reasons: Vec<String> = junit.test_suites[0].test_cases.iter().filter_map(skipped).collect();
    assert_eq!(
        reasons.iter().filter(|why| *why == "left out: --no-mpi was given").count(),
        1,
        "{reasons:?}"
    );
    assert!(reasons.iter().any(|why| why.contains("ci/setup compiles it")), "{reasons:?}");
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    assert_eq!(json["schema"], "octree-verify/1");
    let checks = json["cases"][0]["checks"].as_array().unwrap();
    assert_eq!(checks.iter().filter(|check| check["outcome"] == "left_out").count(), reasons.len());
    let summary = fixture.read("summary.md");
    assert!(summary.contains("left out: mpi because --no-mpi was given"), "{summary}");
}

fn skipped(test: &quick_junit::TestCase) -> Option<String> {
    match &test.status {
        TestCaseStatus::Skipped { message, .. } => Some(message.as_ref()?.as_str().to_owned()),
        _ => None,
    }
}

#[test]
fn what_is_required_and_missing_is_exit_code_3() {
    let fixture = Fixture::new();
    let done = fixture.verify(&["--no-mpi", "--require", "p4est"]);
    assert_eq!(done.code, 3, "{}", done.printed);
    assert!(done.printed.contains("something required is missing"), "{}", done.printed);
    fixture.write("mesher", "#!/bin/sh\n");
    fs::remove_file(fixture.path("mesher")).unwrap();
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(
        (done.code, done.printed.contains("there is no mesher at")),
        (3, true),
        "{}",
        done.printed
    );
}

#[test]
fn a_case_that_all_refuse_is_the_users_error() {
    let fixture = Fixture::new();
    fixture.write("case.toml", "spacing_min = -1.0\n[generator]\nshape = \"cube\"\nfacets = 12\n");
    fixture.play("mesher", REFUSES);
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(done.code, 2, "{}", done.printed);
    assert!(done.printed.contains("input: case: spacing_min is negative"), "{}", done.printed);
}

#[test]
fn a_case_that_the_mesher_alone_refuses_is_a_failure() {
    let fixture = Fixture::new();
    fixture.play("mesher", REFUSES);
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(
        done.printed.contains("it refuses the case: spacing_min is negative"),
        "{}",
        done.printed
    );
}

#[test]
fn a_case_at_fault_that_the_mesher_takes_is_a_failure() {
    let fixture = Fixture::new();
    fixture.write("case.toml", "spacing_min = -1.0\n[generator]\nshape = \"cube\"\nfacets = 12\n");
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(done.printed.contains("the mesher takes a case that is at fault"), "{}", done.printed);
}

#[test]
fn an_unknown_case_is_the_users_error() {
    let fixture = Fixture::new();
    fixture.catalogue_of_one_absent();
    let done = fixture.harness(&["verify", "unheard-of"]);
    let why = "no case unheard-of in the catalogue, which has jet";
    assert_eq!(done.code, 2, "{}", done.printed);
    assert!(done.printed.contains(why), "{}", done.printed);
    assert_eq!(fixture.harness(&["verify", "--ranks", "none"]).code, 2);
}

#[test]
fn a_hang_is_killed_reported_and_kept() {
    let fixture = Fixture::new();
    fixture.play("mesher", HANGS);
    let done = fixture.verify(&["--no-mpi", "--timeout", "1", "--out", "out"]);
    assert_eq!(done.code, 1, "{}", done.printed);
    let why = "did not end within 1 s and was killed; ranks 0, 1 were in: layer 7";
    assert!(done.printed.contains(why), "{}", done.printed);
    assert!(
        done.printed.contains("repeat with: ") && done.printed.contains("--no-mpi --keep"),
        "{}",
        done.printed
    );
    // Where nobody waits for orphans, a dead one stays listed, as a zombie.
    let stat = format!("/proc/{}/stat", fixture.read("sleeper").trim());
    let asleep = fs::read_to_string(stat).is_ok_and(|stat| !stat.contains(") Z "));
    assert!(!asleep, "a process of the hung mesher is still there");
    assert!(fixture.path("out/case/timed/status/rank-00001.txt").is_file());
    for form in ["table.txt", "report.md", "junit.xml", "report.json"] {
        assert!(fixture.path("out").join(form).is_file(), "{form}");
    }
}

#[test]
fn a_mesh_that_depends_on_ranks_is_found() {
    let fixture = Fixture::new();
    fixture.play_mpirun();
    let good = fixture.verify(&[]);
    assert_eq!(good.code, 0, "{}", good.printed);
    fixture.play("mesher", &HOLDS.replace("from=", "[ \"$FAKE_RANKS\" = 3 ] && tree=other; from="));
    let done = fixture.verify(&["--json", "report.json", "--out", "out"]);
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(
        done.printed.contains("3 ranks, morton, base auto: identical: first difference"),
        "{}",
        done.printed
    );
    let repeat = "--ranks 3 --partitioners morton --level-bases auto --keep";
    assert!(done.printed.contains(repeat), "{}", done.printed);
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    let failed = json["cases"][0]["checks"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|check| check["outcome"] == "fail");
    assert_eq!(failed.map(|check| &check["ranks"]).collect::<Vec<_>>(), [3]);
    // The rank count that holds leaves nothing, the one that fails leaves its mesh.
    assert!(!fixture.path("out/case/ranks-2-morton-auto").exists());
    assert!(fixture.path("out/case/ranks-3-morton-auto/mesh/mesh.json").is_file());
}

#[test]
fn ranks_that_do_not_know_of_each_other_are_no_mpi() {
    let fixture = Fixture::new();
    fixture.play_mpirun();
    fixture.play("mesher", &HOLDS.replace("$FAKE_RANKS", ""));
    let done = fixture.verify(&["--require", "mpi"]);
    assert_eq!(done.code, 3, "{}", done.printed);
    assert!(done.printed.contains("it was built without MPI"), "{}", done.printed);
}

#[test]
fn a_record_that_is_not_the_mesh_s_is_found() {
    let fixture = Fixture::new();
    fixture.play("mesher", &HOLDS.replace("\"cells\": 1", "\"cells\": 2"));
    let done = fixture.verify(&["--no-mpi"]);
    assert_eq!(
        (done.code, done.printed.contains("reports 2 cells")),
        (1, true),
        "{}",
        done.printed
    );
}

#[test]
fn a_case_whose_geometry_is_absent_is_left_out_unless_required() {
    let fixture = Fixture::new();
    fixture.catalogue_of_one_absent();
    let rest = ["--no-mpi", "--no-oracles", "--no-p4est"];
    let done = fixture.harness(&[&["verify"], &rest[..]].concat());
    assert_eq!(done.code, 0, "{}", done.printed);
    assert!(
        done.printed.contains("left out: jet: case: geometry because fetched/jet.stl is not here"),
        "{}",
        done.printed
    );
    let done =
        fixture.harness(&[&["verify", "jet", "--require", "geometries"], &rest[..]].concat());
    assert_eq!(done.code, 3, "{}", done.printed);
}
