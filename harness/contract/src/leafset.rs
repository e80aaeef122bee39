//! Leaf sets in memory, and the writing of leaf-set directories: the manifest `mesh.json` and the part files that it names. [`crate::mesh`] reads
//! directories of any size.

use crate::digest::Digest;
use crate::failure::{Failure, Result, named};
use crate::manifest::{self, Manifest, Part, part_name};
use crate::mesh::{Mesh, part_names};
use crate::npy::{self, PartFile};
use ::files::Claim;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

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

/// Reads a leaf-set directory into memory.
///
/// # Errors
/// If the directory is not a leaf set.
pub fn read(dir: &Path) -> Result<LeafSet> {
    let mesh = Mesh::open(dir)?;
    // A tree is one part.
    let mut parts = vec![Vec::new(); mesh.parts.len() + usize::from(mesh.tree_file.is_some())];
    mesh.stream(&mut |part, run| {
        parts[part].extend(run.iter().flat_map(|block| block.words()));
        true
    })?;
    Ok(LeafSet::new(mesh.manifest, parts))
}

/// Reads the arrays of leaves in a directory without a manifest, in the order of their names.
///
/// # Errors
/// If the directory or an array cannot be read, or if there is none.
pub fn read_parts(dir: &Path) -> Result<Vec<(String, Vec<u64>)>> {
    let names = part_names(dir)?;
    let why = Failure::about(dir, "it has neither mesh.json nor an array of leaves");
    Failure::unless(!names.is_empty(), why)?;
    // The numbers in the names of the mesher show how many there were.
    let last = part_name(names.len() - 1);
    let is_number = |name: &str| {
        name.starts_with("leaves-") && name.as_bytes()[7..12].iter().all(u8::is_ascii_digit)
    };
    let is_beyond = |name: &String| name.len() == last.len() && *name > last && is_number(name);
    let why = format!("a part is missing: the last of {} is {last}", names.len());
    Failure::unless(!names.iter().any(is_beyond), Failure::about(dir, why))?;
    let read = |name: String| {
        let path = dir.join(&name);
        Ok((name, PartFile::open(&path).map_err(|why| why.of_file(&path))?.read_all()?))
    };
    names.into_iter().map(read).collect()
}

/// Writes a mesh as [`LeafSet::create`] does; `fill` writes the file of the part with an index.
pub(crate) fn create(
    dir: &Path,
    manifest: &Manifest,
    fill: impl Fn(usize, &mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let parents = dir.parent().map_or(Ok(()), fs::create_dir_all);
    let write = || {
        let names = manifest.parts.iter().map(|part| part.file.clone()).collect();
        let claim = Claim::create(dir, manifest::FILE, names)?;
        for (i, part) in manifest.parts.iter().enumerate() {
            let mut out = BufWriter::new(claim.draft(&part.file)?);
            fill(i, &mut out)?;
            out.into_inner()?.publish()?;
        }
        claim.commit(|out| out.write_all(manifest.text().as_bytes()))?;
        claim.keep();
        Ok(())
    };
    parents.and_then(|()| write()).map_err(|error| named(dir, &error))
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
        set.manifest.set_leaves(&set.words);
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
    pub fn create(&self, dir: &Path) -> io::Result<()> {
        create(dir, &self.manifest, |part, out| out.write_all(&npy::bytes(&self.parts[part])))
    }

    /// Writes the mesh into an existing directory, whether or not its manifest is correct.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, dir: &Path) -> io::Result<()> {
        for (part, words) in self.manifest.parts.iter().zip(&self.parts) {
            npy::write(&dir.join(&part.file), words)?;
        }
        self.manifest.write(dir)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TREE;
    use crate::testing::{leaf_set, words_of};

    #[test]
    fn arrays_without_a_manifest_are_read_in_the_order_of_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let why = read_parts(dir.path()).unwrap_err().to_string();
        assert!(why.ends_with("it has neither mesh.json nor an array of leaves"), "{why}");
        npy::write(&dir.path().join("b.npy"), &[7]).unwrap();
        npy::write(&dir.path().join("a.npy"), &[8, 9]).unwrap();
        fs::write(dir.path().join("c.txt"), "").unwrap();
        let parts = [("a.npy".to_owned(), vec![8, 9]), ("b.npy".to_owned(), vec![7])];
        assert_eq!(read_parts(dir.path()).unwrap(), parts);
        fs::write(dir.path().join("d.npy"), "").unwrap();
        let why = read_parts(dir.path()).unwrap_err().to_string();
        assert!(why.contains("d.npy: the part has no npy header"), "{why}");
    }

    #[test]
    fn a_missing_part_is_known_by_the_numbers_of_the_others() {
        let dir = tempfile::tempdir().unwrap();
        for (index, is_whole) in [(0, true), (2, false), (1, true)] {
            npy::write(&dir.path().join(part_name(index)), &[7]).unwrap();
            assert_eq!(read_parts(dir.path()).is_ok(), is_whole, "{index}");
        }
        for name in ["leaves-outer.npy", "surface00009.npy"] {
            npy::write(&dir.path().join(name), &[7]).unwrap();
        }
        assert_eq!(read_parts(dir.path()).unwrap().len(), 5);
        fs::remove_file(dir.path().join("surface00009.npy")).unwrap();
        fs::remove_file(dir.path().join(part_name(0))).unwrap();
        fs::remove_file(dir.path().join("leaves-outer.npy")).unwrap();
        let why = read_parts(dir.path()).unwrap_err().to_string();
        assert!(why.ends_with("a part is missing: the last of 2 is leaves-00001.npy"), "{why}");
    }

    #[test]
    fn a_directory_that_is_no_leaf_set_is_explained() {
        let set = leaf_set(vec![words_of(|o| o.level < 1), vec![]]);
        let dir = tempfile::tempdir().unwrap();
        set.write(dir.path()).unwrap();
        let found = read(dir.path()).unwrap();
        assert_eq!(
            (&found.manifest, &found.parts, &found.words),
            (&set.manifest, &set.parts, &set.words)
        );
        let why = |change: &dyn Fn(&mut Manifest)| {
            let mut manifest = set.manifest.clone();
            change(&mut manifest);
            manifest.write(dir.path()).unwrap();
            Mesh::open(dir.path()).unwrap_err().to_string()
        };
        assert!(why(&|m| m.schema = "other".to_owned()).contains("its schema is \"other\", not"));
        assert!(
            why(&|m| m.layer_cells_min = 0)
                .ends_with("layer_cells_min: a layer has at least one cell")
        );
        for name in ["../leaves-00000.npy", "/tmp/leaves.npy"] {
            let found = why(&|m| m.parts[0].file = name.to_owned());
            assert!(found.ends_with(&format!("{name:?} is not a plain file name")), "{found}");
        }
        assert!(
            why(&|m| m.hyper_tree_grid = Some("a/b".to_owned()))
                .ends_with("is not a plain file name")
        );
        assert!(
            why(&|m| drop(m.parts.pop()))
                .ends_with("a file of leaves that the manifest does not name")
        );
        fs::write(dir.path().join(TREE), "").unwrap();
        for has_tree in [false, true] {
            let found = why(&|m| {
                if has_tree {
                    (m.parts, m.hyper_tree_grid) = (Vec::new(), Some(TREE.to_owned()));
                }
            });
            assert!(found.ends_with("a file of leaves that the manifest does not name"), "{found}");
        }
        fs::remove_file(dir.path().join(TREE)).unwrap();
        assert!(
            why(&|m| m.parts[1].file = "absent.npy".to_owned())
                .contains("absent.npy: the part cannot be read")
        );
        fs::write(dir.path().join("mesh.json"), "{}").unwrap();
        let why = |path: &Path| Manifest::read(path).unwrap_err().to_string();
        assert!(why(dir.path()).contains("mesh.json: not a leaf-set manifest: missing field"));
        let file = dir.path().join("mesh.json");
        assert!(why(&file).contains("mesh.json is a file: give the directory of a mesh"));
        fs::remove_file(file).unwrap();
        assert!(why(dir.path()).contains("mesh.json: No such file"));
    }

    #[test]
    fn a_mesh_is_created_complete_in_a_new_or_empty_directory_only() {
        let set = leaf_set(vec![words_of(|o| o.level < 1), vec![]]);
        let place = tempfile::tempdir().unwrap();
        let dir = place.path().join("new/mesh");
        set.create(&dir).unwrap();
        assert_eq!(read(&dir).unwrap().words, set.words);
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 3);
        let why = set.create(&dir).unwrap_err().to_string();
        assert!(why.starts_with(&format!("{}: ", dir.display())), "{why}");
        assert_eq!(read(&dir).unwrap().words, set.words);
    }
}
