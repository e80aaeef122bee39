//! Imported cells as a leaf set with its manifest; and hyper-tree grids as this repository writes them, of any size, whose leaves are never in
//! memory all at once. VTK reads other hyper-tree grids.

use super::TOLERANCE;
use super::cells::Cells;
use crate::case::Case;
use crate::digest::Digest;
use crate::failure::{Failure, Result};
use crate::htg::{SIDE, TreeError, TreeFile};
use crate::lattice::Root;
use crate::leafset::{self, LeafSet};
use crate::manifest::{self, Manifest, Part, Sides, Tree};
use crate::mesh::TREE;
use crate::npy;
use crate::word::{self, Order};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::{fs, io};

/// The mesh of these cells in one part, with the root `given` or that of the case, of the file, or of the cells.
///
/// The manifest has the inputs of the case. Without one they are unknown, and all of the root is expected to be filled.
///
/// # Errors
/// If the cells are not leaves of an oct-tree with this root, or if these do not have the digest that the file states.
pub fn leaf_set(
    cells: &Cells,
    given: Option<Root>,
    case: Option<&Case>,
    program: String,
) -> Result<LeafSet> {
    let stated = given.or(case.map(|case| case.root)).or(cells.root);
    let root = stated.map_or_else(|| cells.least_root(), Ok)?;
    Failure::unless(root.is_cube(), format_args!("has a root that is not a cube: {root}"))?;
    let words = cells.words(&root)?;
    let is_of_digest = |stated: Digest| cells.root != Some(root) || stated == Digest::of(&words);
    let is_whole = cells.digest.is_none_or(is_of_digest);
    Failure::unless(is_whole, "has other leaves than its digest states: it is damaged")?;
    let sides = if cells.sides.is_some() { Sides::Known } else { Sides::Unknown };
    let manifest = Manifest { sides, ..manifest_of(root, case, program) };
    let set = LeafSet::new(manifest, Vec::new()).with_parts(vec![words]);
    check_invariants(cells, &set);
    Ok(set)
}

/// The manifest of a mesh in a root, without leaves.
fn manifest_of(root: Root, case: Option<&Case>, program: String) -> Manifest {
    match case {
        Some(case) => Manifest { root, ..case.manifest(Tree::Final, program) },
        None => Manifest { lacks_inputs: true, ..Manifest::without_leaves(root, program) },
    }
}

/// Panics if an invariant of the answer does not hold: the leaves are a linear oct-tree, as many as there are cells, and fill
/// the same part of the root.
pub fn check_invariants(cells: &Cells, set: &LeafSet) {
    let LeafSet { manifest, words, .. } = set;
    assert_eq!(cells.count(), words.len(), "cells and leaves");
    let mut order = Order::default();
    words.iter().try_for_each(|&leaf| order.add(leaf)).expect("a linear oct-tree");
    let of_cells = cells.edges.iter().map(|edge| (edge / manifest.root.edge).powi(3)).sum::<f64>();
    let span = |&leaf: &u64| word::span(word::level(leaf)) as f64 / word::KEY_END as f64;
    let of_leaves = words.iter().map(span).sum::<f64>();
    let is_same = (of_cells - of_leaves).abs() <= 4.0 * TOLERANCE * of_cells;
    assert!(is_same, "cells fill {of_cells} of the root, and their leaves {of_leaves}");
}

/// A tree, and the manifest of its leaves.
pub struct ImportedTree {
    tree: TreeFile,
    /// The manifest, without parts.
    pub manifest: Manifest,
}

impl ImportedTree {
    /// Opens a file and counts its leaves; `None` if VTK has to read it, or if its root is not the one that is given. Sides are
    /// the cell data that `sides` names, otherwise `side` if it has that. The manifest is that of [`leaf_set`].
    ///
    /// # Errors
    /// If the file is damaged or has no such cell data.
    pub fn open(
        path: &Path,
        sides: Option<&str>,
        root: Option<Root>,
        case: Option<&Case>,
        program: String,
    ) -> Result<Option<Self>> {
        // Another array is VTK's to find.
        if sides.is_some_and(|sides| sides != SIDE) {
            return Ok(None);
        }
        let tree = match TreeFile::open(path) {
            Ok(tree) if root.is_none_or(|root| root == tree.root) => tree,
            Ok(_) | Err(TreeError::Unknown(_)) => return Ok(None),
            Err(error) => return Err(Failure::input(error)),
        };
        let mut manifest = manifest_of(tree.root, case, program);
        tree.blocks(&mut |run| {
            run.iter().for_each(|block| _ = manifest.add_block(block));
            true
        })
        .map_err(Failure::input)?;
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
            let read = self.tree.blocks(&mut |run| {
                run.iter().for_each(|block| found.add_block(block));
                let mut words = run.iter().flat_map(|block| block.words());
                written = words.try_for_each(|word| out.write_all(&word.to_le_bytes()));
                written.is_ok()
            });
            written?;
            read.map_err(io::Error::other)?;
            let changed = || io::Error::other("the file changed while it was read");
            (found == digest).then_some(()).ok_or_else(changed)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{cells_of, words_of};

    const ROOT: Root = Root { origin: [1.0; 3], edge: 0.3 };

    #[test]
    fn a_mesh_of_another_digest_than_stated_is_refused_unless_it_is_moved() {
        let words = words_of(|o| o.level < 2);
        let mut cells = cells_of(&words, &ROOT);
        cells.root = Some(ROOT);
        let import = |cells: &Cells, root| leaf_set(cells, root, None, "test".to_owned());
        for (digest, moved, holds) in [
            (Digest::of(&words), false, true),
            (Digest::of(&words[1..]), false, false),
            (Digest::of(&words[1..]), true, true),
        ] {
            cells.digest = Some(digest);
            let root = moved.then_some(Root { edge: 0.6, ..ROOT });
            assert_eq!(import(&cells, root).is_ok(), holds);
        }
    }

    #[test]
    fn an_imported_mesh_that_is_not_its_cells_is_a_bug() {
        let words = words_of(|o| o.level == 0 || o.level < 3 && o.corner == [0; 3]);
        let cells = cells_of(&words, &ROOT);
        let correct = leaf_set(&cells, Some(ROOT), None, "test".to_owned()).unwrap();
        type Fault = fn(&mut LeafSet);
        let faults: [Fault; 4] = [
            |set| *set = set.with_parts(vec![set.words[1..].to_vec()]),
            |set| set.words.swap(0, 1),
            |set| *set = set.with_parts(vec![[&set.words[..1], &set.words[..21]].concat()]),
            |set| {
                let moved = set.words.iter().map(|w| if word::level(*w) == 1 { w + 4 } else { *w });
                *set = set.with_parts(vec![moved.collect()]);
            },
        ];
        for (i, fault) in faults.iter().enumerate() {
            let mut wrong = correct.clone();
            fault(&mut wrong);
            let seen = std::panic::catch_unwind(|| check_invariants(&cells, &wrong));
            assert!(seen.is_err(), "fault {i}");
        }
    }

    #[test]
    fn a_root_that_is_no_cube_is_refused() {
        let cells = cells_of(&words_of(|o| o.level < 1), &ROOT);
        for root in [
            Root { edge: 0.0, ..ROOT },
            Root { edge: -1.0, ..ROOT },
            Root { edge: f64::INFINITY, ..ROOT },
            Root { edge: f64::NAN, ..ROOT },
            Root { origin: [1.0, f64::NAN, 1.0], ..ROOT },
            Root { origin: [1.0, 1.0, f64::INFINITY], ..ROOT },
        ] {
            let why =
                leaf_set(&cells, Some(root), None, "test".to_owned()).unwrap_err().to_string();
            assert!(why.contains("has a root that is not a cube"), "{why}");
        }
    }

    #[test]
    fn a_mesh_has_the_requirements_of_its_case_and_the_root_that_is_given() {
        let text = "spacing_min = 1.0\nlayer_cells_min = 3\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let words = words_of(|o| o.level < 1);
        for (given, expected) in [(None, case.root), (Some(ROOT), ROOT)] {
            let cells = cells_of(&words, &expected);
            let set = leaf_set(&cells, given, Some(&case), "test".to_owned()).unwrap();
            let Manifest { root, level_surface, layer_cells_min, .. } = set.manifest;
            assert_eq!((root, level_surface, layer_cells_min), (expected, 3, 3));
            assert_eq!(set.words, words);
        }
    }

    #[test]
    fn an_imported_mesh_has_a_complete_manifest() {
        let words = words_of(|o| o.level == 0 || o.level < 3 && o.corner == [0; 3]);
        let mut cells = cells_of(&words, &ROOT);
        let set = leaf_set(&cells, Some(ROOT), None, "test".to_owned()).unwrap();
        assert_eq!(set.manifest.digest, Digest::of(&words));
        assert_eq!(
            (set.manifest.leaves, set.manifest.lacks_inputs, set.manifest.sides),
            (22, true, Sides::Known)
        );
        cells.sides = None;
        let set = leaf_set(&cells, None, None, "test".to_owned()).unwrap();
        assert_eq!((&set.words, set.manifest.sides), (&words, Sides::Unknown));
        let place = tempfile::tempdir().unwrap();
        set.create(&place.path().join("mesh")).unwrap();
        let again = crate::leafset::read(&place.path().join("mesh")).unwrap();
        assert_eq!((again.manifest, again.words), (set.manifest.clone(), words));
        assert!(
            set.create(&place.path().join("mesh")).unwrap_err().to_string().contains("not empty")
        );
    }
}
