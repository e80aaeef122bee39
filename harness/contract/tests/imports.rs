//! Meshes that other programs wrote are imported as the cells that those programs state; damaged ones are refused.

use contract::htg::{Cursor, TreeFile};
use contract::import::htg::ImportedTree;
use contract::import::{self, Format, ImportError, Request, leaf_set};
use contract::lattice::Root;
use contract::leafset::{self, LeafSet};
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

fn tree(path: &Path) -> Result<Option<ImportedTree>, ImportError> {
    ImportedTree::open(path, None, None, None, "test".to_owned())
}

/// The digest and the counts are those of the reference.
#[test]
fn a_tree_of_the_mesher_has_the_leaves_of_the_reference_as_words_and_as_a_link() {
    let imported = tree(&sample("sphere.vtkhdf")).unwrap().unwrap();
    assert_eq!(imported.manifest.digest.to_string(), "f15f7dd9863232f4ff3c659161a5c2e9");
    assert_eq!((imported.manifest.leaves, imported.manifest.level_surface), (9056, 5));
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
    assert!(!open(&sample("cube.msh"), None, None).unwrap());
    let (_place, damaged) = edited("sphere.vtkhdf", "", |bytes| {
        let end = bytes.len() - 40;
        bytes.truncate(end);
    });
    let why = open(&damaged, None, None).unwrap_err().to_string();
    assert!(why.contains("is damaged"), "{why}");
    assert!(open(&damaged, None, Some(own)).is_err());
}

#[test]
fn the_leaves_of_an_octant_are_read_without_those_before_it() {
    let tree = TreeFile::open(&sample("sphere.vtkhdf"), Some("side")).unwrap();
    let mut all = Vec::new();
    tree.words(&mut |run| {
        all.extend_from_slice(run);
        true
    })
    .unwrap();
    let index = tree.index().unwrap();
    let mut cursor = Cursor::new(&tree, &index);
    for level in [0, 1, 3, 4, 5] {
        for octant in (0..1u64 << (3 * level)).step_by(1 + (1 << level)) {
            let (begin, end) = (octant * span(level), (octant + 1) * span(level));
            let within = |word: &&u64| (begin..end).contains(&key(**word));
            let expected: Vec<u64> = all.iter().filter(within).copied().collect();
            let before = all.iter().filter(|word| key(**word) < begin).count() as u64;
            let mut found = Vec::new();
            cursor.words(begin, level, &mut found).unwrap();
            assert_eq!(found, expected, "octant {octant} of level {level}");
            assert_eq!(cursor.leaves_before(begin).unwrap(), before, "{octant}, {level}");
        }
    }
    assert_eq!(cursor.leaves_before(span(0)).unwrap(), 9056);
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

#[test]
fn sides_of_an_openfoam_mesh_are_a_list_of_labels() {
    let (_place, copy) = edited("foam-ascii", "cellLevel", |_| {});
    let list = fs::read_to_string(copy.join("cellLevel")).unwrap();
    fs::write(copy.join("body"), list).unwrap();
    let set =
        imported(&copy, &Request { sides: Some("body".into()), ..Request::default() }).unwrap();
    let inside = set.manifest.leaves_by_side.inside;
    assert!(inside > 0 && inside < set.manifest.leaves);
    assert_eq!(set.manifest.sides, contract::manifest::Sides::Known);
}

#[test]
fn an_incomplete_file_is_an_error() {
    let files = ["points", "faces", "owner", "neighbour", "cellLevel"];
    let foam = files.into_iter().flat_map(|file| [("foam-ascii", file), ("foam-binary", file)]);
    let single = SAMPLES[..7].iter().map(|&(name, _, _)| (name, ""));
    for (name, file) in foam.chain(single) {
        for part in [0.0, 0.1, 0.5, 0.9] {
            refusal(name, file, |bytes| bytes.truncate((bytes.len() as f64 * part) as usize));
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
    let files = ["points", "faces", "owner", "neighbour", "cellLevel"];
    let foam = files.into_iter().flat_map(|file| [("foam-ascii", file), ("foam-binary", file)]);
    let single = SAMPLES
        .iter()
        .filter(|(name, _, _)| !name.starts_with("foam"))
        .map(|&(name, _, _)| (name, ""));
    let (mut refused, mut outcomes) = (0, String::new());
    for (name, file) in foam.chain(single) {
        for round in 0..30 {
            let (place, copy) = edited(name, file, |bytes| {
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
            outcomes += &format!("{name} {file} {round}: {outcome}\n");
        }
    }
    assert!(refused > 250, "{refused}");
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
fn a_compressed_or_missing_file_of_openfoam_is_named() {
    let (_place, copy) = edited("foam-binary", "points", |_| {});
    fs::rename(copy.join("points"), copy.join("points.gz")).unwrap();
    let why = imported(&copy, &Request::default()).unwrap_err().to_string();
    assert!(why.contains("points.gz: is compressed: decompress it with gunzip"), "{why}");
    let (_place, copy) = edited("foam-binary", "points", |_| {});
    fs::remove_file(copy.join("owner")).unwrap();
    let why = imported(&copy, &Request::default()).unwrap_err().to_string();
    assert!(why.contains("owner: cannot be read"), "{why}");
}

#[test]
fn counts_beyond_the_file_are_errors() {
    // Vertices, trees, edges, and corners of the connectivity.
    for number in [2, 3, 4, 6] {
        for count in [1 << 20, 1 << 40, u64::MAX / 24 + 1, u64::MAX] {
            refusal("brick.p8est", "", |bytes| {
                bytes[32 + 8 * number..][..8].copy_from_slice(&count.to_le_bytes())
            });
        }
    }
    for count in ["999999999999", "18446744073709551615", "99999999999999999999999999"] {
        refusal("foam-binary", "points", |bytes| {
            replace(bytes, "\n462\n", &format!("\n{count}\n"))
        });
        refusal("foam-ascii", "owner", |bytes| {
            replace(bytes, "\n960\n(", &format!("\n{count}\n("))
        });
        refusal("foam-ascii", "cellLevel", |bytes| {
            replace(bytes, "\n256\n(", &format!("\n{count}{{0}}\n("))
        });
    }
    let why = refusal("foam-binary", "points", |bytes| replace(bytes, "\n462\n", "\n600\n"));
    assert!(why.contains("points: states 600 items, but has only "), "{why}");
    // An item takes two bytes at least.
    let half = fs::read(sample("foam-ascii").join("owner")).unwrap().len() / 2;
    let why =
        refusal("foam-ascii", "owner", |bytes| replace(bytes, "\n960\n(", &format!("\n{half}\n(")));
    assert!(why.ends_with(&format!("owner: states {half} items: it is incomplete")), "{why}");
}

/// The connectivity's header follows 32 bytes, and the forest's its own.
#[test]
fn a_forest_of_another_format_is_refused() {
    for (number, value) in [(0, 7u64), (1, 8)] {
        let of_connectivity = refusal("brick.p8est", "", |bytes| {
            bytes[32 + 8 * number..][..8].copy_from_slice(&value.to_le_bytes());
        });
        assert!(of_connectivity.contains("is supported"), "{of_connectivity}");
        let of_forest = refusal("brick.p8est", "", |bytes| {
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
        let (_place, copy) = edited("brick.p8est", "", |bytes| {
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
        let (_place, copy) = edited("brick.p8est", "", |bytes| {
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
    let moved = refusal("foam-ascii", "points", |bytes| replace(bytes, "(0 -1 -1)", "(0.2 -1 -1)"));
    assert!(moved.contains("cell 0 (corner [-1.0, -1.0, -1.0]) is not a cube"), "{moved}");
    let level =
        refusal("foam-ascii", "cellLevel", |bytes| replace(bytes, "(\n0\n0\n0\n", "(\n0\n0\n1\n"));
    assert!(
        level.contains("cell 2 has level 1 and edge 1, but cell 0 has level 0 and edge 1"),
        "{level}"
    );
    // The points have the numbers 0 to 461.
    let point = refusal("foam-ascii", "faces", |bytes| replace(bytes, "6(1 6 158", "6(1 6 462"));
    assert!(point.contains("has 462 as item"), "{point}");
    let face = refusal("foam-ascii", "faces", |bytes| {
        let at = String::from_utf8_lossy(bytes).find("\n4(").unwrap();
        let end = bytes[at..].iter().position(|&b| b == b')').unwrap() + at;
        let text = String::from_utf8_lossy(&bytes[at + 3..end]).into_owned();
        let first = text.split(' ').next().unwrap();
        bytes.splice(at + 3..end, [first; 4].join(" ").bytes());
    });
    assert!(face.contains("is not a cube: its faces enclose"), "{face}");
    let quadrant = refusal("unitcube.p8est", "", |bytes| {
        let second = bytes.len() - 16 * 105;
        bytes[second..second + 4].copy_from_slice(&8192i32.to_le_bytes());
    });
    assert!(
        quadrant.contains("[8192, 0, 0]")
            && quadrant.contains("begins where the one before it ends"),
        "{quadrant}"
    );
    let overlap = refusal("cube.msh", "", |bytes| replace(bytes, "\n5 1 1 4\n", "\n1 1 1 4\n"));
    assert!(overlap.contains("cell 1 ") && overlap.contains("overlaps cell 0 "), "{overlap}");
    let index = refusal("cube.json", "", |bytes| replace(bytes, "[[2, 2, 2], ", "[[2, 2, 1], "));
    assert!(index.contains("cell 0 (corner"), "{index}");
}

#[test]
fn lists_of_other_meshes_and_absurd_sizes_are_refused() {
    // One neighbour more than there are faces.
    let why = refusal("foam-ascii", "neighbour", |bytes| {
        let at = bytes.windows(6).position(|w| w == b"\n720\n(").unwrap();
        bytes.truncate(at);
        bytes.extend(format!("\n961\n({})", "0 ".repeat(961)).bytes());
    });
    assert!(
        why.contains(
            "960 faces with 960 owners and 961 neighbours: its files belong to different meshes"
        ),
        "{why}"
    );
    for size in [1 << 20, u64::MAX / 2] {
        let why = refusal("brick.p8est", "", |bytes| {
            let format = 0x0300_0009u64.to_le_bytes();
            let at = bytes.windows(8).rposition(|w| w == format).unwrap();
            bytes[at + 24..at + 32].copy_from_slice(&size.to_le_bytes());
        });
        assert!(why.contains(&format!("it states {size} bytes of data per quadrant")), "{why}");
    }
    let close =
        refusal("cube.json", "", |bytes| replace(bytes, "[[0.125, 0.125", "[[0.125, 0.1250005"));
    assert!(close.contains("widths 0.125 and 0.1250005 along axis 1"), "{close}");
}

#[test]
fn widths_that_vary_are_an_error() {
    let json = refusal("cube.json", "", |bytes| replace(bytes, "[[0.125, 0.125", "[[0.125, 0.25"));
    assert!(json.contains("widths 0.125 and 0.25 along axis 1"), "{json}");
    let text =
        refusal("cube.msh", "", |bytes| replace(bytes, "0.125 0.125 0.125", "0.125 0.250 0.125"));
    assert!(text.contains("only cubes"), "{text}");
}

#[test]
fn the_format_can_be_given() {
    let read = |format| import::read(&sample("cube.csv"), format, &Request::default());
    assert!(read(Format::Csv).is_ok());
    for format in
        [Format::P4est, Format::Discretize, Format::Openfoam, Format::Npy, Format::LeafWords]
    {
        assert!(read(format).is_err(), "{format:?}");
    }
}
