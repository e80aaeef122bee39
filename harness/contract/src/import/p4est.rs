//! Forests that p4est wrote with `p8est_save`, as one mesh.
//!
//! Trees are placed by their vertices. `--root` maps the least cube around them onto the root; the root of a case does so for forests in the
//! unit cube only, which most are, whatever the size of the body.
//!
//! A forest that `harness export` wrote has one byte of data per quadrant: the side, or [`FILLER`]. `--sides data` reads it. The
//! attribute of its only tree, if it has one, is the edge of the root to the last bit.

use super::cells::Cells;
use super::forest::{self, Connectivity, Quadrant, damaged};
use super::{Request, root, side};
use crate::failure::Unusable;
use crate::lattice::Root;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX};
use crate::word;

use std::ops::Range;
use std::path::Path;

/// The root of most forests, whatever the size of the body.
const UNIT: Root = Root { origin: [0.0; 3], edge: 1.0 };

/// Value of `--sides` that takes the sides from the data of the quadrants.
const SIDES: &str = "data";
/// The data of a quadrant that is not a leaf of the mesh: p4est's trees have no holes, so a hole is filled with such quadrants.
pub const FILLER: u8 = 3;

/// Reads a forest.
///
/// # Errors
/// If the file cannot be read, is damaged, or has trees that are not cubes along the axes.
pub fn read(path: &Path, request: &Request) -> Result<Cells, Unusable> {
    let forest = forest::read(path)?;
    if forest.connectivity.dimension == 2 {
        let why = "has quadrants of two dimensions, and a mesh has three: harness audit and harness diff read such forests";
        return Err(Unusable::because(why));
    }
    if forest.leaves.is_empty() {
        return Err(damaged("it is a connectivity without leaves"));
    }
    let trees = placed_trees(&forest.connectivity)?;
    let with_sides = sides_requested(request, forest.data_bytes)?;
    let stated = match (trees.corners.as_slice(), trees.edges.as_slice()) {
        (&[origin], &[edge]) => Root { origin, edge },
        _ => root::derive(&trees)?,
    };
    let placed = request.root.unwrap_or(stated);
    let units = 1e-9 * placed.edge;
    let ends = |root: &Root| [root.origin[0], root.origin[1], root.origin[2], root.edge];
    let is_there = ends(&stated).iter().zip(ends(&placed)).all(|(a, b)| (a - b).abs() <= units);
    if request.is_root_of_case && stated != UNIT && !is_there {
        return Err(Unusable::because(format!(
            "states the root {stated}, and the case has {placed}: give --root to move the forest into that"
        )));
    }
    let scale = placed.edge / stated.edge;
    let sides = with_sides.then(Vec::new);
    let mut cells = Cells { root: Some(placed), sides, ..Cells::default() };
    for (tree, quadrants) in forest.leaves.iter().enumerate() {
        let corner = [0, 1, 2]
            .map(|a| placed.origin[a] + (trees.corners[tree][a] - stated.origin[a]) * scale);
        let tree = Root { origin: corner, edge: trees.edges[tree] * scale };
        add_tree(quadrants, &tree, &mut cells)?;
    }
    Ok(cells)
}

/// Whether the sides are to be read from the quadrants' data.
fn sides_requested(request: &Request, data_bytes: u64) -> Result<bool, Unusable> {
    match (request.sides.as_deref(), data_bytes) {
        (None, _) => Ok(false),
        (Some(SIDES), 1) => Ok(true),
        (Some(name), _) => Err(Unusable::because(format!(
            "has no sides called {name:?}, but {data_bytes} bytes of data per quadrant: omit --sides, or choose --sides {SIDES} \
             if the quadrants have one byte of data, their side"
        ))),
    }
}

/// The trees as cells.
fn placed_trees(connectivity: &Connectivity) -> Result<Cells, Unusable> {
    let Connectivity { vertices, tree_to_vertex, attributes, .. } = connectivity;
    match (vertices.len(), connectivity.trees) {
        (0, 1) => Ok(Cells { corners: vec![[0.0; 3]], edges: vec![1.0], ..Cells::default() }),
        (0, _) => Err(damaged("it has several trees and no vertices that place them")),
        _ => {
            let mut trees = cubes(vertices, tree_to_vertex)?;
            if let (Ok(bytes), [edge]) = (attributes.as_slice().try_into(), &mut trees.edges[..]) {
                // Any program may have attributes of eight bytes.
                let exact = f64::from_le_bytes(bytes);
                let is_edge = (exact - *edge).abs() <= 1e-9 * *edge;
                *edge = if is_edge { exact } else { *edge };
            }
            Ok(trees)
        }
    }
}

/// The cubes of the trees, from the coordinates of all vertices and the eight vertices of each tree.
fn cubes(coordinates: &[[f64; 3]], tree_to_vertex: &[i32]) -> Result<Cells, Unusable> {
    let vertex = |&index: &i32| coordinates.get(usize::try_from(index).ok()?);
    let mut trees = Cells::default();
    for (tree, indices) in tree_to_vertex.chunks_exact(8).enumerate() {
        let corners: Option<Vec<_>> = indices.iter().map(vertex).collect();
        let corners = corners
            .ok_or_else(|| damaged(&format!("tree {tree} has a vertex that does not exist")))?;
        let (origin, edge) = (*corners[0], corners[1][0] - corners[0][0]);
        let in_place = |(digit, corner): (usize, &&[f64; 3])| {
            (0..3).all(|a| {
                let expected = origin[a] + if digit >> a & 1 == 1 { edge } else { 0.0 };
                (corner[a] - expected).abs() <= 1e-9 * edge
            })
        };
        if !corners.iter().enumerate().all(in_place) || edge <= 0.0 {
            return Err(damaged(&format!(
                "tree {tree} is not a cube along x, y and z: only forests of such trees are oct-trees with one root"
            )));
        }
        trees.push(origin, edge);
    }
    Ok(trees)
}

/// Adds the quadrants of a tree.
fn add_tree(quadrants: &[Quadrant], tree: &Root, cells: &mut Cells) -> Result<(), Unusable> {
    let Some(&Quadrant { corner: [x, y, z], level, .. }) = quadrants.last() else {
        return Err(damaged("a tree has no quadrants"));
    };
    let last = [x, y, z, level];
    let length = tree_length(last).ok_or_else(|| {
        damaged(&format!(
            "the last quadrant of a tree, {last:?}, does not end in the tree's last corner"
        ))
    })?;
    let mut next = 0;
    for &Quadrant { corner: [x, y, z], level, data } in quadrants {
        if level > i32::from(LEVEL_MAX) {
            return Err(Unusable::because(format!(
                "has a quadrant of level {level} at [{x}, {y}, {z}], and the levels of a mesh are 0 to {LEVEL_MAX}"
            )));
        }
        let covered = interval([x, y, z, level], length);
        next = covered.filter(|interval| interval.start == next).map(|i| i.end).ok_or_else(|| {
            damaged(&format!(
                "the quadrant with the corner [{x}, {y}, {z}] and the level {level} is not an octant of level 0 to \
                 {LEVEL_MAX} that begins where the one before it ends"
            ))
        })?;
        if let Some(sides) = &mut cells.sides {
            match data {
                FILLER => continue,
                code => sides.push(side(f64::from(code), cells.edges.len())?),
            }
        }
        let along = [x, y, z].map(|c| f64::from(c) / f64::from(length) * tree.edge);
        cells.push(
            [0, 1, 2].map(|a| tree.origin[a] + along[a]),
            tree.edge / f64::from(1u32 << level),
        );
    }
    Ok(())
}

/// The Morton codes, in units of level-19 cells, that a quadrant covers in a tree of this length; `None` if it is not an
/// octant of a level that leaf words have.
fn interval([x, y, z, level]: [i32; 4], length: u32) -> Option<Range<u64>> {
    let level = u8::try_from(level).ok().filter(|&level| level <= LEVEL_MAX)?;
    let edge = length >> level;
    let mut corner = [0; 3];
    for (cell, coordinate) in corner.iter_mut().zip([x, y, z]) {
        let coordinate = u32::try_from(coordinate)
            .ok()
            .filter(|&c| c < length && c.checked_rem(edge) == Some(0))?;
        *cell = (u64::from(coordinate) * u64::from(CELLS_PER_EDGE) / u64::from(length)) as u32;
    }
    let start = word::key_of(corner);
    Some(start..start + word::span(level))
}

/// Length of a tree in integer coordinates, which differs between versions of p4est: a tree is complete, so its last
/// quadrant ends where the tree ends.
fn tree_length([x, y, z, level]: [i32; 4]) -> Option<u32> {
    if x != y || y != z || x < 0 || !(0..=30).contains(&level) {
        return None;
    }
    let (before, cells) = (x as u32, 1u32 << level);
    match cells {
        1 => (before == 0).then_some(1),
        _ => Some(before.checked_div(cells - 1)? << level)
            .filter(|&length| length.is_power_of_two() && length - length / cells == before),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_of_a_tree_is_that_of_the_version_that_wrote_it() {
        for length in [1 << 19, 1 << 29, 1u32 << 30] {
            for level in [1, 2, 5, 18] {
                let last = (length - (length >> level)) as i32;
                let length_found = tree_length([last, last, last, level]);
                assert_eq!(length_found, Some(length), "level {level}");
            }
        }
        assert_eq!(tree_length([0, 0, 0, 0]), Some(1));
        // Not the last quadrant of any tree: off its diagonal, outside it, too fine, or not at its end.
        for quadrant in [
            [4, 4, 2, 1],
            [4, 2, 4, 1],
            [2, 4, 4, 1],
            [-4, -4, -4, 1],
            [4, 4, 4, -1],
            [4, 4, 4, 31],
            [4, 4, 4, 2],
            [6, 6, 6, 1],
            [1, 1, 1, 0],
            [0, 0, 0, 1],
        ] {
            assert_eq!(tree_length(quadrant), None, "{quadrant:?}");
        }
    }
}
