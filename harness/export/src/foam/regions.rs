//! Regions of cells that are connected by faces.
//!
//! Cells of an octant are in the same *component* if faces connect them within it. A node of the tree has few components, which are found
//! once for all octants with this content: from the components of its children, and those of them that touch. The regions are the
//! components of the root.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::ops::Range;

use contract::word;
use rustc_hash::FxBuildHasher;

use super::tree::{ANYWHERE, CELLS, CUTS, Content, Handle, Tree};
use crate::error::ExportError;
use crate::options::Options;

/// The components of all nodes.
#[derive(Debug)]
pub struct Regions<'a> {
    tree: &'a Tree,
    nodes: Vec<Node>,
    /// Component in the node of each child's components; left out for nodes with one component.
    components: Vec<u32>,
    sizes: Vec<Size>,
}

/// Indices of what belongs to a node.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Number of its components.
    count: u32,
    sizes: usize,
    components: usize,
}

/// Size of a region or component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Size {
    /// Volume in level-19 cells of a root that is the octant.
    pub volume: u64,
    /// Number of cells.
    pub cells: u64,
}

impl<'a> Regions<'a> {
    /// The regions of a tree.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn new(tree: &'a Tree, options: &Options) -> Result<Self, ExportError> {
        let mut regions =
            Self { tree, nodes: Vec::new(), components: Vec::new(), sizes: Vec::new() };
        for children in tree.nodes() {
            options.check_at(regions.nodes.len() as u64)?;
            regions.push(&children);
        }
        Ok(regions)
    }

    /// The regions, those of largest volume first.
    pub fn sizes(&self) -> Vec<(u32, Size)> {
        let root = self.tree.root().what;
        let mut sizes: Vec<_> = (0..self.count(root)).map(|c| (c, self.size(root, c))).collect();
        sizes.sort_by_key(|&(_, size)| Reverse(size));
        sizes
    }

    fn count(&self, of: Handle) -> u32 {
        of.as_node().map_or(u32::from(of.as_cell().is_some()), |node| self.nodes[node].count)
    }

    fn size(&self, of: Handle, component: u32) -> Size {
        let cell = Size { volume: word::span(0), cells: 1 };
        of.as_node().map_or(cell, |node| self.sizes[self.nodes[node].sizes + component as usize])
    }

    /// The component in an octant that a component of a child belongs to.
    fn component(&self, of: Handle, digit: usize, of_child: u32) -> u32 {
        let Some(node) = of.as_node().map(|node| self.nodes[node]) else { return of_child };
        if node.count == 1 {
            return 0;
        }
        let before = (0..digit).map(|d| self.count(self.tree.child_of(of, d)) as usize);
        self.components[node.components + before.sum::<usize>() + of_child as usize]
    }

    /// Adds the next node.
    fn push(&mut self, children: &[Handle; 8]) {
        let mut begin = [0; 9];
        (0..8).for_each(|d| begin[d + 1] = begin[d] + self.count(children[d]) as usize);
        let mut sets: Vec<u32> = (0..begin[8] as u32).collect();
        for (axis, low) in
            (0..24).map(|i| (i / 8, i % 8)).filter(|(axis, low)| low >> axis & 1 == 0)
        {
            let high = low | 1 << axis;
            for (a, b) in self.touching(children[low], children[high], axis) {
                join(&mut sets, begin[low] + a as usize, begin[high] + b as usize);
            }
        }
        let (components, first) = (self.components.len(), self.sizes.len());
        let mut labels = vec![0; sets.len()];
        for (digit, &child) in children.iter().enumerate() {
            for i in begin[digit]..begin[digit + 1] {
                let least = least(&mut sets, i);
                if least == i {
                    labels[i] = (self.sizes.len() - first) as u32;
                    self.sizes.push(Size::default());
                }
                labels[i] = labels[least];
                let of_child = self.size(child, (i - begin[digit]) as u32);
                let size = &mut self.sizes[first + labels[i] as usize];
                size.volume += of_child.volume / 8;
                size.cells += of_child.cells;
            }
        }
        let count = (self.sizes.len() - first) as u32;
        if count > 1 {
            self.components.extend(labels);
        }
        self.nodes.push(Node { count, sizes: first, components });
    }

    /// The pairs of components, of one octant and of the next along an axis, that have a common face.
    fn touching(&self, low: Handle, high: Handle, axis: usize) -> Vec<(u32, u32)> {
        let mut pairs = Vec::new();
        let has_cells = |of: Handle, side: usize| self.tree.kinds(of, 2 * axis + side) & CELLS != 0;
        if !has_cells(low, 1) || !has_cells(high, 0) {
            return pairs;
        }
        if low.as_node().is_none() && high.as_node().is_none() {
            return vec![(0, 0)];
        }
        let most = self.count(low) as usize * self.count(high) as usize;
        for digit in (0..8).filter(|digit| digit >> axis & 1 == 0) {
            let of_low = self.tree.child_of(low, digit | 1 << axis);
            let of_high = self.tree.child_of(high, digit);
            let below = self.touching(of_low, of_high, axis);
            pairs.extend(below.into_iter().map(|(a, b)| {
                let a = self.component(low, digit | 1 << axis, a);
                (a, self.component(high, digit, b))
            }));
            pairs.sort_unstable();
            pairs.dedup();
            if pairs.len() == most {
                break;
            }
        }
        pairs
    }

    /// The tree with holes in place of all cells that are not in a region.
    pub fn retain(&self, region: u32) -> Tree {
        let root = self.tree.root().what;
        let nodes = self.tree.nodes().collect();
        let mut retained = Retained { regions: self, nodes, known: HashMap::default() };
        let root = retained.octant(root, &[region]);
        Tree::numbered(root, retained.nodes.into_iter())
    }
}

/// Nodes of a tree, and more that have only some of their components.
struct Retained<'a> {
    regions: &'a Regions<'a>,
    nodes: Vec<[Handle; 8]>,
    known: HashMap<(Handle, Vec<u32>), Handle, FxBuildHasher>,
}

impl Retained<'_> {
    /// An octant with these components, ascending, of those that it has.
    fn octant(&mut self, of: Handle, components: &[u32]) -> Handle {
        let regions = self.regions;
        if components.len() == regions.count(of) as usize {
            return of;
        }
        if components.is_empty() && regions.tree.kinds(of, ANYWHERE) & CUTS == 0 {
            return Handle::HOLE;
        }
        let key = (of, components.to_vec());
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let children = std::array::from_fn(|digit| {
            let child = regions.tree.child_of(of, digit);
            let is_kept = |&c: &u32| components.contains(&regions.component(of, digit, c));
            let kept: Vec<u32> = (0..regions.count(child)).filter(is_kept).collect();
            self.octant(child, &kept)
        });
        let node = Handle::node(self.nodes.len());
        self.nodes.push(children);
        self.known.insert(key, node);
        node
    }
}

/// Visits the cells, in ascending intervals, that a tree still has after [`Regions::retain`].
pub fn visit_retained(before: &Tree, after: &Tree, visit: &mut dyn FnMut(Range<u32>)) {
    visit_in((before, before.root()), (after, after.root()), visit);
}

fn visit_in(
    (before, of): (&Tree, Content),
    (after, retained): (&Tree, Content),
    visit: &mut dyn FnMut(Range<u32>),
) {
    if of.what == retained.what {
        visit(of.first..of.first + before.cells_in(of));
    } else if retained.is_node() {
        for digit in 0..8 {
            let child = (after, after.child(retained, digit));
            visit_in((before, before.child(of, digit)), child, visit);
        }
    }
}

fn least(sets: &mut [u32], mut i: usize) -> usize {
    while sets[i] as usize != i {
        sets[i] = sets[sets[i] as usize];
        i = sets[i] as usize;
    }
    i
}

/// Joins two sets, which are represented by their least elements.
fn join(sets: &mut [u32], a: usize, b: usize) {
    let (a, b) = (least(sets, a), least(sets, b));
    sets[a.max(b)] = a.min(b) as u32;
}
