//! Metamorphic tests: changes of the input whose effect on the mesh is known exactly, on any number of ranks.

use crate::support::{
    Facet, Run, Small, closed, config, cuboid, first_difference, run, slit, small, soup,
};
use bricks::octant::{LEVEL_MAX, morton, position};
use mesher::input::lattice::{Enclosed, Keep, Root};
use mesher::partition::{Division, Partitioner, Weights};
use mesher::record::Recorder;
use mesher::{Job, Options};
use proptest::prelude::*;
use ranks::{Comm, Gathered, MessageBuffer, sim};
use std::cell::RefCell;

/// Asserts equal leaves and equal components.
macro_rules! assert_equal {
    ($a:expr, $b:expr) => {
        let (a, b) = (&$a, &$b);
        prop_assert!(a.words == b.words, "{}", first_difference(&a.words, &b.words));
        prop_assert_eq!(a.summary, b.summary);
    };
}

/// One of the 48 symmetries of the root cube: a permutation of the axes, then mirror images.
#[derive(Clone, Copy, Debug)]
struct Symmetry {
    /// The image of each axis.
    to: [usize; 3],
    /// Whether the coordinate along each original axis is mirrored.
    mirrored: [bool; 3],
}

impl Symmetry {
    /// All 48 symmetries; the first is the identity.
    fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] =
            [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        ORDERS.into_iter().flat_map(|to| {
            (0..8).map(move |m| Self { to, mirrored: [0, 1, 2].map(|a| m >> a & 1 == 1) })
        })
    }

    /// The image of a point in the cube from 0 to `extent`.
    fn apply<T: Copy + std::ops::Sub<Output = T>>(&self, p: [T; 3], extent: T) -> [T; 3] {
        let mut q = p;
        for a in 0..3 {
            q[self.to[a]] = if self.mirrored[a] { extent - p[a] } else { p[a] };
        }
        q
    }

    /// The image of a case whose root extends from 0 to 64.
    fn case(&self, case: &Small) -> Small {
        let turn = |f: &Facet| f.map(|v| self.apply(v, 64.0));
        let mut image = case.with(case.facets.iter().map(turn).collect());
        for b in &mut image.boxes {
            let (p, q) = (self.apply(b.min, 64.0), self.apply(b.max, 64.0));
            b.min = std::array::from_fn(|a| p[a].min(q[a]));
            b.max = std::array::from_fn(|a| p[a].max(q[a]));
        }
        image
    }

    /// The images of leaf words, sorted.
    fn words(&self, words: &[u64]) -> Vec<u64> {
        let mut images: Vec<u64> = words.iter().map(|&w| self.word(w)).collect();
        images.sort_unstable();
        images
    }

    fn word(&self, w: u64) -> u64 {
        let level = (w >> 2 & 31) as u32;
        let below = 3 * (LEVEL_MAX - level);
        let p = position(w >> 7 >> below);
        morton(self.apply(p, (1 << level) - 1)) << below << 7 | w & 127
    }
}

/// The four quarters of a facet. Exact if the coordinates are even lattice points.
fn quarters([a, b, c]: &Facet) -> [Facet; 4] {
    let middle = |p: &[f32; 3], q: &[f32; 3]| std::array::from_fn(|i| (p[i] + q[i]) * 0.5);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
}

/// The case scaled by a power of two.
fn scaled(case: &Small, power: i32) -> Small {
    let (narrow, wide) = (2f32.powi(power), 2f64.powi(power));
    let mut image =
        case.with(case.facets.iter().map(|f| f.map(|v| v.map(|c| c * narrow))).collect());
    image.spacing_min *= wide;
    image.root = Root { origin: case.root.origin.map(|c| c * wide), edge: case.root.edge * wide };
    for b in &mut image.boxes {
        (b.min, b.max) = (b.min.map(|c| c * wide), b.max.map(|c| c * wide));
        b.spacing *= wide;
    }
    image
}

/// The case translated, including the root.
fn translated(case: &Small, by: [i32; 3]) -> Small {
    let shift = |v: [f32; 3]| std::array::from_fn(|a| v[a] + by[a] as f32);
    let mut image = case.with(case.facets.iter().map(|f| f.map(shift)).collect());
    let shift = |v: [f64; 3]| std::array::from_fn(|a| v[a] + f64::from(by[a]));
    image.root.origin = shift(case.root.origin);
    for b in &mut image.boxes {
        (b.min, b.max) = (shift(b.min), shift(b.max));
    }
    image
}

/// The words with all inside leaves turned into outside leaves.
fn all_outside(words: &[u64]) -> Vec<u64> {
    words.iter().map(|w| if w & 3 == 1 { w & !3 } else { *w }).collect()
}

proptest! {
    #![proptest_config(config(120))]

    /// The order of facets decides which rank reads which.
    #[test]
    fn shuffled_facets_give_the_same_mesh(
        (case, order) in small(soup()).prop_flat_map(|c| {
            let facets = Just(c.facets.clone()).prop_shuffle();
            (Just(c), facets)
        }),
        run in run(),
    ) {
        let shuffled = case.with(order);
        assert_equal!(shuffled.outcome(&run, true), case.outcome(&Run::SOLO, true));
        assert_equal!(shuffled.outcome(&run, false), case.outcome(&Run::SOLO, false));
    }

    #[test]
    fn reoriented_facets_give_the_same_mesh(
        case in small(soup()),
        which in any::<u64>(),
        run in run(),
    ) {
        let turn = |(i, f): (usize, &Facet)| match which >> (2 * i % 64) & 3 {
            0 => *f,
            1 => [f[1], f[2], f[0]],
            2 => [f[0], f[2], f[1]],
            _ => [f[2], f[1], f[0]],
        };
        let turned = case.with(case.facets.iter().enumerate().map(turn).collect());
        assert_equal!(turned.outcome(&run, true), case.outcome(&Run::SOLO, true));
        assert_equal!(turned.outcome(&run, false), case.outcome(&Run::SOLO, false));
    }

    /// Every ray meets every facet twice, so no leaf is inside. Crossing leaves do not change.
    #[test]
    fn duplicated_facets_leave_nothing_inside(
        case in small(soup()),
        reversed in any::<bool>(),
        run in run(),
    ) {
        let twins = case.facets.iter().map(|f| if reversed { [f[0], f[2], f[1]] } else { *f });
        let twice = case.with(case.facets.iter().copied().chain(twins).collect());

        let base = twice.outcome(&run, true);
        let want = all_outside(&case.outcome(&Run::SOLO, true).words);
        prop_assert!(base.words == want, "{}", first_difference(&base.words, &want));
        prop_assert_eq!(base.summary.ambiguous.count, 0);

        let all = Small { keep: Keep::All, ..case.clone() };
        let want = all_outside(&all.outcome(&Run::SOLO, false).words);
        for keep in [Keep::All, Keep::Outside] {
            // What was inside is outside and enclosed.
            let got = Small { keep, enclosed: Enclosed::Keep, ..twice.clone() }.outcome(&run, false).words;
            prop_assert!(got == want, "{:?}: {}", keep, first_difference(&got, &want));
        }

        // Without boxes all crossing leaves are of one level, so gradation splits nothing.
        let alone = Small { keep: Keep::Inside, keep_crossing: true, boxes: vec![], ..twice };
        let mut want = alone.outcome(&Run::SOLO, true).words;
        want.retain(|w| w & 3 == 2);
        let got = alone.outcome(&run, false).words;
        prop_assert!(got == want, "{:?}: {}", alone.keep, first_difference(&got, &want));
    }

    #[test]
    fn quartered_facets_give_the_same_mesh(
        case in small(soup()).prop_map(Small::on_lattice),
        run in run(),
    ) {
        let four = case.with(case.facets.iter().flat_map(quarters).collect());
        assert_equal!(four.outcome(&run, true), case.outcome(&Run::SOLO, true));
        assert_equal!(four.outcome(&run, false), case.outcome(&Run::SOLO, false));
    }

    /// On a closed body all rays agree, whichever way they are displaced.
    #[test]
    fn the_mesh_of_an_image_of_a_closed_body_is_the_image_of_the_mesh(
        case in small(closed()).prop_map(Small::on_lattice),
        which in 0usize..48,
        run in run(),
    ) {
        let symmetry = Symmetry::all().nth(which).expect("there are 48");
        let turned = symmetry.case(&case);
        for ungraded in [true, false] {
            let (got, straight) = (turned.outcome(&run, ungraded), case.outcome(&Run::SOLO, ungraded));
            let want = symmetry.words(&straight.words);
            prop_assert!(got.words == want, "{}", first_difference(&got.words, &want));
            prop_assert_eq!((got.summary.ambiguous.count, straight.summary.ambiguous.count), (0, 0));
        }
    }

    /// Crossing leaves do not depend on rays, so this holds for open soups as well.
    #[test]
    fn crossing_leaves_of_an_image_are_the_images_of_crossing_leaves(
        case in small(soup()).prop_map(Small::on_lattice),
        which in 0usize..48,
        run in run(),
    ) {
        let symmetry = Symmetry::all().nth(which).expect("there are 48");
        let crossing = |words: Vec<u64>| -> Vec<u64> {
            words.into_iter().filter(|w| w & 3 == 2).collect()
        };
        let got = crossing(symmetry.case(&case).outcome(&run, true).words);
        let want = crossing(symmetry.words(&case.outcome(&Run::SOLO, true).words));
        prop_assert!(got == want, "{}", first_difference(&got, &want));
    }

    #[test]
    fn dyadic_scaling_gives_the_same_mesh(
        case in small(soup()),
        power in -60i32..60,
        run in run(),
    ) {
        let image = scaled(&case, power);
        let on_lattice = |case: &Small, run: &Run| case.outcome(run, false).on_lattice(&case.root);
        assert_equal!(on_lattice(&image, &run), on_lattice(&case, &Run::SOLO));
    }

    #[test]
    fn exact_translation_gives_the_same_mesh(
        case in small(soup()).prop_map(Small::on_lattice),
        by in [-200i32..200, -200i32..200, -200i32..200],
        run in run(),
    ) {
        let image = translated(&case, by);
        for ungraded in [true, false] {
            let on_lattice = |case: &Small, run: &Run| case.outcome(run, ungraded).on_lattice(&case.root);
            assert_equal!(on_lattice(&image, &run), on_lattice(&case, &Run::SOLO));
        }
    }

    #[test]
    fn layers_thicker_than_the_root_equal_layers_as_thick_as_the_root(
        case in small(soup()),
        more in prop_oneof![65u32..300, Just(u32::MAX), Just(u32::MAX - 1)],
        run in run(),
    ) {
        let case = Small { boxes: vec![], layer_cells_min: 65, ..case };
        let thicker = Small { layer_cells_min: more, ..case.clone() };
        assert_equal!(thicker.outcome(&run, false), case.outcome(&Run::SOLO, false));
    }
}

/// A body without symmetries, with an extent box finer than its surface and one coarser.
fn crooked() -> Small {
    let mut facets = cuboid([9.0, 17.0, 30.0], [21.5, 40.0, 33.0]);
    facets.extend(cuboid([20.0, 18.25, 10.5], [50.0, 22.0, 31.0]));
    let boxed = |min, max, spacing| mesher::input::case::BoxSpec { min, max, spacing };
    Small {
        facets,
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 2.0,
        layer_cells_min: 2,
        keep: Keep::Outside,
        keep_crossing: true,
        boxes: vec![
            boxed([8.0, 16.0, 29.0], [10.0, 18.5, 31.0], 0.5),
            boxed([40.0, 2.0, 3.0], [60.0, 30.0, 9.0], 4.0),
        ],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

#[test]
fn the_mesh_of_each_of_48_images_of_a_body_is_the_image_of_its_mesh() {
    for (keep, keep_crossing) in [(Keep::Outside, true), (Keep::Inside, true), (Keep::All, false)] {
        let case = Small { keep, keep_crossing, ..crooked() };
        let straight = case.outcome(&Run::SOLO, false).words;
        assert!(straight.len() > 100, "{keep:?}: {} leaves are too few", straight.len());
        let mut images = std::collections::BTreeSet::new();
        for symmetry in Symmetry::all() {
            let got = symmetry.case(&case).outcome(&Run::SOLO, false).words;
            let want = symmetry.words(&straight);
            assert!(got == want, "{symmetry:?}: {}", first_difference(&got, &want));
            images.insert(got);
        }
        assert_eq!(images.len(), 48, "the body must have no symmetry");
    }
}

#[test]
fn the_papers_partition_gives_the_same_mesh_or_an_error() {
    for keep in [Keep::Outside, Keep::Inside, Keep::All] {
        let case = Small { keep, ..crooked() };
        let want = case.outcome(&Run::SOLO, false);
        for (level_base, ranks, is_enough) in
            [(None, 7, true), (Some(3), 2, true), (Some(1), 9, false)]
        {
            let (partitioner, weights) = (Partitioner::Paper, Weights::Unit);
            let division = Division { partitioner, weights, level_base };
            let got = case.try_outcome(&Run { ranks, seed: 3, division }, false);
            assert_eq!(got.is_ok(), is_enough, "{keep:?} {ranks} {:?}", got.err());
            assert!(got.is_err() || got.unwrap() == want, "{keep:?} {ranks}");
        }
    }
}

/// Includes ranks without base leaves.
#[test]
fn every_partition_gives_the_same_mesh() {
    let leaky = Small { facets: crooked().facets[1..].to_vec(), keep: Keep::All, ..crooked() };
    let hollow = Small { keep: Keep::Inside, keep_crossing: false, ..crooked() };
    let boxes_alone = Small { facets: vec![], ..crooked() };
    let lone_leaf = Small { facets: vec![], boxes: vec![], ..crooked() };
    for (name, case) in [
        ("leaky", leaky),
        ("hollow", hollow),
        ("boxes alone", boxes_alone),
        ("lone leaf", lone_leaf),
    ] {
        for ungraded in [true, false] {
            let want = case.outcome(&Run::SOLO, ungraded);
            for run in partitions() {
                let got = case.outcome(&run, ungraded);
                let difference = || first_difference(&got.words, &want.words);
                assert!(got == want, "{name}, ungraded {ungraded}, {run:?}: {}", difference());
            }
        }
    }
}

fn partitions() -> impl Iterator<Item = Run> {
    let levels = [None, Some(0), Some(1), Some(2), Some(4), Some(6), Some(19)];
    let ways = [Partitioner::Metis, Partitioner::Morton]
        .into_iter()
        .flat_map(|p| [Weights::Unit, Weights::Area, Weights::Rebalance].map(|w| (p, w)));
    ways.flat_map(move |(partitioner, weights)| {
        levels.into_iter().flat_map(move |level_base| {
            [(2, 1), (8, 3), (33, 5)].map(move |(ranks, seed)| Run {
                ranks,
                seed,
                division: Division { partitioner, weights, level_base },
            })
        })
    })
}

/// A rank that notes the phases that it enters.
struct Noting<'a>(&'a dyn Comm, RefCell<Vec<&'static str>>);

impl Comm for Noting<'_> {
    fn rank(&self) -> usize {
        self.0.rank()
    }

    fn size(&self) -> usize {
        self.0.size()
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        self.0.all_gather(mine)
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        self.0.sums(mine)
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        self.0.sparse_all_to_all(to)
    }

    fn repeat_alone(&self, body: &mut dyn FnMut()) {
        self.0.repeat_alone(body);
    }

    fn enter(&self, phase: &'static str) {
        self.1.borrow_mut().push(phase);
    }
}

#[test]
fn a_simulated_rank_repeats_phases_3_to_10_if_it_is_timed_alone() {
    let body = slit(1.0, 10.0, Keep::Outside, vec![]);
    for (ranks, time_alone) in [(1, false), (1, true), (3, false), (3, true)] {
        let meshed = sim::run(ranks, 1, |comm| {
            let comm = Noting(comm, RefCell::default());
            let options = Options { time_alone, ..Options::default() };
            let mut record = Recorder::default();
            let job = &mut Job::new(&options, &comm, &mut record);
            let report = mesher::mesh(&body.mesher_case(), job, |_, _| Ok(())).expect("a case");
            let names: Vec<_> = record.phases.iter().map(|phase| phase.name).collect();
            (comm.1.into_inner(), names, report.mesh.digest)
        });
        for (entered, names, digest) in &meshed {
            let times = |name: &str| entered.iter().filter(|phase| **phase == name).count();
            let again = 1 + usize::from(time_alone);
            assert_eq!((times("read"), times("quantise")), (1, 1));
            assert_eq!(["sides", "grade", "leaves", "finish"].map(times), [again; 4]);
            // Each phase has one entry.
            let once = names.iter().collect::<std::collections::BTreeSet<_>>();
            assert_eq!((once.len(), digest), (names.len(), &meshed[0].2));
        }
    }
}
