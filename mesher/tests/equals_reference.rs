//! The mesher gives the reference's leaves, on whatever facets and however many ranks.
#![allow(missing_docs)]

mod support;

use mesher::lattice::{Keep, Root};
use mesher::partition::Partitioner;
use proptest::prelude::*;
use support::{Small, config, division, small, soup};

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn on_one_rank(case in small(soup())) {
        assert_same!(case.solo(true), case.reference(true), "base tree");
        assert_same!(case.solo(false), case.reference(false), "final mesh");
    }

    #[test]
    fn on_many_ranks(
        case in small(soup()),
        ranks in prop_oneof![3 => 2usize..9, 1 => 9usize..65],
        seed in any::<u64>(),
        metis in any::<bool>(),
        level_base in prop_oneof![1 => Just(None), 2 => (0u32..6).prop_map(Some)],
    ) {
        let division = division(if metis { Partitioner::Metis } else { Partitioner::Morton }, level_base);
        assert_same!(case.ranks(ranks, seed, division, true), case.reference(true), "base tree");
        assert_same!(case.ranks(ranks, seed, division, false), case.reference(false), "final mesh");
    }
}

/// A facet that passes by an edge of the root at a lattice unit: its extent meets the root, it does not.
#[test]
fn a_facet_beside_the_root() {
    let unit = 64.0 / (1 << 27) as f32;
    for level in 0..=3 {
        let case = Small {
            facets: vec![[[0.0, 0.0, -unit], [0.0, -unit, 0.0], [1.0, 0.0, -unit]]],
            root: Root { origin: [0.0; 3], edge: 64.0 },
            spacing_min: 64.0 / f64::from(1 << level),
            layer_cells_min: 1,
            keep: Keep::All,
            keep_crossing: true,
            boxes: vec![],
        };
        assert_eq!(case.reference(true), [0], "the reference's root is a leaf");
        assert_eq!(case.solo(true), [0]);
        assert_eq!(case.ranks(3, 1, division(Partitioner::Metis, None), true), [0]);
    }
}
