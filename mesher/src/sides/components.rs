//! Merges the local components of bricks, within the bricks that this rank holds.
//!
//! A depth-first walk keeps, for each level, the brick on the path from the root and its six face
//! neighbours, so that no neighbour needs a search. Two leaves of one level are merged from the upper
//! side of their common face, as the walk has met the lower one recently. Two leaves of different levels are merged from the finer one: the walk
//! ascends the path until it finds the leaf that covers the octant across the face.

use super::nodes::{Component, Family, Node, Nodes};
use crate::partition::ownership::{Ownership, Placement};
use bricks::brick;
use bricks::brickset::ones;
use bricks::octant::{Level, neighbour};

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// The other side of a brick's face.
#[derive(Clone, Copy)]
enum Across {
    /// Outside the root.
    Nothing,
    /// Leaves coarser than the brick's octants.
    Coarser,
    /// A brick that this rank does not hold.
    Remote,
    /// A brick of the same level: its node, and the mask of its octants that exist.
    Here(Node, u64),
}

/// A brick on the path from the root.
#[derive(Clone, Copy)]
struct Frame {
    level: Level,
    key: u64,
    node: Node,
    exists: u64,
    /// By axis; lower side, upper side.
    across: [[Across; 2]; 3],
}

/// Merges all components that share part of a face, in the bricks that this rank holds.
pub fn merge(nodes: &Nodes, ownership: &Ownership) -> LocalMerge {
    let local = LocalMerge {
        merged: UnionFind::new(nodes.component_count()),
        faces: Vec::new(),
        // Enough for most meshes, so that it does not grow in many steps.
        at_boundary: Vec::with_capacity(1 << 12),
    };
    let mut w = Walk { nodes, ownership, local, path: Vec::new() };
    let across = [[Across::Nothing; 2]; 3];
    w.visit(&Frame { level: 0, key: 0, node: 0, exists: 1, across });
    w.local
}

struct Walk<'a> {
    nodes: &'a Nodes,
    ownership: &'a Ownership,
    local: LocalMerge,
    /// The bricks on the path from the root, by level.
    path: Vec<Frame>,
}

impl Walk<'_> {
    fn visit(&mut self, frame: &Frame) {
        self.merge_brick(frame);
        let nodes = self.nodes;
        let family = nodes.family(frame.level, frame.node);
        if family.bricks == 0 {
            return;
        }
        self.path.push(*frame);
        for j in ones(u64::from(family.bricks)) {
            if let Some(child) = step_down(nodes, frame, &family, u64::from(j)) {
                self.visit(&child);
            }
        }
        self.path.pop();
    }

    /// Merges the components of one brick with those across its faces.
    fn merge_brick(&mut self, frame: &Frame) {
        let (nodes, l) = (self.nodes, frame.level);
        let is_replica = nodes.placement(l, frame.node) == Placement::PartiallyReplicated
            && !self.ownership.owns(l, frame.key);
        for (c, bits) in nodes.components(l, frame.node) {
            if is_replica {
                // The owner merges the brick with its neighbours, and this replica's components with its own.
                self.record_face(l, frame.key, c, bits);
            }
            if l < 2 {
                // Every octant of these levels has a face on the root's boundary.
                self.local.at_boundary.push(c);
            }
            let inner = brick::spread_faces(bits) & !frame.exists & brick::valid(l);
            self.merge_coarser(frame, c, inner, None);
            for axis in 0..3 {
                for up in 0..2 {
                    let faced = brick::across(bits, axis, up == 1) & brick::valid(l);
                    if faced != 0 {
                        self.merge_across(frame, c, faced, (axis, up));
                    }
                }
            }
        }
    }

    #[inline]
    fn merge_across(&mut self, frame: &Frame, c: Component, faced: u64, side: (usize, usize)) {
        let (nodes, l, (axis, up)) = (self.nodes, frame.level, side);
        match frame.across[axis][up] {
            Across::Nothing => self.local.at_boundary.push(c),
            Across::Coarser => self.merge_coarser(frame, c, faced, Some(side)),
            Across::Remote => {
                // The other rank holds a fully replicated brick as well.
                let is_everywhere = nodes.placement(l, frame.node) == Placement::FullyReplicated;
                if !is_everywhere && self.ownership.owns(l, frame.key) {
                    let across = neighbour(l - 2, frame.key, axis, up == 1);
                    self.record_face(l, across.expect("the neighbour lies in the root"), c, faced);
                }
            }
            Across::Here(n, exists) => {
                if up == 0 {
                    self.unite(c, l, n, faced);
                }
                if faced & !exists != 0 {
                    self.merge_coarser(frame, c, faced & !exists, Some(side));
                }
            }
        }
    }

    /// Merges a component with those of a node of level `l` that have some of the octants `faced`.
    #[inline]
    fn unite(&mut self, c: Component, l: Level, node: Node, faced: u64) {
        for (d, bits) in self.nodes.components(l, node) {
            if bits & faced != 0 {
                self.local.merged.unite(c, d);
            }
        }
    }

    /// Records, for the owner of a brick, the octants of the brick that a component has or faces.
    fn record_face(&mut self, level: Level, key: u64, component: Component, bits: u64) {
        let rank = self.ownership.owner(level, key);
        self.local.faces.push(FacedOctants { rank, level, key, component, bits });
    }

    /// Merges a component of a brick with the coarser leaves that cover the octants `faced`: octants of the brick
    /// itself if `side` is none, of its neighbour on this side otherwise.
    #[inline]
    fn merge_coarser(
        &mut self,
        frame: &Frame,
        c: Component,
        mut faced: u64,
        mut side: Option<(usize, usize)>,
    ) {
        let (mut m, mut key) = (frame.level, frame.key);
        while faced != 0 && m > 0 {
            let mut group = key & 7;
            if let Some((axis, up)) = side {
                // The octants lie in the group next to the brick's own, in the same parent brick if that group is on
                // the inner side.
                if group >> axis & 1 != up as u64 {
                    side = None;
                }
                group ^= 1 << axis;
            }
            faced = u64::from(brick::parents(faced)) << (8 * group);
            key >>= 3;
            m -= 1;
            let frame = &self.path[m as usize];
            let (node, exists) = match side {
                None => (frame.node, frame.exists),
                Some((axis, up)) => match frame.across[axis][up] {
                    Across::Here(n, exists) => (n, exists),
                    _ => continue,
                },
            };
            if faced & exists != 0 {
                self.unite(c, m, node, faced);
                faced &= !exists;
            }
        }
    }
}

/// The frame of child brick `j`; none if this rank does not hold it.
#[inline]
fn step_down(nodes: &Nodes, frame: &Frame, family: &Family, j: u64) -> Option<Frame> {
    let l = frame.level;
    let (node, exists) = family.child(j)?;
    if let Placement::Remote(_) = nodes.placement(l + 1, node) {
        return None;
    }
    let mut across = [[Across::Nothing; 2]; 3];
    if l >= 2 {
        for axis in 0..3 {
            for up in 0..2 {
                let beside = j ^ 1 << axis;
                across[axis][up] = match frame.across[axis][up] {
                    _ if j >> axis & 1 != up as u64 => step_across(nodes, l, family, beside),
                    Across::Here(n, _) => step_across(nodes, l, &nodes.family(l, n), beside),
                    other => other,
                };
            }
        }
    }
    Some(Frame { level: l + 1, key: frame.key << 3 | j, node, exists, across })
}

/// The other side of a face of a child brick: octant group `j` of the brick across, whose children are `family`.
#[inline]
fn step_across(nodes: &Nodes, l: Level, family: &Family, j: u64) -> Across {
    match family.child(j) {
        None => Across::Coarser,
        Some((n, exists)) => match nodes.placement(l + 1, n) {
            Placement::Remote(_) => Across::Remote,
            _ => Across::Here(n, exists),
        },
    }
}
