//! A tree of [patches](Patch): the facets of each node.
//!
//! Facets with other normals are far apart in its order: on a wing that is thin, the bounds on the normals of nodes would else be
//! those of both its sides.

use std::ops::Range;

use contract::lattice::FacetLattice;

use super::boxes::Boxes;
pub use super::boxes::GROUP;
use super::bundles::Bundle;
use super::facets::normal;
use super::patch::Patch;
use super::shells::Shells;

/// Bits for the parts of a cube's face along either axis that are classes of normals.
const CLASS_BITS: u32 = 2;

/// A node of the tree, in one line of a cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Node {
    /// Its patch.
    pub bundle: Bundle<1>,
    /// The shell of its facets; [`u32::MAX`] if they belong to several.
    shell: u32,
    /// The second child, the first one follows the node; 0 for a leaf.
    second: u32,
}

impl Node {
    /// The shell of the facets; none if they belong to several.
    pub fn shell(&self) -> Option<u32> {
        (self.shell != u32::MAX).then_some(self.shell)
    }
}

/// The class of a facet with an area: the part of a cube's surface that the normal points to.
fn class(facet: &FacetLattice) -> u16 {
    let n = normal(facet);
    let longest = (0..3).fold(0, |a, b| if n[b].abs() > n[a].abs() { b } else { a });
    let mut class = 2 * longest as u16 + u16::from(n[longest] > 0);
    let parts = (1 << CLASS_BITS) as f64;
    let [u, v] = [1, 2].map(|turn| {
        let ratio = n[(longest + turn) % 3] as f64 / n[longest].abs() as f64;
        ((ratio + 1.0) / 2.0 * parts).min(parts - 1.0) as u16
    });
    for bit in (0..CLASS_BITS).rev() {
        class = class << 2 | (u >> bit & 1) << 1 | (v >> bit & 1);
    }
    class
}

/// The patches of a tree, and each facet as a patch.
#[derive(Debug)]
pub struct Patches {
    boxes: Boxes,
    nodes: Vec<Node>,
    /// The patches of the nodes.
    patches: Vec<Patch>,
    /// The facets of each leaf.
    leaves: Vec<Bundle<GROUP>>,
    /// The index of each node's leaf, if it is one.
    leaf_of: Vec<u32>,
}

impl Patches {
    /// The patches of those facets that have an area.
    pub fn new(lattice: &[FacetLattice], shells: &Shells) -> Self {
        let boxes = Boxes::by_class(lattice, class);
        let mut patches =
            Self { boxes, nodes: vec![], patches: vec![], leaves: vec![], leaf_of: vec![] };
        if !patches.boxes.facets.is_empty() {
            patches.build(lattice, shells);
        }
        patches
    }

    fn build(&mut self, lattice: &[FacetLattice], shells: &Shells) {
        let Self { boxes, .. } = self;
        let root = boxes.bounds(0);
        let side = |a: usize| f64::from(root.high[a]) - f64::from(root.low[a]);
        let origin = [0, 1, 2].map(|a| f64::from(root.low[a]) + side(a) / 2.0);
        let radius = [0, 1, 2].map(side).into_iter().fold(0.0, f64::max) / 2.0;
        let count = boxes.nodes();
        self.patches.reserve(count);
        self.leaves.reserve(count.div_ceil(2));
        self.leaf_of.resize(count, 0);
        // Children follow their parents.
        for node in (0..count).rev() {
            let patch = match boxes.children(node) {
                // Nodes are in reverse order.
                Some([a, b]) => {
                    let [a, b] = [a, b].map(|child| &self.patches[count - 1 - child]);
                    a.union(b)
                }
                None => {
                    let mut leaf = Bundle::EMPTY;
                    let members = boxes.members(node);
                    let facet = |position: usize| &lattice[boxes.facets[position] as usize];
                    let one = |position: usize| {
                        let shell = shells.of(boxes.facets[position] as usize);
                        Patch::of(facet(position), boxes.bounds[position], shell)
                    };
                    let mut ones = [None; GROUP];
                    for (i, position) in members.clone().enumerate() {
                        let one = one(position);
                        leaf.set(i, &one.bundle(origin, radius));
                        ones[i] = Some(one);
                    }
                    let each = members.zip(ones).filter_map(|(at, one)| Some((facet(at), one?)));
                    let all = Patch::of_all(each);
                    self.leaf_of[node] = self.leaves.len() as u32;
                    self.leaves.push(leaf);
                    all.expect("a leaf has facets")
                }
            };
            self.patches.push(patch);
        }
        self.patches.reverse();
        let node = |(node, patch): (usize, &Patch)| Node {
            bundle: patch.bundle(origin, radius),
            shell: patch.shell.unwrap_or(u32::MAX),
            second: boxes.children(node).map_or(0, |[_, second]| second as u32),
        };
        self.nodes = self.patches.iter().enumerate().map(node).collect();
    }

    /// Number of nodes, 0 if there are no facets; the root is node 0.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of facets.
    pub fn facets(&self) -> usize {
        self.boxes.facets.len()
    }

    /// A node.
    pub fn node(&self, node: usize) -> &Node {
        &self.nodes[node]
    }

    /// The patch of a node.
    pub fn patch(&self, node: usize) -> &Patch {
        &self.patches[node]
    }

    /// The facets of a leaf, each as a patch.
    pub fn leaf(&self, node: usize) -> &Bundle<GROUP> {
        &self.leaves[self.leaf_of[node] as usize]
    }

    /// The number of the facet at a position in the tree.
    pub fn number(&self, position: usize) -> u32 {
        self.boxes.facets[position]
    }

    /// The positions of a node's facets.
    pub fn members(&self, node: usize) -> Range<usize> {
        self.boxes.members(node)
    }

    /// The children of a node; none for a leaf.
    pub fn children(&self, node: usize) -> Option<[usize; 2]> {
        let second = self.nodes[node].second as usize;
        (second != 0).then_some([node + 1, second])
    }
}

#[cfg(test)]
mod tests {
    use super::super::boxes::unit_normal;
    use super::*;
    use proptest::prelude::*;

    fn facet() -> impl Strategy<Value = FacetLattice> {
        let corner = || prop::array::uniform3(-50i64..50);
        prop::array::uniform3(corner()).prop_filter("no area", |facet| normal(facet) != [0; 3])
    }

    proptest! {
        #[test]
        fn facets_of_one_class_have_normals_within_36_degrees(a in facet(), b in facet()) {
            let [n, m] = [a, b].map(|facet| unit_normal(&facet));
            let cosine: f64 = (0..3).map(|x| n[x] * m[x]).sum();
            prop_assert!(class(&a) != class(&b) || cosine > 0.809);
            prop_assert!(class(&a) < 6 << (2 * CLASS_BITS));
            prop_assert!(class(&a) != class(&[a[0], a[2], a[1]]));
        }
    }

    #[test]
    fn each_face_of_a_cube_has_sixteen_classes() {
        let mut classes = std::collections::BTreeSet::new();
        let parts = [-7, -3, 3, 7];
        for axis in 0..3 {
            for (u, v) in parts.into_iter().flat_map(|u| parts.map(|v| (u, v))) {
                // Normal to (u, v, 8), or to its opposite.
                let mut facet = [[0; 3]; 3];
                let [x, y, z] = [1, 2, 0].map(|turn| (axis + turn) % 3);
                (facet[1][x], facet[1][z]) = (8, -u);
                (facet[2][y], facet[2][z]) = (8, -v);
                classes.insert(class(&facet));
                facet.swap(1, 2);
                classes.insert(class(&facet));
            }
        }
        assert_eq!(classes.len(), 96);
    }
}
