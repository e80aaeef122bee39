//! ASCII STL (reference/DEFINITION.md, section 10).
//!
//! The parser walks over the bytes once. Words are compared without case, and lines matter only for names.

use geometries::Facet;

/// The first bytes of some text files, in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether the first word of a text with this beginning may be `solid`, which the end of `head` may cut short.
pub(super) fn may_begin_with_solid(head: &[u8]) -> bool {
    let mut text = Text::new(head);
    let word = text.word().to_ascii_lowercase();
    word == b"solid" || text.at == text.bytes.len() && b"solid".starts_with(&word)
}

/// The facets of all solids.
///
/// # Errors
/// The first word that the grammar does not allow, with the index of the facet and the solid: the predicate of a sentence about
/// the file.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    if bytes.contains(&0) {
        return Err("contains a zero byte, which no text does".to_owned());
    }
    let mut text = Text::new(bytes);
    let (mut facets, mut solids) = (Vec::new(), 0);
    while solids == 0 || !text.is_at_end() {
        solids += 1;
        let solid = text.solid(&mut facets);
        solid.map_err(|why| {
            format!("is malformed at facet {}, in solid {solids} ({why})", facets.len())
        })?;
    }
    Ok(facets)
}

/// A position in the text.
struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
}

fn is_white(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

fn ends_line(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

impl<'a> Text<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes: bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes), at: 0 }
    }

    /// The next word, which is empty at the end of the text.
    fn word(&mut self) -> &'a [u8] {
        self.skip_while(is_white);
        let start = self.at;
        self.skip_while(|byte| !is_white(byte));
        &self.bytes[start..self.at]
    }

    fn skip_while(&mut self, skips: impl Fn(u8) -> bool) {
        while self.bytes.get(self.at).is_some_and(|&byte| skips(byte)) {
            self.at += 1;
        }
    }

    fn is_at_end(&mut self) -> bool {
        self.skip_while(is_white);
        self.at == self.bytes.len()
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        let word = self.word();
        match word.eq_ignore_ascii_case(wanted.as_bytes()) {
            true => Ok(()),
            false => Err(unexpected(word, wanted)),
        }
    }

    fn solid(&mut self, facets: &mut Vec<Facet>) -> Result<(), String> {
        self.expect("solid")?;
        self.skip_name(|words| words[0].eq_ignore_ascii_case(b"endsolid") || starts_facet(words));
        loop {
            let word = self.word();
            if word.eq_ignore_ascii_case(b"facet") {
                facets.push(self.facet()?);
            } else if word.eq_ignore_ascii_case(b"endsolid") {
                break;
            } else {
                return Err(unexpected(word, "facet or endsolid"));
            }
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
        for _ in 0..3 {
            self.word();
        }
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
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| ends_line(byte)).unwrap_or(rest.len());
        let mut line = Text { bytes: &self.bytes[..self.at + length], at: self.at };
        while !line.is_at_end() {
            let mut ahead = Text { ..line };
            if ends(&std::array::from_fn(|_| ahead.word())) {
                self.at = line.at;
                return true;
            }
            line.word();
        }
        self.at = line.at;
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
    match word.is_empty() {
        true => format!("it ends where {wanted} was expected"),
        false => format!("it has {shown:?} where {wanted} was expected"),
    }
}

#[cfg(test)]
mod tests {
    use super::may_begin_with_solid;

    #[test]
    fn only_a_whole_word_or_the_beginning_of_one_that_is_cut_short_is_solid() {
        for head in ["solid", "\u{feff} \n SoLiD name", "solid\tname", "", "  s", "SOLI"] {
            assert!(may_begin_with_solid(head.as_bytes()), "{head:?}");
        }
        for head in ["solids", "solid_body x", "sol id", "facet", "a solid", "soli\n"] {
            assert!(!may_begin_with_solid(head.as_bytes()), "{head:?}");
        }
    }
}
