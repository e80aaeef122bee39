//! Bad input ends with one sentence, the documented exit code and no files, on one rank and on several.

use crate::process::{COMMS, INPUT, Workspace, binary_stl, refused, run, tetrahedron};
use std::process::Command;

#[track_caller]
fn refused_case(text: &str, words: &[&str]) {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    workspace.write("case.toml", text);
    refused(&workspace, &["case.toml"], INPUT, &[&["case.toml"], words].concat());
}

/// For errors found when the rules are derived, after reading: these do not name the case file.
#[track_caller]
fn refused_rules(text: &str, words: &[&str]) {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    workspace.write("case.toml", format!("geometry = \"body.stl\"\n{text}"));
    refused(&workspace, &["case.toml"], INPUT, words);
}

#[test]
fn good_input_is_meshed_and_reported_unless_quiet() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    for comm in COMMS {
        let finished = run(workspace.mesher(&["body.stl", "--spacing-min", "0.5", comm]));
        finished.succeeds();
        assert!(finished.stdout.contains("cells"), "{finished:?}");
        let finished =
            run(workspace.mesher(&["body.stl", "--spacing-min", "0.5", "--quiet", comm]));
        finished.succeeds();
        assert_eq!(finished.stdout, "");
    }
}

/// METIS prints to standard output when it cannot make as many parts as requested.
#[test]
fn libraries_print_nothing() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    for comm in ["--comm=sim:2", "--comm=sim:5", "--comm=sim:16", "--comm=sim:40"] {
        for level_base in ["auto", "1", "3"] {
            let args = ["body.stl", "--spacing-min=0.1", "--partitioner=metis", "--quiet", comm];
            let finished =
                run(workspace.mesher(&[&args[..], &["--level-base", level_base]].concat()));
            finished.succeeds();
            assert_eq!(finished.stdout, "", "{comm} {level_base}");
        }
    }
}

#[test]
fn what_contradicts_the_papers_partition_is_refused() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let with = |option| ["body.stl", "--spacing-min=0.1", "--preset=paper", option];
    refused(&workspace, &with("--weights=area"), INPUT, &["--preset paper", "--weights"]);
    refused(&workspace, &with("--partitioner=metis"), INPUT, &["cannot be used multiple times"]);
    let few =
        ["body.stl", "--spacing-min=0.1", "--preset=paper", "--level-base=1", "--comm=sim:40"];
    run(workspace.mesher(&few)).refuses(INPUT, &["METIS", "40 ranks", "--level-base"]);
    run(workspace.mesher(&with("--comm=sim:3"))).succeeds();
}

#[test]
fn files_that_are_not_stl_are_refused() {
    let workspace = Workspace::new();
    let files = geometries::stl_files().into_iter().filter(|file| !file.is_valid);
    let mut count = 0;
    for geometries::StlFile { name, bytes, .. } in files {
        workspace.write(&name, bytes);
        let what: &[&str] = match name.as_str() {
            "empty.stl" => &["empty"],
            "nan.stl" | "infinite.stl" => &[".stl: facet 6", "not finite"],
            "ascii_nan.stl" | "ascii_infinite.stl" | "ascii_overflow.stl" => {
                &[&name, "facet 6", "finite"]
            }
            "count_too_large.stl" => &["promises 4294967295 facets", "484"],
            _ => &[&name],
        };
        refused(&workspace, &[&name, "--spacing-min", "0.1"], INPUT, what);
        count += 1;
    }
    assert!(count >= 20, "only {count} invalid files");
}

#[test]
fn files_that_cannot_be_read_are_refused() {
    let workspace = Workspace::new();
    let spacing = ["--spacing-min", "0.1"];
    let with = |name| [&[name][..], &spacing].concat();
    refused(&workspace, &with("absent.stl"), INPUT, &["absent.stl", "No such file"]);
    refused(&workspace, &["absent.toml"], INPUT, &["absent.toml", "No such file"]);
    std::fs::create_dir(workspace.path().join("folder.stl")).expect("a directory");
    refused(&workspace, &with("folder.stl"), INPUT, &["folder.stl"]);
    std::fs::create_dir(workspace.path().join("folder.toml")).expect("a directory");
    refused(&workspace, &["folder.toml"], INPUT, &["folder.toml"]);
    refused(&workspace, &with("/dev/null"), INPUT, &["/dev/null"]);
    // Opening a pipe would wait for a writer for ever.
    let made = Command::new("mkfifo").arg(workspace.path().join("pipe.stl")).status();
    assert!(made.expect("mkfifo is installed").success());
    refused(&workspace, &with("pipe.stl"), INPUT, &["pipe.stl"]);
}

#[test]
fn truncated_files_are_refused() {
    let whole = tetrahedron();
    for length in [1, 40, 83, 84, 85, 133, 134, whole.len() - 50, whole.len() - 1] {
        let workspace = Workspace::new();
        workspace.write("cut.stl", &whole[..length]);
        refused(&workspace, &["cut.stl", "--spacing-min", "0.1"], INPUT, &["cut.stl"]);
    }
}

#[test]
fn spacings_and_layers_out_of_range_are_refused() {
    for (value, words) in [
        ("0", &["spacing_min is 0", "positive"][..]),
        ("0.0", &["spacing_min is 0", "positive"]),
        ("-0.5", &["spacing_min is -0.5", "positive"]),
        ("nan", &["spacing_min is NaN", "positive"]),
        ("inf", &["spacing_min is inf", "positive"]),
        ("1e-9", &["spacing_min 0.000000001", "too small", "level 19"]),
        ("5e-324", &["spacing_min", "too small", "level 19"]),
    ] {
        refused_rules(&format!("spacing_min = {value}\n"), words);
        let workspace = Workspace::new();
        workspace.write("body.stl", tetrahedron());
        refused(&workspace, &["body.stl", "--spacing-min", value], INPUT, words);
    }
    refused_rules(
        "spacing_min = 0.5\nlayer_cells_min = 0\n",
        &["layer_cells_min is 0", "at least 1"],
    );
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let layers = |n| ["body.stl", "--spacing-min=0.5", "--layer-cells-min", n];
    refused(&workspace, &layers("0"), INPUT, &["layer_cells_min is 0", "at least 1"]);
    refused(&workspace, &layers("-1"), INPUT, &["--layer-cells-min"]);
    refused(&workspace, &layers("2.5"), INPUT, &["--layer-cells-min"]);
    refused(&workspace, &["body.stl"], INPUT, &["--spacing-min"]);
}

#[test]
fn roots_and_boxes_out_of_range_are_refused() {
    let root = |origin: &str, edge: &str| {
        format!("spacing_min = 0.5\n[root]\norigin = [{origin}]\nedge = {edge}\n")
    };
    for edge in ["0.0", "-8.0", "nan", "inf"] {
        refused_rules(&root("0.0, 0.0, 0.0", edge), &["edge", "positive"]);
    }
    refused_rules(&root("0.0, nan, 0.0", "8.0"), &["origin", "not finite"]);
    // One root edge outside the root is allowed, no more.
    refused_rules(&root("-100.0, 0.0, 0.0", "8.0"), &["facet 0", "outside the root"]);
    refused_rules(&root("-16.5, 0.0, 0.0", "8.0"), &["facet 0", "outside the root"]);
    refused_rules("spacing_min = 0.5\nroot_scale = 0.0\n", &["root_scale is 0", "positive"]);
    refused_rules("spacing_min = 0.5\nroot_scale = -1.0\n", &["root_scale is -1", "positive"]);
    let boxed = |min: &str, max: &str, spacing: &str| {
        format!(
            "spacing_min = 0.5\n[[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 1.0]\nspacing = 1.0\n[[box]]\nmin = [{min}]\nmax = [{max}]\nspacing = {spacing}\n"
        )
    };
    refused_rules(&boxed("0.0, 0.0, 0.0", "1.0, 0.0, 1.0", "0.5"), &["box 1", "below max"]);
    refused_rules(&boxed("0.0, 2.0, 0.0", "1.0, 1.0, 1.0", "0.5"), &["box 1", "below max"]);
    refused_rules(&boxed("0.0, -inf, 0.0", "1.0, 1.0, 1.0", "0.5"), &["box 1", "finite"]);
    for spacing in ["0.0", "-1.0", "nan"] {
        refused_rules(&boxed("0.0, 0.0, 0.0", "1.0, 1.0, 1.0", spacing), &["box 1", "positive"]);
    }
    refused_rules(&boxed("0.0, 0.0, 0.0", "1.0, 1.0, 1.0", "1e-9"), &["box 1", "too small"]);
    let workspace = Workspace::new();
    workspace.write("none.stl", binary_stl(&[]));
    workspace.write("point.stl", binary_stl(&[[[0.25; 3]; 3]]));
    for name in ["none.stl", "point.stl"] {
        refused(&workspace, &[name, "--spacing-min=0.5"], INPUT, &["no extent", "[root]"]);
    }
}

#[test]
fn case_files_with_mistakes_are_refused() {
    const GOOD: &str = "geometry = \"body.stl\"\nspacing_min = 0.5\n";
    for (text, words) in [
        (
            "geometry = \"body.stl\"\nspacing_mim = 0.5\n",
            &["line 2", "spacing_mim", "`spacing_min`"][..],
        ),
        (&format!("{GOOD}layers_min = 3\n"), &["line 3", "layers_min", "`layer_cells_min`"]),
        (&format!("{GOOD}keep_crosing = true\n"), &["keep_crosing", "`keep_crossing`"]),
        (&format!("{GOOD}[[boxes]]\nmin = [0,0,0]\n"), &["line 3", "boxes", "`box`"]),
        (&format!("{GOOD}[root]\norigin = [0.0, 0.0, 0.0]\nedges = 1.0\n"), &["edges", "`edge`"]),
        (
            &format!("{GOOD}[[box]]\nmin = [0.0,0.0,0.0]\nmax = [1.0,1.0,1.0]\nspacings = 1.0\n"),
            &["line 6", "spacings", "`spacing`"],
        ),
        (
            "spacing_min = 0.5\n[generator]\nshape = \"sphere\"\nfacet = 80\n",
            &["facet", "`facets`"],
        ),
        ("spacing_min = 0.5\n[generator]\nshape = \"spere\"\nfacets = 80\n", &["spere"]),
        ("spacing_min = 0.5\n[generator]\nshape = \"sphere\"\nfacets = 0\n", &["generator"]),
        ("spacing_min = 0.5\n", &["no geometry"]),
        (&format!("{GOOD}[generator]\nshape = \"sphere\"\nfacets = 80\n"), &["not both"]),
        (
            &format!("{GOOD}root_scale = 2.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 1.0\n"),
            &["not both"],
        ),
        (&format!("{GOOD}layer_cells_min = -4\n"), &["line 3", "`-4`", "whole number"]),
        (&format!("{GOOD}layer_cells_min = 4294967296\n"), &["line 3", "`4294967296`"]),
        (&format!("{GOOD}layer_cells_min = 1.5\n"), &["line 3"]),
        (&format!("{GOOD}keep = \"neither\"\n"), &["neither", "outside"]),
        (&format!("{GOOD}spacing_min = 0.25\n"), &["line 3", "duplicate"]),
        ("geometry = \"body.stl\"\nspacing_min = \"0.5\"\n", &["line 2"]),
        ("geometry = \"body.stl\"\nspacing_min = \n", &["line 2"]),
        ("geometry = \"body.stl\n\nspacing_min = 0.5\n", &["line 1"]),
        ("", &["no geometry"]),
        ("\u{0}\u{1}\u{2}", &["line 1"]),
    ] {
        if text.contains("facets = 0") {
            // Found when the facets are generated, so the case file is not named.
            let workspace = Workspace::new();
            workspace.write("case.toml", text);
            refused(&workspace, &["case.toml"], INPUT, words);
        } else {
            refused_case(text, words);
        }
    }
    let workspace = Workspace::new();
    workspace.write("case.toml", b"geometry = \"\xff\xfe.stl\"\n");
    refused(&workspace, &["case.toml"], INPUT, &["case.toml", "UTF-8"]);
    workspace.write("case.toml", "geometry = \"nowhere/body.stl\"\nspacing_min = 0.5\n");
    refused(&workspace, &["case.toml"], INPUT, &["nowhere/body.stl", "No such file"]);
}

#[test]
fn options_with_mistakes_are_refused() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    workspace.write("case.toml", "geometry = \"body.stl\"\nspacing_min = 0.5\n");
    let with = |more: &[&'static str]| [&["body.stl", "--spacing-min=0.5"], more].concat();
    refused(&workspace, &with(&["--keep", "some"]), INPUT, &["--keep"]);
    refused(&workspace, &with(&["--keap", "all"]), INPUT, &["--keap", "--keep"]);
    refused(&workspace, &with(&["--root", "0,0,0"]), INPUT, &["--root", "4 numbers"]);
    refused(&workspace, &with(&["--box", "0,0,0,1,1,1,x"]), INPUT, &["--box", "7 numbers"]);
    refused(&workspace, &with(&["--box", "0,0,0,1,-1,1,1"]), INPUT, &["box 0", "below max"]);
    refused(&workspace, &with(&["--root-scale", "-2"]), INPUT, &["root_scale is -2"]);
    refused(&workspace, &with(&["--level-base", "20"]), INPUT, &["--level-base"]);
    refused(&workspace, &["case.toml", "--spacing-min", "1"], INPUT, &["case.toml is a case file"]);
    for comm in ["sim:0", "sim", "sim:x", "sim:2:3:4", "sim:4097", "tcp"] {
        run(workspace.mesher(&["body.stl", "--comm", comm])).refuses(INPUT, &["--comm"]);
    }
    run(workspace.mesher(&[])).refuses(INPUT, &["INPUT"]);
}
