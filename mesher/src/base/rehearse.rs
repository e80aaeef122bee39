//! The rehearsal: the same mesh made a few levels coarser tells what a base leaf will hold.
//!
//! Leaves near a surface grow by four per level, so counts scale. But a coarser mesh's layers are thicker
//! and reach into other base leaves: so the rehearsal is believed for regions that are wide against its
//! layers, and within them leaves are spread by what the facets' area lets expect. Parts of the rehearsal
//! are Morton cuts of the latter, too, so that it is divided well itself.

use super::{Cut, route};
use crate::comm::Comm;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::Level;
use crate::partition::{boxed, morton_cuts};
use crate::share::{BaseLeaf, Ownership};
use crate::stream::Leaves;
use crate::tree::Tree;
use crate::voxelise::{Depth, Filed, Start, refine};
use crate::{grade, kept, sides};

/// Levels that a rehearsal is coarser: it takes a 64th of the cells.
const COARSER: Level = 3;

/// Leaves to expect in each base leaf, the same on all ranks. `expected` is what area lets expect, and the
/// answer where the tree is too shallow to rehearse. Collective.
pub fn weights(
    facets: &[Facet],
    rules: &Rules,
    cut: &Cut,
    expected: Vec<u64>,
    comm: &dyn Comm,
) -> Vec<u64> {
    // The base leaves of the coarse tree must be those of the fine one.
    let Some(coarser) = rules.level_surface.checked_sub(cut.level_base + 2) else {
        return expected;
    };
    let coarser = coarser.min(COARSER);
    if coarser == 0 || comm.size() == 1 {
        return expected;
    }
    let coarse = coarsen(rules, coarser, cut.level_base);
    let mut leaves = cut.leaves.clone();
    let owners = morton_cuts(&expected, comm.size());
    leaves.iter_mut().zip(owners).for_each(|(b, owner)| b.owner = owner);
    let share = Ownership::new(comm.rank(), comm.size(), cut.internal.clone(), leaves);
    let mut counts = vec![0u64; cut.leaves.len()];
    for theirs in comm.all_gather(&rehearse(facets, &coarse, cut, &share, comm)) {
        theirs.chunks_exact(2).for_each(|pair| counts[pair[0] as usize] += pair[1]);
    }
    let scale = 1 << (2 * coarser);
    let region = region_level(&coarse);
    let regions = regions(&cut.leaves, region);
    let mut weights = Vec::with_capacity(expected.len());
    for of in regions.chunk_by(|a, b| a == b) {
        let range = weights.len()..weights.len() + of.len();
        let told =
            counts[range.clone()].iter().map(|n| 1 + n.saturating_sub(1) * scale).sum::<u64>();
        let thought: u64 = expected[range.clone()].iter().sum();
        let weight = |w: u64| (u128::from(w) * u128::from(told) / u128::from(thought)) as u64;
        let least = |i: usize| boxed(&cut.leaves[i], rules).max(1);
        weights.extend(range.map(|i| weight(expected[i]).max(least(i))));
    }
    weights
}

/// Level of regions that are wide against the layers around the coarse mesh's surface.
fn region_level(coarse: &Rules) -> Level {
    let wide = 4 * (coarse.layer_cells_min + 2);
    coarse.level_surface.saturating_sub(wide.next_power_of_two().ilog2())
}

/// The region of each base leaf: its ancestor of a level, or itself if it is no deeper.
fn regions(leaves: &[BaseLeaf], level: Level) -> Vec<(Level, u64)> {
    let of = |b: &BaseLeaf| match b.level.checked_sub(level) {
        Some(deeper) => (level, b.code >> (3 * deeper)),
        None => (b.level, b.code),
    };
    leaves.iter().map(of).collect()
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
    share: &Ownership,
    comm: &dyn Comm,
) -> Vec<u64> {
    let depth = Depth { surface: rules.level_surface, boxes: rules.boxes.clone() };
    let filed = Filed::new(&route(facets, share, comm));
    let starts = share.leaves().iter().zip(&cut.heavy);
    let mine = starts.filter(|(b, heavy)| **heavy && b.owner == comm.rank());
    let starts: Vec<Start> = mine.map(|(b, _)| Start { level: b.level, code: b.code }).collect();
    let (mut tree, _): (Tree, _) = refine(&filed, &depth, &starts);
    crate::share_top(&mut tree, cut.top.clone(), share, cut.level_base, comm);
    let sides = sides::decide(&tree, share, facets, rules.keep, comm);
    let Tree { split, crossing } = tree;
    let (split, _) = grade::grade(split, &crossing, &kept::Kept::new(&sides.deleted), rules, share, comm);
    let leaves =
        Leaves { split: &split, crossing: &crossing, sides: &sides, share, everything: false, rules };
    let mut counts = vec![0; share.leaves().len()];
    let count = |words: &[u64]| {
        words.iter().for_each(|w| counts[share.leaf_at(w >> 7)] += 1);
        Ok::<(), std::convert::Infallible>(())
    };
    let Ok(_) = leaves.emit(count);
    (0..).zip(counts).filter(|c| c.1 > 0).flat_map(|c| [c.0, c.1]).collect()
}
