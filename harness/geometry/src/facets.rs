//! Defects of single facets, and facets that repeat others.

use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use contract::lattice::FacetLattice;
use contract::parity::normal;

/// A facet is a sliver if its height is below this part of its longest edge.
const SLIVER: f64 = 1e-3;

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

/// Facets without area on the lattice, and slivers.
pub fn shapes(input: &Input, first: usize) -> [Finding; 2] {
    let mut findings = [Kind::Degenerate, Kind::Slivers].map(Finding::new);
    for (i, facet) in input.lattice.iter().enumerate() {
        let at = match is_degenerate(facet) {
            true => 0,
            false if is_sliver(&input.facets[i]) => 1,
            false => continue,
        };
        findings[at].add(first, || Place::new(vec![i as u32], input.centroid(i as u32)));
    }
    findings
}

/// Whether a facet is a segment or a point.
pub fn is_degenerate(facet: &FacetLattice) -> bool {
    normal(facet) == [0; 3]
}

fn is_sliver(facet: &[[f32; 3]; 3]) -> bool {
    let edge = |v: usize, w: usize| -> [f64; 3] {
        std::array::from_fn(|a| f64::from(facet[w][a]) - f64::from(facet[v][a]))
    };
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let (u, v, w) = (edge(0, 1), edge(0, 2), edge(1, 2));
    let longest = dot(u, u).max(dot(v, v)).max(dot(w, w));
    let cross: [f64; 3] =
        std::array::from_fn(|a| u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3]);
    // |cross| = height * longest edge.
    dot(cross, cross) < (SLIVER * longest).powi(2)
}
