//! STL files, binary and text, including common deviations from the format (reference/DEFINITION.md, section 10).
//!
//! The parser of text walks over the bytes once. Words are compared without case, and lines matter only for names.

use crate::error::Error;
use geometries::Facet;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

const HEADER: u64 = 84;
const RECORD: u64 = 50;

/// An open STL file of known format.
pub struct Stl {
    path: PathBuf,
    file: File,
    /// Number of facets if the file is binary.
    pub binary: Option<u64>,
}

/// Opens a file and determines whether it is binary: whether its length is that of the facets which the header
/// counts.
///
/// # Errors
/// If the file cannot be read or is no STL file.
pub fn open(path: &Path) -> Result<Stl, Error> {
    let failed = |e: io::Error| Error::input(format!("{e}: give a readable STL file")).at(path);
    let file = files::open(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    let mut head = vec![0; length.min(1024) as usize];
    file.read_exact_at(&mut head, 0).map_err(failed)?;
    let count = head.get(80..).and_then(|after| after.first_chunk());
    let count = count.map(|&bytes| u64::from(u32::from_le_bytes(bytes)));
    let binary = count.filter(|count| length == HEADER + RECORD * count);
    // The first word of a text, if it has one, is `solid`, and no byte is zero.
    if binary.is_some() || may_begin_with_solid(&head) && !head.contains(&0) {
        return Ok(Stl { path: path.to_owned(), file, binary });
    }
    let neither =
        "is neither a binary STL nor a text STL, which begins with \"solid\": give an STL file";
    let Some(count) = count else { return Err(Error::input(neither).at(path)) };
    let promised = HEADER + RECORD * count;
    Err(Error::input(format!(
        "the header promises {count} facets, which take {promised} bytes, but the file has {length}: it is truncated, longer or not an STL; export it again"
    ))
    .at(path))
}

impl Stl {
    /// Facets `first..end` of a binary file.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn read(&self, first: u64, end: u64) -> Result<Vec<Facet>, Error> {
        const CHUNK: u64 = 8192;
        let mut out = Vec::with_capacity((end - first) as usize);
        let mut buffer = vec![0; (CHUNK.min(end - first) * RECORD) as usize];
        for at in (first..end).step_by(CHUNK as usize) {
            let bytes = &mut buffer[..(CHUNK.min(end - at) * RECORD) as usize];
            self.file.read_exact_at(bytes, HEADER + RECORD * at).map_err(|e| {
                Error::input(format!("{e} at facet {at}: export it again")).at(&self.path)
            })?;
            out.extend(bytes.as_chunks::<{ RECORD as usize }>().0.iter().map(record));
        }
        Ok(out)
    }

    /// The facets of all solids of a text file.
    ///
    /// # Errors
    /// If the file cannot be read, or is malformed or truncated.
    pub fn read_text(mut self) -> Result<Vec<Facet>, Error> {
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes).map_err(|e| Error::input(e).at(&self.path))?;
        parse(&bytes).map_err(|why| Error::input(format!("{why}: export it again")).at(&self.path))
    }
}

/// The vertices of a binary record. They follow the normal, which is not used.
fn record(bytes: &[u8; RECORD as usize]) -> Facet {
    let coordinates = bytes[12..].as_chunks().0;
    std::array::from_fn(|v| std::array::from_fn(|a| f32::from_le_bytes(coordinates[3 * v + a])))
}

/// Checks that all coordinates are finite; `first` is the index of the first facet, for the error.
///
/// # Errors
/// Names the first facet that has another coordinate.
pub fn check_finite(facets: &[Facet], first: u64) -> Result<(), Error> {
    // Without branches, for the vector lanes.
    let finite = |of: &[f32]| of.iter().fold(true, |all, x| all & x.is_finite());
    if finite(facets.as_flattened().as_flattened()) {
        return Ok(());
    }
    let is_bad = |f: &Facet| !finite(f.as_flattened());
    let bad = facets.iter().position(is_bad).expect("one of them is not finite");
    Err(Error::input(format!(
        "facet {} has a vertex that is not finite: {:?}: repair the geometry",
        first + bad as u64,
        facets[bad]
    )))
}

/// The first bytes of some text files, in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether the first word of a text with this beginning may be `solid`, which the end of `head` may cut short.
fn may_begin_with_solid(head: &[u8]) -> bool {
    let mut text = Text::new(head);
    let word = text.word().to_ascii_lowercase();
    word == b"solid" || text.0.is_empty() && b"solid".starts_with(&word)
}

/// The facets of all solids.
///
/// # Errors
/// The first word that the grammar does not allow, with the index of the facet and the solid: the predicate of a sentence about
/// the file.
fn parse(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    if bytes.contains(&0) {
        return Err("contains a zero byte, which no text does".to_owned());
    }
    let mut text = Text::new(bytes);
    let (mut facets, mut solids) = (Vec::new(), 0);
    while solids == 0 || !text.is_at_end() {
        solids += 1;
        let (solid, facet) = (text.solid(&mut facets), facets.len());
        solid.map_err(|why| format!("is malformed at facet {facet}, in solid {solids} ({why})"))?;
    }
    Ok(facets)
}

/// The rest of a text.
struct Text<'a>(&'a [u8]);

fn is_white(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

impl<'a> Text<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self(bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes))
    }

    /// The next word, which is empty at the end of the text.
    fn word(&mut self) -> &'a [u8] {
        self.next_while(is_white);
        self.next_while(|byte| !is_white(byte))
    }

    /// The next bytes, as many as satisfy a condition.
    fn next_while(&mut self, is_one: impl Fn(u8) -> bool) -> &'a [u8] {
        let length = self.0.iter().take_while(|&&byte| is_one(byte)).count();
        self.0.split_off(..length).expect("no more than the rest")
    }

    fn is_at_end(&mut self) -> bool {
        self.next_while(is_white);
        self.0.is_empty()
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        let word = self.word();
        let is_wanted = word.eq_ignore_ascii_case(wanted.as_bytes());
        if is_wanted { Ok(()) } else { Err(unexpected(word, wanted)) }
    }

    fn solid(&mut self, facets: &mut Vec<Facet>) -> Result<(), String> {
        self.expect("solid")?;
        self.skip_name(|words| words[0].eq_ignore_ascii_case(b"endsolid") || starts_facet(words));
        let mut word = self.word();
        while word.eq_ignore_ascii_case(b"facet") {
            facets.push(self.facet()?);
            word = self.word();
        }
        if !word.eq_ignore_ascii_case(b"endsolid") {
            return Err(unexpected(word, "facet or endsolid"));
        }
        match self.skip_name(starts_facet) {
            true => Err("a facet follows on the line of endsolid".to_owned()),
            false => Ok(()),
        }
    }

    /// The facet after the word `facet`.
    fn facet(&mut self) -> Result<Facet, String> {
        self.expect("normal")?;
        // Normals are not used, and often are not numbers.
        (0..3).for_each(|_| _ = self.word());
        self.expect("outer")?;
        self.expect("loop")?;
        let mut facet = Facet::default();
        for vertex in &mut facet {
            self.expect("vertex")?;
            for coordinate in vertex {
                *coordinate = self.number()?;
            }
        }
        self.expect("endloop")?;
        self.expect("endfacet")?;
        Ok(facet)
    }

    fn number(&mut self) -> Result<f32, String> {
        let word = self.word();
        let number = str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number.filter(|n: &f32| n.is_finite()).ok_or_else(|| unexpected(word, "a finite number"))
    }

    /// Skips the rest of the line up to words of which the first ones satisfy `ends`. Returns whether there are such words.
    fn skip_name(&mut self, ends: impl Fn(&[&[u8]; NAME_AHEAD]) -> bool) -> bool {
        let mut line = Text(Text(self.0).next_while(|byte| !b"\n\r".contains(&byte)));
        let after = &self.0[line.0.len()..];
        while !line.is_at_end() {
            let mut ahead = Text(line.0);
            if ends(&std::array::from_fn(|_| ahead.word())) {
                self.0 = &self.0[self.0.len() - after.len() - line.0.len()..];
                return true;
            }
            line.word();
        }
        self.0 = after;
        false
    }
}

/// Number of words after which it is known that a facet begins.
const NAME_AHEAD: usize = 7;

/// Whether the words are the first ones of a facet.
fn starts_facet(words: &[&[u8]; NAME_AHEAD]) -> bool {
    let start = [(0, "facet"), (1, "normal"), (5, "outer"), (6, "loop")];
    start.iter().all(|&(i, wanted)| words[i].eq_ignore_ascii_case(wanted.as_bytes()))
}

fn unexpected(word: &[u8], wanted: &str) -> String {
    let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
    let found = if word.is_empty() { "ends".to_owned() } else { format!("has {shown:?}") };
    format!("it {found} where {wanted} was expected")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_facet_that_is_not_finite_is_named() {
        let bad = [[[0.0; 3]; 3], [[0.0, 1.0, f32::NAN]; 3]];
        assert!(check_finite(&bad, 7).unwrap_err().to_string().contains("facet 8"));
        assert!(check_finite(&bad[..1], 7).is_ok());
    }

    #[test]
    fn only_a_whole_word_or_the_beginning_of_one_that_is_cut_short_is_solid() {
        for head in ["solid", "\u{feff} \n SoLiD name", "solid\tname", "", "  s", "SOLI"] {
            assert!(may_begin_with_solid(head.as_bytes()), "{head:?}");
        }
        for head in ["solids", "solid_body x", "sol id", "facet", "a solid", "soli\n"] {
            assert!(!may_begin_with_solid(head.as_bytes()), "{head:?}");
        }
    }

    #[test]
    fn a_binary_file_is_recognised_by_its_length() {
        let mut bytes = b"solid but binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2u32.to_le_bytes());
        for i in 0..2 * 12 {
            bytes.extend((i as f32).to_le_bytes());
            if i % 12 == 11 {
                bytes.extend([0, 0]);
            }
        }
        let try_open = |b: &[u8]| {
            let mut f = tempfile::NamedTempFile::new().unwrap();
            f.write_all(b).unwrap();
            open(f.path()).and_then(|s| match s.binary {
                Some(n) => s.read(0, n),
                None => s.read_text(),
            })
        };
        let facets = try_open(&bytes).unwrap();
        assert_eq!(facets[1], [[15.0, 16.0, 17.0], [18.0, 19.0, 20.0], [21.0, 22.0, 23.0]]);
        for cut in [0, 1, 83, 84, 100, bytes.len() - 1] {
            assert_eq!(try_open(&bytes[..cut]).unwrap_err().exit_code, 2, "cut at {cut}");
        }
        bytes.push(0);
        assert!(try_open(&bytes).is_err());
    }
}
