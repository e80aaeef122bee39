//! Hyper-tree grids as this repository writes them, of any size: leaves are never in memory all at once. VTK reads other
//! hyper-tree grids.

use super::leaf_set;
use crate::case::Case;
use crate::digest::Digest;
use crate::failure::Failure;
use crate::htg::{SIDE, TreeError, TreeFile};
use crate::lattice::Root;
use crate::leafset;
use crate::manifest::{self, Manifest, Part};
use crate::npy;
use std::fs;
use std::io;
use std::os::unix::fs::symlink;
use std::path::Path;

/// Name of the tree in a directory.
const TREE: &str = "mesh.vtkhdf";

/// A tree, and the manifest of its leaves.
pub struct ImportedTree {
    tree: TreeFile,
    /// The manifest, without parts.
    pub manifest: Manifest,
}

impl ImportedTree {
    /// Opens a file and counts its leaves; `None` if VTK has to read it, or if its root is not the one that is given. Sides are
    /// the cell data that `sides` names, otherwise `side` if it has that. The manifest is that of [`leaf_set`](super::leaf_set()).
    ///
    /// # Errors
    /// If the file is damaged or has no such cell data.
    pub fn open(
        path: &Path,
        sides: Option<&str>,
        root: Option<Root>,
        case: Option<&Case>,
        program: String,
    ) -> Result<Option<Self>, Failure> {
        // Another array is VTK's to find.
        if sides.is_some_and(|sides| sides != SIDE) {
            return Ok(None);
        }
        let tree = match TreeFile::open(path) {
            Ok(tree) if root.is_none_or(|root| root == tree.root) => tree,
            Ok(_) | Err(TreeError::Unknown(_)) => return Ok(None),
            Err(error) => return Err(Failure::input(error)),
        };
        let mut manifest = leaf_set::manifest(tree.root, case, program);
        tree.words(&mut |run| {
            run.iter().for_each(|&word| manifest.add(word));
            true
        })
        .map_err(Failure::input)?;
        manifest.finish();
        assert_eq!(manifest.leaves, tree.leaves, "leaves of the walk, and of the bits of nodes");
        Ok(Some(Self { tree, manifest }))
    }

    /// Writes the leaf words as a new directory, or into one that is empty, in one part.
    ///
    /// # Errors
    /// If the directory is not empty or a file cannot be written; the message names it.
    pub fn create(&self, dir: &Path) -> io::Result<()> {
        let Manifest { leaves, digest, .. } = self.manifest;
        let parts = vec![Part { file: manifest::part_name(0), leaves, digest }];
        leafset::create(dir, &Manifest { parts, ..self.manifest.clone() }, |_, out| {
            out.write_all(&npy::header("<u8", &format!("({leaves},)")))?;
            let (mut found, mut written) = (Digest::default(), Ok(()));
            let read = self.tree.words(&mut |run| {
                run.iter().for_each(|&word| found.add(word));
                written = out.write_all(bytemuck::cast_slice(run));
                written.is_ok()
            });
            written?;
            match read {
                Ok(()) if found == digest => Ok(()),
                Ok(()) => Err(io::Error::other("the file changed while it was read")),
                Err(error) => Err(io::Error::other(error)),
            }
        })
    }

    /// Makes an empty directory a leaf set that has the tree alone, by a link to its file.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn link(&self, dir: &Path) -> io::Result<()> {
        symlink(fs::canonicalize(&self.tree.path)?, dir.join(TREE))?;
        Manifest { hyper_tree_grid: Some(TREE.to_owned()), ..self.manifest.clone() }.write(dir)
    }
}
