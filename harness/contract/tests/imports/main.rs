//! Meshes that other programs wrote are imported as the cells that those programs state; damaged ones are refused.

mod damage;

use contract::failure::Failure;
use contract::import::cells::Cells;
use contract::import::{self, Format, ImportedTree, Request, leaf_set};
use contract::lattice::Root;
use contract::leafset::{self, LeafSet};
use contract::npy;
use std::fs;
use std::path::{Path, PathBuf};

/// Every sample, the cells that its program states, and its root as origin and edge.
const SAMPLES: [(&str, &str, [f64; 4]); 2] = [
    ("unitcube.p8est", "unitcube.csv", [0.0, 0.0, 0.0, 1.0]),
    ("brick.p8est", "brick.csv", [0.0, 0.0, 0.0, 4.0]),
];

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples").join(name)
}

fn root([x, y, z, edge]: [f64; 4]) -> Root {
    Root { origin: [x, y, z], edge }
}

fn imported(path: &Path, request: &Request) -> Result<LeafSet, Failure> {
    let cells = match import::guess(path)? {
        Format::LeafWords => import::words::read(path, request)?,
        Format::P4est => import::p4est::read(path, request)?,
        _ => return Err(Failure::input("is read in Python")),
    };
    leaf_set(&cells, request.root, None, "test".to_owned())
}

/// The leaves of a table of corners and edges.
fn leaves(table: &str, root: Root) -> Vec<u64> {
    let text = fs::read_to_string(sample(table)).unwrap();
    let mut cells = Cells::default();
    for line in text.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        cells.push([row[0], row[1], row[2]], row[3]);
    }
    cells.words(&root).unwrap()
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
fn formats_without_cell_arrays_refuse_sides() {
    let request = Request { sides: Some("body".into()), ..Request::default() };
    let why = imported(&sample("unitcube.p8est"), &request).unwrap_err().to_string();
    assert!(why.contains("omit --sides"), "{why}");
}

/// A copy of a sample that `change` has edited.
fn edited(name: &str, change: impl FnOnce(&mut Vec<u8>)) -> (tempfile::TempDir, PathBuf) {
    let place = tempfile::tempdir().unwrap();
    let copy = place.path().join("mesh");
    let mut bytes = fs::read(sample(name)).unwrap();
    change(&mut bytes);
    fs::write(&copy, bytes).unwrap();
    (place, copy)
}

/// The sentence with which an edited sample is refused.
fn refusal(name: &str, change: impl FnOnce(&mut Vec<u8>)) -> String {
    let (_place, copy) = edited(name, change);
    let why = imported(&copy, &Request::default()).unwrap_err().to_string();
    assert!(why.len() > 10 && !why.contains('\n'), "{why}");
    why
}

#[test]
fn the_root_of_a_case_moves_forests_in_the_unit_cube_only() {
    let root = Some(root([-1.0, 2.0, 0.5, 4.0]));
    let request = Request { root, is_root_of_case: true, ..Request::default() };
    assert!(imported(&sample("unitcube.p8est"), &request).is_ok());
    let why = imported(&sample("brick.p8est"), &request).unwrap_err().to_string();
    assert!(why.contains("give --root to move the forest"), "{why}");
    let given = Request { is_root_of_case: false, ..request };
    assert!(imported(&sample("brick.p8est"), &given).is_ok());
}

fn tree(path: &Path) -> Result<Option<ImportedTree>, Failure> {
    ImportedTree::open(path, None, None, None, "test".to_owned())
}

/// The digest and the counts are those of the reference.
#[test]
fn a_tree_of_the_mesher_has_the_leaves_of_the_reference_as_words_and_as_a_link() {
    let imported = tree(&sample("sphere.vtkhdf")).unwrap().unwrap();
    assert_eq!(imported.manifest.digest.to_string(), "f15f7dd9863232f4ff3c659161a5c2e9");
    assert_eq!((imported.manifest.leaves, imported.manifest.lacks_inputs), (9056, true));
    assert_eq!(imported.manifest.root, root([-2.0, -2.0, -2.0, 4.0]));
    let place = tempfile::tempdir().unwrap();
    let (words, link) = (place.path().join("new/words"), place.path().join("link"));
    imported.create(&words).unwrap();
    assert!(imported.create(&words).is_err(), "the directory is not empty");
    fs::create_dir(&link).unwrap();
    imported.link(&link).unwrap();
    let (words, link) = (leafset::read(&words).unwrap(), leafset::read(&link).unwrap());
    assert_eq!((words.words.len(), &words.words), (9056, &link.words));
    assert!(words.words.is_sorted());
}

/// A tree with another root than is wanted must be read cell by cell, as must other layouts; a damaged one is no tree at all.
#[test]
fn a_tree_is_opened_as_such_only_with_its_own_root() {
    let path = sample("sphere.vtkhdf");
    let open = |path: &Path, sides, root| {
        ImportedTree::open(path, sides, root, None, "test".to_owned()).map(|tree| tree.is_some())
    };
    let own = root([-2.0, -2.0, -2.0, 4.0]);
    assert!(open(&path, None, Some(own)).unwrap() && open(&path, Some("side"), None).unwrap());
    assert!(!open(&path, None, Some(root([-2.0, -2.0, -2.0, 8.0]))).unwrap());
    assert!(!open(&path, Some("body"), None).unwrap());
    assert!(!open(&sample("brick.p8est"), None, None).unwrap());
    let (_place, damaged) = edited("sphere.vtkhdf", |bytes| {
        let end = bytes.len() - 40;
        bytes.truncate(end);
    });
    let why = open(&damaged, None, None).unwrap_err().to_string();
    assert!(why.contains("is damaged"), "{why}");
    assert!(open(&damaged, None, Some(own)).is_err());
}

#[test]
fn a_truncated_tree_is_refused() {
    let bytes = fs::read(sample("sphere.vtkhdf")).unwrap();
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("mesh.vtkhdf");
    for length in (0..bytes.len()).step_by(37) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(!matches!(tree(&path), Ok(Some(_))), "{length} bytes");
    }
}
