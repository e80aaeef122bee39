//! `harness gate`, `shrink` and `track` as a user runs them, on a scripted engine.

mod fixture;
mod targets;

use fixture::{Fixture, Outcome};
use std::fs;
use std::process::Command;

const SHRINK: &str = "shrink case.toml --engine engine.toml --ranks 8";

#[test]
fn a_failure_on_three_ranks_is_shrunk_to_its_two_facets() {
    let fixture = Fixture::new();
    let options = "--timeout 77 --reference engine";
    let outcome = fixture.harness(&format!("{SHRINK} --out tiny {options}"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    let case = contract::case::Case::read(&fixture.path("tiny/case.toml")).unwrap();
    let mut positions: Vec<f32> = case.facets.iter().map(|facet| facet[0][0]).collect();
    positions.sort_by(f32::total_cmp);
    assert_eq!(positions, [0.25, 0.5], "{}", outcome.printed);
    assert!(case.root.level_for(2.0) == Some(case.level_surface), "{}", outcome.printed);
    assert!(
        outcome.printed.contains("3 simulated ranks")
            && outcome.printed.contains("nothing more can be removed"),
        "{}",
        outcome.printed
    );
    assert!(outcome.printed.contains("first difference: the mesh has"), "{}", outcome.printed);
    let readme = fs::read_to_string(fixture.path("tiny/README.md")).unwrap();
    let line = readme.lines().find(|line| line.contains("harness shrink")).unwrap().trim();
    assert!(line.contains(options), "{line}");
    let again = fixture.harness(line.strip_prefix("harness ").unwrap());
    assert_eq!(again.code, 1, "{line}: {}", again.printed);
}

#[test]
fn a_passing_case_is_not_shrunk() {
    let fixture = Fixture::new();
    let outcome = fixture.harness("shrink case.toml --engine engine.toml --ranks 2 --out tiny");
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    assert!(!fixture.path("tiny").exists());
    assert_eq!(fixture.harness(&format!("{SHRINK} --test-only")).code, 1);
    let without = fixture.harness(&format!("{SHRINK} --test-only --mpi"));
    assert!(without.printed.contains("has no `parallel` in [run]"), "{}", without.printed);
    assert_eq!(without.code, 3);
    let nowhere = fixture.harness(&format!("{SHRINK} --out nowhere/deep/tiny"));
    assert!(nowhere.code == 1 && fixture.path("nowhere/deep/tiny/README.md").is_file());
}

/// Whatever the command: the interpreter of the engine file is not there.
#[test]
fn a_missing_interpreter_is_missing() {
    let fixture = Fixture::new();
    let engine = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    let gate = "gate --engine engine.toml --rules gate.toml";
    let verify = "verify case.toml --engine engine.toml --no-mpi";
    let commands =
        [gate, &format!("{gate} --baseline engine"), verify, &format!("{SHRINK} --test-only")];
    for (command, python) in
        commands.into_iter().flat_map(|of| [(of, "no-such-python"), (of, "/no/python")])
    {
        let first = format!("[\"{python}\", \"{{program}}\"");
        fixture.write("engine.toml", &engine.replace("[\"{program}\"", &first));
        let outcome = fixture.harness(command);
        assert_eq!(outcome.code, 3, "{command}: {}", outcome.printed);
        assert!(
            outcome.printed.contains(&format!("{python} was not found")),
            "{}",
            outcome.printed
        );
    }
}

#[test]
fn shrinking_replaces_no_file() {
    let fixture = Fixture::new();
    let before = fs::read(fixture.path("case.toml")).unwrap();
    let outcome = fixture.harness(&format!("{SHRINK} --out ."));
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("is there already"), "{}", outcome.printed);
    assert_eq!(fs::read(fixture.path("case.toml")).unwrap(), before);
}

#[test]
fn a_program_without_times_is_named() {
    let fixture = Fixture::new();
    fixture.write("gate.toml", "[[case]]\nname = \"case.toml\"\nlayers = [\"time\"]\n");
    fixture.program("broken", "#!/bin/sh\necho no >&2\nexit 1\n");
    let gate = "gate --engine engine.toml --rules gate.toml --layers time";
    for (baseline, candidate, code, who) in [
        ("engine", "broken", 1, "the candidate has no result"),
        ("broken", "engine", 3, "the baseline has no result"),
        ("broken", "broken", 3, "the baseline has no result"),
    ] {
        let outcome =
            fixture.harness(&format!("{gate} --baseline {baseline} --candidate {candidate}"));
        assert_eq!(outcome.code, code, "{}", outcome.printed);
        assert!(outcome.printed.contains(who), "{}", outcome.printed);
    }
}

#[test]
fn times_of_different_meshes_are_not_compared() {
    let fixture = Fixture::new();
    fixture.write("gate.toml", "[[case]]\nname = \"case.toml\"\nlayers = [\"time\"]\n");
    let script = fs::read_to_string(fixture.path("engine")).unwrap();
    fixture.program("other", &script.replace("mesh=right cells=1", "mesh=wrong cells=8"));
    let gate =
        "gate --engine engine.toml --rules gate.toml --layers time --budget 1 --baseline engine";
    let outcome = fixture.harness(&format!("{gate} --candidate other"));
    let why = "the mesh is another one, so that its numbers are not comparable: digest ";
    assert!(outcome.code == 3 && outcome.printed.contains(why), "{}", outcome.printed);
    let same = fixture.harness(&format!("{gate} --candidate engine"));
    assert_ne!(same.code, 3, "{}", same.printed);
}

/// Meshes that change on purpose: their numbers are not compared, but their correctness is.
#[test]
fn other_meshes_hold_if_they_are_accepted_and_something_was_compared() {
    let fixture = Fixture::new();
    let case = fs::read_to_string(fixture.path("case.toml")).unwrap();
    fixture.write("case.toml", &case.replace("spacing_min = 1.0", "spacing_min = 8.0"));
    let engine = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    fixture.write("engine.toml", &(engine + "[promises]\ncomplete = true\n"));
    let rules = "[[case]]\nname = \"case.toml\"\nlayers = [\"correctness\", \"counters\", \"memory\", \"time\"]\n";
    fixture.write("gate.toml", rules);
    let script = fs::read_to_string(fixture.path("engine")).unwrap();
    fixture.program("other", &script.replace("mesh=right cells=1", "mesh=wrong cells=8"));
    let accepting = "gate --engine engine.toml --rules gate.toml --baseline engine --require-layers --accept-meshes";
    let outcome = fixture.harness(&format!("{accepting} --candidate other --json gate.json"));
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    for part in [
        "accepted     case: digest; the mesh is another one",
        "accepted     case: time; the mesh is another one",
        "; other meshes were accepted, and their numbers not compared",
    ] {
        assert!(outcome.printed.contains(part), "{part}: {}", outcome.printed);
    }
    let json = fs::read_to_string(fixture.path("gate.json")).unwrap();
    assert_eq!(json.matches("\"verdict\": \"accepted\"").count(), 3, "{json}");
    let nothing = fixture.harness(&format!("{accepting} --candidate other --layers counters"));
    let why = "it cannot be accepted, as its correctness was not compared";
    assert!(nothing.code == 3 && nothing.printed.contains(why), "{}", nothing.printed);
    // The correctness of one case does not judge the mesh of another.
    fs::copy(fixture.path("case.toml"), fixture.path("unjudged.toml")).unwrap();
    let unjudged = "[[case]]\nname = \"unjudged.toml\"\nlayers = [\"counters\", \"time\"]\n";
    fixture.write("gate.toml", &[rules, unjudged].concat());
    let partly = fixture.harness(&format!("{accepting} --candidate other"));
    assert!(partly.code == 3 && partly.printed.contains(why), "{}", partly.printed);
    for part in
        ["accepted     case: time", "missing      unjudged: digest", "missing      unjudged: time"]
    {
        assert!(partly.printed.contains(part), "{part}: {}", partly.printed);
    }
    fixture.write("gate.toml", rules);
    let alone = "gate --engine engine.toml --rules gate.toml --accept-meshes";
    assert_eq!(fixture.harness(alone).code, 2, "nothing to accept");
    // What is no other mesh is judged as ever.
    fixture.engine("more", 1);
    let more = fixture.harness(&format!("{accepting} --candidate more --layers counters"));
    assert_eq!(more.code, 1, "{}", more.printed);
}

/// The program runs twice: under valgrind, and without.
#[test]
fn instructions_of_a_program_that_needs_an_empty_place_are_counted() {
    let fixture = Fixture::new();
    let rules = fs::read_to_string(fixture.path("gate.toml")).unwrap();
    fixture.write("gate.toml", &rules.replace("counters", "instructions"));
    let serial = "about = \"a script\"\nprogram = \"{here}/always\"\n[run]\nserial = [\"{program}\", \"{case}\", \"1\", \"--out\", \"{out}\"]\n";
    fixture.write("always.toml", serial);
    let script = fs::read_to_string(fixture.path("engine")).unwrap();
    let refuses = "[ ! -e \"$out\" ] || exit 2\nbody=";
    fixture.program("always", &script.replacen("body=", refuses, 1));
    let counts = "#!/bin/sh\nwhile :; do case \"$1\" in --callgrind-out-file=*) file=${1#*=};; --*) ;; *) break;; esac; shift; done\n\
                  echo totals: 7 >\"${file%.%p}.1\"\nexec \"$@\"\n";
    fixture.program("bin/valgrind", counts);
    let path = format!("{}:{}", fixture.path("bin").display(), std::env::var("PATH").unwrap());
    let gate = "gate --engine always.toml --rules gate.toml --baseline always --candidate always";
    let outcome = fixture.harness_with(gate, "PATH", &path);
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    assert!(outcome.printed.contains("1 unchanged"), "{}", outcome.printed);
}

#[test]
fn a_baseline_without_a_mesh_has_no_correctness_to_compare_with() {
    let fixture = Fixture::new();
    let case = fs::read_to_string(fixture.path("case.toml")).unwrap();
    fixture.write("case.toml", &case.replace("spacing_min = 1.0", "spacing_min = 8.0"));
    let promises = "[promises]\ncomplete = true\ndeterministic = true\n";
    let engine = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    fixture.write("engine.toml", &(engine + promises));
    fixture.program("broken", "#!/bin/sh\necho no >&2\nexit 3\n");
    let rules = "[[case]]\nname = \"case.toml\"\nlayers = [\"correctness\"]\n";
    fixture.write("gate.toml", rules);
    let gate = "gate --engine engine.toml --rules gate.toml --layers correctness";
    for (baseline, code, what) in [
        ("--baseline engine --candidate engine", 0, "unchanged"),
        ("--baseline broken --candidate engine", 3, "the baseline does not make a mesh"),
        ("--candidate engine", 0, "measured"),
    ] {
        let outcome = fixture.harness(&format!("{gate} {baseline}"));
        assert_eq!(outcome.code, code, "{}", outcome.printed);
        assert!(outcome.printed.contains(what), "{}", outcome.printed);
    }
}

/// As one that is older than the option that makes ranks stay.
#[test]
fn correctness_on_ranks_needs_no_program_that_stays() {
    let fixture = Fixture::new();
    let case = fs::read_to_string(fixture.path("case.toml")).unwrap();
    fixture.write("case.toml", &case.replace("spacing_min = 1.0", "spacing_min = 8.0"));
    let on_ranks = "parallel = [\"{program}\", \"{case}\", \"{ranks}\"]\nserve = [\"--serve\"]\n";
    let promises = "[promises]\ncomplete = true\nindependent_of = [\"ranks\"]\n";
    let engine = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    fixture.write("engine.toml", &[&engine, on_ranks, promises].concat());
    let rules = "[[case]]\nname = \"case.toml\"\nlayers = [\"correctness\"]\nmpi = [2]\n";
    fixture.write("gate.toml", rules);
    let outcome = fixture.harness(
        "gate --engine engine.toml --rules gate.toml --baseline engine --candidate engine",
    );
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
}

#[test]
fn a_counter_that_grows_fails_the_gate_and_one_that_shrinks_does_not() {
    let fixture = Fixture::new();
    fixture.engine("more", 1);
    let gate = "gate --engine engine.toml --rules gate.toml --layers counters";
    let outcome = fixture.harness(&format!(
        "{gate} --baseline engine --candidate more --junit gate.xml --record more.json"
    ));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("regression   case: words 40 -> 41 (+2.50 %)"),
        "{}",
        outcome.printed
    );
    assert!(fs::read_to_string(fixture.path("gate.xml")).unwrap().contains("failures=\"2\""));
    let outcome = fixture.harness(&format!("{gate} --baseline more --candidate engine"));
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("improvement  case: 2 ranks/words 41 -> 40"),
        "{}",
        outcome.printed
    );
}

/// A program that counts leaves: all of them on rank 0, or none.
#[test]
fn leaves_are_those_of_the_mesh_and_the_rank_with_most_of_them_counts() {
    let fixture = Fixture::new();
    let script = fs::read_to_string(fixture.path("engine")).unwrap();
    let with = |name: &str, cells: u64, [serial, two]: [&str; 2]| {
        let of = format!(
            "[ \"$ranks\" = 1 ] && leaves={serial} || leaves={two}\ncells={cells}\n[ -z \"$out\" ]"
        );
        let text = script.replacen("[ -z \"$out\" ]", &of, 1);
        let counted = "\"counters\": {\"rank_words_max\": [%s], \"leaves\": [%s], \"words\"";
        let text = text.replace("\"counters\": {\"words\"", counted);
        let values = "\"$leaves\" \"$leaves\" $((($(wc";
        fixture.program(name, &text.replace("$((($(wc", values));
    };
    with("even", 8, ["8", "4,4"]);
    with("uneven", 8, ["8", "8,0"]);
    with("none", 8, ["0", "0,0"]);
    let gate = "gate --engine engine.toml --rules gate.toml --layers counters --baseline even";
    let outcome = fixture.harness(&format!("{gate} --candidate uneven"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    for part in ["2 ranks/leaves_max 4 -> 8", "2 ranks/rank_words_max 4 -> 8"] {
        assert!(outcome.printed.contains(part), "{}", outcome.printed);
    }
    let none = fixture.harness(&format!("{gate} --candidate none"));
    let why = "counts 0 leaves, but 8 cells";
    assert!(none.code == 1 && none.printed.contains(why), "{}", none.printed);
}

#[test]
fn incomparable_baselines_are_reported() {
    let fixture = Fixture::new();
    let outcome = fixture.harness("gate --engine engine.toml --rules gate.toml --baseline main");
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("does not describe how to build a revision"),
        "{}",
        outcome.printed
    );
    let record = fixture
        .harness("gate --engine engine.toml --rules gate.toml --record now.json --layers counters");
    assert_eq!(record.code, 0, "{}", record.printed);
    let gate = "gate --engine engine.toml --rules gate.toml --baseline now.json";
    let outcome = fixture.harness(gate);
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("neither a program that can be"), "{}", outcome.printed);
}

#[test]
fn a_mesh_that_depends_on_the_rank_count_is_no_result_of_the_gate() {
    let fixture = Fixture::new();
    fixture.write(
        "gate.toml",
        "[[case]]\nname = \"case.toml\"\nlayers = [\"counters\"]\nranks = [3]\n",
    );
    let outcome = fixture.harness(
        "gate --engine engine.toml --rules gate.toml --baseline engine --candidate engine",
    );
    // The same program twice: nothing got worse, and nothing was compared.
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    assert!(outcome.printed.contains("neither program has a result"), "{}", outcome.printed);
    assert!(outcome.printed.contains("differs from the serial one"), "{}", outcome.printed);
}

/// The record of a gate, of a program with one counter.
fn measured(counter: &str, value: u32) -> String {
    let of = "{\"named\": \"m\", \"revision\": null, \"program\": \"\"}";
    let case =
        format!("{{\"digest\": null, \"exact\": {{\"{counter}\": {value}}}, \"counted\": {{}}}}");
    format!(
        "{{\"schema\": \"octree-measures/1\", \"of\": {of}, \"machine\": \"\", \"cases\": {{\"case\": {case}}}}}"
    )
}

#[test]
fn tracked_commits_form_a_history_with_a_change_point() {
    let fixture = Fixture::new();
    let git = |arguments: &str| {
        let mut command = Command::new("git");
        command.args(["-c", "user.name=a", "-c", "user.email=b", "-c", "init.defaultBranch=main"]);
        assert!(
            command
                .args(arguments.split(' '))
                .current_dir(fixture.path(""))
                .status()
                .unwrap()
                .success()
        );
    };
    git("init --quiet");
    for i in 0..16 {
        git(&format!("commit --quiet --allow-empty -m commit-{i}"));
        fixture.write("record.json", &measured("words", if i < 10 { 40 } else { 44 }));
        let outcome = fixture.harness("track history.jsonl --add record.json");
        let is_named = outcome.printed.contains(&format!(": commit-{i}\n"));
        assert!(outcome.code == 0 && is_named, "{}", outcome.printed);
    }
    let forms = "--page trend.html --json trend.json --junit t.xml";
    let outcome = fixture.harness(&format!("track history.jsonl --fail-recent 6 {forms}"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(
        outcome.printed.contains("case/words: 40 -> 44 (+10.00 %, worse) in "),
        "{}",
        outcome.printed
    );
    let named = "FAILED: worse within the last 6 values: case/words";
    assert!(outcome.printed.contains(named), "{}", outcome.printed);
    // Options that would have no effect, and an address that is the same for all commits.
    for few in [1, 4] {
        let refused = fixture.harness(&format!("track history.jsonl --fail-recent {few}"));
        let why = "is not in 5..";
        assert!(refused.code == 2 && refused.printed.contains(why), "{}", refused.printed);
    }
    for unused in ["--commit HEAD", "--repository .", "--link x/{commit}", "--page p --link x"] {
        assert_eq!(fixture.harness(&format!("track history.jsonl {unused}")).code, 2, "{unused}");
    }
    let series = fs::read_to_string(fixture.path("trend.json")).unwrap();
    assert!(series.contains("\"first_new\"") && series.contains("44.0"), "{series}");
    assert!(fs::read_to_string(fixture.path("trend.html")).unwrap().contains("commit-10"));
    assert_eq!(fixture.harness("track history.jsonl --fail-recent 5").code, 0);
    // The last line but five has the first commit with the new values.
    let history = fs::read_to_string(fixture.path("history.jsonl")).unwrap();
    let first_new = history.lines().nth(10).unwrap().split("\"commit\":\"").nth(1).unwrap();
    let accepted = fixture
        .harness(&format!("track history.jsonl --fail-recent 6 --accept {}", &first_new[..12]));
    assert_eq!(accepted.code, 0, "{}", accepted.printed);
    assert!(accepted.printed.contains(", accepted"), "{}", accepted.printed);
    assert_eq!(fixture.harness("track history.jsonl --accept f00f00f00f00").code, 2);
    let without = "accepted without effect: no metric has a step near";
    assert!(!accepted.printed.contains(without), "{}", accepted.printed);
    let last = history.lines().nth(15).unwrap().split("\"commit\":\"").nth(1).unwrap();
    let nowhere = fixture.harness(&format!("track history.jsonl --accept {}", &last[..12]));
    assert!(nowhere.code == 0 && nowhere.printed.contains(without), "{}", nowhere.printed);
    // A metric that is measured no more is named, and a history of nothing is not green.
    git("commit --quiet --allow-empty -m other");
    fixture.write("record.json", &measured("other", 1));
    let ended = fixture.harness("track history.jsonl --add record.json");
    assert_eq!(ended.code, 0, "{}", ended.printed);
    let named = "not in the last record: case/words";
    assert!(ended.printed.contains(named), "{}", ended.printed);
    fs::write(fixture.path("empty.jsonl"), "").unwrap();
    let nothing = fixture.harness("track empty.jsonl");
    assert_eq!(nothing.code, 3, "{}", nothing.printed);
    // Nor is one to which a file of no numbers was to be added, with others or without.
    fixture.write("none.json", &measured("words", 1).replace("\"words\": 1", ""));
    let history = fs::read_to_string(fixture.path("history.jsonl")).unwrap();
    for more in ["", " --add record.json"] {
        let nothing = fixture.harness(&format!("track history.jsonl --add none.json{more}"));
        let why = "none.json has no metric, so nothing is appended";
        assert!(nothing.code == 3 && nothing.printed.contains(why), "{}", nothing.printed);
    }
    assert_eq!(fs::read_to_string(fixture.path("history.jsonl")).unwrap(), history);
}

#[test]
fn revisions_of_another_repository_are_built_and_kept_whole() {
    let fixture = Fixture::new();
    let git = |arguments: &str| {
        let mut command = Command::new("git");
        let identity = ["-c", "user.name=a", "-c", "user.email=a@b"];
        command.args(identity).args(arguments.split(' ')).current_dir(fixture.path("other"));
        assert!(command.status().unwrap().success(), "{arguments}");
    };
    // The program reads a file that its build puts beside it, and one of its sources.
    let program = "#!/bin/sh\nhere=$(dirname \"$0\") ranks=$2\nwhile [ $# -gt 0 ]; do [ \"$1\" = --json ] && json=$2; shift; done\n\
                   printf '{\"ranks\": %s, \"cells\": 1, \"digest\": \"00\", \"counters\": {\"words\": [%s]}}' \"$ranks\" \"$(cat \"$here/words\")\" > \"$json\"\n";
    fixture.write("other/program", program);
    fixture.write(
        "other/make",
        "d=$PWD; while [ $d != / ]; do d=$(dirname $d); test ! -e $d/settings || exit 1; done\n\
         mkdir -p $1/lib && cp program $1/lib/ && printf %s%s $(cat words) $MORE >$1/lib/words && chmod +x $1/lib/program && test \"$RUSTFLAGS\" != -bad\n",
    );
    git("init --quiet");
    for words in ["40", "41"] {
        fixture.write("other/words", words);
        git("add .");
        git(&format!("commit --quiet -m words-{words}"));
    }
    fixture.write("other/words", "43");
    // Builds of revisions do not find what the working tree has, as cargo does in directories above.
    fixture.write("other/settings", "");
    let engine = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    let build = "[build]\ncommand = ['sh', 'make', '{target}']\nprogram = '{target}/lib/program'\n";
    fixture.write("built.toml", &format!("{engine}{build}"));
    let gate = "gate --engine built.toml --rules gate.toml --layers counters --repository other/";
    for (revisions, change) in [
        ("--baseline HEAD~1 --candidate HEAD", "words 40 -> 41"),
        ("--baseline HEAD~1 --candidate HEAD", "words 40 -> 41"),
        ("--baseline HEAD", "words 41 -> 43"),
    ] {
        let outcome = fixture.harness(&format!("{gate} {revisions} --record of.json"));
        assert_eq!(outcome.code, 1, "{}", outcome.printed);
        assert!(outcome.printed.contains(change), "{}", outcome.printed);
    }
    // The last one is of a working tree that is no commit.
    let track = "track history.jsonl --repository other/ --add of.json";
    let refused = fixture.harness(track);
    assert!(refused.code == 2 && refused.printed.contains("give --commit"), "{}", refused.printed);
    assert_eq!(fixture.harness(&format!("{track} --commit HEAD")).code, 0);
    git("stash --quiet");
    let clean = fixture.harness(&format!("{gate} --baseline HEAD --record of.json"));
    assert_eq!((clean.code, fixture.harness(track).code), (0, 0), "{}", clean.printed);
    git("stash pop --quiet");
    fixture.program("given", program);
    fixture.write("words", "47");
    let given = fixture.harness(&format!("{gate} --baseline HEAD~1 --mesher given"));
    assert!(given.printed.contains("words 40 -> 47"), "{}", given.printed);
    let two = fixture.harness(&format!("{gate} --baseline HEAD~1 --candidate HEAD --mesher given"));
    assert_eq!(two.code, 2, "{}", two.printed);
    // Whatever a build depends on, it is that of now: what an earlier one left is not taken for its result.
    let both = format!("{gate} --baseline HEAD~1 --candidate HEAD");
    let more = fixture.harness_with(&both, "MORE", "1");
    assert!(more.printed.contains("words 401 -> 411"), "{}", more.printed);
    assert_eq!(fixture.harness_with(&both, "RUSTFLAGS", "-bad").code, 2);
    assert!(fixture.harness(&both).printed.contains("words 40 -> 41"));
    let without = build.replace("'sh', 'make', '{target}'", "'true'");
    fixture.write("built.toml", &format!("{engine}{without}"));
    let stale = fixture.harness(&format!("{gate} --baseline HEAD"));
    let is_found =
        stale.printed.contains("the working tree: the build succeeded, but did not rebuild ");
    assert_eq!((stale.code, is_found), (2, true), "{}", stale.printed);
    let elsewhere = fixture.harness(&format!("{} --baseline HEAD~1", gate.replace("other/", ".")));
    assert_eq!(elsewhere.code, 2, "{}", elsewhere.printed);
}

/// Nothing is compared: no rules, no layers, a program without counters.
#[test]
fn a_gate_that_compared_nothing_is_not_green() {
    let fixture = Fixture::new();
    let gate = "gate --engine engine.toml --rules gate.toml --layers counters";
    let alone = fixture.harness(gate);
    assert_eq!(alone.code, 0, "{}", alone.printed);
    assert!(alone.printed.contains("no baseline was given"), "{}", alone.printed);
    let engine = fs::read_to_string(fixture.path("engine")).unwrap();
    let silent = engine.replace("\"counters\": {\"words\": [%s, 0]}", "\"facets\": %s");
    assert_ne!(silent, engine);
    fixture.program("silent", &silent);
    for also in ["", " --require-layers"] {
        let baseline = format!("{gate} --baseline silent --candidate engine{also}");
        let outcome = fixture.harness(&baseline);
        assert_eq!(outcome.code, 3, "{}", outcome.printed);
        let why = "INCOMPLETE: counters of case: counters: no quantity but cells is in both";
        assert!(outcome.printed.contains(why), "{}", outcome.printed);
    }
    let other =
        fixture.harness(&format!("{} --baseline engine", gate.replace("counters", "instructions")));
    assert_eq!(other.code, 3, "{}", other.printed);
    assert!(other.printed.contains("the rules have no case for instructions"), "{}", other.printed);
    // Neither program says how much memory it takes, and the engine file says that they do.
    let description = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    fixture.write("engine.toml", &description.replace("[run]", "reports_memory = true\n[run]"));
    fixture.write("gate.toml", "[[case]]\nname = \"case.toml\"\nlayers = [\"memory\"]\n");
    let memory = gate.replace("--layers counters", "--baseline engine --candidate engine");
    let memory = fixture.harness(&memory);
    assert_eq!(memory.code, 3, "{}", memory.printed);
    fixture.write("gate.toml", "[tolerance]\ncounters = 0.0\n");
    let none = fixture.harness(&format!("{gate} --baseline engine"));
    assert_eq!(none.code, 2, "{}", none.printed);
    assert!(none.printed.contains("it has no [[case]]"), "{}", none.printed);
}

#[test]
fn a_program_that_is_replaced_while_it_is_measured_gives_no_result() {
    let fixture = Fixture::new();
    let engine = fs::read_to_string(fixture.path("engine")).unwrap();
    fixture.program("moving", &format!("{engine}\necho '#' >> \"$0\"\n"));
    let gate = "gate --engine engine.toml --rules gate.toml --layers counters";
    let outcome = fixture.harness(&format!("{gate} --baseline engine --candidate moving"));
    let is_said = outcome.printed.contains("moving was replaced while it was measured");
    assert!(outcome.code == 2 && is_said, "{}", outcome.printed);
}

#[test]
fn rules_that_cannot_be_followed_are_refused() {
    let fixture = Fixture::new();
    fixture.write("invalid.toml", "spacing_min = -1.0\n");
    let rules = fs::read_to_string(fixture.path("gate.toml")).unwrap();
    let also = |case: &str| format!("{rules}[[case]]\nname = '{case}'\nlayers = ['counters']\n");
    for (wrong, code, why) in [
        (also("missing.toml"), 2, "missing.toml"),
        (also("invalid.toml"), 2, "invalid.toml"),
        (format!("[tolerance]\nmemory = -1.0\n{rules}"), 2, "effects and budget_s must"),
        (format!("[tolerance.of]\nwords = nan\n{rules}"), 2, "effects and budget_s must"),
        (
            format!("[tolerance.of]\nwords = 5.0\n'2 ranks/words' = 1.0\n{rules}"),
            0,
            "nothing got worse",
        ),
    ] {
        fixture.write("gate.toml", &wrong);
        let gate = "gate --engine engine.toml --rules gate.toml --layers counters";
        let outcome = fixture.harness(&format!("{gate} --baseline engine"));
        let has = outcome.printed.contains(why);
        assert!(outcome.code == code && has, "{wrong}: {}", outcome.printed);
    }
    let Outcome { code, printed } = fixture.harness("gate --engine engine.toml --baseline engine");
    assert!(code == 2 && printed.contains("give --rules FILE"), "{code}: {printed}");
}

#[test]
fn a_counter_that_vanishes_is_not_green() {
    let fixture = Fixture::new();
    let engine = fs::read_to_string(fixture.path("engine")).unwrap();
    let counts = "\"counters\": {\"words\"";
    fixture.program("more", &engine.replace(counts, "\"counters\": {\"hops\": [4], \"words\""));
    let gate = "gate --engine engine.toml --rules gate.toml --baseline more --candidate engine";
    let outcome = fixture.harness(gate);
    assert_eq!(outcome.code, 3, "{}", outcome.printed);
    let why = "INCOMPLETE: counters of case: 2 ranks/hops: the candidate does not report it";
    assert!(outcome.printed.contains(why), "{}", outcome.printed);
}

#[test]
fn memory_that_grows_fails_the_gate() {
    let fixture = Fixture::new();
    let rules = fs::read_to_string(fixture.path("gate.toml")).unwrap();
    fixture.write("gate.toml", &rules.replace("[\"counters\"]", "[\"counters\", \"memory\"]"));
    let engine = fs::read_to_string(fixture.path("engine")).unwrap();
    let reports = |name: &str, bytes: u64| {
        let with = format!("\"peak_rss_bytes\": {bytes}, \"counters\"");
        fixture.program(name, &engine.replace("\"counters\"", &with));
    };
    reports("small", 50 << 20);
    reports("large", 82 << 20);
    let gate = "gate --engine engine.toml --rules gate.toml";
    let outcome = fixture.harness(&format!("{gate} --baseline small --candidate large"));
    assert_eq!(outcome.code, 1, "{}", outcome.printed);
    assert!(outcome.printed.contains("REGRESSION in memory"), "{}", outcome.printed);
    let back = fixture.harness(&format!("{gate} --baseline large --candidate small"));
    assert_eq!(back.code, 0, "{}", back.printed);
    // Every third time, both runs of a measurement have a peak that is missed: first those of the baseline.
    let run = "n=$(cat \"$here/runs\" || echo 0); echo $((n + 1)) > \"$here/runs\"\n\
               peak=$((n / 2 % 3 == 0 ? 50000000 : 82000000))\n";
    let sampled = engine.replace("mesh=right", &format!("{run}mesh=right"));
    let reported = "\"peak_rss_bytes\": '\"$peak\"', \"counters\"";
    fixture.program("sampled", &sampled.replace("\"counters\"", reported));
    let same = fixture.harness(&format!("{gate} --baseline sampled --candidate sampled"));
    assert_eq!(same.code, 0, "{}", same.printed);
    assert!(fs::read_to_string(fixture.path("runs")).unwrap().trim().parse::<u32>().unwrap() > 4);
    // A baseline that crashes when it is measured again shows nothing about the candidate.
    let crash = run.replace("runs", "again").replace("peak=", "[ $n -lt 2 ] || exit 9; peak=");
    let crashes = engine.replace("mesh=right", &format!("{crash}mesh=right"));
    fixture.program("crashes", &crashes.replace("\"counters\"", reported));
    let unknown = fixture.harness(&format!("{gate} --baseline crashes --candidate large"));
    assert_eq!(unknown.code, 3, "{}", unknown.printed);
    let why = "case: runs; a repetition of the baseline has no result";
    assert!(unknown.printed.contains(why), "{}", unknown.printed);
}

#[test]
fn an_output_that_cannot_be_written_is_noticed_before_measuring() {
    let fixture = Fixture::new();
    for option in ["--record", "--junit", "--json", "--markdown"] {
        let gate = format!("gate --engine engine.toml --rules gate.toml {option} case.toml/out");
        let outcome = fixture.harness(&gate);
        assert_eq!(outcome.code, 2, "{}", outcome.printed);
        assert!(!outcome.printed.contains("harness gate: counters"), "{}", outcome.printed);
    }
    fixture.write("record.json", &measured("words", 1));
    let track = fixture.harness("track history.jsonl --add record.json --page case.toml/out");
    assert_eq!(track.code, 2, "{}", track.printed);
    assert!(!fixture.path("history.jsonl").exists());
}

/// The programs under comparison are inputs, and so is a script that an engine's command names.
#[test]
fn an_output_that_would_replace_a_program_is_refused() {
    let fixture = Fixture::new();
    fixture.engine("other", 0);
    let through_shell = fs::read_to_string(fixture.path("engine.toml")).unwrap();
    let words = "[\"sh\", \"{here}/engine\", ";
    fixture.write(
        "script.toml",
        &through_shell
            .replace("[\"{program}\", ", words)
            .replace("program = \"{here}/engine\"", ""),
    );
    let gate = "gate --rules gate.toml --engine";
    let compare = format!("{gate} engine.toml --baseline other --candidate engine");
    for command in [
        format!("{compare} --json other"),
        format!("{compare} --record engine"),
        format!("{gate} engine.toml --json engine"),
        format!("{gate} script.toml --markdown engine"),
    ] {
        let before = ["engine", "other"].map(|name| fs::read(fixture.path(name)).unwrap());
        let outcome = fixture.harness(&command);
        assert_eq!(outcome.code, 2, "{command}: {}", outcome.printed);
        assert!(outcome.printed.contains("give the output another name"), "{}", outcome.printed);
        assert_eq!(["engine", "other"].map(|name| fs::read(fixture.path(name)).unwrap()), before);
    }
}
