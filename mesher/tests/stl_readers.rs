//! The STL readers of mesher, reference and harness are independent programs for one grammar
//! (reference/DEFINITION.md, section 10): on any file they read the same facets, or all refuse it.
//!
//! `STL_INPUTS=1e6` sets the number of inputs, and `STL_SEED=7` the first one.
#![allow(missing_docs)]

use geometries::Facet;
use mesher::comm::Solo;
use mesher::ingest::{self, Source};
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// A sequence of pseudorandom numbers (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn of<'a>(&mut self, items: &[&'a [u8]]) -> &'a [u8] {
        items[self.below(items.len())]
    }
}

const WORDS: &[&[u8]] = &[
    b"solid",
    b"endsolid",
    b"facet",
    b"normal",
    b"outer",
    b"loop",
    b"vertex",
    b"endloop",
    b"endfacet",
    b"SOLID",
    b"EndSolid",
    b"0",
    b"1",
    b"-2.5e-1",
    b"1.",
    b".5",
    b".",
    b"+3E+2",
    b"1e",
    b"1e99",
    b"-0",
    b"1e-60",
    b"nan",
    b"-NaN",
    b"inf",
    b"infinity",
    b"0x1p3",
    b"1_0",
    b"1,5",
    b"banana",
    b"\xff\xfe",
    b"\xc2\xa0",
    b"\xe2\x80\xa8",
    b"\xef\xbb\xbf",
    b"\0",
    b"x",
    b"16777217",
    b"0.1",
];
const GAPS: &[&[u8]] =
    &[b" ", b" ", b" ", b"\n", b"\n", b"\r\n", b"\r", b"\t", b"\x0b", b"\x0c", b"  \n ", b""];

/// A valid file: one or two solids, with line ends of one kind or anything between words.
fn valid(random: &mut Random) -> Vec<&'static [u8]> {
    let gap: Option<&[u8]> = (random.below(3) > 0).then(|| random.of(&GAPS[..4]));
    let mut tokens: Vec<&[u8]> = Vec::new();
    for _ in 0..=random.below(2) {
        tokens.extend([b"solid" as &[u8], b" name" as &[u8], b"\n"]);
        for _ in 0..random.below(3) {
            let facet: [&[u8]; 21] = [
                b"facet",
                b"normal",
                b"0",
                b"0",
                b"1",
                b"outer",
                b"loop",
                b"vertex",
                b"0",
                b"0",
                b"0",
                b"vertex",
                b"1",
                b".5",
                b"-0",
                b"vertex",
                b"0.1",
                b"1e-3",
                b"7",
                b"endloop",
                b"endfacet",
            ];
            for word in facet {
                tokens.extend([word, gap.unwrap_or_else(|| random.of(&GAPS[..11]))]);
            }
        }
        tokens.extend([
            b"endsolid" as &[u8],
            b" name",
            if random.below(4) > 0 { b"\n" } else { b" " },
        ]);
    }
    tokens
}

/// A file that is nearly always nearly valid.
fn input(random: &mut Random) -> Vec<u8> {
    if random.below(16) == 0 {
        return binary(random);
    }
    let mut tokens = valid(random);
    for _ in 0..random.below(4) {
        let at = random.below(tokens.len());
        match random.below(5) {
            0 if tokens.len() > 1 => drop(tokens.remove(at)),
            0 | 1 => tokens[at] = random.of(WORDS),
            2 => tokens[at] = random.of(GAPS),
            3 => {
                tokens.insert(at, b" ");
                tokens.insert(at, random.of(WORDS));
            }
            _ => tokens.truncate(at.max(1)),
        }
    }
    let mut bytes = tokens.concat();
    if random.below(8) == 0 {
        let white = [b"\n", b" ", b"\x0b"][random.below(3)];
        bytes = [b"\xef\xbb\xbf".repeat(random.below(3)), white.repeat(random.below(2000)), bytes]
            .concat();
    }
    if random.below(4) == 0 && !bytes.is_empty() {
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
    }
    bytes
}

/// A binary file, whose length its header may contradict.
fn binary(random: &mut Random) -> Vec<u8> {
    let mut bytes = if random.below(2) == 0 { b"solid x".to_vec() } else { Vec::new() };
    bytes.resize(80, if random.below(2) == 0 { b' ' } else { 0 });
    let count = random.below(4);
    bytes.extend((count as u32).to_le_bytes());
    bytes.extend((0..50 * count).map(|i| if i % 4 == 3 { 0x3f } else { random.next() as u8 }));
    if random.below(4) == 0 {
        bytes.truncate(random.below(bytes.len() + 1));
    }
    bytes
}

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
