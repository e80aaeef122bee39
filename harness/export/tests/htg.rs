//! A mesh as a tree has the leaves of its words, whether they are read as a whole or by selection; and a tree of
//! any content is read or refused, without a panic.
#![allow(missing_docs)]

use contract::failure::{EXIT_INPUT, Failure};
use contract::htg::{TreeError, TreeFile};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::Manifest;
use contract::mesh::Leaf;
use contract::mesh::Mesh;
use contract::testing::random_words;
use contract::word;
use export::options::{Export, Regions};
use export::selection::{Selection, Slice};
use proptest::prelude::*;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use vtkhdf::tree::{Shape, Siblings, TreeWriter, Window};
use vtkhdf::write::Deflater;

const ROOT: Root = Root { origin: [0.1, -1.0, 1e6], edge: 0.3 };

/// A mesh of these parts on disk.
fn on_disk(parts: Vec<Vec<u64>>) -> (TempDir, Mesh) {
    let empty = Manifest::without_leaves(ROOT, "test".to_owned());
    let set = LeafSet::new(empty, Vec::new()).with_parts(parts);
    let dir = tempfile::tempdir().unwrap();
    set.write(dir.path()).unwrap();
    let mesh = Mesh::open(dir.path()).unwrap();
    (dir, mesh)
}

/// The mesh of a tree alone: the file, and the manifest of the words that it should have.
fn as_tree(mesh: &Mesh, selection: &Selection) -> Option<(TempDir, Mesh)> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mesh.vtkhdf");
    let script = |_: &str, _: &Path, _: &Path| unreachable!("no script makes this format");
    let export = Export { mesh, selection, case: None, regions: Regions::All, script };
    match export::htg::write(&export, &path) {
        Err(Failure { code: EXIT_INPUT, .. }) => return None,
        written => assert_eq!(written.unwrap().bytes, fs::metadata(&path).unwrap().len()),
    }
    let manifest = Manifest {
        parts: Vec::new(),
        hyper_tree_grid: Some("mesh.vtkhdf".to_owned()),
        ..mesh.manifest.clone()
    };
    manifest.write(dir.path()).unwrap();
    let mesh = Mesh::open(dir.path()).unwrap();
    Some((dir, mesh))
}

/// Words and indices of the selected leaves.
fn leaves(mesh: &Mesh, selection: &Selection) -> Vec<(u64, u64)> {
    let mut leaves = Vec::new();
    selection
        .visit(mesh, &mut |Leaf { octant, side, index, .. }| {
            leaves.push((word::encode(octant, side), index));
            Ok(())
        })
        .unwrap();
    leaves
}

fn words(tree: &TreeFile) -> Result<Vec<u64>, TreeError> {
    let mut words = Vec::new();
    tree.blocks(&mut |run| {
        words.extend(run.iter().flat_map(|block| block.words()));
        true
    })?;
    Ok(words)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_tree_has_the_leaves_of_the_words(
        all in random_words(5), parts in 1usize..3, axis in 0usize..3, at in 0.0f64..1.0
    ) {
        let mut by_part = vec![Vec::new(); parts];
        all.iter().enumerate().for_each(|(i, &w)| by_part[i / 11 % parts].push(w));
        let (_dir, mesh) = on_disk(by_part);
        let slice = Slice::new(&ROOT, axis, ROOT.origin[axis] + at * ROOT.edge);
        let cut = Selection { slice, ..Selection::default() };
        for selection in [Selection::default(), cut.clone()] {
            let expected = leaves(&mesh, &selection);
            let Some((dir, tree)) = as_tree(&mesh, &selection) else {
                prop_assert!(expected.is_empty());
                continue;
            };
            // A file of part of a mesh counts only that part.
            let expected: Vec<u64> = expected.into_iter().map(|(word, ..)| word).collect();
            let file = TreeFile::open(&dir.path().join("mesh.vtkhdf")).unwrap();
            prop_assert_eq!(file.root, ROOT);
            prop_assert_eq!(&words(&file).unwrap(), &expected);
            prop_assert_eq!(tree.leaf_count(), expected.len() as u64);
            if selection == Selection::default() {
                prop_assert_eq!(leaves(&tree, &cut), leaves(&mesh, &cut));
                prop_assert!(mesh.require_ranks().is_ok() && tree.require_ranks().is_err());
            }
        }
    }

    /// Whatever the nodes are, they are refused or leaves of an oct-tree.
    #[test]
    fn a_tree_of_any_nodes_is_read_or_refused(
        groups in prop::collection::vec(any::<[u8; 4]>(), 1..6),
        levels in prop::collection::vec(1u64..4, 1..4),
        sparse in any::<bool>(),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mesh.vtkhdf");
        let nodes = [1].into_iter().chain(levels.iter().map(|n| 8 * n)).collect();
        write(&path, Shape { origin: ROOT.origin, edge: ROOT.edge, nodes }, &groups, sparse);
        let Ok(tree) = TreeFile::open(&path) else { return Ok(()) };
        let streamed = words(&tree);
        for pair in streamed.unwrap_or_default().windows(2) {
            prop_assert!(word::check(pair[0]).is_ok());
            prop_assert!(word::key(pair[0]) + word::span(word::level(pair[0])) <= word::key(pair[1]));
        }
    }
}

/// Writes a tree with these siblings, in one window; the root is split.
fn write(path: &Path, shape: Shape, groups: &[[u8; 4]], sparse: bool) {
    let mut window = Window::new(0);
    window.put_root(Siblings { split: 1, ..Siblings::default() });
    for (number, &[split, deleted, crossing, inside]) in (0..).zip(groups) {
        let only = |bits: u8, other: u8| if sparse { bits & !other } else { bits };
        let (split, deleted) = (only(split, 0xf5), only(deleted, split | 0xf0));
        let inside = only(inside, crossing);
        let [split, deleted, crossing, inside] = [split, deleted, crossing, inside].map(u64::from);
        window.put(number, Siblings { split, deleted, crossing, inside });
    }
    let chunks = window.compress(&shape, &mut Deflater::default());
    let mut out = TreeWriter::new(fs::File::create(path).unwrap(), shape).unwrap();
    out.add(0, &chunks).unwrap();
    out.finish().unwrap();
}
