//! Reader of STL files, binary or ASCII.
//!
//! A file is binary if its length is 84 + 50 n for the n in its header, whatever its first bytes:
//! some binary files begin with "solid". Any other file must be ASCII: any number of solids, as words
//! separated by any white space. Files in use contain upper and lower case, three kinds of line end,
//! blank lines and solids without a name. Lines matter only after `solid` and `endsolid`, for names
//! (DEFINITION, section 10).
use crate::error::{Error, read_file};
use std::path::Path;

/// The three vertices of a facet, in the precision of STL.
pub type Facet = [[f32; 3]; 3];

const HEADER_BYTES: usize = 84;
const FACET_BYTES: usize = 50;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads the facets of an STL file. A valid file may contain no facets; a file of zero bytes is an
/// error.
///
/// # Errors
/// The file cannot be read, is damaged or is not STL, or a vertex is not finite.
pub fn read(path: &Path) -> Result<Vec<Facet>, Error> {
    let bytes = read_file(path)?;
    parse(&bytes).map_err(|why| Error::Invalid(format!("geometry {}: {why}", path.display())))
}

/// Parses the bytes of an STL file.
///
/// # Errors
/// One sentence with the problem, its location and a remedy, without the path of the file.
pub fn parse(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    if bytes.is_empty() {
        return Err("the file is empty; export the geometry again".to_owned());
    }
    let facets = match header_count(bytes) {
        Some(count) if binary_length(count) == bytes.len() as u64 => binary(bytes),
        _ if is_likely_ascii(bytes) => ascii(bytes)?,
        Some(count) => return Err(wrong_length(count, bytes.len())),
        None => {
            return Err(
                "the file is neither ASCII STL, which begins with \"solid\", nor long enough \
                        for binary STL; give an STL file"
                    .to_owned(),
            );
        }
    };
    let finite = |facet: &Facet| facet.as_flattened().iter().all(|x| x.is_finite());
    if let Some(index) = facets.iter().position(|facet| !finite(facet)) {
        let vertices = facets[index];
        return Err(format!(
            "facet {index} has a vertex that is not finite ({vertices:?}); repair the geometry"
        ));
    }
    Ok(facets)
}

/// The facet count in a binary header. It may be arbitrarily wrong, so nothing is allocated from
/// it.
fn header_count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(count.try_into().expect("four bytes")))
}

fn binary_length(facets: u32) -> u64 {
    HEADER_BYTES as u64 + FACET_BYTES as u64 * u64::from(facets)
}

fn wrong_length(count: u32, length: usize) -> String {
    format!(
        "as binary STL the file should have {} bytes for the {count} facets of its header, but it \
         has {length}, and it is not ASCII STL either; it is damaged or not STL: export it again",
        binary_length(count)
    )
}

/// The record of a facet is a normal, which is ignored, three vertices, and two bytes of
/// attributes.
fn binary(bytes: &[u8]) -> Vec<Facet> {
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let facet = |record: &[u8]| {
        std::array::from_fn(|vertex| {
            std::array::from_fn(|axis| {
                let start = 12 + 12 * vertex + 4 * axis;
                number(&record[start..start + 4])
            })
        })
    };
    bytes[HEADER_BYTES..].chunks_exact(FACET_BYTES).map(facet).collect()
}

/// Whether a file is probably ASCII STL: its first word is `solid` and no byte is zero. Text contains no zero bytes.
fn is_likely_ascii(bytes: &[u8]) -> bool {
    let mut words = Words::new(bytes);
    words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !bytes.contains(&0)
}

/// The facets of all solids of an ASCII file, or one sentence about the first error.
fn ascii(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    let mut words = Words::new(bytes);
    let mut facets = Vec::new();
    while let Some(word) = words.next() {
        if !word.eq_ignore_ascii_case(b"solid") {
            return Err(words.unexpected("solid", Some(word)));
        }
        words.skip_name(true);
        loop {
            match words.next() {
                Some(word) if word.eq_ignore_ascii_case(b"facet") => {
                    facets.push(facet(&mut words)?);
                }
                Some(word) if word.eq_ignore_ascii_case(b"endsolid") => break,
                other => return Err(words.unexpected("facet or endsolid", other)),
            }
        }
        words.skip_name(false);
        if words.starts_facet() {
            return Err(words.unexpected("the end of the line", words.clone().next()));
        }
    }
    Ok(facets)
}

/// Parses a facet after its first word `facet`, up to and including `endfacet`.
fn facet(words: &mut Words) -> Result<Facet, String> {
    words.expect("normal")?;
    for _ in 0..3 {
        // Normals are not used: exporters write arbitrary words for facets without area.
        words.next().ok_or_else(|| words.unexpected("a normal", None))?;
    }
    words.expect("outer")?;
    words.expect("loop")?;
    let mut vertices = [[0.0; 3]; 3];
    for vertex in &mut vertices {
        words.expect("vertex")?;
        for coordinate in vertex {
            *coordinate = words.number()?;
        }
    }
    words.expect("endloop")?;
    words.expect("endfacet")?;
    Ok(vertices)
}

/// White space in the sense of C, with the vertical tab, which `u8::is_ascii_whitespace` lacks.
fn is_white(byte: &u8) -> bool {
    byte.is_ascii_whitespace() || *byte == 0x0b
}

/// An iterator over the words of a text that counts lines.
#[derive(Clone)]
struct Words<'a> {
    rest: &'a [u8],
    line: usize,
    /// Whether the previous byte was a carriage return, so that a line feed does not start another
    /// line.
    after_return: bool,
}

impl<'a> Words<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        Self { rest, line: 1, after_return: false }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        while self.rest.first().is_some_and(is_white) {
            self.step();
        }
        let length = self.rest.iter().take_while(|byte| !is_white(byte)).count();
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        self.after_return &= word.is_empty();
        (!word.is_empty()).then_some(word)
    }

    /// The next word, if it is on the same line as the previous one.
    fn next_on_line(&mut self) -> Option<&'a [u8]> {
        while self.rest.first().is_some_and(|byte| is_white(byte) && !b"\n\r".contains(byte)) {
            self.step();
        }
        if self.rest.first().is_none_or(is_white) { None } else { self.next() }
    }

    /// Skips a name: the words up to the end of the line, up to a facet, or, if `in_solid`, up to `endsolid`.
    fn skip_name(&mut self, in_solid: bool) {
        loop {
            let mut after = self.clone();
            let Some(word) = after.next_on_line() else { return };
            if (in_solid && word.eq_ignore_ascii_case(b"endsolid")) || self.starts_facet() {
                return;
            }
            *self = after;
        }
    }

    /// Whether the line continues with the first seven words of a facet.
    fn starts_facet(&self) -> bool {
        let mut words = self.clone();
        let start: [Option<&[u8]>; 7] = std::array::from_fn(|_| words.next_on_line());
        let is = |i: usize, wanted: &[u8]| {
            start[i].is_some_and(|word| word.eq_ignore_ascii_case(wanted))
        };
        is(0, b"facet") && is(1, b"normal") && is(5, b"outer") && is(6, b"loop")
    }

    fn step(&mut self) {
        let byte = self.rest[0];
        if byte == b'\r' || (byte == b'\n' && !self.after_return) {
            self.line += 1;
        }
        self.after_return = byte == b'\r';
        self.rest = &self.rest[1..];
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        match self.next() {
            Some(word) if word.eq_ignore_ascii_case(wanted.as_bytes()) => Ok(()),
            other => Err(self.unexpected(wanted, other)),
        }
    }

    fn number(&mut self) -> Result<f32, String> {
        let word = self.next();
        let text = word.and_then(|word| std::str::from_utf8(word).ok());
        let number = text.and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.unexpected("a number", word))
    }

    fn unexpected(&self, wanted: &str, found: Option<&[u8]>) -> String {
        let line = self.line;
        let Some(word) = found else {
            return format!(
                "the file is truncated: it ends in line {line}, where {wanted} was expected; \
                 export it again"
            );
        };
        // A word may be as long as the file; the message must be short.
        let word = String::from_utf8_lossy(&word[..word.len().min(40)]);
        format!(
            "line {line} has {word:?} where {wanted} was expected; \
             correct the line or export the geometry again"
        )
    }
}
