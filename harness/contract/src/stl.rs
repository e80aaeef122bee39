//! The harness's own STL reader. It is independent of the reader of the program under test, so that a body that the
//! program misreads cannot go unnoticed.

use std::path::Path;

use geometries::Facet;
use serde::Serialize;

use crate::failure::{Failure, Result};
use crate::files;

/// A solid of an STL file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Solid {
    /// The name in an ASCII file, possibly empty; none in a binary file, which is one solid.
    pub name: Option<String>,
    /// Index of the first facet.
    pub facet_first: usize,
    /// Number of facets.
    pub facets: usize,
}

/// The content of an STL file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// The facets of all solids.
    pub facets: Vec<Facet>,
    /// The solids, in the order of the file.
    pub solids: Vec<Solid>,
}

/// Reads a binary or ASCII STL file into memory.
///
/// # Errors
/// A sentence that begins with the path, if the file cannot be read, or is not an STL file.
pub fn read(path: &Path) -> Result<Body> {
    let body = files::read(path).map_err(Failure::unreadable).and_then(|bytes| parse(&bytes));
    body.map_err(|why| Failure::input(format!("{} {why}", path.display())))
}

/// Parses the bytes of an STL file.
///
/// # Errors
/// If they are not an STL file.
pub fn parse(bytes: &[u8]) -> Result<Body> {
    Failure::unless(!bytes.is_empty(), wrong("it is empty"))?;
    let Some(facets) = binary(bytes) else { return ascii(bytes) };
    Ok(Body { solids: vec![Solid { name: None, facet_first: 0, facets: facets.len() }], facets })
}

/// The facets of a binary file; `None` if the length of the file contradicts its facet count. The header cannot
/// decide, because that of some binary files begins with "solid".
fn binary(bytes: &[u8]) -> Option<Vec<Facet>> {
    if bytes.len() as u64 != length(facet_count(bytes)?) {
        return None;
    }
    let facet = |record: &[u8; 50]| {
        let (vertices, _) = record[12..].as_chunks::<4>().0.as_chunks::<3>();
        std::array::from_fn(|v| vertices[v].map(f32::from_le_bytes))
    };
    Some(bytes[84..].as_chunks().0.iter().map(facet).collect())
}

/// The facet count in the header of a binary file; `None` if the bytes end before it.
fn facet_count(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?))
}

/// The length of a binary file in bytes.
fn length(facets: u32) -> u64 {
    84 + 50 * u64::from(facets)
}

/// Bytes that are neither text nor a binary file: probably a binary file that is truncated.
fn damaged(bytes: &[u8]) -> Failure {
    let found = bytes.len();
    let promised = facet_count(bytes).map_or("a header of 84 bytes".to_owned(), |count| {
        format!("the {} bytes of the {count} facets that its header promises", length(count))
    });
    wrong(&format!("it is not text, and has {found} bytes in place of {promised}: export it again"))
}

/// A word, and the number of line ends before it.
type Word<'a> = (&'a [u8], usize);

/// The words of a text. A carriage return before a line feed ends one more line, which does no harm: lines are only compared.
fn words(bytes: &[u8]) -> impl Iterator<Item = Word<'_>> + Clone {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    text.split(|b| matches!(b, b'\n' | b'\r')).enumerate().flat_map(|(line, text)| {
        let words = text.split(|b| matches!(b, b' ' | b'\t' | 0x0b | 0x0c));
        words.filter(|word| !word.is_empty()).map(move |word| (word, line))
    })
}

/// The solids of an ASCII file (reference/DEFINITION.md, section 10).
fn ascii(bytes: &[u8]) -> Result<Body> {
    Failure::unless(!bytes.contains(&0), damaged(bytes))?;
    let mut words = words(bytes);
    let mut body = Body::default();
    let begins = words.clone().next().is_some_and(|(word, _)| is(word, "solid"));
    Failure::unless(begins, wrong("it is not binary and does not begin with `solid`"))?;
    while words.clone().next().is_some() {
        let line = expect(&mut words, "solid")?;
        let name = Some(name(&mut words, line, true));
        let facet_first = body.facets.len();
        let line = loop {
            match words.next() {
                Some((word, _)) if is(word, "facet") => {
                    let before = body.facets.len();
                    let located = |why| Failure::input(format!("{why}, after {before} facets"));
                    body.facets.push(facet(&mut words).map_err(located)?);
                }
                Some((word, line)) if is(word, "endsolid") => break line,
                other => return Err(unexpected("facet` or `endsolid", other)),
            }
        };
        self::name(&mut words, line, false);
        let why = "a facet follows on the line of `endsolid`";
        Failure::unless(!starts_facet(&words, line), wrong(why))?;
        body.solids.push(Solid { name, facet_first, facets: body.facets.len() - facet_first });
    }
    Ok(body)
}

/// The words of a line up to its end, up to a facet, or, after `solid`, up to `endsolid`.
fn name<'a>(
    words: &mut (impl Iterator<Item = Word<'a>> + Clone),
    line: usize,
    of_solid: bool,
) -> String {
    let mut name = Vec::new();
    while let Some((word, at)) = words.clone().next()
        && at == line
        && !(of_solid && is(word, "endsolid"))
        && !starts_facet(words, line)
    {
        name.push(String::from_utf8_lossy(word));
        words.next();
    }
    name.join(" ")
}

/// Whether the first seven words of a facet follow on a line.
fn starts_facet<'a>(words: &(impl Iterator<Item = Word<'a>> + Clone), line: usize) -> bool {
    let start: Vec<&[u8]> =
        words.clone().take(7).take_while(|&(_, at)| at == line).map(|(word, _)| word).collect();
    let wanted = [(0, "facet"), (1, "normal"), (5, "outer"), (6, "loop")];
    start.len() == 7 && wanted.iter().all(|&(i, wanted)| is(start[i], wanted))
}

/// A facet after its first word. Its normal is ignored.
fn facet<'a>(words: &mut impl Iterator<Item = Word<'a>>) -> Result<Facet> {
    expect(words, "normal")?;
    if words.take(3).count() < 3 {
        return Err(unexpected("a normal", None));
    }
    expect(words, "outer")?;
    expect(words, "loop")?;
    let mut facet = Facet::default();
    for vertex in &mut facet {
        expect(words, "vertex")?;
        for coordinate in vertex {
            let word = words.next();
            let text = word.and_then(|(word, _)| str::from_utf8(word).ok());
            let number = text.and_then(|text| text.parse().ok());
            *coordinate = number.ok_or_else(|| unexpected("a number", word))?;
        }
    }
    expect(words, "endloop")?;
    expect(words, "endfacet")?;
    Ok(facet)
}

/// Takes this word; returns its line.
fn expect<'a>(words: &mut impl Iterator<Item = Word<'a>>, wanted: &str) -> Result<usize> {
    match words.next() {
        Some((word, line)) if is(word, wanted) => Ok(line),
        other => Err(unexpected(wanted, other)),
    }
}

fn is(word: &[u8], wanted: &str) -> bool {
    word.eq_ignore_ascii_case(wanted.as_bytes())
}

fn unexpected(wanted: &str, found: Option<Word>) -> Failure {
    match found {
        Some((word, _)) => {
            let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
            wrong(&format!("`{wanted}` expected, found {shown:?}"))
        }
        None => wrong(&format!("it ends where `{wanted}` was expected")),
    }
}

fn wrong(why: &str) -> Failure {
    Failure::input(format!("is not an STL file: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                         vertex 0 1 -2.5e-1\nendloop\nendfacet\n";
    const EXPECTED: Facet = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, -0.25]];

    fn of(bytes: &[u8]) -> Result<Vec<Facet>> {
        parse(bytes).map(|body| body.facets)
    }

    #[test]
    fn ascii_files_may_have_several_solids_any_line_ends_and_any_case() {
        let plain = format!("solid a\n{FACET}endsolid a\n");
        let two = format!("{plain}solid vertex 1 2 3\n{FACET}endsolid\n");
        assert_eq!(of(plain.as_bytes()).unwrap(), [EXPECTED]);
        assert_eq!(of(two.as_bytes()).unwrap(), [EXPECTED, EXPECTED]);
        for text in [plain.replace('\n', "\r\n"), plain.replace('\n', "\r"), plain.to_uppercase()] {
            assert_eq!(of(text.as_bytes()).unwrap(), [EXPECTED]);
        }
        let one_line = format!("\n  solid\n{}\nendsolid", FACET.replace('\n', " "));
        assert_eq!(of(one_line.as_bytes()).unwrap(), [EXPECTED]);
        assert_eq!(of(b"solid\nendsolid").unwrap(), [] as [Facet; 0]);
    }

    #[test]
    fn a_binary_header_may_begin_with_solid() {
        let mut bytes = b"solid".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([0; 12]);
        EXPECTED.as_flattened().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend([0; 2]);
        assert_eq!(of(&bytes).unwrap(), [EXPECTED]);
        assert!(of(&bytes[..bytes.len() - 1]).is_err());
    }

    #[test]
    fn a_truncated_binary_file_and_an_empty_one_are_called_so() {
        let mut bytes = vec![0; 80];
        bytes.extend(3u32.to_le_bytes());
        bytes.extend([0; 120]);
        let why = of(&bytes).unwrap_err().to_string();
        assert!(why.contains("204 bytes in place of the 234 bytes of the 3 facets"), "{why}");
        let why = of(&bytes[..60]).unwrap_err().to_string();
        assert!(why.contains("60 bytes in place of a header"), "{why}");
        assert_eq!(of(b"").unwrap_err().to_string(), "is not an STL file: it is empty");
    }

    #[test]
    fn other_text_is_rejected() {
        for text in [
            "",
            "hello",
            "solid a\nfacet",
            "solid a\nvertex 1 2\nendsolid",
            "solid a\nvertex 1 2 3\nendsolid",
            "solid a\nbanana\nendsolid",
        ] {
            assert!(of(text.as_bytes()).is_err(), "{text:?}");
        }
    }

    #[test]
    fn every_solid_has_its_name_and_first_facet() {
        let one_line = FACET.replace('\n', " ");
        let text = format!(
            "solid endfacet of a wing\n{FACET}{FACET}endsolid endfacet of a wing\r\nSOLID\n{one_line}\nendsolid\n\
             solid b {one_line} endsolid b\n"
        );
        let solid = |name: &str, facet_first, facets| Solid {
            name: Some(name.into()),
            facet_first,
            facets,
        };
        let expected = [solid("endfacet of a wing", 0, 2), solid("", 2, 1), solid("b", 3, 1)];
        assert_eq!(parse(text.as_bytes()).unwrap().solids, expected);
    }
}
