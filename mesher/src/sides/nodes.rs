//! The base tree's bricks as a linked tree, with the components inside each brick.
//!
//! Invariants: nodes of a level are in Morton order; a node's children are neighbours in the next
//! level, one per byte of `split` that is not zero; components are numbered through all levels in order.

use crate::brick;
use crate::brickset::ones;
use crate::octant::Level;
use crate::share::{Ownership, Place};
use crate::tree::{LEVELS, Tree};

/// Number of a component inside a brick.
pub type Component = u32;

/// A node of a level, by number.
pub type Node = u32;

/// All bricks that this rank holds, and stubs for the children of top bricks that it does not.
pub struct Nodes {
    levels: Vec<LevelNodes>,
    masks: Vec<u64>,
}

#[derive(Default)]
struct LevelNodes {
    keys: Vec<u64>,
    /// Non-crossing leaves.
    open: Vec<u64>,
    /// Empty if nothing is split at the level.
    split: Vec<u64>,
    first_child: Vec<Node>,
    /// First component; one more entry than nodes.
    components: Vec<Component>,
    /// Places of the nodes; empty if all are this rank's alone.
    places: Vec<Place>,
}

impl Nodes {
    /// Links the bricks of a base tree.
    pub fn new(tree: &Tree, share: &Ownership) -> Self {
        let mut nodes = Self { levels: Vec::with_capacity(LEVELS), masks: Vec::new() };
        for l in 0..LEVELS as Level {
            let level = nodes.build(tree, share, l);
            nodes.levels.push(level);
        }
        nodes
    }

    fn build(&mut self, tree: &Tree, share: &Ownership, l: Level) -> LevelNodes {
        let mut out = LevelNodes::default();
        let mut split = tree.split[l as usize].cursor();
        let mut crossing = tree.crossing[l as usize].cursor();
        let splits = !tree.split[l as usize].is_empty();
        let mut children = 0;
        for b in Tree::exists(&tree.split, l) {
            let remote = !share.answers_for(l, b.key) && share.place(l, b.key) != Place::Top;
            let (s, c) = if remote { (0, 0) } else { (split.get(b.key), crossing.get(b.key)) };
            let open = if remote { 0 } else { b.bits & !s & !c };
            out.keys.push(b.key);
            out.open.push(open);
            if splits {
                out.split.push(s);
                out.first_child.push(children);
                children += brick::parents(s).count_ones();
            }
            if l < 2 || share.is_shared(l) || remote || !out.places.is_empty() {
                let place = share.place(l, b.key);
                out.places.resize(out.keys.len() - 1, Place::Mine);
                out.places.push(place);
            }
            out.components.push(self.masks.len() as Component);
            let mut rest = open;
            while rest != 0 {
                let one = brick::flood(rest & rest.wrapping_neg(), rest);
                self.masks.push(one);
                rest &= !one;
            }
        }
        out.components
            .push(Component::try_from(self.masks.len()).expect("fewer than 2^32 components"));
        out
    }

    /// Number of components.
    pub fn component_count(&self) -> Component {
        self.masks.len() as Component
    }

    /// Nodes of a level with their keys.
    pub fn keys(&self, l: Level) -> impl Iterator<Item = (Node, u64)> + '_ {
        (0..).zip(self.levels[l as usize].keys.iter().copied())
    }

    /// Number of nodes of a level.
    pub fn len(&self, l: Level) -> usize {
        self.levels[l as usize].keys.len()
    }

    /// Non-crossing leaves of a node.
    #[inline]
    pub fn open(&self, l: Level, n: Node) -> u64 {
        self.levels[l as usize].open[n as usize]
    }

    /// Split octants of a node.
    #[inline]
    pub fn split(&self, l: Level, n: Node) -> u64 {
        self.levels[l as usize].split.get(n as usize).copied().unwrap_or(0)
    }

    /// The child of node `n` whose brick is octant group `j`, if that group is split further.
    #[inline]
    pub fn child(&self, l: Level, n: Node, j: u64) -> Option<(Node, u64)> {
        let split = self.split(l, n);
        let byte = brick::byte(split, j);
        if byte == 0 {
            return None;
        }
        let before = (brick::parents(split) & ((1u16 << j) - 1) as u8).count_ones();
        Some((self.levels[l as usize].first_child[n as usize] + before, brick::children(byte)))
    }

    /// Whose the node's brick is.
    #[inline]
    pub fn place(&self, l: Level, n: Node) -> Place {
        self.levels[l as usize].places.get(n as usize).copied().unwrap_or(Place::Mine)
    }

    /// Components of a node with their octants.
    #[inline]
    pub fn components(&self, l: Level, n: Node) -> impl Iterator<Item = (Component, u64)> + '_ {
        let starts = &self.levels[l as usize].components;
        let range = starts[n as usize]..starts[n as usize + 1];
        range.clone().zip(self.masks[range.start as usize..range.end as usize].iter().copied())
    }

    /// The component of the leaf `bit` of a node; none if that leaf crosses the surface.
    #[inline]
    pub fn component_of(&self, l: Level, n: Node, bit: u64) -> Option<Component> {
        self.components(l, n).find(|c| c.1 >> bit & 1 == 1).map(|c| c.0)
    }

    /// The components that the octants `bits` of brick `key` of level `l` touch: of leaves of that level,
    /// or of the coarser leaves that they lie in; octants that are split have none.
    pub fn meet(&self, l: Level, key: u64, bits: u64, found: &mut Vec<Component>) {
        for bit in ones(bits) {
            found.extend(self.leaf_component(l, key << 6 | u64::from(bit)));
        }
    }

    /// The component of the leaf of level `l` or coarser at an octant.
    fn leaf_component(&self, l: Level, code: u64) -> Option<Component> {
        let mut node = 0;
        for m in 0..=l {
            let at = code >> (3 * (l - m));
            if self.split(m, node) >> (at & 63) & 1 == 0 {
                return self.component_of(m, node, at & 63);
            }
            node = self.child(m, node, at >> 3 & 7)?.0;
        }
        None
    }
}
