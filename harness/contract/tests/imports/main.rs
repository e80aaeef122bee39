//! Meshes that other programs wrote are imported as the cells that those programs state; damaged ones are refused.

mod damage;
mod trees;

use contract::htg::{Cursor, TreeFile};
use contract::import::htg::ImportedTree;
use contract::import::{self, Format, ImportError, Request, leaf_set};
use contract::lattice::Root;
use contract::leafset::{self, LeafSet};
use contract::npy;
use contract::word::{key, span};
use std::fs;
use std::path::{Path, PathBuf};

/// Every sample, the cells that its program states, and its root as origin and edge.
const SAMPLES: [(&str, &str, [f64; 4]); 10] = [
    ("unitcube.p8est", "unitcube.csv", [0.0, 0.0, 0.0, 1.0]),
    ("brick.p8est", "brick.csv", [0.0, 0.0, 0.0, 4.0]),
    ("cube.json", "cube.csv", [-1.0, 2.0, 0.5, 2.0]),
    ("cube.msh", "cube.csv", [-1.0, 2.0, 0.5, 2.0]),
    ("flat.json", "flat.csv", [0.0, 0.0, -1.0, 8.0]),
    ("flat.msh", "flat.csv", [0.0, 0.0, -1.0, 8.0]),
    ("rounded.json", "rounded.csv", [0.0, 0.0, 0.0, 0.25]),
    ("foam-ascii", "foam.csv", [-1.0, -1.0, -1.0, 4.0]),
    ("foam-binary", "foam.csv", [-1.0, -1.0, -1.0, 4.0]),
    ("unitcube.csv", "unitcube.csv", [0.0, 0.0, 0.0, 1.0]),
];

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples").join(name)
}

fn root([x, y, z, edge]: [f64; 4]) -> Root {
    Root { origin: [x, y, z], edge }
}

fn imported(path: &Path, request: &Request) -> Result<LeafSet, ImportError> {
    let cells = import::read(path, import::guess(path)?, request)?;
    leaf_set(&cells, request.root, None, "test".to_owned())
}

/// The leaves of a table of corners and edges.
fn leaves(table: &str, root: Root) -> Vec<u64> {
    let request = Request { root: Some(root), ..Request::default() };
    imported(&sample(table), &request).unwrap().words
}

#[test]
fn every_sample_is_imported_as_its_program_states_its_cells() {
    for (name, table, expected) in SAMPLES {
        let set = imported(&sample(name), &Request::default()).unwrap();
        let Root { origin, edge } = set.manifest.root;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(
            (0..3).all(|a| near(origin[a], expected[a])) && near(edge, expected[3]),
            "{name}: {:?}",
            set.manifest.root
        );
        assert_eq!(set.words, leaves(table, root(expected)), "{name}");
        assert!(set.words.len() > 90, "{name}");
    }
}

#[test]
fn a_given_root_moves_a_forest() {
    let given = root([-4.0, -4.0, -4.0, 8.0]);
    let request = Request { root: Some(given), ..Request::default() };
    for (name, table, own) in &SAMPLES[..2] {
        let set = imported(&sample(name), &request).unwrap();
        assert_eq!((set.manifest.root, set.words), (given, leaves(table, root(*own))));
    }
}

#[test]
fn a_given_root_replaces_one_that_the_file_rounded() {
    let exact = root([0.0, 0.0, 0.0, 0.25]);
    let set =
        imported(&sample("rounded.msh"), &Request { root: Some(exact), ..Request::default() })
            .unwrap();
    assert_eq!((set.manifest.root, set.words), (exact, leaves("rounded.csv", exact)));
    // This root is not the file's: cells stay where they are, and do not fit.
    let other = Request { root: Some(root([0.0, 0.0, 0.0, 0.3])), ..Request::default() };
    assert!(imported(&sample("rounded.msh"), &other).unwrap_err().to_string().contains("cell 0"));
}

#[test]
fn a_larger_root_holds_the_same_cells() {
    let request = Request { root: Some(root([-9.0, -6.0, -7.5, 16.0])), ..Request::default() };
    let set = imported(&sample("cube.json"), &request).unwrap();
    assert_eq!(set.words.len(), leaves("cube.csv", root([-1.0, 2.0, 0.5, 2.0])).len());
}

#[test]
fn formats_without_cell_arrays_refuse_sides() {
    let request = Request { sides: Some("body".into()), ..Request::default() };
    for name in ["unitcube.p8est", "cube.json", "cube.msh"] {
        assert!(
            imported(&sample(name), &request).unwrap_err().to_string().contains("omit --sides")
        );
    }
    assert!(imported(&sample("foam-ascii"), &request).unwrap_err().to_string().contains("body"));
}

/// A copy of a sample in which `change` has edited one file.
fn edited(
    name: &str,
    file: &str,
    change: impl FnOnce(&mut Vec<u8>),
) -> (tempfile::TempDir, PathBuf) {
    let place = tempfile::tempdir().unwrap();
    let copy = place.path().join("mesh");
    match sample(name).is_dir() {
        false => fs::copy(sample(name), &copy).map(drop).unwrap(),
        true => {
            fs::create_dir(&copy).unwrap();
            for entry in fs::read_dir(sample(name)).unwrap() {
                let entry = entry.unwrap();
                fs::copy(entry.path(), copy.join(entry.file_name())).unwrap();
            }
        }
    }
    let path = if file.is_empty() { copy.clone() } else { copy.join(file) };
    let mut bytes = fs::read(&path).unwrap();
    change(&mut bytes);
    fs::write(&path, bytes).unwrap();
    (place, copy)
}

/// The sentence with which an edited sample is refused.
fn refusal(name: &str, file: &str, change: impl FnOnce(&mut Vec<u8>)) -> String {
    let (_place, copy) = edited(name, file, change);
    let why = imported(&copy, &Request::default()).unwrap_err().to_string();
    assert!(why.len() > 10 && !why.contains('\n'), "{why}");
    why
}

fn replace(bytes: &mut Vec<u8>, from: &str, to: &str) {
    let at = bytes
        .windows(from.len())
        .position(|w| w == from.as_bytes())
        .expect("the text is in the sample");
    bytes.splice(at..at + from.len(), to.bytes());
}
