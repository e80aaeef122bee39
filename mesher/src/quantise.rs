//! Quantisation: the rules of a case and its facets on the lattice of the root.

use crate::case::Case;
use crate::comm::{Comm, agree};
use crate::error::Error;
use crate::facet::Facet;
use crate::ingest::Slice;
use crate::lattice::{Bounds, Rules};

/// The rules and the bounds of all facets, the same on all ranks, and this rank's facets on the lattice, in their order. Collective.
///
/// # Errors
/// If the case has no valid rules for these facets, or a facet is too far from the root.
pub fn quantise(
    case: &Case,
    slice: Slice,
    comm: &dyn Comm,
) -> Result<(Rules, Bounds, Vec<Facet>), Error> {
    let local = Bounds::of(&slice.facets);
    let words: Vec<u64> = local.lo.iter().chain(&local.hi).map(|c| c.to_bits()).collect();
    let bounds = comm.all_gather(&words).messages().fold(Bounds::EMPTY, |b, (_, w)| {
        let c = |i: usize| f64::from_bits(w[i]);
        b.union(Bounds { lo: [c(0), c(1), c(2)], hi: [c(3), c(4), c(5)] })
    });
    let rules = case.rules(&bounds)?;
    let facets = agree(comm, rules.root.facets(slice.facets, &local, slice.first))?;
    Ok((rules, bounds, facets))
}
