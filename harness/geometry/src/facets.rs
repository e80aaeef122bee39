//! Defects of single facets, and facets that repeat others.

use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::tree::Point;
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
    let [a, b, c] = facet.map(|vertex| Point::from(vertex.map(f64::from)));
    let (u, v, w) = (b - a, c - a, c - b);
    let longest = [u, v, w].map(Point::length_squared).into_iter().fold(0.0, f64::max);
    // |cross| = height * longest edge.
    u.cross(v).length_squared() < (SLIVER * longest).powi(2)
}
