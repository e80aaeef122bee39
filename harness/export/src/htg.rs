//! Selected leaves as a hyper-tree grid in VTKHDF: the whole tree in one file, a twentieth of a byte per leaf. Leaves that are not
//! selected are masked.
//!
//! The file has the nodes level by level, and the leaves come in Morton order. So they become a tree that stores equal subtrees once, whose
//! split nodes are then put in the order of the file: about 1.2 bytes per leaf.

use std::io::BufWriter;
use std::path::Path;

use contract::failure::{Failure, Result, uninterrupted};
use contract::files;
use contract::lattice::Root;
use contract::tree::{Builder, Handle, Kind, Tree};
use contract::word::{self, Side};
use vtkhdf::tree::{Shape, Siblings, TreeWriter, Window, groups};
use vtkhdf::write::Deflater;

use crate::options::{Export, Summary};

/// Writes the file.
///
/// # Errors
/// If the sides of the mesh are unknown, no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary> {
    let Export { mesh, selection, .. } = export;
    mesh.require_sides()?;
    let leaves = export.count()?;
    let mut builder = Builder::default();
    selection.visit(mesh, &mut |leaf| {
        builder.push_leaf(word::key_of(leaf.octant.corner), leaf.octant.level, leaf.side as Kind);
        Ok(())
    })?;
    let tree = builder.finish();
    let Root { origin, edge } = mesh.manifest.root;
    let (nodes, split) = by_level(&tree);
    let shape = Shape { origin, edge, nodes };
    let children = split.iter().flat_map(|&node| tree.children(node));
    let shown = children.chain([tree.root]).filter(|content| content.as_leaf().is_some());
    assert_eq!(shown.count() as u64, leaves, "nodes that are neither split nor masked, and leaves");
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, |file| {
        let out = BufWriter::with_capacity(1 << 20, file);
        let mut out = TreeWriter::new(out, shape.clone()).map_err(named)?;
        let mut deflater = Deflater::default();
        for index in 0..shape.windows() {
            uninterrupted()?;
            let mut window = Window::new(index);
            if index == 0 {
                window.put_root(siblings(&[tree.root]));
            }
            for group in groups(index).take_while(|&group| group < split.len() as u64) {
                window.put(group, siblings(&tree.children(split[group as usize])));
            }
            out.add(index, &window.compress(&shape, &mut deflater)).map_err(named)?;
        }
        out.finish().map(drop).map_err(named)
    })?;
    Ok(Summary { leaves, bytes, notes: Vec::new() })
}

/// The numbers of nodes by level, and the split nodes as the file numbers them: the children of each are one group of siblings.
fn by_level(tree: &Tree) -> (Vec<u64>, Vec<Handle>) {
    let is_split = |of: &Handle| of.is_node();
    let mut level: Vec<Handle> = [tree.root].into_iter().filter(is_split).collect();
    let (mut nodes, mut split) = (vec![1], Vec::new());
    while !level.is_empty() {
        nodes.push(8 * level.len() as u64);
        split.extend_from_slice(&level);
        level = level.iter().flat_map(|&node| tree.children(node)).filter(is_split).collect();
    }
    (nodes, split)
}

/// Siblings, or the root, with these contents.
fn siblings(contents: &[Handle]) -> Siblings {
    let bits = |has: &dyn Fn(Handle) -> bool| {
        (0..).zip(contents).map(|(i, &content)| u64::from(has(content)) << i).sum()
    };
    let of = |side: Side| bits(&|content| content.as_leaf() == Some(side as Kind));
    Siblings {
        split: bits(&Handle::is_node),
        deleted: bits(&|content| content == Handle::HOLE),
        crossing: of(Side::Crossing),
        inside: of(Side::Inside),
    }
}
