//! Meshes that other programs wrote are imported as the cells that those programs state; damaged ones are refused.

use contract::failure::{Failure, Result};
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

fn imported(path: &Path, request: &Request) -> Result<LeafSet> {
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

fn tree(path: &Path) -> Result<Option<ImportedTree>> {
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

// Incomplete, damaged and contradictory meshes: each is refused in a sentence that names the place.

#[test]
fn an_incomplete_file_is_an_error() {
    for (name, ..) in SAMPLES {
        for part in [0.0, 0.1, 0.5, 0.9] {
            refusal(name, |bytes| bytes.truncate((bytes.len() as f64 * part) as usize));
        }
    }
}

/// No change of bytes causes a panic, a hang, or an allocation that a count alone determines; what it causes is listed.
#[test]
fn no_damage_is_fatal() {
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    let (mut refused, mut outcomes) = (0, String::new());
    for (name, ..) in SAMPLES {
        for round in 0..90 {
            let (place, copy) = edited(name, |bytes| {
                let begin = random(bytes.len() - 8);
                match round % 3 {
                    0 => bytes[begin] = random(256) as u8,
                    1 => bytes[begin..begin + 8].fill([0, 0x7f, 0xff, b'9'][random(4)]),
                    _ => drop(bytes.drain(begin..begin + 1 + random(7))),
                }
            });
            let outcome = imported(&copy, &Request::default());
            refused += usize::from(outcome.is_err());
            let outcome = match outcome {
                Ok(set) => format!("{} leaves {}", set.manifest.leaves, set.manifest.digest),
                Err(why) => why.to_string().replace(&*place.path().to_string_lossy(), ""),
            };
            outcomes += &format!("{name} {round}: {outcome}\n");
        }
    }
    assert!(refused > 50, "{refused}");
    assert_text(&outcomes, "damage.txt");
}

/// Compares a text with that of a file beside this one. If it differs as intended, copy the file that the message names.
fn assert_text(text: &str, file: &str) {
    let expected = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/expected").join(file);
    if text != fs::read_to_string(&expected).unwrap_or_default() {
        let found = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
        fs::write(&found, text).unwrap();
        panic!("{} differs from {}", found.display(), expected.display());
    }
}

#[test]
fn counts_beyond_the_file_are_errors() {
    // Vertices, trees, edges, and corners of the connectivity.
    for number in [2, 3, 4, 6] {
        for count in [1 << 20, 1 << 40, u64::MAX / 24 + 1, u64::MAX] {
            refusal("brick.p8est", |bytes| {
                bytes[32 + 8 * number..][..8].copy_from_slice(&count.to_le_bytes())
            });
        }
    }
}

#[test]
fn trees_at_edges_and_corners_that_a_forest_lacks_are_errors() {
    for number in [5, 7] {
        for count in [6, -1i64] {
            let why = refusal("unitcube.p8est", |bytes| {
                bytes[32 + 8 * number..][..8].copy_from_slice(&count.to_le_bytes())
            });
            assert!(why.contains("none where trees meet"), "{why}");
        }
    }
}

/// The connectivity's header follows 32 bytes, and the forest's its own.
#[test]
fn a_forest_of_another_format_is_refused() {
    for (number, value) in [(0, 7u64), (1, 8)] {
        let of_connectivity = refusal("brick.p8est", |bytes| {
            bytes[32 + 8 * number..][..8].copy_from_slice(&value.to_le_bytes());
        });
        assert!(of_connectivity.contains("is supported"), "{of_connectivity}");
        let of_forest = refusal("brick.p8est", |bytes| {
            let format = bytes[32..40].to_vec();
            let after = bytes[40..].windows(8).position(|eight| eight == format);
            let at = 40 + after.expect("the forest has the format, too") + 8 * number;
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        });
        assert!(of_forest.contains("has another format than the connectivity"), "{of_forest}");
    }
}

/// The number at this place in the header of a connectivity.
fn head_of_forest(bytes: &[u8], number: usize) -> usize {
    u64::from_le_bytes(bytes[32 + 8 * number..][..8].try_into().unwrap()) as usize
}

/// Tables that the reader skips have the lengths that p4est gives them: with edges, corners and attributes in the connectivity, the
/// cells are the same.
#[test]
fn edges_corners_and_attributes_of_a_connectivity_are_skipped() {
    let expected = imported(&sample("brick.p8est"), &Request::default()).unwrap().words;
    for (edges, corners, attributes) in
        [(0, 0, 0), (1, 0, 0), (3, 0, 5), (0, 1, 0), (0, 30, 0), (2, 4, 3)]
    {
        let (_place, copy) = edited("brick.p8est", |bytes| {
            let head = [2, 3, 4, 6, 8].map(|number| head_of_forest(bytes, number));
            let [vertices, trees, own_edges, own_corners, own_attributes] = head;
            assert_eq!((own_edges, own_attributes), (0, 0));
            let own_pairs = head_of_forest(bytes, 7);
            let mut at = 32 + 80 + 24 * vertices;
            let mut whole = bytes[..at].to_vec();
            let mut take = |whole: &mut Vec<u8>, count: usize| {
                whole.extend(&bytes[at..at + count]);
                at += count;
            };
            let put = |whole: &mut Vec<u8>, count: usize| whole.resize(whole.len() + count, 7);
            let corners = own_corners + corners;
            for (number, value) in [
                (4, edges),
                (5, 2 * edges),
                (6, corners),
                (7, own_pairs + 3 * corners),
                (8, attributes),
            ] {
                whole[32 + 8 * number..][..8].copy_from_slice(&(value as u64).to_le_bytes());
            }
            put(&mut whole, if edges > 0 { 48 * trees } else { 0 });
            take(&mut whole, 32 * trees);
            let own = if own_corners > 0 { 32 * trees } else { 0 };
            take(&mut whole, own);
            put(&mut whole, if corners > 0 { 32 * trees - own } else { 0 });
            take(&mut whole, 30 * trees);
            put(&mut whole, attributes * trees);
            take(&mut whole, 4);
            put(&mut whole, 4 * edges + 5 * 2 * edges);
            take(
                &mut whole,
                4 * (own_corners + 1) + if own_corners > 0 { 5 * own_pairs } else { 0 },
            );
            let added = corners - own_corners;
            let pairs = if corners > 0 { 5 * (own_pairs + 3 * corners) } else { 0 };
            put(&mut whole, 4 * added + pairs - if own_corners > 0 { 5 * own_pairs } else { 0 });
            at = at.next_multiple_of(32);
            whole.resize(whole.len().next_multiple_of(32), 0);
            whole.extend(&bytes[at..]);
            *bytes = whole;
        });
        let found = imported(&copy, &Request::default()).unwrap().words;
        assert_eq!(found, expected, "{edges} edges, {corners} corners, {attributes} bytes");
    }
}

#[test]
fn trees_are_cubes_up_to_rounding() {
    let with = |by: f64| {
        let (_place, copy) = edited("brick.p8est", |bytes| {
            let x = &mut bytes[32 + 80..][..8];
            let moved = f64::from_le_bytes((&*x).try_into().unwrap()) + by;
            x.copy_from_slice(&moved.to_le_bytes());
        });
        imported(&copy, &Request::default())
    };
    assert!(with(1e-11).is_ok() && with(-1e-11).is_ok());
    for by in [1e-6, -1e-6, 0.25] {
        assert!(with(by).unwrap_err().to_string().contains("is not a cube along x, y and z"));
    }
}

#[test]
fn each_error_of_a_mesh_names_its_cell() {
    let quadrant = refusal("unitcube.p8est", |bytes| {
        let second = bytes.len() - 16 * 105;
        bytes[second..second + 4].copy_from_slice(&8192i32.to_le_bytes());
    });
    assert!(
        quadrant.contains("[8192, 0, 0]")
            && quadrant.contains("begins where the one before it ends"),
        "{quadrant}"
    );
}

#[test]
fn absurd_sizes_are_refused() {
    for size in [1 << 20, u64::MAX / 2] {
        let why = refusal("brick.p8est", |bytes| {
            let format = 0x0300_0009u64.to_le_bytes();
            let at = bytes.windows(8).rposition(|w| w == format).unwrap();
            bytes[at + 24..at + 32].copy_from_slice(&size.to_le_bytes());
        });
        assert!(why.contains(&format!("it states {size} bytes of data per quadrant")), "{why}");
    }
}

#[test]
fn swapped_bytes_and_a_leaf_set_are_refused() {
    let why = refusal("brick.p8est", |bytes| {
        for number in bytes[32..112].chunks_exact_mut(8) {
            number.reverse();
        }
    });
    assert!(why.contains("its format is 0x9000003"), "{why}");
    let place = tempfile::tempdir().unwrap();
    let words = leaves("unitcube.csv", root([0.0, 0.0, 0.0, 1.0]));
    let refused = |path: &Path| imported(path, &Request::default()).unwrap_err().to_string();
    let path = place.path().join("words.npy");
    let swapped: Vec<u64> = words.iter().map(|word| word.swap_bytes()).collect();
    npy::write(&path, &swapped).unwrap();
    assert!(refused(&path).contains("cell 0 is the word "), "{}", refused(&path));
    let bytes = words.iter().flat_map(|word| word.to_be_bytes());
    let header = npy::header(">u8", &format!("({},)", words.len()));
    fs::write(&path, header.into_iter().chain(bytes).collect::<Vec<u8>>()).unwrap();
    assert!(refused(&path).contains("has type >u8, not '<u8'"), "{}", refused(&path));
    let mesh = place.path().join("mesh");
    let set = imported(&sample("unitcube.p8est"), &Request::default()).unwrap();
    set.create(&mesh).unwrap();
    let why = refused(&mesh);
    assert!(why.contains("needs no import: `harness audit` shows"), "{why}");
}
