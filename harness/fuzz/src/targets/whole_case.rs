//! Whole cases: any facets, boxes, seeds, layers, enclosed components and sides to keep, meshed by the reference, by the mesher on one rank, and
//! by the mesher on simulated ranks. All leaves are the same, or all refuse the seeds.

#[path = "../../../../mesher/tests/support/mod.rs"]
mod support;

use crate::Scratch;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use support::{Run, Small};

/// The level to which most cases are limited, with a level more in boxes: a small case is as likely to find a fault, and is tried a
/// hundred times as fast.
const LEVEL_MOST: i32 = 3;

/// The case without levels beyond [`LEVEL_MOST`], on few ranks.
fn smaller((mut case, mut run): (Small, Run)) -> (Small, Run) {
    let spacing = |level: i32| case.root.edge / f64::from(1 << level);
    for b in &mut case.boxes {
        b.spacing = b.spacing.max(spacing(LEVEL_MOST + 1));
    }
    case.spacing_min = case.spacing_min.max(spacing(LEVEL_MOST));
    run.ranks = run.ranks.min(8);
    (case, run)
}

/// A case, and how it is meshed in parallel.
fn drawn() -> impl Strategy<Value = (Small, Run)> {
    let seed = || [0.0f64..64.0, 0.0f64..64.0, 0.0f64..64.0];
    let seeds = prop_oneof![3 => Just(vec![]), 1 => prop::collection::vec(seed(), 1..3)];
    let is_small = prop::bool::weighted(0.97);
    let case = prop_oneof![
        4 => support::small(support::soup()),
        1 => support::thin(),
        1 => support::leaky_on_rays(),
    ];
    (case, seeds, support::run(), is_small).prop_map(|(case, seeds, run, is_small)| {
        let drawn = (Small { seeds, ..case }, run);
        if is_small { smaller(drawn) } else { drawn }
    })
}

/// The case that is drawn with these bytes as the seed.
pub(super) fn run(_: &mut Scratch, bytes: &[u8]) -> bool {
    let mut seed = [0; 32];
    for (i, byte) in bytes.iter().enumerate() {
        seed[i % 32] ^= byte;
    }
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let (case, run) = drawn().new_tree(&mut runner).expect("no value is rejected").current();
    // The final mesh contains the base tree, unless parts of it were deleted.
    let both: &[bool] = if seed[0] & 3 == 0 { &[true, false] } else { &[false] };
    for &ungraded in both {
        let wanted = match ungraded {
            true => reference::base_tree(&case.reference_case()),
            false => reference::mesh(&case.reference_case()),
        };
        let wanted = wanted.ok().map(|mesh| mesh.words);
        for run in [Run::SOLO, run] {
            let found = case.try_outcome(&run, ungraded).ok().map(|outcome| outcome.words);
            assert!(
                found == wanted,
                "{case:?}\n{run:?}\nungraded: {ungraded}: {}",
                support::first_difference(
                    &found.unwrap_or_default(),
                    wanted.as_ref().map_or(&[], |words| words)
                )
            );
        }
        if wanted.is_none() {
            return false;
        }
    }
    true
}
