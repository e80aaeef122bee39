//! Unusual STL files are read completely, malformed ones are refused, and none makes the mesher crash. The STL readers of mesher,
//! reference and harness are independent programs for one grammar (reference/DEFINITION.md, section 10): on any file they read the same
//! facets, or all refuse it.
//!
//! `STL_INPUTS=1e6` sets the number of inputs of that comparison, and `STL_SEED=7` the first one.

use crate::stl_inputs::{Random, input};
use crate::support::{Facet, config, cuboid};
use geometries::StlFile;
use mesher::error::Error;
use mesher::input::ingest::{self, Source};
use mesher::input::{case::Case, lattice::Bounds, stl};
use proptest::prelude::*;
use ranks::{Solo, sim};
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Reads a whole file on one rank.
fn read(path: &Path) -> Result<Vec<Facet>, Error> {
    Ok(ingest::read(&Source::Stl(path.to_owned()), &Solo)?.facets)
}

fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("room for it");
    file
}

#[test]
fn unusual_files_are_read_bit_for_bit() {
    let valid: Vec<_> = geometries::stl_files().into_iter().filter(|f| f.is_valid).collect();
    assert!(valid.len() >= 15, "only {} files", valid.len());
    let plain = valid.iter().find(|f| f.name == "binary.stl").expect("an ordinary binary STL");
    let want = read(file(&plain.bytes).path()).expect("an ordinary binary STL");
    assert_eq!(want.len(), 8);
    let bits = |facets: &[Facet]| -> Vec<u32> {
        facets.as_flattened().as_flattened().iter().map(|c| c.to_bits()).collect()
    };
    for StlFile { name, bytes, .. } in valid {
        let file = file(&bytes);
        let got = read(file.path()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(bits(&got), bits(&want), "{name}");
        let parts = sim::run(3, 11, |c| {
            ingest::read(&Source::Stl(file.path().to_owned()), c)
                .expect("several ranks read what one rank reads")
                .facets
        });
        assert_eq!(bits(&parts.concat()), bits(&want), "{name} on 3 ranks");
    }
}

fn binary(facets: &[Facet]) -> Vec<u8> {
    let mut bytes = Vec::new();
    geometries::write_stl_binary(facets, &mut bytes).expect("memory can be written to");
    bytes
}

fn text(facets: &[Facet]) -> Vec<u8> {
    let mut s = String::from("solid body\n");
    for f in facets {
        s += "facet normal 0 0 1\nouter loop\n";
        f.iter().for_each(|v| s += &format!("vertex {} {} {}\n", v[0], v[1], v[2]));
        s += "endloop\nendfacet\n";
    }
    (s + "endsolid body\n").into_bytes()
}

/// A kind of damage to a file.
#[derive(Clone, Debug)]
enum Damage {
    Cut(prop::sample::Index),
    Flip(prop::sample::Index, u8),
    Insert(prop::sample::Index, Vec<u8>),
    Remove(prop::sample::Index, usize),
    /// A wrong number of facets in the header.
    Count(u32),
}

fn damage() -> impl Strategy<Value = Damage> {
    let words = prop_oneof![
        prop::collection::vec(any::<u8>(), 1..60),
        Just(b"endsolid\n".to_vec()),
        Just(b"solid x\n".to_vec()),
        Just(b"\nvertex 1 2 3\n".to_vec()),
        Just(b"1e39".to_vec()),
        Just(b"nan".to_vec()),
        Just(b"\r".to_vec()),
        Just("\u{2028}\u{130}".as_bytes().to_vec()),
    ];
    prop_oneof![
        any::<prop::sample::Index>().prop_map(Damage::Cut),
        (any::<prop::sample::Index>(), 1u8..=255).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        (any::<prop::sample::Index>(), words).prop_map(|(at, what)| Damage::Insert(at, what)),
        (any::<prop::sample::Index>(), 1usize..70).prop_map(|(at, n)| Damage::Remove(at, n)),
        prop_oneof![0u32..20, any::<u32>()].prop_map(Damage::Count),
    ]
}

fn damaged(mut bytes: Vec<u8>, by: &[Damage]) -> Vec<u8> {
    for d in by {
        if bytes.is_empty() {
            break;
        }
        match d {
            Damage::Cut(at) => bytes.truncate(at.index(bytes.len())),
            Damage::Flip(at, bits) => {
                let at = at.index(bytes.len());
                bytes[at] ^= bits;
            }
            Damage::Insert(at, what) => {
                let at = at.index(bytes.len());
                bytes.splice(at..at, what.iter().copied());
            }
            Damage::Remove(at, n) => {
                let at = at.index(bytes.len());
                bytes.drain(at..(at + n).min(bytes.len()));
            }
            Damage::Count(n) if bytes.len() >= 84 => {
                bytes[80..84].copy_from_slice(&n.to_le_bytes())
            }
            Damage::Count(_) => {}
        }
    }
    bytes
}

proptest! {
    #![proptest_config(config(1500))]

    /// Damaged files give finite facets and a mesh, or an input error.
    #[test]
    fn damaged_files_are_read_or_refused(
        in_text in any::<bool>(),
        by in prop::collection::vec(damage(), 1..4),
    ) {
        let body = cuboid([-1.0, 0.5, 1e-3], [2.0, 0.75, 40.0]);
        let bytes = if in_text { text(&body) } else { binary(&body) };
        let file = file(&damaged(bytes, &by));
        match read(file.path()) {
            Err(error) => is_input_error(&error)?,
            Ok(facets) => {
                prop_assert!(facets.as_flattened().as_flattened().iter().all(|c| c.is_finite()));
                mesh_coarsely(file.path(), &facets)?;
            }
        }
    }

    #[test]
    fn binary_files_are_recognised_by_their_length(count in 0u32..40, length in 0usize..2100, text in any::<bool>()) {
        let mut bytes = vec![if text { b' ' } else { 0 }; length];
        bytes.iter_mut().zip(b"solid").for_each(|(b, s)| *b = *s);
        if length >= 84 {
            bytes[80..84].copy_from_slice(&count.to_le_bytes());
        }
        let file = file(&bytes);
        let fits = length == 84 + 50 * count as usize;
        match stl::open(file.path()) {
            Ok(stl) => prop_assert_eq!(stl.binary, fits.then_some(u64::from(count))),
            Err(_) => prop_assert!(!fits),
        }
    }

    /// Damaged case files give a case with valid rules, or an input error.
    #[test]
    fn damaged_case_files_are_read_or_refused(by in prop::collection::vec(damage(), 1..4)) {
        const GOOD: &str = "geometry = \"uav.stl\"\nspacing_min = 0.01\nlayer_cells_min = 4\nkeep = \"outside\"\n
            keep_crossing = true\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n[[box]]\nmin = [0.0, -1.0, -1.0]\n
            max = [4.0, 1.0, 1.0]\nspacing = 0.05\n";
        let file = file(&damaged(GOOD.into(), &by));
        match case_file::read(file.path()) {
            Err(error) => is_input_error(&error)?,
            Ok(case) => {
                let unit = Bounds { lo: [0.0; 3], hi: [1.0; 3] };
                if let Ok(rules) = case.rules(&unit) {
                    prop_assert!(rules.level_deepest() <= 19 && rules.layer_cells_min > 0);
                }
            }
        }
    }
}

/// One sentence, and the exit code of unusable input.
fn is_input_error(error: &Error) -> Result<(), TestCaseError> {
    let text = error.to_string();
    prop_assert!(error.exit_code == 2 && !text.is_empty() && !text.contains('\n'), "{}", text);
    Ok(())
}

/// Meshes the facets with a few cells along their longest edge; of whatever size, it must not crash.
fn mesh_coarsely(path: &Path, facets: &[Facet]) -> Result<(), TestCaseError> {
    let bounds = Bounds::of(facets);
    let longest = (0..3).map(|a| bounds.hi[a] - bounds.lo[a]).fold(0.0, f64::max);
    let mut case = Case {
        source: Source::Stl(path.to_owned()),
        spacing_min: longest / 4.0,
        layer_cells_min: 2,
        keep: mesher::input::lattice::Keep::All,
        keep_crossing: true,
        root: mesher::input::case::RootSpec::Scale(1.5),
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: mesher::input::lattice::Enclosed::Delete,
    };
    let options = crate::support::options(crate::support::Run::SOLO.division, false);
    match crate::support::words(&case, &options, &Solo) {
        Ok((words, ..)) => prop_assert!(words.is_sorted() && !words.is_empty()),
        Err(e) => {
            is_input_error(&e)?;
            prop_assert!(longest == 0.0, "{}", e);
        }
    }
    // A root that most facets are outside.
    let root = mesher::input::lattice::Root { origin: [0.0; 3], edge: 1.0 };
    (case.root, case.spacing_min) = (mesher::input::case::RootSpec::Exact(root), 0.25);
    if let Err(e) = crate::support::words(&case, &options, &Solo) {
        is_input_error(&e)?;
    }
    Ok(())
}

type Bits = Vec<[[u32; 3]; 3]>;

/// The bits of the coordinates; `None` if one is not finite.
fn bits(facets: Vec<Facet>) -> Option<Bits> {
    let finite = facets.as_flattened().as_flattened().iter().all(|c| c.is_finite());
    finite.then(|| facets.iter().map(|f| f.map(|v| v.map(f32::to_bits))).collect())
}

/// What mesher, reference and harness read; `None` if they refuse the file.
fn read_by_all(bytes: &[u8], file: &Path) -> [Option<Bits>; 3] {
    // Rewritten in place: a file system may flush a file that was truncated first, a millisecond each.
    let open = File::options().create(true).truncate(false).write(true).open(file);
    let mut out = open.expect("a temporary file");
    out.write_all(bytes).expect("room for a small file");
    out.set_len(bytes.len() as u64).expect("a file of the right length");
    let mesher = ingest::read(&Source::Stl(file.to_owned()), &Solo).ok();
    [
        mesher.and_then(|slice| bits(slice.facets)),
        reference::stl::parse(bytes).ok().and_then(bits),
        contract::stl::parse(bytes).ok().and_then(|body| bits(body.facets)),
    ]
}

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse::<f64>().expect("a number") as u64)
}

#[test]
fn three_readers_agree_on_every_input() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("body.stl");
    let (first, count) = (variable("STL_SEED", 0), variable("STL_INPUTS", 20_000));
    let mut accepted = 0;
    for seed in first..first + count {
        let bytes = input(&mut Random(seed));
        let [mesher, reference, harness] = read_by_all(&bytes, &file);
        let agree = mesher == reference && reference == harness;
        let text = String::from_utf8_lossy(&bytes);
        assert!(
            agree,
            "seed {seed}: mesher {}, reference {}, harness {}: {text:?}",
            mesher.is_some(),
            reference.is_some(),
            harness.is_some()
        );
        accepted += u64::from(mesher.is_some());
    }
    println!("{count} inputs, {accepted} accepted");
    assert!(accepted > count / 10 && accepted < 9 * count / 10, "{accepted} of {count}");
}

#[test]
fn each_form_of_the_grammar_is_accepted_or_refused_by_all() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("body.stl");
    let facet =
        "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet";
    let lines = facet.replace(' ', "\n");
    for (text, facets) in [
        (format!("solid a {facet} {facet} endsolid a"), Some(2)),
        (format!("\u{feff}solid a\n{facet}\nendsolid"), Some(1)),
        (format!("solid\x0b\x0c\n{lines}\nendsolid\n"), Some(1)),
        (format!("solid facet normal vertex\n{facet}\nendsolid facet normal vertex\n"), Some(1)),
        (format!("{}solid a\n{facet}\nendsolid\n", "\n".repeat(5000)), Some(1)),
        ("solid\nendsolid".to_owned(), Some(0)),
        (format!("solid a\nendsolid a\n{facet}\n"), None),
        (format!("solid a\n{facet}\nendsolid a solid b {facet} endsolid b\n"), None),
        (format!("solid a\n{}\nendsolid\n", facet.replace("normal 0 0 1", "banana")), None),
        (format!("solid a\n{}\nendsolid\n", facet.replace("outer", "junk outer")), None),
        (format!("solid a\n{}\nendsolid\n", facet.replace("vertex 0 1 0", "vertex 0 1 0 0")), None),
        ("solid state drive: all tests passed\nno facets here\n".to_owned(), None),
        (format!("solid a\n{facet}\n"), None),
        (format!("solid a\n{}\nendsolid", facet.replace("1 0 0", "1 0 nan")), None),
        (String::new(), None),
    ] {
        let found = read_by_all(text.as_bytes(), &file).map(|body| body.map(|facets| facets.len()));
        assert_eq!(found, [facets; 3], "{text:?}");
    }
}

#[test]
fn an_independent_library_reads_the_same_from_ordinary_text() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("body.stl");
    let mut random = Random(1);
    for _ in 0..200 {
        let mut text = String::from("solid x\n");
        for _ in 0..random.below(5) {
            text += "facet normal 0 0 1\nouter loop\n";
            for _ in 0..3 {
                let mut number = || f32::from_bits(random.next() as u32 % 0x7f80_0000);
                text += &format!("vertex {:e} {} -{:e}\n", number(), number() as f64, number());
            }
            text += "endloop\nendfacet\n";
        }
        text += "endsolid x\n";
        let mut cursor = std::io::Cursor::new(&text);
        let library = stl_io::create_stl_reader(&mut cursor).unwrap();
        let library: Vec<Facet> = library.map(|t| t.unwrap().vertices.map(|v| v.0)).collect();
        let ours = read_by_all(text.as_bytes(), &file);
        assert!(ours.iter().all(|read| *read == bits(library.clone())), "{text}");
    }
}
