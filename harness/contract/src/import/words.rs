//! Bare leaf words: one array, or the parts of a directory without a manifest.

use super::cells::Cells;
use super::{Request, refuse_leaf_set};
use crate::failure::{Failure, Result};
use crate::lattice::Root;
use crate::leafset::read_parts;
use crate::npy::PartFile;
use crate::word::{self, Side};
use std::path::Path;

/// The name under which the sides in the words can be requested. Without the request they are ignored, because a program
/// that does not know the sides writes some code too.
pub const SIDES: &str = "side";

/// Reads leaf words.
///
/// # Errors
/// If a part cannot be read, or a word is not a leaf.
pub fn read(path: &Path, request: &Request) -> Result<Cells> {
    let name = request.sides.as_deref().unwrap_or(SIDES);
    let why = format!("leaf words have no array {name}: request their sides with --sides {SIDES}");
    Failure::unless(name == SIDES, why)?;
    refuse_leaf_set(path)?;
    let parts = match path.is_dir() {
        true => read_parts(path)?,
        false => vec![(String::new(), PartFile::open(path)?.read_all()?)],
    };
    let (has_sides, root) = (request.sides.is_some(), request.root.unwrap_or(Root::UNIT));
    let mut cells = Cells { root: Some(root), sides: has_sides.then(Vec::new), ..Cells::default() };
    for (part, words) in parts {
        let part = if part.is_empty() { part } else { part + ": " };
        for word in words {
            let cell = cells.count();
            // Side bits must be valid only if they are used.
            word::check(if has_sides { word } else { word & !3 }).map_err(|why| {
                format!("{part}cell {cell} is the word {word:#018x}, in which {why}")
            })?;
            let octant = word::octant(word);
            cells.push(root.to_user(octant.bounds().0), root.edge_of(octant.level));
            cells.sides.iter_mut().for_each(|sides| sides.push(Side::ALL[(word & 3) as usize]));
        }
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::words_with_sides;
    use crate::{manifest, npy};
    use std::fs;

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
        let why = read(place.path(), &request(true)).unwrap_err().to_string();
        assert!(why.starts_with("has a manifest"), "{why}");
    }

    #[test]
    fn a_word_that_is_no_leaf_is_named() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("words.npy");
        let refused = |bad: u64, sides| {
            let mut words = words();
            words[7] = bad;
            npy::write(&path, &words).unwrap();
            read(&path, &request(sides))
                .map(|cells| cells.count())
                .map_err(|error| error.to_string())
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
