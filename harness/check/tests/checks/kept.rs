//! The check `kept` on meshes of random bodies to which a whole component is added, or from which one is removed; and the promise
//! `complete` where the case and not the mesh decides which region is kept.

use crate::no_false_alarms::{hull, hulls, settings, soup};
use crate::support;
use check::checks::{self, CheckResult, Subject, components};
use check::promises::Promises;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::{Leak, Manifest, Tree};
use contract::word;
use proptest::prelude::*;
use std::collections::HashSet;

/// The words of a mesh that lie in these leaves of T0, and the others.
fn within(mesh: &[u64], base: &[u64], leaves: &[u32]) -> (Vec<u64>, Vec<u64>) {
    let leaves: HashSet<usize> = leaves.iter().map(|&i| i as usize).collect();
    let containing = |w: u64| word::leaf_at(base, word::octant(w).bounds().0);
    mesh.iter().partition(|&&w| containing(w).is_some_and(|i| leaves.contains(&i)))
}

fn check(subject: &Subject, name: &str) -> CheckResult {
    checks::all(subject).into_iter().find(|result| result.name == name).unwrap()
}

fn reported(subject: &Subject) -> bool {
    !check(subject, "kept").holds()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_component_that_is_added_or_removed_is_reported(facets in prop_oneof![1 => soup(), 3 => hulls()], text in settings()) {
        let Ok(correct) = support::meshes_of_facets(&text, &facets) else { return Ok(()) };
        let (terms, base) = (correct.case.rules.clone(), &correct.base.words);
        let counted = |words| -> LeafSet { correct.mesh.with_parts(vec![words]) };
        for component in components::find(base, &terms, &correct.case.facets_lattice) {
            let (removed, mut words) = within(&correct.mesh.words, base, &component.leaves);
            let is_kept = !removed.is_empty();
            prop_assert_eq!(is_kept, terms.keeps(component.side as u8) && !component.enclosed);
            if !is_kept {
                words.extend(component.leaves.iter().map(|&i| base[i as usize]));
            }
            let mesh = counted(words);
            let alone = Subject::new(None, Tree::Final, &mesh);
            // Without the case, `sides` reports leaves of the side that is not kept.
            prop_assert!(reported(&alone) || !is_kept && !component.enclosed, "without the case: {text}");
            prop_assert!(reported(&Subject::new(&correct.case, Tree::Final, &mesh)), "{text}");
        }
    }
}

#[test]
fn leaks_that_are_impossible_or_differ_from_those_of_the_reference_are_reported() {
    let correct = support::built_in("enclosed");
    let Root { origin, edge } = correct.mesh.manifest.root;
    let leak = Leak { spacing_coarse: 0.2, spacing_fine: 0.1, volume: 0.01 * edge, point: origin };
    let with = |leaks: Option<Vec<Leak>>| -> LeafSet {
        let mut mesh = correct.mesh.clone();
        mesh.manifest.leaks = leaks;
        mesh
    };
    let found = |leaks, reference| {
        let (mesh, reference) = (with(leaks), with(reference));
        let subject = Subject::new(&correct.case, Tree::Final, &mesh).with_reference(&reference);
        check(&subject, "manifest").findings_total
    };
    assert_eq!(found(Some(vec![leak]), Some(vec![leak])), 0);
    assert_eq!(found(None, Some(vec![leak])), 0, "a program need not look for leaks");
    assert_eq!(found(Some(vec![]), Some(vec![leak])), 1);
    assert_eq!(found(Some(vec![leak; 2]), Some(vec![leak])), 1);
    for impossible in [
        Leak { spacing_coarse: 0.1, ..leak },
        Leak { spacing_fine: -0.1, ..leak },
        Leak { volume: 0.0, ..leak },
        Leak { volume: 1.01 * edge.powi(3), ..leak },
        Leak { volume: f64::NAN, ..leak },
        Leak { point: origin.map(|c| c - edge), ..leak },
    ] {
        assert_eq!(found(Some(vec![impossible]), None), 1, "{impossible:?}");
    }
}

#[test]
fn counts_of_components_that_differ_from_those_of_the_reference_are_reported() {
    let correct = support::built_in("enclosed");
    let found = |change: fn(&mut Manifest)| {
        let mut mesh = correct.mesh.clone();
        change(&mut mesh.manifest);
        let subject = Subject::new(&correct.case, Tree::Final, &mesh).with_reference(&correct.mesh);
        check(&subject, "manifest").findings_total
    };
    assert_eq!(found(|_| ()), 0);
    assert_eq!(found(|m| m.components = None), 0);
    assert_eq!(found(|m| m.components.as_mut().unwrap().inside += 1), 1);
    assert_eq!(found(|m| m.components.as_mut().unwrap().enclosed.example = None), 1);
    assert_eq!(found(|m| m.components_ambiguous.as_mut().unwrap().count += 1), 1);
    assert_eq!(found(|m| m.components_ambiguous = None), 0, "an import knows none");
}

#[test]
fn what_a_manifest_leaves_out_is_said() {
    let correct = support::built_in("enclosed");
    let said = |change: fn(&mut Manifest)| {
        let mut mesh = correct.mesh.clone();
        change(&mut mesh.manifest);
        let result = check(&Subject::new(&correct.case, Tree::Final, &mesh), "stated");
        (result.examined, result.nothing_to_check.unwrap_or_default())
    };
    assert_eq!(said(|_| ()), (4, String::new()));
    let lacks = |keys: &str| (0, format!("the manifest does not state {keys}"));
    assert_eq!(said(|m| m.leaks = None), lacks("leaks"));
    assert_eq!(said(|m| m.components_ambiguous = None), lacks("components_ambiguous"));
    let lost: fn(&mut Manifest) = |m| (m.geometry, m.components) = (None, None);
    assert_eq!(said(lost), lacks("geometry, components"));
    // Formats of others state nothing.
    let mut imported = correct.mesh.clone();
    let manifest = &mut imported.manifest;
    (manifest.geometry, manifest.components) = (None, None);
    (manifest.components_ambiguous, manifest.leaks) = (None, None);
    let results = checks::all(&Subject::new(&correct.case, Tree::Final, &imported));
    assert!(results.iter().all(|result| result.name != "stated"), "{results:?}");
}

/// A box within a box: the space within the inner one is outside by parity, and the far field does not reach it.
#[test]
fn enclosed_space_must_be_deleted_or_kept_as_the_case_requires() {
    let facets = [hull(([-6.0; 3], [12.0; 3])), hull(([-3.0; 3], [6.0; 3]))].concat();
    let meshed = |enclosed: &str| {
        let text = format!(
            "spacing_min = 0.5\nlayer_cells_min = 1\nenclosed = {enclosed:?}\n\
             [root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0\n"
        );
        support::meshes_of_facets(&text, &facets).unwrap()
    };
    let (kept, deleted) = (meshed("keep"), meshed("delete"));
    let complete = Promises { complete: true, ..Promises::default() };
    for (mesh, of, finding) in [
        (&kept, &kept, None),
        (&deleted, &deleted, None),
        (&kept, &deleted, Some("a leaf must be deleted")),
        (&deleted, &kept, Some("the mesh has a hole")),
    ] {
        let subject = Subject::new(&of.case, Tree::Final, &mesh.mesh).promising(&complete);
        let [.., result] = &checks::all(&subject)[..] else { panic!("one promise is one check") };
        assert!(result.was_run(), "{result}");
        let first = result.findings.first().map(|finding| finding.as_str());
        match finding {
            Some(what) => assert!(first.is_some_and(|detail| detail.contains(what)), "{result}"),
            None => assert_eq!(first, None, "{result}"),
        }
    }
}
