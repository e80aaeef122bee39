//! Windows of nodes that are partly filled.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

use vtkhdf::tree::{Shape, TreeWriter, WINDOW, Window, first_node};
use vtkhdf::write::Deflater;

use super::siblings::Family;

/// The windows of a file, each written when it is full.
pub(super) struct Windows<W> {
    out: TreeWriter<W>,
    shape: Shape,
    with_ranks: bool,
    /// Number of the next siblings of each level.
    next: Vec<u64>,
    /// Windows with the number of their nodes that are missing.
    open: BTreeMap<u64, (Window, u64)>,
    deflater: Deflater,
}

impl<W: Write + Seek> Windows<W> {
    pub(super) fn new(out: TreeWriter<W>, shape: Shape, with_ranks: bool) -> Self {
        // The root is in no group of siblings.
        let mut next = vec![0; 2.min(shape.nodes.len())];
        for nodes in shape.nodes.iter().skip(1) {
            next.push(next.last().unwrap_or(&0) + nodes / 8);
        }
        let (open, deflater) = (BTreeMap::new(), Deflater::default());
        Self { out, shape, with_ranks, next, open, deflater }
    }

    /// Puts siblings in their place, which follows that of the last ones of their level.
    pub(super) fn put(&mut self, family: &Family) -> io::Result<()> {
        if family.level == 0 {
            let root = family.siblings;
            return self.fill(0, 1, |window| window.put_root(root, family.parts[0]));
        }
        let next = &mut self.next[usize::from(family.level)];
        let group = *next;
        *next += 1;
        let (first, last) = (first_node(group), first_node(group) + 7);
        for window in first / WINDOW..=last / WINDOW {
            let nodes = last.min(window * WINDOW + WINDOW - 1) + 1 - first.max(window * WINDOW);
            self.fill(window, nodes, |w| w.put(group, family.siblings, family.parts))?;
        }
        Ok(())
    }

    fn fill(&mut self, index: u64, nodes: u64, put: impl FnOnce(&mut Window)) -> io::Result<()> {
        let all = WINDOW.min(self.shape.nodes_total() - index * WINDOW);
        let (window, missing) =
            self.open.entry(index).or_insert_with(|| (Window::new(index, self.with_ranks), all));
        put(window);
        *missing -= nodes;
        if *missing > 0 {
            return Ok(());
        }
        let chunks = window.compress(&self.shape, &mut self.deflater);
        self.open.remove(&index);
        self.out.add(index, chunks.iter().map(Option::as_deref))
    }

    /// Completes the file, and returns it.
    pub(super) fn finish(self) -> io::Result<W> {
        assert!(self.open.is_empty(), "every node was counted");
        self.out.finish()
    }
}
