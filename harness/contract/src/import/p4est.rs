//! Forests that p4est wrote with `p8est_save`, as one mesh.
//!
//! Trees are placed by their vertices. `--root` maps the least cube around them onto the root; the root of a case does so for forests in the
//! unit cube only, which most are, whatever the size of the body.
//!
//! A forest that `harness export` wrote has one byte of data per quadrant: the side, [`NO_SIDE`] or [`FILLER`]. `--sides data` reads it;
//! otherwise data are those of any program, and fillers are cells. The
//! attribute of its only tree, if it has one, is the edge of the root to the last bit.

use super::cells::Cells;
use super::forest::{self, Connectivity, Quadrant, damaged};
use super::{Request, side};
use crate::failure::{Failure, Result};
use crate::lattice::Root;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX};
use crate::word;

use std::path::Path;

/// Value of `--sides` that takes the sides from the data of the quadrants.
const SIDES: &str = "data";
/// The data of a quadrant that is not a leaf of the mesh: p4est's trees have no holes, so a hole is filled with such quadrants.
pub const FILLER: u8 = 3;
/// The data of a leaf in a mesh whose sides are unknown.
pub const NO_SIDE: u8 = 4;

/// Reads a forest.
///
/// # Errors
/// If the file cannot be read, is damaged, or has trees that are not cubes along the axes.
pub fn read(path: &Path, request: &Request) -> Result<Cells> {
    let forest = forest::read(path)?;
    let why = "has quadrants of two dimensions, and a mesh has three: harness audit and harness diff read such forests";
    Failure::unless(forest.connectivity.dimension == 3, why)?;
    Failure::unless(!forest.leaves.is_empty(), damaged("it is a connectivity without leaves"))?;
    let trees = placed_trees(&forest.connectivity)?;
    let (name, data_bytes) = (request.sides.as_deref().unwrap_or(SIDES), forest.data_bytes);
    let why = format!(
        "has no sides called {name:?}, but {data_bytes} bytes of data per quadrant: omit --sides, or choose --sides \
         {SIDES} if the quadrants have one byte of data, their side"
    );
    Failure::unless(request.sides.is_none() || name == SIDES && data_bytes == 1, why)?;
    let stated = match (trees.corners.as_slice(), trees.edges.as_slice()) {
        (&[origin], &[edge]) => Root { origin, edge },
        _ => trees.least_root()?,
    };
    let placed = request.root.unwrap_or(stated);
    let units = 1e-9 * placed.edge;
    let ends = |root: &Root| [root.origin[0], root.origin[1], root.origin[2], root.edge];
    let is_there = ends(&stated).iter().zip(ends(&placed)).all(|(a, b)| (a - b).abs() <= units);
    // The root of most forests is the unit cube, whatever the size of the body.
    let why = format!(
        "states the root {stated}, and the case has {placed}: give --root to move the forest into that"
    );
    Failure::unless(!request.is_root_of_case || stated == Root::UNIT || is_there, why)?;
    let (scale, length) = (placed.edge / stated.edge, forest.length());
    let sides = request.sides.as_ref().map(|_| Vec::new());
    let mut cells = Cells { root: Some(placed), sides, ..Cells::default() };
    for (tree, quadrants) in forest.leaves.iter().enumerate() {
        let offset = |a: usize| (trees.corners[tree][a] - stated.origin[a]) * scale;
        let origin = [0, 1, 2].map(|a| placed.origin[a] + offset(a));
        let tree = Root { origin, edge: trees.edges[tree] * scale };
        add_tree(quadrants, length, &tree, &mut cells)?;
    }
    cells.sides = cells.sides.filter(|sides| !sides.is_empty());
    let is_whole = cells.sides.as_ref().is_none_or(|sides| sides.len() == cells.edges.len());
    Failure::unless(is_whole, damaged("only some of its leaves have a side"))?;
    Ok(cells)
}

/// The trees as cells.
fn placed_trees(connectivity: &Connectivity) -> Result<Cells> {
    let Connectivity { vertices, tree_to_vertex, attributes, .. } = connectivity;
    let mut trees = Cells::default();
    if vertices.is_empty() {
        let why = "it has several trees and no vertices that place them";
        Failure::unless(connectivity.trees == 1, damaged(why))?;
        trees.push([0.0; 3], 1.0);
    }
    let vertex = |&index: &i32| vertices.get(usize::try_from(index).ok()?);
    for (tree, indices) in tree_to_vertex.chunks_exact(8).enumerate() {
        let missing = || damaged(&format!("tree {tree} has a vertex that does not exist"));
        let corners = indices.iter().map(vertex).collect::<Option<Vec<_>>>().ok_or_else(missing)?;
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
    if let (Ok(bytes), [edge]) = (attributes.as_slice().try_into(), &mut trees.edges[..]) {
        // Any program may have attributes of eight bytes.
        let exact = f64::from_le_bytes(bytes);
        *edge = if (exact - *edge).abs() <= 1e-9 * *edge { exact } else { *edge };
    }
    Ok(trees)
}

/// Adds the quadrants of a tree, which are complete: each begins where the one before it ends, on the Morton curve.
fn add_tree(quadrants: &[Quadrant], length: i64, tree: &Root, cells: &mut Cells) -> Result<()> {
    let mut next = 0;
    for quadrant in quadrants {
        let &Quadrant { corner, level, data } = quadrant;
        let cell = corner.map(|at| (i64::from(at) * i64::from(CELLS_PER_EDGE) / length) as u32);
        let is_octant = quadrant.is_octant(length) && level <= i32::from(LEVEL_MAX);
        if !is_octant || word::key_of(cell) != next {
            return Err(damaged(&format!(
                "the quadrant with the corner {corner:?} and the level {level} is not an octant of level 0 to \
                 {LEVEL_MAX} that begins where the one before it ends"
            )));
        }
        let level = level as u8;
        next += word::span(level);
        match (&mut cells.sides, data) {
            (Some(_), FILLER) => continue,
            (Some(_), NO_SIDE) | (None, _) => {}
            (Some(sides), code) => sides.push(side(f64::from(code), cells.edges.len())?),
        }
        let along = corner.map(|c| f64::from(c) / length as f64 * tree.edge);
        cells.push([0, 1, 2].map(|a| tree.origin[a] + along[a]), tree.edge_of(level));
    }
    let why = "the last quadrant of a tree does not end in the tree's last corner";
    Failure::unless(next == word::KEY_END, damaged(why))
}
