//! Defects of single facets, and facets that repeat others.

use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use contract::lattice::FacetLattice;
use contract::parity::normal;

/// Facets with the vertices of an earlier facet. A facet with a repeated vertex is degenerate, not a duplicate.
pub fn duplicates(input: &Input, edges: &Edges, first: usize) -> Finding {
    let key = |(facet, corners): (usize, &[u32; 3])| {
        let mut sorted = *corners;
        sorted.sort_unstable();
        let [a, b, c] = sorted.map(u128::from);
        (a != b && b != c).then_some(a << 96 | b << 64 | c << 32 | facet as u128)
    };
    let mut keys: Vec<u128> = edges.corners.iter().enumerate().filter_map(key).collect();
    keys.sort_unstable();
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for same in keys.chunk_by(|a, b| a >> 32 == b >> 32) {
        pairs.extend(same[1..].iter().map(|&copy| (copy as u32, same[0] as u32)));
    }
    pairs.sort_unstable();
    let mut finding = Finding::new(Kind::Duplicates);
    for (copy, original) in pairs {
        finding.add(first, || Place::new(vec![original, copy], input.centroid(copy)));
    }
    finding
}

/// Facets without area on the lattice.
pub fn degenerate(input: &Input, first: usize) -> Finding {
    let mut finding = Finding::new(Kind::Degenerate);
    for (i, _) in input.lattice.iter().enumerate().filter(|(_, facet)| is_degenerate(facet)) {
        finding.add(first, || Place::new(vec![i as u32], input.centroid(i as u32)));
    }
    finding
}

/// Whether a facet is a segment or a point.
pub fn is_degenerate(facet: &FacetLattice) -> bool {
    normal(facet) == [0; 3]
}
