//! Merges the components of blocks, within the bricks that this rank holds.
//!
//! A depth-first walk keeps, for each level, the brick on the path from the root and its six face neighbours, so that no neighbour needs a
//! search. The block below a brick is merged with what is across its sides: with leaves of its own level on the lower sides only, so that
//! each pair is merged once, and with coarser leaves on all sides, for which the walk ascends the path until it finds those that cover the
//! octants across. The flood fill of the block has found the coarser leaves of its own region.

use super::masks::{Component, Part};
use super::nodes::{Child, Family, Node, Nodes, UnionFind};
use crate::partition::ownership::{Ownership, Placement};
use bricks::brick::{self, Block, ones};
use bricks::octant::{Level, neighbour};
use bricks::widest;
use std::mem::take;

/// Merged local components, and the faces whose other side only another rank sees.
pub struct LocalMerge {
    /// The sets of components that are merged.
    pub merged: UnionFind,
    /// What other ranks must merge: octants in their bricks that a component of this rank faces, and
    /// components in replicas of bricks that another rank owns.
    pub faces: Vec<FacedOctants>,
    /// Components with a face on the root's boundary; some more than once.
    pub at_boundary: Vec<Component>,
}

/// Octants of a brick that belong to a component or share a face with it. They are leaves, or lie in
/// coarser leaves.
pub struct FacedOctants {
    /// The rank that owns the brick.
    pub rank: usize,
    /// The level of the facing leaf.
    pub level: Level,
    /// The brick, of that level.
    pub key: u64,
    /// The component.
    pub component: Component,
    /// The octants.
    pub bits: u64,
}

/// An axis, and whether it is the upper side along it: 0 or 1.
type Side = (usize, usize);

/// All sides of a brick.
const SIDES: [Side; 6] = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)];

/// The octants of a brick without a face on its surface.
const INNER: u64 = brick::SPANS[0][1][2] & brick::SPANS[1][1][2] & brick::SPANS[2][1][2];

/// The octant groups at each side of a brick, by axis, lower and upper.
const GROUPS: [[[usize; 4]; 2]; 3] =
    [[[0, 2, 4, 6], [1, 3, 5, 7]], [[0, 1, 4, 5], [2, 3, 6, 7]], [[0, 1, 2, 3], [4, 5, 6, 7]]];

/// The other side of a brick's face.
#[derive(Clone, Copy)]
enum Across {
    /// Outside the root.
    Nothing,
    /// Leaves coarser than the brick's octants.
    Coarser,
    /// A brick that this rank does not hold.
    Remote,
    /// A brick of the same level.
    Here(Child),
}

/// A brick with children, on the path from the root.
#[derive(Clone, Copy)]
struct Frame {
    level: Level,
    key: u64,
    brick: Child,
    /// By axis; lower side, upper side.
    across: [[Across; 2]; 3],
}

/// Merges all components that share part of a face, in the bricks that this rank holds. `merged` are the sets that blocks connect.
pub fn merge(nodes: &Nodes, merged: UnionFind, ownership: &Ownership) -> LocalMerge {
    let brick = nodes.root();
    // Enough room for most meshes, so that it does not grow in many steps.
    let mut at_boundary = Vec::with_capacity(1 << 12);
    nodes.masks.brick(brick.part, |c, _| at_boundary.push(c));
    let local = LocalMerge { merged, faces: Vec::new(), at_boundary };
    let mut w = Walk { nodes, ownership, local, path: vec![], mine: vec![], theirs: vec![] };
    w.visit(&Frame { level: 0, key: 0, brick, across: [[Across::Nothing; 2]; 3] });
    w.local
}

struct Walk<'a> {
    nodes: &'a Nodes,
    ownership: &'a Ownership,
    local: LocalMerge,
    /// The bricks on the path from the root, by level.
    path: Vec<Frame>,
    /// The octants of the components of a block, and of one across a face.
    mine: Vec<(Component, Block)>,
    theirs: Vec<(Component, Block)>,
}

widest! {
    /// Merges the components of the block below a brick with those across its faces.
    fn merge_block(walk: &mut Walk, frame: &Frame, family: &Family) = Walk::merge_lanes;
}

impl Walk<'_> {
    fn visit(&mut self, frame: &Frame) {
        let (nodes, l) = (self.nodes, frame.level);
        let family = nodes.family(l, frame.brick.node);
        merge_block(self, frame, &family);
        // Below a local brick all bricks are local.
        let is_local = |n: Node| nodes.placement(l, n) == Placement::Local;
        let is_inner = is_local(frame.brick.node)
            && frame.across.iter().flatten().all(|across| match across {
                Across::Nothing | Across::Coarser => true,
                Across::Remote => false,
                Across::Here(brick) => is_local(brick.node),
            });
        self.path.push(*frame);
        for j in ones(u64::from(family.bricks)).map(u64::from) {
            if !is_inner {
                self.record_faces(frame, &family, j);
            }
            if let Some(child) = self.step_down(frame, &family, j) {
                self.visit(&child);
            }
        }
        self.path.pop();
    }

    #[inline(always)]
    fn merge_lanes(&mut self, frame: &Frame, family: &Family) {
        let mut mine = take(&mut self.mine);
        mine.clear();
        self.nodes.masks.block(family.block(), |c, octants| mine.push((c, octants)));
        if frame.level < 2 {
            // Every octant of levels 0 and 1 has a face on the root's boundary.
            let touches = |octants: &Block| frame.level == 0 || octants[0] & !INNER != 0;
            let at = mine.iter().filter(|(_, octants)| touches(octants));
            self.local.at_boundary.extend(at.map(|(c, _)| c));
        } else {
            for side in SIDES {
                self.merge_side(frame, &mine, side);
            }
        }
        self.mine = mine;
    }

    /// Merges the components of a block with those across one side.
    #[inline(always)]
    fn merge_side(&mut self, frame: &Frame, mine: &[(Component, Block)], side: Side) {
        let (nodes, l, (axis, up)) = (self.nodes, frame.level, side);
        let groups = GROUPS[axis][1 - up];
        let mut leaves = groups.iter().fold(0, |all, j| all | 0xff << (8 * j));
        let mut other = Family::default();
        match frame.across[axis][up] {
            // The other rank merges what is there.
            Across::Remote => return,
            Across::Nothing => leaves = 0,
            Across::Coarser => {}
            Across::Here(brick) if up == 1 => leaves &= !nodes.split(l, brick.node),
            // On the lower side, pairs of leaves of one level are merged.
            Across::Here(brick) => {
                other = nodes.family(l, brick.node);
                leaves &= !other.split;
            }
        }
        self.theirs.clear();
        nodes.masks.block(other.block(), |c, octants| self.theirs.push((c, octants)));
        for (c, octants) in mine {
            let across = |k: usize| brick::across(octants[groups[k] ^ 1 << axis], axis, up == 1);
            let faced = [across(0), across(1), across(2), across(3)];
            if faced[0] | faced[1] | faced[2] | faced[3] == 0 {
                continue;
            }
            for (d, theirs) in &self.theirs {
                if (0..4).fold(0, |all, k| all | faced[k] & theirs[groups[k]]) != 0 {
                    self.local.merged.unite(*c, *d);
                }
            }
            if let Across::Nothing = frame.across[axis][up] {
                self.local.at_boundary.push(*c);
            }
            if leaves != 0 {
                let parents = |k: usize| u64::from(brick::parents(faced[k])) << (8 * groups[k]);
                let coarse = parents(0) | parents(1) | parents(2) | parents(3);
                self.merge_leaves(frame, *c, coarse & leaves, side);
            }
        }
    }

    /// Merges a component with the leaves that cover the octants `faced` of the brick across one side of a brick, none of them split.
    fn merge_leaves(&mut self, frame: &Frame, c: Component, mut faced: u64, side: Side) {
        let (mut frame, (axis, up), mut is_across) = (frame, side, true);
        while faced != 0 {
            let brick = match frame.across[axis][up] {
                _ if !is_across => Some(frame.brick),
                Across::Here(brick) => Some(brick),
                _ => None,
            };
            if let Some(Child { part, exists, .. }) = brick {
                self.nodes.masks.among(part, faced, |d| self.local.merged.unite(c, d));
                faced &= !exists;
            }
            if frame.level == 0 {
                return;
            }
            // The octants lie in the group next to the brick's own, or in its own; in the same parent brick if that group is on the inner side.
            let mut group = frame.key & 7;
            if is_across {
                is_across = group >> axis & 1 == up as u64;
                group ^= 1 << axis;
            }
            faced = u64::from(brick::parents(faced)) << (8 * group);
            frame = &self.path[frame.level as usize - 1];
        }
    }

    /// Records, for the ranks that own them, the octants that components of child brick `j` have or face in other ranks' bricks.
    fn record_faces(&mut self, frame: &Frame, family: &Family, j: u64) {
        let (l, key) = (frame.level + 1, frame.key << 3 | j);
        let Some(Child { node, part, .. }) = family.child(j) else { return };
        match self.nodes.placement(l, node) {
            // The other ranks hold a fully replicated brick as well.
            Placement::FullyReplicated | Placement::Remote(_) => {}
            Placement::PartiallyReplicated if !self.ownership.owns(l, key) => {
                // The owner merges the brick with its neighbours, and this replica's components with its own.
                self.record_face((l, key), part, |bits| bits);
            }
            _ => {
                for (axis, up) in SIDES {
                    if let Across::Remote = self.across(frame, family, j, (axis, up)) {
                        let beside = neighbour(l - 2, key, axis, up == 1);
                        let beside = beside.expect("the neighbour lies in the root");
                        let faced = |bits| brick::across(bits, axis, up == 1);
                        self.record_face((l, beside), part, faced);
                    }
                }
            }
        }
    }

    /// Records, for the owner of a brick, those of its octants that are `faced` by components.
    fn record_face(&mut self, (level, key): (Level, u64), part: Part, faced: impl Fn(u64) -> u64) {
        let rank = self.ownership.owner(level, key);
        self.nodes.masks.brick(part, |component, bits| {
            let bits = faced(bits);
            if bits != 0 {
                self.local.faces.push(FacedOctants { rank, level, key, component, bits });
            }
        });
    }

    /// The frame of child brick `j`; none if it has no children or this rank does not hold it.
    fn step_down(&self, frame: &Frame, family: &Family, j: u64) -> Option<Frame> {
        let (level, key) = (frame.level + 1, frame.key << 3 | j);
        let brick = family.child(j).filter(|child| self.nodes.split(level, child.node) != 0)?;
        let mut across = [[Across::Nothing; 2]; 3];
        if level > 2 {
            for (axis, up) in SIDES {
                across[axis][up] = self.across(frame, family, j, (axis, up));
            }
        }
        Some(Frame { level, key, brick, across })
    }

    /// The other side of a face of child brick `j`.
    #[inline(always)]
    fn across(&self, frame: &Frame, family: &Family, j: u64, (axis, up): Side) -> Across {
        let (nodes, l, beside) = (self.nodes, frame.level, j ^ 1 << axis);
        let child = match frame.across[axis][up] {
            _ if j >> axis & 1 != up as u64 => family.child(beside),
            Across::Here(brick) => nodes.family(l, brick.node).child(beside),
            other => return other,
        };
        match child {
            None => Across::Coarser,
            Some(brick) => match nodes.placement(l + 1, brick.node) {
                Placement::Remote(_) => Across::Remote,
                _ => Across::Here(brick),
            },
        }
    }
}
