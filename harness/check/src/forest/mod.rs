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

/// A leaf in units of [`LENGTH`].
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
}

/// The Morton code of a point in a tree.
fn key(dimension: usize, point: [i64; 3]) -> u128 {
    let of_bit = |bit: usize| {
        let of_axis = |axis: usize| (point[axis] as u128 >> bit & 1) << (dimension * bit + axis);
        (0..dimension).map(of_axis).sum::<u128>()
    };
    (0..LENGTH.trailing_zeros() as usize).map(of_bit).sum()
}

/// A quadrant in a tree of this length; `None` if it is not an octant.
fn leaf(dimension: usize, length: i64, quadrant: &Quadrant) -> Option<Leaf> {
    let corner = quadrant.corner.map(|at| i64::from(at) * (LENGTH / length));
    let leaf = || Leaf { corner, level: quadrant.level as u32, key: key(dimension, corner) };
    quadrant.is_octant(length).then(leaf)
}

/// A quadrant as findings name it.
fn named(tree: usize, index: usize, quadrant: &Quadrant) -> String {
    let Quadrant { corner: [x, y, z], level, .. } = quadrant;
    format!("tree {tree}, quadrant {index} (level {level} at {x}, {y}, {z})")
}

/// The leaves of each tree, and the checks `valid`, `linear` and `complete`.
fn trees(forest: &Forest) -> (Vec<Vec<Leaf>>, [CheckResult; 3]) {
    let [mut valid, mut linear, mut complete] =
        ["valid", "linear", "complete"].map(CheckResult::new);
    let (dimension, length) = (forest.connectivity.dimension, forest.length());
    let mut all = Vec::new();
    for (tree, quadrants) in forest.leaves.iter().enumerate() {
        let (mut next, mut leaves) = (0, Vec::with_capacity(quadrants.len()));
        for (index, quadrant) in quadrants.iter().enumerate() {
            let name = || named(tree, index, quadrant);
            let Some(leaf) = leaf(dimension, length, quadrant) else {
                let why = format_args!("is no octant of a tree whose length is {length}");
                valid.report(format_args!("{} {why}", name()));
                continue;
            };
            if leaf.key < next {
                let why = "begins before the end of the one before it";
                linear.report(format_args!("{} {why}", name()));
            } else if leaf.key > next {
                let why = "does not begin where the one before it ends, or the tree begins";
                complete.report(format_args!("{} {why}", name()));
            }
            next = leaf.key + (1 << (dimension * leaf.size().trailing_zeros() as usize));
            leaves.push(leaf);
        }
        if next != 1 << (dimension * LENGTH.trailing_zeros() as usize) {
            complete.report(match quadrants.last() {
                Some(last) => {
                    let last = named(tree, quadrants.len() - 1, last);
                    format!("{last} is the last and does not end where the tree ends")
                }
                None => format!("tree {tree} has no quadrants"),
            });
        }
        all.push(leaves);
    }
    (all, [valid, linear, complete])
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
                let [fine, coarse] = [(tree, index), (other, coarse)]
                    .map(|(tree, index)| named(tree, index, &self.forest.leaves[tree][index]));
                let what = ["in a face", second, "in a corner"][axes as usize - 1];
                result.report(format_args!("{fine} touches {what} {coarse}"));
            }
        }
    }

    /// A leaf two or more levels coarser that touches this one, with its tree, and the number of axes along which it lies.
    fn too_coarse(&self, tree: usize, leaf: &Leaf) -> Option<(usize, usize, u32)> {
        let (size, dimension) = (2 * leaf.size(), self.topology.dimension);
        let parent = leaf.corner.map(|at| at & !(size - 1));
        for direction in &self.directions {
            let mut cube = parent;
            for axis in (0..dimension).filter(|axis| direction >> axis & 1 == 1) {
                cube[axis] += if leaf.corner[axis] == parent[axis] { -size } else { size };
            }
            for (other, corner) in self.topology.same_place(tree, cube, size) {
                let (leaves, key) = (&self.trees[other], key(dimension, corner));
                let index = leaves.partition_point(|leaf| leaf.key <= key) - 1;
                if leaves[index].level + 1 < leaf.level {
                    return Some((other, index, direction.count_ones()));
                }
            }
        }
        None
    }
}

/// Checks a forest: its connectivity, the leaves of each tree, and that leaves that touch in this way differ by at most one level.
pub fn audit(forest: &Forest, touching: Touching, start: Instant) -> AuditReport {
    let time_read_s = start.elapsed().as_secs_f64();
    let mut connectivity = CheckResult::new("connectivity");
    let topology = Topology::of(&forest.connectivity, &mut connectivity);
    let mut balance = CheckResult::new("balance");
    let (of_trees, [mut valid, mut linear, mut complete]) = trees(forest);
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
            let mut directions: Vec<_> = (1..1 << topology.dimension).filter(is_asked).collect();
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
    // Versions of p4est differ in the length of a tree.
    let [in_a, in_b] = [a, b].map(|forest| {
        let scale = LENGTH / forest.length();
        move |leaf: &Quadrant| (leaf.corner.map(|at| i64::from(at) * scale), leaf.level)
    });
    for tree in 0..a.leaves.len().max(b.leaves.len()) {
        let [of_a, of_b] = [a, b].map(|of| of.leaves.get(tree).map_or(&[][..], Vec::as_slice));
        let pairs = of_a.iter().map(&in_a).zip(of_b.iter().map(&in_b));
        let same = pairs.take_while(|(a, b)| a == b).count();
        if same < of_a.len().max(of_b.len()) {
            let name = |leaves: &[Quadrant]| match leaves.get(same) {
                Some(leaf) => named(tree, same, leaf),
                None => format!("no quadrant {same} in tree {tree}"),
            };
            leaves.report(format_args!("A has {}, B has {}", name(of_a), name(of_b)));
        }
    }
    let mut results = [connectivity, leaves];
    results.iter_mut().for_each(|result| result.needs_objects(NO_LEAVES));
    results
}
