//! `harness targets` as a user runs it, on a scripted mesher.

use crate::fixture::Fixture;
use std::fs;
use std::os::unix::fs::PermissionsExt;

/// Reports 1000 cells in 2 ms, fails on three ranks, and writes the correct mesh.
const MESHER: &str = r#"#!/bin/sh
here=$(dirname "$0") ranks=1
while [ $# -gt 0 ]; do
    case "$1" in
    --out) cp -r "$here/right" "$2" ;;
    --json) json="$2" ;;
    --comm)
        [ "$2" != sim:3:1 ] || { echo "mesher: no three" >&2; exit 70; }
        case "$2" in sim:*) ranks="${2#sim:}" ranks="${ranks%%:*}" ;; esac
        ;;
    esac
    shift
done
[ -z "$json" ] || printf '{"ranks": %s, "facets": 40, "cells": 1000, "digest": "00", "time_wall_s": 0.002, "peak_rss_bytes": [4096000]}' "$ranks" > "$json"
"#;

const TARGETS: &str = r#"
mesh.body.case = "case.toml"
[run]
one = { mesh = "body", comm = "solo", repeats = 2 }
three = { mesh = "body", comm = "sim", ranks = 3 }
two = { mesh = "body", ranks = 2 }
[[row]]
name = "failing"
run = "three"
measure = "lambda_cpu"
[[row]]
name = "rate"
run = "one"
measure = "cells_per_second_per_core"
at_least = 500e3
[[row]]
name = "mpi"
run = "two"
measure = "seconds"
at_most = 9
"#;

fn scripted() -> Fixture {
    let fixture = Fixture::new();
    fixture.write("mesher", MESHER);
    fs::set_permissions(fixture.path("mesher"), fs::Permissions::from_mode(0o755)).unwrap();
    fixture.write("targets.toml", TARGETS);
    fixture
}

const TARGETS_COMMAND: &str = "targets targets.toml --mesher ./mesher --network 1e-6,1e10";
/// The network is that of the record.
const SHOW: &str = "targets targets.toml --show";

#[test]
fn a_mesh_whose_spacing_is_not_found_fails_by_the_record_too() {
    let fixture = scripted();
    let study = "mesh.body = { case = 'case.toml', cells = 1e5 }\nrun.one = { mesh = 'body', comm = 'solo' }\n\
                 [[row]]\nname = 'r'\nrun = 'one'\nmeasure = 'seconds'\nat_most = 9\n";
    fixture.write("targets.toml", study);
    fixture.program("mesher", "#!/bin/sh\nexit 70\n");
    for command in [TARGETS_COMMAND, SHOW] {
        let outcome = fixture.harness(&format!("{command} --record r.jsonl"));
        let is_said = outcome
            .printed
            .contains("FAILED: run one failed: no spacing is known for 1.0e5 cells: ");
        assert!(outcome.code == 1 && is_said, "{}", outcome.printed);
    }
}

#[test]
fn met_targets_succeed_and_the_record_gives_the_same_table() {
    let fixture = scripted();
    let only = "--only rate --record out/r.jsonl";
    let outcome = fixture.harness(&format!("{TARGETS_COMMAND} {only}"));
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    assert!(outcome.printed.contains("1 met, 0 missed"), "{}", outcome.printed);
    let shown = fixture.harness(&format!("{SHOW} {only}"));
    assert_eq!(shown.code, 0, "{}", shown.printed);
    assert!(outcome.printed.contains(shown.printed.trim()), "{}", shown.printed);
    // The record of a report may be elsewhere.
    let apart = fixture.harness(&format!("{SHOW} {only} --report apart"));
    assert!(apart.code == 0 && fixture.path("apart/index.html").is_file(), "{}", apart.printed);
    // A later session, of another program, made none of these runs.
    let record = fs::read_to_string(fixture.path("out/r.jsonl")).unwrap();
    let mut later: serde_json::Value =
        serde_json::from_str(record.lines().next().unwrap()).unwrap();
    (later["session"], later["machine"]["commit"]) = ("later".into(), "another commit".into());
    fixture.write("out/later.jsonl", &format!("{record}{later}\n"));
    let only = "--only rate --record out/later.jsonl --report apart";
    assert_eq!(fixture.harness(&format!("{SHOW} {only}")).code, 0);
    let table = fs::read_to_string(fixture.path("apart/targets.md")).unwrap();
    assert!(table.contains("1 met") && !table.contains("another commit"), "{table}");
    // A text takes its numbers from the record.
    let check = |text: &str| {
        fixture.write("paper.tex", text);
        fixture.harness("report out --record out/r.jsonl --check paper.tex")
    };
    assert_eq!(check("No number.").code, 3);
    let numbers = fs::read_to_string(fixture.path("out/numbers.tex")).unwrap();
    let key = numbers.split("\\defresult{").nth(2).unwrap().split('}').next().unwrap();
    let right = check(&format!("It takes \\result{{{key}}}."));
    assert!(
        right.code == 0 && right.printed.contains("1 numbers compared, 0 of them by hand"),
        "{}",
        right.printed
    );
    let wrong = check(&format!("It takes \\result{{{key}}},\nor 98.76543 s."));
    assert!(
        wrong.code == 1 && wrong.printed.contains("line 2: 98.76543 is written by hand"),
        "{}",
        wrong.printed
    );
    // A text that it includes is a part of it; what the report has just written need not be compared.
    fixture
        .write("parts/one.tex", &format!("\\result{{{key}}}, or 98.76543 s\\input{{parts/one}}"));
    let figures = "%\n\\providecommand{\\figures}{figures}\n98.76543";
    fixture.write("copy.tex", &figures.replacen('%', "% Made by `harness report`.", 1));
    let whole = check("\\input{out/numbers}\\input{copy}\\include{parts/one} % \\input{absent}");
    let part = "one.tex, line 1: 98.76543 is written by hand";
    assert!(whole.code == 1 && whole.printed.contains(part), "{}", whole.printed);
    for made in ["numbers.tex", "copy.tex"] {
        assert!(!whole.printed.contains(made), "{}", whole.printed);
    }
    // Numbers are ASCII, whatever the encoding.
    fs::write(fixture.path("paper.tex"), b"M\xfcller: 98.76543").unwrap();
    let latin = fixture.harness("report out --record out/r.jsonl --check paper.tex");
    assert!(latin.code == 1 && latin.printed.contains("98.76543"), "{}", latin.printed);
    let absent = check(&format!("\\result{{{key}}}\\input{{absent}}"));
    assert!(absent.code == 2 && absent.printed.contains("absent.tex"), "{}", absent.printed);
}

#[test]
fn an_archive_is_replayed_and_another_mesh_is_noticed() {
    let fixture = scripted();
    let rows = TARGETS.find("[[row]]").unwrap();
    let rate = TARGETS[rows..].split("[[row]]").find(|row| row.contains("rate")).unwrap();
    fixture.write("mine.toml", &format!("{}[[row]]{rate}", &TARGETS[..rows]));
    let bench = fixture.harness("bench mine.toml --mesher ./mesher --report out");
    assert_eq!(bench.code, 0, "{}", bench.printed);
    let archive = "archive out mine.toml -o a --title T --author A --licence MIT";
    let inside = fixture.harness(&archive.replace("-o a", "-o out/a"));
    assert!(inside.code == 2 && inside.printed.contains("is in the report"), "{}", inside.printed);
    let nameless = fixture.harness(&archive.replace("--title T", "--title="));
    assert!(nameless.code == 2 && nameless.printed.contains("--title"), "{}", nameless.printed);
    fixture.write("out/numbers.tex", "of an earlier record");
    fixture.write("out/figures/earlier.svg", "");
    let made = fixture.harness(archive);
    assert_eq!(made.code, 0, "{}", made.printed);
    let numbers = fs::read_to_string(fixture.path("a/numbers.tex")).unwrap();
    assert!(!numbers.contains("of an earlier record"), "{numbers}");
    assert!(!fixture.path("a/figures/earlier.svg").exists());
    assert!(made.printed.contains(" 3 values to be met"), "{}", made.printed);
    assert_eq!(fixture.harness(archive).code, 2, "it exists");
    // Another case than that of the runs.
    let case = fs::read_to_string(fixture.path("case.toml")).unwrap();
    fixture.write("case.toml", &format!("enclosed = 'keep'\n{case}"));
    let changed = fixture.harness(&archive.replace("-o a", "-o c"));
    let why = "case.toml: runs of targets have other rules or geometry";
    assert!(changed.code == 2 && changed.printed.contains(why), "{}", changed.printed);
    fixture.write("case.toml", &case);
    let metadata = fs::read_to_string(fixture.path("a/ro-crate-metadata.json")).unwrap();
    for name in
        ["study/study.toml", "study/case.toml", "study/body.stl", "expected.json", "record.jsonl"]
    {
        assert!(
            metadata.contains(&format!("\"@id\": \"{name}\""))
                && fixture.path("a").join(name).is_file()
        );
    }
    // A record of a program that would not be run again.
    fixture.write("series.toml", "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\n");
    let series = fixture.harness("bench series.toml --mesher ./mesher --no-mpi --report series");
    assert_eq!(series.code, 0, "{}", series.printed);
    let record = fs::read_to_string(fixture.path("series/record.jsonl")).unwrap();
    let other = record.replace("\"engine\":\"mesher\"", "\"engine\":\"other\"");
    assert_ne!(record, other);
    fixture.write("series/record.jsonl", &other);
    let other =
        fixture.harness("archive series series.toml -o b --title T --author A --licence MIT");
    assert!(
        other.code == 2 && other.printed.contains("the study does not ask for, other"),
        "{}",
        other.printed
    );
    // A run that failed, which the study asks for.
    let line = record.lines().rfind(|line| line.contains("\"kind\":\"run\"")).unwrap();
    let mut failed: serde_json::Value = serde_json::from_str(line).unwrap();
    (failed["kind"], failed["why"]) = ("failure".into(), "no memory".into());
    failed["setup"]["comm"] = "sim".into();
    fixture
        .write("series.toml", "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\nsim = [1]\n");
    fixture.write("series/record.jsonl", &format!("{record}{failed}\n"));
    let lacking =
        fixture.harness("archive series series.toml -o b --title T --author A --licence MIT");
    let why = "sim:1 default: mesher failed: no memory";
    assert!(lacking.code == 3 && lacking.printed.contains(why), "{}", lacking.printed);
    assert!(fs::read_to_string(fixture.path("b/README.md")).unwrap().contains(why));
    // What was measured with is not needed any more.
    for name in ["case.toml", "body.stl", "mine.toml"] {
        fs::remove_file(fixture.path(name)).unwrap();
    }
    let replay = || fixture.harness("replay a --mesher ./mesher");
    let equal = replay();
    assert_eq!(equal.code, 0, "{}", equal.printed);
    assert!(
        equal.printed.contains("exact: 2 equal, 0 differ; ratios: 1 inside"),
        "{}",
        equal.printed
    );
    assert!(!equal.printed.contains("does not follow from the record"), "{}", equal.printed);
    let expected = fs::read_to_string(fixture.path("a/expected.json")).unwrap();
    fixture.write("a/expected.json", &expected.replacen("\"values\": [", "\"values\": [ ", 1));
    let changed = replay();
    assert!(changed.printed.contains("does not follow from the record"), "{}", changed.printed);
    fixture.write("mesher", &MESHER.replace("\"00\"", "\"01\""));
    let other = replay();
    assert!(other.code == 1 && other.printed.contains("DIFFERS"), "{}", other.printed);
    fixture.write("mesher", "#!/bin/sh\nexit 70\n");
    let nothing = replay();
    assert!(nothing.code == 1 && nothing.printed.contains("4 missing"), "{}", nothing.printed);
    assert!(nothing.printed.contains("mesher ended with code 70"), "{}", nothing.printed);
}

/// The session that began last has them, whatever the names of the files.
#[test]
fn the_last_build_and_the_last_network_are_those_of_an_archive() {
    let fixture = scripted();
    let phases = r#""phases": [{"name": "all", "time_cpu_s": ['"$(seq -s, -f 0.00%.0f $ranks)"']}], "digest""#;
    fixture.write("mesher", &MESHER.replace("\"digest\"", phases));
    fixture
        .write("study.toml", "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\nsim = [1]\n");
    let bench = fixture.harness("bench study.toml --mesher ./mesher --report out");
    assert_eq!(bench.code, 0, "{}", bench.printed);
    // As if the network had been measured, after a session of another build and with a network that was given.
    let record = fs::read_to_string(fixture.path("out/record.jsonl")).unwrap();
    fixture.write("out/a.jsonl", &record.replace("\"measured\":false", "\"measured\":true"));
    let older = record.lines().map(|line| {
        let mut of: serde_json::Value = serde_json::from_str(line).unwrap();
        (of["session"], of["time_utc"]) = ("old".into(), "2001-01-01T00:00:00Z".into());
        match of["kind"].as_str() {
            Some("run") => (of["digest"], of["program"]) = ("01".into(), "old".into()),
            Some("network") => (of["latency_s"], of["given"]) = (0.25_f64.into(), true.into()),
            _ => {}
        }
        format!("{of}\n")
    });
    fixture.write("out/record.jsonl", &older.collect::<String>());
    let study = fs::read_to_string(fixture.path("study.toml")).unwrap();
    fixture.write("study.toml", &format!("{study}engines = ['mesher', 'engine.toml']\n"));
    let archive = fixture.harness("archive out study.toml -o a --title T --author A --licence MIT");
    let lacks = "engine case strong n=1 sim:1 default is not in the record";
    assert!(archive.code == 3 && archive.printed.contains(lacks), "{}", archive.printed);
    assert!(archive.printed.contains("engine.toml: what the scripts beside it import is not"));
    // What cannot be run here has its own reason.
    fixture.write("a/study/engine.toml", "serial = 1");
    let expected = fs::read_to_string(fixture.path("a/expected.json")).unwrap();
    assert!(expected.contains("\"00\"") && !expected.contains("\"01\""), "{expected}");
    let replay = fixture.harness("replay a --mesher ./mesher --record again.jsonl");
    assert!(replay.code == 3 && replay.printed.contains("0 missing"), "{}", replay.printed);
    let left_out = "engine.toml are left out: ";
    assert!(replay.printed.contains(left_out) && replay.printed.contains("unknown field"));
    let again = fs::read_to_string(fixture.path("again.jsonl")).unwrap();
    assert!(again.contains("\"latency_s\":") && !again.contains("\"latency_s\":0.25"), "{again}");
}

/// What a study asks for and its record lacks is named, and is not executed: nothing would be compared with it, and its time is unknown.
#[test]
fn an_incomplete_record_gives_no_green_replay() {
    let fixture = scripted();
    let series = |of: &str| format!("[[series]]\ncase = 'case.toml'\nexperiment = {of}\n");
    let study = series("'strong'") + &series("'layers'\nlayers = [1, 2]");
    fixture.write("study.toml", &study);
    let bench = fixture.harness("bench study.toml --mesher ./mesher --only strong --report out");
    assert_eq!(bench.code, 0, "{}", bench.printed);
    let archive = fixture.harness("archive out study.toml -o a --title T --author A --licence MIT");
    let page = fs::read_to_string(fixture.path("a/README.md")).unwrap();
    for n in [1, 2] {
        let lacks = format!("mesher case layers n={n} solo:1 default is not in the record");
        assert!(archive.code == 3 && archive.printed.contains(&lacks), "{}", archive.printed);
        assert!(page.contains(&lacks), "{page}");
    }
    let replay = fixture.harness("replay a --mesher ./mesher");
    assert!(replay.code == 3 && replay.printed.contains("0 differ"), "{}", replay.printed);
    assert!(replay.printed.contains(" strong ") && replay.printed.contains("not in the archive"));
    assert!(!replay.printed.contains("n=2 solo:1 default, warm-up"), "{}", replay.printed);
    // As often as in the record, unless more is asked for.
    fixture.write("a/study/study.toml", &series("'strong'\nrepeats = 9"));
    let whole = fixture.harness("replay a --mesher ./mesher");
    assert!(whole.code == 0 && !whole.printed.contains("repeat 2"), "{}", whole.printed);
    let twice = fixture.harness("replay a --mesher ./mesher --repeat 2");
    assert!(twice.code == 0 && twice.printed.contains("repeat 2"), "{}", twice.printed);
}

/// A search for a spacing would begin with other meshes than it did, and mesh what the archive lacks.
#[test]
fn a_replay_makes_the_runs_of_the_archive_and_no_others() {
    let fixture = scripted();
    let cells = r#""$ranks" "$(awk '/^spacing_min/ { printf "%.0f", 9000 / $3 ^ 2 }' "$of")" >"#;
    let mesher = MESHER
        .replace("    --out)", "    *.toml) of=\"$1\"; echo run >>\"$here/calls\" ;;\n    --out)")
        .replace("\"cells\": 1000", "\"cells\": %s")
        .replace("\"$ranks\" >", cells);
    fixture.write("mesher", &mesher);
    let series = |of: &str| format!("[[series]]\ncase = 'case.toml'\nexperiment = {of}\n");
    let layers = series("'layers'\nlayers = [1, 2]\ncells = [2e4]\nmpi = [1, 2]");
    let study = |cells: &str| series(&format!("'strong'\ncells = {cells}")) + &layers;
    fixture.write("study.toml", &study("[3e4]"));
    for only in ["layers", "strong"] {
        let bench = "bench study.toml --mesher ./mesher --no-mpi --report out --only";
        let bench = fixture.harness(&format!("{bench} {only}"));
        assert_eq!(bench.code, 0, "{}", bench.printed);
    }
    let archive = fixture.harness("archive out study.toml -o a --title T --author A --licence MIT");
    assert_eq!(archive.code, 3, "{}", archive.printed);
    fixture.write("a/study/study.toml", &study("[4e5, 3e4]"));
    fs::remove_file(fixture.path("calls")).unwrap();
    let replay = fixture.harness("replay a --mesher ./mesher");
    assert!(replay.code == 3 && replay.printed.contains(" 0 differ"), "{}", replay.printed);
    assert!(replay.printed.contains(" 0 missing"), "{}", replay.printed);
    let record = fs::read_to_string(fixture.path("out/record.jsonl")).unwrap();
    let runs = record.lines().filter(|line| line.contains("\"kind\":\"run\"")).count();
    assert_eq!(fs::read_to_string(fixture.path("calls")).unwrap().lines().count(), runs);
}

/// The time of a mesh of another geometry is no result.
#[test]
fn a_run_of_other_facets_than_the_case_has_fails() {
    let fixture = scripted();
    fixture.write("mesher", &MESHER.replace("\"facets\": 40", "\"facets\": 39"));
    fixture.write("study.toml", "[[series]]\ncase = 'case.toml'\nexperiment = 'strong'\n");
    let bench = fixture.harness("bench study.toml --mesher ./mesher");
    let why = "it reports 39 facets, and the case has 40";
    assert!(bench.code == 1 && bench.printed.contains(why), "{}", bench.printed);
}

#[test]
fn a_series_whose_case_is_missing_is_noticed_before_the_first_run() {
    let fixture = scripted();
    let series = |case: &str| format!("[[series]]\ncase = '{case}'\nexperiment = 'strong'\n");
    fixture.write("study.toml", &(series("case.toml") + &series("absent.toml")));
    let bench = fixture.harness("bench study.toml --mesher ./mesher --record r.jsonl");
    assert!(bench.code == 2 && bench.printed.contains("absent.toml"), "{}", bench.printed);
    let record = fs::read_to_string(fixture.path("r.jsonl")).unwrap();
    assert!(!record.contains("\"kind\":\"run\""), "{record}");
}

/// The report says why.
#[test]
fn a_series_that_cannot_be_run_is_missing_with_and_without_a_report() {
    let fixture = scripted();
    let series = "[[series]]\nexperiment = 'weak'\ncase = 'case.toml'\ncells = [1e3]\nmpi = [2]\n";
    fixture.write("study.toml", series);
    for report in ["", " --report out"] {
        let bench = "bench study.toml --mesher ./mesher --no-mpi --record r.jsonl";
        let outcome = fixture.harness(&format!("{bench}{report}"));
        let why = "mesher cannot run the series weak: --no-mpi was given";
        assert!(outcome.code == 3 && outcome.printed.contains(why), "{}", outcome.printed);
    }
    let page = fs::read_to_string(fixture.path("out/index.html")).unwrap();
    assert!(page.contains("cannot run the series weak"), "{page}");
    // Of a report alone, this is all that was asked for.
    let alone = fixture.harness("report out --record r.jsonl");
    let why = "no repetition succeeded; the page lists the reasons";
    assert!(alone.code == 2 && alone.printed.contains(why), "{}", alone.printed);
}

/// Facets that grow with the ranks are those of one case, and an edit of its file makes another one.
#[test]
fn an_edited_case_is_another_one() {
    let fixture = scripted();
    let phases = r#""phases": [{"name": "all", "time_cpu_s": ['"$(seq -s, -f 0.00%.0f $ranks)"']}], "digest""#;
    let mesher = MESHER.replace("\"digest\"", phases).replace("\"facets\": 40, ", "");
    fixture.write("mesher", &mesher);
    let case = "spacing_min = 0.5\nroot_scale = 2.0\n[generator]\nshape = 'sphere'\nfacets = 80\n";
    fixture.write(
        "study.toml",
        "[[series]]\nexperiment = 'weak'\ncase = 'ball.toml'\ncells = [1e3]\nsim = [1, 4]\nfacets = 80\n",
    );
    let bench = |case: &str| {
        fixture.write("ball.toml", case);
        fixture.harness("bench study.toml --mesher ./mesher --network 1e-6,1e10 --report out")
    };
    let apart = "apart: ball-80-facets-per-rank [1]: ";
    let first = bench(case);
    assert!(first.code == 0 && !first.printed.contains("apart: "), "{}", first.printed);
    let second = bench(&format!("keep = 'all'\n{case}"));
    assert!(second.code == 0 && second.printed.contains(apart), "{}", second.printed);
    let numbers = fs::read_to_string(fixture.path("out/numbers.tex")).unwrap();
    for ranks in [1, 4] {
        let key = |case: &str| format!("{{mesher/{case}/weak/1000/{ranks}/projected/time}}");
        let both = ["ball-80-facets-per-rank", "ball-80-facets-per-rank--2-"].map(key);
        assert!(both.iter().all(|key| numbers.contains(key)), "{numbers}");
    }
}

#[test]
fn a_missed_target_fails_and_a_failed_run_affects_only_its_row() {
    let fixture = scripted();
    let outcome = fixture.harness(&format!("{TARGETS_COMMAND} --no-mpi --report out"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(
        outcome
            .printed
            .contains("FAILED: run three failed: mesher ended with code 70: mesher: no three"),
        "{}",
        outcome.printed
    );
    assert!(
        outcome.printed.contains("1 met, 0 missed, 1 failed, 1 left out"),
        "{}",
        outcome.printed
    );
    let page = fs::read_to_string(fixture.path("out/targets.md")).unwrap();
    assert!(
        page.contains("| rate | at least 0.50 M cells/s |") && page.contains("| met |"),
        "{page}"
    );
    fixture.write("targets.toml", &TARGETS.replace("at_least = 500e3", "at_least = 501e3"));
    let outcome = fixture.harness(&format!("{TARGETS_COMMAND} --only rate --record r.jsonl"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(outcome.printed.contains("MISSED"), "{}", outcome.printed);
}

/// A report of no run would say nothing.
#[test]
fn an_interruption_before_the_first_run_leaves_no_report() {
    let fixture = scripted();
    fixture.program("mesher", "#!/bin/sh\nkill -INT $PPID\nsleep 60\n");
    fixture.write("study.toml", "[[series]]\nexperiment = 'strong'\ncase = 'case.toml'\n");
    let outcome = fixture.harness("bench study.toml --mesher ./mesher --no-mpi --report out");
    assert_eq!(outcome.code, 130, "{}", outcome.printed);
    assert!(!outcome.printed.contains("nothing was measured"), "{}", outcome.printed);
    assert!(!fixture.path("out/index.html").exists());
}

#[test]
fn rows_that_were_all_left_out_and_a_partition_without_metis_are_not_green() {
    let fixture = scripted();
    let none = fixture.harness(&format!("{TARGETS_COMMAND} --only mpi --record r.jsonl --no-mpi"));
    assert_eq!(none.code, 3, "{}", none.printed);
    assert!(none.printed.contains("no row was measured"), "{}", none.printed);
    fixture
        .write("mesher", &MESHER.replace("\"digest\"", "\"partitioner\": \"morton\", \"phases\": [{\"name\": \"all\", \"time_cpu_s\": [1, 1, 1, 1]}], \"digest\""));
    let sim = "three = { mesh = \"body\", comm = \"sim\", ranks = 3 }";
    let metis = "three = { mesh = \"body\", comm = \"sim\", ranks = 4, partitioner = \"metis\" }";
    fixture.write("targets.toml", &TARGETS.replace(sim, metis));
    let outcome = fixture.harness(&format!("{TARGETS_COMMAND} --only failing --record r.jsonl"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(outcome.printed.contains("METIS was asked for"), "{}", outcome.printed);
}

#[test]
fn missing_programs_and_invalid_input_have_different_exit_codes() {
    let fixture = scripted();
    let outcome = fixture.harness(&format!(
        "{TARGETS_COMMAND} --only mpi,rate --record r.jsonl --launcher nonesuch/{{ranks}}"
    ));
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    assert!(outcome.printed.contains("left out: the launcher is missing"), "{}", outcome.printed);
    let excluded =
        fixture.harness(&format!("{TARGETS_COMMAND} --only mpi,rate --record r.jsonl --no-mpi"));
    assert_eq!(excluded.code, 0, "{}", excluded.printed);
    assert_eq!(fixture.harness(&format!("{TARGETS_COMMAND} --only luck")).code, 2);
    fixture.write("targets.toml", &TARGETS.replace("seconds", "minutes"));
    let outcome = fixture.harness(TARGETS_COMMAND);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("targets.toml") && outcome.printed.contains("unknown variant"),
        "{}",
        outcome.printed
    );
}
