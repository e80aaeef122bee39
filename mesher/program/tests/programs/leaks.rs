//! What users see of a geometry that leaks.

use crate::process::{Workspace, read_json, run};
use crate::support::schedules::write;
use crate::support::{Small, rooms, slit};
use mesher::input::lattice::Keep;
use serde_json::{Value, json};

/// Runs the mesher on a case; returns its warnings and the leaks in report and manifest. With `--strict`, a warning is an error and leaves no mesh.
fn meshed(case: &Small, comm: &str) -> (Vec<String>, Value) {
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
        let (warnings, leaks) = meshed(&slit(6.0, 20.0, Keep::Outside, vec![]), comm);
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
        assert_eq!(meshed(&closed, comm), (vec![], json!([])));
        // Wider than the cells of any spacing that is compared.
        let (warnings, leaks) = meshed(&slit(20.0, 11.0, Keep::Outside, vec![]), comm);
        assert_eq!((warnings.len(), leaks), (1, json!([])));
        assert!(
            warnings[0].starts_with("the facets bound no inside at spacings of 2, 4 and 8"),
            "{warnings:?}"
        );
        // An inner flow without an inside is none, strictly.
        let (warnings, leaks) = meshed(&slit(20.0, 11.0, Keep::Inside, vec![]), comm);
        assert_eq!((warnings.len(), leaks), (1, json!([])));
        assert!(warnings[0].starts_with("nothing is inside the geometry"), "{warnings:?}");
        let mut sheet = closed;
        sheet.facets.truncate(2);
        assert_eq!(meshed(&sheet, comm), (vec![], json!([])));
    }
}

/// It is described at the finest spacing that closes it; the others are in the report.
#[test]
fn the_warning_names_the_largest_region_with_the_narrowest_range_of_spacings() {
    let two = rooms(6.0, 20.0, Keep::Inside, vec![[20.0; 3]]);
    let (warnings, leaks) = meshed(&two, "--comm=solo");
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
    let (warnings, leaks) = meshed(&both, "--comm=sim:3");
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
