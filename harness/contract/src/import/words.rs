//! Bare leaf words: one array, or the parts of a directory without a manifest.

use super::cells::Cells;
use super::{ImportError, Request};
use crate::lattice::Root;
use crate::manifest;
use crate::npy::PartFile;
use crate::octant::Octant;
use crate::word::{self, Side, WordError};
use std::fs;
use std::path::{Path, PathBuf};

/// The name under which the sides in the words can be requested. Without the request they are ignored, because a program
/// that does not know the sides writes some code too.
pub const SIDES: &str = "side";

/// The root in which words are placed if none is given.
const UNIT: Root = Root { origin: [0.0; 3], edge: 1.0 };

/// Reads leaf words.
///
/// # Errors
/// If a part cannot be read, or a word is not a leaf.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    let with_sides = match request.sides.as_deref() {
        None => false,
        Some(SIDES) => true,
        Some(name) => {
            return Err(ImportError::content(format!(
                "leaf words have no array {name}: request their sides with --sides {SIDES}"
            )));
        }
    };
    let root = request.root.unwrap_or(UNIT);
    let mut cells =
        Cells { root: Some(root), sides: with_sides.then(Vec::new), ..Cells::default() };
    for part in parts(path)? {
        let of_part = |why: String| ImportError::content(why).of_file(&part);
        let file = PartFile::open(&part).map_err(|error| of_part(format!("the part {error}")))?;
        let words = file.read_all()?;
        let is_leaf = |word: u64| octant(word, with_sides).is_ok();
        let swapped = !words.iter().all(|&word| is_leaf(word))
            && words.iter().all(|&word| is_leaf(word.swap_bytes()));
        if swapped {
            let why = "the bytes of its words are swapped: a big-endian machine wrote them";
            return Err(of_part(why.to_owned()));
        }
        for word in words {
            let cell = cells.len();
            let octant = octant(word, with_sides).map_err(|why| {
                of_part(format!("cell {cell} is the word {word:#018x}, in which {why}"))
            })?;
            cells
                .push(root.to_user(octant.bounds().0), root.edge / f64::from(1u32 << octant.level));
            cells.sides.iter_mut().for_each(|sides| sides.push(Side::ALL[(word & 3) as usize]));
        }
    }
    Ok(cells)
}

/// The octant of a word, whose side bits must be valid only if they are used.
fn octant(word: u64, with_sides: bool) -> Result<Octant, WordError> {
    match word::fault(if with_sides { word } else { word & !3 }) {
        Some(why) => Err(why),
        None => Ok(word::octant(word)),
    }
}

/// The part files, in the order of their names.
fn parts(path: &Path) -> Result<Vec<PathBuf>, ImportError> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    if path.join(manifest::FILE).exists() {
        return Err(ImportError::content(format!(
            "has a manifest ({}), so it is a leaf set already: use it as it is",
            manifest::FILE
        )));
    }
    let mut parts = Vec::new();
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        if name.to_str().is_some_and(|name| name.starts_with("leaves-") && name.ends_with(".npy")) {
            parts.push(path.join(name));
        }
    }
    parts.sort();
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npy;
    use crate::testing::words_with_sides;

    fn words() -> Vec<u64> {
        words_with_sides(|o| o.level < 2, |o| Some(Side::ALL[o.digit() as usize % 3]))
    }

    fn request(sides: bool) -> Request {
        let root = Some(Root { origin: [1.0, 2.0, 3.0], edge: 0.1 });
        Request { sides: sides.then(|| SIDES.to_owned()), root, ..Request::default() }
    }

    #[test]
    fn parts_without_a_manifest_are_one_mesh() {
        let (place, words) = (tempfile::tempdir().unwrap(), words());
        for (i, part) in [&words[..10], &words[40..], &words[10..40], &[]].into_iter().enumerate() {
            npy::write(&place.path().join(manifest::part_name(i)), part).unwrap();
        }
        for sides in [true, false] {
            let cells = read(place.path(), &request(sides)).unwrap();
            let side_bits = if sides { 3 } else { 0 };
            let expected: Vec<u64> = words.iter().map(|w| w & (!3 | side_bits)).collect();
            assert_eq!(cells.words(&request(sides).root.unwrap()).unwrap(), expected);
        }
        fs::write(place.path().join(manifest::FILE), "{}").unwrap();
        assert!(
            read(place.path(), &request(true))
                .unwrap_err()
                .to_string()
                .contains("a leaf set already")
        );
    }

    #[test]
    fn a_word_that_is_no_leaf_is_named() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("words.npy");
        let refused = |bad: u64, sides| {
            let mut words = words();
            words[7] = bad;
            npy::write(&path, &words).unwrap();
            read(&path, &request(sides)).map(|cells| cells.len()).map_err(|error| error.to_string())
        };
        assert!(
            refused(1 << 7, true).unwrap_err().contains("cell 7 is the word 0x0000000000000080")
        );
        assert!(refused(20 << 2, false).unwrap_err().contains("level 20"));
        assert!(refused(words()[7] | 3, true).unwrap_err().contains("side 3"));
        assert_eq!(refused(words()[7] | 3, false), Ok(64));
        let other = Request { sides: Some("body".into()), ..Request::default() };
        assert!(read(&path, &other).unwrap_err().to_string().contains("--sides side"));
    }
}
