//! The files of a leaf-set directory: the manifest, the tree, and the names of the parts.

use std::fs;
use std::path::Path;

use crate::failure::Unusable;
use crate::files;
use crate::htg::{TreeError, TreeFile};
use crate::manifest::{self, Manifest, Sides};
use crate::npy::PartFile;

/// Maximum number of distinct nodes of a tree in memory. A node needs up to 120 bytes while the tables grow.
pub const NODES_MAX: usize = 32_000_000;

/// Opens a part.
pub(crate) fn open_part(path: &Path) -> Result<PartFile, Unusable> {
    PartFile::open(path).map_err(|why| Unusable::at(path, format!("the part {why}")))
}

/// A part that was opened, but cannot be read.
pub(crate) fn of_part(part: &PartFile, error: std::io::Error) -> Unusable {
    Unusable::at(part.path(), format!("the part {}", Unusable::from(error)))
}

/// A tree that was opened, but cannot be read.
pub fn of_tree(tree: &TreeFile, why: &TreeError) -> Unusable {
    Unusable::at(tree.path(), format!("the tree {why}"))
}

/// Opens the tree of a leaf-set directory without reading leaves; `None` if there is none.
///
/// # Errors
/// If the file is not the tree of a mesh with this root.
pub fn open_tree(dir: &Path, manifest: &Manifest) -> Result<Option<TreeFile>, Unusable> {
    let Some(name) = &manifest.hyper_tree_grid else { return Ok(None) };
    let path = dir.join(name);
    let sides = manifest.sides == Sides::Known;
    let tree = TreeFile::open(&path, sides).and_then(|tree| match tree.root == manifest.root {
        true => Ok(tree),
        false => Err(TreeError::Unknown(format!(
            "its root is {}, but that of the manifest {}",
            tree.root, manifest.root
        ))),
    });
    tree.map(Some).map_err(|why| Unusable::at(&path, format!("the tree {why}")))
}

/// Reads only the manifest.
///
/// # Errors
/// If it cannot be read, or does not follow its schema.
pub fn read_manifest(dir: &Path) -> Result<Manifest, Unusable> {
    if dir.is_file() {
        let why = "is a file: give the directory of a mesh, which has mesh.json (`mesher CASE --out DIR` makes one)";
        return Err(Unusable::because(format!("{} {why}", dir.display())));
    }
    let path = dir.join(manifest::FILE);
    let text = files::read_text(&path).map_err(|error| Unusable::at(&path, error))?;
    let not_one = |why: String| Unusable::at(&path, format!("not a leaf-set manifest: {why}"));
    let wrong = |why| Err(not_one(why));
    let manifest: Manifest =
        serde_json::from_str(&text).map_err(|error| not_one(error.to_string()))?;
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
pub(crate) fn refuse_extra_parts(dir: &Path, manifest: &Manifest) -> Result<(), Unusable> {
    let io = |error| Unusable::at(dir, error);
    for entry in fs::read_dir(dir).map_err(io)? {
        let name = entry.map_err(io)?.file_name();
        let is_part = Path::new(&name).extension().is_some_and(|e| e == "npy");
        if is_part && !manifest.parts.iter().any(|p| *p.file == *name) {
            return Err(Unusable::at(
                &dir.join(name),
                "a part file that the manifest does not name",
            ));
        }
    }
    Ok(())
}
