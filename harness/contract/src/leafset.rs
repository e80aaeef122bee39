//! Leaf-set directories: `mesh.json` and the part files it names, read and written.
//!
//! Reading refuses only what cannot be understood (no manifest, a part missing or not an array of
//! words, a part file that the manifest does not name). Whether the contents are true is the
//! checks' affair.

use std::fs;
use std::path::{Path, PathBuf};

use crate::digest::Digest;
use crate::manifest::{self, Manifest, Part, Tally};
use crate::npy::{self, NpyError, PartFile};

/// A mesh in memory.
#[derive(Clone, Debug)]
pub struct LeafSet {
    /// What the directory says about itself.
    pub manifest: Manifest,
    /// Every part's words as they stand in its file.
    pub parts: Vec<Vec<u64>>,
    /// The words of all parts, sorted.
    pub words: Vec<u64>,
}

/// A leaf-set directory, opened: every part's header is good, no leaf has been read.
#[derive(Debug)]
pub struct LeafDir {
    /// What the directory says about itself.
    pub manifest: Manifest,
    /// The part files, in the manifest's order.
    pub parts: Vec<PartFile>,
}

/// Why a directory is not a leaf set.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The manifest or a listing could not be read.
    #[error("{path}: {source}")]
    Io {
        /// What was being read.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The manifest is not what its schema says.
    #[error("{path}: not a leaf-set manifest: {why}")]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// A part is missing or is not an array of leaf words.
    #[error("{path}: the part {source}")]
    Part {
        /// The part file.
        path: PathBuf,
        /// What is wrong.
        source: NpyError,
    },
    /// A part file that the manifest does not name.
    #[error("{0}: a part file that the manifest does not name")]
    PartExtra(PathBuf),
}

/// Reads a leaf-set directory into memory.
pub fn read(dir: &Path) -> Result<LeafSet, ReadError> {
    let LeafDir { manifest, parts } = open(dir)?;
    let read = |p: &PartFile| {
        p.read_all().map_err(|e| ReadError::Part { path: p.path().to_owned(), source: e.into() })
    };
    let parts = parts.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    Ok(LeafSet::new(manifest, parts))
}

/// Opens a leaf-set directory without reading leaves.
pub fn open(dir: &Path) -> Result<LeafDir, ReadError> {
    let manifest = read_manifest(dir)?;
    let mut parts = Vec::new();
    for part in &manifest.parts {
        let path = dir.join(&part.file);
        parts.push(PartFile::open(&path).map_err(|source| ReadError::Part { path, source })?);
    }
    refuse_extra_parts(dir, &manifest)?;
    Ok(LeafDir { manifest, parts })
}

/// Reads the manifest alone.
pub fn read_manifest(dir: &Path) -> Result<Manifest, ReadError> {
    let path = dir.join(manifest::FILE);
    let text =
        fs::read_to_string(&path).map_err(|source| ReadError::Io { path: path.clone(), source })?;
    let manifest: Manifest = serde_json::from_str(&text)
        .map_err(|e| ReadError::Manifest { path: path.clone(), why: e.to_string() })?;
    let wrong = |why| Err(ReadError::Manifest { path, why });
    if manifest.schema != manifest::SCHEMA {
        return wrong(format!("schema {:?}, not {:?}", manifest.schema, manifest::SCHEMA));
    }
    if manifest.octant_digests.len() != manifest::OCTANTS {
        return wrong(format!("{} octant digests, not 512", manifest.octant_digests.len()));
    }
    // A name with a directory in it would let a manifest borrow another mesh's leaves.
    if let Some(part) = manifest.parts.iter().find(|p| Path::new(&p.file).components().count() != 1)
    {
        return wrong(format!("part {:?} is not a plain file name", part.file));
    }
    Ok(manifest)
}

/// Part files lying about unnamed mean that manifest and directory do not belong together.
fn refuse_extra_parts(dir: &Path, manifest: &Manifest) -> Result<(), ReadError> {
    let io = |source| ReadError::Io { path: dir.to_owned(), source };
    for entry in fs::read_dir(dir).map_err(io)? {
        let name = entry.map_err(io)?.file_name();
        let is_part = Path::new(&name).extension().is_some_and(|e| e == "npy");
        if is_part && !manifest.parts.iter().any(|p| *p.file == *name) {
            return Err(ReadError::PartExtra(dir.join(name)));
        }
    }
    Ok(())
}

impl LeafSet {
    /// A mesh of these parts; `words` follows from them.
    pub fn new(manifest: Manifest, parts: Vec<Vec<u64>>) -> Self {
        let mut words = parts.concat();
        words.sort_unstable();
        Self { manifest, parts, words }
    }

    /// The same mesh with other parts, and a manifest made true to them.
    pub fn with_parts(&self, parts: Vec<Vec<u64>>) -> Self {
        let mut set = Self::new(self.manifest.clone(), parts);
        let tally = Tally::of(&set.words);
        let manifest = &mut set.manifest;
        manifest.leaves = tally.leaves;
        manifest.leaves_by_level = tally.by_level;
        manifest.leaves_by_side = tally.by_side;
        manifest.digest = tally.digest;
        manifest.octant_digests = tally.octants;
        let part = |(rank, words): (usize, &Vec<u64>)| Part {
            file: format!("leaves-{rank:05}.npy"),
            leaves: words.len() as u64,
            digest: Digest::of(words),
        };
        manifest.parts = set.parts.iter().enumerate().map(part).collect();
        set
    }

    /// Writes the mesh as it stands, true or not, into an existing directory.
    pub fn write(&self, dir: &Path) -> std::io::Result<()> {
        for (part, words) in self.manifest.parts.iter().zip(&self.parts) {
            npy::write(&dir.join(&part.file), words)?;
        }
        let text = serde_json::to_string(&self.manifest).expect("a manifest is plain data");
        fs::write(dir.join(manifest::FILE), text)
    }
}
