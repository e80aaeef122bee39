//! Seeds must not lie in crossing leaves of T0 (reference/DEFINITION.md, section 4).

use crate::case::Case;
use crate::lattice::FacetLattice;
use crate::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL};
use crate::triangle::Triangle;

/// Refuses a case with a seed in a crossing leaf of T0.
pub(crate) fn refuse_crossing(case: &Case) -> Result<(), String> {
    for (i, (&seed, at)) in case.seeds_lattice.iter().zip(&case.seeds).enumerate() {
        if let (leaf, Some(facet)) = base_leaf(case, seed) {
            let leaf = case.root.describe(&leaf);
            return Err(format!(
                "seed {i} at {at:?} lies in the crossing leaf {leaf}, which facet {facet} crosses; move it away from \
                 the surface"
            ));
        }
    }
    Ok(())
}

/// The leaf of T0 that contains a lattice point of the root's half-open cube, and the first facet that crosses it.
///
/// If a rule of section 3 requires the split of an octant, it requires the split of its ancestors, so the leaf is
/// the first octant on the way down that no rule splits.
fn base_leaf(case: &Case, point: [i64; 3]) -> (Octant, Option<usize>) {
    let cell = Octant { corner: point.map(|q| (q / UNITS_PER_CELL) as u32), level: LEVEL_MAX };
    let numbered = |(i, facet): (usize, &FacetLattice)| (i, Triangle::new(facet));
    let mut crossing: Vec<(usize, Triangle)> =
        case.facets_lattice.iter().enumerate().map(numbered).collect();
    let mut octant = Octant::ROOT;
    loop {
        let (low, high) = octant.bounds();
        crossing.retain(|(_, facet)| facet.meets(low, high));
        let by_surface = !crossing.is_empty() && octant.level < case.level_surface;
        let by_box = || case.boxes.iter().any(|b| b.level > octant.level && b.meets(&octant));
        if !by_surface && !by_box() {
            return (octant, crossing.first().map(|(i, _)| *i));
        }
        octant = cell.ancestor(octant.level + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A facet in the plane x = 0.5 of a root of edge 8, at a spacing of one.
    fn case(seed: [f64; 3], boxes: &str) -> Result<Case, String> {
        let facet = [[0.5, 1.0, 1.0], [0.5, 3.0, 1.0], [0.5, 1.0, 3.0]];
        let text = format!(
            "spacing_min = 1.0\nseeds = [{seed:?}]\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n{boxes}"
        );
        Case::from_parts(&text, vec![facet])
    }

    #[test]
    fn a_seed_is_refused_in_a_crossing_leaf_only() {
        // Leaves are closed for crossing, so the facet's corner at y = 1 crosses leaves below it.
        for crossing in [[0.1, 1.5, 1.5], [0.9, 2.9, 1.1], [0.1, 0.1, 1.1]] {
            let why = case(crossing, "").unwrap_err();
            assert!(why.contains("seed 0") && why.contains("facet 0 crosses"), "{why}");
        }
        for clear in [[1.0, 1.5, 1.5], [0.1, 4.5, 1.5], [7.9, 7.9, 7.9]] {
            assert!(case(clear, "").is_ok(), "{clear:?}");
        }
    }

    #[test]
    fn a_box_makes_the_leaf_of_a_seed_smaller() {
        let fine = "[[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [8.0, 8.0, 8.0]\nspacing = 0.25";
        assert!(case([0.1, 1.5, 1.5], fine).is_ok());
        assert!(case([0.4, 1.5, 1.5], fine).is_err());
    }
}
