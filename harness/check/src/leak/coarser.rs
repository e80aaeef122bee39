//! The base tree of a coarser surface level, from a finer one.
//!
//! A facet touches an octant iff it touches one of its children, so a finer surface level only adds splits. Of the octants that the
//! finer tree splits, those coarser than the coarser surface level stay split, and so do those that a box requires to be split. All
//! others are split for the surface alone, and are crossing leaves of the coarser tree.

use contract::manifest::ExtentBox;
use contract::octant::Octant;
use contract::word::{self, Leaf, Side};

/// The sorted leaf words of the base tree with a coarser surface level. Leaves that no facet touches have the side that they have in
/// the finer tree, although components of free leaves can be others.
pub fn coarser(words: &[u64], boxes: &[ExtentBox], level: u8) -> Vec<u64> {
    let is_split = |o: &Octant| boxes.iter().any(|b| b.level > o.level && b.meets(o));
    let (mut coarse, mut end) = (Vec::new(), 0);
    for &w in words {
        if word::key(w) < end {
            continue;
        }
        let leaf = word::octant(w);
        let mut ancestors = (level..leaf.level).map(|l| leaf.ancestor(l));
        match ancestors.find(|octant| !is_split(octant)) {
            Some(octant) => {
                end = word::key_of(octant.corner) + word::span(octant.level);
                coarse.push(word::encode(&Leaf { octant, side: Side::Crossing }));
            }
            None => coarse.push(w),
        }
    }
    coarse
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use reference::case::{BoxSpec, Case, Root};

    const EDGE: f64 = 8.0;

    /// The base tree of the reference without the sides of free leaves, and its boxes.
    fn meshed(case: &Case, level: u8) -> (Vec<u64>, Vec<ExtentBox>) {
        let spacing_min = EDGE / f64::from(1u32 << level);
        let mesh = reference::base_tree(&Case { spacing_min, ..case.clone() }).unwrap();
        let of_box = |b: &reference::lattice::LatticeBox| ExtentBox {
            min: b.extent.min,
            max: b.extent.max,
            level: b.level as u8,
        };
        (without_sides(mesh.words), mesh.boxes.iter().map(of_box).collect())
    }

    fn without_sides(words: Vec<u64>) -> Vec<u64> {
        let is_crossing = |w: u64| w & word::SIDE_BITS == Side::Crossing as u64;
        words.into_iter().map(|w| if is_crossing(w) { w } else { w & !word::SIDE_BITS }).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_coarser_tree_is_the_one_that_is_meshed(
            facets in prop::collection::vec((prop::array::uniform3(0.5f64..7.0), prop::array::uniform3(prop::array::uniform3(-0.5f64..0.5))), 1..4),
            boxes in prop::collection::vec((prop::array::uniform3(-0.5f64..7.5), 0.1f64..2.0, 0i32..6), 0..3),
            on_lattice in any::<bool>(),
        ) {
            // Facets in the planes of faces touch the leaves on both sides.
            let round = |c: f64| if on_lattice { (4.0 * c).round() / 4.0 } else { c };
            let facet = |(at, corners): ([f64; 3], [[f64; 3]; 3])| {
                corners.map(|corner| std::array::from_fn(|a| round(at[a] + corner[a])))
            };
            let extent = |(min, edge, level): ([f64; 3], f64, i32)| {
                BoxSpec { min, max: min.map(|c| c + edge), spacing: EDGE / 2f64.powi(level) }
            };
            let case = Case {
                facets: facets.into_iter().map(facet).collect(),
                root: Root { origin: [0.0; 3], edge: EDGE },
                spacing_min: EDGE,
                layer_cells_min: 1,
                keep: reference::case::Keep::All,
                keep_crossing: true,
                boxes: boxes.into_iter().map(extent).collect(),
                seeds: Vec::new(),
                enclosed: reference::case::Enclosed::Keep,
            };
            let (finest, boxes) = meshed(&case, 5);
            let mut previous = finest.clone();
            for level in (0..5).rev() {
                let expected = meshed(&case, level).0;
                prop_assert_eq!(&without_sides(coarser(&finest, &boxes, level)), &expected);
                previous = coarser(&previous, &boxes, level);
                prop_assert_eq!(&without_sides(previous.clone()), &expected);
            }
        }
    }
}
