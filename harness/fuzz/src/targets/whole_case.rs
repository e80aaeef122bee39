//! Whole cases: any facets, boxes, seeds, layers, enclosed components and sides to keep, meshed by the reference, by the mesher on one rank, and
//! by the mesher on simulated ranks. All leaves and components are the same, or all refuse the seeds.

#[path = "../../../../mesher/tests/support/mod.rs"]
mod support;

use crate::Scratch;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use ranks::Solo;
use ranks::sim::Adversary;
use std::rc::Rc;
use support::schedules::{Meshed, merge, on_ranks, part, plain};
pub(crate) use support::{Outcome, Run, Small};

/// One in this many cases is compared before gradation, too. The final mesh contains the base tree, unless parts of it were deleted.
const UNGRADED: u8 = 4;
/// One in this many cases runs all phases on the simulated ranks, with the invariants checked after each; the others end with the leaves.
const WHOLE: u8 = 16;

/// The case with a surface level from `least` to `most`, boxes of at most one level more, and few ranks, in a root that is larger by
/// `doubled` levels.
fn bounded((mut case, mut run): (Small, Run), [least, most, doubled]: [i32; 3]) -> (Small, Run) {
    let spacing = |level: i32| case.root.edge / f64::from(1 << level);
    for b in &mut case.boxes {
        b.spacing = b.spacing.max(spacing(most + 1));
    }
    case.spacing_min = case.spacing_min.clamp(spacing(most), spacing(least));
    case.root.edge *= f64::from(1 << doubled);
    if doubled > 0 {
        // Thick layers on every level would take seconds.
        case.layer_cells_min = case.layer_cells_min.min(if doubled > 3 { 2 } else { 4 });
    }
    run.ranks = run.ranks.min(8);
    (case, run)
}

/// A case, and how it is meshed in parallel. The reference meshes most cases in less than a millisecond.
fn drawn() -> BoxedStrategy<(Small, Run)> {
    let seed = || [0.0f64..64.0, 0.0f64..64.0, 0.0f64..64.0];
    let seeds = prop_oneof![3 => Just(vec![]), 1 => prop::collection::vec(seed(), 1..3)];
    let levels = prop_oneof![
        12 => Just([0, 3]), 6 => Just([2, 4]), 2 => Just([3, 5]), 1 => Just([0, 6])
    ];
    let doubled = prop_oneof![14 => Just(0), 4 => 1..=3, 1 => 4..=12];
    let case = prop_oneof![
        4 => support::small(support::soup()),
        1 => support::thin(),
        1 => support::leaky_on_rays(),
    ];
    (case, seeds, support::run(), levels, doubled)
        .prop_map(|(case, seeds, run, [least, most], doubled)| {
            bounded((Small { seeds, ..case }, run), [least, most, doubled])
        })
        .boxed()
}

thread_local! {
    static DRAWN: BoxedStrategy<(Small, Run)> = drawn();
}

/// A case, how it was meshed in parallel, and the mesh; `None` if its seeds were refused.
pub(crate) struct Tried {
    pub case: Small,
    pub run: Run,
    pub mesh: Option<Outcome>,
}

/// Tries the case that is drawn with these bytes as the seed.
///
/// # Panics
/// If two meshes of it differ.
pub(crate) fn tried(bytes: &[u8]) -> Tried {
    let mut seed = [0; 32];
    for (i, byte) in bytes.iter().enumerate() {
        seed[i % 32] ^= byte;
    }
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let drawn = DRAWN.with(|drawn| drawn.new_tree(&mut runner));
    let (case, run) = drawn.expect("no value is rejected").current();
    let whole = seed[0] / UNGRADED % WHOLE == 1;
    if seed[0] % UNGRADED == 0 {
        compared(&case, &run, true, whole);
    }
    let mesh = compared(&case, &run, false, whole);
    Tried { case, run, mesh }
}

/// The mesh of a case by the reference, which the mesher's on one rank and on simulated ranks equal.
fn compared(case: &Small, run: &Run, ungraded: bool, whole: bool) -> Option<Outcome> {
    let wanted = case.try_reference_outcome(ungraded);
    let refused = |error| assert!(is_of_seeds(&error), "{case:?}\n{error}");
    let wanted = wanted.map_err(refused).ok().map(|outcome| Meshed {
        reported: whole.then(|| {
            let digest = reference::digest(&outcome.words);
            (reference::leaves::hex(digest), outcome.words.len() as u64)
        }),
        outcome,
    });
    for run in [Run::SOLO, *run] {
        let found = meshed(case, &run, ungraded, whole);
        assert!(
            found == wanted,
            "{case:?}\n{run:?}\nungraded: {ungraded}\n{}\n{:?}\n{:?}",
            support::first_difference(words(&found), words(&wanted)),
            found.as_ref().map(|mesh| (&mesh.outcome.summary, &mesh.reported)),
            wanted.as_ref().map(|mesh| (&mesh.outcome.summary, &mesh.reported)),
        );
    }
    wanted.map(|mesh| mesh.outcome)
}

/// The mesh of a case by the mesher; `None` if all ranks refuse it.
fn meshed(case: &Small, run: &Run, ungraded: bool, whole: bool) -> Option<Meshed> {
    let case = Rc::new(case.mesher_case());
    let options = mesher::Options { check: whole, ..support::options(run.division, ungraded) };
    let mesh = match run.ranks {
        1 => merge(vec![part(&case, &options, whole, &Solo)]),
        ranks => on_ranks(case, options, ranks, Adversary::new(run.seed), whole, plain),
    };
    mesh.inspect_err(|error| assert!(error.to_string().starts_with("seed "), "{error}")).ok()
}

fn is_of_seeds(error: &reference::Error) -> bool {
    matches!(error, reference::Error::SeedOutside { .. } | reference::Error::SeedCrossing { .. })
}

fn words(mesh: &Option<Meshed>) -> &[u64] {
    mesh.as_ref().map_or(&[], |mesh| &mesh.outcome.words)
}

pub(super) fn run(_: &mut Scratch, bytes: &[u8]) -> bool {
    tried(bytes).mesh.is_some()
}
