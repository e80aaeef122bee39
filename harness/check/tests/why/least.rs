//! A correct mesh has no needless and no missing split, and every planted one is found.

use super::*;
use check::why::NEEDLESS;
use contract::octant::{LEVEL_MAX, Octant};
use contract::testing::octants_of;
use contract::word;

/// The octants with each fault, and how many were examined.
#[derive(Debug, Default)]
struct Found {
    splits_and_leaves: usize,
    needless: Vec<Octant>,
    missing: Vec<Octant>,
}

fn audited(set: &LeafSet, case: Option<&Case>) -> Found {
    let mut found = Found::default();
    with_mesh(set, case, |mesh| {
        mesh.audit(&mut |octant, fault| {
            found.splits_and_leaves += 1;
            match fault {
                Some(NEEDLESS) => found.needless.push(octant),
                Some(_) => found.missing.push(octant),
                None => {}
            }
        });
    });
    found
}

/// The words with the leaf at an index split.
fn split(words: &mut Vec<u64>, at: usize) {
    let (octant, side) = (word::octant(words[at]), word::side(words[at]));
    let children = (0..8).map(|d| word::encode(octant.child(d), side));
    words.splice(at..=at, children);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn planted_splits_are_counted_exactly(
        text in settings(1..5), facets in prop_oneof![soup(1..8), hull()], boxes in boxes(0..3, 6),
        plants in prop::collection::vec(any::<prop::sample::Index>(), 0..5), nested in any::<bool>(),
    ) {
        let text = text + &boxes.concat();
        let correct = made(&text, &facets);
        let mut words = correct.mesh.words.clone();
        let mut planted = 0;
        let mut last = None;
        for plant in plants.iter().filter(|_| !correct.mesh.words.is_empty()) {
            // Every second split is below the one before.
            let at = last.take().filter(|_| nested).unwrap_or_else(|| plant.index(words.len()));
            if word::level(words[at]) < LEVEL_MAX {
                split(&mut words, at);
                (planted, last) = (planted + 1, Some(at + planted % 8));
            }
        }
        let case = correct.case.keep_crossing.then_some(None).into_iter();
        for case in case.chain([Some(&correct.case)]) {
            let mutated = correct.mesh.with_parts(vec![words.clone()]);
            let found = audited(&mutated, case);
            prop_assert_eq!(found.needless.len(), planted, "{}{:?}", text, found);
            let splits = octants_of(&words).len() - words.len();
            prop_assert_eq!(found.splits_and_leaves, splits + words.len());
            prop_assert_eq!(found.missing.len(), 0, "{}{:?}", text, found);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// The mesh is the least one, so whatever is merged has to be split.
    #[test]
    fn every_merged_octant_is_found(
        text in settings(1..5), facets in prop_oneof![soup(1..8), hull()], boxes in boxes(0..3, 6),
        which in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
    ) {
        let text = text + &boxes.concat();
        let correct = made(&text, &facets);
        let parent = |w: &u64| (word::level(*w) > 0).then(|| {
            let octant = word::octant(*w);
            octant.ancestor(octant.level - 1)
        });
        for which in which {
            let mut words = correct.mesh.words.clone();
            let groups: Vec<_> = (0..words.len().saturating_sub(7))
                .filter(|&i| parent(&words[i]).is_some() && words[i..i + 8].iter().all(|w| parent(w) == parent(&words[i])))
                .collect();
            if groups.is_empty() {
                continue;
            }
            let at = groups[which.index(groups.len())];
            let octant = parent(&words[at]).expect("it has siblings");
            let side = word::side(words[at]);
            words.splice(at..at + 8, [word::encode(octant, side)]);
            let mutated = correct.mesh.with_parts(vec![words]);
            let found = audited(&mutated, Some(&correct.case));
            prop_assert!(found.missing.contains(&octant), "{}{} {:?}", text, octant, found);
        }
    }
}

/// The places at which needless refinement is likely: the far field, the surroundings of a box, and of deleted leaves.
#[test]
fn a_needless_split_is_found_wherever_it_is() {
    for name in ["outside", "inside", "all", "boxes"] {
        let correct = support::built_in(name);
        let (case, words) = (Some(&correct.case), &correct.mesh.words);
        let count = |set: &LeafSet| audited(set, case);
        for set in [&correct.mesh, &correct.base] {
            let found = count(set);
            assert_eq!((found.needless.len(), found.missing.len()), (0, 0), "{name}");
        }
        for at in (0..words.len()).step_by(words.len() / 12) {
            let mut mutated = words.clone();
            split(&mut mutated, at);
            let found = count(&correct.mesh.with_parts(vec![mutated]));
            assert_eq!(found.needless.len(), 1, "{name}: {found:?}");
            let planted = word::octant(words[at]);
            assert_eq!(found.needless[0], planted, "{name}: {found:?}");
        }
        // No layer and no balance requires a split of the base tree.
        let words = &correct.base.words;
        for at in (0..words.len()).step_by(words.len() / 12) {
            let mut mutated = words.clone();
            split(&mut mutated, at);
            let found = count(&correct.base.with_parts(vec![mutated]));
            assert_eq!(found.needless.len(), 1, "{name}: {found:?}");
        }
    }
}

/// Faces of a box in every part of an octant, so that octants are deleted with all their leaves, or with some. The deleted space
/// within the box has coarse leaves in T0, which require nothing. A small, fine extent box beside them refines few of those that are deleted:
/// whoever visits all octants that the others could have takes minutes.
#[test]
fn deleted_crossing_leaves_require_the_layers_around_them_and_other_deleted_leaves_do_not() {
    let bodies = [
        ([[-3.8, 3.2], [-4.8, 3.3], [-4.4, 0.2]], 3, ""),
        ([[-1.8, 2.2], [-0.8, 3.3], [-2.4, 1.2]], 4, ""),
        (
            [[-1.8, 2.2], [-0.8, 3.3], [-2.4, 1.2]],
            4,
            "box = [{ min = [2.3, 0.1, 0.1], max = [2.301, 0.101, 0.101], spacing = 0.001 }]\n",
        ),
    ];
    for (ends, n, extra) in bodies {
        let facets = sides::cuboid(ends);
        for keep in ["outside", "inside", "all"] {
            let text = format!(
                "spacing_min = 1.0\nlayer_cells_min = {n}\nkeep = {keep:?}\nkeep_crossing = false\n{extra}{ROOT}"
            );
            let correct = made(&text, &facets);
            let words = &correct.mesh.words;
            let count = |words: Vec<u64>| {
                let set = correct.mesh.with_parts(vec![words]);
                audited(&set, Some(&correct.case)).needless.len()
            };
            assert_eq!(count(words.clone()), 0, "{n} cells, {keep}");
            let coarsest = words.iter().map(|&w| word::level(w)).min().unwrap();
            let is_coarse = |&i: &usize| word::level(words[i]) <= coarsest + 1;
            let coarse: Vec<usize> = (0..words.len()).filter(is_coarse).collect();
            for &i in coarse.iter().step_by(1 + coarse.len() / 8) {
                let mut needless = words.clone();
                split(&mut needless, i);
                let leaf = word::octant(words[i]);
                assert_eq!(count(needless), 1, "{n} cells, {keep}: {leaf}");
            }
        }
    }
}

/// Then no leaf of the least mesh is a leaf, and yet each justifies what it did.
#[test]
fn needless_splits_of_all_leaves_are_counted_and_no_other() {
    let facets = sides::cuboid([[-2.8, 1.2], [-1.8, 3.3], [-2.4, 0.2]]);
    for (keep, crossing, n) in [("outside", true, 3), ("outside", false, 3), ("all", true, 1)] {
        let text = format!(
            "spacing_min = 1.0\nlayer_cells_min = {n}\nkeep = {keep:?}\nkeep_crossing = {crossing}\n{ROOT}"
        );
        let correct = made(&text, &facets);
        let mut words = correct.mesh.words.clone();
        (0..words.len()).rev().for_each(|i| split(&mut words, i));
        let mutated = correct.mesh.with_parts(vec![words]);
        let found = audited(&mutated, Some(&correct.case));
        assert_eq!(found.needless.len(), correct.mesh.words.len(), "{keep}, {crossing}: {found:?}");
    }
}

#[test]
fn a_needless_split_below_the_deepest_level_has_no_cause() {
    let correct = support::built_in("outside");
    let mut words = correct.mesh.words.clone();
    let deepest = words.iter().map(|&w| word::level(w)).max().unwrap();
    let at = words.iter().position(|&w| word::level(w) == deepest).unwrap();
    let point = correct.case.root.to_user(word::octant(words[at]).child(0).centre());
    split(&mut words, at);
    for case in [None, Some(&correct.case)] {
        let mutated = correct.mesh.with_parts(vec![words.clone()]);
        let answer = with_mesh(&mutated, case, |mesh| mesh.at(point).unwrap());
        assert!(answer.split.as_ref().unwrap().cause.is_none(), "{answer}");
        let answer = with_mesh(&correct.mesh, case, |mesh| mesh.at(point).unwrap());
        assert!(answer.split.as_ref().unwrap().cause.is_some(), "{answer}");
    }
}

#[test]
fn a_layer_thicker_than_the_root_refines_all_of_it_and_a_single_leaf_has_no_split() {
    for (layer_cells_min, spacing, leaves, splits) in [(40, 1.0, 512, 73), (40, 8.0, 1, 0)] {
        let text = format!(
            "spacing_min = {spacing:?}\nlayer_cells_min = {layer_cells_min}\nkeep = 'all'\n\
             root = {{ origin = [-4.0, -4.0, -4.0], edge = 8.0 }}\ngenerator = {{ shape = 'cube', facets = 12 }}\n"
        );
        let correct = support::selftest_case("thick", &text);
        assert_eq!(correct.mesh.words.len(), leaves);
        for case in [None, Some(&correct.case)] {
            let found = audited(&correct.mesh, case);
            assert_eq!(
                (found.needless.len(), found.splits_and_leaves),
                (0, splits + leaves),
                "{found:?}"
            );
        }
    }
}
