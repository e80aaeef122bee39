//! Inputs: case files and STL files as people and exporters write them, what is refused, and with which message; each kind of
//! invalid case has its own error.

use crate::support;
use reference::stl::{Facet, parse};
use reference::{BoxSpec, Case, Enclosed, Error, Keep, Root, case_file, mesh};
use std::fs;
use support::{ROOT_EDGE, case};

const GENERATED: &str = "[generator]\nshape = \"cube\"\nfacets = 12\n";
const ROOT: &str = "[root]\norigin = [-4.0, -4, -4.0]\nedge = 8\n";

fn read(text: &str) -> Result<Case, Error> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("case.toml");
    fs::write(&path, text).unwrap();
    case_file::read(&path)
}

fn assert_case_refused(text: &str, part: &str) {
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
    assert_case_refused(&with("layer_cell_min = 3"), "line 2: unknown field `layer_cell_min`");
    assert_case_refused(&with("layer_cell_min = 3"), "`layer_cells_min`");
    assert_case_refused(&with("rootscale = 3"), "`root_scale`");
    assert_case_refused(&with("keep = \"outsde\""), "`outside`");
    assert_case_refused(&with("seed = [[0, 0, 0]]"), "`seeds`");
    assert_case_refused(&with("enclosed = \"kept\""), "`keep`");
    assert_case_refused(&with("[root]\norigin = [0, 0, 0]\nedges = 1"), "`edge`");
    assert_case_refused(&with("[[box]]\nmin = [0, 0, 0]\nmxa = [1, 1, 1]\nspacing = 1"), "`max`");
    assert_case_refused(&with("[[boxes]]\nspacing = 1"), "`box`");
    assert_case_refused("spacing_min = 1\n[generator]\nshape = \"cube\"\nfacet = 12", "`facets`");
    assert_case_refused("spacing_min = 1\n[generator]\nshape = \"cub\"\nfacets = 12", "`cube`");
}

#[test]
fn invalid_case_files_are_refused() {
    assert_case_refused(GENERATED, "missing field `spacing_min`; correct the case file");
    assert_case_refused("spacing_min = 1", "either `geometry` or a [generator] table");
    let both = format!("spacing_min = 1\ngeometry = \"body.stl\"\n{GENERATED}");
    assert_case_refused(&both, "either `geometry` or a [generator] table");
    let with = |line: &str| format!("spacing_min = 1.0\n{line}\n{GENERATED}");
    assert_case_refused(
        &with(&format!("root_scale = 2.0\n{ROOT}")),
        "either `root_scale` or a [root] table",
    );
    for scale in ["0", "-1.0", "nan", "inf"] {
        assert_case_refused(&with(&format!("root_scale = {scale}")), "finite and greater than 0");
    }
    assert_case_refused(&with("layer_cells_min = -1"), "line 2");
    assert_case_refused(&with("layer_cells_min = 1.5"), "line 2");
    assert_case_refused(&with("keep_crossing = 1"), "expected a boolean");
    assert_case_refused(&with("seeds = [0, 0, 0]"), "line 2");
    assert_case_refused(&with("seeds = [[0, 0]]"), "line 2");
    assert_case_refused(&with("[root]\norigin = [0, 0]\nedge = 1"), "line 3");
    assert_case_refused("spacing_min = = 1", "line 1");
    assert_case_refused("spacing_min = 1\nspacing_min = 2", "line 2");
    let directory = tempfile::tempdir().unwrap();
    let nowhere = case_file::read(&directory.path().join("nowhere.toml")).unwrap_err();
    assert!(nowhere.to_string().contains("nowhere.toml"));
}

const FACET: Facet = [[0.0, 1.0, 2.5], [-1.0, 0.1, 1e-3], [3.0, 4.0, -5e10]];

const TEXT: &str = "solid part one
  facet normal 0 0 1
    outer loop
      vertex 0 1 2.5
      vertex -1 0.1 1e-3
      vertex +3.0 4.000 -5.0E+10
    endloop
  endfacet
endsolid part one
";

fn binary(header: &[u8], count: u32, facets: &[Facet]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend(count.to_le_bytes());
    for facet in facets {
        bytes.extend([0; 12]);
        bytes.extend(facet.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([7, 7]);
    }
    bytes
}

fn assert_stl_refused(bytes: &[u8], part: &str) {
    let problem = parse(bytes).unwrap_err();
    assert!(problem.contains(part), "{problem:?} should contain {part:?}");
}

#[test]
fn binary_files_are_recognised_by_their_length() {
    assert_eq!(parse(&binary(b"", 2, &[FACET, FACET])).unwrap(), [FACET, FACET]);
    assert_eq!(parse(&binary(b"solid but binary", 1, &[FACET])).unwrap(), [FACET]);
    let no_zero_byte = [b'x'; 80];
    assert_eq!(parse(&binary(&no_zero_byte, 1, &[FACET])).unwrap(), [FACET]);
    assert!(parse(&binary(b"", 0, &[])).unwrap().is_empty());
}

#[test]
fn ascii_files_may_vary_in_case_white_space_and_names() {
    assert_eq!(parse(TEXT.as_bytes()).unwrap(), [FACET]);
    for (from, to) in [
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("\n", " \n\n\t"),
        ("\n", " "),
        ("solid part one", "solid"),
        ("solid part", "solid facet normal"),
        ("solid part one\n", "solid facet normal 0 0 1 outer\n"),
        ("solid part one\n", "solid name of six words and loop\n"),
        ("facet normal 0 0 1", "facet normal nan nan nan"),
        ("facet normal 0 0 1\n    outer", "facet normal 0 0 1 outer"),
    ] {
        assert_eq!(
            parse(TEXT.replace(from, to).as_bytes()).unwrap(),
            [FACET],
            "{from:?} as {to:?}"
        );
    }
    assert_eq!(parse(TEXT.to_uppercase().as_bytes()).unwrap(), [FACET]);
    assert_eq!(parse(format!("\n\r\n  {TEXT}\n\n").as_bytes()).unwrap(), [FACET]);
    assert_eq!(parse(format!("\u{feff}{TEXT}").as_bytes()).unwrap(), [FACET]);
    assert_eq!(parse(TEXT.trim_end().as_bytes()).unwrap(), [FACET], "no line feed at the end");
}

#[test]
fn the_facets_of_all_solids_are_read() {
    let solids = [TEXT, "solid\nendsolid\n", &TEXT.to_uppercase(), TEXT].concat();
    assert_eq!(parse(solids.as_bytes()).unwrap(), [FACET; 3]);
    assert!(parse(b"solid nothing\nendsolid nothing\n").unwrap().is_empty());
}

/// The last word that a file needs is `endsolid`; only the name after it may be missing.
#[test]
fn truncated_ascii_files_are_refused() {
    let whole = TEXT.find("endsolid").unwrap() + "endsolid".len();
    for length in "solid".len()..whole {
        assert!(parse(&TEXT.as_bytes()[..length]).is_err(), "{length} bytes");
    }
    assert_stl_refused(
        &TEXT.as_bytes()[..whole - 8],
        "ends in line 9, where facet or endsolid was expected",
    );
}

#[test]
fn binary_files_of_the_wrong_length_are_refused() {
    let whole = binary(b"solid", 2, &[FACET, FACET]);
    for length in 0..whole.len() {
        assert!(parse(&whole[..length]).is_err(), "{length} bytes");
    }
    assert_stl_refused(&whole[..100], "184 bytes for the 2 facets of its header, but it has 100");
    assert_stl_refused(&[&whole[..], b"x"].concat(), "but it has 185");
    assert_stl_refused(&binary(b"", 1, &[FACET, FACET]), "the 1 facets of its header");
    // Nothing is allocated for a count that exceeds the length of the file.
    assert_stl_refused(&binary(b"", u32::MAX, &[FACET]), "the 4294967295 facets of its header");
}

#[test]
fn files_that_are_not_stl_are_refused() {
    assert_stl_refused(b"", "empty");
    assert_stl_refused(b"hello", "neither ASCII STL");
    assert_stl_refused(b"   \n", "neither ASCII STL");
    assert_stl_refused(&[b'#'; 5000], "it is damaged or not STL");
    assert_stl_refused(b"solid\nhello", "line 2 has \"hello\"");
    assert_stl_refused(
        &[TEXT.as_bytes(), b"rubbish"].concat(),
        "line 10 has \"rubbish\" where solid was expected",
    );
    assert_stl_refused(
        TEXT.replace("2.5", "blah").as_bytes(),
        "line 4 has \"blah\" where a number was expected",
    );
    assert_stl_refused(
        TEXT.replace("2.5", "").as_bytes(),
        "line 5 has \"vertex\" where a number was expected",
    );
    assert_stl_refused(
        TEXT.replace("2.5", "2.5 1").as_bytes(),
        "line 4 has \"1\" where vertex was expected",
    );
    assert_stl_refused(TEXT.replace("outer loop", "outer").as_bytes(), "where loop was expected");
    let crlf = TEXT.replace('\n', "\r\n").replace("2.5", "2,5");
    assert_stl_refused(crlf.as_bytes(), "line 4 has \"2,5\"");
    let cr = TEXT.replace('\n', "\r").replace("2.5", "2,5");
    assert_stl_refused(cr.as_bytes(), "line 4 has \"2,5\"");
    let long = format!("solid\n{}", "x".repeat(100_000));
    assert!(parse(long.as_bytes()).unwrap_err().len() < 200);
    assert_stl_refused(b"solid\n\xff\xfe", "line 2");
}

#[test]
fn vertices_that_are_not_finite_are_refused() {
    for word in ["nan", "inf", "-Infinity", "1e999"] {
        assert_stl_refused(
            TEXT.replace("2.5", word).as_bytes(),
            "facet 0 has a vertex that is not finite",
        );
    }
    let mut wrong = FACET;
    wrong[2][1] = f32::NAN;
    assert_stl_refused(&binary(b"", 2, &[FACET, wrong]), "facet 1 has a vertex that is not finite");
}

#[test]
fn each_invalid_input_has_its_own_error() {
    let valid = case(&[[[0; 3]; 3], [[1; 3]; 3]], 3);
    let error = |change: &dyn Fn(&mut Case)| {
        let mut invalid = valid.clone();
        change(&mut invalid);
        mesh(&invalid).unwrap_err()
    };
    let edge = ROOT_EDGE as f64;
    let refused = |error: Error, part: &str| {
        assert!(matches!(&error, Error::Invalid(why) if why.contains(part)), "{error}: not {part}");
    };
    for x in [2.0 * edge + 1.0, -edge - 1.0] {
        refused(error(&|c| c.facets[1][2][0] = x), "facet 1 has a vertex [");
        refused(error(&|c| c.facets[1][2][0] = x), "more than one root edge outside the root");
    }
    for x in [f64::NAN, f64::INFINITY] {
        let error = error(&|c| c.facets[1][2][0] = x);
        assert!(error.to_string().starts_with("facet 1 has a vertex ["), "{error}");
        refused(error, "that is not finite");
    }
    // The product of 0 and an infinite scale is not a number.
    refused(error(&|c| c.root.edge = 1e-310), "facet 0 has a vertex [0.0, 0.0, 0.0] that is not");
    let mut limit = valid.clone();
    limit.facets[1][2] = [2.0 * edge, -edge, 0.0];
    mesh(&limit).unwrap();

    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let must = format!("is {spacing}: it must be finite and greater than 0");
        refused(error(&|c| c.spacing_min = spacing), &format!("spacing_min {must}"));
        refused(error(&|c| c.root.edge = spacing), &format!("the root's edge {must}"));
    }
    let least = edge / 2f64.powi(19);
    let too_fine = format!("spacing_min is 255.9, less than {least}, the cell edge");
    refused(error(&|c| c.spacing_min = 255.9), &too_fine);
    refused(error(&|c| c.root.origin[1] = f64::NAN), "the root's origin [");
    refused(error(&|c| c.layer_cells_min = 0), "layer_cells_min is 0");
    let boxed = |min, max, spacing| error(&move |c| c.boxes = vec![BoxSpec { min, max, spacing }]);
    for max in [[1.0, 1.0, 0.0], [f64::INFINITY; 3]] {
        refused(boxed([0.0; 3], max, 1e6), "box 0 extends from");
    }
    refused(boxed([0.0; 3], [1.0; 3], 1.0), "the spacing of box 0 is 1, less than");
    // At level 19.
    let too_many = boxed([0.0; 3], [edge; 3], 256.0);
    assert!(matches!(too_many, Error::TooManyCells { index: 0, cells } if cells == 2f64.powi(57)));
    assert!(too_many.to_string().contains("1.4e17 cells") && too_many.exit_code() == 71);
    let octant = boxed([edge / 2.0; 3], [edge; 3], 256.0);
    assert!(matches!(octant, Error::TooManyCells { cells, .. } if cells == 2f64.powi(54)));
}
