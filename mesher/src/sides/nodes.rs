//! The base tree's bricks as a linked tree, with the components of their leaves.
//!
//! The child bricks of a brick are a *block* of 8 x 8 x 8 octants. A flood fill finds what is connected in a block, through leaves of
//! the two levels above, too. So only faces between blocks remain to be looked at, and few components to be united.
//!
//! Invariants:
//! - the nodes of a level are in Morton order;
//! - the children of a node are contiguous in the next level, one for each non-zero byte of `split`;
//! - components are numbered through all levels in order; each is a set of leaves of one block, and no leaf is in two.

use super::masks::{Component, Masks, Part};
use crate::partition::ownership::{Ownership, Placement};
use bricks::brick::{self, Block, Brick, ones};
use bricks::octant::Level;
use bricks::tree::{LEVELS, Tree};
use bricks::widest;

/// Number of a node within its level.
pub type Node = u32;

/// All bricks that this rank holds, and placeholders for those children of its bricks that it does not hold.
#[derive(Default)]
pub struct Nodes {
    levels: Vec<LevelNodes>,
    /// The octants of the components.
    pub masks: Masks,
}

#[derive(Default)]
struct LevelNodes {
    /// Split octants of each node; empty if no octant of the level is split.
    split: Vec<u64>,
    /// Where the block below each node of the level above begins, and the end. A block of its own has the brick of level 0.
    blocks: BlockStarts,
    /// Placements of the first nodes; the others are local.
    placements: Vec<Placement>,
}

/// The first node and the first component of a block, and where the octants of its components begin.
type BlockStart = [u32; 3];

/// The components of brick `brick` of a block, which ends where another starts.
#[inline(always)]
fn part_of([[_, component, word], [_, end, _]]: [BlockStart; 2], brick: u8) -> Part {
    Part { components: [component, end], word, brick }
}

/// Number of blocks in a group.
const GROUP: usize = 64;

/// The starts of blocks in order, in groups: that of the first, and how much greater the numbers of each are. That takes half of the memory.
#[derive(Default)]
struct BlockStarts {
    groups: Vec<(BlockStart, [[u16; 3]; GROUP])>,
    len: usize,
}

impl BlockStarts {
    fn push(&mut self, block: BlockStart) {
        if self.len.is_multiple_of(GROUP) {
            self.groups.push((block, [[0; 3]; GROUP]));
        }
        let (first, offsets) = self.groups.last_mut().expect("a group has begun");
        // A block has at most 8 nodes and 512 words, and no more components; the end of a chunk is one block more.
        let offset = |k| u16::try_from(block[k] - first[k]).expect("fewer than 2^16 in a group");
        offsets[self.len % GROUP] = std::array::from_fn(offset);
        self.len += 1;
    }

    #[inline(always)]
    fn get(&self, block: usize) -> BlockStart {
        let (first, offsets) = &self.groups[block / GROUP];
        std::array::from_fn(|k| first[k] + u32::from(offsets[block % GROUP][k]))
    }
}

/// The start of the block below a node, that of the next block, and the number of the block after that.
#[derive(Clone, Copy, Default)]
struct Parent {
    block: [BlockStart; 2],
    next: usize,
}

/// Sets of numbers from 0. The least number represents a set.
pub struct UnionFind(Vec<u32>);

impl UnionFind {
    /// Numbers below `count`, each in a set of its own.
    pub fn new(count: u32) -> Self {
        Self((0..count).collect())
    }

    /// The representative of a number.
    #[inline]
    pub fn find(&mut self, mut c: u32) -> u32 {
        while self.0[c as usize] != c {
            let up = self.0[self.0[c as usize] as usize];
            self.0[c as usize] = up;
            c = up;
        }
        c
    }

    /// The set of each number; the sets are numbered from 0.
    pub fn numbered(self) -> Vec<u32> {
        let mut merged = self.0;
        let mut count = 0;
        for c in 0..merged.len() {
            // A parent in the union-find has a lower number than its child, so it is numbered already.
            let up = merged[c] as usize;
            merged[c] = if up == c { count } else { merged[up] };
            count += u32::from(up == c);
        }
        merged
    }

    /// Unites the sets of two numbers.
    #[inline]
    pub fn unite(&mut self, a: u32, b: u32) {
        // Most pairs have been united before and have the same parent.
        if self.0[a as usize] == self.0[b as usize] {
            return;
        }
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
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
pub fn open_bricks(tree: &Tree, owners: &Ownership, l: Level) -> impl Iterator<Item = OpenBrick> {
    let [mut split, mut crossing] = [&tree.split, &tree.crossing].map(|s| s[l as usize].cursor());
    Tree::exists(&tree.split, l).map(move |Brick { key, bits }| {
        let is_local = !owners.is_replicated(l) && owners.owns(l, key);
        let placement = if is_local { Placement::Local } else { owners.placement(l, key) };
        if let Placement::Remote(_) = placement {
            return OpenBrick { key, split: 0, open: 0, placement };
        }
        let split = split.get(key);
        OpenBrick { key, split, open: bits & !split & !crossing.get(key), placement }
    })
}

/// A node's children.
#[derive(Clone, Copy, Debug, Default)]
pub struct Family {
    /// The node's split octants.
    pub split: u64,
    /// Mask of the octant groups that have a child brick.
    pub bricks: u8,
    block: [BlockStart; 2],
}

/// A child brick.
#[derive(Clone, Copy, Debug)]
pub struct Child {
    /// Its node.
    pub node: Node,
    /// Its octants that exist.
    pub exists: u64,
    /// Its components.
    pub part: Part,
}

impl Family {
    /// The components of the children.
    #[inline(always)]
    pub fn block(&self) -> Part {
        part_of(self.block, 0)
    }

    /// The child brick below octant group `j`; none if no octant of the group is split.
    #[inline(always)]
    pub fn child(&self, j: u64) -> Option<Child> {
        let before = u32::from(self.bricks & ((1u16 << j) - 1) as u8).count_ones();
        (self.bricks >> j & 1 == 1).then(|| Child {
            node: self.block[0][0] + before,
            exists: brick::children(brick::byte(self.split, j)),
            part: part_of(self.block, j as u8),
        })
    }
}

/// A block whose components are looked for.
#[derive(Default)]
struct NewBlock {
    /// Its non-crossing leaves.
    open: Block,
    /// The key of the brick above it.
    key: u64,
    /// The components of this brick, and of the brick above that, as far as there are such bricks.
    parents: Vec<Part>,
    /// Components of these, with the octants of the block that they fill.
    above: Vec<(Component, Block)>,
    /// The components, each with one of the levels above that it is connected to, if there is one. Leaves of these levels may be all that
    /// connects its leaves.
    found: Vec<(Option<Component>, Block)>,
}

widest! {
    /// Finds what is connected in a block, and unites those of the levels above that it connects.
    fn fill(block: &mut NewBlock, masks: &mut Masks, sets: &mut UnionFind) = fill_lanes;
}

#[inline(always)]
fn fill_lanes(block: &mut NewBlock, masks: &mut Masks, sets: &mut UnionFind) {
    let NewBlock { open, key, parents, above, found } = block;
    let and = |a, b| a & b;
    above.clear();
    for (up, part) in parents.iter().enumerate() {
        masks.brick(*part, |c, bits| {
            let fill = |j| match up {
                0 => brick::children(brick::byte(bits, j as u64)),
                _ => u64::from(brick::byte(bits, *key & 7) >> j & 1).wrapping_neg(),
            };
            above.push((c, std::array::from_fn(fill)));
        });
    }
    // What is in no component yet.
    let mut free = above.iter().fold(*open, |all, (_, w)| both(&all, w, |a, b| a | b));
    let within = brick::layers(free);
    found.clear();
    let grow = |seed| brick::layers(brick::flood_layers(brick::layers(seed), &within));
    for &(c, seed) in above.iter() {
        for (other, _) in found.iter().filter(|(_, w)| brick::any(&both(w, &seed, and))) {
            sets.unite(other.expect("found above"), c);
        }
        let seed = both(&seed, &free, and);
        if brick::any(&seed) {
            found.push((Some(c), grow(seed)));
            free = both(&free, &found[found.len() - 1].1, |a, b| a & !b);
        }
    }
    while let Some(j) = (0..8).find(|&j| open[j] & free[j] != 0) {
        let (mut seed, bits) = ([0; 8], open[j] & free[j]);
        seed[j] = bits & bits.wrapping_neg();
        found.push((None, grow(seed)));
        free = both(&free, &found[found.len() - 1].1, |a, b| a & !b);
    }
    for (above, w) in found {
        let octants = both(w, open, and);
        if brick::any(&octants) {
            let set = above.map_or(sets.0.len() as Component, |above| sets.find(above));
            sets.0.push(set);
            masks.push(&octants);
        }
    }
}

#[inline(always)]
fn both(a: &Block, b: &Block, f: impl Fn(u64, u64) -> u64) -> Block {
    std::array::from_fn(|j| f(a[j], b[j]))
}

impl Nodes {
    /// Links the bricks of a base tree and finds the components of its blocks; those that a block connects are united.
    pub fn new(tree: &Tree, ownership: &Ownership) -> (Self, UnionFind) {
        let (mut nodes, mut sets) = (Self::default(), UnionFind::new(0));
        let mut block = NewBlock::default();
        for l in 0..LEVELS as Level {
            let mut level = LevelNodes::default();
            let has_split = !tree.split[l as usize].is_empty();
            let mut bricks = open_bricks(tree, ownership, l);
            // The bricks above a block, one and two levels.
            let (mut node, mut parents) = (0, [Parent::default(); 2]);
            for above in 0..l.checked_sub(1).map_or(1, |l| nodes.levels[l as usize].split.len()) {
                let split = if l == 0 { 1 } else { nodes.split(l - 1, above as Node) };
                level.blocks.push(nodes.block_start(node));
                if split == 0 {
                    continue;
                }
                block.open = [0; 8];
                for j in ones(brick::parents(split).into()) {
                    let b = bricks.next().expect("split octants have a brick below");
                    (block.key, block.open[j as usize]) = (b.key >> 3, b.open);
                    if b.placement != Placement::Local {
                        level.placements.resize(node as usize, Placement::Local);
                        level.placements.push(b.placement);
                    }
                    if has_split {
                        level.split.push(b.split);
                    }
                    node += 1;
                }
                block.parents.clear();
                let mut child = above;
                for (up, parent) in (1..=l).zip(&mut parents) {
                    let place = (block.key >> (3 * (up - 1)) & 7) as u8;
                    block.parents.push(nodes.part(l - up, child as Node, place, parent));
                    child = parent.next - 2;
                }
                fill(&mut block, &mut nodes.masks, &mut sets);
            }
            level.blocks.push(nodes.block_start(node));
            nodes.levels.push(level);
        }
        (nodes, sets)
    }

    fn block_start(&mut self, node: Node) -> BlockStart {
        let (component, word) = self.masks.begin();
        [node, component, word]
    }

    /// The components of a node of level `l` at place `brick` of its block, whose parent is not before `parent`, which becomes the parent.
    #[inline(always)]
    fn part(&self, l: Level, node: Node, brick: u8, parent: &mut Parent) -> Part {
        while parent.block[1][0] <= node {
            let next = self.levels[l as usize].blocks.get(parent.next);
            *parent = Parent { next: parent.next + 1, block: [parent.block[1], next] };
        }
        part_of(parent.block, brick)
    }

    /// The bricks of a level of the tree, with their components.
    pub fn bricks(&self, tree: &Tree, l: Level) -> impl Iterator<Item = (Brick, Part)> {
        let (mut node, mut parent) = (0, Parent::default());
        Tree::exists(&tree.split, l).map(move |b| {
            let part = self.part(l, node, (b.key & 7) as u8, &mut parent);
            node += 1;
            (b, part)
        })
    }

    /// Frees the links between bricks, which take much of the memory; the components remain.
    pub fn drop_links(&mut self) {
        self.levels.iter_mut().for_each(|level| level.split = Vec::new());
    }

    /// Bytes that the nodes and their components take.
    pub fn bytes(&self) -> usize {
        let of_level = |l: &LevelNodes| size_of_val(&*l.split) + size_of_val(&*l.blocks.groups);
        self.levels.iter().map(of_level).sum::<usize>() + self.masks.bytes()
    }

    /// The brick of level 0.
    pub fn root(&self) -> Child {
        Child { node: 0, exists: 1, part: self.part(0, 0, 0, &mut Parent::default()) }
    }

    /// The split octants of a node.
    pub fn split(&self, l: Level, n: Node) -> u64 {
        self.levels[l as usize].split.get(n as usize).copied().unwrap_or(0)
    }

    /// The children of a node.
    #[inline(always)]
    pub fn family(&self, l: Level, n: Node) -> Family {
        let split = self.split(l, n);
        if split == 0 {
            return Family::default();
        }
        let blocks = &self.levels[l as usize + 1].blocks;
        let block = [blocks.get(n as usize), blocks.get(n as usize + 1)];
        Family { split, bricks: brick::parents(split), block }
    }

    /// The placement of the node's brick.
    pub fn placement(&self, l: Level, n: Node) -> Placement {
        self.levels[l as usize].placements.get(n as usize).copied().unwrap_or(Placement::Local)
    }

    /// The components of fully replicated bricks, brick by brick in an order that is the same on all ranks.
    pub fn replicated(&self, tree: &Tree) -> impl Iterator<Item = Part> {
        (0..).zip(&self.levels).flat_map(|(l, level)| {
            let nodes = self.bricks(tree, l).zip(&level.placements);
            nodes.filter(|node| *node.1 == Placement::FullyReplicated).map(|node| node.0.1)
        })
    }

    /// Checks the invariants, with the links.
    ///
    /// # Panics
    /// If one is violated; the message names it, the level, and a node or a block.
    pub fn check_invariants(&self) {
        for (l, level) in (0..).zip(&self.levels) {
            for (n, &split) in (0..).zip(&level.split) {
                let [start, end] = [n, n + 1].map(|n| self.levels[l as usize + 1].blocks.get(n)[0]);
                let children = brick::parents(split).count_ones();
                assert_eq!(start + children, end, "children of node {n} of level {l} must follow");
            }
            for n in 0..level.blocks.len - 1 {
                let (mut all, block) = ([0; 8], [n, n + 1].map(|n| level.blocks.get(n)));
                self.masks.block(part_of(block, 0), |_, octants| {
                    let has_common = brick::any(&both(&all, &octants, |a, b| a & b));
                    assert!(!has_common, "block {n} of level {l}: a leaf has two components");
                    all = both(&all, &octants, |a, b| a | b);
                });
            }
        }
    }

    /// Calls `found` with the components of the octants `bits` of brick `key` of level `l`: of the leaves of that
    /// level, or of the coarser leaves that contain them. Octants that are split have no component. `path` has the bricks on the way to
    /// another brick, by level, empty at first; afterwards those on the way to this one.
    pub fn find(
        &self,
        path: &mut Vec<(u64, Child)>,
        l: Level,
        key: u64,
        bits: u64,
        mut found: impl FnMut(Component),
    ) {
        let common =
            (0..=l).zip(&*path).take_while(|&(m, at)| at.0 == key >> (3 * (l - m))).count();
        path.truncate(common);
        if common == 0 {
            path.push((0, self.root()));
        }
        // Where two bricks of the path follow on one, its octant that contains `bits` is split.
        for m in common.saturating_sub(2) as Level..=l {
            let brick = path[m as usize].1;
            // At two levels above `l` and higher, one octant contains all of `bits`; at one level above, those of
            // one sibling group do.
            let octants = match l - m {
                0 => bits,
                1 => u64::from(brick::parents(bits)) << (8 * (key & 7)),
                up => 1 << (key >> (3 * (up - 2)) & 63),
            };
            let family = self.family(m, brick.node);
            let leaves = octants & !family.split;
            if leaves != 0 {
                self.masks.among(brick.part, leaves, &mut found);
            }
            if leaves == octants || m == l {
                return;
            }
            if path.len() == m as usize + 1 {
                let below = key >> (3 * (l - m - 1));
                let Some(child) = family.child(below & 7) else { return };
                path.push((below, child));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sides::components;
    use crate::tests::set;
    use bricks::brick::ones;
    use bricks::wide::widths;
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
        let mut found = None;
        nodes.masks.brick(nodes.bricks(tree, m).nth(node)?.1, |c, bits| {
            if bits >> (at & 63) & 1 == 1 {
                found = Some(c);
            }
        });
        found
    }

    proptest! {
        #[test]
        fn components_are_found_by_their_octants(
            deepest in prop::collection::vec(any::<u64>(), 1..20),
            queries in prop::collection::vec((2..=DEEPEST, any::<prop::sample::Index>(), 0u64..80, any::<u64>()), 1..40),
        ) {
            let tree = tree(&deepest);
            tree.check_structure();
            let (nodes, _) = Nodes::new(&tree, &Ownership::solo());
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
    fn all_widths_find_the_same_components() {
        let tree = tree(&[0, 0o777777, 0o123456, 0o123457, 0o070707, 0o654321, 0o111222, 0o333444]);
        let found = widths(|| {
            let (nodes, sets) = Nodes::new(&tree, &Ownership::solo());
            let merged = components::merge(&nodes, sets, &Ownership::solo()).merged.numbered();
            (nodes.masks, merged)
        });
        assert!(found.iter().all(|(_, of)| *of == found[0].1 && of.1.len() > 10));
    }

    #[test]
    #[should_panic(expected = "children of node 1 of level 4 must follow")]
    fn a_wrong_link_is_found() {
        let (mut nodes, _) = Nodes::new(&tree(&[0, 1 << 12]), &Ownership::solo());
        nodes.levels[5].blocks.groups[0].1[2][0] += 1;
        nodes.check_invariants();
    }

    #[test]
    #[should_panic(expected = "block 0 of level 1: a leaf has two components")]
    fn a_leaf_of_two_components_is_found() {
        let (mut nodes, _) = Nodes::new(&tree(&[0]), &Ownership::solo());
        // The first component of the next block becomes one of this block, too.
        nodes.levels[1].blocks.groups[0].1[1][1] += 1;
        nodes.check_invariants();
    }
}
