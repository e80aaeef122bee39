//! What decides a side: facets, the rays of a candidate, a seed; and what is enclosed.

use super::*;
use check::checks::components;
use check::why::answer::Answer;
use contract::octant::Octant;
use contract::word::{self, Side};

/// Two nested spheres: the far field, a wall and a cavity.
const NESTED: &str = "spacing_min = 0.125\nlayer_cells_min = 1\nkeep = \"all\"\nroot_scale = 4.0\n\
                      [generator]\nshape = \"nested_spheres\"\nfacets = 640\n";

/// T0 of two nested spheres with seeds, relabelled by the harness's own components.
fn with_seeds(seeds: &[[f64; 3]]) -> SelftestCase {
    let mut correct = support::selftest_case("nested", NESTED);
    correct.case.seeds = seeds.to_vec();
    let quantised = seeds.iter().map(|&seed| correct.case.root.quantise_seed(seed).unwrap());
    correct.case.rules.seeds = quantised.collect();
    correct.base.manifest.seeds = correct.case.rules.seeds.clone();
    let terms = correct.case.rules.clone();
    let mut words = correct.base.words.clone();
    for component in components::find(&words.clone(), &terms, &correct.case.facets_lattice) {
        for &i in &component.leaves {
            words[i as usize] = words[i as usize] & !3 | component.side as u64;
        }
    }
    correct.base = correct.base.with_parts(vec![words]);
    correct
}

/// The answers for the first leaf of every component, for its last, and for a crossing leaf.
fn explain(correct: &SelftestCase) -> Vec<Answer> {
    let words = &correct.base.words;
    let terms = correct.case.rules.clone();
    let found = components::find(words, &terms, &correct.case.facets_lattice);
    let ends = found.iter().flat_map(|component| {
        [component.leaves[0], *component.leaves.last().unwrap()].map(|i| words[i as usize])
    });
    let crossing = words.iter().copied().find(|&w| word::side(w) == Side::Crossing);
    with_mesh(&correct.base, Some(&correct.case), |mesh| {
        let centre = |w| correct.case.root.to_user(word::octant(w).centre());
        ends.chain(crossing).map(|w| mesh.at(centre(w)).unwrap()).collect()
    })
}

#[test]
fn seeds_decide_the_side_of_their_component_and_of_all_others() {
    // In the middle of the inner sphere, and in the far field.
    let correct = with_seeds(&[[0.01, 0.01, 0.01], [1.9, 1.9, 1.9]]);
    let mut seeds = Vec::new();
    for answer in explain(&correct) {
        let (side, decision) = answer.side_decided_by.unwrap();
        assert_eq!(answer.leaf.map(|(_, side)| side), Some(side));
        if side != Side::Crossing {
            assert_eq!(decision.starts_with("seed "), side == Side::Outside);
            seeds.push(decision);
        }
    }
    for decision in ["no seed lies", "seed 0 lies", "seed 1 lies"] {
        assert!(seeds.iter().any(|seed| seed.starts_with(decision)), "{decision}: {seeds:?}");
    }
}

#[test]
fn a_leaf_with_a_wrong_side_is_called_wrong() {
    let mut correct = support::selftest_case("nested", NESTED);
    let point = correct.case.root.to_user(word::octant(correct.base.words[0]).centre());
    let explained = |of: &SelftestCase| {
        with_mesh(&of.base, Some(&of.case), |mesh| mesh.at(point).unwrap()).to_string()
    };
    let text = "  the mesh is wrong: its leaf is inside\n";
    assert!(!explained(&correct).contains("wrong"));
    let mut words = correct.base.words.clone();
    words[0] = words[0] & !3 | Side::Inside as u64;
    correct.base = correct.base.with_parts(vec![words]);
    assert!(explained(&correct).ends_with(text), "{}", explained(&correct));
}

#[test]
fn the_candidate_is_the_first_leaf_of_its_component_and_its_rays_agree() {
    let correct = with_seeds(&[]);
    let terms = correct.case.rules.clone();
    let found = components::find(&correct.base.words, &terms, &correct.case.facets_lattice);
    let mut sides = Vec::new();
    for answer in explain(&correct) {
        let (side, decision) = answer.side_decided_by.as_ref().unwrap();
        if *side != Side::Crossing {
            let begins = |octant: &Octant| {
                let text =
                    format!("each of the six rays of the candidate octant {} ", octant.path());
                decision.starts_with(&text)
            };
            assert!(found.iter().any(|c| begins(&c.first) && c.side == *side), "{answer}");
            let parity = if *side == Side::Inside { "an odd" } else { "an even" };
            assert!(decision.contains(parity), "{answer}");
            assert_eq!(answer.leaf.map(|(_, side)| side), Some(*side));
            sides.push(*side);
        }
    }
    assert!(sides.contains(&Side::Inside) && sides.contains(&Side::Outside));
}

#[test]
fn a_point_in_an_enclosed_part_names_the_rule() {
    let text = NESTED.replace("\"all\"", "\"outside\"");
    let mut correct = support::selftest_case("outside", &text);
    let root = correct.case.root;
    // The cavity of the inner sphere is deleted, if the reference has not done so.
    let in_cavity = |w: &u64| {
        let centre = root.to_user(word::octant(*w).centre());
        word::side(*w) == Side::Outside && centre.iter().map(|c| c * c).sum::<f64>() < 0.2
    };
    let words: Vec<u64> = correct.mesh.words.iter().filter(|w| !in_cavity(w)).copied().collect();
    correct.mesh = correct.mesh.with_parts(vec![words]);
    let rule = |point| {
        let answer = with_mesh(&correct.mesh, Some(&correct.case), |mesh| mesh.at(point).unwrap());
        assert!(answer.leaf.is_none(), "{answer}");
        let text = answer.to_string();
        assert!(text.contains("deleted by section 5"), "{text}");
        answer.deleted_by.unwrap()
    };
    assert!(rule([0.01, 0.01, 0.01]).contains("enclosed is delete"));
    let wall = root.to_user(
        correct
            .base
            .words
            .iter()
            .map(|&w| (word::octant(w), word::side(w)))
            .find(|(_, side)| *side == Side::Inside)
            .unwrap()
            .0
            .centre(),
    );
    assert!(rule(wall).contains("keep is outside"));
}

/// The faces of a box with these ends along each axis, two facets each.
pub fn cuboid(ends: [[f32; 2]; 3]) -> Vec<Facet> {
    let at = |i: usize| [0, 1, 2].map(|a| ends[a][i >> a & 1]);
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    faces.into_iter().flat_map(halves).map(|facet| facet.map(at)).collect()
}

/// A face that is given twice stops no ray, so the rays of all leaves within the box disagree.
#[test]
fn the_majority_decides_the_side_where_no_candidate_has_rays_that_agree() {
    let faces = cuboid([[-2.7, 3.6], [-2.3, 4.1], [-3.3, 3.7]]);
    for twice in 0..=6 {
        let body = [&faces[..], &faces[..2 * twice]].concat();
        let text = format!("spacing_min = 1.0\nlayer_cells_min = 1\nkeep = 'all'\n{ROOT}");
        let correct = made(&text, &body);
        let answer =
            with_mesh(&correct.mesh, Some(&correct.case), |m| m.at([0.5, 0.6, 0.7]).unwrap());
        let (side, decision) = answer.side_decided_by.unwrap();
        let expected = if twice < 3 { Side::Inside } else { Side::Outside };
        assert_eq!((side, answer.leaf.unwrap().1), (expected, expected), "{twice}: {decision}");
        if (1..6).contains(&twice) {
            let terms = correct.case.rules.clone();
            let found = components::find(&correct.base.words, &terms, &correct.case.facets_lattice);
            let leaves = |side| found.iter().find(|c| c.side == side && c.is_ambiguous());
            let candidates = leaves(side).unwrap().leaves.len().min(32);
            let text = format!(
                "the component is ambiguous: the rays of no candidate agree, and {} of the {} rays of {candidates} \
                 candidates are odd",
                (6 - twice) * candidates,
                6 * candidates
            );
            assert_eq!(decision, text);
        } else {
            assert!(decision.starts_with("each of the six rays"), "{twice}: {decision}");
        }
    }
}
