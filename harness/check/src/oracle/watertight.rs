//! Whether the parity of rays determines the sides of a body.

use contract::lattice::FacetLattice;

/// Whether every edge belongs to an even number of facets on the lattice, regardless of their winding.
///
/// If so, all rays from a point off the surface have the same parity. Degenerate facets count here, although no
/// ray crosses them, because they close slits of zero width.
pub fn is_watertight(facets: &[FacetLattice]) -> bool {
    let sides = |facet: &FacetLattice| {
        let [a, b, c] = *facet;
        [[a, b], [b, c], [c, a]]
    };
    let sorted = |[a, b]: [[i64; 3]; 2]| [a.min(b), a.max(b)];
    let mut edges: Vec<_> = facets.iter().flat_map(sides).map(sorted).collect();
    edges.retain(|[a, b]| a != b);
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
}

/// Whether two facets have the same vertices. Rays cancel them; the oracles may count both.
pub fn is_doubled(facets: &[FacetLattice]) -> bool {
    let sorted = |facet: &FacetLattice| {
        let mut vertices = *facet;
        vertices.sort_unstable();
        vertices
    };
    let mut all: Vec<FacetLattice> = facets.iter().map(sorted).collect();
    all.retain(|[a, b, c]| a != b && b != c);
    all.sort_unstable();
    all.windows(2).any(|pair| pair[0] == pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[i64; 3]; 4] = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]];

    fn tetrahedron() -> Vec<FacetLattice> {
        let facet = |without: usize| {
            let mut rest = CORNERS.to_vec();
            rest.remove(without);
            [rest[0], rest[1], rest[2]]
        };
        (0..4).map(facet).collect()
    }

    #[test]
    fn a_tetrahedron_is_watertight_until_a_facet_is_removed() {
        let mut body = tetrahedron();
        assert!(is_watertight(&body));
        assert!(is_watertight(&[]));
        body.pop();
        assert!(!is_watertight(&body));
    }

    #[test]
    fn two_copies_of_a_facet_cancel() {
        let mut body = tetrahedron();
        assert!(!is_doubled(&body));
        let [a, b, c] = body[0];
        body.push([b, a, c]);
        assert!(!is_watertight(&body) && is_doubled(&body));
        body.push(body[0]);
        assert!(is_watertight(&body));
    }

    #[test]
    fn a_degenerate_facet_closes_a_slit() {
        let mut body = tetrahedron();
        // An edge of facet 0 is bisected, but not the same edge of its neighbour.
        let [a, b, c] = body[0];
        let middle = std::array::from_fn(|axis| (a[axis] + b[axis]) / 2);
        body[0] = [a, middle, c];
        body.push([middle, b, c]);
        assert!(!is_watertight(&body));
        body.push([a, middle, b]);
        assert!(is_watertight(&body));
    }

    #[test]
    fn a_facet_that_is_a_point_has_no_effect() {
        let mut body = tetrahedron();
        body.push([CORNERS[0]; 3]);
        assert!(is_watertight(&body));
    }
}
