//! No false alarms: every check passes on the reference's meshes of random bodies, also in the audit. And a fault among deleted leaves, which no leaf shows.

use crate::support;
use check::audit;
use check::checks::{self, Subject};
use check::promises::{Promises, Sides, Surface, Touching};
use contract::leafset::LeafSet;
use contract::manifest::Tree;
use contract::octant::Octant;
use contract::word::{self, Side};
use geometries::Facet;
use proptest::prelude::*;

/// Coordinates that often coincide with each other and with faces of octants, in a root of edge 16 around the
/// origin.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![(-12i32..=12).prop_map(|i| i as f32 * 0.5), -6.0f32..6.0]
}

pub fn soup() -> impl Strategy<Value = Vec<Facet>> {
    let vertex = || prop::array::uniform3(coordinate());
    let facet = prop::array::uniform3(vertex());
    let degenerate = (vertex(), vertex()).prop_map(|(a, b)| [a, b, a]);
    prop::collection::vec(prop_oneof![8 => facet, 1 => degenerate], 0..8)
}

/// Watertight boxes, often with faces on those of octants: several that may overlap, or one within another.
pub fn hulls() -> impl Strategy<Value = Vec<Facet>> {
    let any = (prop::array::uniform3(coordinate()), prop::array::uniform3(0.6f32..6.0));
    let outer = (Just([-6.0; 3]), prop::array::uniform3(9.0f32..12.0));
    let inner = (prop::array::uniform3(-4.5f32..-2.0), prop::array::uniform3(2.0f32..4.5));
    let nested = (outer, inner).prop_map(|(outer, inner)| [hull(outer), hull(inner)].concat());
    prop_oneof![
        prop::collection::vec(any.prop_map(hull), 1..4).prop_map(|hulls| hulls.concat()),
        nested,
    ]
}

/// The box with this minimum corner and size.
pub fn hull((low, size): ([f32; 3], [f32; 3])) -> Vec<Facet> {
    let corner = |i: usize| -> [f32; 3] {
        std::array::from_fn(|a| low[a] + if i >> a & 1 == 1 { size[a] } else { 0.0 })
    };
    let quads =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let halves = |q: [usize; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
    quads.into_iter().flat_map(halves).map(|t| t.map(corner)).collect()
}

/// A case file without geometry. About half of the cases that have seeds are valid.
pub fn settings() -> impl Strategy<Value = String> {
    let extent = (prop::array::uniform3(coordinate()), prop::array::uniform3(0.3f32..4.0), 0i32..6);
    let boxes = prop::collection::vec(extent, 0..3);
    let keep = prop::sample::select(vec!["outside", "inside", "all"]);
    let enclosed = prop_oneof![3 => Just("delete"), 1 => Just("keep")];
    let seed = prop::array::uniform3(prop_oneof![coordinate(), -8.0f32..8.0]);
    let seeds = prop_oneof![3 => Just(vec![]), 2 => prop::collection::vec(seed, 1..3)];
    let region = (keep, any::<bool>(), enclosed, seeds);
    (prop_oneof![0i32..6, 4i32..6], 1u32..=10, region, boxes).prop_map(|(level, n, region, boxes)| {
        let (keep, crossing, enclosed, seeds) = region;
        let spacing = |level: i32| 16.0 * 0.5f64.powi(level);
        let mut text = format!(
            "spacing_min = {:?}\nlayer_cells_min = {n}\nkeep = {keep:?}\nkeep_crossing = {crossing}\n\
             enclosed = {enclosed:?}\nseeds = {seeds:?}\n[root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0\n",
            spacing(level)
        );
        for (min, size, level) in boxes {
            let max: [f32; 3] = std::array::from_fn(|a| min[a] + size[a]);
            text += &format!("[[box]]\nmin = {min:?}\nmax = {max:?}\nspacing = {:?}\n", spacing(level));
        }
        text
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn all_checks_pass_on_meshes_of_the_reference(facets in prop_oneof![soup(), hulls()], text in settings()) {
        let correct = match support::meshes_of_facets(&text, &facets) {
            Ok(correct) => correct,
            Err([harness, reference]) => {
                prop_assert!(harness.contains("seed") && reference.contains("seed"), "{harness}, {reference}");
                return Ok(());
            }
        };
        for tree in [Tree::Final, Tree::Base] {
            let subject = Subject::new(&correct.case, tree, correct.set(tree));
            for result in checks::all(&subject) {
                prop_assert!(result.holds(), "without a reference: {text}{result}");
            }
            for result in checks::all(&subject.with_reference(correct.set(tree))) {
                prop_assert!(result.holds(), "{text}{result}");
            }
        }
        let definition = Promises::of_definition();
        for set in [&correct.mesh, &correct.base] {
            let dir = tempfile::tempdir().unwrap();
            set.write(dir.path()).unwrap();
            let mut case = correct.case.clone();
            case.rules.tree = set.manifest.tree;
            for case in [None, Some(&case)] {
                let report = audit::audit_against(dir.path(), case, &definition);
                prop_assert!(report.holds(), "{text}{report}");
            }
        }
    }

    /// The definition includes every promise. Around a body that is not watertight, the rays of a single leaf may contradict
    /// its component.
    #[test]
    fn meshes_of_the_reference_keep_every_promise(facets in hulls(), text in settings()) {
        let promises = Promises {
            complete: true,
            crossing: true,
            surface: Some(Surface { tolerance_cells: 0.0 }),
            boxes: true,
            sides: Some(Sides { band_cells: 1.0 }),
            balance: Some(Touching::Corner),
            layers: true,
            ..Promises::default()
        };
        let Ok(correct) = support::meshes_of_facets(&text, &facets) else { return Ok(()) };
        let results = checks::all(&Subject::new(&correct.case, Tree::Final, &correct.mesh).promising(&promises));
        prop_assert_eq!(results.len(), 2 + 7);
        for result in results {
            prop_assert!(result.holds(), "{text}{result}");
        }
    }
}

#[test]
fn a_layer_that_is_too_thin_around_deleted_leaves_breaks_its_promise() {
    let text = "spacing_min = 0.25\nlayer_cells_min = 4\nkeep_crossing = false\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n";
    let correct = support::meshes_of_facets(text, &hull(([-1.0; 3], [2.0; 3]))).unwrap();
    let promises = Promises { layers: true, ..Promises::default() };
    let holds = |set: &LeafSet| {
        let subject = Subject::new(&correct.case, Tree::Final, set).promising(&promises);
        checks::all(&subject).iter().all(|result| result.holds())
    };
    assert!(holds(&correct.mesh));
    // The leaves beside those that the facets at x = 1 cross, merged.
    let near = word::octant(correct.mesh.words[0]).level;
    let root = correct.mesh.manifest.root;
    let is_near = |parent: &Octant| root.place(*parent).to_string().contains("[1.5, 0.0, 0.0] to");
    let words = &correct.mesh.words;
    let parents = words.iter().map(|w| word::octant(*w)).filter(|o| o.level > near);
    let parent = parents.map(|o| o.parent()).find(is_near).expect("a leaf near the body");
    let (inside, mut merged): (Vec<u64>, Vec<u64>) =
        words.iter().partition(|w| parent.contains(&word::octant(**w)));
    assert_eq!(inside.len(), 8);
    merged.push(word::encode(parent, Side::Outside));
    merged.sort_unstable();
    assert!(!holds(&correct.mesh.with_parts(vec![merged])));
}
