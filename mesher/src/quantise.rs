//! Quantisation: the rules of a case and its facets on the lattice of the root.

use crate::case::Case;
use crate::comm::{Comm, agree, uncounted};
use crate::digest;
use crate::error::Error;
use crate::facet::Facet;
use crate::ingest::Slice;
use crate::lattice::{Bounds, Rules};
use crate::octant::ROOT_EDGE;

/// The facets of all ranks, in numbers.
#[derive(Clone, Copy, Debug)]
pub struct FacetCounts {
    /// All facets.
    pub total: u64,
    /// Those with a point beyond the root.
    pub beyond_root: u64,
    /// The digest of the geometry.
    pub digest: u128,
}

/// The result of the phase on a rank.
pub struct Quantised {
    /// The rules, the same on all ranks.
    pub rules: Rules,
    /// The bounds of all facets, the same on all ranks.
    pub bounds: Bounds,
    /// This rank's facets on the lattice, in their order.
    pub facets: Vec<Facet>,
    /// The same on all ranks.
    pub counts: FacetCounts,
}

/// The rules of a case, and its facets on the lattice. Collective.
///
/// # Errors
/// If the case has no valid rules for these facets, or a facet is too far from the root.
pub fn quantise(case: &Case, slice: Slice, comm: &dyn Comm) -> Result<Quantised, Error> {
    let local = Bounds::of(&slice.facets);
    let words: Vec<u64> = local.lo.iter().chain(&local.hi).map(|c| c.to_bits()).collect();
    let bounds = comm.all_gather(&words).messages().fold(Bounds::EMPTY, |b, (_, w)| {
        let c = |i: usize| f64::from_bits(w[i]);
        b.union(Bounds { lo: [c(0), c(1), c(2)], hi: [c(3), c(4), c(5)] })
    });
    let rules = case.rules(&bounds)?;
    let facets = agree(comm, rules.root.facets(slice.facets, &local, slice.first))?;
    let beyond_root = if bounds.exceed(&rules.root) { comm.sum(beyond_root(&facets)) } else { 0 };
    let digest = uncounted(comm, || digest_of_all(&facets, comm));
    let counts = FacetCounts { total: slice.total, beyond_root, digest };
    Ok(Quantised { rules, bounds, facets, counts })
}

/// The digest of the facets of all ranks: each facet is in one slice. Collective.
fn digest_of_all(mine: &[Facet], comm: &dyn Comm) -> u128 {
    let mine = digest::of_facets(mine);
    let all = comm.all_gather(&[(mine >> 64) as u64, mine as u64]);
    let of_rank = |w: &[u64; 2]| u128::from(w[0]) << 64 | u128::from(w[1]);
    all.words().as_chunks().0.iter().map(of_rank).fold(0, u128::wrapping_add)
}

fn beyond_root(facets: &[Facet]) -> u64 {
    let is_in_root = |c: &i32| (0..=ROOT_EDGE).contains(&i64::from(*c));
    facets.iter().filter(|f| !f.v.as_flattened().iter().all(is_in_root)).count() as u64
}
