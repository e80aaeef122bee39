//! The harness's own STL reader. It is independent of the reader of the program under test, so that a body that the
//! program misreads cannot go unnoticed.

use std::path::Path;

use geometries::Facet;

/// Why a body cannot be read: the predicate of a sentence whose subject is the file.
#[derive(Debug, thiserror::Error)]
pub enum StlError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file has neither the length of a binary STL file nor the syntax of an ASCII one.
    #[error("is not an STL file: {0}")]
    Format(String),
}

/// Reads a binary or ASCII STL file into memory.
///
/// # Errors
/// If the file cannot be read, or is not an STL file.
pub fn read(path: &Path) -> Result<Vec<Facet>, StlError> {
    let bytes = std::fs::read(path)?;
    match binary(&bytes) {
        Some(facets) => Ok(facets),
        None => ascii(&bytes),
    }
}

/// The facets of a binary file; `None` if the length of the file contradicts its facet count. The header cannot
/// decide, because that of some binary files begins with "solid".
fn binary(bytes: &[u8]) -> Option<Vec<Facet>> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?);
    if bytes.len() as u64 != 84 + 50 * u64::from(count) {
        return None;
    }
    let number = |b: &[u8]| f32::from_le_bytes(b.try_into().expect("four bytes"));
    let facet = |record: &[u8]| -> Facet {
        std::array::from_fn(|v| {
            std::array::from_fn(|a| {
                let at = 12 * (v + 1) + 4 * a;
                number(&record[at..at + 4])
            })
        })
    };
    Some(bytes[84..].chunks_exact(50).map(facet).collect())
}

/// The facets of all solids of an ASCII file. A solid's name may be any text, so lines with a name are removed
/// before the rest is split into words.
fn ascii(bytes: &[u8]) -> Result<Vec<Facet>, StlError> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty()).peekable();
    if lines.peek().is_none_or(|l| first_word(l) != "solid") {
        return Err(wrong("it is not binary and does not begin with `solid`"));
    }
    let (mut words, mut open) = (Vec::new(), false);
    for line in lines {
        match first_word(line).as_str() {
            "solid" if open => return Err(wrong("a solid begins before `endsolid`")),
            "solid" => open = true,
            "endsolid" => open = false,
            _ if open => words.extend(line.split_whitespace()),
            _ => return Err(wrong(&format!("{line:?} is outside all solids"))),
        }
    }
    if open {
        return Err(wrong("it ends before `endsolid`"));
    }
    let mut facets = Vec::new();
    let mut words = words.into_iter().peekable();
    while words.peek().is_some() {
        facets.push(facet(&mut words)?);
    }
    Ok(facets)
}

/// One facet. Its normal is ignored.
fn facet<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<Facet, StlError> {
    expect(words, &["facet", "normal"])?;
    let normal = words.by_ref().take(3).count();
    expect(words, if normal == 3 { &["outer", "loop"] } else { &["a normal of three numbers"] })?;
    let mut facet = Facet::default();
    for vertex in &mut facet {
        expect(words, &["vertex"])?;
        for c in vertex {
            let text = words.next().unwrap_or_default();
            *c = text.parse().map_err(|_| wrong(&format!("{text:?} is not a coordinate")))?;
        }
    }
    expect(words, &["endloop", "endfacet"])?;
    Ok(facet)
}

fn expect<'a>(words: &mut impl Iterator<Item = &'a str>, key: &[&str]) -> Result<(), StlError> {
    for key in key {
        let word = words.next().unwrap_or_default();
        if !word.eq_ignore_ascii_case(key) {
            return Err(wrong(&format!("`{key}` expected, found {word:?}")));
        }
    }
    Ok(())
}

fn first_word(line: &str) -> String {
    line.split_whitespace().next().unwrap_or_default().to_ascii_lowercase()
}

fn wrong(why: &str) -> StlError {
    StlError::Format(why.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                         vertex 0 1 -2.5e-1\nendloop\nendfacet\n";
    const EXPECTED: Facet = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, -0.25]];

    fn of(bytes: &[u8]) -> Result<Vec<Facet>, StlError> {
        binary(bytes).map_or_else(|| ascii(bytes), Ok)
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
}
