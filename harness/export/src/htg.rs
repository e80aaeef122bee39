//! Selected leaves as a hyper-tree grid in VTKHDF: the whole tree in one file, a twentieth of a byte per leaf. Leaves that are not
//! selected are masked.
//!
//! The file has the nodes level by level, and the leaves come in Morton order. So a first pass over the leaves counts the nodes of each level;
//! then the place of every node is known, and a second pass fills windows of nodes at all levels at once. A window is
//! written as soon as it is full, so that only a few per level are in memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek};
use std::path::Path;

use contract::files;
use contract::octant::LEVEL_MAX;
use contract::word::{self, Side};
use vtkhdf::tree::{Shape, Siblings, TreeWriter, WINDOW, Window, first_node};
use vtkhdf::write::Deflater;

use crate::leaf::Leaf;
use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use crate::written::Written;
use contract::failure::Failure;

/// Leaves between two reports of progress.
const REPORT: u64 = 1 << 16;

/// Takes the siblings of a level that contain the leaves of a mesh, or the root in place of the first of them.
type Take<'a> = &'a mut dyn FnMut(usize, Siblings) -> Result<(), Failure>;

/// Writes the file.
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
    let counted = families(mesh, selection, 0, options, &mut |level, _| {
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
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, named, |file: &mut File| {
        let out = BufWriter::with_capacity(1 << 20, file);
        let mut windows = Windows::new(out, shape).map_err(named)?;
        let mut shown = 0;
        let written = families(mesh, selection, leaves, options, &mut |level, siblings| {
            let is_shown = !(siblings.split | siblings.deleted);
            shown += u64::from(if level == 0 { is_shown & 1 } else { is_shown }.count_ones());
            windows.put(level, siblings).map_err(named)
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
    take: Take<'_>,
) -> Result<Written, Failure> {
    let (mut open, mut written) = (Open::default(), Written::default());
    mesh.visit(selection, &|| options.check(), &mut |leaf| {
        if written.cells.is_multiple_of(REPORT) {
            options.watch.progress(written.cells.min(total), total.max(1));
        }
        written.add(&leaf.octant, true);
        open.push(&leaf, take)
    })?;
    open.close(0, take)?;
    Ok(written)
}

/// The siblings that contain the last leaf, or the octants that contain it: one family for each level down to its own.
#[derive(Debug, Default)]
struct Open {
    families: Vec<Siblings>,
    /// Morton code of the last leaf.
    key: u64,
}

impl Open {
    /// Adds a leaf, which follows the last one, and passes on the families that end before it.
    fn push(&mut self, leaf: &Leaf, take: Take<'_>) -> Result<(), Failure> {
        let (key, level) = (word::key_of(leaf.octant.corner), leaf.octant.level);
        // The families of the common ancestors stay open, and that of the first octants that differ.
        let shared =
            (self.key ^ key).checked_ilog2().map_or(LEVEL_MAX, |bit| LEVEL_MAX - bit as u8 / 3 - 1);
        self.close(usize::from(shared) + 2, take)?;
        self.key = key;
        while self.families.len() <= usize::from(level) {
            let levels = self.families.len() as u8;
            if let Some(above) = self.families.last_mut() {
                let bit = 1 << digit(key, levels - 1);
                above.split |= bit;
                above.deleted &= !bit;
            }
            self.families.push(Siblings { deleted: 0xff, ..Siblings::default() });
        }
        let siblings = &mut self.families[usize::from(level)];
        let bit = 1 << digit(key, level);
        siblings.deleted &= !bit;
        match leaf.side {
            Side::Crossing => siblings.crossing |= bit,
            Side::Inside => siblings.inside |= bit,
            Side::Outside => {}
        }
        Ok(())
    }

    /// Passes on families until at most `count` are open.
    fn close(&mut self, count: usize, take: Take<'_>) -> Result<(), Failure> {
        while self.families.len() > count {
            let siblings = self.families.pop().unwrap_or_default();
            take(self.families.len(), siblings)?;
        }
        Ok(())
    }
}

/// Which of its siblings contains a level-19 cell, among octants of this level; 0 for the root.
fn digit(key: u64, level: u8) -> usize {
    if level == 0 { 0 } else { ((key / word::span(level)) & 7) as usize }
}

/// The windows of a file, each written when it is full.
struct Windows<W> {
    out: TreeWriter<W>,
    shape: Shape,
    /// Number of the next siblings of each level.
    next: Vec<u64>,
    /// Windows with the number of their nodes that are missing.
    open: BTreeMap<u64, (Window, u64)>,
    deflater: Deflater,
}

impl<W: io::Write + Seek> Windows<W> {
    fn new(out: W, shape: Shape) -> io::Result<Self> {
        // The root is in no group of siblings.
        let mut next = vec![0; 2.min(shape.nodes.len())];
        for nodes in shape.nodes.iter().skip(1) {
            next.push(next.last().unwrap_or(&0) + nodes / 8);
        }
        let out = TreeWriter::new(out, shape.clone())?;
        Ok(Self { out, shape, next, open: BTreeMap::new(), deflater: Deflater::default() })
    }

    /// Puts siblings in their place, which follows that of the last ones of their level.
    fn put(&mut self, level: usize, siblings: Siblings) -> io::Result<()> {
        if level == 0 {
            return self.fill(0, 1, |window| window.put_root(siblings));
        }
        let group = self.next[level];
        self.next[level] += 1;
        let (first, last) = (first_node(group), first_node(group) + 7);
        for window in first / WINDOW..=last / WINDOW {
            let nodes = last.min(window * WINDOW + WINDOW - 1) + 1 - first.max(window * WINDOW);
            self.fill(window, nodes, |window| window.put(group, siblings))?;
        }
        Ok(())
    }

    fn fill(&mut self, index: u64, nodes: u64, put: impl FnOnce(&mut Window)) -> io::Result<()> {
        let all = WINDOW.min(self.shape.nodes_total() - index * WINDOW);
        let (window, missing) = self.open.entry(index).or_insert_with(|| (Window::new(index), all));
        put(window);
        *missing -= nodes;
        if *missing > 0 {
            return Ok(());
        }
        let chunks = window.compress(&self.shape, &mut self.deflater);
        self.open.remove(&index);
        self.out.add(index, &chunks)
    }

    /// Completes the file, and returns it.
    fn finish(self) -> io::Result<W> {
        assert!(self.open.is_empty(), "every node was counted");
        self.out.finish()
    }
}
