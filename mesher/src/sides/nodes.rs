//! The base tree's bricks as a linked tree, with the components inside each brick.
//!
//! Invariants: nodes of a level are in Morton order; a node's children are neighbours in the next
//! level, one per byte of `split` that is not zero; components are numbered through all levels in order.

use crate::brick;
use crate::octant::Level;
use crate::partition::ownership::{Ownership, Placement};
use crate::tree::{LEVELS, Tree};
use std::ops::Range;

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
    /// Empty if nothing is split at the level.
    split: Vec<u64>,
    first_child: Vec<Node>,
    /// First component; one more entry than nodes.
    components: Vec<Component>,
    /// Places of the nodes; empty if all are this rank's alone.
    places: Vec<Placement>,
}

/// A brick with its leaves that do not cross.
pub struct OpenBrick {
    /// Its key.
    pub key: u64,
    /// Its octants that are split.
    pub split: u64,
    /// Its non-crossing leaves.
    pub open: u64,
    /// The rank that holds it, if this one does not; then nothing is known of it.
    pub remote: Option<usize>,
}

/// The bricks of a level, in Morton order: the nodes.
pub fn open_bricks<'a>(
    tree: &'a Tree,
    ownership: &'a Ownership,
    l: Level,
) -> impl Iterator<Item = OpenBrick> + 'a {
    let mut split = tree.split[l as usize].cursor();
    let mut crossing = tree.crossing[l as usize].cursor();
    Tree::exists(&tree.split, l).map(move |b| {
        let place =
            if ownership.owns(l, b.key) { Placement::Local } else { ownership.placement(l, b.key) };
        match place {
            Placement::Remote(r) => OpenBrick { key: b.key, split: 0, open: 0, remote: Some(r) },
            _ => {
                let split = split.get(b.key);
                OpenBrick {
                    key: b.key,
                    split,
                    open: b.bits & !split & !crossing.get(b.key),
                    remote: None,
                }
            }
        }
    })
}

/// A node's children.
#[derive(Clone, Copy)]
pub struct Family {
    split: u64,
    /// One bit for each child brick.
    bricks: u8,
    first: Node,
}

impl Family {
    /// One bit for each octant group whose brick is a child.
    #[inline]
    pub fn bricks(&self) -> u8 {
        self.bricks
    }

    /// The child whose brick is octant group `j`, with the octants that it has; none if that group is not
    /// split further.
    #[inline]
    pub fn child(&self, j: u64) -> Option<(Node, u64)> {
        let before = self.bricks & ((1u16 << j) - 1) as u8;
        let child = self.first + before.count_ones();
        (self.bricks >> j & 1 == 1).then(|| (child, brick::children(brick::byte(self.split, j))))
    }
}

impl Nodes {
    /// Links the bricks of a base tree.
    pub fn new(tree: &Tree, ownership: &Ownership) -> Self {
        let mut nodes = Self { levels: Vec::with_capacity(LEVELS), masks: Vec::new() };
        for l in 0..LEVELS as Level {
            let level = nodes.build(tree, ownership, l);
            nodes.levels.push(level);
        }
        nodes
    }

    fn build(&mut self, tree: &Tree, ownership: &Ownership, l: Level) -> LevelNodes {
        let mut out = LevelNodes::default();
        let splits = !tree.split[l as usize].is_empty();
        let mut children = 0;
        for (n, b) in open_bricks(tree, ownership, l).enumerate() {
            if splits {
                out.split.push(b.split);
                out.first_child.push(children);
                children += brick::parents(b.split).count_ones();
            }
            if l < 2 || ownership.is_replicated(l) || b.remote.is_some() || !out.places.is_empty() {
                out.places.resize(n, Placement::Local);
                out.places.push(ownership.placement(l, b.key));
            }
            out.components.push(self.masks.len() as Component);
            self.masks.extend(brick::components(b.open));
        }
        out.components
            .push(Component::try_from(self.masks.len()).expect("fewer than 2^32 components"));
        out
    }

    /// Forgets how bricks hang together, which is a good part of it all; components stay.
    pub fn forget_links(&mut self) {
        for level in &mut self.levels {
            *level = LevelNodes {
                components: std::mem::take(&mut level.components),
                ..LevelNodes::default()
            };
        }
    }

    /// Number of components.
    pub fn component_count(&self) -> Component {
        self.masks.len() as Component
    }

    /// Number of nodes of a level.
    pub fn len(&self, l: Level) -> Node {
        (self.levels[l as usize].components.len() - 1) as Node
    }

    /// Split octants of a node.
    #[inline]
    pub fn split(&self, l: Level, n: Node) -> u64 {
        self.levels[l as usize].split.get(n as usize).copied().unwrap_or(0)
    }

    /// The children of a node.
    #[inline]
    pub fn family(&self, l: Level, n: Node) -> Family {
        let level = &self.levels[l as usize];
        match level.split.get(n as usize) {
            Some(&split) => {
                let (bricks, first) = (brick::parents(split), level.first_child[n as usize]);
                Family { split, bricks, first }
            }
            None => Family { split: 0, bricks: 0, first: 0 },
        }
    }

    /// Whose the node's brick is.
    #[inline]
    pub fn place(&self, l: Level, n: Node) -> Placement {
        self.levels[l as usize].places.get(n as usize).copied().unwrap_or(Placement::Local)
    }

    /// Components of a node with their octants.
    #[inline]
    pub fn components(&self, l: Level, n: Node) -> impl Iterator<Item = (Component, u64)> + '_ {
        let starts = &self.levels[l as usize].components;
        let range = starts[n as usize]..starts[n as usize + 1];
        range.clone().zip(self.masks[range.start as usize..range.end as usize].iter().copied())
    }

    /// The nodes of a level that may be another's too.
    pub fn shared(&self, l: Level) -> Range<Node> {
        0..self.levels[l as usize].places.len() as Node
    }

    /// To find components by octants.
    pub fn finder(&self) -> Finder<'_> {
        Finder { nodes: self, way: vec![(0, 0)] }
    }
}

/// Finds components by octants, quickly where one question is about the neighbourhood of the one before.
pub struct Finder<'a> {
    nodes: &'a Nodes,
    /// The latest bricks on the way down, by level: key and node.
    way: Vec<(u64, Node)>,
}

impl Finder<'_> {
    /// Tells `found` the components that the octants `bits` of brick `key` of level `l` touch: of leaves of that
    /// level, or of the coarser leaves that they lie in; octants that are split have none.
    pub fn meet(&mut self, l: Level, key: u64, bits: u64, mut found: impl FnMut(Component)) {
        let nodes = self.nodes;
        let on_the_way =
            |(m, way): (Level, &(u64, Node))| m <= l && way.0 == brick_above(l, key, m);
        let known = (0..).zip(&self.way).take_while(|&way| on_the_way(way)).count();
        self.way.truncate(known);
        // That a brick is there means that the octant is split which it fills, two levels above.
        for m in (known as Level).saturating_sub(2)..=l {
            let node = self.way[m as usize].1;
            // Down to two levels above, the octants lie in one; then in those of one group; then they are told apart.
            let here = match l - m {
                0 => bits,
                1 => u64::from(brick::parents(bits)) << (8 * (key & 7)),
                up => 1 << (key >> (3 * (up - 2)) & 63),
            };
            let split = nodes.split(m, node);
            let leaves = here & !split;
            nodes.components(m, node).filter(|c| c.1 & leaves != 0).for_each(|c| found(c.0));
            if here & split == 0 || m == l {
                return;
            }
            if self.way.len() == m as usize + 1 {
                let below = brick_above(l, key, m + 1);
                let Some((node, _)) = nodes.family(m, node).child(below & 7) else { return };
                self.way.push((below, node));
            }
        }
    }
}

/// The key of the brick of level `m` that a brick of level `l` lies in.
#[inline]
fn brick_above(l: Level, key: u64, m: Level) -> u64 {
    key >> (3 * (l - m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::Brick;
    use crate::brickset::BrickSet;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Deepest level of the trees here.
    const DEEPEST: Level = 6;

    fn of_codes(codes: &BTreeSet<u64>) -> BrickSet {
        BrickSet::from_unsorted(
            codes.iter().map(|c| Brick { key: c >> 6, bits: 1 << (c & 63) }).collect(),
        )
    }

    /// Some octants of the last level with all above them split; of the leaves every third crosses.
    fn tree(deepest: &[u64]) -> Tree {
        let mut tree = Tree::default();
        for l in 0..DEEPEST {
            let up = |code: &u64| (code % (1 << (3 * DEEPEST))) >> (3 * (DEEPEST - l));
            tree.split[l as usize] = of_codes(&deepest.iter().map(up).collect());
        }
        for l in 0..=DEEPEST as usize {
            let leaf = |code: &u64| !tree.split[l].contains(*code);
            let leaves = Tree::exists(&tree.split, l as Level)
                .flat_map(|b| {
                    crate::brickset::ones(b.bits).map(move |bit| b.key << 6 | u64::from(bit))
                })
                .filter(leaf);
            tree.crossing[l] = of_codes(&leaves.step_by(3).collect());
        }
        tree
    }

    /// The component of the leaf that an octant is or lies in, found without links; none if that crosses, or if it is split.
    fn component_of(nodes: &Nodes, tree: &Tree, l: Level, code: u64) -> Option<Component> {
        let exists =
            |m: Level| m == 0 || tree.split[m as usize - 1].contains(code >> (3 * (l - m) + 3));
        let m = (0..=l).rev().find(|&m| exists(m))?;
        let at = code >> (3 * (l - m));
        let node = Tree::exists(&tree.split, m).position(|b| b.key == at >> 6)?;
        let mut there = nodes.components(m, node as Node);
        there.find(|c| c.1 >> (at & 63) & 1 == 1).map(|c| c.0)
    }

    proptest! {
        #[test]
        fn components_are_found_whatever_was_asked_before(
            deepest in prop::collection::vec(any::<u64>(), 1..20),
            asked in prop::collection::vec((2..=DEEPEST, any::<prop::sample::Index>(), 0u64..80, any::<u64>()), 1..40),
        ) {
            let tree = tree(&deepest);
            tree.check_structure();
            let nodes = Nodes::new(&tree, &Ownership::solo());
            let mut finder = nodes.finder();
            for (l, near, beside, bits) in asked {
                // Near a place where the tree is deep, as neighbours' octants are.
                let place = (near.get(&deepest) % (1 << (3 * DEEPEST))) >> (3 * (DEEPEST - l));
                let key = (place ^ beside) >> 6;
                let mut found = BTreeSet::new();
                finder.meet(l, key, bits, |c| _ = found.insert(c));
                let codes = crate::brickset::ones(bits).map(|bit| key << 6 | u64::from(bit));
                let want: BTreeSet<Component> =
                    codes.filter_map(|code| component_of(&nodes, &tree, l, code)).collect();
                prop_assert_eq!(found, want, "level {} key {}", l, key);
            }
        }
    }
}
