//! The directory: patches, regions, and what is refused.

use super::*;

/// The patches in `boundary`: name, number of faces, first face.
fn boundary_in(dir: &Path) -> Vec<(String, usize, usize)> {
    let text = fs::read_to_string(dir.join("boundary")).unwrap();
    let (_, list) = text.split_once("\n(\n").unwrap();
    let entries = list.trim_end().strip_suffix(')').unwrap().split_terminator("    }\n");
    let value = |entry: &str, key: &str| {
        let (_, rest) = entry.split_once(key).unwrap();
        rest.split_once(';').unwrap().0.trim().parse().unwrap()
    };
    let patch = |entry: &str| {
        let name = entry.trim_start().lines().next().unwrap().to_owned();
        (name, value(entry, "nFaces"), value(entry, "startFace"))
    };
    entries.map(patch).collect()
}

#[test]
fn patches_follow_the_internal_faces_and_lie_where_their_names_say() {
    let words =
        words_with_sides(|o| o.level < 2, |o| (o.corner != [0; 3]).then_some(Side::Outside));
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    let half = [[0; 3], [1 << 27, 1 << 27, 1 << 26]];
    let selection = Selection { clip: Some(half), ..Selection::default() };
    let target = dir.path().join("case/constant/polyMesh");
    write(&export(&mesh, &selection), &target).unwrap();
    let complex = complex_in(&target);
    let boundary = boundary_in(&target);
    let faces: Vec<_> = boundary.iter().map(|(name, faces, _)| (name.as_str(), *faces)).collect();
    let expected = [
        ("xMin", 7),
        ("xMax", 8),
        ("yMin", 7),
        ("yMax", 8),
        ("zMin", 15),
        ("zMax", 0),
        ("body", 3),
        ("cut", 16),
    ];
    assert_eq!(faces, expected);
    let mut next = complex.neighbour.len();
    for (name, faces, start) in &boundary {
        assert_eq!(*start, next);
        next += faces;
        let edge = mesh.manifest.root.edge;
        for vertices in &complex.faces[*start..next] {
            let on = |axis: usize, at: f64| vertices.iter().all(|&v| complex.points[v][axis] == at);
            match name.as_str() {
                "xMin" => assert!(on(0, 0.0)),
                "xMax" => assert!(on(0, edge)),
                "yMin" => assert!(on(1, 0.0)),
                "yMax" => assert!(on(1, edge)),
                "zMin" => assert!(on(2, 0.0)),
                "cut" => assert!(on(2, edge / 2.0)),
                _ => assert!((0..3).any(|axis| on(axis, edge / 4.0))),
            }
        }
    }
    assert_eq!(next, complex.faces.len());
}

#[test]
fn regions_that_no_face_connects_can_be_left_out() {
    // Two octants that touch in a corner: 64 small cells in one and a large cell in the other, which is the largest region.
    let words = words_with_sides(
        |o| o.level == 0 || o.level < 3 && o.ancestor(1).digit() == 0,
        |o| [0, 7].contains(&o.ancestor(1).digit()).then_some(Side::Outside),
    );
    let words: Vec<u64> = words.into_iter().filter(|&w| word::octant(w).corner != [0; 3]).collect();
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    for (regions, cells) in [(Regions::All, 64), (Regions::Largest, 1)] {
        let target = dir.path().join(format!("{cells}/constant/polyMesh"));
        let summary = write(&Export { regions, ..whole(&mesh) }, &target).unwrap();
        assert_eq!(summary.leaves, cells);
        assert!(
            summary.notes[1].starts_with("2 regions that no face connects: "),
            "{:?}",
            summary.notes
        );
        complex_in(&target).assert_closed(cells as usize);
    }
}

#[test]
fn what_exists_is_not_replaced_and_what_fails_leaves_nothing() {
    let words = words_with_sides(|o| o.level < 2, |_| Some(Side::Outside));
    let (dir, mesh) = on_disk(&leaf_set(vec![words]));
    let case = dir.path().join("case");
    let refused = |selection: &Selection| {
        let target = case.join("constant/polyMesh");
        write(&export(&mesh, selection), &target).unwrap_err().to_string()
    };
    let everything = Selection::default();
    let none = Selection { level_max: Some(1), ..Selection::default() };
    assert!(refused(&none).contains("no leaf satisfies all conditions"));
    assert!(!case.exists());

    write(&export(&mesh, &everything), &case.join("constant/polyMesh")).unwrap();
    assert!(refused(&everything).contains("constant/polyMesh exists"));
    let names = |dir: &Path| {
        fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name()).collect::<BTreeSet<_>>()
    };
    assert_eq!(names(&case).len(), 1);

    let empty = dir.path().join("other/constant/polyMesh");
    fs::create_dir_all(&empty).unwrap();
    write(&export(&mesh, &everything), &empty).unwrap();
    assert_eq!(names(&empty).len(), 7);
}

/// A cube as a solid of an ASCII file.
fn solid(name: &str, low: [f64; 3], edge: f64) -> String {
    let mut text = format!("solid {name}\n");
    for (axis, side) in (0..6).map(|face| (face / 2, face % 2)) {
        for corners in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
            text.push_str("facet normal 0 0 0\nouter loop\n");
            for (i, j) in corners {
                let mut steps = [side; 3];
                (steps[(axis + 1) % 3], steps[(axis + 2) % 3]) = (i, j);
                let [x, y, z]: [f64; 3] = std::array::from_fn(|a| low[a] + steps[a] as f64 * edge);
                text.push_str(&format!("vertex {x} {y} {z}\n"));
            }
            text.push_str("endloop\nendfacet\n");
        }
    }
    text + &format!("endsolid {name}\n")
}

#[test]
fn faces_belong_to_the_patch_of_the_nearest_named_solid() {
    // Two solids, each in a hole of one cell, and one without a name in a hole of eight cells.
    let cell = |o: &Octant| o.corner.map(|c| c / o.edge());
    let holes = [[1; 3], [6; 3]];
    let words = words_with_sides(
        |o| o.level < 3,
        |o| {
            (!holes.contains(&cell(o)) && o.ancestor(2).corner.map(|c| c >> 17) != [2, 0, 0])
                .then_some(Side::Outside)
        },
    );
    let mut set = leaf_set(vec![words]);
    set.manifest.level_surface = 3;
    let (dir, mesh) = on_disk(&set);
    let solids = [
        solid("left wing", [1.2; 3], 0.6),
        solid("", [4.2, 0.2, 0.2], 1.6),
        solid("tail", [6.1; 3], 0.8),
        solid("left wing", [1.3; 3], 0.1),
    ];
    fs::write(dir.path().join("body.stl"), solids.concat()).unwrap();
    let case = |edge: f64| {
        let text = format!(
            "geometry = \"body.stl\"\nspacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = {edge:?}\n"
        );
        fs::write(dir.path().join("case.toml"), text).unwrap();
        Case::read(&dir.path().join("case.toml")).unwrap()
    };
    let (case, other) = (case(8.0), case(16.0));
    let of = |case| Export { case: Some(case), ..whole(&mesh) };
    let target = dir.path().join("case/constant/polyMesh");
    write(&of(&case), &target).unwrap();
    let faces: Vec<_> =
        boundary_in(&target).into_iter().map(|(name, faces, _)| (name, faces)).collect();
    let expected = [("left_wing", 6), ("body", 24 - 4 - 4), ("tail", 6)];
    assert_eq!(faces[6..], expected.map(|(name, faces)| (name.to_owned(), faces)));
    let error = write(&of(&other), &dir.path().join("other/polyMesh")).unwrap_err().to_string();
    assert!(error.contains("not of the case"), "{error}");
}

#[test]
fn different_solids_have_patches_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let names = ["a b", "a_b", "a b", "xMin", "body_xMin"];
    let solids = names.map(|name| solid(name, [1.0; 3], 1.0));
    fs::write(dir.path().join("body.stl"), solids.concat()).unwrap();
    let case = dir.path().join("case.toml");
    fs::write(&case, "geometry = \"body.stl\"\nspacing_min = 1.0\n").unwrap();
    let patches = Patches::new(Some(&Case::read(&case).unwrap()), false);
    assert_eq!(patches.names[6..], ["a_b", "a_b_2", "body_xMin", "body_xMin_2"]);
}

#[test]
fn crossing_cells_and_solids_without_faces_produce_warnings() {
    let notes = |side: Side, selection: Selection| {
        let (dir, mesh) =
            on_disk(&leaf_set(vec![words_with_sides(|o| o.level < 1, |_| Some(side))]));
        write(&export(&mesh, &selection), &dir.path().join("polyMesh")).unwrap().notes
    };
    let all = notes(Side::Crossing, Selection::default());
    let expected = [
        "faces of each patch: xMin 4, ",
        "warning: patches without faces",
        "warning: the geometry crosses",
    ];
    assert_eq!(all.len(), expected.len(), "{all:?}");
    for (note, expected) in all.iter().zip(expected) {
        assert!(note.starts_with(expected), "{note}");
    }
    assert!(all[1].ends_with(": body"), "{}", all[1]);
    assert_eq!(notes(Side::Outside, Selection::default()).len(), 2);
}

#[test]
fn names_of_solids_become_words() {
    for (solid, patch) in [
        ("wing", "wing"),
        ("", "body"),
        ("left wing (v2)", "left_wing__v2_"),
        ("a;b\"c{d}", "a_b_c_d_"),
        ("xMin", "body_xMin"),
        ("cut", "body_cut"),
        ("procBoundary0to1", "body_procBoundary0to1"),
        ("processing_unit", "body_processing_unit"),
        ("2nd", "body_2nd"),
    ] {
        assert_eq!(patch_name(solid), patch);
    }
}
