//! The rehearsal: the same mesh made a few levels coarser tells what a base leaf will hold.
//!
//! Leaves near a surface grow by four per level, so counts scale. Parts of the rehearsal are Morton cuts
//! of what the facets' area lets expect, so that it is divided well itself.

use super::{Cut, route};
use crate::comm::Comm;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::Level;
use crate::partition::{boxed, morton_cuts};
use crate::share::Ownership;
use crate::stream::Leaves;
use crate::tree::Tree;
use crate::voxelise::{Depth, Filed, refine};
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
    let counts = rehearse(facets, &coarse, cut, &share, comm);
    // Parts are pieces of the curve: all ranks' counts, one behind the other, are in the leaves' order.
    let all = comm.all_gather(&counts).concat();
    let scale = 1 << (2 * coarser);
    let weight = |(b, n): (&_, u64)| (1 + n.saturating_sub(1) * scale).max(boxed(b, rules));
    cut.leaves.iter().zip(all).map(weight).collect()
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

/// Leaves of the coarse mesh in each of this rank's base leaves, in order. Collective.
fn rehearse(
    facets: &[Facet],
    rules: &Rules,
    cut: &Cut,
    share: &Ownership,
    comm: &dyn Comm,
) -> Vec<u64> {
    let depth = Depth { surface: rules.level_surface, boxes: rules.boxes.clone() };
    let filed = Filed::new(&route(facets, share, comm));
    let mine: Vec<usize> =
        (0..share.leaves().len()).filter(|&i| share.leaves()[i].owner == comm.rank()).collect();
    let starts = mine.iter().filter(|&&i| cut.heavy[i]).map(|&i| share.leaves()[i]);
    let starts: Vec<_> =
        starts.map(|b| crate::voxelise::Start { level: b.level, code: b.code }).collect();
    let (mut tree, _): (Tree, _) = refine(&filed, &depth, &starts);
    crate::share_top(&mut tree, cut.top.clone(), share, cut.level_base, comm);
    let sides = sides::decide(&tree, share, facets, rules.keep, comm);
    let (split, _) = grade::grade(&tree, &kept::Kept::new(&sides.deleted), rules, share, comm);
    let leaves =
        Leaves { split: &split, base: &tree, sides: &sides, share, everything: false, rules };
    let mut counts = vec![0; mine.len()];
    let first = mine.first().copied().unwrap_or(0);
    let count = |words: &[u64]| {
        words.iter().for_each(|w| counts[share.leaf_at(w >> 7) - first] += 1);
        Ok::<(), std::convert::Infallible>(())
    };
    let Ok(_) = leaves.emit(count);
    counts
}
