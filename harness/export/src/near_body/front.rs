//! The front of a mesh towards the body: the faces at which its cells end at crossing leaves, deleted or not.
//!
//! A leaf on a side (not crossing) borders leaves of its own side and crossing leaves only, because a component is kept or deleted as
//! a whole. Where it borders neither the root's boundary nor a leaf on a side, a crossing leaf was deleted, or is there. Such
//! a face is exposed. A face that is exposed in part is divided into quarters, and these again, until each is exposed or
//! not; so no two squares of the front overlap, and a whole face is one square whatever the crossing leaves are like.
//!
//! The mesh is held as a tree that stores equal subtrees once. Subtrees without holes or crossing leaves, among which are their neighbours,
//! are passed over.

use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kinds, Neighbourhood, Tree};
use contract::word::{self, Side};

use crate::mesh::Mesh;
use crate::selection::Selection;
use contract::failure::Failure;

/// What a face is exposed to: crossing leaves, and none.
const OPEN: Kinds = HOLES | 1 << Side::Crossing as u8;

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

/// The faces of the selected leaves that belong to the front. `check` is called from time to time.
///
/// # Errors
/// If the mesh is not a linear oct-tree or cannot be read, and those of `check`.
pub fn front(
    mesh: &Mesh,
    selection: &Selection,
    check: &dyn Fn() -> Result<(), Failure>,
) -> Result<Vec<Face>, Failure> {
    let tree = mesh.tree()?;
    let mut found = Vec::new();
    search(&tree, &Neighbourhood::root(&tree), &mut found, check)?;
    // The tree has neither ranks nor what else may be selected.
    let (mut found, mut faces) = (found.into_iter().peekable(), Vec::new());
    mesh.visit(selection, check, &mut |leaf| {
        let key = word::key_of(leaf.octant.corner);
        while let Some((owner, face)) = found.next_if(|(owner, _)| *owner <= key) {
            faces.extend((owner == key).then_some(Face { rank: leaf.rank, ..face }));
        }
        Ok(())
    })?;
    Ok(faces)
}

/// Appends the front of the leaves in an octant, with their Morton codes, which ascend.
fn search(
    tree: &Tree,
    around: &Neighbourhood,
    found: &mut Vec<(u64, Face)>,
    check: &dyn Fn() -> Result<(), Failure>,
) -> Result<(), Failure> {
    if around.handles.iter().all(|&handle| tree.kinds(handle) & OPEN == 0) {
        return Ok(());
    }
    let (Octant { corner, level }, centre) = (around.octant, around.centre());
    if centre.is_node() {
        check()?;
        return (0..8).try_for_each(|digit| search(tree, &around.child(tree, digit), found, check));
    }
    let side = centre.as_leaf().map(|kind| Side::ALL[usize::from(kind)]);
    let Some(side) = side.filter(|&side| side != Side::Crossing) else { return Ok(()) };
    for (axis, is_leaf_above) in (0..6).map(|face| (face / 2, face % 2 == 0)) {
        let (mut offset, mut at) = ([0; 3], corner);
        offset[axis] = if is_leaf_above { -1 } else { 1 };
        at[axis] += if is_leaf_above { 0 } else { around.octant.edge() };
        let axis = axis as u8;
        let face =
            Face { corner: at, level, axis, is_leaf_above, leaf_level: level, side, rank: 0 };
        let mut exposed = Vec::new();
        if expose(tree, around.at_offset(offset), face, &mut exposed) {
            exposed.push(face);
        }
        found.extend(exposed.into_iter().map(|face| (word::key_of(corner), face)));
    }
    Ok(())
}

/// Whether all of a square is exposed to the octant across it. If only parts are, the largest of them are appended.
fn expose(tree: &Tree, across: Handle, square: Face, exposed: &mut Vec<Face>) -> bool {
    if !across.is_node() {
        return tree.kinds(across) & OPEN != 0;
    }
    let axis = usize::from(square.axis);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let quarters = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
        let mut quarter = Face { level: square.level + 1, ..square };
        quarter.corner[u] += i * quarter.edge();
        quarter.corner[v] += j * quarter.edge();
        let digit = (i as u8) << u | (j as u8) << v | u8::from(square.is_leaf_above) << axis;
        let child = tree.child(across, digit, square.level);
        expose(tree, child, quarter, exposed).then_some(quarter)
    });
    let is_whole = quarters.iter().all(Option::is_some);
    if !is_whole {
        exposed.extend(quarters.into_iter().flatten());
    }
    is_whole
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

    fn faces(words: &[u64], parts: usize) -> Vec<Face> {
        let (_dir, mesh) = on_disk(words, parts, |i| i / 5);
        front(&mesh, &Selection::default(), &|| Ok(())).unwrap()
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
            words in random_words(LEVEL), parts in 1usize..4
        ) {
            let scale = Octant::ROOT.child(0).edge() >> (LEVEL - 1);
            let expected = expected(&words);
            let leaf_of = |face: &Face| {
                let corner = face.corner.map(|c| c / scale);
                expected.get(&(corner, face.axis as usize)).copied()
            };
            let mut covered = 0;
            let faces = faces(&words, parts);
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
