//! Case files: defaults, and an informative message for each kind of error.
use reference::{BoxSpec, Case, Enclosed, Error, Keep, Root, case_file};
use std::fs;

const GENERATED: &str = "[generator]\nshape = \"cube\"\nfacets = 12\n";
const ROOT: &str = "[root]\norigin = [-4.0, -4, -4.0]\nedge = 8\n";

fn read(text: &str) -> Result<Case, Error> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("case.toml");
    fs::write(&path, text).unwrap();
    case_file::read(&path)
}

fn assert_refused(text: &str, part: &str) {
    let problem = read(text).unwrap_err().to_string();
    assert!(problem.contains(part), "{problem:?} should contain {part:?}");
}

#[test]
fn missing_keys_take_their_defaults() {
    let case = read(&format!("spacing_min = 0.5\n{GENERATED}")).unwrap();
    assert_eq!((case.facets.len(), case.spacing_min, case.layer_cells_min), (12, 0.5, 4));
    assert_eq!((case.keep, case.keep_crossing, case.boxes.len()), (Keep::Outside, true, 0));
    assert!(case.seeds.is_empty());
    assert_eq!(case.enclosed, Enclosed::Delete);
    assert_eq!(case.root, Root::around(&case.facets, 10.0).unwrap());
}

#[test]
fn every_key_is_read() {
    let text = format!(
        "spacing_min = 1\nlayer_cells_min = 2\nkeep = \"inside\"\nkeep_crossing = false\n\
         seeds = [[0, 0.5, 1.0], [-1.0, 2.0, 3]]\nenclosed = \"keep\"\n{ROOT}{GENERATED}\
         [[box]]\nmin = [0.0, -1.0, -1.0]\nmax = [4.0, 1.0, 1.0]\nspacing = 0.05\n\
         [[box]]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\nspacing = 0.1\n"
    );
    let case = read(&text).unwrap();
    assert_eq!(case.root, Root { origin: [-4.0; 3], edge: 8.0 });
    assert_eq!((case.keep, case.keep_crossing, case.layer_cells_min), (Keep::Inside, false, 2));
    assert_eq!(case.seeds, [[0.0, 0.5, 1.0], [-1.0, 2.0, 3.0]]);
    assert_eq!(case.enclosed, Enclosed::Keep);
    let first = BoxSpec { min: [0.0, -1.0, -1.0], max: [4.0, 1.0, 1.0], spacing: 0.05 };
    let second = BoxSpec { min: [0.0; 3], max: [1.0; 3], spacing: 0.1 };
    assert_eq!(case.boxes, [first, second]);
}

/// The path of a geometry is relative to the case file, and coordinates are rounded to f32.
#[test]
fn geometry_files_are_relative_to_the_case_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("case.toml");
    let facet =
        "facet normal 0 0 0 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 0.1 0 endloop endfacet";
    fs::write(directory.path().join("body.stl"), format!("solid\n{facet}\nendsolid\n")).unwrap();
    fs::write(&path, "geometry = \"body.stl\"\nspacing_min = 1.0\nroot_scale = 2.0\n").unwrap();
    let case = case_file::read(&path).unwrap();
    assert_eq!(case.facets, [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.10000000149011612, 0.0]]]);
    assert_eq!(case.root, Root::around(&case.facets, 2.0).unwrap());

    fs::write(directory.path().join("body.stl"), "solid\nendsolid\n").unwrap();
    assert!(case_file::read(&path).unwrap_err().to_string().contains("no facets or its"));
    let point = facet.replace("vertex 1 0 0 vertex 0 0.1 0", "vertex 0 0 0 vertex 0 0 0");
    fs::write(directory.path().join("body.stl"), format!("solid\n{point}\nendsolid\n")).unwrap();
    assert!(
        case_file::read(&path).unwrap_err().to_string().contains("its bounding box has no extent")
    );
    fs::write(directory.path().join("body.stl"), "solid\nendsolid\n").unwrap();
    fs::write(&path, format!("geometry = \"body.stl\"\nspacing_min = 1.0\n{ROOT}")).unwrap();
    assert!(case_file::read(&path).unwrap().facets.is_empty(), "an explicit root suffices");
    fs::write(&path, "geometry = \"boddy.stl\"\nspacing_min = 1.0\n").unwrap();
    assert!(matches!(case_file::read(&path), Err(Error::Read { .. })));
}

#[test]
fn an_unknown_key_is_refused_with_the_most_similar_known_one() {
    let with = |line: &str| format!("spacing_min = 1.0\n{line}\n{GENERATED}");
    assert_refused(&with("layer_cell_min = 3"), "line 2: unknown field `layer_cell_min`");
    assert_refused(&with("layer_cell_min = 3"), "`layer_cells_min`");
    assert_refused(&with("rootscale = 3"), "`root_scale`");
    assert_refused(&with("keep = \"outsde\""), "`outside`");
    assert_refused(&with("seed = [[0, 0, 0]]"), "`seeds`");
    assert_refused(&with("enclosed = \"kept\""), "`keep`");
    assert_refused(&with("[root]\norigin = [0, 0, 0]\nedges = 1"), "`edge`");
    assert_refused(&with("[[box]]\nmin = [0, 0, 0]\nmxa = [1, 1, 1]\nspacing = 1"), "`max`");
    assert_refused(&with("[[boxes]]\nspacing = 1"), "`box`");
    assert_refused("spacing_min = 1\n[generator]\nshape = \"cube\"\nfacet = 12", "`facets`");
    assert_refused("spacing_min = 1\n[generator]\nshape = \"cub\"\nfacets = 12", "`cube`");
}

#[test]
fn invalid_case_files_are_refused() {
    assert_refused(GENERATED, "missing field `spacing_min`; correct the case file");
    assert_refused("spacing_min = 1", "either `geometry` or a [generator] table");
    let both = format!("spacing_min = 1\ngeometry = \"body.stl\"\n{GENERATED}");
    assert_refused(&both, "either `geometry` or a [generator] table");
    let with = |line: &str| format!("spacing_min = 1.0\n{line}\n{GENERATED}");
    assert_refused(
        &with(&format!("root_scale = 2.0\n{ROOT}")),
        "either `root_scale` or a [root] table",
    );
    for scale in ["0", "-1.0", "nan", "inf"] {
        assert_refused(&with(&format!("root_scale = {scale}")), "finite and greater than 0");
    }
    assert_refused(&with("layer_cells_min = -1"), "line 2");
    assert_refused(&with("layer_cells_min = 1.5"), "line 2");
    assert_refused(&with("keep_crossing = 1"), "expected a boolean");
    assert_refused(&with("seeds = [0, 0, 0]"), "line 2");
    assert_refused(&with("seeds = [[0, 0]]"), "line 2");
    assert_refused(&with("[root]\norigin = [0, 0]\nedge = 1"), "line 3");
    assert_refused("spacing_min = = 1", "line 1");
    assert_refused("spacing_min = 1\nspacing_min = 2", "line 2");
    let directory = tempfile::tempdir().unwrap();
    let nowhere = case_file::read(&directory.path().join("nowhere.toml")).unwrap_err();
    assert!(nowhere.to_string().contains("nowhere.toml"));
}
