//! The exposed faces that the mesher counts by bit operations, compared with a search for the neighbours of every leaf.

use crate::support::fibres;
use crate::support::{Run, Small, config, options, run, small, soup, thin};
use bricks::octant::{LEVEL_MAX, Level, neighbour, start57};
use mesher::record::Recorder;
use mesher::{Options, mesh, words};
use proptest::prelude::*;
use ranks::Comm;
use ranks::sim::{Adversary, Sim};
use std::collections::BTreeMap;

/// The leaves on a side: their level by the start of their interval of the curve.
struct OnASide(BTreeMap<u64, Level>);

impl OnASide {
    fn new(words: impl Iterator<Item = u64>) -> Self {
        let open = words.filter(|w| w & 3 != 2);
        Self(open.map(|w| (w >> 7, (w >> 2 & 31) as Level)).collect())
    }

    /// Whether a leaf contains all of an octant.
    fn contains(&self, l: Level, code: u64) -> bool {
        let before = self.0.range(..=start57(l, code)).next_back();
        before.is_some_and(|(&start, &level)| {
            level <= l && start >> (3 * (LEVEL_MAX - level)) == code >> (3 * (l - level))
        })
    }

    fn is_empty_below(&self, l: Level, code: u64) -> bool {
        self.0.range(start57(l, code)..start57(l, code + 1)).next().is_none()
    }

    /// Whether no leaf touches the face of an octant on its lower or upper side along an axis, from within.
    fn is_free(&self, l: Level, code: u64, axis: usize, upper: bool) -> bool {
        !self.contains(l, code)
            && (self.is_empty_below(l, code)
                || quarters(code, axis, upper).all(|c| self.is_free(l + 1, c, axis, upper)))
    }

    /// The squares of such a face that no leaf touches: as large as possible.
    fn squares(&self, l: Level, code: u64, axis: usize, upper: bool) -> u64 {
        if self.contains(l, code) {
            0
        } else if self.is_free(l, code, axis, upper) {
            1
        } else {
            quarters(code, axis, upper).map(|c| self.squares(l + 1, c, axis, upper)).sum()
        }
    }

    /// The exposed faces of a leaf.
    fn exposed(&self, word: u64) -> u64 {
        let l = (word >> 2 & 31) as Level;
        let code = word >> 7 >> (3 * (LEVEL_MAX - l));
        let faces = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
        let across =
            |(axis, up)| neighbour(l, code, axis, up).map(|n| self.squares(l, n, axis, !up));
        faces.filter_map(across).sum()
    }
}

/// The four children at the lower or upper face of an octant.
fn quarters(code: u64, axis: usize, upper: bool) -> impl Iterator<Item = u64> {
    let at_face = move |child: &u64| child >> axis & 1 == u64::from(upper);
    (0..8).filter(at_face).map(move |child| code << 3 | child)
}

/// The words of a rank, and its count of exposed faces.
type Counted = (Vec<u64>, Option<u64>);

/// The words and counts of all ranks, and the digest.
fn counted(case: &Small, run: &Run, weight: Option<u32>) -> (Vec<Counted>, String) {
    let case = case.mesher_case();
    let options = Options { weight_exposed: weight, ..options(run.division, false) };
    let mut ranks = fibres::run(run.ranks, Adversary::new(run.seed), move |comm: &Sim| {
        let (words, ..) = words(&case, &options, comm).expect("the case is good");
        let report = mesh(&case, &options, comm, &mut Recorder::default()).expect("it is");
        let counts = report.counters.get("exposed_faces");
        ((words, counts.map(|counts| counts[comm.rank()])), report.digest)
    });
    let digest = std::mem::take(&mut ranks[0].1);
    (ranks.into_iter().map(|rank| rank.0).collect(), digest)
}

fn check(case: &Small, run: &Run, weight: u32) -> Result<(), TestCaseError> {
    let (ranks, digest) = counted(case, run, Some(weight));
    let leaves = OnASide::new(ranks.iter().flat_map(|rank| rank.0.iter().copied()));
    for (words, count) in &ranks {
        let open = words.iter().filter(|&w| w & 3 != 2);
        prop_assert_eq!(*count, Some(open.map(|&w| leaves.exposed(w)).sum()));
    }
    let (plain, same) = counted(case, run, None);
    prop_assert_eq!(digest, same);
    prop_assert!(plain.iter().all(|rank| rank.1.is_none()));
    Ok(())
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn every_rank_counts_the_faces_of_its_leaves(
        case in small(soup()), run in run(), weight in 0u32..20
    ) {
        check(&case, &run, weight)?;
    }

    /// Boxes finer than the surface: leaves on a side are coarser or finer than the crossing leaves that they border.
    #[test]
    fn faces_of_other_levels_than_the_surface_are_counted(case in thin(), run in run()) {
        check(&case, &run, 3)?;
    }
}

#[test]
fn weights_move_boundaries_towards_equal_numbers_of_faces() {
    let facets = crate::support::cuboid([20.0; 3], [44.0; 3]);
    let case = Small {
        facets,
        root: mesher::input::lattice::Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 1.0,
        layer_cells_min: 4,
        keep: mesher::input::lattice::Keep::Outside,
        keep_crossing: false,
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: mesher::input::lattice::Enclosed::Delete,
    };
    let spread = |weight| {
        let (ranks, _) = counted(&case, &Run { ranks: 5, ..Run::SOLO }, Some(weight));
        let faces = ranks.iter().map(|rank| rank.1.expect("counted"));
        faces.clone().max().unwrap() - faces.min().unwrap()
    };
    let [without, with] = [0, 1000].map(spread);
    assert!(with < without, "{without} without weights, {with} with them");
}
