//! Quantisation: the rules of a case and its facets on the lattice of the root.

use crate::error::{Error, agree};
use crate::input::case::Case;
use crate::input::ingest::Slice;
use crate::input::lattice::{Bounds, Rules};
use bricks::digest;
use bricks::facet::Facet;
use bricks::octant::ROOT_EDGE;
use ranks::{Comm, gather, uncounted};

/// The facets of all ranks, in numbers.
#[derive(Clone, Copy, Debug)]
pub struct FacetCounts {
    /// All facets.
    pub total: u64,
    /// Their least distance from the root's boundary in lattice units; negative if some lie beyond the root, wholly or partly.
    pub margin: i64,
    /// The digest of the geometry.
    pub digest: u128,
    /// How far apart the numbers of STL files are below the greatest coordinate.
    pub rounding: f32,
}

/// The result of the phase on a rank.
#[derive(Clone)]
pub struct Quantised<F = Vec<Facet>> {
    /// The rules, the same on all ranks.
    pub rules: Rules,
    /// This rank's facets on the lattice, in their order.
    pub facets: F,
    /// The same on all ranks.
    pub counts: FacetCounts,
}

/// The rules of a case, and its facets on the lattice. Collective.
///
/// # Errors
/// If the case has no valid rules for these facets, or a facet is too far from the root.
pub fn quantise(case: &Case, slice: Slice, comm: &dyn Comm) -> Result<Quantised, Error> {
    let local = Bounds::of(&slice.facets);
    let bounds = gather(comm, &[local]).into_iter().reduce(Bounds::union).unwrap_or(local);
    let rules = case.rules(&bounds)?;
    let facets = agree(comm, rules.root.facets(slice.facets, &local, slice.first))?;
    let [low, high] = [bounds.lo, bounds.hi].map(|corner| rules.root.nearest(corner));
    let margin =
        (0..3).map(|a| low[a].min(ROOT_EDGE.saturating_sub(high[a]))).fold(i64::MAX, i64::min);
    // Each facet is in one slice.
    let digests = uncounted(comm, || gather(comm, &[digest::of_facets(&facets)]));
    let digest = digests.into_iter().fold(0, u128::wrapping_add);
    let coordinates = bounds.lo.iter().chain(&bounds.hi).filter(|c| c.is_finite());
    let farthest = coordinates.fold(0f32, |farthest, c| farthest.max(c.abs() as f32));
    let rounding = farthest - farthest.next_down();
    let counts = FacetCounts { total: slice.total, margin, digest, rounding };
    Ok(Quantised { rules, facets, counts })
}
