//! Refinement: T0 down to its deepest level (the paper's section II.B), on the ranks that own its octants.
//!
//! Every facet is sent to the owners of the octants that its extent reaches; each rank then [voxelises](voxelise) its
//! own octants.
//!
//! Invariant: a rank has every facet whose extent reaches an octant that it owns, once.

pub mod voxelise;

use crate::partition::ownership::Ownership;
use crate::refine::voxelise::ContainingOctant;
use bricks::facet::Facet;
use bricks::octant::{LEVEL_MAX, Level, corner, edge};
use ranks::{Comm, MessageBuffer};

/// Sends every facet to the owners of the octants that its extent reaches. Returns the facets for this rank. Collective.
pub fn route(facets: &[Facet], ownership: &Ownership, comm: &dyn Comm) -> Vec<Facet> {
    let mut to_rank: Vec<Vec<Facet>> = vec![Vec::new(); comm.size()];
    // Index of the latest facet for each rank.
    let mut latest = vec![u64::MAX; comm.size()];
    for (i, f) in (0u64..).zip(facets) {
        let Some(containing) = ContainingOctant::of(f) else { continue };
        let extent = std::array::from_fn(|a| f.range(a));
        let l = containing.level();
        let code = containing.start() >> (3 * (LEVEL_MAX - l));
        ownership.owners_in(l, code, &|l, code| reaches(&extent, l, code), &mut |owner| {
            if std::mem::replace(&mut latest[owner], i) != i {
                to_rank[owner].push(*f);
            }
        });
    }
    let mut local = std::mem::take(&mut to_rank[comm.rank()]);
    let mut messages = MessageBuffer::default();
    for (owner, facets) in to_rank.into_iter().enumerate() {
        messages.write_values(owner, &facets);
    }
    local.extend(comm.sparse_all_to_all(messages).values::<Facet>());
    local
}

/// Whether an extent reaches an octant, which is closed.
fn reaches(extent: &[(i64, i64); 3], l: Level, code: u64) -> bool {
    let (min, h) = (corner(l, code), edge(l));
    (0..3).all(|a| extent[a].0 <= min[a] + h && extent[a].1 >= min[a])
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::start57;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// The children of the root, and instead of some their children, each with an owner of its own.
    fn two_levels(split: u8) -> Vec<(Level, u64)> {
        let octants = (0..8u64).flat_map(|c| match split >> c & 1 {
            0 => vec![(1, c)],
            _ => (0..8).map(|d| (2, c << 3 | d)).collect(),
        });
        octants.collect()
    }

    proptest! {
        #[test]
        fn the_owners_of_all_octants_that_an_extent_reaches_are_found(
            split in 1u8..,
            v in prop::array::uniform3(prop::array::uniform3(-2i32..=10)),
        ) {
            // Vertices on the faces of octants, next to them, and outside the root.
            let v = v.map(|p| p.map(|c| (c / 2) * (1 << 25) + c % 2));
            let (f, leaves) = (Facet { v }, two_levels(split));
            let starts = leaves.iter().map(|&(level, code)| start57(level, code));
            let ownership = Ownership::along(0, leaves.len(), starts.zip(0..));
            let reached = |(level, code): (Level, u64)| (0..3).all(|a| {
                let at = corner(level, code)[a];
                f.range(a).0 <= at + edge(level) && f.range(a).1 >= at
            });
            // Facets outside the root have no containing octant.
            prop_assume!(reached((0, 0)));
            let mut found = BTreeSet::new();
            let extent = std::array::from_fn(|a| f.range(a));
            ownership.owners_in(0, 0, &|l, code| reaches(&extent, l, code), &mut |b| _ = found.insert(b));
            let want = (0..).zip(&leaves).filter(|(_, leaf)| reached(**leaf)).map(|(owner, _)| owner);
            prop_assert!(found.into_iter().eq(want));
        }
    }
}
