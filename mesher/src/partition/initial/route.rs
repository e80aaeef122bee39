//! The facets' journey to the ranks that need them.

use crate::comm::{Comm, MessageBuffer};
use crate::facet::Facet;
use crate::octant::{LEVEL_MAX, Level, corner, edge};
use crate::partition::ownership::Ownership;
use crate::voxelise::ContainingOctant;

/// Brings every facet to the owners of the base leaves that its extent reaches. Collective.
pub fn route(facets: &[Facet], ownership: &Ownership, comm: &dyn Comm) -> Vec<Facet> {
    let mut packed: Vec<Vec<Facet>> = vec![Vec::new(); comm.size()];
    let mut last = vec![u64::MAX; comm.size()];
    for (i, f) in (0u64..).zip(facets) {
        let Some(octant) = ContainingOctant::of(f) else { continue };
        let extent = std::array::from_fn(|a| f.range(a));
        let code = octant.start() >> (3 * (LEVEL_MAX - octant.level()));
        visit(ownership, &extent, octant.level(), code, &mut |owner| {
            if std::mem::replace(&mut last[owner], i) != i {
                packed[owner].push(*f);
            }
        });
    }
    let mut mine = std::mem::take(&mut packed[comm.rank()]);
    let mut out = MessageBuffer::with_capacity(5 * packed.iter().map(Vec::len).sum::<usize>());
    for (owner, facets) in packed.into_iter().enumerate() {
        out.write(owner, facets.iter().flat_map(pack));
    }
    mine.extend(comm.sparse_all_to_all(out).words().as_chunks().0.iter().map(unpack));
    mine
}

/// Tells `found` the owners of what an extent, inside an octant's, reaches; some more than once.
fn visit(
    ownership: &Ownership,
    extent: &[(i64, i64); 3],
    l: Level,
    code: u64,
    found: &mut impl FnMut(usize),
) {
    if let Some(owner) = ownership.sole_owner(l, code) {
        return found(owner);
    }
    let (at, half) = (corner(l, code), edge(l + 1));
    // By axis, whether the lower and the upper half are reached; they are closed.
    let halves: [[bool; 2]; 3] =
        std::array::from_fn(|a| [extent[a].0 <= at[a] + half, extent[a].1 >= at[a] + half]);
    for child in 0..8 {
        if (0..3).all(|a| halves[a][child >> a & 1]) {
            visit(ownership, extent, l + 1, code << 3 | child as u64, found);
        }
    }
}

/// Nine coordinates in five words.
fn pack(f: &Facet) -> [u64; 5] {
    let c = f.v.as_flattened();
    std::array::from_fn(|i| {
        u64::from(c[2 * i] as u32) | u64::from(c.get(2 * i + 1).map_or(0, |v| *v as u32)) << 32
    })
}

fn unpack(words: &[u64; 5]) -> Facet {
    let at = |i: usize| (words[i / 2] >> (32 * (i % 2))) as u32 as i32;
    Facet { v: std::array::from_fn(|v| std::array::from_fn(|a| at(3 * v + a))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::ownership::BaseLeaf;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// The root's children, and the children of some of those, each with an owner of its own.
    fn two_levels(split: u8) -> Vec<BaseLeaf> {
        let octants = (0..8u64).flat_map(|c| match split >> c & 1 {
            0 => vec![(1, c)],
            _ => (0..8).map(|d| (2, c << 3 | d)).collect(),
        });
        let leaf = |(owner, (level, code))| BaseLeaf { level, code, owner };
        octants.enumerate().map(leaf).collect()
    }

    proptest! {
        #[test]
        fn all_owners_that_an_extent_reaches_are_found(
            split in 1u8..,
            v in prop::array::uniform3(prop::array::uniform3(-2i32..=10)),
        ) {
            // Corners on and beside the octants' faces, and beyond the root.
            let v = v.map(|p| p.map(|c| (c / 2) * (1 << 25) + c % 2));
            let (f, leaves) = (Facet { v }, two_levels(split));
            let ownership = Ownership::new(0, leaves.len(), &leaves);
            let reached = |b: &BaseLeaf| (0..3).all(|a| {
                let at = corner(b.level, b.code)[a];
                f.range(a).0 <= at + edge(b.level) && f.range(a).1 >= at
            });
            // The root itself is taken to be reached; what is outside it has no octant.
            prop_assume!(reached(&BaseLeaf { level: 0, code: 0, owner: 0 }));
            let mut found = BTreeSet::new();
            visit(&ownership, &std::array::from_fn(|a| f.range(a)), 0, 0, &mut |b| _ = found.insert(b));
            let want = leaves.iter().filter(|b| reached(b)).map(|b| b.owner);
            prop_assert!(found.into_iter().eq(want));
        }
    }

    #[test]
    fn facets_survive_the_journey() {
        let f = Facet { v: [[-5, 1 << 28, 0], [7, -(1 << 27), 3], [i32::MAX, i32::MIN, -1]] };
        assert_eq!(unpack(&pack(&f)), f);
    }
}
