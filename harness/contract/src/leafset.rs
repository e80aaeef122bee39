//! Leaf-set directories: the manifest `mesh.json` and the part files that it names.
//!
//! Reading fails only if the directory cannot be interpreted: no manifest, a part that is missing or is not an
//! array of words, or a part file that the manifest does not name. The checks establish whether the contents
//! are correct.

use std::fs;
use std::path::{Path, PathBuf};

use crate::digest::Digest;
use crate::files::named;
use crate::manifest::{self, Manifest, Part, Tally};
use crate::npy::{self, NpyError, PartFile};
use ::files::Claim;

/// A mesh in memory.
#[derive(Clone, Debug)]
pub struct LeafSet {
    /// The manifest.
    pub manifest: Manifest,
    /// The words of each part, in the order of its file.
    pub parts: Vec<Vec<u64>>,
    /// The words of all parts, sorted.
    pub words: Vec<u64>,
}

/// A leaf-set directory whose manifest and part headers were read and are valid. No leaf has been read.
#[derive(Debug)]
pub struct LeafDir {
    /// The manifest.
    pub manifest: Manifest,
    /// The part files, in the manifest's order.
    pub parts: Vec<PartFile>,
}

/// Why a directory is not a leaf set.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The manifest or the directory cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The manifest does not follow its schema.
    #[error("{path}: not a leaf-set manifest: {why}")]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The cause.
        why: String,
    },
    /// A part is missing, or is not an array of leaf words.
    #[error("{path}: the part {source}")]
    Part {
        /// The part file.
        path: PathBuf,
        /// The cause.
        source: NpyError,
    },
    /// A part file that the manifest does not name.
    #[error("{0}: a part file that the manifest does not name")]
    PartExtra(PathBuf),
}

/// Reads a leaf-set directory into memory.
///
/// # Errors
/// If the directory is not a leaf set.
pub fn read(dir: &Path) -> Result<LeafSet, ReadError> {
    let LeafDir { manifest, parts } = open(dir)?;
    let read = |part: &PartFile| part.read_all().map_err(|e| ReadError::part(part, e));
    let parts = parts.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    Ok(LeafSet::new(manifest, parts))
}

/// Reads the arrays of leaves in a directory without a manifest, in the order of their names.
///
/// # Errors
/// If the directory or an array cannot be read, or if there is none.
pub fn read_parts(dir: &Path) -> Result<Vec<(String, Vec<u64>)>, ReadError> {
    let io = |source| ReadError::Io { path: dir.to_owned(), source };
    let mut names = Vec::new();
    for entry in fs::read_dir(dir).map_err(io)? {
        let name = entry.map_err(io)?.file_name().to_string_lossy().into_owned();
        names.extend(Path::new(&name).extension().is_some_and(|e| e == "npy").then_some(name));
    }
    if names.is_empty() {
        return Err(io(std::io::Error::other("it has neither mesh.json nor an array of leaves")));
    }
    names.sort_unstable();
    let read = |name: String| {
        let path = dir.join(&name);
        let part = PartFile::open(&path).map_err(|source| ReadError::Part { path, source })?;
        part.read_all().map(|words| (name, words)).map_err(|error| ReadError::part(&part, error))
    };
    names.into_iter().map(read).collect()
}

impl ReadError {
    /// A part that was opened, but cannot be read.
    pub fn part(part: &PartFile, error: std::io::Error) -> Self {
        Self::Part { path: part.path().to_owned(), source: error.into() }
    }
}

/// Opens a leaf-set directory without reading leaves.
///
/// # Errors
/// If the directory is not a leaf set.
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

/// Reads only the manifest.
///
/// # Errors
/// If it cannot be read, or does not follow its schema.
pub fn read_manifest(dir: &Path) -> Result<Manifest, ReadError> {
    let path = dir.join(manifest::FILE);
    let text =
        fs::read_to_string(&path).map_err(|source| ReadError::Io { path: path.clone(), source })?;
    let manifest: Manifest = serde_json::from_str(&text)
        .map_err(|e| ReadError::Manifest { path: path.clone(), why: e.to_string() })?;
    let wrong = |why| Err(ReadError::Manifest { path, why });
    if manifest.schema != manifest::SCHEMA {
        return wrong(format!("its schema is {:?}, not {:?}", manifest.schema, manifest::SCHEMA));
    }
    if manifest.octant_digests.len() != manifest::OCTANTS {
        return wrong(format!("it has {} octant digests, not 512", manifest.octant_digests.len()));
    }
    // A path instead of a file name could refer to the leaves of another mesh.
    if let Some(part) = manifest.parts.iter().find(|p| Path::new(&p.file).components().count() != 1)
    {
        return wrong(format!("part {:?} is not a plain file name", part.file));
    }
    Ok(manifest)
}

/// A part file that the manifest does not name shows that manifest and directory do not belong together.
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
    /// A mesh of these parts.
    pub fn new(manifest: Manifest, parts: Vec<Vec<u64>>) -> Self {
        let mut words = parts.concat();
        words.sort_unstable();
        Self { manifest, parts, words }
    }

    /// The mesh with other parts, and with the counts and digests of its manifest updated to match.
    pub fn with_parts(&self, parts: Vec<Vec<u64>>) -> Self {
        let mut set = Self::new(self.manifest.clone(), parts);
        set.manifest.set_tally(Tally::of(&set.words));
        let part = |(rank, words): (usize, &Vec<u64>)| Part {
            file: manifest::part_name(rank),
            leaves: words.len() as u64,
            digest: Digest::of(words),
        };
        set.manifest.parts = set.parts.iter().enumerate().map(part).collect();
        set
    }

    /// Writes the mesh as a new directory, or into one that is empty. No partial file ever has its final name, and the
    /// manifest is written last.
    ///
    /// # Errors
    /// If the directory is not empty or a file cannot be written; the message names it.
    pub fn create(&self, dir: &Path) -> std::io::Result<()> {
        let parents = dir.parent().map_or(Ok(()), fs::create_dir_all);
        let write = || {
            let parts = self.manifest.parts.iter().zip(&self.parts);
            let names = parts.clone().map(|(part, _)| part.file.clone());
            let claim = Claim::create(dir, manifest::FILE, names).map_err(std::io::Error::from)?;
            for (part, words) in parts {
                let mut out = std::io::BufWriter::new(claim.draft(&part.file)?);
                npy::write_to(&mut out, words)?;
                out.into_inner()?.publish()?;
            }
            claim.commit(|out| out.write_all(self.manifest.text().as_bytes()))?;
            claim.keep();
            Ok(())
        };
        parents.and_then(|()| write()).map_err(|error| named(dir, &error))
    }

    /// Writes the mesh into an existing directory, whether or not its manifest is correct.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, dir: &Path) -> std::io::Result<()> {
        for (part, words) in self.manifest.parts.iter().zip(&self.parts) {
            npy::write(&dir.join(&part.file), words)?;
        }
        self.manifest.write(dir)
    }
}
