//! Explanations of meshes that the reference made: every cause is checked by removing it.

#[path = "../checks/support.rs"]
#[allow(dead_code)]
mod support;

mod chains;
mod least;
mod sides;

use check::selftest::{self, SelftestCase};
use check::why::{self, Mesh};
use contract::case::Case;
use contract::leafset::LeafSet;
use contract::testing::assert_text;
use contract::tree::Tree;
use contract::word;
use geometries::Facet;
use proptest::prelude::*;

fn with_mesh<T>(set: &LeafSet, case: Option<&Case>, examine: impl FnOnce(Mesh) -> T) -> T {
    let tree = Tree::of_words(&set.words);
    let body = case.map(|case| why::body(case, &set.manifest).unwrap());
    examine(Mesh::of(&set.manifest, &tree, body.as_ref()))
}

/// Final mesh and T0 of facets and the text of a case.
fn made(text: &str, facets: &[Facet]) -> SelftestCase {
    support::meshes_of_facets(text, facets).unwrap()
}

const ROOT: &str = "[root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0\n";

/// A coordinate, often on a face of a cell.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![(-60i32..60).prop_map(|c| c as f32 / 8.0), -7.5f32..7.5]
}

/// Small facets at random places.
fn soup(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Facet>> {
    let offset = || prop::array::uniform3(-1.0f32..1.0);
    let facet = (prop::array::uniform3(coordinate()), offset(), offset()).prop_map(|(at, u, v)| {
        let add = |by: [f32; 3]| std::array::from_fn(|a| at[a] + by[a]);
        [at, add(u), add(v)]
    });
    prop::collection::vec(facet, count)
}

/// A closed box.
fn hull() -> impl Strategy<Value = Vec<Facet>> {
    (prop::array::uniform3(-6.0f32..1.0), prop::array::uniform3(1.0f32..6.0)).prop_map(
        |(low, size)| {
            let corner = |i: usize| -> [f32; 3] {
                std::array::from_fn(|a| low[a] + if i >> a & 1 == 1 { size[a] } else { 0.0 })
            };
            let quads = [
                [0, 1, 3, 2],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 3, 7, 5],
            ];
            let halves = |q: [usize; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
            quads.into_iter().flat_map(halves).map(|t| t.map(corner)).collect()
        },
    )
}

/// Boxes as tables of a case file, with levels below `level`.
fn boxes(count: std::ops::Range<usize>, level: i32) -> impl Strategy<Value = Vec<String>> {
    let extent =
        (prop::array::uniform3(coordinate()), prop::array::uniform3(0.3f32..3.0), 2..level);
    prop::collection::vec(extent, count).prop_map(|boxes| {
        let table = |(min, size, level): ([f32; 3], [f32; 3], i32)| {
            let max: [f32; 3] = std::array::from_fn(|a| min[a] + size[a]);
            let spacing = 16.0 * 0.5f64.powi(level);
            format!("[[box]]\nmin = {min:?}\nmax = {max:?}\nspacing = {spacing:?}\n")
        };
        boxes.into_iter().map(table).collect()
    })
}

/// Case files without geometry and without boxes: any kept side, surface levels from `levels`.
fn settings(levels: std::ops::Range<i32>) -> impl Strategy<Value = String> {
    let keep = prop::sample::select(vec!["outside", "inside", "all"]);
    (levels, 1u32..=4, keep, any::<bool>()).prop_map(|(level, n, keep, crossing)| {
        let spacing = 16.0 * 0.5f64.powi(level);
        format!("spacing_min = {spacing:?}\nlayer_cells_min = {n}\nkeep = {keep:?}\nkeep_crossing = {crossing}\n{ROOT}")
    })
}

/// The answers about points in leaves of every size and side, and in deleted parts.
#[test]
fn the_answers_about_points_of_each_case_are_the_expected_texts() {
    let mut texts = String::new();
    for (name, text) in selftest::cases().into_iter().filter(|(name, _)| name != "all") {
        let correct = support::selftest_case(&name, &text);
        let of_mesh = &correct.mesh.words;
        let leaves = correct.base.words.iter().step_by(correct.base.words.len() / 3);
        let leaves = leaves.chain(of_mesh.iter().step_by(of_mesh.len() / 3));
        with_mesh(&correct.mesh, Some(&correct.case), |mesh| {
            for &leaf in leaves {
                let centre = correct.case.root.to_user(word::octant(leaf).centre());
                texts += &format!("{name}\n{}\n", mesh.at(centre).unwrap());
            }
        });
    }
    assert_text(&texts, "tests/why/expected/answers.txt");
}
