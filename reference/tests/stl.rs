//! STL files as they are met: what must be read, and what must be refused with a sentence.
use reference::stl::{Facet, parse};

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

/// The sentence on what is wrong, which must hold `part`.
fn refused(bytes: &[u8], part: &str) {
    let problem = parse(bytes).unwrap_err();
    assert!(problem.contains(part), "{problem:?} should say {part:?}");
}

#[test]
fn binary_files() {
    assert_eq!(parse(&binary(b"", 2, &[FACET, FACET])).unwrap(), [FACET, FACET]);
    assert_eq!(parse(&binary(b"solid but binary", 1, &[FACET])).unwrap(), [FACET]);
    let no_zero_byte = [b'x'; 80];
    assert_eq!(parse(&binary(&no_zero_byte, 1, &[FACET])).unwrap(), [FACET]);
    assert!(parse(&binary(b"", 0, &[])).unwrap().is_empty());
}

#[test]
fn ascii_files() {
    assert_eq!(parse(TEXT.as_bytes()).unwrap(), [FACET]);
    for (from, to) in [
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("\n", " \n\n\t"),
        ("solid part one", "solid"),
        ("solid part", "solid facet normal"),
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
    assert_eq!(parse(TEXT.trim_end().as_bytes()).unwrap(), [FACET], "no line end at the end");
}

#[test]
fn several_solids() {
    let solids = [TEXT, "solid\nendsolid\n", &TEXT.to_uppercase(), TEXT].concat();
    assert_eq!(parse(solids.as_bytes()).unwrap(), [FACET; 3]);
    assert!(parse(b"solid nothing\nendsolid nothing\n").unwrap().is_empty());
}

/// Whatever is cut off at the end, it is missed; only a name may go.
#[test]
fn truncated_ascii_files() {
    let whole = TEXT.find("endsolid").unwrap() + "endsolid".len();
    for length in "solid".len()..whole {
        assert!(parse(&TEXT.as_bytes()[..length]).is_err(), "{length} bytes");
    }
    refused(&TEXT.as_bytes()[..whole - 8], "line 9 where facet or endsolid should follow");
}

#[test]
fn truncated_and_overlong_binary_files() {
    let whole = binary(b"solid", 2, &[FACET, FACET]);
    for length in 0..whole.len() {
        assert!(parse(&whole[..length]).is_err(), "{length} bytes");
    }
    refused(&whole[..100], "promises 2 facets, 184 bytes in all, but the file has 100");
    refused(&[&whole[..], b"x"].concat(), "but the file has 185");
    refused(&binary(b"", 1, &[FACET, FACET]), "promises 1 facets");
    // Nothing is allocated for a count that the file cannot hold.
    refused(&binary(b"", u32::MAX, &[FACET]), "promises 4294967295 facets");
}

#[test]
fn what_is_not_stl() {
    refused(b"", "empty");
    refused(b"hello", "neither ASCII STL");
    refused(b"   \n", "neither ASCII STL");
    refused(&[b'#'; 5000], "it is damaged or no STL");
    refused(b"solid\nhello", "line 2 says \"hello\"");
    refused(
        &[TEXT.as_bytes(), b"rubbish"].concat(),
        "line 10 says \"rubbish\" where solid should be",
    );
    refused(
        TEXT.replace("2.5", "blah").as_bytes(),
        "line 4 says \"blah\" where a number should be",
    );
    refused(TEXT.replace("2.5", "").as_bytes(), "line 5 says \"vertex\" where a number should be");
    refused(TEXT.replace("2.5", "2.5 1").as_bytes(), "line 4 says \"1\" where vertex should be");
    refused(TEXT.replace("outer loop", "outer").as_bytes(), "where loop should be");
    let crlf = TEXT.replace('\n', "\r\n").replace("2.5", "2,5");
    refused(crlf.as_bytes(), "line 4 says \"2,5\"");
    let cr = TEXT.replace('\n', "\r").replace("2.5", "2,5");
    refused(cr.as_bytes(), "line 4 says \"2,5\"");
    let long = format!("solid\n{}", "x".repeat(100_000));
    assert!(parse(long.as_bytes()).unwrap_err().len() < 200);
    refused(b"solid\n\xff\xfe", "line 2");
}

#[test]
fn vertices_that_are_not_finite() {
    for word in ["nan", "inf", "-Infinity", "1e999"] {
        refused(TEXT.replace("2.5", word).as_bytes(), "facet 0 has a vertex that is not finite");
    }
    let mut wrong = FACET;
    wrong[2][1] = f32::NAN;
    refused(&binary(b"", 2, &[FACET, wrong]), "facet 1 has a vertex that is not finite");
}
