//! Forests of p4est, tree by tree: whether the leaves of each tree are a complete linear oct-tree or quadtree, and balanced, also
//! across the boundaries of trees; and where two forests differ.
//!
//! Balance is decided where leaves touch: a leaf of level l has no neighbour of a level below l - 1. A leaf lies in one corner of its parent, so whatever touches it
//! outside of the parent touches the parent there, and one that is too coarse contains a cube of the parent's size. So seven cubes
//! (three squares) are looked up for each leaf, by binary search, wherever the topology has them.
//!
//! The check cannot detect needless refinement.

mod isometry;
mod topology;

#[cfg(test)]
mod tests;

use crate::audit::AuditReport;
use crate::checks::{CheckResult, NO_LEAVES};
use crate::promises::Touching;
use contract::import::forest::{Forest, Quadrant};
use isometry::LENGTH;
use std::time::Instant;
use topology::Topology;

/// Lengths of a tree in the versions of p4est.
const LENGTHS: [i64; 3] = [1 << 19, 1 << 29, 1 << 30];

/// A leaf in units of [`LENGTH`].
#[derive(Clone, Copy, Debug)]
struct Leaf {
    corner: [i64; 3],
    level: u32,
    /// The Morton code of its minimum corner.
    key: u128,
}

impl Leaf {
    fn size(&self) -> i64 {
        LENGTH >> self.level
    }

    /// The Morton code after its last one.
    fn end(&self, dimension: usize) -> u128 {
        self.key + (1 << (dimension * self.size().trailing_zeros() as usize))
    }
}

/// The bits of every byte, spread to every second or third bit.
static SPREAD: [[u32; 256]; 2] = [spread_bytes(2), spread_bytes(3)];

const fn spread_bytes(dimension: usize) -> [u32; 256] {
    let mut spread = [0; 256];
    let mut bit = 0;
    while bit < 8 * 256 {
        let (byte, place) = (bit / 8, bit % 8);
        spread[byte] |= (byte as u32 >> place & 1) << (place * dimension);
        bit += 1;
    }
    spread
}

/// The Morton code of a point in a tree.
fn key(dimension: usize, point: [i64; 3]) -> u128 {
    let of_axis = |axis: usize| {
        let bytes = (point[axis] as u32).to_le_bytes().into_iter().enumerate();
        let spread = |(i, byte)| (SPREAD[dimension - 2][byte as usize], 8 * i * dimension);
        bytes.map(spread).map(|(bits, shift)| u128::from(bits) << (shift + axis)).sum::<u128>()
    };
    (0..dimension).map(of_axis).sum()
}

/// The length of a tree, which is that of the version of p4est: most quadrants are octants of such trees.
fn length(forest: &Forest) -> i64 {
    let quadrants = || forest.leaves.iter().flatten();
    let fitting = |&length: &i64| {
        quadrants().filter(|q| leaf(forest.connectivity.dimension, length, q).is_some()).count()
    };
    LENGTHS.into_iter().max_by_key(fitting).expect("three lengths")
}

/// A quadrant in a tree of this length; `None` if it is not an octant of a level that p4est allows.
fn leaf(dimension: usize, length: i64, quadrant: &Quadrant) -> Option<Leaf> {
    let level = u32::try_from(quadrant.level).ok().filter(|&l| l < length.trailing_zeros())?;
    let corner = quadrant.corner.map(|at| i64::from(at) * (LENGTH / length));
    let leaf = Leaf { corner, level, key: 0 };
    let fits = |&at: &i64| (0..LENGTH).contains(&at) && at % leaf.size() == 0;
    corner.iter().all(fits).then(|| Leaf { key: key(dimension, corner), ..leaf })
}

/// A quadrant as findings name it.
fn named(
    tree: usize,
    index: usize,
    Quadrant { corner: [x, y, z], level, .. }: &Quadrant,
) -> String {
    format!("tree {tree}, quadrant {index} (level {level} at {x}, {y}, {z})")
}

/// Checks of the leaves of each tree, of which all later ones assume that the earlier ones hold.
struct Trees {
    leaves: Vec<Vec<Leaf>>,
    valid: CheckResult,
    linear: CheckResult,
    complete: CheckResult,
}

impl Trees {
    fn of(forest: &Forest) -> Self {
        let [valid, linear, complete] = ["valid", "linear", "complete"].map(CheckResult::new);
        let mut trees = Self { leaves: Vec::new(), valid, linear, complete };
        let (dimension, length) = (forest.connectivity.dimension, length(forest));
        for (tree, quadrants) in forest.leaves.iter().enumerate() {
            let mut next = 0;
            let mut leaves = Vec::with_capacity(quadrants.len());
            for (index, quadrant) in quadrants.iter().enumerate() {
                let Some(leaf) = leaf(dimension, length, quadrant) else {
                    let why = "is no octant of a tree whose length is";
                    trees
                        .valid
                        .report_with(|| format!("{} {why} {length}", named(tree, index, quadrant)));
                    continue;
                };
                let name = || named(tree, index, quadrant);
                if leaf.key < next {
                    let why = "begins before the end of the one before it";
                    trees.linear.report_with(|| format!("{} {why}", name()));
                } else if leaf.key > next {
                    let why = "does not begin where the one before it ends, or the tree begins";
                    trees.complete.report_with(|| format!("{} {why}", name()));
                }
                next = leaf.end(dimension);
                leaves.push(leaf);
            }
            if next != 1 << (dimension * LENGTH.trailing_zeros() as usize) {
                let last = quadrants.last().map(|last| named(tree, quadrants.len() - 1, last));
                trees.complete.report(match last {
                    Some(last) => {
                        format!("{last} is the last and does not end where the tree ends")
                    }
                    None => format!("tree {tree} has no quadrants"),
                });
            }
            trees.leaves.push(leaves);
        }
        trees
    }
}

/// Which leaves touch.
struct Balance<'a> {
    forest: &'a Forest,
    topology: &'a Topology,
    trees: &'a [Vec<Leaf>],
    /// Sets of axes along which neighbours must be balanced, as bits.
    directions: Vec<usize>,
}

impl Balance<'_> {
    fn check(&self, result: &mut CheckResult) {
        let second = if self.topology.dimension == 2 { "in a corner" } else { "in an edge" };
        for (tree, leaves) in self.trees.iter().enumerate() {
            result.examined += leaves.len() as u64;
            // Leaves of level 0 and 1 have no neighbour two levels coarser.
            for (index, leaf) in leaves.iter().enumerate().filter(|(_, leaf)| leaf.level > 1) {
                let Some((other, coarse, axes)) = self.too_coarse(tree, leaf) else { continue };
                result.report_with(|| {
                    let name = |tree: usize, index: usize| {
                        named(tree, index, &self.forest.leaves[tree][index])
                    };
                    let what = ["in a face", second, "in a corner"][axes as usize - 1];
                    format!("{} touches {what} {}", name(tree, index), name(other, coarse))
                });
            }
        }
    }

    /// A leaf two or more levels coarser that touches this one, with its tree, and the number of axes along which it lies.
    fn too_coarse(&self, tree: usize, leaf: &Leaf) -> Option<(usize, usize, u32)> {
        let (size, dimension) = (2 * leaf.size(), self.topology.dimension);
        let parent = leaf.corner.map(|at| at & !(size - 1));
        let mut found = None;
        for direction in &self.directions {
            let mut cube = parent;
            for axis in (0..dimension).filter(|axis| direction >> axis & 1 == 1) {
                cube[axis] += if leaf.corner[axis] == parent[axis] { -size } else { size };
            }
            self.topology.same_place(tree, cube, size, &mut |other, corner| {
                let leaves = &self.trees[other];
                let key = key(dimension, corner);
                let index = leaves.partition_point(|leaf| leaf.key <= key) - 1;
                if leaves[index].level + 1 < leaf.level {
                    found = found.or(Some((other, index, direction.count_ones())));
                }
            });
        }
        found
    }
}

/// Checks a forest: its connectivity, the leaves of each tree, and that leaves that touch in this way differ by at most one level.
pub fn audit(forest: &Forest, touching: Touching, start: Instant) -> AuditReport {
    let time_read_s = start.elapsed().as_secs_f64();
    let mut connectivity = CheckResult::new("connectivity");
    let topology = Topology::of(&forest.connectivity, &mut connectivity);
    let mut balance = CheckResult::new("balance");
    let Trees { leaves: of_trees, mut valid, mut linear, mut complete } = Trees::of(forest);
    let leaves = forest.leaves.iter().map(|leaves| leaves.len() as u64).sum();
    let is_tree = [&valid, &linear, &complete].iter().all(|result| result.holds());
    match topology {
        None => balance.lacks("the connectivity contradicts itself"),
        Some(_) if !is_tree => balance.lacks("the leaves are no complete trees"),
        Some(_) if of_trees.iter().flatten().all(|leaf| leaf.level < 2) => {
            balance.lacks("no leaf has a level above 1");
        }
        Some(topology) => {
            let is_asked = |direction: &usize| direction.count_ones() <= touching as u32 + 1;
            let mut directions: Vec<usize> =
                (1..1 << topology.dimension).filter(is_asked).collect();
            directions.sort_by_key(|direction| direction.count_ones());
            let topology = &topology;
            Balance { forest, topology, trees: &of_trees, directions }.check(&mut balance);
        }
    }
    if valid.findings_total + linear.findings_total > 0 {
        complete = CheckResult::new("complete");
        complete.lacks("the leaves are not those of sorted, disjoint octants");
    }
    for result in [&mut valid, &mut linear, &mut complete] {
        match forest.leaves.is_empty() {
            true => result.lacks("the file is a connectivity without leaves"),
            false if result.was_run() => result.examined = leaves,
            false => {}
        }
    }
    let mut checks = vec![connectivity, valid, linear, complete, balance];
    checks.iter_mut().for_each(|result| result.needs_objects(NO_LEAVES));
    let time_wall_s = start.elapsed().as_secs_f64();
    let report = AuditReport { checks, leaves, nodes: 0, time_read_s, time_wall_s };
    report.check_invariants();
    report
}

/// Where two forests differ: in their connectivities, and in their leaves, whatever data they have.
pub fn diff(a: &Forest, b: &Forest) -> [CheckResult; 2] {
    let [mut connectivity, mut leaves] = ["connectivity", "leaves"].map(CheckResult::new);
    connectivity.examined = a.connectivity.trees as u64;
    let (of_a, of_b) = (&a.connectivity, &b.connectivity);
    let fields = [
        ("dimension", of_a.dimension == of_b.dimension),
        ("number of trees", of_a.trees == of_b.trees),
        ("vertices", of_a.vertices == of_b.vertices && of_a.tree_to_vertex == of_b.tree_to_vertex),
        ("faces", of_a.tree_to_tree == of_b.tree_to_tree && of_a.tree_to_face == of_b.tree_to_face),
        ("lists of edges", of_a.edges == of_b.edges),
        ("lists of corners", of_a.corners == of_b.corners),
        ("attributes", of_a.attributes == of_b.attributes),
    ];
    for (field, _) in fields.iter().filter(|(_, is_same)| !is_same) {
        connectivity.report(format!("the {field} of the connectivities differ"));
    }
    leaves.examined = a.leaves.iter().map(|leaves| leaves.len() as u64).sum();
    let place = |leaf: &Quadrant| (leaf.corner, leaf.level);
    for tree in 0..a.leaves.len().max(b.leaves.len()) {
        let [of_a, of_b] =
            [a, b].map(|forest| forest.leaves.get(tree).map_or(&[][..], Vec::as_slice));
        let pairs = of_a.iter().map(place).zip(of_b.iter().map(place));
        let same = pairs.take_while(|(a, b)| a == b).count();
        if same < of_a.len().max(of_b.len()) {
            let name = |leaves: &[Quadrant]| match leaves.get(same) {
                Some(leaf) => named(tree, same, leaf),
                None => format!("no quadrant {same} in tree {tree}"),
            };
            leaves.report_with(|| format!("A has {}, B has {}", name(of_a), name(of_b)));
        }
    }
    let mut results = [connectivity, leaves];
    results.iter_mut().for_each(|result| result.needs_objects(NO_LEAVES));
    results
}
