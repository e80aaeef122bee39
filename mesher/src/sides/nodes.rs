//! The base tree's bricks as a linked tree, with the local components of each brick.
//!
//! Invariants:
//! - the nodes of a level are in Morton order;
//! - the children of a node are contiguous in the next level, one for each non-zero byte of `split`;
//! - components are numbered through all levels in order, and each is a non-empty set of octants that
//!   are connected over faces within the brick.

use crate::partition::ownership::{Ownership, Placement};
use bricks::brick::{self, Brick};
use bricks::octant::Level;
use bricks::tree::{LEVELS, Tree};

/// Number of a local component: leaves of one brick that are connected over faces.
pub type Component = u32;

/// Number of a node within its level.
pub type Node = u32;

/// All bricks that this rank holds, and placeholders for those children of its bricks that it does not hold.
pub struct Nodes {
    levels: Vec<LevelNodes>,
    masks: Vec<u64>,
}

#[derive(Default)]
struct LevelNodes {
    /// Split octants of each node; empty if no octant of the level is split.
    split: Vec<u64>,
    first_child: Vec<Node>,
    /// First component of each node, and the end: one entry more than nodes.
    components: Vec<Component>,
    /// Placements of the first nodes; the others are local.
    placements: Vec<Placement>,
}

/// A brick and its non-crossing leaves. Of a brick that this rank does not hold, no octants are known.
pub struct OpenBrick {
    /// Its key.
    pub key: u64,
    /// Its octants that are split.
    pub split: u64,
    /// Its non-crossing leaves.
    pub open: u64,
    /// Which ranks hold it.
    pub placement: Placement,
}

/// The bricks of a level in Morton order: one for each node.
pub fn open_bricks<'a>(
    tree: &'a Tree,
    ownership: &'a Ownership,
    l: Level,
) -> impl Iterator<Item = OpenBrick> + 'a {
    let mut split = tree.split[l as usize].cursor();
    let mut crossing = tree.crossing[l as usize].cursor();
    Tree::exists(&tree.split, l).map(move |Brick { key, bits }| {
        let is_local = !ownership.is_replicated(l) && ownership.owns(l, key);
        let placement = if is_local { Placement::Local } else { ownership.placement(l, key) };
        if let Placement::Remote(_) = placement {
            return OpenBrick { key, split: 0, open: 0, placement };
        }
        let split = split.get(key);
        OpenBrick { key, split, open: bits & !split & !crossing.get(key), placement }
    })
}

/// A node's children.
#[derive(Clone, Copy, Default)]
pub struct Family {
    /// The node's split octants.
    pub split: u64,
    /// Mask of the octant groups that have a child brick.
    pub bricks: u8,
    first: Node,
}

impl Family {
    /// The child brick below octant group `j` and the mask of its octants that exist; none if no octant of
    /// the group is split.
    #[inline]
    pub fn child(&self, j: u64) -> Option<(Node, u64)> {
        let before = self.bricks & ((1u16 << j) - 1) as u8;
        let child = self.first + before.count_ones();
        (self.bricks >> j & 1 == 1).then(|| (child, brick::children(brick::byte(self.split, j))))
    }
}

impl Nodes {
    /// Links the bricks of a base tree and finds their local components.
    pub fn new(tree: &Tree, ownership: &Ownership) -> Self {
        let (mut levels, mut masks) = (Vec::with_capacity(LEVELS), Vec::new());
        for l in 0..LEVELS as Level {
            let mut out = LevelNodes::default();
            let splits = !tree.split[l as usize].is_empty();
            let mut children = 0;
            open_bricks(tree, ownership, l).for_each(|b| {
                if splits {
                    out.split.push(b.split);
                    out.first_child.push(children);
                    children += brick::parents(b.split).count_ones();
                }
                if b.placement != Placement::Local {
                    out.placements.resize(out.components.len(), Placement::Local);
                    out.placements.push(b.placement);
                }
                out.components.push(masks.len() as Component);
                masks.extend(brick::components(b.open));
            });
            let end = Component::try_from(masks.len()).expect("fewer than 2^32 components");
            out.components.push(end);
            levels.push(out);
        }
        Self { levels, masks }
    }

    /// Frees the links between bricks, which take much of the memory; the components remain.
    pub fn drop_links(&mut self) {
        for level in &mut self.levels {
            let components = std::mem::take(&mut level.components);
            *level = LevelNodes { components, ..LevelNodes::default() };
        }
    }

    /// Bytes that the nodes and their components take.
    pub fn bytes(&self) -> usize {
        let of_level = |level: &LevelNodes| {
            let numbers = level.first_child.len() + level.components.len();
            size_of_val(&level.split[..]) + numbers * size_of::<u32>()
        };
        self.levels.iter().map(of_level).sum::<usize>() + size_of_val(&self.masks[..])
    }

    /// Number of local components.
    pub fn component_count(&self) -> Component {
        self.masks.len() as Component
    }

    /// The children of a node.
    #[inline]
    pub fn family(&self, l: Level, n: Node) -> Family {
        let level = &self.levels[l as usize];
        level.split.get(n as usize).map_or(Family::default(), |&split| {
            let (bricks, first) = (brick::parents(split), level.first_child[n as usize]);
            Family { split, bricks, first }
        })
    }

    /// The placement of the node's brick.
    #[inline]
    pub fn placement(&self, l: Level, n: Node) -> Placement {
        self.levels[l as usize].placements.get(n as usize).copied().unwrap_or(Placement::Local)
    }

    /// The components of a node, with their octants.
    #[inline]
    pub fn components(&self, l: Level, n: Node) -> impl Iterator<Item = (Component, u64)> + '_ {
        let starts = &self.levels[l as usize].components;
        let range = starts[n as usize]..starts[n as usize + 1];
        range.clone().zip(self.masks[range.start as usize..range.end as usize].iter().copied())
    }

    /// The components of fully replicated bricks, in an order that is the same on all ranks.
    pub fn replicated_components(&self) -> Vec<Component> {
        let of_level = |(l, level): (Level, &LevelNodes)| {
            let nodes = (0..).zip(level.placements.clone());
            let replicated = nodes.filter(|node| node.1 == Placement::FullyReplicated);
            replicated.flat_map(move |(n, _)| self.components(l, n).map(|c| c.0))
        };
        (0..).zip(&self.levels).flat_map(of_level).collect()
    }

    /// Checks the invariants, with the links.
    ///
    /// # Panics
    /// If one is violated; the message names it, the level and a node.
    pub fn check_invariants(&self) {
        let mut component = 0;
        for (l, level) in self.levels.iter().enumerate() {
            let mut child = 0;
            for (n, (&first, &split)) in level.first_child.iter().zip(&level.split).enumerate() {
                assert_eq!(first, child, "children of node {n} of level {l} must be contiguous");
                child += brick::parents(split).count_ones();
            }
            let next = self.levels.get(l + 1).map_or(0, |next| next.components.len() as Node - 1);
            assert_eq!(child, next, "each node of level {} must be a child", l + 1);
            for (n, range) in level.components.windows(2).enumerate() {
                assert_eq!(range[0], component, "components of node {n} of level {l} must follow");
                for &mask in &self.masks[range[0] as usize..range[1] as usize] {
                    let connected = brick::flood(mask & mask.wrapping_neg(), mask);
                    assert!(mask != 0 && connected == mask, "node {n} of level {l}: {mask:#x}");
                }
                component = range[1];
            }
        }
        assert_eq!(component, self.component_count(), "each component must belong to a node");
    }

    /// Calls `found` with the components of the octants `bits` of brick `key` of level `l`: of the leaves of that
    /// level, or of the coarser leaves that contain them. Octants that are split have no component. `path` has the bricks on the way to
    /// another brick, by level, empty at first; afterwards those on the way to this one.
    pub fn find(
        &self,
        path: &mut Vec<(u64, Node)>,
        l: Level,
        key: u64,
        bits: u64,
        mut found: impl FnMut(Component),
    ) {
        let common =
            (0..=l).zip(&*path).take_while(|&(m, at)| at.0 == key >> (3 * (l - m))).count();
        path.truncate(common);
        if common == 0 {
            path.push((0, 0));
        }
        // Where two bricks of the path follow on one, its octant that contains `bits` is split.
        for m in common.saturating_sub(2) as Level..=l {
            let node = path[m as usize].1;
            // At two levels above `l` and higher, one octant contains all of `bits`; at one level above, those of
            // one sibling group do.
            let octants = match l - m {
                0 => bits,
                1 => u64::from(brick::parents(bits)) << (8 * (key & 7)),
                up => 1 << (key >> (3 * (up - 2)) & 63),
            };
            let family = self.family(m, node);
            let leaves = octants & !family.split;
            if leaves != 0 {
                self.components(m, node).filter(|c| c.1 & leaves != 0).for_each(|c| found(c.0));
            }
            if leaves == octants || m == l {
                return;
            }
            if path.len() == m as usize + 1 {
                let below = key >> (3 * (l - m - 1));
                let Some((child, _)) = family.child(below & 7) else { return };
                path.push((below, child));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::set;
    use bricks::brickset::ones;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Deepest level of the trees octants.
    const DEEPEST: Level = 6;

    /// A tree with the given octants at its deepest level; every third of its leaves is crossing.
    fn tree(deepest: &[u64]) -> Tree {
        let mut tree = Tree::default();
        for l in 0..DEEPEST {
            let up = |code: &u64| (code % (1 << (3 * DEEPEST))) >> (3 * (DEEPEST - l));
            tree.split[l as usize] = set(&deepest.iter().map(up).collect::<BTreeSet<u64>>());
        }
        for l in 0..=DEEPEST as usize {
            let leaf = |code: &u64| !tree.split[l].contains(*code);
            let leaves = Tree::exists(&tree.split, l as Level)
                .flat_map(|b| ones(b.bits).map(move |bit| b.key << 6 | u64::from(bit)))
                .filter(leaf);
            tree.crossing[l] = set(&leaves.step_by(3).collect::<BTreeSet<u64>>());
        }
        tree
    }

    /// The component of the leaf that is or contains an octant, found without links; none if this leaf crosses,
    /// or if the octant is split.
    fn component_of(nodes: &Nodes, tree: &Tree, l: Level, code: u64) -> Option<Component> {
        let exists =
            |m: Level| m == 0 || tree.split[m as usize - 1].contains(code >> (3 * (l - m) + 3));
        let m = (0..=l).rev().find(|&m| exists(m))?;
        let at = code >> (3 * (l - m));
        let node = Tree::exists(&tree.split, m).position(|b| b.key == at >> 6)?;
        let mut components = nodes.components(m, node as Node);
        components.find(|c| c.1 >> (at & 63) & 1 == 1).map(|c| c.0)
    }

    proptest! {
        #[test]
        fn components_are_found_by_their_octants(
            deepest in prop::collection::vec(any::<u64>(), 1..20),
            queries in prop::collection::vec((2..=DEEPEST, any::<prop::sample::Index>(), 0u64..80, any::<u64>()), 1..40),
        ) {
            let tree = tree(&deepest);
            tree.check_structure();
            let nodes = Nodes::new(&tree, &Ownership::solo());
            nodes.check_invariants();
            let mut path = Vec::new();
            for (l, near, offset, bits) in queries {
                // Near a region where the tree is deep, as queries by neighbouring ranks are.
                let place = (near.get(&deepest) % (1 << (3 * DEEPEST))) >> (3 * (DEEPEST - l));
                let key = (place ^ offset) >> 6;
                let mut found = BTreeSet::new();
                nodes.find(&mut path, l, key, bits, |c| _ = found.insert(c));
                let codes = ones(bits).map(|bit| key << 6 | u64::from(bit));
                let want: BTreeSet<Component> =
                    codes.filter_map(|code| component_of(&nodes, &tree, l, code)).collect();
                prop_assert_eq!(found, want, "level {} key {}", l, key);
            }
        }
    }

    #[test]
    #[should_panic(expected = "children of node 1 of level 4 must be contiguous")]
    fn a_wrong_link_is_found() {
        let mut nodes = Nodes::new(&tree(&[0, 1 << 12]), &Ownership::solo());
        nodes.levels[4].first_child[1] += 1;
        nodes.check_invariants();
    }

    #[test]
    #[should_panic(expected = "node 0 of level 1: 0x81")]
    fn a_component_of_two_parts_is_found() {
        let mut nodes = Nodes::new(&tree(&[0]), &Ownership::solo());
        let first = nodes.levels[1].components[0];
        nodes.masks[first as usize] = 0x81;
        nodes.check_invariants();
    }
}
