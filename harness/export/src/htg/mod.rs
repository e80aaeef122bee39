//! Selected leaves as a hyper-tree grid in VTKHDF: the whole tree in one file, a twentieth of a byte per leaf. Leaves that are not
//! selected are masked.
//!
//! The file has the nodes level by level, and the leaves come in Morton order. So a first pass over the leaves counts the nodes of each level;
//! then the place of every node is known, and a second pass fills windows of nodes at all levels at once. A window is
//! written as soon as it is full, so that only a few per level are in memory.

mod siblings;
mod windows;

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use contract::files;
use vtkhdf::tree::{Shape, TreeWriter};

use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use crate::written::Written;
use contract::failure::Failure;
use siblings::{Family, Open};
use windows::Windows;

/// Leaves between two reports of progress.
const REPORT: u64 = 1 << 16;

/// Writes the file. With more than one rank, cells have it as `rank`.
///
/// # Errors
/// If the sides of the mesh are unknown, no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    mesh.require_sides()?;
    let mut nodes = vec![1u64];
    let counted = families(mesh, selection, 0, options, &mut |family| {
        let level = usize::from(family.level);
        nodes.resize(nodes.len().max(level + 1), 0);
        nodes[level] += if level > 0 { 8 } else { 0 };
        Ok(())
    })?;
    let leaves = counted.cells;
    if leaves == 0 {
        return Err(mesh.nothing_selected());
    }
    let root = mesh.manifest.root;
    let shape = Shape { origin: root.origin, edge: root.edge, nodes };
    let with_ranks = mesh.leaves_by_rank()?.len() > 1;
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, named, |file: &mut File| {
        let out = BufWriter::with_capacity(1 << 20, file);
        let out = TreeWriter::new(out, shape.clone(), with_ranks).map_err(named)?;
        let mut windows = Windows::new(out, shape, with_ranks);
        let mut shown = 0;
        let written = families(mesh, selection, leaves, options, &mut |family| {
            shown += u64::from(family.leaves());
            windows.put(&family).map_err(named)
        })?;
        written.check_invariants(mesh, selection, leaves);
        assert_eq!(shown, leaves, "nodes that are neither split nor masked, and leaves");
        let file = windows.finish().map_err(named)?;
        let file = file.into_inner().map_err(|error| named(error.into_error()))?;
        Ok::<_, Failure>(file.metadata().map_err(named)?.len())
    })?;
    Ok(Summary { leaves, files: 1, bytes, notes: Vec::new() })
}

/// Visits the selected leaves and passes on all siblings, those of each level in Morton order; returns the leaves. `total` is their
/// number in the second pass.
fn families(
    mesh: &Mesh,
    selection: &Selection,
    total: u64,
    options: &Options<'_>,
    take: &mut dyn FnMut(Family) -> Result<(), Failure>,
) -> Result<Written, Failure> {
    let (mut open, mut written) = (Open::default(), Written::default());
    mesh.visit(selection, &|| options.check(), &mut |leaf| {
        if written.cells.is_multiple_of(REPORT) {
            options.watch.progress(written.cells.min(total), total.max(1));
        }
        written.add(&leaf.octant, true);
        open.push(&leaf, take)
    })?;
    open.finish(take)?;
    Ok(written)
}
