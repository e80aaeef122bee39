//! The rehearsal: the same mesh made a few levels coarser tells what a base leaf will hold.
//!
//! Leaves along a surface grow by four per level, those that its curvature, edges and tips add by two, as
//! layers there are thicker the coarser the mesh. What is which, the facets' area tells. Parts of the
//! rehearsal are Morton cuts by area, so that it is divided well itself.

use super::cut::Cut;
use super::{route, starts};
use crate::comm::Comm;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::{Level, start57};
use crate::partition::morton_cuts;
use crate::partition::ownership::Ownership;
use crate::stream::Leaves;
use crate::tree::Tree;
use crate::voxelise::{BinnedFacets, Depth, refine};
use crate::{grade, kept, sides};

/// Levels that a rehearsal is coarser: it takes a 64th of the cells. With fewer it costs more and tells less,
/// as what a base leaf has beyond its area is taken to grow with the size only.
const COARSER: Level = 3;

/// Deepest level of base leaves that can be rehearsed as it should be.
pub fn deepest(rules: &Rules) -> Level {
    rules.level_surface.saturating_sub(COARSER + 2)
}

/// Leaves to expect in each base leaf, the same on all ranks; where the tree is too shallow to rehearse, what
/// area lets expect. Collective.
pub fn weights(facets: &[Facet], rules: &Rules, cut: &Cut, comm: &dyn Comm) -> Vec<u64> {
    let expected = cut.weights();
    // The base leaves of the coarse tree must be those of the fine one.
    let Some(coarser) = rules.level_surface.checked_sub(cut.level_base() + 2) else {
        return expected;
    };
    let coarser = coarser.min(COARSER);
    if coarser == 0 || comm.size() == 1 {
        return expected;
    }
    let coarse = coarsen(rules, coarser, cut.level_base());
    let mut counts = vec![0u64; expected.len()];
    let all = comm.all_gather(&rehearse(facets, &coarse, cut, &expected, comm));
    for &[leaf, count] in all.words().as_chunks().0 {
        counts[leaf as usize] += count;
    }
    extrapolate(&expected, &counts, 1 << coarser)
}

/// Leaves to expect where a mesh `scale` times coarser has `counts`, and area lets expect `expected`.
///
/// The latter is put right in all; what a leaf has more or less than that says is taken to grow with the
/// size only, be it by curvature, edges and tips, or as layers reach from one leaf into the next.
fn extrapolate(expected: &[u64], counts: &[u64], scale: u64) -> Vec<u64> {
    let sum = |all: &[u64]| all.iter().map(|&n| n as f64).sum::<f64>();
    let scale = scale as f64;
    let right = sum(counts) * scale * scale / sum(expected).max(1.0);
    let weight = |(&thought, &told): (&u64, &u64)| {
        let leaves = told as f64 * scale + thought as f64 * right * (1.0 - 1.0 / scale);
        // A base leaf is a leaf at least; where a rehearsal kept nothing, they are all alike.
        (leaves as u64).max(1)
    };
    expected.iter().zip(counts).map(weight).collect()
}

/// The same rules for a coarser mesh whose base tree is equal down to the base leaves.
fn coarsen(rules: &Rules, coarser: Level, level_base: Level) -> Rules {
    let level = |b: &ExtentBox| b.level.saturating_sub(coarser).max(b.level.min(level_base + 1));
    Rules {
        level_surface: rules.level_surface - coarser,
        boxes: rules.boxes.iter().map(|b| ExtentBox { level: level(b), ..*b }).collect(),
        ..rules.clone()
    }
}

/// Leaves of the coarse mesh that this rank answers for, by base leaf: its number and how many, in turn.
/// Collective.
fn rehearse(
    facets: &[Facet],
    rules: &Rules,
    cut: &Cut,
    expected: &[u64],
    comm: &dyn Comm,
) -> Vec<u64> {
    let owners = morton_cuts(expected, comm.size());
    let ownership = Ownership::new(comm.rank(), comm.size(), &cut.dealt(&owners));
    let filed = BinnedFacets::new(&route(facets, &ownership, comm));
    let depth = Depth { surface: rules.level_surface, boxes: rules.boxes.clone() };
    let (mut tree, _) = refine(&filed, &depth, &starts(&ownership));
    ownership.synchronise_replicas(&mut [&mut tree.split, &mut tree.crossing], comm);
    let sides = sides::decide(&tree, &ownership, facets, rules.keep, comm);
    let Tree { split, crossing } = tree;
    let (split, _) =
        grade::grade(split, &crossing, &kept::Kept::new(&sides.deleted), rules, &ownership, comm);
    let leaves = Leaves {
        split: &split,
        crossing: &crossing,
        sides: &sides,
        ownership: &ownership,
        all_leaves: false,
        rules,
    };
    let starts: Vec<u64> = cut.pieces.iter().map(|p| start57(p.level, p.code)).collect();
    let mut counts = vec![0; starts.len()];
    let count = |words: &[u64]| {
        words.iter().for_each(|w| counts[starts.partition_point(|&s| s <= w >> 7) - 1] += 1);
        Ok::<(), std::convert::Infallible>(())
    };
    let Ok(_) = leaves.emit(count);
    (0..).zip(counts).filter(|c| c.1 > 0).flat_map(|c| [c.0, c.1]).collect()
}
