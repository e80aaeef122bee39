//! The front of a mesh towards the body: the faces at which its cells end at crossing leaves, deleted or not.
//!
//! A leaf on a side (not crossing) borders leaves of its own side and crossing leaves only, because a component is kept or deleted as
//! a whole. Where it borders neither the root's boundary nor a leaf on a side, a crossing leaf was deleted, or is there. Such
//! a face is exposed. A face that is exposed in part is divided into quarters, and these again, until each is exposed or
//! not; so no two squares of the front overlap, and a whole face is one square whatever the crossing leaves are like.
//!
//! The octree is traversed once, over octants for the faces within them and over pairs of octants for the faces between.
//! Octants of many leaves are not held: of each child, only the leaves at its six faces remain when it is done. So memory
//! grows with the surfaces of octants and with the front.

use std::ops::Range;

use contract::octant::{LEVEL_MAX, Octant};
use contract::word::{self, Side};

use crate::error::ExportError;
use crate::leaf::Leaf;
use crate::mesh::{Mesh, Visitor};
use crate::selection::Selection;

/// Octants of at most this many leaves are held as a whole.
const LEAVES_HELD: u64 = 1 << 16;

/// A square of the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Minimum corner, in level-19 cells.
    pub corner: [u32; 3],
    /// The level whose cells have this edge: that of the leaf, or deeper if only part of the leaf's face is exposed.
    pub level: u8,
    /// The axis that it is normal to.
    pub axis: u8,
    /// Whether the leaf is on the positive side.
    pub is_leaf_above: bool,
    /// Level of the leaf.
    pub leaf_level: u8,
    /// Side of the leaf, which is not crossing.
    pub side: Side,
    /// Rank of the leaf; 0 if it is unknown.
    pub rank: u32,
}

impl Face {
    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        Octant { corner: [0; 3], level: self.level }.edge()
    }

    /// The four corners in level-19 cells, counterclockwise as seen from the leaf.
    pub fn corners(&self) -> [[u32; 3]; 4] {
        let (u, v) = ((self.axis as usize + 1) % 3, (self.axis as usize + 2) % 3);
        let corner = |along_u: u32, along_v: u32| {
            let mut corner = self.corner;
            corner[u] += along_u * self.edge();
            corner[v] += along_v * self.edge();
            corner
        };
        match self.is_leaf_above {
            true => [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)],
            false => [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)],
        }
    }
}

/// The faces of the selected leaves that belong to the front.
///
/// # Errors
/// If the mesh cannot be read, or with the first error of `check`, which is called from time to time.
pub fn front(
    mesh: &Mesh,
    selection: &Selection,
    check: &dyn Fn() -> Result<(), ExportError>,
) -> Result<Vec<Face>, ExportError> {
    front_holding(LEAVES_HELD, mesh, selection, check)
}

fn front_holding(
    leaves_held: u64,
    mesh: &Mesh,
    selection: &Selection,
    check: &dyn Fn() -> Result<(), ExportError>,
) -> Result<Vec<Face>, ExportError> {
    let found = Found { selection, faces: Vec::new() };
    let mut search = Search { mesh: mesh.visitor(), leaves_held, check, found };
    search.octant(Octant::ROOT)?;
    Ok(search.found.faces)
}

/// A leaf, with its Morton code.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    key: u64,
    leaf: Leaf,
}

impl Entry {
    fn is_open(&self) -> bool {
        self.leaf.side == Side::Crossing
    }
}

/// The leaves at the six faces of an octant: at the lower and upper face along each axis, in Morton order.
type Layers = [[Vec<Entry>; 2]; 3];

/// The traversal of octants that may have too many leaves to be held.
struct Search<'a> {
    mesh: Visitor<'a>,
    leaves_held: u64,
    check: &'a dyn Fn() -> Result<(), ExportError>,
    found: Found<'a>,
}

impl Search<'_> {
    /// Finds the front within an octant.
    fn octant(&mut self, octant: Octant) -> Result<Layers, ExportError> {
        let start = word::key_of(octant.corner);
        let keys = start..start + word::span(octant.level);
        let leaves = self.mesh.count(keys.clone())?;
        if leaves <= self.leaves_held || octant.level == LEVEL_MAX {
            return self.held(octant, keys);
        }
        let mut below = Vec::new();
        for child in (0..8).map(|digit| octant.child(digit)) {
            below.push(self.octant(child)?);
        }
        for (low, high, axis) in neighbours() {
            let node = |digit: usize, end: usize| Node {
                octant: octant.child(digit as u8),
                leaves: &below[digit][axis][end],
            };
            self.found.between(node(low, 1), node(high, 0), axis);
        }
        let mut layers = Layers::default();
        for (digit, child) in below.into_iter().enumerate() {
            for (axis, [low, high]) in child.into_iter().enumerate() {
                let end = digit >> axis & 1;
                layers[axis][end].extend(if end == 0 { low } else { high });
            }
        }
        Ok(layers)
    }

    /// The same for an octant whose leaves are read at once.
    fn held(&mut self, octant: Octant, keys: Range<u64>) -> Result<Layers, ExportError> {
        (self.check)()?;
        let mut leaves = Vec::new();
        let mut closed = 0;
        self.mesh.visit(keys, &Selection::default(), &mut |leaf: Leaf| {
            let entry = Entry { key: word::key_of(leaf.octant.corner), leaf };
            closed += if entry.is_open() { 0 } else { word::span(leaf.octant.level) };
            leaves.push(entry);
            Ok::<(), ExportError>(())
        })?;
        // An octant full of leaves on a side has no front within.
        if closed != word::span(octant.level) {
            self.found.within(Node { octant, leaves: &leaves });
        }
        let mut layers = Layers::default();
        for entry in leaves {
            let Octant { corner, .. } = entry.leaf.octant;
            let edge = entry.leaf.octant.edge();
            for axis in 0..3 {
                let at = corner[axis] - octant.corner[axis];
                let [low, high] = &mut layers[axis];
                low.extend((at == 0).then_some(entry));
                high.extend((at + edge == octant.edge()).then_some(entry));
            }
        }
        Ok(layers)
    }
}

/// The pairs of children that share a face, each with the axis normal to it.
fn neighbours() -> impl Iterator<Item = (usize, usize, usize)> {
    let of_axis = |axis: usize| (0..8).map(move |low: usize| (low, low | 1 << axis, axis));
    (0..3).flat_map(of_axis).filter(|(low, high, _)| low != high)
}

/// An octant and leaves in it: all that matter, or the one leaf that contains it.
#[derive(Clone, Copy)]
struct Node<'a> {
    octant: Octant,
    leaves: &'a [Entry],
}

/// An octant as seen across a face.
enum Kind {
    /// A leaf on a side.
    Cell(Leaf),
    /// No leaf, or a crossing one.
    Open,
    Split,
}

impl<'a> Node<'a> {
    fn kind(&self) -> Kind {
        match self.leaves {
            [] => Kind::Open,
            [entry] if entry.leaf.octant.level <= self.octant.level => match entry.is_open() {
                true => Kind::Open,
                false => Kind::Cell(entry.leaf),
            },
            _ => Kind::Split,
        }
    }

    fn child(&self, digit: usize) -> Self {
        let octant = self.octant.child(digit as u8);
        let leaves = match self.kind() {
            Kind::Split => {
                let start = word::key_of(octant.corner);
                let end = start + word::span(octant.level);
                let first = self.leaves.partition_point(|entry| entry.key < start);
                let count = self.leaves[first..].partition_point(|entry| entry.key < end);
                &self.leaves[first..first + count]
            }
            _ => self.leaves,
        };
        Self { octant, leaves }
    }
}

/// The leaf of which the whole of a face is exposed, and whether it is the upper of the two octants.
type Exposed = Option<(Leaf, bool)>;

/// The faces found so far.
struct Found<'a> {
    selection: &'a Selection,
    faces: Vec<Face>,
}

impl Found<'_> {
    /// Finds the front within an octant.
    fn within(&mut self, node: Node) {
        if !matches!(node.kind(), Kind::Split) {
            return;
        }
        let children: [Node; 8] = std::array::from_fn(|digit| node.child(digit));
        children.iter().for_each(|&child| self.within(child));
        for (low, high, axis) in neighbours() {
            self.between(children[low], children[high], axis);
        }
    }

    /// Finds the front between two octants of the same size.
    fn between(&mut self, low: Node, high: Node, axis: usize) {
        let exposed = self.across(low, high, axis);
        self.add(exposed, &high.octant, axis);
    }

    /// Finds the front between two octants of the same size, except for the whole of a leaf's face, which is returned.
    fn across(&mut self, low: Node, high: Node, axis: usize) -> Exposed {
        let owner = match (low.kind(), high.kind()) {
            (Kind::Cell(_), Kind::Cell(_)) | (Kind::Open, Kind::Open) => return None,
            (Kind::Cell(leaf), Kind::Open) => return Some((leaf, false)),
            (Kind::Open, Kind::Cell(leaf)) => return Some((leaf, true)),
            (Kind::Cell(leaf), Kind::Split) => Some((leaf, false)),
            (Kind::Split, Kind::Cell(leaf)) => Some((leaf, true)),
            (Kind::Open, Kind::Split) | (Kind::Split, Kind::Open) | (Kind::Split, Kind::Split) => {
                None
            }
        };
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let quarters = [0, u, v, u | v].map(|digit| {
            let (below, above) = (low.child(digit | 1 << axis), high.child(digit));
            (above.octant, self.across(below, above, axis))
        });
        if owner.is_some() && quarters.iter().all(|(_, exposed)| exposed.is_some()) {
            return owner;
        }
        quarters.iter().for_each(|(above, exposed)| self.add(*exposed, above, axis));
        None
    }

    /// Adds the lower face of an octant along an axis, if it is exposed.
    fn add(&mut self, exposed: Exposed, above: &Octant, axis: usize) {
        let Some((leaf, is_leaf_above)) = exposed.filter(|(leaf, _)| self.selection.has(leaf))
        else {
            return;
        };
        let Leaf { octant: Octant { level: leaf_level, .. }, side, rank, .. } = leaf;
        let (Octant { corner, level }, axis) = (*above, axis as u8);
        self.faces.push(Face { corner, level, axis, is_leaf_above, leaf_level, side, rank });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::on_disk;
    use contract::testing::random_words;
    use proptest::prelude::*;
    use rustc_hash::FxHashMap;

    /// Level of the finest cells of the random meshes.
    const LEVEL: u8 = 4;

    fn faces(words: &[u64], parts: usize, leaves_held: u64) -> Vec<Face> {
        let (_dir, mesh) = on_disk(words, parts, |i| i / 5);
        front_holding(leaves_held, &mesh, &Selection::default(), &|| Ok(())).unwrap()
    }

    /// A square of the finest level: its minimum corner in finest cells, and its axis.
    type Unit = ([u32; 3], usize);

    /// The word of the leaf, and whether it is above, for each square of the finest level between a cell on a side and one that
    /// is not: by brute force.
    fn expected(words: &[u64]) -> FxHashMap<Unit, (u64, bool)> {
        let scale = Octant::ROOT.child(0).edge() >> (LEVEL - 1);
        let mut cells: FxHashMap<[u32; 3], u64> = FxHashMap::default();
        for &w in words.iter().filter(|&&w| word::side(w) != Side::Crossing) {
            let octant = word::octant(w);
            let edge = octant.edge() / scale;
            for i in 0..edge.pow(3) {
                let along = [i % edge, i / edge % edge, i / edge / edge];
                cells.insert(std::array::from_fn(|a| octant.corner[a] / scale + along[a]), w);
            }
        }
        let mut expected = FxHashMap::default();
        let neighbours = |at: [u32; 3]| (0..3).flat_map(move |axis| [(at, axis, 0), (at, axis, 1)]);
        for (at, axis, end) in cells.keys().copied().flat_map(neighbours) {
            let mut other = at;
            match (end, at[axis]) {
                (0, 0) => continue,
                (0, _) => other[axis] -= 1,
                (_, last) if last + 1 == 1 << LEVEL => continue,
                _ => other[axis] += 1,
            }
            if !cells.contains_key(&other) {
                let mut corner = at;
                corner[axis] += end;
                expected.insert((corner, axis), (cells[&at], end == 0));
            }
        }
        expected
    }

    proptest! {
        #[test]
        fn the_front_is_what_brute_force_finds_and_its_squares_are_the_largest(
            words in random_words(LEVEL), parts in 1usize..4, leaves_held in prop::sample::select(vec![1u64, 10, 1000])
        ) {
            let scale = Octant::ROOT.child(0).edge() >> (LEVEL - 1);
            let expected = expected(&words);
            let leaf_of = |face: &Face| {
                let corner = face.corner.map(|c| c / scale);
                expected.get(&(corner, face.axis as usize)).copied()
            };
            let mut covered = 0;
            let faces = faces(&words, parts, leaves_held);
            for face in &faces {
                let (u, v) = ((face.axis as usize + 1) % 3, (face.axis as usize + 2) % 3);
                let leaf = leaf_of(face).unwrap();
                prop_assert_eq!(leaf.1, face.is_leaf_above);
                prop_assert_eq!((word::level(leaf.0), word::side(leaf.0)), (face.leaf_level, face.side));
                let edge = face.edge() / scale;
                for i in 0..edge * edge {
                    let mut at = face.corner.map(|c| c / scale);
                    at[u] += i % edge;
                    at[v] += i / edge;
                    prop_assert_eq!(expected.get(&(at, face.axis as usize)), Some(&leaf));
                }
                covered += edge * edge;
                // Of a square that is not the whole face, the square of which it is a quarter is not exposed.
                if face.level > face.leaf_level {
                    let size = 2 * edge;
                    let low = face.corner.map(|c| c / scale);
                    let parent = |a: usize| if a == face.axis as usize { low[a] } else { low[a] / size * size };
                    let whole = (0..size * size).all(|i| {
                        let mut at: [u32; 3] = std::array::from_fn(parent);
                        at[u] += i % size;
                        at[v] += i / size;
                        expected.contains_key(&(at, face.axis as usize))
                    });
                    prop_assert!(!whole);
                }
            }
            prop_assert_eq!(covered as usize, expected.len());
        }
    }
}
