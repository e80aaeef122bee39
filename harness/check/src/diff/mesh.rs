//! A mesh to compare: the parts of its directory or, if there are none, its tree.

use std::path::Path;

use contract::htg::{Cursor, TreeFile};
use contract::leafset::{self, LeafDir, Leaves, ReadError};
use contract::manifest::{Manifest, octant_index};
use contract::npy::PartFile;

/// A mesh whose leaves stay on disk.
pub(super) struct Mesh {
    pub manifest: Manifest,
    leaves: Source,
}

enum Source {
    Parts(Vec<PartFile>),
    Tree(Box<TreeFile>),
}

/// Number of words of a part that are read at once.
const CHUNK: u64 = 1 << 16;

/// Each octant of level 3 has a range of 2^55 words.
const OCTANT_WORDS: u64 = 1 << 55;

impl Mesh {
    pub fn open(dir: &Path) -> Result<Self, ReadError> {
        Ok(match leafset::open_any(dir)? {
            Leaves::Words(words) => {
                let LeafDir { manifest, parts } = *words;
                Self { manifest, leaves: Source::Parts(parts) }
            }
            Leaves::Tree(tree, manifest) => {
                Self { manifest: *manifest, leaves: Source::Tree(tree) }
            }
        })
    }

    /// Passes the words of all leaves to `visit`, some thousands at a time, in the order of the files.
    pub fn visit(&self, mut visit: impl FnMut(&[u64])) -> Result<(), ReadError> {
        let parts = match &self.leaves {
            Source::Parts(parts) => parts,
            Source::Tree(tree) => {
                let mut run = |words: &[u64]| {
                    visit(words);
                    true
                };
                return tree.words(&mut run).map_err(|error| ReadError::tree(tree, error));
            }
        };
        let mut words = Vec::new();
        for part in parts {
            for first in (0..part.len()).step_by(CHUNK as usize) {
                words.resize(CHUNK.min(part.len() - first) as usize, 0);
                part.read_at(first, &mut words).map_err(|error| ReadError::part(part, error))?;
                visit(&words);
            }
        }
        Ok(())
    }

    /// All words, sorted.
    pub fn words(&self) -> Result<Vec<u64>, ReadError> {
        let mut all = Vec::new();
        self.visit(|words| all.extend_from_slice(words))?;
        all.sort_unstable();
        Ok(all)
    }

    /// All words of a level-3 octant, sorted.
    pub fn octant(&self, index: usize) -> Result<Vec<u64>, ReadError> {
        let mut words = Vec::new();
        match &self.leaves {
            Source::Parts(parts) => {
                for part in parts {
                    let of_part = octant_of(part, index);
                    words.extend(of_part.map_err(|error| ReadError::part(part, error))?);
                }
            }
            Source::Tree(tree) => {
                let read = tree.index().and_then(|counts| {
                    let key = (index as u64) << 48;
                    Cursor::new(tree, &counts).words(key, 3, &mut words)
                });
                read.map_err(|error| ReadError::tree(tree, error))?;
            }
        }
        debug_assert!(words.iter().all(|&w| octant_index(w) == index));
        words.sort_unstable();
        Ok(words)
    }
}

/// The words of a level-3 octant in one part.
fn octant_of(part: &PartFile, index: usize) -> std::io::Result<Vec<u64>> {
    let from = part.lower_bound(0..part.len(), index as u64 * OCTANT_WORDS)?;
    // One past the last octant does not fit a word.
    let end = (index as u64 + 1).checked_mul(OCTANT_WORDS);
    let until = end.map_or(Ok(part.len()), |end| part.lower_bound(0..part.len(), end))?;
    let count = usize::try_from(until - from).expect("an octant fits the address space");
    let mut words = vec![0; count];
    part.read_at(from, &mut words)?;
    Ok(words)
}
