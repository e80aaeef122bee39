//! Random inputs for property tests.
use super::dense::{self, CROSSING};
use super::{ROOT_EDGE, block, box_of_level, case};
use proptest::array::uniform3;
use proptest::bool::weighted;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::TestRunner;
use reference::{Case, Enclosed, Keep};
use std::ops::RangeInclusive;

pub type Facet = [[i64; 3]; 3];

/// Tests `property` on random values of `inputs`, as many as the environment variable
/// `PROPTEST_CASES` gives or else `cases`. The seed of a failure is written to a file beside
/// `source`, the test's `file!()`.
///
/// # Panics
/// If the property panics, with the simplest failing value that was found.
pub fn for_all<S: Strategy>(
    source: &'static str,
    cases: u32,
    inputs: S,
    property: impl Fn(S::Value),
) {
    let cases = std::env::var("PROPTEST_CASES").map_or(cases, |n| n.parse().unwrap());
    let config = ProptestConfig {
        cases,
        source_file: Some(source),
        max_shrink_iters: 500,
        ..Default::default()
    };
    let tested = TestRunner::new(config).run(&inputs, |input| {
        property(input);
        Ok(())
    });
    if let Err(failure) = tested {
        panic!("{failure}");
    }
}

/// A facet with all coordinates in a range.
pub fn facet(range: RangeInclusive<i64>) -> impl Strategy<Value = Facet> {
    uniform3(uniform3(range))
}

/// A case, with its facets on the lattice and the level D of its surface.
#[derive(Clone, Debug)]
pub struct RandomCase {
    pub facets: Vec<Facet>,
    pub level_surface: u32,
    pub case: Case,
}

/// Cases of any facets, boxes and valid seeds, none of which requires a level beyond `finest`. Most
/// have no seeds.
pub fn cases(finest: u32) -> impl Strategy<Value = RandomCase> {
    let unit = ROOT_EDGE >> 5;
    let extent_box = (uniform3(0..=30_i64), uniform3(1..=12_i64), 0..=finest).prop_map(
        move |(min, size, level)| {
            let max: [i64; 3] = std::array::from_fn(|a| (min[a] + size[a]).min(32));
            box_of_level(min.map(|x| x * unit), max.map(|x| x * unit), level)
        },
    );
    let keep = select(vec![Keep::Outside, Keep::Inside, Keep::All]);
    let enclosed = select(vec![Enclosed::Delete, Enclosed::Keep]);
    let region = (keep, any::<bool>(), enclosed, seeds());
    (soup(), 1..=finest, vec(extent_box, 0..=2), 1..=4_u32, region).prop_map(
        move |(facets, level_surface, boxes, layer_cells_min, region)| {
            let (keep, keep_crossing, enclosed, seeds) = region;
            let case = case(&facets, level_surface);
            let mut case =
                Case { layer_cells_min, keep, keep_crossing, boxes, enclosed, seeds, ..case };
            if !case.seeds.is_empty() {
                let mut free = dense::base(&case, &facets, finest, level_surface);
                free.cells.retain(|cell| cell.side != CROSSING);
                case.seeds.retain(|&seed| free.contain(&free.cells, seed));
            }
            RandomCase { facets, level_surface, case }
        },
    )
}

/// Cases like those of [`cases`] for external flow, with a shell around the middle of the root as an
/// additional body. Most have enclosed space.
pub fn cases_with_a_cavity(finest: u32) -> impl Strategy<Value = RandomCase> {
    let unit = ROOT_EDGE >> 4;
    let outer = (uniform3(1..=2_i64), uniform3(14..=15_i64));
    let inner = (uniform3(4..=5_i64), uniform3(9..=11_i64));
    (cases(finest), outer, inner, 0..=unit).prop_map(move |(random, outer, inner, shift)| {
        let mut facets = random.facets;
        for (min, max) in [outer, inner] {
            facets.extend(block(min.map(|x| x * unit + shift), max.map(|x| x * unit + shift)));
        }
        let surface = case(&facets, finest);
        let Case { layer_cells_min, keep_crossing, boxes, enclosed, .. } = random.case;
        let keep = Keep::Outside;
        let case = Case { layer_cells_min, keep, keep_crossing, boxes, enclosed, ..surface };
        RandomCase { facets, level_surface: finest, case }
    })
}

/// No seeds or a few, half of them in cell planes.
fn seeds() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let unit = ROOT_EDGE >> 5;
    let planes = uniform3(0..32_i64).prop_map(move |point| point.map(|x| x * unit));
    let point = prop_oneof![uniform3(0..ROOT_EDGE), planes];
    let point = point.prop_map(|point| point.map(|x| x as f64));
    prop_oneof![3 => Just(Vec::new()), 1 => vec(point, 1..=3)]
}

/// Facets of every kind: blocks, closed or with a hole, triangles, segments and points, in cell
/// planes and outside them, within the root and reaching out of it.
fn soup() -> impl Strategy<Value = Vec<Facet>> {
    (3..=5_u32).prop_flat_map(|level| {
        let unit = ROOT_EDGE >> level;
        let cells = 1_i64 << level;
        let shift = prop_oneof![Just(0), 0..=unit];
        let blocks = (uniform3(-1..=cells - 2), uniform3(2..=cells), shift).prop_map(
            move |(min, size, shift)| {
                let max: [i64; 3] = std::array::from_fn(|a| min[a] + size[a]);
                block(min.map(|x| x * unit + shift), max.map(|x| x * unit + shift))
            },
        );
        let indices = select(vec![[0, 1, 2], [0, 1, 2], [0, 1, 1], [0, 0, 0]]);
        let triangles = (facet(-2..=cells + 2), indices).prop_map(move |(vertices, indices)| {
            indices.map(|i: usize| vertices[i].map(|x| x * unit))
        });
        (vec(blocks, 0..=2), weighted(1.0 / 3.0), vec(triangles, 0..=3)).prop_map(
            |(blocks, has_hole, triangles)| {
                let mut facets = blocks.concat();
                if has_hole {
                    facets.pop();
                }
                facets.extend(triangles);
                facets
            },
        )
    })
}
