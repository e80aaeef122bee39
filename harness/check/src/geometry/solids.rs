//! The solids of an STL file: their names, their first facets and their sizes.

use std::io;
use std::path::Path;

use serde::Serialize;

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

/// The solids of a valid STL file that has this number of facets.
///
/// # Errors
/// The file cannot be read.
pub fn read(path: &Path, facets: usize) -> io::Result<Vec<Solid>> {
    let bytes = std::fs::read(path)?;
    let binary = Solid { name: None, facet_first: 0, facets };
    let is_binary = bytes.get(80..84) == Some(&(facets as u32).to_le_bytes()[..])
        && bytes.len() == 84 + 50 * facets;
    Ok(if is_binary { vec![binary] } else { ascii(&String::from_utf8_lossy(&bytes)) })
}

/// The solids of valid ASCII text. A name is the rest of the line after `solid`.
fn ascii(text: &str) -> Vec<Solid> {
    let mut solids: Vec<Solid> = Vec::new();
    for line in text.split(['\n', '\r']).map(str::trim) {
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if word.eq_ignore_ascii_case("solid") {
            let facet_first = solids.last().map_or(0, |s| s.facet_first + s.facets);
            let name = Some(rest.trim().to_owned());
            solids.push(Solid { name, facet_first, facets: 0 });
        } else if !word.eq_ignore_ascii_case("endsolid")
            && let Some(solid) = solids.last_mut()
        {
            let ends = |w: &&str| w.eq_ignore_ascii_case("endfacet");
            solid.facets += line.split_whitespace().filter(ends).count();
        }
    }
    solids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_solid_has_its_name_and_first_facet() {
        let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
        let one_line = facet.replace('\n', " ");
        let text = format!(
            "solid endfacet of a wing\n{facet}{facet}endsolid endfacet of a wing\r\nSOLID\n{one_line}\nendsolid\n"
        );
        let wing = Solid { name: Some("endfacet of a wing".into()), facet_first: 0, facets: 2 };
        let unnamed = Solid { name: Some(String::new()), facet_first: 2, facets: 1 };
        assert_eq!(ascii(&text), [wing, unnamed]);
    }
}
