//! Every link of a chain is a leaf of the mesh that forces the split by the stated rule, and every chain leads to a cause.
//!
//! A cause is checked by meshing without it. With `keep = "all"` a split has a sufficient cause among single facets and
//! boxes: the mesh of that facet or box alone has the split. Removing all sufficient ones removes the split.

use super::*;
use check::why::answer::{Answer, Rule, Split};
use contract::manifest::Manifest;
use contract::octant::Octant;
use contract::triangle::Triangle;
use contract::word::{self, Side};

/// What splits an octant in a mesh whose crossing leaves are kept, by the definition: slow, simple, and without the search structures of
/// the library.
struct Brute<'a> {
    case: &'a Case,
    terms: Manifest,
}

impl Brute<'_> {
    /// Whether T0 splits an octant.
    fn base_splits(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        let crossed = || self.case.facets_lattice.iter().any(|f| Triangle::new(f).meets(low, high));
        self.terms.box_that_splits(octant).is_some()
            || octant.level < self.terms.level_surface && crossed()
    }

    /// Whether a leaf forces an octant to split by its layer, and by balance.
    fn forces(&self, leaf: &Octant, octant: &Octant) -> (bool, bool) {
        let distance = octant.distance(leaf);
        let reach = i64::from(self.terms.layer_cells_min - 1) * i64::from(leaf.edge());
        let is_finer = leaf.level > octant.level && !octant.contains(leaf);
        (is_finer && distance < reach, is_finer && leaf.level > octant.level + 1 && distance == 0)
    }
}

/// Checks one answer link by link, with the numbers of the definition.
fn check(answer: &Answer, correct: &SelftestCase) -> Result<(), TestCaseError> {
    let terms = correct.case.rules.clone();
    let words = &correct.mesh.words;
    let brute = Brute { case: &correct.case, terms: terms.clone() };
    let crossing = |octant: &Octant| {
        let of = |w: &&u64| word::octant(**w).contains(octant) && word::side(**w) == Side::Crossing;
        correct.base.words.iter().any(|w| of(&w))
    };
    for split in answer.split.iter() {
        let cause = split.cause.as_ref();
        prop_assert!(cause.is_some(), "{answer}");
        let (is_crossed, facets) = cause.map_or((false, 0), |c| (c.is_crossed, c.facets.len()));
        prop_assert_eq!(is_crossed, facets > 0, "{}", answer);
        let mut octant = split.octant;
        let mut is_source = false;
        for &(rule, leaf) in &split.links {
            let in_mesh = words.iter().any(|&w| word::octant(w) == leaf);
            prop_assert!(in_mesh || !terms.keep_crossing && crossing(&leaf), "{answer}");
            let (layer, balance) = brute.forces(&leaf, &octant);
            match rule {
                Rule::Layer => prop_assert!(layer, "{answer}"),
                Rule::Balance => prop_assert!(balance, "{answer}"),
                Rule::ExtraLayer => {
                    prop_assert!(octant.distance(&leaf) == 0 && octant.level < terms.level_surface)
                }
            }
            // The extra layer precedes all levels of the sweep.
            let is_early = rule == Rule::ExtraLayer || leaf.level > octant.level + 1;
            prop_assert!(!is_source || is_early, "{answer}");
            is_source = rule == Rule::Layer;
            octant = if rule == Rule::ExtraLayer { leaf } else { leaf.ancestor(leaf.level - 1) };
        }
        match split.links.last() {
            Some((Rule::ExtraLayer, _)) => prop_assert!(crossing(&octant)),
            _ => prop_assert!(brute.base_splits(&octant), "{answer}"),
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn every_split_has_a_chain_and_every_deleted_point_a_rule(
        text in settings(2..5), facets in prop_oneof![soup(1..8), hull()], boxes in boxes(0..3, 6),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 4),
        points in prop::collection::vec(prop::array::uniform3(-8.0f64..8.0), 4),
    ) {
        let text = text + &boxes.concat();
        let correct = made(&text, &facets);
        let root = &correct.case.root;
        let answers = with_mesh(&correct.mesh, Some(&correct.case), |mesh| {
            let words = correct.mesh.words.iter().copied();
            let leaves: Vec<Octant> = words.map(word::octant).collect();
            let picked = picks.iter().filter(|_| !leaves.is_empty());
            let centres = picked.map(|pick| root.to_user(pick.get(&leaves).centre()));
            centres.chain(points.iter().copied()).map(|point| mesh.at(point).unwrap()).collect::<Vec<_>>()
        });
        for answer in &answers {
            check(answer, &correct)?;
            let base = answer.base_leaf.unwrap();
            let word = correct.base.words.iter().find(|&&w| word::octant(w) == base);
            prop_assert!(word.is_some(), "{answer}");
            let side = word::side(*word.unwrap());
            prop_assert_eq!(Some(side), answer.side_decided_by.as_ref().map(|(side, _)| *side), "{}", answer);
            if let Some(rule) = &answer.deleted_by {
                // The enclosed parts are not deleted by every version of the reference.
                prop_assert!(!rule.contains("lost"), "{answer}");
            }
            prop_assert_eq!(answer.deleted_by.is_some(), answer.leaf.is_none());
        }
    }
}

/// Far from a single small facet, so that chains lead through many levels.
#[test]
fn every_link_of_a_chain_through_many_levels_is_right() {
    for (n, level, far) in [(1, 9, 6.9), (2, 8, 6.9), (3, 8, 5.9), (5, 6, 6.9)] {
        let spacing = 16.0 * 0.5f64.powi(level);
        let text =
            format!("spacing_min = {spacing:?}\nlayer_cells_min = {n}\nkeep = 'all'\n{ROOT}");
        let correct = made(&text, &[[[0.3, 0.2, 0.1], [0.31, 0.2, 0.1], [0.3, 0.21, 0.12]]]);
        let mut links_max = 0;
        for point in [[far, 0.4, -1.3], [-2.2, far, far]] {
            let answer =
                with_mesh(&correct.mesh, Some(&correct.case), |mesh| mesh.at(point).unwrap());
            check(&answer, &correct).unwrap();
            links_max =
                answer.split.iter().map(|split| split.links.len()).fold(links_max, usize::max);
        }
        assert!(links_max >= 3, "n = {n}: {links_max}");
    }
}

#[test]
fn an_answer_that_contradicts_itself_is_a_bug() {
    let text = format!("spacing_min = 0.25\nlayer_cells_min = 3\nkeep = 'all'\n{ROOT}");
    let made = made(&text, &[[[0.3, 0.2, 0.1], [0.31, 0.2, 0.1], [0.3, 0.21, 0.12]]]);
    let correct =
        with_mesh(&made.mesh, Some(&made.case), |mesh| mesh.at([5.9, 0.4, -1.3]).unwrap());
    correct.check_invariants();
    assert!(correct.split.as_ref().unwrap().links.len() > 1, "a chain");
    fn chain(answer: &mut Answer) -> &mut Split {
        answer.split.as_mut().unwrap()
    }
    let faults: [&dyn Fn(&mut Answer); 9] = [
        &|a| a.point[1] += 4.0,
        &|a| a.leaf = None,
        &|a| a.base_leaf = Some(chain(a).links[0].1),
        &|a| a.split = None,
        &|a| chain(a).links[0].1 = a.leaf.unwrap().0,
        &|a| chain(a).links.swap(0, 1),
        &|a| _ = chain(a).links.pop(),
        &|a| chain(a).cause = None,
        &|a| chain(a).cause.as_mut().unwrap().is_crossed = false,
    ];
    for (i, fault) in faults.iter().enumerate() {
        let mut wrong = correct.clone();
        fault(&mut wrong);
        let seen = std::panic::catch_unwind(|| wrong.check_invariants());
        assert!(seen.is_err(), "fault {i}: {wrong}");
    }
}

/// Without the case, the surface is known from the crossing leaves, and the chains are the same.
#[test]
fn a_directory_alone_explains_the_same_sizes() {
    let correct = support::built_in("outside");
    let centres: Vec<[f64; 3]> = correct
        .mesh
        .words
        .iter()
        .step_by(101)
        .map(|&w| correct.case.root.to_user(word::octant(w).centre()))
        .collect();
    let explain = |case: Option<&Case>| {
        with_mesh(&correct.mesh, case, |mesh| {
            centres.iter().map(|&centre| mesh.at(centre).unwrap()).collect::<Vec<Answer>>()
        })
    };
    for (with, without) in explain(Some(&correct.case)).iter().zip(&explain(None)) {
        let links = |answer: &Answer| -> Vec<Vec<Octant>> {
            let links = answer.split.iter().map(|split| split.links.iter());
            links.map(|links| links.map(|&(_, leaf)| leaf).collect()).collect()
        };
        assert_eq!(links(with), links(without));
        let crossed = |answer: &Answer| -> Vec<bool> {
            answer.split.iter().map(|split| split.cause.as_ref().unwrap().is_crossed).collect()
        };
        assert_eq!(crossed(with), crossed(without));
        assert!(with.side_decided_by.is_some() && without.side_decided_by.is_none());
        assert!(without.to_string().contains("--case"), "{without}");
    }
}

#[test]
fn a_point_outside_the_root_and_another_case_are_refused() {
    let mut correct = support::built_in("all");
    let why = with_mesh(&correct.mesh, None, |mesh| mesh.at([99.0, 0.0, 0.0]).unwrap_err());
    assert!(why.contains("outside the root"), "{why}");
    let mut other = correct.case.clone();
    other.rules.layer_cells_min += 1;
    let why = why::body(&other, &correct.mesh.manifest).unwrap_err().why;
    let n = other.layer_cells_min;
    let expected = format!(
        "the mesh was made from other inputs than the case (layer_cells_min: {} in the mesh; {n} in the case); give the case \
         file from which it was made",
        n - 1
    );
    assert_eq!(why, expected);
    correct.mesh.manifest.sides = contract::manifest::Sides::Unknown;
    let why = why::body(&correct.case, &correct.mesh.manifest).unwrap_err().why;
    assert_eq!(why, "the sides of the mesh are unknown, and the answer needs them");
}

/// Whether the leaves split an octant.
fn splits(words: &[u64], octant: &Octant) -> bool {
    words
        .iter()
        .map(|&w| word::octant(w))
        .any(|leaf| leaf.level > octant.level && octant.contains(&leaf))
}

/// The facets and boxes of a case in which everything is kept.
struct Inputs {
    level: i32,
    n: u32,
    facets: Vec<Facet>,
    boxes: Vec<String>,
}

impl Inputs {
    /// The case of some of the facets and boxes.
    fn made(&self, facets: impl Fn(usize) -> bool, boxes: impl Fn(usize) -> bool) -> SelftestCase {
        let spacing = 16.0 * 0.5f64.powi(self.level);
        let n = self.n;
        let mut text =
            format!("spacing_min = {spacing:?}\nlayer_cells_min = {n}\nkeep = 'all'\n{ROOT}");
        (0..self.boxes.len()).filter(|&b| boxes(b)).for_each(|b| text += &self.boxes[b]);
        let facets = (0..self.facets.len()).filter(|&f| facets(f)).map(|f| self.facets[f]);
        super::made(&text, &facets.collect::<Vec<_>>())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_split_disappears_with_its_sufficient_causes_and_each_reported_one_is_sufficient(
        level in 3i32..=5, n in 1u32..=4, facets in soup(1..4), boxes in boxes(0..2, 6),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 4),
    ) {
        let inputs = Inputs { level, n, facets, boxes };
        let correct = inputs.made(|_| true, |_| true);
        // The meshes of single facets and of single boxes.
        let facet_alone: Vec<Vec<u64>> =
            (0..inputs.facets.len()).map(|f| inputs.made(|i| i == f, |_| false).mesh.words).collect();
        let box_alone: Vec<Vec<u64>> =
            (0..inputs.boxes.len()).map(|b| inputs.made(|_| false, |i| i == b).mesh.words).collect();
        let answers = with_mesh(&correct.mesh, Some(&correct.case), |mesh| {
            let leaf = |pick: &prop::sample::Index| word::octant(*pick.get(&correct.mesh.words));
            let centre = |octant: Octant| correct.case.root.to_user(octant.centre());
            picks.iter().map(|pick| mesh.at(centre(leaf(pick))).unwrap()).collect::<Vec<_>>()
        });
        for split in answers.iter().flat_map(|answer| &answer.split) {
            let octant = &split.octant;
            let cause = split.cause.as_ref().unwrap();
            prop_assert!(!cause.facets.is_empty() || !cause.boxes.is_empty());
            for &facet in &cause.facets {
                prop_assert!(splits(&facet_alone[facet as usize], octant), "facet {facet}: {split:#?}");
            }
            for &b in &cause.boxes {
                prop_assert!(splits(&box_alone[b], octant), "box {b}: {split:#?}");
            }
            let rest = inputs.made(|f| !splits(&facet_alone[f], octant), |b| !splits(&box_alone[b], octant));
            prop_assert!(!splits(&rest.mesh.words, octant), "{split:#?}");
        }
    }
}
