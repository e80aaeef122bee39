//! The leaves of a base tree with an index that finds the leaf at a point and the neighbours of a leaf.
//!
//! Invariants: the leaves tile the root in Morton order; a node has eight children; the root is node 0 or a leaf.

use super::search::Graph;
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant, UNITS_PER_CELL};
use contract::word::{self, KEY_END, Side};

/// Bit of an entry that refers to a node; without it, the entry is the index of a leaf.
const NODE: u32 = 1 << 31;

/// The leaves as a tree. It takes about 5 bytes per leaf in addition to the words.
#[derive(Debug)]
pub struct Leaves<'a> {
    words: &'a [u64],
    nodes: Vec<[u32; 8]>,
    root: u32,
}

impl<'a> Leaves<'a> {
    /// The tree of sorted words.
    ///
    /// # Errors
    /// One sentence, if the words are not leaves that tile the root.
    pub fn new(words: &'a [u64]) -> Result<Self, String> {
        if words.len() >= NODE as usize {
            return Err(format!("{} leaves exceed the limit of {}", words.len(), NODE - 1));
        }
        let mut tree = Self { words, nodes: Vec::with_capacity(words.len() / 7 + 1), root: 0 };
        let (mut end, mut previous) = (0, 0);
        let mut path = [0; LEVEL_MAX as usize];
        let mut open = 0;
        for (i, &w) in words.iter().enumerate() {
            let (key, level) = (word::key(w), usize::from(word::level(w)));
            if word::fault(w).is_some() || key != end {
                return Err(format!("the base tree is not a tree: leaf {i} is wrong"));
            }
            end = key + word::span(level as u8);
            open = open.min(shared_levels(previous, key));
            previous = key;
            while open < level {
                path[open] =
                    tree.open_node(open.checked_sub(1).map(|parent| (path[parent], key, parent)));
                open += 1;
            }
            if let Some(parent) = level.checked_sub(1) {
                tree.nodes[path[parent] as usize][digit(key, parent)] = i as u32;
            }
        }
        if end != KEY_END {
            return Err("the base tree is not a tree: it does not fill the root".to_owned());
        }
        Ok(tree)
    }

    /// Adds a node below its parent, given with the key of a descendant and the parent's level.
    fn open_node(&mut self, parent: Option<(u32, u64, usize)>) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push([0; 8]);
        match parent {
            Some((above, key, level)) => {
                self.nodes[above as usize][digit(key, level)] = NODE | node
            }
            None => self.root = NODE | node,
        }
        node
    }

    /// Number of leaves.
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// Whether there are no leaves, which no valid tree has.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// The words, sorted.
    pub fn words(&self) -> &'a [u64] {
        self.words
    }

    /// The octant of a leaf.
    pub fn octant(&self, leaf: u32) -> Octant {
        word::octant(self.words[leaf as usize])
    }

    /// Whether no facet touches the leaf.
    pub fn is_free(&self, leaf: u32) -> bool {
        is_free(self.words[leaf as usize])
    }

    /// The leaf whose half-open box contains a lattice point of the root; a point on an upper face of the root lies in
    /// the leaf below it.
    pub fn locate(&self, at: [i64; 3]) -> u32 {
        let cell = at.map(|c| (c / UNITS_PER_CELL).clamp(0, i64::from(CELLS_PER_EDGE) - 1) as u32);
        let key = word::key_of(cell);
        let (mut entry, mut level) = (self.root, 0);
        while entry & NODE != 0 {
            entry = self.nodes[(entry & !NODE) as usize][digit(key, level)];
            level += 1;
        }
        entry
    }

    /// Calls `visit` with every leaf that shares part of a face with this leaf.
    pub fn neighbours(&self, leaf: u32, visit: &mut impl FnMut(u32)) {
        let octant = self.octant(leaf);
        for axis in 0..3 {
            for side in [-1, 1] {
                let mut offset = [0; 3];
                offset[axis] = side;
                if let Some(neighbour) = octant.neighbour(offset) {
                    self.facing(self.find(&neighbour), axis, side < 0, visit);
                }
            }
        }
    }

    /// The entry of an octant: its node, or the leaf that contains it.
    fn find(&self, octant: &Octant) -> u32 {
        let key = word::key_of(octant.corner);
        let mut entry = self.root;
        for level in 0..usize::from(octant.level) {
            if entry & NODE == 0 {
                break;
            }
            entry = self.nodes[(entry & !NODE) as usize][digit(key, level)];
        }
        entry
    }

    /// The leaves of an entry at its upper or lower face.
    fn facing(&self, entry: u32, axis: usize, upper: bool, visit: &mut impl FnMut(u32)) {
        if entry & NODE == 0 {
            return visit(entry);
        }
        let children = &self.nodes[(entry & !NODE) as usize];
        for (digit, &child) in children.iter().enumerate() {
            if (digit >> axis & 1 == 1) == upper {
                self.facing(child, axis, upper, visit);
            }
        }
    }
}

/// The free leaves.
impl Graph for Leaves<'_> {
    fn count(&self) -> usize {
        self.len()
    }

    fn position(&self, leaf: u32) -> [f64; 3] {
        self.octant(leaf).centre().map(|c| c as f64)
    }

    fn is_far(&self, leaf: u32) -> bool {
        let octant = self.octant(leaf);
        octant.corner.iter().any(|&c| c == 0 || c + octant.edge() == CELLS_PER_EDGE)
    }

    fn joined(&self, leaf: u32, visit: &mut impl FnMut(u32)) {
        self.neighbours(leaf, &mut |next| {
            if self.is_free(next) {
                visit(next);
            }
        });
    }
}

/// Whether no facet touches a leaf.
pub fn is_free(word: u64) -> bool {
    word & 3 != Side::Crossing as u64
}

/// The centre of the face, or part of a face, that two octants share, in lattice units.
pub fn shared_face_centre(a: &Octant, b: &Octant) -> [f64; 3] {
    let ((a_low, a_high), (b_low, b_high)) = (a.bounds(), b.bounds());
    std::array::from_fn(|i| (a_low[i].max(b_low[i]) + a_high[i].min(b_high[i])) as f64 / 2.0)
}

/// Number of common ancestors of two level-19 cells, themselves excluded.
fn shared_levels(a: u64, b: u64) -> usize {
    match (a ^ b).checked_ilog2() {
        Some(bit) => usize::from(LEVEL_MAX) - bit as usize / 3,
        None => 0,
    }
}

/// The digit of the child that contains a level-19 cell, among the children of its ancestor at `level`.
fn digit(key: u64, level: usize) -> usize {
    (key >> (3 * (usize::from(LEVEL_MAX) - 1 - level)) & 7) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{words_of, words_with_sides};
    use proptest::prelude::*;

    /// Complete trees of up to four levels, split at random.
    fn trees() -> impl Strategy<Value = Vec<u64>> {
        any::<u64>().prop_map(|seed| {
            words_of(|o| {
                let mixed =
                    contract::digest::mix(word::key_of(o.corner) ^ seed ^ u64::from(o.level)) >> 70;
                o.level < 4 && mixed % 5 < 3
            })
        })
    }

    proptest! {
        #[test]
        fn neighbours_are_the_leaves_with_a_common_face(words in trees()) {
            let leaves = Leaves::new(&words).unwrap();
            for i in 0..leaves.len() as u32 {
                let mut found = Vec::new();
                leaves.neighbours(i, &mut |j| found.push(j));
                found.sort_unstable();
                let octant = leaves.octant(i);
                let touches = |j: &u32| shares_a_face(&octant, &leaves.octant(*j));
                let expected: Vec<u32> = (0..leaves.len() as u32).filter(touches).collect();
                prop_assert_eq!(found, expected);
                let (low, high) = octant.bounds();
                prop_assert_eq!(leaves.locate(low), i);
                prop_assert_eq!(leaves.locate(high.map(|c| c - 1)), i);
            }
        }
    }

    #[test]
    fn leaves_at_the_boundary_are_in_the_far_field() {
        let words = words_of(|o| o.level < 2 || (o.level < 3 && o.corner == [0; 3]));
        let leaves = Leaves::new(&words).unwrap();
        for leaf in 0..leaves.len() as u32 {
            let (low, high) = leaves.octant(leaf).bounds();
            let is_at_face = |a: usize| low[a] == 0 || high[a] == contract::lattice::UNITS_PER_EDGE;
            assert_eq!(leaves.is_far(leaf), (0..3).any(is_at_face), "leaf {leaf}");
        }
    }

    /// Closed boxes that share an area: they touch along one axis and overlap along the others.
    fn shares_a_face(a: &Octant, b: &Octant) -> bool {
        let ((a_low, a_high), (b_low, b_high)) = (a.bounds(), b.bounds());
        let common = |i: usize| a_high[i].min(b_high[i]) - a_low[i].max(b_low[i]);
        let axes = [0, 1, 2].map(common);
        axes.iter().filter(|&&c| c == 0).count() == 1
            && axes.iter().filter(|&&c| c > 0).count() == 2
    }

    #[test]
    fn words_that_do_not_tile_the_root_are_refused() {
        let whole = words_of(|o| o.level < 1);
        assert!(Leaves::new(&whole).is_ok());
        assert!(Leaves::new(&whole[1..]).is_err());
        assert!(Leaves::new(&whole[..7]).is_err());
        assert!(Leaves::new(&[]).is_err());
        let hole =
            words_with_sides(|o| o.level < 2, |o| (o.corner != [0; 3]).then_some(Side::Outside));
        assert!(Leaves::new(&hole).is_err());
        let root = words_of(|_| false);
        let root = Leaves::new(&root).unwrap();
        assert!(root.locate([5; 3]) == 0 && !root.is_empty());
    }
}
