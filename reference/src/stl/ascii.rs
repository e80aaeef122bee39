//! Parser of ASCII STL: any number of solids, as words separated by any white space.
//!
//! Files in use contain upper and lower case, three kinds of line end, blank lines and solids
//! without a name. Lines matter only after `solid` and `endsolid`, where the rest of the line is a
//! name.
use super::Facet;

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether the first word is `solid` and no byte is zero. Text contains no zero bytes.
pub fn is_likely(bytes: &[u8]) -> bool {
    let mut words = Words::new(bytes);
    words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !bytes.contains(&0)
}

/// The facets of all solids, or one sentence about the first error.
pub fn parse(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    let mut words = Words::new(bytes);
    let mut facets = Vec::new();
    while let Some(word) = words.next() {
        if !word.eq_ignore_ascii_case(b"solid") {
            return Err(words.unexpected("solid", Some(word)));
        }
        words.skip_line();
        loop {
            match words.next() {
                Some(word) if word.eq_ignore_ascii_case(b"facet") => {
                    facets.push(facet(&mut words)?);
                }
                Some(word) if word.eq_ignore_ascii_case(b"endsolid") => break words.skip_line(),
                other => return Err(words.unexpected("facet or endsolid", other)),
            }
        }
    }
    Ok(facets)
}

/// Parses a facet after its first word `facet`, up to and including `endfacet`.
fn facet(words: &mut Words) -> Result<Facet, String> {
    words.expect("normal")?;
    for _ in 0..3 {
        // Normals are not used: exporters write arbitrary words for facets without area.
        words.next();
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

/// An iterator over the words of a text that counts lines.
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
        while self.rest.first().is_some_and(u8::is_ascii_whitespace) {
            self.step();
        }
        let length = self.rest.iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        self.after_return &= word.is_empty();
        (!word.is_empty()).then_some(word)
    }

    /// Skips to the end of the line.
    fn skip_line(&mut self) {
        while self.rest.first().is_some_and(|&byte| byte != b'\n' && byte != b'\r') {
            self.step();
        }
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
