use super::*;

const UNIT: Facet = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn defaults_and_the_computed_root_follow_the_definition() {
    let case = Case::from_parts("spacing_min = 0.5", vec![UNIT]).unwrap();
    assert_eq!((case.layer_cells_min, case.keep, case.keep_crossing), (4, Keep::Outside, true));
    assert_eq!(case.root, Root { origin: [-9.0, -9.5, -10.0], edge: 20.0 });
    assert_eq!(case.level_surface, 6);
}

#[test]
fn boxes_are_clamped_to_the_root_and_have_their_own_level() {
    let text = "spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n\
                    [[box]]\nmin = [-4.0, 1.0, 2.0]\nmax = [4.0, 99.0, 3.0]\nspacing = 0.3";
    let case = Case::from_parts(text, vec![]).unwrap();
    let unit = 1 << 24;
    let expected =
        ExtentBox { min: [0, unit, 2 * unit], max: [4 * unit, 8 * unit, 3 * unit], level: 5 };
    assert_eq!(case.boxes, [expected]);
    assert_eq!(case.level_deepest(), 5);
}

#[test]
fn seeds_are_points_of_the_root_and_enclosed_components_are_deleted_by_default() {
    let with = |keys: &str| {
        let root = "[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0";
        Case::from_parts(&format!("spacing_min = 1.0\n{keys}\n{root}"), vec![UNIT])
    };
    let case = with("").unwrap();
    assert_eq!((case.enclosed, case.seeds), (Enclosed::Delete, vec![]));
    let case = with("seeds = [[0, 1.5, -4], [1, 1, 1]]\nenclosed = 'keep'").unwrap();
    assert_eq!(case.seeds, [[0.0, 1.5, -4.0], [1.0; 3]]);
    assert_eq!(case.rules.seeds, [[4 << 24, 11 << 23, 0], [5 << 24; 3]]);
    assert_eq!(case.enclosed, Enclosed::Keep);
    let why = with("seeds = [[0, 0, 0], [4, 0, 0]]").unwrap_err();
    assert!(
        why.starts_with(
            "seed 1 at (4, 0, 0) lies outside the root, corner [-4.0, -4.0, -4.0], edge 8;"
        ),
        "{why}"
    );
    assert!(with("seeds = [[0, 0, nan]]").unwrap_err().contains("seed 0"));
    assert!(with("enclosed = 'drop'").is_err());
}

#[test]
fn a_seed_in_a_crossing_leaf_is_an_error() {
    let seeded = |seed: [f64; 3]| {
        let text = format!(
            "spacing_min = 1.0\nseeds = [{seed:?}]\n[root]\norigin = [-1.0, -1.0, -1.0]\nedge = 8.0"
        );
        Case::from_parts(&text, vec![UNIT])
    };
    let why = seeded([0.5, 0.5, 0.5]).unwrap_err();
    assert!(why.contains("seed 0") && why.contains("facet 0 crosses"), "{why}");
    assert!(seeded([5.5, 5.5, 5.5]).is_ok());
}

#[test]
fn the_manifest_of_a_case_has_all_its_inputs() {
    let text = "spacing_min = 1.0\nlayer_cells_min = 2\nkeep = 'inside'\nkeep_crossing = false\nenclosed = 'keep'\n\
                    seeds = [[5.5, 5.5, 5.5]]\n[root]\norigin = [-1.0, -1.0, -1.0]\nedge = 8.0\n\
                    [[box]]\nmin = [0.0, 1.0, 2.0]\nmax = [4.0, 6.0, 3.0]\nspacing = 0.3";
    let case = Case::from_parts(text, vec![UNIT]).unwrap();
    let manifest = case.manifest(Tree::Base, "a program".to_owned());
    assert_eq!(
        (manifest.tree, manifest.program.as_str(), manifest.root),
        (Tree::Base, "a program", case.root)
    );
    assert_eq!((manifest.level_surface, manifest.layer_cells_min), (3, 2));
    assert_eq!(
        (manifest.keep, manifest.keep_crossing, manifest.enclosed),
        (Keep::Inside, false, Enclosed::Keep)
    );
    assert_eq!((manifest.boxes, manifest.seeds), (case.boxes.clone(), vec![[13 << 23; 3]]));
    assert_eq!((case.boxes.len(), manifest.leaves), (1, 0));
}

#[test]
fn a_box_has_positive_extent_and_spacing() {
    let with = |min: &str, max: &str, spacing: &str| {
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
        let text = format!(
            "spacing_min = 1.0\n{root}\n[[box]]\nmin = {min}\nmax = {max}\nspacing = {spacing}"
        );
        Case::from_parts(&text, vec![]).err()
    };
    assert_eq!(with("[0, 0, 0]", "[1, 1, 1]", "0.5"), None);
    let wrong = Some("box 0: min must be below max in every axis, and finite".to_owned());
    for (min, max) in [
        ("[0, 1, 0]", "[1, 1, 1]"),
        ("[0, 0, 2]", "[1, 1, 1]"),
        ("[-inf, 0, 0]", "[1, 1, 1]"),
        ("[0, 0, 0]", "[1, nan, 1]"),
        ("[0, 0, 0]", "[1, 1, inf]"),
    ] {
        assert_eq!(with(min, max, "0.5"), wrong, "{min} {max}");
    }
    assert!(with("[0, 0, 0]", "[1, 1, 1]", "0.0").unwrap().starts_with("box spacing = 0 must be"));
    assert!(with("[0, 0, 0]", "[1, 1, 1]", "1e-9").unwrap().contains("deeper than 19"));
}

#[test]
fn an_error_of_the_file_has_a_line_and_one_of_the_whole_has_none() {
    let why = |text: &str| Case::from_parts(text, vec![UNIT]).unwrap_err();
    assert_eq!(
        why("layer_cells_min = 3"),
        "missing field `spacing_min`; for example spacing_min = 0.01"
    );
    let text = "spacing_min = 1.0\n\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 'long'";
    assert!(why(text).starts_with("line 5, edge: invalid type: string"), "{}", why(text));
    let without_edge = why("spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]");
    assert_eq!(without_edge, "line 2, [root]: missing field `edge`; for example edge = 2.0");
    let both = "spacing_min = 1.0\nroot_scale = inf";
    assert_eq!(why(both), "root_scale = inf must be finite and greater than zero");
    let root = "spacing_min = 1.0\n[root]\norigin = [0.0, nan, 0.0]\nedge = 8.0";
    assert_eq!(why(root), "the root's origin is not finite");
    assert!(why("spacing_min = 0.0").starts_with("spacing_min = 0 must be finite"));
}

#[test]
fn errors_name_the_cause() {
    let why = |text: &str| Case::from_parts(text, vec![UNIT]).unwrap_err();
    let unknown = why("spacing_mim = 1.0");
    assert!(
        unknown.starts_with("line 1, spacing_mim: unknown field `spacing_mim`, expected one of"),
        "{unknown}"
    );
    let map = why("spacing_min = 1.0\nlayer_cells_min = { a = 1 }");
    assert!(map.contains("line 2, layer_cells_min: invalid type: map"), "{map}");
    let word = why("spacing_min = \"fine\"");
    assert!(word.contains("line 1, spacing_min: ") && word.contains("expected a number"), "{word}");
    let table = why("spacing_min = 1.0\n[layer_cells_min]\na = 1");
    assert!(table.contains("line 2, [layer_cells_min]: invalid type: map"), "{table}");
    for path in [r#""C:\Users\me\a.stl""#, "parts/a.stl", "12"] {
        let why = why(&format!("spacing_min = 1.0\ngeometry = {path}"));
        assert!(why.starts_with("line 2, geometry: ") && why.contains("single quotes"), "{why}");
    }
    assert!(why("spacing_min = -1.0").contains("spacing_min"));
    assert!(why("spacing_min = 1e-9").contains("deeper"));
    assert!(why("spacing_min = 1.0\nlayer_cells_min = 0").contains("layer_cells_min"));
    assert!(
        why("spacing_min = 1.0\nroot_scale = 2.0\n[root]\norigin=[0.0,0.0,0.0]\nedge=1.0")
            .contains("exclude")
    );
    assert!(Case::from_parts("spacing_min = 1.0", vec![]).unwrap_err().contains("extent"));
    let far = "spacing_min = 1.0\n[root]\norigin = [9.0, 9.0, 9.0]\nedge = 2.0";
    let why = why(far);
    assert!(why.starts_with("facet 0 has a vertex at (0, 0, 0), more than one root edge"), "{why}");
}
