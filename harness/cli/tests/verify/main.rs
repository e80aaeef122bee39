//! `harness verify` as a user or a CI system sees it: exit codes, reports, hangs, remaining files.
//!
//! Mesher, reference and `mpirun` are shell scripts, so that each can be made to fail in its own way. The case is
//! the smallest possible one: a cube in a root that is a single crossing leaf.

mod fixture;

use fixture::{Fixture, HANGS, HOLDS, REFUSES};
use quick_junit::{Report, TestCaseStatus};
use std::fs;
use std::process::Command;

#[test]
fn a_correct_mesher_passes() {
    let fixture = Fixture::new();
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    assert!(outcome.printed.contains("all hold"), "{}", outcome.printed);
    assert!(fixture.temporary_files().is_empty(), "{:?}", fixture.temporary_files());
}

#[test]
fn every_form_of_the_report_lists_skipped_checks() {
    let fixture = Fixture::new();
    let outcome = fixture.verify(&["--no-mpi", "--junit", "junit.xml", "--json", "report.json"]);
    assert!(
        outcome.printed.contains("left out: mpi because --no-mpi was given"),
        "{}",
        outcome.printed
    );
    assert!(
        outcome.printed.contains("left out: p4est because /nowhere/p4est is missing"),
        "{}",
        outcome.printed
    );
    let junit = Report::deserialize_from_str(&fixture.read("junit.xml")).unwrap();
    let reasons: Vec<String> = junit.test_suites[0].test_cases.iter().filter_map(skipped).collect();
    assert_eq!(
        reasons.iter().filter(|why| *why == "left out: --no-mpi was given").count(),
        1,
        "{reasons:?}"
    );
    assert!(reasons.iter().any(|why| why.contains("ci/setup compiles it")), "{reasons:?}");
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    assert_eq!(json["schema"], "octree-verify/2");
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
fn a_missing_requirement_gives_exit_code_3() {
    let fixture = Fixture::new();
    let outcome = fixture.verify(&["--no-mpi", "--require", "p4est"]);
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    assert!(outcome.printed.contains("something required is missing"), "{}", outcome.printed);
    fixture.write("mesher", "#!/bin/sh\n");
    fs::remove_file(fixture.path("mesher")).unwrap();
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(
        (outcome.code, outcome.printed.contains("the mesher is missing")),
        (3, true),
        "{}",
        outcome.printed
    );
}

#[test]
fn a_case_that_all_programs_reject_is_invalid_input() {
    let fixture = Fixture::new();
    fixture.write("case.toml", "spacing_min = -1.0\n[generator]\nshape = \"cube\"\nfacets = 12\n");
    fixture.script("mesher", REFUSES);
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("input: case: spacing_min is negative"),
        "{}",
        outcome.printed
    );
}

#[test]
fn a_case_that_only_the_mesher_rejects_is_a_failure() {
    let fixture = Fixture::new();
    fixture.script("mesher", REFUSES);
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("it refuses the case: spacing_min is negative"),
        "{}",
        outcome.printed
    );
}

#[test]
fn an_invalid_case_that_the_mesher_accepts_is_a_failure() {
    let fixture = Fixture::new();
    fixture.write("case.toml", "spacing_min = -1.0\n[generator]\nshape = \"cube\"\nfacets = 12\n");
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(outcome.printed.contains("the mesher accepts an invalid case"), "{}", outcome.printed);
}

/// The mesher accepts the case, which the harness cannot read: the user's mistake, not the mesher's.
#[test]
fn a_geometry_that_the_report_would_replace_is_invalid_input() {
    let fixture = Fixture::new();
    fixture.write("case.toml", "spacing_min = 1.0\ngeometry = \"body.stl\"\n");
    fixture.write("body.stl", "solid body");
    let body = fixture.path("body.stl");
    let outcome = fixture.verify(&["--no-mpi", "--json", body.to_str().unwrap()]);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("give the output another name"), "{}", outcome.printed);
    assert!(!outcome.printed.contains("accepts"), "{}", outcome.printed);
    assert_eq!(fixture.read("body.stl"), "solid body");
    assert!(fixture.temporary_files().is_empty(), "{:?}", fixture.temporary_files());
}

#[test]
fn two_reports_in_one_file_are_invalid_input() {
    let fixture = Fixture::new();
    let file = fixture.path("report");
    let file = file.to_str().unwrap();
    fs::create_dir(fixture.path("out")).unwrap();
    let within = ["--out", "out", "--junit", "out/report.json"];
    for options in [&["--json", file, "--junit", file][..], &within] {
        let outcome = fixture.verify(&[&["--no-mpi"], options].concat());
        assert_eq!(outcome.code, 2, "{}", outcome.printed);
        assert!(outcome.printed.contains("this run also writes"), "{}", outcome.printed);
    }
}

#[test]
fn a_summary_that_cannot_be_written_is_named() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("summary.md")).unwrap();
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("could not be written: /"), "{}", outcome.printed);
    assert!(outcome.printed.contains("summary.md: "), "{}", outcome.printed);
}

/// What is in the way of the second case is found before the first.
#[test]
fn a_directory_of_something_else_is_refused_before_the_first_case() {
    let fixture = Fixture::new();
    fixture.write("other.toml", &fixture.read("case.toml"));
    fixture.write("out/other/precious", "");
    let outcome = fixture.verify(&["other.toml", "--no-mpi", "--out", "out"]);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("no verification made it"), "{}", outcome.printed);
    assert!(!fixture.path("out/case").exists() && fixture.path("out/other/precious").exists());
}

#[test]
fn an_unknown_case_is_invalid_input() {
    let fixture = Fixture::new();
    fixture.catalogue_with_absent_geometry();
    let outcome = fixture.harness(&["verify", "unheard-of"]);
    let why = "unheard-of: no such file or directory exists, nor a case of this name in ";
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
    assert_eq!(fixture.harness(&["verify", "--ranks", "none"]).code, 2);
}

#[test]
fn a_hang_is_killed_reported_and_kept() {
    let fixture = Fixture::new();
    fixture.script("mesher", HANGS);
    let outcome = fixture.verify(&["--no-mpi", "--timeout", "20", "--out", "out"]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let why = "did not end within 20 s and was killed; its ranks were in layer 7";
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
    assert!(
        outcome.printed.contains("repeat with: ")
            && outcome.printed.contains("--timeout 20 --no-mpi --keep"),
        "{}",
        outcome.printed
    );
    // If no process reaps orphans, a killed one remains as a zombie.
    let stat = format!("/proc/{}/stat", fixture.read("sleeper").trim());
    let asleep = fs::read_to_string(stat).is_ok_and(|stat| !stat.contains(") Z "));
    assert!(!asleep, "a process of the hung mesher is still running");
    assert!(fixture.path("out/case/timed/status/rank-00001.txt").is_file());
    for form in ["table.txt", "report.md", "junit.xml", "report.json"] {
        assert!(fixture.path("out").join(form).is_file(), "{form}");
    }
}

#[test]
fn a_mesh_that_depends_on_the_rank_count_is_detected() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    let good = fixture.verify(&[]);
    assert_eq!(good.code, 0, "{}", good.printed);
    fixture
        .script("mesher", &HOLDS.replace("from=", "[ \"$FAKE_RANKS\" = 3 ] && tree=other; from="));
    let outcome = fixture.verify(&["--json", "report.json", "--out", "out"]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("3 ranks, morton, base auto: identical: first difference"),
        "{}",
        outcome.printed
    );
    let repeat = "--ranks 3 --partitioners morton --level-bases auto --no-oracles";
    assert!(outcome.printed.contains(repeat), "{}", outcome.printed);
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    let failed = json["cases"][0]["checks"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|check| check["outcome"] == "fail");
    assert_eq!(failed.map(|check| &check["ranks"]).collect::<Vec<_>>(), [3]);
    // The files of a passing rank count are removed, those of a failing one are kept.
    assert!(!fixture.path("out/case/ranks-2-morton-auto").exists());
    assert!(fixture.path("out/case/ranks-3-morton-auto/mesh/mesh.json").is_file());
}

/// The first serial run is the timed one, and the second has the mesh with which all ranks are compared.
#[test]
fn a_mesher_whose_serial_runs_differ_is_reported() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    let first = "[ -e \"$here/seen\" ] || tree=other; touch \"$here/seen\"; from=";
    fixture.script("mesher", &HOLDS.replace("from=", first));
    let outcome = fixture.verify(&[]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let why = "serial: deterministic: two serial runs differ";
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
}

/// The timed run writes no mesh, so that only the run with one shows how many cells there are.
#[test]
fn a_wrong_number_of_cells_of_the_timed_run_is_reported() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    let lie = "[ -n \"$out\" ] || sed -i 's/\"cells\": 1/\"cells\": 7/' \"$json\"";
    fixture.script("mesher", &format!("{HOLDS}\n{lie}"));
    let outcome = fixture.verify(&[]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let why = "serial: deterministic: two serial runs differ: 7 cells";
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
}

#[test]
fn a_wrong_digest_in_manifest_and_report_on_ranks_is_reported() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    let digest = "00000000000000000000000000000001";
    let lie = format!(
        "[ -z \"$FAKE_RANKS\" ] || for file in \"$out/mesh.json\" \"$json\"; do \
         sed -i 's/\"digest\": *\"[0-9a-f]*\"/\"digest\": \"{digest}\"/' \"$file\"; done"
    );
    fixture.script("mesher", &format!("{HOLDS}\n{lie}"));
    let outcome = fixture.verify(&[]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let why = format!(
        "2 ranks, morton, base auto; 3 ranks, morton, base auto: manifest: digest: \"{digest}\" in the"
    );
    assert!(outcome.printed.contains(&why), "{}", outcome.printed);
    // The ranks have the right digest, and the serial runs agree on a wrong one.
    fixture.script("mesher", &format!("{HOLDS}\n{}", lie.replace("-z", "-n")));
    let outcome = fixture.verify(&[]);
    let why = format!("serial; base tree: manifest: digest: \"{digest}\" in the");
    assert_eq!((outcome.code, outcome.printed.contains(&why)), (1, true), "{}", outcome.printed);
}

/// Each process of another MPI's launcher, or of a mesher without MPI, meshes the whole case.
#[test]
fn ranks_that_are_fewer_than_were_started_are_a_failure() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    fixture.script("mesher", &HOLDS.replace("$FAKE_RANKS", ""));
    let outcome = fixture.verify(&[]);
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let why = "was to run on 2 ranks, but reports 1: if on MPI, it was built without it, or for another than that of ";
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
    assert!(outcome.printed.contains("bin/mpirun"), "{}", outcome.printed);
}

#[test]
fn an_engine_that_crashes_on_mpi_fails() {
    let fixture = Fixture::new();
    fixture.script("bin/mpirun", "echo 'rank 1: segmentation fault' >&2; exit 139");
    for options in [&["--ranks", "2"][..], &[]] {
        let case = fixture.path("case.toml");
        let outcome = fixture.harness(&[&["verify", case.to_str().unwrap()], options].concat());
        assert_eq!(outcome.code, 1, "{}", outcome.printed);
        assert!(outcome.printed.contains("ended with code 139: rank 1"), "{}", outcome.printed);
        assert!(!outcome.printed.contains("all hold"), "{}", outcome.printed);
    }
}

#[test]
fn ranks_that_were_asked_for_or_promised_require_mpirun() {
    let fixture = Fixture::new();
    fixture.link_tools();
    let (bin, case) = (fixture.path("bin"), fixture.path("case.toml"));
    let arguments = ["verify", case.to_str().unwrap(), "--json", "report.json", "--ranks", "2,3"];
    // The mesher promises the same mesh on any number of ranks, so even ranks that were not asked for are required.
    for count in [6, 4] {
        let outcome = fixture.harness_on(bin.to_str().unwrap(), &arguments[..count]);
        assert_eq!(outcome.code, 3, "{}", outcome.printed);
        assert!(outcome.printed.contains("something required is missing"), "{}", outcome.printed);
        assert!(outcome.printed.contains("mpirun is not on the PATH"), "{}", outcome.printed);
    }
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    let checks = json["cases"][0]["checks"].as_array().unwrap();
    for ranks in [1, 2, 64] {
        assert!(checks.iter().any(|check| check["ranks"] == ranks), "{ranks} are not named");
    }
    let outcome =
        fixture.harness_on(bin.to_str().unwrap(), &[&arguments[..2], &["--no-mpi"]].concat());
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
}

/// As those of a shell that becomes the harness.
#[test]
fn processes_that_others_started_are_left_alone() {
    let fixture = Fixture::new();
    // In a session of its own from some time on.
    let script =
        "(sleep 0.05; exec setsid sleep 600) >/dev/null 2>&1 & echo $! >sleeper; exec \"$@\"";
    let verify = "verify case.toml --no-mpi --no-proof --mesher ./mesher --reference ./reference";
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh", env!("CARGO_BIN_EXE_harness")]).args(verify.split(' '));
    let ended = command.current_dir(fixture.path("")).output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
    let killed = Command::new("kill").arg(fixture.read("sleeper").trim()).status();
    assert!(killed.unwrap().success(), "{ended:?}");
}

/// Of a case that was named, nothing left out is green; of those of a size, not all.
#[test]
fn a_case_on_which_nothing_was_checked_is_not_green() {
    let fixture = Fixture::new();
    // More cells than are checked in memory: the first run writes no mesh.
    fixture.script("mesher", &HOLDS.replace("\"cells\": 1", "\"cells\": 200000000"));
    let outcome = fixture.verify(&["--no-mpi"]);
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    assert!(outcome.printed.contains("no check was run on case"), "{}", outcome.printed);
    assert!(!outcome.printed.contains("all hold"), "{}", outcome.printed);
    fixture.catalogue_with_absent_geometry();
    let outcome = fixture.harness(&["verify", "--size", "large"]);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("no case in "), "{}", outcome.printed);
}

/// Of ranks that stay, no other memory is measured.
#[test]
fn the_memory_of_rank_0_is_not_that_of_all_ranks() {
    let fixture = Fixture::new();
    fixture.script_mpirun();
    fixture.script("mesher", &HOLDS.replace("\"ranks\": %s", "\"other\": %s"));
    let outcome = fixture.verify(&["--json", "report.json"]);
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
    let runs = json["cases"][0]["runs"].as_array().unwrap();
    let on_ranks: Vec<_> = runs.iter().filter(|run| !run["layout"].is_null()).collect();
    assert_eq!(on_ranks.len(), 2);
    assert!(on_ranks.iter().all(|run| run["peak_rss_bytes"].is_null()), "{runs:?}");
}

/// An engine that reads binary STL files only, and whose arrays have names of their own, or that keeps the outside only.
#[test]
fn the_comparison_with_p4est_is_made_with_what_the_engine_takes_and_writes() {
    let fixture = Fixture::new();
    let balances =
        "test -f \"$1/leaves-00000.npy\" && cp \"${0%/*}/other/leaves-00000.npy\" \"$2\"";
    fixture.script("p4est", balances);
    let engine = "[run]\nserial = [\"{here}/mesher\", \"{case}\"]\nout = [\"--out\", \"{out}\"]\n\
                  json = [\"--json\", \"{json}\"]\nungraded = [\"--ungraded\"]\n[takes]\n";
    let renamed = "[ -z \"$out\" ] || { mv \"$out/leaves-00000.npy\" \"$out/words.npy\"\n\
                   sed -i 's/leaves-00000/words/; s/\"keep\":\"all\"/\"keep\":\"'$keep'\"/' \"$out/mesh.json\"; }";
    let case = fixture.read("case.toml");
    for (keep, takes, refuses, outcome) in [
        ("all", "", "! grep -q '^solid' \"${1%/*}/body.stl\"", "pass"),
        ("outside", "keep = [\"outside\"]", "! grep -q '^keep = \"all\"' \"$1\"", "left_out"),
    ] {
        fixture.write("case.toml", &case.replace("\"all\"", &format!("\"{keep}\"")));
        fixture.write("engine.toml", &format!("{engine}{takes}\n"));
        fixture.script("mesher", &format!("{refuses} || exit 2\nkeep={keep}{HOLDS}\n{renamed}"));
        let options = ["--engine", "engine.toml", "--json", "report.json"];
        let verified = fixture.harness(&[&["verify", "case.toml"], &options[..]].concat());
        assert_eq!(verified.code, 0, "{}", verified.printed);
        let json: serde_json::Value = serde_json::from_str(&fixture.read("report.json")).unwrap();
        let checks = json["cases"][0]["checks"].as_array().unwrap();
        let by_p4est = checks.iter().find(|check| check["subject"] == "p4est").unwrap();
        assert_eq!(by_p4est["outcome"], outcome, "{by_p4est}");
        let why = by_p4est["why"].as_str().unwrap_or_default();
        assert!(outcome == "pass" || why.contains("does not support keep = all"), "{why}");
    }
}

/// OCaml has the same exit code for an exception that nothing catches as the checker for a file that it cannot use.
#[test]
fn a_proven_checker_that_crashes_fails_and_files_that_it_cannot_use_leave_the_proof_out() {
    let fixture = Fixture::new();
    let required = ["--no-mpi", "--require", "proof"];
    for (why, asked, code) in [
        ("no inputs", &required[..1], 0),
        ("no inputs", &required, 3),
        ("Fatal error: exception Stack_overflow", &required[..1], 1),
    ] {
        fixture.script("proof", &format!("echo '{why}' >&2; exit 2"));
        let outcome = fixture.verify(asked);
        assert!(outcome.code == code && outcome.printed.contains(why), "{}", outcome.printed);
    }
}

#[test]
fn a_run_report_that_contradicts_the_mesh_the_case_or_the_clock_is_detected() {
    let fixture = Fixture::new();
    for (replaced, stated, why) in [
        ("\"cells\": 1", "\"cells\": 2", "states 2 cells, and its mesh has 1"),
        ("\"cells\": 1", "\"cells\": 1, \"facets\": 3", "reports 3 facets, and the case has "),
        ("\"cells\": 1", "\"cells\": 1, \"facets\": 0", "reports 0 facets, and the case has "),
        // Milliseconds.
        ("_s\": 0.005", "_s\": 5e3", "reports a wall time of 5000 s, and ran for "),
    ] {
        fixture.script("mesher", &HOLDS.replace(replaced, stated));
        let outcome = fixture.verify(&["--no-mpi"]);
        let is_found = outcome.printed.contains(why);
        assert_eq!((outcome.code, is_found), (1, true), "{}", outcome.printed);
    }
}

#[test]
fn a_case_whose_geometry_is_absent_is_left_out_and_not_green_alone() {
    let fixture = Fixture::new();
    fixture.catalogue_with_absent_geometry();
    let rest = ["--no-mpi", "--no-oracles", "--no-p4est"];
    let outcome = fixture.harness(&[&["verify"], &rest[..]].concat());
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    assert!(
        outcome
            .printed
            .contains("left out: jet: case: geometry because fetched/jet.stl is missing"),
        "{}",
        outcome.printed
    );
    let outcome =
        fixture.harness(&[&["verify", "jet", "--require", "geometries"], &rest[..]].concat());
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
}
