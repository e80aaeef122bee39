//! The mesher gives the reference's leaves, on whatever facets and however many ranks.
#![allow(missing_docs)]

mod support;

use mesher::partition::Partitioner;
use proptest::prelude::*;
use support::{config, division, small, soup};

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
