//! Comparison of sides with external oracles. trimesh, open3d and pyvista determine the side of the centroids
//! of base-tree leaves; the harness's own exact rays decide where they differ.
//!
//! [`choose`] chooses the points, the crate `run` passes them to the oracles, and [`vote`] compares the answers
//! with the mesh and with the exact rays. [`is_watertight`] decides whether a difference is an error.

use contract::case::Case;
use contract::digest::mix;
use contract::lattice::{FacetLattice, UNITS_PER_EDGE, edges, sorted};
use contract::word::{self, Side};

pub mod vote;

/// Leaves and their centroids.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The chosen leaves, ascending.
    pub words: Vec<u64>,
    /// Their centroids in the user's units.
    pub points: Vec<[f64; 3]>,
    /// Half-width of the band around the surface that is excluded, in the user's units.
    pub band: f64,
    /// Number of leaves that the band excludes.
    pub in_band: u64,
}

/// Chooses at most `points_max` leaves of a base tree outside the band; all of them, if they are no more than that.
pub fn choose(case: &Case, base: &[u64], points_max: usize, seed: u64) -> Sample {
    let band = band(case);
    let candidates = base.iter().copied().filter(|&leaf| word::side(leaf) != Side::Crossing);
    let count = candidates.clone().count();
    // No facet meets the closed octant of a leaf that is not crossing, so its centroid is at least half an edge
    // away from the surface.
    let clear = |leaf: &u64| case.root.edge_of(word::level(*leaf)) / 2.0 >= band;
    let mut words: Vec<u64> = candidates.filter(clear).collect();
    let in_band = count - words.len();
    if words.len() > points_max {
        words.select_nth_unstable_by_key(points_max, |&leaf| mix(leaf ^ seed));
        words.truncate(points_max);
        words.sort_unstable();
    }
    let points = words.iter().map(|&leaf| case.root.to_user(word::octant(leaf).centre())).collect();
    Sample { words, points, band, in_band: in_band as u64 }
}

/// A generous bound of the displacement of the surface by single precision and by the lattice. The oracles
/// compute with coordinates relative to the centre of the body, but they read an STL file of f32 coordinates
/// relative to the origin.
fn band(case: &Case) -> f64 {
    let coordinates = case.facets.iter().flatten().flatten();
    let largest = coordinates.fold(0.0, |most: f64, &c| most.max(f64::from(c).abs()));
    (16.0 * f64::from(f32::EPSILON) * largest).max(4.0 * case.root.edge / UNITS_PER_EDGE as f64)
}

/// Whether every edge belongs to an even number of facets on the lattice, regardless of their winding.
///
/// If so, all rays from a point off the surface have the same parity. Degenerate facets count here, although no
/// ray crosses them, because they close slits of zero width.
pub fn is_watertight(facets: &[FacetLattice]) -> bool {
    let mut edges: Vec<_> = facets.iter().flat_map(edges).map(sorted).collect();
    edges.retain(|[a, b]| a != b);
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
}

/// Whether no edge is on an opening. Where all facets appear an even number of times, each counts once.
pub fn is_closed(facets: &[FacetLattice]) -> bool {
    let mut all = in_order(facets);
    if all.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0) {
        all.dedup();
    }
    is_watertight(&all)
}

/// Whether two facets have the same vertices. Rays cancel them; the oracles may count both.
pub fn is_doubled(facets: &[FacetLattice]) -> bool {
    in_order(facets).windows(2).any(|pair| pair[0] == pair[1])
}

/// The facets with three different vertices, in the order of these.
fn in_order(facets: &[FacetLattice]) -> Vec<FacetLattice> {
    let mut all: Vec<FacetLattice> = facets.iter().copied().map(sorted).collect();
    all.retain(|[a, b, c]| a != b && b != c);
    all.sort_unstable();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::octant::Octant;

    const BODY: [[f32; 3]; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn case(edge: f64, origin: f64, body: [[f32; 3]; 3]) -> Case {
        let root =
            format!("[root]\norigin = [{origin:?}, {origin:?}, {origin:?}]\nedge = {edge:?}");
        Case::from_parts(&format!("spacing_min = {edge:?}\n{root}"), vec![body]).unwrap()
    }

    /// The 512 octants of level 3, each side in turn.
    fn leaves() -> Vec<u64> {
        let octant = |key: u64| Octant { corner: word::corner_of(key << 48), level: 3 };
        let leaf = |key: u64| word::encode(octant(key), Side::ALL[(key % 3) as usize]);
        (0..512).map(leaf).collect()
    }

    #[test]
    fn a_small_mesh_is_sampled_completely_except_for_crossing_leaves() {
        let sample = choose(&case(8.0, -4.0, BODY), &leaves(), 1000, 0);
        assert_eq!((sample.words.len(), sample.in_band), (342, 0));
        assert!(sample.words.iter().all(|&leaf| word::side(leaf) != Side::Crossing));
        assert_eq!(sample.points[0], [-3.5; 3]);
        assert_eq!(choose(&case(8.0, -4.0, BODY), &leaves(), 342, 0), sample);
    }

    #[test]
    fn a_sample_depends_on_the_leaves_and_the_seed_only() {
        let case = case(8.0, -4.0, BODY);
        let sample = choose(&case, &leaves(), 100, 1);
        assert_eq!(sample.words.len(), 100);
        assert!(sample.words.is_sorted());
        let mut shuffled = leaves();
        shuffled.reverse();
        assert_eq!(choose(&case, &shuffled, 100, 1), sample);
        assert_ne!(choose(&case, &leaves(), 100, 2).words, sample.words);
    }

    #[test]
    fn the_band_is_wider_far_from_the_origin_and_its_leaves_are_counted() {
        let far = BODY.map(|vertex| vertex.map(|c| c + 4.0e6));
        let sample = choose(&case(8.0, 4.0e6 - 4.0, far), &leaves(), 1000, 0);
        assert!(sample.band > 1.0);
        assert_eq!((sample.words.len(), sample.in_band), (0, 342));
        // The band is 7.63 wide, and the centroids are half an edge, a sixteenth of the root's, away from the surface.
        for (edge, in_band) in [(120.0, 342), (128.0, 0)] {
            let sample = choose(&case(edge, 4.0e6 - 4.0, far), &leaves(), 1000, 0);
            assert_eq!(sample.in_band, in_band, "{edge}");
        }
    }

    /// 16 roundings of the largest coordinate, or 4 lattice units.
    #[test]
    fn the_band_is_the_larger_of_single_precision_and_the_lattice() {
        let far = BODY.map(|vertex| vertex.map(|c| c + 4.0e6));
        assert_eq!(band(&case(8.0, 4.0e6 - 4.0, far)), 4.000001e6 * 16.0 * 2f64.powi(-23));
        let least = BODY.map(|vertex| vertex.map(|c| c / 1024.0));
        assert_eq!(band(&case(8.0, -4.0, least)), 2f64.powi(-22));
    }

    #[test]
    fn a_sample_has_the_leaves_whose_shuffled_words_are_least() {
        let case = case(8.0, -4.0, BODY);
        for seed in [1, 2, u64::MAX / 3] {
            let mut expected = choose(&case, &leaves(), 1000, seed).words;
            expected.sort_by_key(|&leaf| mix(leaf ^ seed));
            expected.truncate(100);
            expected.sort_unstable();
            assert_eq!(choose(&case, &leaves(), 100, seed).words, expected, "{seed}");
        }
    }
}

#[cfg(test)]
mod bodies {
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
        let [whole, torn] = [tetrahedron(), tetrahedron()[1..].to_vec()];
        for (facets, expected) in [(&whole, true), (&torn, false)] {
            let twice = [&facets[..], facets].concat();
            assert_eq!((is_closed(facets), is_closed(&twice)), (expected, expected));
            assert!(is_watertight(&twice) && is_closed(&[&twice[..], &whole].concat()));
        }
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
