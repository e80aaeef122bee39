//! The facets' journey to the ranks that need them.

use crate::comm::Comm;
use crate::facet::Facet;
use crate::octant::{LEVEL_MAX, start57};
use crate::share::Ownership;
use crate::voxelise::{Home, Start, reaches};

/// Brings every facet to the owners of the base leaves that its extent reaches. Collective.
pub fn route(facets: &[Facet], share: &Ownership, comm: &dyn Comm) -> Vec<Facet> {
    let mut packed: Vec<Vec<Facet>> = vec![Vec::new(); comm.size()];
    let mut last = vec![u64::MAX; comm.size()];
    for (i, f) in (0u64..).zip(facets) {
        let Some(home) = Home::of(f) else { continue };
        let first = share.leaf_at(home.start());
        let end = home.start() + (1 << (3 * (LEVEL_MAX - home.level())));
        for b in &share.leaves()[first..] {
            if start57(b.level, b.code) >= end {
                break;
            }
            let there =
                b.level <= home.level() || reaches(f, &Start { level: b.level, code: b.code });
            if there && std::mem::replace(&mut last[b.owner], i) != i {
                packed[b.owner].push(*f);
            }
        }
    }
    let mut mine = std::mem::take(&mut packed[comm.rank()]);
    let out = packed.iter().map(|facets| facets.iter().flat_map(pack).collect());
    for (_, words) in comm.exchange(out.enumerate().collect()) {
        mine.extend(words.chunks_exact(5).map(unpack));
    }
    mine
}

/// Nine coordinates in five words.
fn pack(f: &Facet) -> [u64; 5] {
    let c = f.v.as_flattened();
    std::array::from_fn(|i| {
        u64::from(c[2 * i] as u32) | u64::from(c.get(2 * i + 1).map_or(0, |v| *v as u32)) << 32
    })
}

fn unpack(words: &[u64]) -> Facet {
    let at = |i: usize| (words[i / 2] >> (32 * (i % 2))) as u32 as i32;
    Facet { v: std::array::from_fn(|v| std::array::from_fn(|a| at(3 * v + a))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_survive_the_journey() {
        let f = Facet { v: [[-5, 1 << 28, 0], [7, -(1 << 27), 3], [i32::MAX, i32::MIN, -1]] };
        assert_eq!(unpack(&pack(&f)), f);
    }
}
