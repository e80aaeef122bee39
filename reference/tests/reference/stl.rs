//! STL files as exporters write them: the variants that must be read and the errors that must be
//! refused.
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

fn assert_refused(bytes: &[u8], part: &str) {
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
    assert_refused(
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
    assert_refused(&whole[..100], "184 bytes for the 2 facets of its header, but it has 100");
    assert_refused(&[&whole[..], b"x"].concat(), "but it has 185");
    assert_refused(&binary(b"", 1, &[FACET, FACET]), "the 1 facets of its header");
    // Nothing is allocated for a count that exceeds the length of the file.
    assert_refused(&binary(b"", u32::MAX, &[FACET]), "the 4294967295 facets of its header");
}

#[test]
fn files_that_are_not_stl_are_refused() {
    assert_refused(b"", "empty");
    assert_refused(b"hello", "neither ASCII STL");
    assert_refused(b"   \n", "neither ASCII STL");
    assert_refused(&[b'#'; 5000], "it is damaged or not STL");
    assert_refused(b"solid\nhello", "line 2 has \"hello\"");
    assert_refused(
        &[TEXT.as_bytes(), b"rubbish"].concat(),
        "line 10 has \"rubbish\" where solid was expected",
    );
    assert_refused(
        TEXT.replace("2.5", "blah").as_bytes(),
        "line 4 has \"blah\" where a number was expected",
    );
    assert_refused(
        TEXT.replace("2.5", "").as_bytes(),
        "line 5 has \"vertex\" where a number was expected",
    );
    assert_refused(
        TEXT.replace("2.5", "2.5 1").as_bytes(),
        "line 4 has \"1\" where vertex was expected",
    );
    assert_refused(TEXT.replace("outer loop", "outer").as_bytes(), "where loop was expected");
    let crlf = TEXT.replace('\n', "\r\n").replace("2.5", "2,5");
    assert_refused(crlf.as_bytes(), "line 4 has \"2,5\"");
    let cr = TEXT.replace('\n', "\r").replace("2.5", "2,5");
    assert_refused(cr.as_bytes(), "line 4 has \"2,5\"");
    let long = format!("solid\n{}", "x".repeat(100_000));
    assert!(parse(long.as_bytes()).unwrap_err().len() < 200);
    assert_refused(b"solid\n\xff\xfe", "line 2");
}

#[test]
fn vertices_that_are_not_finite_are_refused() {
    for word in ["nan", "inf", "-Infinity", "1e999"] {
        assert_refused(
            TEXT.replace("2.5", word).as_bytes(),
            "facet 0 has a vertex that is not finite",
        );
    }
    let mut wrong = FACET;
    wrong[2][1] = f32::NAN;
    assert_refused(&binary(b"", 2, &[FACET, wrong]), "facet 1 has a vertex that is not finite");
}
