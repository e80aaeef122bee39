//! Tests of the checks on meshes of the reference. First, the exact predicates of both agree, which have other algorithms.

mod kept;
mod no_false_alarms;
mod selftest;
mod support;

use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use contract::parity::Parity;
use contract::triangle::Triangle;
use proptest::prelude::*;

/// Lattice coordinates of every magnitude, or in a small range, where coincidences are common.
fn lattice() -> impl Strategy<Value = i64> {
    prop_oneof![
        -8i64..=8,
        -UNITS_PER_EDGE..=2 * UNITS_PER_EDGE,
        (-4i64..=8).prop_map(|i| i * UNITS_PER_EDGE / 4)
    ]
}

fn lattice_facet() -> impl Strategy<Value = FacetLattice> {
    prop::array::uniform3(prop::array::uniform3(lattice()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn crossing_tests_agree_on_small_boxes(facet in lattice_facet(), min in prop::array::uniform3(-8i64..=6), size in 1i64..=6) {
        let max = min.map(|c| c + size);
        let expected = reference::crossing::crosses(&facet, &reference::octant::Extent { min, max });
        prop_assert_eq!(Triangle::new(&facet).meets(min, max), expected);
    }

    #[test]
    fn crossing_tests_agree_on_octants(facet in lattice_facet(), at in prop::array::uniform3(0i64..16), level in 0u32..=4) {
        let edge = UNITS_PER_EDGE >> level;
        let min = at.map(|c| c % (1 << level) * edge);
        let max = min.map(|c| c + edge);
        let expected = reference::crossing::crosses(&facet, &reference::octant::Extent { min, max });
        prop_assert_eq!(Triangle::new(&facet).meets(min, max), expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn ray_parities_agree(facets in prop::collection::vec(lattice_facet(), 0..12), point in prop::array::uniform3(lattice())) {
        let on_a_facet = facets.iter().any(|f| Triangle::new(f).meets(point, point));
        prop_assume!(!on_a_facet);
        let found = Parity::new(&facets).inside(point);
        for axis in 0..3 {
            let [down, up] = reference::ray::parities(&facets, point, axis);
            prop_assert_eq!([found[2 * axis], found[2 * axis + 1]], [up, down]);
        }
    }
}
