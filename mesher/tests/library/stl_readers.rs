//! The STL readers of mesher, reference and harness are independent programs for one grammar
//! (reference/DEFINITION.md, section 10): on any file they read the same facets, or all refuse it.
//!
//! `STL_INPUTS=1e6` sets the number of inputs, and `STL_SEED=7` the first one.

use crate::stl_inputs::{Random, input};
use geometries::Facet;
use mesher::input::ingest::{self, Source};
use ranks::Solo;
use std::fs::File;
use std::io::Write;
use std::path::Path;

type Bits = Vec<[[u32; 3]; 3]>;

/// The bits of the coordinates; `None` if one is not finite.
fn bits(facets: Vec<Facet>) -> Option<Bits> {
    let finite = facets.as_flattened().as_flattened().iter().all(|c| c.is_finite());
    finite.then(|| facets.iter().map(|f| f.map(|v| v.map(f32::to_bits))).collect())
}

/// What mesher, reference and harness read; `None` if they refuse the file.
fn read(bytes: &[u8], file: &Path) -> [Option<Bits>; 3] {
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
        let [mesher, reference, harness] = read(&bytes, &file);
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
        let found = read(text.as_bytes(), &file).map(|body| body.map(|facets| facets.len()));
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
        let ours = read(text.as_bytes(), &file);
        assert!(ours.iter().all(|read| *read == bits(library.clone())), "{text}");
    }
}
