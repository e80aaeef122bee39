//! Promises of a foreign mesher: every one is shown to fail on a defect that breaks it, and nothing else is checked.

mod fixture;

use fixture::{Fixture, Outcome};

/// A defect of the mesh, a promise that it breaks, and the check that must report it.
const BROKEN: [(&str, &str, &str); 9] = [
    ("complete", "complete = true", "complete"),
    ("surface", "surface = { tolerance_cells = 0.0 }", "surface"),
    ("boxes", "boxes = true", "boxes"),
    ("sides", "sides = { band_cells = 6.0 }", "sides"),
    ("corner", "balance = 'corner'", "balance"),
    ("edge", "balance = 'edge'", "balance"),
    ("face", "balance = 'face'", "balance"),
    ("layers", "layers = true", "layer"),
    ("layer-at-surface", "layers = true", "layer"),
];

/// Everything that the right mesh keeps.
const ALL: &str = "complete = true\nsurface = { tolerance_cells = 0.0 }\nboxes = true\n\
                   sides = { band_cells = 6.0 }\nbalance = 'corner'\nlayers = true\ndeterministic = true\n\
                   independent_of = ['ranks', 'partitioner']";

fn failed(outcome: &Outcome, check: &str) -> bool {
    outcome.code == 1 && outcome.printed.contains(check)
}

#[test]
fn a_mesh_that_keeps_every_promise_passes_every_command() {
    let fixture = Fixture::new();
    fixture.engine("right", ALL);
    let verified = fixture.verify("--ranks 2,3 --out out --keep --require mpi,checks");
    assert_eq!(verified.code, 0, "{}", verified.printed);
    assert!(verified.printed.contains("0 fail, 0 left out"), "{}", verified.printed);
    // Two partitioners on two rank counts; the base level cannot be chosen.
    for layout in ["ranks-2-metis", "ranks-3-morton"] {
        assert!(fixture.path("out/case").join(layout).is_dir(), "{layout}");
    }
    let mesh = "out/case/serial/mesh";
    for command in [
        format!("audit {mesh} --promises foreign.toml --case case.toml --require-checks"),
        "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine --require-layers".to_owned(),
        "shrink case.toml --engine foreign.toml --test-only".to_owned(),
    ] {
        let outcome = fixture.harness(&command);
        assert_eq!(outcome.code, 0, "{command}: {}", outcome.printed);
    }
}

#[test]
fn every_broken_promise_is_reported_by_verify_audit_gate_and_shrink() {
    let fixture = Fixture::new();
    for (mesh, promise, check) in BROKEN {
        fixture.engine(mesh, promise);
        let verified = fixture.verify("--no-mpi --out out");
        assert!(failed(&verified, &format!("serial: {check}: ")), "{mesh}: {}", verified.printed);
        assert!(verified.printed.contains(" 1 fail, "), "{mesh}: {}", verified.printed);
        let audit = "audit out/case/serial/mesh --promises foreign.toml --case case.toml";
        let audited = fixture.harness(audit);
        assert!(failed(&audited, "finding"), "{mesh}: {}", audited.printed);
        let gate = "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine";
        let gated = fixture.harness(gate);
        assert!(failed(&gated, &format!("serial: {check}")), "{mesh}: {}", gated.printed);
        let shrink = "shrink case.toml --engine foreign.toml --test-only";
        let probed = fixture.harness(shrink);
        assert!(failed(&probed, &format!("{check}: serial: ")), "{mesh}: {}", probed.printed);
    }
}

#[test]
fn what_is_not_promised_is_not_checked() {
    let fixture = Fixture::new();
    for (mesh, _, check) in BROKEN {
        let promise =
            if check == "balance" { "complete = true" } else { "balance = 'face'\nratio = 4" };
        fixture.engine(mesh, promise);
        let verified = fixture.verify("--no-mpi");
        assert_eq!(verified.code, 0, "{mesh}: {}", verified.printed);
    }
    // A corner or an edge is no face.
    for mesh in ["corner", "edge"] {
        fixture.engine(mesh, "balance = 'face'");
        assert_eq!(fixture.verify("--no-mpi").code, 0, "{mesh}");
    }
}

#[test]
fn a_mesh_that_depends_on_what_it_must_not_is_reported() {
    let fixture = Fixture::new();
    fixture.engine("repetition", "deterministic = true");
    let repeated = fixture.verify("--no-mpi");
    assert!(failed(&repeated, "deterministic: two serial runs differ"), "{}", repeated.printed);
    let command = format!(" --engine {} ", fixture.path("foreign.toml").display());
    assert!(repeated.printed.contains(&command), "{}", repeated.printed);
    for (of, subject) in [("ranks", "3 ranks"), ("partitioner", "metis")] {
        fixture.engine(of, &format!("independent_of = ['{of}', 'ranks']"));
        let verified = fixture.verify("--ranks 2,3");
        let reported = failed(&verified, "identical: first difference");
        assert!(reported && verified.printed.contains(subject), "{of}: {}", verified.printed);
    }
    // Ranks of an engine that does not promise to be independent of them have to keep the other promises only.
    fixture.engine("ranks", "balance = 'corner'");
    let verified = fixture.verify("--ranks 2,3");
    assert_eq!(verified.code, 0, "{}", verified.printed);
    fixture.engine("ranks", "layers = true");
    let verified = fixture.verify("--ranks 2,3");
    assert!(failed(&verified, "3 ranks: layer: "), "{}", verified.printed);
}

/// An engine that copies a forest of p4est, and whose run report, of rank 0 alone, has neither a digest nor a number of ranks.
const FOREST: &str = r#"
[run]
serial = ["sh", "{here}/copy"]
parallel = ["{launcher}", "sh", "{here}/copy"]
out = ["{out}.p8est"]
json = ["{json}"]
format = "p4est"
[promises]
complete = true
balance = "corner"
deterministic = true
independent_of = ["ranks"]
"#;

fn copying(fixture: &Fixture, sample: &str) {
    let samples = format!("{}/../contract/tests/samples", env!("CARGO_MANIFEST_DIR"));
    let cells =
        std::fs::read_to_string(format!("{samples}/{sample}.csv")).unwrap().lines().count() - 1;
    let script = format!(
        "echo run >> ${{0%/*}}/seen\nfor file; do case $file in *.p8est) cp {samples}/{sample}.p8est $file ;; \
         *) echo '{{\"cells\": {cells}}}' > $file ;; esac; done\n"
    );
    fixture.write("copy", &script);
}

#[test]
fn an_engine_in_a_format_of_its_own_needs_neither_digest_nor_ranks() {
    let fixture = Fixture::new();
    fixture.write("forest.toml", FOREST);
    copying(&fixture, "unitcube");
    let verify = "verify case.toml --engine forest.toml --ranks 2,3";
    let verified = fixture.harness(verify);
    assert_eq!(verified.code, 0, "{}", verified.printed);
    assert!(verified.printed.contains("0 fail, 0 left out"), "{}", verified.printed);
    assert!(verified.printed.contains("no run report states `ranks`"), "{}", verified.printed);
    // What it does not promise needs no oracle, and its time is the harness's.
    assert!(!verified.printed.contains("oracles"), "{}", verified.printed);
    let serial = verified.printed.lines().find(|line| line.contains(" serial ")).unwrap();
    assert_eq!(serial.split_whitespace().nth(8), Some("-"), "{serial}");
    // This forest fills a part of its root.
    copying(&fixture, "brick");
    let verified = fixture.harness(verify);
    assert!(failed(&verified, "serial: complete: "), "{}", verified.printed);
    fixture.write("forest.toml", &FOREST.replace("[\"{out}.p8est\"]", "[\"{out}.json\"]"));
    let unwritten = fixture.harness(verify);
    assert!(failed(&unwritten, "wrote a mesh that cannot be imported: "), "{}", unwritten.printed);
    fixture.write("forest.toml", &FOREST.replace("[\"{out}.p8est\"]", "[\"-\", \"{out}.p8es\"]"));
    std::fs::remove_file(fixture.path("seen")).unwrap();
    fixture.write("case.toml", "spacing_min = 'fine'\n");
    let refused = fixture.harness(verify);
    assert_eq!((refused.code, fixture.path("seen").exists()), (2, false), "{}", refused.printed);
    let why = "case.toml: line 1, spacing_min: invalid type: string \"fine\", expected a number; for example spacing_min = 0.01";
    assert!(refused.printed.contains(why), "{}", refused.printed);
}

#[test]
fn promises_can_be_given_on_the_command_line() {
    let fixture = Fixture::new();
    fixture.engine("corner", "complete = true");
    assert_eq!(fixture.verify("--no-mpi --out out --keep").code, 0);
    let audit = |promises: &str| {
        let words =
            ["audit", "out/case/serial/mesh", "--case", "case.toml", "--promises", promises];
        fixture.harness_with(&words)
    };
    let outcome = audit("complete = true, balance = 'edge'");
    assert_eq!(outcome.code, 0, "{}", outcome.printed);
    let outcome = audit("balance = 'corner'");
    assert!(failed(&outcome, "finding"), "{}", outcome.printed);
    let outcome = audit("balance = corner");
    assert_eq!(outcome.code, 2, "{}", outcome.printed);
    assert!(outcome.printed.contains("for example"), "{}", outcome.printed);
}

#[test]
fn shrinking_keeps_the_named_check_and_no_other() {
    let fixture = Fixture::new();
    fixture
        .engine("corner", "surface = { tolerance_cells = 0.0 }\nbalance = 'corner'\nlayers = true");
    let passed = fixture.harness("shrink case.toml --engine foreign.toml --check surface");
    assert_eq!(passed.code, 0, "{}", passed.printed);
    assert!(passed.printed.contains("does not fail surface"), "{}", passed.printed);
    // The imbalance does not depend on the body, but a thin layer needs n = 2 at least.
    for (check, n) in [("balance", "layer_cells_min = 1"), ("layer", "layer_cells_min = 2")] {
        let shrink =
            format!("shrink case.toml --engine foreign.toml --check {check} --out {check}");
        let outcome = fixture.harness(&shrink);
        assert!(failed(&outcome, &format!("{check}: serial: ")), "{}", outcome.printed);
        let case = std::fs::read_to_string(fixture.path(check).join("case.toml")).unwrap();
        assert!(case.contains(n), "{check}: {case}");
        let repeat =
            format!("shrink {check}/case.toml --engine foreign.toml --test-only --check {check}");
        assert_eq!(fixture.harness(&repeat).code, 1, "{check}");
    }
}

#[test]
fn a_case_that_the_engine_declines_is_left_out_by_every_command() {
    let fixture = Fixture::new();
    fixture.engine("right", "complete = true\n[limits]\nlevel_max = 4");
    let why = "foreign.toml does not support level 5 (level_max in [limits])";
    let gate =
        "gate --engine foreign.toml --rules gate.toml --layers correctness --reference ./engine";
    let verify = "verify case.toml --engine foreign.toml --reference ./engine --no-oracles --no-p4est --no-mpi";
    fixture.write("mesh/empty", "");
    let audit = "audit mesh --promises foreign.toml --case case.toml";
    for (command, require) in
        [(gate, "--require-layers"), (verify, "--require checks"), (audit, "--require-checks")]
    {
        let outcome = fixture.harness(command);
        // Of the cases of the gate's rules, none was named.
        let code = if command == gate { [0, 3] } else { [3, 3] };
        assert!(code.contains(&outcome.code), "{command}: {}", outcome.printed);
        let green =
            ["all hold", "nothing got worse"].iter().any(|text| outcome.printed.contains(text));
        assert!(!green && outcome.printed.contains(why), "{command}: {}", outcome.printed);
        let required = fixture.harness(&format!("{command} {require}"));
        assert_eq!(required.code, 3, "{command} {require}: {}", required.printed);
    }
    let shrink = fixture.harness("shrink case.toml --engine foreign.toml");
    assert_eq!((shrink.code, shrink.printed.contains(why)), (3, true), "{}", shrink.printed);
}
