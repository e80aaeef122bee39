//! The mesher's leaves equal the reference's, for any facets and any number of ranks.

use crate::support::{Run, Small, config, cuboid, division, leaky_on_rays, run, small, soup, thin};
use bricks::octant::position;
use mesher::input::case::BoxSpec;
use mesher::input::lattice::{Enclosed, Keep, Root};
use mesher::partition::Partitioner;
use proptest::prelude::*;

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn one_rank_equals_the_reference(case in small(soup())) {
        assert_reference(&case, &Run::SOLO)?;
    }

    #[test]
    fn many_ranks_equal_the_reference(case in small(soup()), run in run()) {
        assert_reference(&case, &run)?;
    }

    /// Layers must not act through the deleted region, which is thin here.
    #[test]
    fn thin_bodies_in_fine_boxes_equal_the_reference(case in thin(), run in run()) {
        assert_reference(&case, &run)?;
    }

    /// Rays that meet edges and vertices must be displaced as defined; otherwise leaks are decided differently.
    #[test]
    fn open_soups_with_edges_on_rays_equal_the_reference(case in leaky_on_rays(), run in run()) {
        assert_reference(&case, &run)?;
    }
}

fn assert_reference(case: &Small, run: &Run) -> Result<(), TestCaseError> {
    for (ungraded, what) in [(true, "base tree"), (false, "final mesh")] {
        let (got, want) = (case.outcome(run, ungraded), case.reference_outcome(ungraded));
        assert_same!(got.words, want.words, "{what}");
        prop_assert_eq!(got.summary, want.summary);
        prop_assert_eq!(got.leaks, want.leaks);
    }
    Ok(())
}

/// The facet misses an edge of the root by a lattice unit, although its extent meets the root.
#[test]
fn a_facet_outside_the_root_crosses_nothing() {
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
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        };
        assert_eq!(case.reference(true), [0], "the reference's root is a leaf");
        assert_eq!(case.solo(true), [0]);
        assert_eq!(case.ranks(3, 1, division(Partitioner::Metis, None), true), [0]);
    }
}

/// A plate across the root, three cells thick, of which the middle one is deleted. The extent box covers
/// one side of the plate with cells a quarter as large. Its layer ends before the other side, but twice
/// its layer would not: a sibling group of cells half as large must not act through the plate.
#[test]
fn a_layer_of_fine_cells_does_not_reach_through_a_deleted_plate() {
    for axis in 0..3 {
        let slab = |first: f64, last: f64| {
            let (mut lo, mut hi) = ([-8.0; 3], [72.0; 3]);
            (lo[axis], hi[axis]) = (first, last);
            (lo, hi)
        };
        let (lo, hi) = slab(44.0, 60.0);
        let (min, max) = slab(0.0, 40.0);
        let case = Small {
            facets: cuboid(lo.map(|c| c as f32), hi.map(|c| c as f32)),
            root: Root { origin: [0.0; 3], edge: 64.0 },
            spacing_min: 8.0,
            layer_cells_min: 4,
            keep: Keep::Outside,
            keep_crossing: true,
            boxes: vec![BoxSpec { min, max, spacing: 2.0 }],
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        };
        let words = case.solo(false);
        assert_eq!(words, case.reference(false));
        let far = words.iter().filter(|w| position(*w >> 7)[axis] >= 7 << 16);
        assert!(far.clone().count() > 0 && far.clone().all(|w| w >> 2 & 31 == 3), "axis {axis}");
    }
}
