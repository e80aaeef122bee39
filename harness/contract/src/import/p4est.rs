//! Forests that p4est wrote with `p8est_save`.
//!
//! The file is the connectivity (`p8est_connectivity_sink`), zero bytes up to a multiple of 32, a header of 64-bit numbers
//! (format, sizes, quadrants up to the end of each rank, then of each tree), zero bytes again, and the quadrants: x, y,
//! z and level as 32-bit integers, each followed by the user's data. Numbers are those of the machine that wrote the
//! file, which must be little-endian.
//!
//! Trees are placed by their vertices. `--root` maps the least cube around them onto the root: most forests are in the
//! unit cube, whatever the size of the body.
//!
//! A forest that `harness export` wrote has one byte of data per quadrant: the side, or [`FILLER`]. `--sides data` reads it. The
//! attribute of its only tree, if it has one, is the edge of the root to the last bit.

use super::cells::Cells;
use super::{ImportError, Request, root, side};
use crate::files;
use crate::lattice::Root;
use crate::octant::{CELLS_PER_EDGE, LEVEL_MAX};
use crate::word;

use std::ops::Range;
use std::path::Path;

/// `P8EST_ONDISK_FORMAT`.
pub const FORMAT: u64 = 0x0300_0009;
/// Header and quadrants begin at multiples of this number of bytes.
pub const ALIGNMENT: usize = 32;
/// Bytes of x, y, z and level.
const QUADRANT_BYTES: u64 = 16;
/// Value of `--sides` that takes the sides from the data of the quadrants.
const SIDES: &str = "data";
/// The data of a quadrant that is not a leaf of the mesh: p4est's trees have no holes, so a hole is filled with such quadrants.
pub const FILLER: u8 = 3;

/// Reads a forest.
///
/// # Errors
/// If the file cannot be read, is damaged, or has trees that are not cubes along the axes.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    let bytes = files::read(path)?;
    let mut input = Input { bytes: &bytes, at: 0 };
    let trees = connectivity(&mut input)?;
    input.align()?;
    let (ends, data_bytes) = forest_header(&mut input, trees.len())?;
    input.align()?;
    let with_sides = sides_requested(request, data_bytes)?;
    let stated = match (trees.corners.as_slice(), trees.edges.as_slice()) {
        (&[origin], &[edge]) => Root { origin, edge },
        _ => root::derive(&trees)?,
    };
    let placed = request.root.unwrap_or(stated);
    let scale = placed.edge / stated.edge;
    let sides = with_sides.then(Vec::new);
    let mut cells = Cells { root: Some(placed), sides, ..Cells::default() };
    let mut begin = 0;
    for (tree, end) in ends.into_iter().enumerate() {
        let count = end
            .checked_sub(begin)
            .ok_or_else(|| damaged("the trees' numbers of quadrants decrease"))?;
        let quadrants = input.items(count, QUADRANT_BYTES + data_bytes)?;
        let corner = [0, 1, 2]
            .map(|a| placed.origin[a] + (trees.corners[tree][a] - stated.origin[a]) * scale);
        let tree = Root { origin: corner, edge: trees.edges[tree] * scale };
        add_tree(quadrants, (QUADRANT_BYTES + data_bytes) as usize, &tree, &mut cells)?;
        begin = end;
    }
    Ok(cells)
}

/// Whether the sides are to be read from the quadrants' data.
fn sides_requested(request: &Request, data_bytes: u64) -> Result<bool, ImportError> {
    match (request.sides.as_deref(), data_bytes) {
        (None, _) => Ok(false),
        (Some(SIDES), 1) => Ok(true),
        (Some(name), _) => Err(ImportError::content(format!(
            "has no sides called {name:?}, but {data_bytes} bytes of data per quadrant: omit --sides, or choose --sides {SIDES} \
             if the quadrants have one byte of data, their side"
        ))),
    }
}

fn damaged(why: &str) -> ImportError {
    ImportError::content(format!("is not a usable file of p8est_save, because {why}"))
}

/// The bytes of the file, and how many have been read.
struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Input<'a> {
    /// The next `count` items of `size` bytes each.
    fn items(&mut self, count: u64, size: u64) -> Result<&'a [u8], ImportError> {
        let left = &self.bytes[self.at..];
        match count
            .checked_mul(size)
            .and_then(|n| usize::try_from(n).ok())
            .filter(|&n| n <= left.len())
        {
            Some(n) => {
                self.at += n;
                Ok(&left[..n])
            }
            None => Err(damaged(&format!(
                "it ends at byte {} within {count} items of {size} bytes",
                self.bytes.len()
            ))),
        }
    }

    fn numbers(&mut self, count: u64) -> Result<Vec<u64>, ImportError> {
        let bytes = self.items(count, 8)?;
        Ok(bytes
            .chunks_exact(8)
            .map(|b| u64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect())
    }

    fn array<const N: usize>(&mut self) -> Result<[u64; N], ImportError> {
        Ok(self.numbers(N as u64)?.try_into().expect("as many numbers as were read"))
    }

    /// Skips the zero bytes up to a multiple of [`ALIGNMENT`].
    fn align(&mut self) -> Result<(), ImportError> {
        let padding = self.at.next_multiple_of(ALIGNMENT) - self.at;
        self.items(padding as u64, 1).map(drop)
    }
}

/// The trees as cells.
fn connectivity(input: &mut Input) -> Result<Cells, ImportError> {
    if input.items(8, 1)? != b"p8est\0\0\0" {
        return Err(damaged("it does not begin with p8est"));
    }
    input.items(24, 1)?;
    let [
        format,
        index_bytes,
        vertices,
        trees,
        edges,
        edge_trees,
        corners,
        corner_trees,
        attribute_bytes,
        _,
    ] = input.array::<10>()?;
    if format.swap_bytes() == FORMAT {
        return Err(damaged("its bytes are swapped: a big-endian machine wrote it"));
    }
    if format != FORMAT || index_bytes != 4 {
        return Err(damaged(&format!(
            "its format is {format:#x} with indices of {index_bytes} bytes, and {FORMAT:#x} with 4 is supported"
        )));
    }
    let coordinates = input.items(vertices, 24)?;
    input.items(if edges > 0 { trees } else { 0 }, 12 * 4)?;
    let tree_to_vertex = input.items(if vertices > 0 { trees } else { 0 }, 8 * 4)?;
    input.items(if corners > 0 { trees } else { 0 }, 8 * 4)?;
    // Neighbours across the six faces: trees and faces.
    input.items(trees, 6 * (4 + 1))?;
    let attributes = input.items(trees, attribute_bytes)?;
    for (count, pairs) in [(edges, edge_trees), (corners, corner_trees)] {
        input.items(count.saturating_add(1), 4)?;
        input.items(if count > 0 { pairs } else { 0 }, 4 + 1)?;
    }
    match (vertices, trees) {
        (0, 1) => Ok(Cells { corners: vec![[0.0; 3]], edges: vec![1.0], ..Cells::default() }),
        (0, _) => Err(damaged("it has several trees and no vertices that place them")),
        _ => {
            let mut trees = cubes(coordinates, tree_to_vertex)?;
            if let (Ok(bytes), [edge]) = (attributes.try_into(), &mut trees.edges[..]) {
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
fn cubes(coordinates: &[u8], tree_to_vertex: &[u8]) -> Result<Cells, ImportError> {
    let vertex = |index: &[u8]| {
        let index = u32::from_le_bytes(index.try_into().expect("four bytes")) as usize;
        let place = coordinates.chunks_exact(24).nth(index)?;
        Some(
            [0, 1, 2]
                .map(|a| f64::from_le_bytes(place[8 * a..][..8].try_into().expect("eight bytes"))),
        )
    };
    let mut trees = Cells::default();
    for (tree, indices) in tree_to_vertex.chunks_exact(32).enumerate() {
        let corners: Option<Vec<_>> = indices.chunks_exact(4).map(vertex).collect();
        let corners = corners
            .ok_or_else(|| damaged(&format!("tree {tree} has a vertex that does not exist")))?;
        let (origin, edge) = (corners[0], corners[1][0] - corners[0][0]);
        let in_place = |(digit, corner): (usize, &[f64; 3])| {
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

/// Number of quadrants up to the end of each tree, and bytes of user data per quadrant.
fn forest_header(input: &mut Input, trees: usize) -> Result<(Vec<u64>, u64), ImportError> {
    let [format, coordinate_bytes, _, data_bytes, _, ranks] = input.array::<6>()?;
    if format != FORMAT || coordinate_bytes != 4 {
        return Err(damaged("the header of the forest has another format than the connectivity"));
    }
    let of_ranks = input.numbers(ranks)?;
    let of_trees = input.numbers(trees as u64)?;
    if data_bytes > input.bytes.len() as u64 {
        return Err(damaged(&format!("it states {data_bytes} bytes of data per quadrant")));
    }
    if of_ranks.last() != of_trees.last() {
        return Err(damaged("ranks and trees have different numbers of quadrants"));
    }
    Ok((of_trees, data_bytes))
}

/// Adds the quadrants of a tree, which has `stride` bytes per quadrant.
fn add_tree(
    quadrants: &[u8],
    stride: usize,
    tree: &Root,
    cells: &mut Cells,
) -> Result<(), ImportError> {
    let decode = |quadrant: &[u8]| -> [i32; 4] {
        [0, 1, 2, 3]
            .map(|i| i32::from_le_bytes(quadrant[4 * i..][..4].try_into().expect("four bytes")))
    };
    let Some(last) = quadrants.chunks_exact(stride).next_back().map(decode) else {
        return Err(damaged("a tree has no quadrants"));
    };
    let length = tree_length(last).ok_or_else(|| {
        damaged(&format!(
            "the last quadrant of a tree, {last:?}, does not end in the tree's last corner"
        ))
    })?;
    let mut next = 0;
    for quadrant in quadrants.chunks_exact(stride) {
        let at @ [x, y, z, level] = decode(quadrant);
        if level > i32::from(LEVEL_MAX) {
            return Err(ImportError::content(format!(
                "has a quadrant of level {level} at [{x}, {y}, {z}], and the levels of a mesh are 0 to {LEVEL_MAX}"
            )));
        }
        next = interval(at, length).filter(|interval| interval.start == next).map(|i| i.end).ok_or_else(|| {
            damaged(&format!(
                "the quadrant with the corner [{x}, {y}, {z}] and the level {level} is not an octant of level 0 to \
                 {LEVEL_MAX} that begins where the one before it ends"
            ))
        })?;
        if let Some(sides) = &mut cells.sides {
            match quadrant[QUADRANT_BYTES as usize] {
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
