//! Incomplete, damaged and contradictory meshes: each is refused in a sentence that names the place.

use super::*;

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
fn swapped_bytes_and_a_leaf_set_are_named() {
    let why = refusal("brick.p8est", |bytes| {
        for number in bytes[32..112].chunks_exact_mut(8) {
            number.reverse();
        }
    });
    assert!(why.contains("bytes are swapped"), "{why}");
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
    assert!(refused(&path).contains("has type >u8"), "{}", refused(&path));
    let mesh = place.path().join("mesh");
    let set = imported(&sample("unitcube.p8est"), &Request::default()).unwrap();
    set.create(&mesh).unwrap();
    let why = refused(&mesh);
    assert!(why.contains("needs no import: `harness audit` shows"), "{why}");
}
