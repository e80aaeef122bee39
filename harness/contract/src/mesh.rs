//! Meshes on disk, of any size: the part files of a leaf-set directory or, if it has none, its tree.
//!
//! [`Mesh::stream`] passes on all words as they are, for the checks. [`Mesh::visit`], [`Mesh::leaves`] and [`Mesh::tree`] refuse words that are
//! not a linear oct-tree, for all who rely on one.
//!
//! Opening fails only if the directory cannot be interpreted: no manifest, a part that is missing or is not an array of words, or words or a
//! tree that the manifest does not name. The checks establish whether the contents are correct.

use crate::case::Case;
use crate::digest::Digest;
use crate::failure::{Failure, Result, uninterrupted};
use crate::htg::{Block, TreeError, TreeFile};
use crate::manifest::{Geometry, Manifest, Part, Sides};
use crate::npy::PartFile;
use crate::octant::Octant;
use crate::tree::{Builder, Tree};
use crate::word::{self, Order, Side};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs;
use std::path::{Path, PathBuf};

/// Maximum number of distinct nodes of a tree in memory. A node needs about 50 bytes, and 20 more in the check of layers: pages of tables that are larger than their contents are not
/// in memory.
pub const NODES_MAX: usize = 128_000_000;

/// Name of the tree in a directory.
pub(crate) const TREE: &str = "mesh.vtkhdf";

/// A leaf-set directory whose manifest and files were opened. No leaf has been read.
#[derive(Debug)]
pub struct Mesh {
    dir: PathBuf,
    /// The manifest.
    pub manifest: Manifest,
    /// The files of words, in the manifest's order.
    pub parts: Vec<PartFile>,
    /// The tree, if there are no files of words.
    pub tree_file: Option<TreeFile>,
}

/// A leaf of a mesh on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Its octant.
    pub octant: Octant,
    /// Its side.
    pub side: Side,
    /// The rank that owns it: the index of its part; 0 in a tree.
    pub rank: u32,
    /// Index among all leaves of the mesh, in Morton order.
    pub index: u64,
}

/// Visits leaves of the part with an index.
pub type Visit<'a> = &'a mut dyn FnMut(usize, &[Block]) -> Result<()>;

/// Visits a leaf; its error ends the traversal.
pub type Each<'a> = &'a mut dyn FnMut(Leaf) -> Result<()>;

impl Mesh {
    /// Opens a leaf-set directory.
    ///
    /// # Errors
    /// If the directory is not a leaf set.
    pub fn open(dir: &Path) -> Result<Self> {
        let manifest = Manifest::read(dir)?;
        let open = |part: &Part| {
            let path = dir.join(&part.file);
            PartFile::open(&path).map_err(|why| why.of_file(&path))
        };
        let parts = manifest.parts.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        // Words or a tree that the manifest does not name show that manifest and directory do not belong together.
        let mut found = part_names(dir)?;
        found.extend(dir.join(TREE).exists().then(|| TREE.to_owned()));
        if let Some(name) = found.into_iter().find(|name| !manifest.names().any(|it| it == name)) {
            let why = "a file of leaves that the manifest does not name";
            return Err(Failure::about(&dir.join(name), why));
        }
        match &manifest.hyper_tree_grid {
            Some(name) if parts.is_empty() => Self::of_tree(dir, name, &manifest),
            _ => Ok(Self { dir: dir.to_owned(), manifest, parts, tree_file: None }),
        }
    }

    /// Opens the tree of a directory with this manifest, whether or not it has parts.
    ///
    /// # Errors
    /// If the file is not the tree of a mesh with this root.
    pub fn of_tree(dir: &Path, name: &str, manifest: &Manifest) -> Result<Self> {
        let path = dir.join(name);
        let tree = TreeFile::open(&path).map_err(|why| damaged_tree(&path, &why))?;
        let (found, stated) = (tree.root, manifest.root);
        let why = format!("the tree has the root {found}, but the manifest states {stated}");
        Failure::unless(found == stated, Failure::about(&path, why))?;
        let (dir, manifest) = (dir.to_owned(), manifest.clone());
        Ok(Self { dir, manifest, parts: Vec::new(), tree_file: Some(tree) })
    }

    /// Number of leaves in the files, whatever the manifest states.
    pub fn leaf_count(&self) -> u64 {
        let of_parts = self.parts.iter().map(|part| part.leaves).sum();
        self.tree_file.as_ref().map_or(of_parts, |tree| tree.leaves)
    }

    /// Passes all leaves to `run`, until it returns false: the blocks of a tree, and each word of a part, whatever it is, as a block. Each run comes
    /// from the part with the given index. If every part is sorted, so is the stream.
    ///
    /// # Errors
    /// If a file cannot be read, or if the tree is damaged.
    pub fn stream(&self, run: &mut dyn FnMut(usize, &[Block]) -> bool) -> Result<()> {
        if let Some(tree) = &self.tree_file {
            let read = tree.blocks(&mut |blocks| run(0, blocks));
            return read.map_err(|why| damaged_tree(&tree.path, &why));
        }
        let mut blocks = Vec::new();
        merge(&self.parts, &mut |part, words| {
            blocks.clear();
            blocks.extend(words.iter().map(|&first| Block { first, depth: 0 }));
            run(part, &blocks)
        })
    }

    /// Visits all leaves in ascending order, each run with the index of its part.
    ///
    /// # Errors
    /// If a file cannot be read, or if the words are not those of a linear oct-tree; or the first error of `visit`, which ends the traversal.
    pub fn visit(&self, visit: Visit<'_>) -> Result<()> {
        let (mut order, mut visited) = (Order::default(), Ok(()));
        self.stream(&mut |part, blocks| {
            let text =
                |why| format!("not a linear oct-tree, because {why}: run harness audit on it");
            let linear = blocks.iter().try_for_each(|block| order.add(block.first)).map_err(text);
            let linear = linear.map_err(|why| Failure::about(&self.dir, why));
            visited = linear.and_then(|()| visit(part, blocks));
            visited.is_ok()
        })?;
        visited
    }

    /// Visits the leaves in those octants that `takes` accepts, in Morton order. All are read.
    ///
    /// # Errors
    /// As [`Mesh::visit`], if the leaves do not have the digest in the manifest, or if the user interrupts.
    pub fn leaves(&self, takes: &dyn Fn(&Octant) -> bool, visit: Each<'_>) -> Result<()> {
        let (mut index, mut digest) = (0u64, Digest::default());
        self.visit(&mut |part, blocks| {
            uninterrupted()?;
            for block in blocks {
                let (rank, side) = (part as u32, word::side(block.first));
                if takes(&block.octant()) {
                    for (index, word) in (index..).zip(block.words()) {
                        visit(Leaf { octant: word::octant(word), side, rank, index })?;
                    }
                }
                index += block.leaves();
                digest.add_block(block);
            }
            Ok(())
        })?;
        self.require_digest(digest)
    }

    fn require_digest(&self, digest: Digest) -> Result<()> {
        let stated = self.manifest.digest;
        let why = format!(
            "its leaves have the digest {digest}, and its manifest states {stated}: run harness audit on it"
        );
        Failure::unless(digest == stated, Failure::about(&self.dir, why))
    }

    /// All leaves as a tree.
    ///
    /// # Errors
    /// As [`Mesh::leaves`], and if the tree has more distinct nodes than [`NODES_MAX`].
    pub fn tree(&self) -> Result<Tree> {
        let (mut builder, mut digest) = (Builder::default(), Digest::default());
        self.visit(&mut |_, blocks| {
            blocks.iter().for_each(|block| digest.add_block(block));
            if builder.nodes() <= NODES_MAX {
                blocks.iter().for_each(|b| builder.push_block(b).expect("a visit is linear"));
            }
            Ok(())
        })?;
        let why = "distinct octants, which is the limit: use a part of the mesh";
        let why = Failure::about(&self.dir, format!("more than {NODES_MAX} {why}"));
        Failure::unless(builder.nodes() <= NODES_MAX, why)?;
        self.require_digest(digest)?;
        Ok(builder.finish())
    }

    /// The sorted words of the leaves in an octant, found among all.
    ///
    /// # Errors
    /// As [`Mesh::visit`].
    pub fn octant(&self, octant: &Octant) -> Result<Vec<u64>> {
        let start = word::key_of(octant.corner);
        let keys = start..start + word::span(octant.level);
        let mut found = Vec::new();
        let is_near =
            |block: &&Block| block.octant().contains(octant) || octant.contains(&block.octant());
        self.visit(&mut |_, blocks| {
            let words = blocks.iter().filter(is_near).flat_map(|block| block.words());
            found.extend(words.filter(|&word| keys.contains(&word::key(word))));
            Ok(())
        })?;
        Ok(found)
    }

    /// Refuses a case that was not meshed here, by its root, its surface level and its facets.
    ///
    /// # Errors
    /// If the mesh cannot be one of the case.
    pub fn require_case(&self, case: &Case) -> Result<()> {
        let &Manifest { root, lacks_inputs, level_surface, geometry, .. } = &self.manifest;
        let differs = if root != case.root {
            format!("root ({root})")
        } else if !lacks_inputs && level_surface != case.level_surface {
            format!("surface level ({level_surface})")
        } else if geometry.is_some_and(|facets| facets != Geometry::of(&case.facets_lattice)) {
            "geometry".to_owned()
        } else {
            return Ok(());
        };
        Err(Failure::input(format!(
            "the mesh is not of the case {}, but has another {differs}: give the case that was meshed",
            case.name
        )))
    }

    /// Makes sure that the sides of the leaves are known.
    ///
    /// # Errors
    /// If they are not.
    pub fn require_sides(&self) -> Result<()> {
        let why = "the sides of this mesh are unknown, and this needs them: hyper-tree grids and surfaces cannot be written without";
        Failure::unless(self.manifest.sides == Sides::Known, why)
    }

    /// Makes sure that the rank of each leaf is known: words have a file for each rank, and a tree has none.
    ///
    /// # Errors
    /// If they are not.
    pub fn require_ranks(&self) -> Result<()> {
        let why = "the ranks of a mesh that has only a tree are unknown: mesh with --write words";
        Failure::unless(self.tree_file.is_none(), why)
    }
}

/// A tree that cannot be opened or read.
fn damaged_tree(path: &Path, why: &TreeError) -> Failure {
    Failure::about(path, format!("the tree {why}"))
}

/// The names of the arrays of leaves in a directory, in alphabetical order.
pub(crate) fn part_names(dir: &Path) -> Result<Vec<String>> {
    let io = |error| Failure::about(dir, error);
    let mut names = Vec::new();
    for entry in fs::read_dir(dir).map_err(io)? {
        let name = entry.map_err(io)?.file_name().to_string_lossy().into_owned();
        names.extend(Path::new(&name).extension().is_some_and(|e| e == "npy").then_some(name));
    }
    names.sort_unstable();
    Ok(names)
}

/// Words per read: large enough for streaming, small enough for thousands of parts.
const CHUNK: u64 = 1 << 15;

/// A part and its buffer.
struct Reader<'a> {
    file: &'a PartFile,
    /// Index in the file of the first word after the buffer.
    next: u64,
    words: Vec<u64>,
    /// Index in the buffer of the next word.
    position: usize,
}

impl Reader<'_> {
    /// The next word, after an exhausted buffer was refilled; `None` at the end of the part.
    fn head(&mut self) -> Result<Option<u64>> {
        if self.position == self.words.len() {
            let left = (self.file.leaves - self.next).min(CHUNK);
            self.words.resize(left as usize, 0);
            self.file.read_at(self.next, &mut self.words)?;
            (self.next, self.position) = (self.next + left, 0);
        }
        Ok(self.words.get(self.position).copied())
    }
}

/// Passes the words of all parts to `run` in runs, until it returns false. Each run comes from the part with
/// the given index, and the next word of every other part is at least as large. If every part is sorted, so is
/// the stream.
///
/// # Errors
/// If a part cannot be read.
fn merge(parts: &[PartFile], run: &mut dyn FnMut(usize, &[u64]) -> bool) -> Result<()> {
    let reader = |file| Reader { file, next: 0, words: Vec::new(), position: 0 };
    let mut readers: Vec<Reader> = parts.iter().map(reader).collect();
    let mut heads = BinaryHeap::new();
    for (part, reader) in readers.iter_mut().enumerate() {
        heads.extend(reader.head()?.map(|head| Reverse((head, part))));
    }
    while let Some(Reverse((_, part))) = heads.pop() {
        let limit = heads.peek().map_or(u64::MAX, |Reverse((head, _))| *head);
        let reader = &mut readers[part];
        let buffered = &reader.words[reader.position..];
        // At least one word, so that equal heads and unsorted parts make progress.
        let len = 1 + buffered[1..].iter().take_while(|&&w| w < limit).count();
        if !run(part, &buffered[..len]) {
            return Ok(());
        }
        reader.position += len;
        heads.extend(reader.head()?.map(|head| Reverse((head, part))));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leafset::LeafSet;
    use crate::testing::{leaf_set, random_words, words_of};
    use proptest::prelude::*;

    fn opened(set: &LeafSet) -> (tempfile::TempDir, Mesh) {
        let dir = tempfile::tempdir().unwrap();
        set.write(dir.path()).unwrap();
        let mesh = Mesh::open(dir.path()).unwrap();
        (dir, mesh)
    }

    fn in_parts(words: &[u64], part_of: &[usize]) -> LeafSet {
        let mut parts = vec![Vec::new(); 3];
        words.iter().zip(part_of).for_each(|(&w, &part)| parts[part].push(w));
        leaf_set(parts)
    }

    proptest! {
        #[test]
        fn every_way_of_reading_gives_the_leaves_of_the_parts(words in random_words(3), part_of in prop::collection::vec(0usize..3, 600)) {
            let words: Vec<u64> = words.into_iter().take(part_of.len()).collect();
            let (_dir, mesh) = opened(&in_parts(&words, &part_of));
            prop_assert_eq!(mesh.leaf_count(), words.len() as u64);
            let mut visited = Vec::new();
            mesh.visit(&mut |_, run| {
                visited.extend(run.iter().flat_map(|block| block.words()));
                Ok(())
            })
            .unwrap();
            prop_assert_eq!(&visited, &words);
            let (tree, expected) = (mesh.tree().unwrap(), Tree::of_words(&words));
            for octant in words.iter().step_by(7).map(|&w| word::octant(w)) {
                prop_assert_eq!(tree.locate(octant.corner), expected.locate(octant.corner));
                let above = octant.ancestor(octant.level.saturating_sub(1));
                let within = words.iter().copied().filter(|&w| above.contains(&word::octant(w)));
                prop_assert_eq!(mesh.octant(&above).unwrap(), within.collect::<Vec<u64>>());
            }
        }

        #[test]
        fn words_that_are_no_linear_tree_are_refused(words in random_words(3), at in any::<prop::sample::Index>(), way in 0..4) {
            prop_assume!(words.len() > 1);
            let mut parts = vec![words.clone(), vec![]];
            let (i, other) = (at.index(words.len() - 1), words[at.index(words.len())]);
            match way {
                0 => parts[0].swap(i, i + 1),
                1 => parts[1].push(other),
                2 => parts[1].push(word::key_of(word::octant(other).ancestor(0).corner) << 7),
                _ => parts[0][i] |= 3,
            }
            let (_dir, mesh) = opened(&leaf_set(parts));
            for error in [mesh.visit(&mut |_, _| Ok(())).unwrap_err(), mesh.tree().unwrap_err()] {
                prop_assert!(error.to_string().contains("not a linear oct-tree"), "{}", error);
                prop_assert!(error.to_string().ends_with("run harness audit on it"), "{}", error);
            }
        }
    }

    #[test]
    fn leaves_that_the_manifest_does_not_state_are_refused() {
        let mut set = leaf_set(vec![words_of(|o| o.level < 2)]);
        set.parts[0].truncate(60);
        let (_dir, mesh) = opened(&set);
        let leaves = mesh.leaves(&|_| true, &mut |_| Ok(()));
        for error in [leaves.unwrap_err(), mesh.tree().unwrap_err()] {
            assert!(error.to_string().contains("its leaves have the digest"), "{error}");
        }
    }

    #[test]
    fn leaves_are_counted_in_the_files_and_not_in_the_manifest() {
        let mut set = leaf_set(vec![words_of(|o| o.level < 1), vec![]]);
        set.manifest.leaves = u64::MAX;
        assert_eq!(opened(&set).1.leaf_count(), 8);
    }
}

#[cfg(test)]
mod merging {
    use super::*;
    use crate::digest::mix;
    use crate::npy;

    fn parts(words: &[Vec<u64>]) -> (tempfile::TempDir, Vec<PartFile>) {
        let dir = tempfile::tempdir().unwrap();
        let open = |(i, words): (usize, &Vec<u64>)| {
            let path = dir.path().join(format!("{i}.npy"));
            npy::write(&path, words).unwrap();
            PartFile::open(&path).unwrap()
        };
        let files = words.iter().enumerate().map(open).collect();
        (dir, files)
    }

    #[test]
    fn the_words_of_sorted_parts_become_one_sorted_stream() {
        // One part exceeds the buffer, one is empty, and words are repeated within and across parts.
        let random = |count: u64, salt: u64| {
            let mut words: Vec<u64> =
                (0..count).map(|i| (mix(i ^ salt << 40) >> 64) as u64 % 50_000).collect();
            words.sort_unstable();
            words
        };
        let given =
            [random(2 * CHUNK + 5, 1), vec![], random(300, 2), vec![7; 3], random(CHUNK, 3)];
        let (_dir, files) = parts(&given);
        let (mut found, mut by_part) = (Vec::new(), vec![Vec::new(); given.len()]);
        merge(&files, &mut |part, run| {
            assert!(!run.is_empty());
            by_part[part].extend_from_slice(run);
            found.extend_from_slice(run);
            true
        })
        .unwrap();
        let mut expected = given.concat();
        expected.sort_unstable();
        assert!(found == expected && by_part == given);
        let mut runs = 0;
        merge(&files, &mut |_, _| {
            runs += 1;
            runs < 3
        })
        .unwrap();
        assert_eq!(runs, 3);
    }

    #[test]
    fn words_of_unsorted_parts_are_all_passed_on() {
        let given = [vec![9, 1, 5], vec![2, u64::MAX, 0]];
        let (_dir, files) = parts(&given);
        let mut by_part = vec![Vec::new(); 2];
        merge(&files, &mut |part, run| {
            by_part[part].extend_from_slice(run);
            true
        })
        .unwrap();
        assert_eq!(by_part, given);
    }
}
