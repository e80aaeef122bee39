//! Forests of p4est, in two and three dimensions, as `p4est_save` and `p8est_save` write them, and connectivities by themselves.
//!
//! The file is the connectivity (`p4est_connectivity_sink`), zero bytes up to a multiple of 32, a header of 64-bit numbers
//! (format, sizes, quadrants up to the end of each rank, then of each tree), zero bytes again, and the quadrants: x, y, in three
//! dimensions z, and level as 32-bit integers, each followed by the user's data. Numbers are those of the machine that wrote the
//! file, which must be little-endian.
//!
//! No memory is allocated for a count before the file has been seen to be long enough for it. Nothing else is checked here: indices
//! and quadrants are those of the file.

use crate::failure::{Failure, Result};
use crate::files;
use bytemuck::{Pod, pod_collect_to_vec};
use std::path::Path;

/// `P4EST_ONDISK_FORMAT`.
const FORMAT_PLANE: u64 = 0x0200_0009;
/// `P8EST_ONDISK_FORMAT`.
pub const FORMAT: u64 = 0x0300_0009;
/// Lengths of a tree in integer coordinates, in the versions of p4est.
const LENGTHS: [i64; 3] = [1 << 19, 1 << 29, 1 << 30];
/// Header and quadrants begin at multiples of this number of bytes.
pub const ALIGNMENT: usize = 32;

/// Trees and how they are glued, as in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connectivity {
    /// 2 or 3.
    pub dimension: usize,
    /// Number of trees.
    pub trees: usize,
    /// Coordinates of all vertices.
    pub vertices: Vec<[f64; 3]>,
    /// The vertices of each tree, if there are vertices.
    pub tree_to_vertex: Vec<i32>,
    /// The tree across each face.
    pub tree_to_tree: Vec<i32>,
    /// Its face, plus the number of faces times the orientation.
    pub tree_to_face: Vec<i8>,
    /// Edges at which trees meet; in two dimensions none.
    pub edges: Lists,
    /// Corners at which trees meet.
    pub corners: Lists,
    /// Attributes of all trees.
    pub attributes: Vec<u8>,
}

/// Edges or corners at which trees meet: each is a list of places in trees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lists {
    /// The list that has a place of a tree, or -1; empty without lists.
    pub of_tree: Vec<i32>,
    /// Where each list begins, and the end of the last one.
    pub offsets: Vec<i32>,
    /// The trees of all lists.
    pub trees: Vec<i32>,
    /// Their edges or corners; 12 is added to an edge that runs in the opposite direction.
    pub places: Vec<i8>,
}

/// A leaf, as in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quadrant {
    /// The minimum corner, in units that depend on the version of p4est; z is 0 in two dimensions.
    pub corner: [i32; 3],
    /// The level.
    pub level: i32,
    /// The first byte of the user's data, or 0.
    pub data: u8,
}

impl Quadrant {
    /// Whether it is an octant, of a level that p4est allows, of a tree of this length.
    pub fn is_octant(&self, length: i64) -> bool {
        let is_multiple = |at: i32, edge| (0..length).contains(&at.into()) && at % edge == 0;
        (0..length.trailing_zeros() as i32).contains(&self.level)
            && self.corner.iter().all(|&at| is_multiple(at, (length >> self.level) as i32))
    }
}

/// A forest.
#[derive(Clone, Debug, PartialEq)]
pub struct Forest {
    /// The trees.
    pub connectivity: Connectivity,
    /// The leaves of each tree; empty if the file is a connectivity alone.
    pub leaves: Vec<Vec<Quadrant>>,
    /// Bytes of the user's data per quadrant.
    pub data_bytes: u64,
}

impl Forest {
    /// The length of a tree, which is that of the version of p4est: most quadrants are octants of such trees.
    pub fn length(&self) -> i64 {
        let all = || self.leaves.iter().flatten();
        let fitting = |&length: &i64| all().filter(|quadrant| quadrant.is_octant(length)).count();
        LENGTHS.into_iter().max_by_key(fitting).expect("three lengths")
    }

    /// Whether the mesh is an oct-tree in one root.
    pub fn is_one_cube(&self) -> bool {
        let of = &self.connectivity;
        let is_boundary = (0..).zip(&of.tree_to_face).all(|(face, &to)| face == to);
        let is_alone = of.edges.trees.is_empty() && of.corners.trees.is_empty() && is_boundary;
        of.dimension == 3 && of.trees == 1 && of.tree_to_tree == [0; 6] && is_alone
    }
}

/// Reads a forest or a connectivity.
///
/// # Errors
/// If the file cannot be read or is damaged.
pub fn read(path: &Path) -> Result<Forest> {
    let bytes = files::read(path).map_err(Failure::unreadable)?;
    let mut input = Input { bytes: &bytes, at: 0 };
    let (connectivity, format) = connectivity(&mut input)?;
    let mut forest = Forest { connectivity, leaves: Vec::new(), data_bytes: 0 };
    if input.at == bytes.len() {
        return Ok(forest);
    }
    input.align()?;
    let [own_format, coordinate_bytes, _, data_bytes, _, ranks] = input.array::<6>()?;
    let why = "the header of the forest has another format than the connectivity";
    Failure::unless(own_format == format && coordinate_bytes == 4, damaged(why))?;
    // Numbers of quadrants up to the end of each rank's part, and of each tree.
    let of_ranks: Vec<u64> = input.numbers(ranks, 1)?;
    let ends: Vec<u64> = input.numbers(forest.connectivity.trees as u64, 1)?;
    let why = format!("it states {data_bytes} bytes of data per quadrant");
    Failure::unless(data_bytes <= bytes.len() as u64, damaged(&why))?;
    let why = "ranks and trees have different numbers of quadrants";
    Failure::unless(of_ranks.last() == ends.last(), damaged(why))?;
    input.align()?;
    forest.data_bytes = data_bytes;
    let (dimension, mut begin) = (forest.connectivity.dimension, 0);
    let own_bytes = 4 * (dimension + 1);
    for end in ends {
        let decrease = || damaged("the trees' numbers of quadrants decrease");
        let count = end.checked_sub(begin).ok_or_else(decrease)?;
        let stride = own_bytes as u64 + data_bytes;
        let records = input.items(count, stride)?.chunks_exact(stride as usize);
        let quadrant = |record: &[u8]| {
            let numbers: Vec<i32> = pod_collect_to_vec(&record[..own_bytes]);
            let z = if dimension == 3 { numbers[2] } else { 0 };
            let data = record.get(own_bytes).copied().unwrap_or(0);
            Quadrant { corner: [numbers[0], numbers[1], z], level: numbers[dimension], data }
        };
        forest.leaves.push(records.map(quadrant).collect());
        begin = end;
    }
    let why = format!("{} bytes follow its quadrants", bytes.len() - input.at);
    Failure::unless(input.at == bytes.len(), damaged(&why))?;
    Ok(forest)
}

pub(super) fn damaged(why: &str) -> Failure {
    Failure::input(format!("is not a usable file of p4est, because {why}"))
}

/// The bytes of the file, and how many have been read.
struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Input<'a> {
    /// The next `count` items of `size` bytes each.
    fn items(&mut self, count: u64, size: u64) -> Result<&'a [u8]> {
        let left = &self.bytes[self.at..];
        let bytes = count.checked_mul(size).and_then(|bytes| usize::try_from(bytes).ok());
        let end = self.bytes.len();
        let ends =
            || damaged(&format!("it ends at byte {end} within {count} items of {size} bytes"));
        let items = bytes.and_then(|bytes| left.get(..bytes)).ok_or_else(ends)?;
        self.at += items.len();
        Ok(items)
    }

    /// As many numbers for each of `count` items.
    fn numbers<T: Pod>(&mut self, count: u64, each: u64) -> Result<Vec<T>> {
        Ok(pod_collect_to_vec(self.items(count, each * size_of::<T>() as u64)?))
    }

    fn array<const N: usize>(&mut self) -> Result<[u64; N]> {
        Ok(self.numbers(N as u64, 1)?.try_into().expect("as many numbers as were read"))
    }

    /// The lists of `count` edges or corners, given which one each place of a tree has.
    fn lists(&mut self, of_tree: Vec<i32>, count: u64, pairs: u64) -> Result<Lists> {
        let offsets = self.numbers(count.saturating_add(1), 1)?;
        let why = "it states trees at edges or corners, and none where trees meet";
        Failure::unless(count > 0 || pairs == 0, damaged(why))?;
        let (trees, places) = (self.numbers(pairs, 1)?, self.numbers(pairs, 1)?);
        Ok(Lists { of_tree, offsets, trees, places })
    }

    /// Skips the zero bytes up to a multiple of [`ALIGNMENT`].
    fn align(&mut self) -> Result<()> {
        self.items((self.at.next_multiple_of(ALIGNMENT) - self.at) as u64, 1).map(drop)
    }
}

/// The connectivity, and the format of the file.
fn connectivity(input: &mut Input) -> Result<(Connectivity, u64)> {
    let (dimension, expected) = match input.items(8, 1)? {
        b"p4est\0\0\0" => (2, FORMAT_PLANE),
        b"p8est\0\0\0" => (3, FORMAT),
        _ => return Err(damaged("it does not begin with p4est or p8est")),
    };
    input.items(24, 1)?;
    let [format, index_bytes] = input.array()?;
    let [vertices, trees, edges, edge_trees] = input.array()?;
    let [corners, corner_trees, attribute_bytes, _] = input.array()?;
    let why = format!(
        "its format is {format:#x} with indices of {index_bytes} bytes, and {expected:#x} with 4 is supported"
    );
    Failure::unless(format == expected && index_bytes == 4, damaged(&why))?;
    let if_any = |count: u64| if count > 0 { trees } else { 0 };
    let (children, faces) = (1 << dimension, 2 * dimension as u64);
    let coordinates = input.numbers(vertices, 1)?;
    let tree_to_edge = input.numbers(if_any(edges), 12)?;
    let tree_to_vertex = input.numbers(if_any(vertices), children)?;
    let tree_to_corner = input.numbers(if_any(corners), children)?;
    // Fields are read in this order, which is that of the file.
    let connectivity = Connectivity {
        dimension,
        trees: trees as usize,
        vertices: coordinates,
        tree_to_vertex,
        tree_to_tree: input.numbers(trees, faces)?,
        tree_to_face: input.numbers(trees, faces)?,
        attributes: input.items(trees, attribute_bytes)?.to_vec(),
        edges: match dimension {
            // p4est writes no offsets of edges in two dimensions.
            2 => Lists { of_tree: tree_to_edge, ..Lists::default() },
            _ => input.lists(tree_to_edge, edges, edge_trees)?,
        },
        corners: input.lists(tree_to_corner, corners, corner_trees)?,
    };
    Ok((connectivity, format))
}
