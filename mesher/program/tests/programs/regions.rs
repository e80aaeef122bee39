//! The kept region: seeds, enclosed components, leaks, what is reported about them, and warnings.

use crate::process::{Workspace, read_json, run};
use crate::support::schedules::write;
use crate::support::{Facet, Run, Small, config, cuboid, rooms, slit, small, soup};
use bricks::octant::position;
use mesher::input::lattice::{Enclosed, Keep, Root};
use proptest::prelude::*;
use serde_json::{Value, json};

fn case(facets: Vec<Facet>, keep: Keep) -> Small {
    Small {
        facets,
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 2.0,
        layer_cells_min: 2,
        keep,
        keep_crossing: true,
        boxes: Vec::new(),
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

/// A sealed box in a box: the cavity is outside by the parity of rays.
fn box_in_box() -> Vec<Facet> {
    let mut facets = cuboid([9.0; 3], [55.0; 3]);
    facets.extend(cuboid([23.0; 3], [41.0; 3]));
    facets
}

/// Without its facets at x = 9, so that the flow can leave it.
fn open_box() -> Vec<Facet> {
    let is_wall = |f: &Facet| f.iter().any(|v| v[0] != 9.0);
    cuboid([9.0; 3], [55.0; 3]).into_iter().filter(is_wall).collect()
}

/// Minimum corner and edge of the leaf of a word, in cells of edge 64 / 2^19.
fn cube(word: u64) -> ([u32; 3], u32) {
    (position(word >> 7), 1 << (19 - (word >> 2 & 31)))
}

/// Whether all leaves of a mesh on a root of edge 64 that meet the cavity of [`box_in_box`] cross.
fn cavity_is_empty(words: &[u64]) -> bool {
    let within = |word: &&u64| {
        let (min, edge) = cube(**word);
        let middle = min.map(|c| (f64::from(c) + f64::from(edge) / 2.0) * 64.0 / 524_288.0);
        middle.iter().all(|c| (23.0..41.0).contains(c))
    };
    words.iter().filter(within).all(|w| w & 3 == 2)
}

#[test]
fn a_sealed_cavity_is_deleted_unless_it_is_to_be_kept() {
    for ranks in [1, 3, 8] {
        let run = Run { ranks, seed: 5, ..Run::SOLO };
        let deleted = case(box_in_box(), Keep::Outside).outcome(&run, false);
        assert!(cavity_is_empty(&deleted.words), "{ranks} ranks");
        let summary = deleted.summary;
        assert_eq!((summary.outside, summary.inside), (2, 1));
        // The cavity is 18 long; 16 of it are free of the crossing leaves at its walls: 4096 / 8 leaves of edge 2,
        // of which most are siblings that were never split.
        let enclosed = summary.enclosed;
        let base = case(box_in_box(), Keep::Outside).outcome(&run, true);
        let in_cavity = |w: &&u64| cavity_is_empty(&[**w & !3]) != cavity_is_empty(&[**w | 2]);
        let leaves = base.words.iter().filter(|w| *w & 3 == 0).filter(in_cavity).count() as u64;
        assert_eq!((enclosed.count, enclosed.leaves), (1, leaves));
        let place = enclosed.example.expect("the cavity is enclosed");
        assert!(place.iter().all(|c| (23.0..41.0).contains(c)), "{place:?}");
        assert_eq!(base.summary, summary, "the base tree's manifest reports the same");

        let kept = Small { enclosed: Enclosed::Keep, ..case(box_in_box(), Keep::Outside) };
        let kept = kept.outcome(&run, false);
        assert!(!cavity_is_empty(&kept.words));
        assert_eq!((kept.summary.outside, kept.summary.enclosed.count), (2, 0));
    }
}

/// If the root's boundary is inside or crossing, no outside component has a face on it.
#[test]
fn without_a_far_field_nothing_is_enclosed() {
    let mut facets = cuboid([-1.0; 3], [65.0; 3]);
    facets.extend(cuboid([9.0; 3], [20.0; 3]));
    facets.extend(cuboid([30.0; 3], [50.0; 3]));
    let outcome = case(facets, Keep::Outside).outcome(&Run::SOLO, false);
    assert_eq!((outcome.summary.outside, outcome.summary.enclosed.count), (2, 0));
    assert!(outcome.words.iter().any(|w| w & 3 == 0));
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn flow_from_seeds_equals_the_reference(
        case in small(soup()),
        picks in prop::collection::vec((any::<prop::sample::Index>(), [0i64..256, 0i64..256, 0i64..256]), 1..4),
        run in crate::support::run(),
    ) {
        let mut free = case.solo(true);
        free.retain(|w| w & 3 != 2);
        prop_assume!(!free.is_empty());
        let seed = |(pick, part): &(prop::sample::Index, [i64; 3])| {
            let (min, edge) = cube(*pick.get(&free));
            // On the minimum faces, which belong to the leaf, or anywhere in it.
            let q = std::array::from_fn(|a| i64::from(min[a]) * 256 + part[a] * i64::from(edge));
            case.root.locate(q)
        };
        let seeds: Vec<[f64; 3]> = picks.iter().map(seed).collect();
        let case = Small { seeds, ..case.clone() };
        for ungraded in [true, false] {
            let (got, want) = (case.outcome(&run, ungraded), case.reference_outcome(ungraded));
            assert_same!(got.words, want.words, "ungraded {ungraded}");
            prop_assert_eq!(got.summary, want.summary);
            prop_assert_eq!(got.summary.ambiguous.count, 0);
        }
    }

    /// Which seed is refused, and the point that is offered instead.
    #[test]
    fn unusable_seeds_are_refused_as_by_the_reference(
        case in small(soup()),
        seeds in prop::collection::vec([-9.0f64..73.0, -9.0f64..73.0, -9.0f64..73.0], 1..3),
        run in crate::support::run(),
    ) {
        let case = Small { seeds, ..case };
        // The error's numbers: the seed's and the coordinates.
        let numbers = |message: String| -> Vec<f64> {
            let is_part = |c: char| c.is_ascii_digit() || "-.e".contains(c);
            message.split(|c| !is_part(c)).filter_map(|n| n.trim_end_matches('.').parse().ok()).collect()
        };
        let got = case.try_outcome(&run, false).map_err(|e| numbers(e.to_string()));
        match (got, reference::mesh(&case.reference_case())) {
            (Ok(got), Ok(want)) => prop_assert_eq!(got.words, want.words),
            (Err(got), Err(want)) => {
                let want = numbers(want.to_string());
                let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
                let agree = got.len() == want.len() && got.iter().zip(&want).all(near);
                prop_assert!(agree, "{got:?} instead of {want:?}");
            }
            (got, want) => prop_assert!(false, "{got:?} instead of {want:?}"),
        }
    }
}

/// An ASCII STL file.
fn stl(facets: &[Facet]) -> String {
    let vertex = |v: &[f32; 3]| format!("vertex {} {} {}\n", v[0], v[1], v[2]);
    let facet = |f: &Facet| {
        let vertices: String = f.iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    format!("solid body\n{}endsolid body\n", facets.iter().map(facet).collect::<String>())
}

/// The JSON report and the error output of the mesher on these facets.
fn meshed(facets: &[Facet], options: &[&str]) -> (Value, String) {
    let workspace = Workspace::new();
    workspace.write("body.stl", stl(facets));
    let args = ["body.stl", "--spacing-min", "2", "--root", "0,0,0,64", "--json", "report.json"];
    let finished = run(workspace.mesher(&[&args[..], options].concat()));
    assert_eq!(finished.code, Some(0), "{finished:?}");
    (crate::process::read_json(&workspace.path().join("report.json")), finished.stderr)
}

#[test]
fn the_report_counts_components_by_side_and_those_that_are_enclosed() {
    let (report, stderr) = meshed(&box_in_box(), &[]);
    for (key, value) in [("outside", json!(2)), ("inside", json!(1))] {
        assert_eq!(report["components"][key], value, "{key}");
    }
    let enclosed = &report["components"]["enclosed"];
    assert_eq!((&enclosed["count"], &report["warnings"]), (&json!(1), &json!([])));
    assert!(enclosed["leaves"].as_u64().is_some_and(|n| n > 0));
    assert_eq!(enclosed["example"].as_array().map(Vec::len), Some(3));
    assert_eq!(stderr, "");
    let (kept, _) = meshed(&box_in_box(), &["--enclosed", "keep"]);
    let enclosed = &kept["components"]["enclosed"];
    assert_eq!((&enclosed["count"], &enclosed["example"]), (&json!(0), &json!(null)));
    assert!(kept["cells"].as_u64() > report["cells"].as_u64());
}

#[test]
fn a_seed_in_the_solid_makes_it_the_flow() {
    let (report, _) = meshed(&box_in_box(), &["--keep", "inside", "--seed", "16,32,32"]);
    let components = &report["components"];
    assert_eq!((&components["inside"], &components["outside"]), (&json!(1), &json!(2)));
    let seeds = ["--keep", "inside", "--seed", "32,32,32", "--seed", "16,32,32"];
    let (report, _) = meshed(&box_in_box(), &seeds);
    assert_eq!(report["components"]["inside"], 2);
}

#[test]
fn a_flow_that_leaks_and_a_region_without_cells_produce_warnings() {
    for (facets, options, expected) in [
        (open_box(), &["--keep", "inside"][..], "nothing is inside the geometry"),
        (
            open_box(),
            &["--keep", "inside", "--seed", "32,32,32"],
            "the flow reaches the root's boundary: right if the root cuts the geometry",
        ),
        (cuboid([-1.0; 3], [65.0; 3]), &["--keep", "outside"], "nothing is outside the geometry"),
        (
            cuboid([-1.0; 3], [65.0; 3]),
            &["--keep", "inside"],
            "the flow reaches the root's boundary: right if the root cuts the geometry",
        ),
        (box_in_box(), &["--seed", "16,32,32"], "the flow of no seed reaches the root's boundary"),
        (cuboid([-8.0, 8.0, 8.0], [56.0; 3]), &[], "facets lie wholly or partly beyond the root"),
        (vec![], &[], "the geometry has no facets"),
    ] {
        let (report, stderr) = meshed(&facets, options);
        let warnings = report["warnings"].as_array().expect("a list");
        assert_eq!(warnings.len(), 1, "{options:?}: {warnings:?}");
        let warning = warnings[0].as_str().expect("a sentence");
        assert!(warning.contains(expected), "{warning}");
        assert_eq!(stderr.trim_end(), format!("mesher: warning: {warning}"));
    }
}

#[test]
fn a_box_that_refines_nothing_produces_a_warning() {
    for (corner, count) in [("64.0", 1), ("1e7", 1), ("63.0", 0)] {
        let workspace = Workspace::new();
        workspace.write("body.stl", stl(&cuboid([24.0; 3], [40.0; 3])));
        let root = "root = { origin = [0.0, 0.0, 0.0], edge = 64.0 }";
        let text = format!(
            "geometry = \"body.stl\"\nspacing_min = 2.0\n{root}\n[[box]]\nmin = [{corner}, 1.0, 1.0]\nmax = [1e8, 9.0, 9.0]\nspacing = 1.0\n"
        );
        workspace.write("case.toml", text);
        let finished = run(workspace.mesher(&["case.toml"]));
        let base = run(workspace.mesher(&["case.toml", "--ungraded"]));
        for finished in [finished, base] {
            let found = finished.stderr.matches("has no volume within the root").count();
            assert_eq!((finished.code, found), (Some(0), count), "{corner}: {finished:?}");
        }
    }
}

#[test]
fn a_body_so_far_from_the_origin_that_it_has_steps_produces_a_warning() {
    // Numbers of STL files are half a cell apart up to 2^23, and a cell above.
    for (x, count) in [(8_388_568.0, 0), (8_388_608.0, 1)] {
        let workspace = Workspace::new();
        let body = cuboid([x + 24.0, 24.0, 24.0], [x + 40.0, 40.0, 40.0]);
        workspace.write("body.stl", stl(&body));
        let root = format!("--root={x},0,0,64");
        let finished = run(workspace.mesher(&["body.stl", "--spacing-min", "1", &root]));
        let found = finished.stderr.matches("so that the body may have steps").count();
        assert_eq!((finished.code, found), (Some(0), count), "{x}: {finished:?}");
    }
}

/// What is wrong with the inputs, or guessed, is so in T0 as well; what is kept is of the mesh only.
#[test]
fn facets_beyond_the_root_and_rays_that_disagree_produce_warnings_of_t0_too() {
    let is_said = |facets: &[Facet], options: &[&str], expected: &[&str]| {
        let (report, _) = meshed(facets, options);
        let warnings = report["warnings"].as_array().expect("a list");
        let found = warnings.iter().map(|w| w.as_str().expect("a sentence"));
        let is_right = found.zip(expected).all(|(found, expected)| found.contains(expected));
        assert!(is_right && warnings.len() == expected.len(), "{options:?}: {warnings:?}");
    };
    let cut = "facets lie wholly or partly beyond the root";
    let cuboids = |x: f32| cuboid([x, 8.0, 8.0], [56.0; 3]);
    is_said(&cuboids(-8.0), &["--ungraded"], &[cut]);
    // All of it: then no hole or copy is to blame for the missing inside.
    let beyond = cuboid([-40.0, 8.0, 8.0], [-8.0, 56.0, 56.0]);
    let inside = "nothing is inside the geometry";
    is_said(&beyond, &["--keep", "inside"], &[inside, cut]);
    is_said(&beyond, &["--keep", "inside", "--ungraded"], &[inside, cut]);
    // Of a box without a side whose opening is beyond the root, rays along one axis leave through the opening.
    let mut open = cuboids(-8.0);
    open.retain(|f| f.iter().any(|v| v[0] != -8.0));
    for options in [&[][..], &["--ungraded"]] {
        is_said(&open, options, &["the rays of 1 components disagree", cut]);
    }
}

#[test]
fn a_seed_in_the_far_field_and_a_body_that_ends_at_the_root_produce_no_warnings() {
    for (facets, options) in [
        (box_in_box(), &["--seed", "2,2,2", "--seed", "16,32,32"][..]),
        (cuboid([32.0; 3], [64.0; 3]), &[]),
    ] {
        assert_eq!(meshed(&facets, options).0["warnings"], json!([]), "{options:?}");
    }
}

#[test]
fn an_unusable_seed_is_refused_with_a_point_that_can_be_used() {
    let workspace = Workspace::new();
    workspace.write("body.stl", stl(&box_in_box()));
    let args = ["body.stl", "--spacing-min", "2", "--root", "0,0,0,64", "--seed"];
    for (seed, expected) in [
        ("9,32,32", ["seed 0 at (9, 32, 32)", "crosses", "(11, 31, 31)"]),
        ("64,32,32", ["seed 0 at (64, 32, 32)", "outside the root", "(60, 28, 28)"]),
        ("1e300,0,0", ["seed 0", "outside the root", "nearest"]),
        ("nan,0,0", ["seed 0", "not finite", "three numbers"]),
    ] {
        run(workspace.mesher(&[&args[..], &[seed]].concat())).refuses(2, &expected);
    }
}

/// Runs the mesher on a case; returns its warnings and the leaks in report and manifest. With `--strict`, a warning is an error and leaves no mesh.
fn with_leaks(case: &Small, comm: &str) -> (Vec<String>, Value) {
    let workspace = Workspace::new();
    write(case, workspace.path(), "case");
    let args = ["case.toml", "--out", "mesh", "--json", "run.json", comm];
    let ended = run(workspace.mesher(&args));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let warnings = ended.stderr.lines().filter_map(|line| line.strip_prefix("mesher: warning: "));
    let warnings: Vec<String> = warnings.map(str::to_owned).collect();
    let (report, manifest) =
        (workspace.json("run.json"), read_json(&workspace.path().join("mesh/mesh.json")));
    assert_eq!((&report["warnings"], &report["leaks"]), (&json!(warnings), &manifest["leaks"]));

    let base = run(workspace.mesher(&["case.toml", "--ungraded", comm]));
    let of_leaks = |line: &&str| line.contains("leak");
    assert!(
        ended.stderr.lines().filter(of_leaks).eq(base.stderr.lines().filter(of_leaks)),
        "{base:?}"
    );

    let strict = run(workspace.mesher(&["case.toml", "--out", "strict", "--strict", comm]));
    let message = warnings.first().map_or(String::new(), |warning| format!("mesher: {warning}\n"));
    let code = i32::from(!warnings.is_empty());
    assert_eq!((strict.code, strict.stderr), (Some(code), message));
    assert_eq!(workspace.path().join("strict").exists(), code == 0);
    (warnings, manifest["leaks"].clone())
}

#[test]
fn leaks_are_warnings_or_errors() {
    for comm in ["--comm=solo", "--comm=sim:3"] {
        let (warnings, leaks) = with_leaks(&slit(6.0, 20.0, Keep::Outside, vec![]), comm);
        assert_eq!(
            (warnings.len(), &leaks[0]["spacing_coarse"], &leaks[0]["spacing_fine"]),
            (1, &json!(4.0), &json!(2.0))
        );
        let [x, y, z] = [0, 1, 2].map(|a| leaks[0]["point"][a].to_string());
        let command = format!("`harness leak case.toml --from {x},{y},{z}`")
            .replace(".0,", ",")
            .replace(".0`", "`");
        assert!(
            warnings[0].starts_with("the geometry leaks: a region with a volume of "),
            "{warnings:?}"
        );
        assert!(warnings[0].contains(&command), "{command} in {warnings:?}");

        let closed = slit(0.0, 20.0, Keep::Outside, vec![]);
        assert_eq!(with_leaks(&closed, comm), (vec![], json!([])));
        // Wider than the cells of any spacing that is compared.
        let (warnings, leaks) = with_leaks(&slit(20.0, 11.0, Keep::Outside, vec![]), comm);
        assert_eq!((warnings.len(), leaks), (1, json!([])));
        assert!(
            warnings[0].starts_with("the facets bound no inside at spacings of 2, 4 and 8"),
            "{warnings:?}"
        );
        // An inner flow without an inside is none, strictly.
        let (warnings, leaks) = with_leaks(&slit(20.0, 11.0, Keep::Inside, vec![]), comm);
        assert_eq!((warnings.len(), leaks), (1, json!([])));
        assert!(warnings[0].starts_with("nothing is inside the geometry"), "{warnings:?}");
        // Nor is one that reaches the root's boundary around the whole geometry.
        let seeds = vec![[20.0, 20.0, 20.0]];
        let (warnings, leaks) = with_leaks(&slit(20.0, 11.0, Keep::Inside, seeds), comm);
        assert_eq!((warnings.len(), leaks), (1, json!([])));
        assert!(warnings[0].starts_with("the flow reaches the root's boundary"), "{warnings:?}");
        assert!(warnings[0].contains("`harness leak case.toml --from X,Y,Z`"), "{warnings:?}");
        // An outer flow without an outside, or of seeds in the solid only, is none either.
        for (facets, seeds, said) in [
            (cuboid([-1.0; 3], [65.0; 3]), vec![], "nothing is outside the geometry"),
            (box_in_box(), vec![[16.0, 32.0, 32.0]], "keep = outside, and the flow of no seed"),
        ] {
            let outer = Small { seeds, ..case(facets, Keep::Outside) };
            let (warnings, leaks) = with_leaks(&outer, comm);
            assert_eq!((warnings.len(), leaks), (1, json!([])), "{warnings:?}");
            assert!(warnings[0].starts_with(said), "{warnings:?}");
        }
        // The largest leaves, whose rays decide, are in the body, and the space around it has their side.
        let mut open = cuboid([3.0; 3], [61.0; 3]);
        open.retain(|f| f.iter().any(|v| v[0] != 3.0));
        for keep in [Keep::Outside, Keep::All] {
            let (warnings, leaks) = with_leaks(&case(open.clone(), keep), comm);
            assert_eq!((warnings.len(), leaks), (2, json!([])), "{warnings:?}");
            let is_said =
                warnings[0].starts_with("the geometry leaks: the space around it is inside");
            assert!(
                is_said && warnings[1].starts_with("the rays of 1 components disagree"),
                "{warnings:?}"
            );
        }
        let mut sheet = closed;
        sheet.facets.truncate(2);
        assert_eq!(with_leaks(&sheet, comm), (vec![], json!([])));
    }
}

/// It is described at the finest spacing that closes it; the others are in the report.
#[test]
fn the_warning_names_the_largest_region_with_the_narrowest_range_of_spacings() {
    let two = rooms(6.0, 20.0, Keep::Inside, vec![[20.0; 3]]);
    let (warnings, leaks) = with_leaks(&two, "--comm=solo");
    assert_eq!(leaks.as_array().expect("a list").len(), 2);
    let is_said = |what: &str| assert!(warnings[0].contains(what), "{what} in {warnings:?}");
    is_said("the geometry leaks: a region with a volume of 5.1200e3 at (");
    is_said(
        "deleted at a spacing of 4, became kept at 2: close what `harness leak case.toml --to ",
    );

    // A wider slit in another box: at twice the spacing it is open.
    let mut both = slit(6.0, 20.0, Keep::Outside, vec![]);
    let wide = slit(11.0, 16.0, Keep::Outside, vec![]).facets;
    both.facets.extend(wide.into_iter().map(|f| f.map(|[x, y, z]| [x + 28.0, y, z])));
    let (warnings, leaks) = with_leaks(&both, "--comm=sim:3");
    assert_eq!(leaks.as_array().expect("a list").len(), 3);
    let volume = |i: usize| leaks[i]["volume"].as_f64().expect("a number");
    // The second box leaks at four times the spacing only, and the first one has less of its volume there.
    assert!(volume(0) > volume(1) && volume(0) > volume(2), "{leaks}");
    is_part_of_first(&leaks[1]);
    let said = format!("the geometry leaks: a region with a volume of {:.4e} at (", volume(0));
    assert!(warnings[0].starts_with(&said), "{said} in {warnings:?}");
    assert!(warnings[0].contains("inside at a spacing of 4, became outside at 2"), "{warnings:?}");
}

/// The first box begins at 10, the second one at 38.
fn is_part_of_first(leak: &Value) {
    assert!(leak["point"][0].as_f64().expect("a number") < 33.0, "{leak}");
}
