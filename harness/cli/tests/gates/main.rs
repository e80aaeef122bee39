//! `harness gate`, `shrink` and `track` as a user runs them, on an engine that a script plays.

mod play;
mod targets;

use play::Play;
use std::fs;
use std::process::Command;

const SHRINK: &str = "shrink case.toml --engine engine.toml --ranks 8";

#[test]
fn a_bug_of_three_ranks_is_shrunk_to_its_two_facets() {
    let play = Play::new();
    let done = play.harness(&format!("{SHRINK} --out tiny"));
    assert_eq!(done.code, 1, "{}", done.printed);
    let case = contract::case::Case::read(&play.path("tiny/case.toml")).unwrap();
    let mut at: Vec<f32> = case.facets.iter().map(|facet| facet[0][0]).collect();
    at.sort_by(f32::total_cmp);
    assert_eq!(at, [0.25, 0.5], "{}", done.printed);
    assert!(case.root.level_for(2.0) == Some(case.level_surface), "{}", done.printed);
    assert!(
        done.printed.contains("3 simulated ranks")
            && done.printed.contains("nothing more can be removed"),
        "{}",
        done.printed
    );
    // The mesh that was wanted has one leaf.
    assert!(
        done.printed.contains("nothing in either mesh asks for that")
            || done.printed.contains("section 3"),
        "{}",
        done.printed
    );
    let readme = fs::read_to_string(play.path("tiny/README.md")).unwrap();
    let line = readme.lines().find(|line| line.contains("harness shrink")).unwrap().trim();
    let again = play.harness(line.strip_prefix("harness ").unwrap());
    assert_eq!(again.code, 1, "{line}: {}", again.printed);
}

#[test]
fn a_passing_case_is_not_shrunk() {
    let play = Play::new();
    let done = play.harness("shrink case.toml --engine engine.toml --ranks 2 --out tiny");
    assert_eq!(done.code, 0, "{}", done.printed);
    assert!(!play.path("tiny").exists());
    assert_eq!(play.harness(&format!("{SHRINK} --check")).code, 1);
}

#[test]
fn a_counter_that_grows_fails_the_gate_and_one_that_shrinks_does_not() {
    let play = Play::new();
    play.engine("more", 1);
    let gate = "gate --engine engine.toml --rules gate.toml --layers counters";
    let done = play.harness(&format!(
        "{gate} --baseline engine --candidate more --junit gate.xml --record more.json"
    ));
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(
        done.printed.contains("regression   case.toml: words 40 -> 41 (+2.50 %)"),
        "{}",
        done.printed
    );
    assert!(fs::read_to_string(play.path("gate.xml")).unwrap().contains("failures=\"2\""));
    for better in ["--baseline more --candidate engine", "--baseline more.json --mesher engine"] {
        let done = play.harness(&format!("{gate} {better}"));
        assert_eq!(done.code, 0, "{}", done.printed);
        assert!(
            done.printed.contains("improvement  case.toml: 2 ranks/words 41 -> 40"),
            "{}",
            done.printed
        );
    }
}

#[test]
fn the_gate_reports_what_it_cannot_compare() {
    let play = Play::new();
    let done = play.harness("gate --engine engine.toml --rules gate.toml --baseline main");
    assert_eq!(done.code, 2, "{}", done.printed);
    assert!(done.printed.contains("does not say how a revision is built"), "{}", done.printed);
    let record = play
        .harness("gate --engine engine.toml --rules gate.toml --record now.json --layers counters");
    assert_eq!(record.code, 0, "{}", record.printed);
    let done = play.harness("gate --engine engine.toml --rules gate.toml --baseline now.json --layers time --require-layers");
    assert_eq!(done.code, 3, "{}", done.printed);
    assert!(done.printed.contains("a record cannot be run"), "{}", done.printed);
}

#[test]
fn a_run_on_ranks_that_makes_another_mesh_fails_the_gate() {
    let play = Play::new();
    play.write(
        "gate.toml",
        "[[case]]\nname = \"case.toml\"\nlayers = [\"counters\"]\nranks = [3]\n",
    );
    let done = play.harness(
        "gate --engine engine.toml --rules gate.toml --baseline engine --candidate engine",
    );
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(done.printed.contains("differs from the serial one"), "{}", done.printed);
}

#[test]
fn numbers_of_commits_become_a_history_with_a_change_in_it() {
    let play = Play::new();
    let git = |arguments: &str| {
        let mut command = Command::new("git");
        command.args([
            "-c",
            "user.name=a",
            "-c",
            "user.email=a@b",
            "-c",
            "init.defaultBranch=main",
        ]);
        assert!(
            command
                .args(arguments.split(' '))
                .current_dir(play.path(""))
                .status()
                .unwrap()
                .success()
        );
    };
    git("init --quiet");
    for i in 0..16 {
        git(&format!("commit --quiet --allow-empty -m commit-{i}"));
        let value = if i < 10 { 40 } else { 44 };
        let done = play.harness(&format!("track history.jsonl --value case/words={value}"));
        assert_eq!(done.code, 0, "{}", done.printed);
    }
    let forms = "--page trend.html --csv trend.csv --bencher b.json --github-benchmark g.json --junit t.xml";
    let done = play.harness(&format!("track history.jsonl --fail-recent 6 {forms}"));
    assert_eq!(done.code, 1, "{}", done.printed);
    assert!(done.printed.contains("case/words: 40 -> 44 (+10.00 %) in "), "{}", done.printed);
    assert_eq!(fs::read_to_string(play.path("trend.csv")).unwrap().lines().count(), 17);
    assert!(fs::read_to_string(play.path("trend.html")).unwrap().contains("commit-10"));
    assert_eq!(play.harness("track history.jsonl --fail-recent 5").code, 0);
}
