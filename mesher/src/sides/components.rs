//! Joins the components of bricks into those of the tree, as far as this rank sees.
//!
//! A depth-first walk carries, for each level, the brick on the way down and its six face
//! neighbours, so that no neighbour is searched for. Leaves of one level are joined from the lower to
//! the higher side; a leaf and a coarser one from the finer leaf, which climbs the way until it finds the leaf
//! that covers the octant it faces.

use super::nodes::{Component, Family, Node, Nodes};
use crate::brick;
use crate::brickset::ones;
use crate::octant::{Level, neighbour};
use crate::partition::ownership::{Ownership, Placement};

/// The joined components, and the faces that another rank must look at.
pub struct Local {
    parent: Vec<Component>,
    /// What other ranks must be asked about: octants of theirs that a component of this rank faces, and components
    /// in bricks that several ranks hold and another answers for.
    pub faces: Vec<Face>,
}

/// Joined components, numbered.
pub struct Classes {
    /// The class of each component.
    pub of: Vec<u32>,
    /// How many there are.
    pub count: u32,
}

/// Octants of a brick, of leaf size or finer, that a component faces or has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The rank that answers for the brick.
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

impl Local {
    /// The component that stands for all joined with `c`.
    #[inline]
    pub fn find(&mut self, mut c: Component) -> Component {
        while self.parent[c as usize] != c {
            let up = self.parent[self.parent[c as usize] as usize];
            self.parent[c as usize] = up;
            c = up;
        }
        c
    }

    /// Numbers the classes of joined components.
    pub fn classes(self) -> Classes {
        let mut class = self.parent;
        let mut count = 0;
        for c in 0..class.len() {
            // A parent's number is never higher than its child's, so its class is there already.
            let up = class[c] as usize;
            class[c] = if up == c { count } else { class[up] };
            count += u32::from(up == c);
        }
        Classes { of: class, count }
    }

    /// Joins two components; the lower number stands for both.
    #[inline]
    pub fn join(&mut self, a: Component, b: Component) {
        // Mostly they are joined already, and know it.
        if self.parent[a as usize] == self.parent[b as usize] {
            return;
        }
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

/// What lies across a brick's face.
#[derive(Clone, Copy)]
enum Across {
    /// Outside the root.
    Nothing,
    /// Leaves coarser than this level.
    Coarser,
    /// Other ranks' bricks.
    Remote,
    /// A node of this level and which of its octants exist.
    Here(Node, u64),
}

/// A brick on the way down.
#[derive(Clone, Copy)]
struct Frame {
    key: u64,
    node: Node,
    exists: u64,
    /// By axis, down and up.
    across: [[Across; 2]; 3],
}

/// What lies across a brick's face, for its children to step across.
#[derive(Clone, Copy)]
enum Beyond {
    /// No bricks of the children's level.
    Never(Across),
    /// The children of a brick.
    Here(Family),
}

/// Joins all components that share part of a face, as far as this rank's nodes tell.
pub fn join(nodes: &Nodes, ownership: &Ownership) -> Local {
    let mut w = Walk {
        nodes,
        ownership,
        local: Local { parent: (0..nodes.component_count()).collect(), faces: Vec::new() },
        way: Vec::new(),
    };
    let root = Frame { key: 0, node: 0, exists: 1, across: [[Across::Nothing; 2]; 3] };
    w.visit(0, &root);
    w.local
}

struct Walk<'a> {
    nodes: &'a Nodes,
    ownership: &'a Ownership,
    local: Local,
    /// The bricks on the way down, by level.
    way: Vec<Frame>,
}

impl Walk<'_> {
    fn visit(&mut self, l: Level, frame: &Frame) {
        self.join_brick(l, frame);
        let nodes = self.nodes;
        let family = nodes.family(l, frame.node);
        if family.bricks() == 0 {
            return;
        }
        // Found once for all children, each of which steps across three of them.
        let beyond = frame.across.map(|sides| {
            sides.map(|across| match across {
                Across::Here(n, _) => Beyond::Here(nodes.family(l, n)),
                other => Beyond::Never(other),
            })
        });
        self.way.push(*frame);
        for j in ones(u64::from(family.bricks())) {
            if let Some(child) = step_down(nodes, l, frame, &family, &beyond, u64::from(j)) {
                self.visit(l + 1, &child);
            }
        }
        self.way.pop();
    }

    /// Joins the components of one brick with what they face.
    fn join_brick(&mut self, l: Level, frame: &Frame) {
        let nodes = self.nodes;
        let elsewhere = nodes.place(l, frame.node) == Placement::PartiallyReplicated
            && !self.ownership.owns(l, frame.key);
        for (c, bits) in nodes.components(l, frame.node) {
            if elsewhere {
                // Whoever answers for the brick joins it with what it faces, and this rank's copy with its own.
                self.report_status(l, frame.key, c, bits);
            }
            let inner = brick::spread_faces(bits) & !frame.exists & brick::valid(l);
            self.join_coarser(l, c, frame.key, inner, None);
            for axis in 0..3 {
                for up in 0..2 {
                    let faced = brick::across(bits, axis, up == 1) & brick::valid(l);
                    if faced != 0 {
                        self.join_across(l, frame, c, faced, axis, up);
                    }
                }
            }
        }
    }

    #[inline]
    fn join_across(
        &mut self,
        l: Level,
        frame: &Frame,
        c: Component,
        faced: u64,
        axis: usize,
        up: usize,
    ) {
        let nodes = self.nodes;
        match frame.across[axis][up] {
            Across::Nothing => {}
            Across::Coarser => self.join_coarser(l, c, frame.key, faced, Some((axis, up))),
            Across::Remote => {
                let asks = match nodes.place(l, frame.node) {
                    Placement::Local => true,
                    Placement::PartiallyReplicated => self.ownership.owns(l, frame.key),
                    // What a top brick faces, the other rank sees itself.
                    Placement::FullyReplicated | Placement::Remote(_) => false,
                };
                if asks {
                    let there = neighbour(l - 2, frame.key, axis, up == 1);
                    self.report_status(
                        l,
                        there.expect("a brick faces one inside the root"),
                        c,
                        faced,
                    );
                }
            }
            Across::Here(n, exists) => {
                if up == 1 {
                    for (d, bits) in nodes.components(l, n) {
                        if bits & faced != 0 {
                            self.local.join(c, d);
                        }
                    }
                }
                if faced & !exists != 0 {
                    self.join_coarser(l, c, frame.key, faced & !exists, Some((axis, up)));
                }
            }
        }
    }

    /// Has the rank that answers for a brick told which of its octants a component meets.
    fn report_status(&mut self, level: Level, key: u64, component: Component, bits: u64) {
        let rank = self.ownership.owner(level, key);
        self.local.faces.push(Face { rank, level, key, component, bits });
    }

    /// Joins a component of a brick, which has key `key`, with the leaves coarser than level `l` that cover the octants
    /// `faced` of the brick itself (`side` none) or of its neighbour there.
    #[inline]
    fn join_coarser(
        &mut self,
        l: Level,
        c: Component,
        mut key: u64,
        mut faced: u64,
        mut side: Option<(usize, usize)>,
    ) {
        let mut m = l;
        while faced != 0 && m > 0 {
            let mut group = key & 7;
            if let Some((axis, up)) = side {
                // Beside its own group, and in the same brick if that is on the way there.
                if group >> axis & 1 != up as u64 {
                    side = None;
                }
                group ^= 1 << axis;
            }
            faced = u64::from(brick::parents(faced)) << (8 * group);
            key >>= 3;
            m -= 1;
            let frame = &self.way[m as usize];
            let (node, exists) = match side {
                None => (frame.node, frame.exists),
                Some((axis, up)) => match frame.across[axis][up] {
                    Across::Here(n, exists) => (n, exists),
                    _ => continue,
                },
            };
            if faced & exists != 0 {
                for (d, bits) in self.nodes.components(m, node) {
                    if bits & faced != 0 {
                        self.local.join(c, d);
                    }
                }
                faced &= !exists;
            }
        }
    }
}

/// The frame of child brick `j`; none if it is another rank's.
#[inline]
fn step_down(
    nodes: &Nodes,
    l: Level,
    frame: &Frame,
    family: &Family,
    beyond: &[[Beyond; 2]; 3],
    j: u64,
) -> Option<Frame> {
    let (node, exists) = family.child(j)?;
    if let Placement::Remote(_) = nodes.place(l + 1, node) {
        return None;
    }
    let mut across = [[Across::Nothing; 2]; 3];
    if l >= 2 {
        for axis in 0..3 {
            for up in 0..2 {
                let stays = j >> axis & 1 != up as u64;
                let beyond = if stays { &Beyond::Here(*family) } else { &beyond[axis][up] };
                across[axis][up] = step_across(nodes, l, beyond, j ^ 1 << axis);
            }
        }
    }
    Some(Frame { key: frame.key << 3 | j, node, exists, across })
}

/// What lies across a face of a child brick, which is to be octant group `j` there.
#[inline]
fn step_across(nodes: &Nodes, l: Level, beyond: &Beyond, j: u64) -> Across {
    let family = match beyond {
        Beyond::Never(across) => return *across,
        Beyond::Here(family) => family,
    };
    match family.child(j) {
        None => Across::Coarser,
        Some((n, exists)) => match nodes.place(l + 1, n) {
            Placement::Remote(_) => Across::Remote,
            _ => Across::Here(n, exists),
        },
    }
}
