//! The files of a leaf-set directory: the manifest, the tree, and the names of the parts.

use std::fs;
use std::path::{Path, PathBuf};

use crate::files;
use crate::htg::{TreeError, TreeFile};
use crate::manifest::{self, Manifest, Sides};
use crate::npy::{NpyError, PartFile};

/// Maximum number of distinct nodes of a tree in memory. A node needs up to 120 bytes while the tables grow.
pub const NODES_MAX: usize = 32_000_000;

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
    /// A file was given in place of a directory.
    #[error(
        "{0} is a file: give the directory of a mesh, which has mesh.json (`mesher CASE --out DIR` makes one)"
    )]
    NotADirectory(PathBuf),
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
    /// The tree is missing or damaged.
    #[error("{path}: the tree {source}")]
    Tree {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: TreeError,
    },
    /// The words are not those of an oct-tree.
    #[error("{path}: not a linear oct-tree, because {why}: run harness audit on it")]
    NotLinear {
        /// The directory.
        path: PathBuf,
        /// The cause.
        why: String,
    },
    /// The tree does not fit the limit of memory.
    #[error(
        "{0}: more than {NODES_MAX} distinct octants, which is the limit: use a part of the mesh"
    )]
    TooLarge(PathBuf),
    /// A part file that the manifest does not name.
    #[error("{0}: a part file that the manifest does not name")]
    PartExtra(PathBuf),
}

impl ReadError {
    /// A part that was opened, but cannot be read.
    pub fn part(part: &PartFile, error: std::io::Error) -> Self {
        Self::Part { path: part.path().to_owned(), source: error.into() }
    }

    /// A tree that was opened, but cannot be read.
    pub fn tree(tree: &TreeFile, source: TreeError) -> Self {
        Self::Tree { path: tree.path().to_owned(), source }
    }
}

/// Opens the tree of a leaf-set directory without reading leaves; `None` if there is none.
///
/// # Errors
/// If the file is not the tree of a mesh with this root.
pub fn open_tree(dir: &Path, manifest: &Manifest) -> Result<Option<TreeFile>, ReadError> {
    let Some(name) = &manifest.hyper_tree_grid else { return Ok(None) };
    let path = dir.join(name);
    let sides = manifest.sides == Sides::Known;
    let tree = TreeFile::open(&path, sides).and_then(|tree| match tree.root == manifest.root {
        true => Ok(tree),
        false => Err(TreeError::Layout(format!(
            "its root is {:?}, but that of the manifest {:?}",
            tree.root, manifest.root
        ))),
    });
    tree.map(Some).map_err(|source| ReadError::Tree { path, source })
}

/// Reads only the manifest.
///
/// # Errors
/// If it cannot be read, or does not follow its schema.
pub fn read_manifest(dir: &Path) -> Result<Manifest, ReadError> {
    if dir.is_file() {
        return Err(ReadError::NotADirectory(dir.to_owned()));
    }
    let path = dir.join(manifest::FILE);
    let text =
        files::read_text(&path).map_err(|source| ReadError::Io { path: path.clone(), source })?;
    let manifest: Manifest = serde_json::from_str(&text)
        .map_err(|e| ReadError::Manifest { path: path.clone(), why: e.to_string() })?;
    let wrong = |why| Err(ReadError::Manifest { path, why });
    if manifest.schema != manifest::SCHEMA {
        return wrong(format!("its schema is {:?}, not {:?}", manifest.schema, manifest::SCHEMA));
    }
    if let Some(fault) = manifest.fault() {
        return wrong(fault.to_owned());
    }
    // A path instead of a file name could refer to the leaves of another mesh.
    let mut names = manifest.parts.iter().map(|p| &p.file).chain(&manifest.hyper_tree_grid);
    if let Some(name) = names.find(|name| Path::new(name).components().count() != 1) {
        return wrong(format!("{name:?} is not a plain file name"));
    }
    Ok(manifest)
}

/// A part file that the manifest does not name shows that manifest and directory do not belong together.
pub(crate) fn refuse_extra_parts(dir: &Path, manifest: &Manifest) -> Result<(), ReadError> {
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
