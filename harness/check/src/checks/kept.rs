//! The mesh has leaves in exactly those components of T0 that are kept, and the manifest counts the components.
//!
//! Section 5 of reference/DEFINITION.md. With the case: no leaf lies in a component that is deleted (enclosed, without a
//! seed, or on the side that is not wanted), every other component has leaves, and the manifest states the numbers
//! of components and of enclosed leaves (`complete` establishes that no part of a component is missing).
//!
//! Without the case, the components are those of the mesh, or of T0 itself. Refinement connects and separates nothing, so the components of a
//! mesh are the kept ones of T0: if enclosed components are deleted, either all outside components have a face on the root's boundary
//! or none has; every seed lies in a leaf of flow, and every component of flow has a seed; and each side has as many
//! components as the manifest counts. The check cannot detect that a whole component is missing if the manifest has no
//! counts, or any wrong component if the surface is larger than some millions of octants (a note says so).

use super::components::{self, Component};
use super::manifest::COMPONENTS;
use super::{CheckResult, Subject, contact, json, some_leaves};
use contract::lattice::cell_at;
use contract::manifest::{Components, EnclosedComponents, Manifest, Sides, Tree as Kind};
use contract::octant::Octant;
use contract::tree::{Handle, Tree};
use contract::word::{self, Side};

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let Some(truth) = subject.truth() else {
        if subject.terms.sides == Sides::Unknown {
            return result.lacks(super::UNKNOWN_SIDES);
        }
        let (inputs, manifest) = (&subject.inputs, subject.manifest);
        check_alone(subject.tree(), inputs, manifest, result);
        let is_sought = inputs.deletes_enclosed() && manifest.tree == Kind::Final;
        let is_compared = manifest.components.is_some() || is_sought && result.note.is_empty();
        let none = !is_compared && inputs.seeds.is_empty();
        let why = none.then(|| "neither seeds nor counts of components are stated".to_owned());
        return result.requires(some_leaves(subject.tree_with_deleted()).or(why));
    };
    result.examined = subject.examined_with(truth);
    let terms = &subject.terms;
    // A component has leaves in the mesh iff it is kept.
    for &Component { side, first, ref leaves, enclosed, .. } in &truth.components {
        let mut octants = leaves.iter().map(|&i| word::octant(truth.words[i as usize]));
        let example = octants.find(|leaf| subject.tree().at(leaf) != Handle::HOLE);
        let enclosed = enclosed && terms.deletes_enclosed();
        let (what, octant) = match (terms.keeps(side as u8) && !enclosed, example) {
            (false, Some(leaf)) => ("deleted, but the mesh has leaves in it, first in", leaf),
            (true, None) => ("kept, but the mesh has no leaf in it:", first),
            _ => continue,
        };
        let why = if enclosed { "enclosed".to_owned() } else { side.to_string() };
        let (total, octant) = (leaves.len(), terms.root.place(octant));
        result.report(format_args!(
            "a component of {total} leaves of T0 is {why} and must be {what} {octant}"
        ));
    }
    let counts = Some(count(&truth.components, &subject.inputs));
    let expected = Manifest { components: counts, ..subject.inputs.clone() };
    super::manifest::components(subject.manifest, ("T0", &expected), &COMPONENTS, result);
}

/// The components by side, as a manifest states them.
fn count(components: &[Component], terms: &Manifest) -> Components {
    let of_side = |side| components.iter().filter(|c| c.side == side).count() as u64;
    let enclosed = || components.iter().filter(|c| c.enclosed);
    let first = enclosed().map(|c| c.first).min_by_key(|o| (o.level, word::key_of(o.corner)));
    Components {
        outside: of_side(Side::Outside),
        inside: of_side(Side::Inside),
        enclosed: EnclosedComponents {
            count: enclosed().count() as u64,
            leaves: enclosed().map(|c| c.leaves.len() as u64).sum(),
            example: first.map(|octant| terms.root.to_user(octant.centre())),
        },
    }
}

/// Checks a tree, final or T0, by itself.
fn check_alone(tree: &Tree, terms: &Manifest, manifest: &Manifest, result: &mut CheckResult) {
    seeds_in_flow(tree, terms, result);
    possible(tree, terms, manifest, result);
    let is_base = manifest.tree == Kind::Base;
    let counts = manifest.components.as_ref().map(|counted| {
        let deleted = if is_base { 0 } else { counted.enclosed.count };
        let outside = counted.outside.saturating_sub(deleted);
        let counts = [(Side::Outside, outside), (Side::Inside, counted.inside)];
        counts.into_iter().filter(|(side, _)| is_base || terms.keeps(*side as u8))
    });
    let octants = uniform_octants(tree);
    let found = octants.as_ref().map(|octants| components::stated(octants, terms));
    for (side, expected) in counts.into_iter().flatten() {
        let (least, found) = match &found {
            Some(all) => (expected, all.iter().filter(|of| of.side == side).count() as u64),
            // Leaves show whether there is one.
            None => (expected.min(1), (tree.kinds(tree.root) >> side as u8 & 1).into()),
        };
        if found != least {
            result.report(format_args!(
                "the manifest leaves {expected} {side} components, and there are {found}"
            ));
        }
    }
    let (Some(octants), Some(found)) = (octants, found) else {
        let why = format!("over {OCTANTS_MAX} octants have leaves of one side");
        result.note = format!("components are not known: {why}");
        return;
    };
    let place = |component: &Component| terms.root.place(component.first);
    let enclosed = || found.iter().filter(|component| component.enclosed);
    if manifest.tree == Kind::Final {
        for place in enclosed().map(place) {
            result.report(format_args!(
                "an outside component has no face on the root's boundary, although another has, so it is enclosed \
                 and must be deleted; in it lies {place}"
            ));
        }
    }
    if !terms.seeds.is_empty() {
        let seeded = components::seeded_leaves(&octants, terms);
        let lacks_seed = |component: &&Component| {
            component.side == terms.side_of_flow()
                && components::seed_in(&component.leaves, &seeded).is_none()
        };
        for place in found.iter().filter(lacks_seed).map(place) {
            result.report(format_args!("no seed lies in a component of flow, that of {place}"));
        }
    }
    let Some(counted) = &manifest.components else { return };
    let (found, count) = (enclosed().count() as u64, counted.enclosed.count);
    if is_base && found != count {
        result.report(format_args!("the manifest has {count} enclosed components; T0 has {found}"));
    }
}

/// Maximum number of octants whose components are sought, at some 30 bytes and a microsecond each.
const OCTANTS_MAX: usize = 4_000_000;

/// The largest octants all of whose leaves have one side, crossing octants excluded, as sorted words; `None` if there
/// are too many. Their components are those of the leaves.
fn uniform_octants(tree: &Tree) -> Option<Vec<u64>> {
    let mut words = Vec::new();
    tree.walk(&mut |octant, handle| {
        let kinds = tree.kinds(handle);
        let one = [Side::Outside, Side::Inside].into_iter().find(|&s| kinds == 1 << s as u8);
        words.extend(one.map(|side| word::encode(octant, side)));
        one.is_none() && words.len() <= OCTANTS_MAX
    });
    (words.len() <= OCTANTS_MAX).then_some(words)
}

/// Every seed lies in a leaf of flow.
fn seeds_in_flow(tree: &Tree, terms: &Manifest, result: &mut CheckResult) {
    let flow = terms.side_of_flow();
    for (i, &seed) in terms.seeds.iter().enumerate() {
        let found = match cell_at(seed).map(|cell| tree.locate(cell)) {
            Some(Some((_, kind))) if kind == flow as u8 => continue,
            Some(Some((leaf, kind))) => {
                format!("in the {} leaf {}", contact::name(1 << kind), terms.root.place(leaf))
            }
            Some(None) => "in no leaf".to_owned(),
            None => "outside the root".to_owned(),
        };
        let at = terms.root.to_user(seed);
        result.report(format_args!("seed {i} at {at:?} is {found}, not in a leaf that is {flow}"));
    }
}

/// Whether the counts in a manifest can be right, and the example lies in a leaf that is deleted.
fn possible(tree: &Tree, terms: &Manifest, manifest: &Manifest, result: &mut CheckResult) {
    let Some(counted) = &manifest.components else { return };
    let EnclosedComponents { count, leaves, example } = counted.enclosed;
    let none = count == 0 && leaves == 0 && example.is_none();
    // The far field is another outside component.
    let some = terms.deletes_enclosed()
        && 0 < count
        && count < counted.outside
        && count <= leaves
        && example.is_some_and(|at| deleted_at(tree, at, manifest.tree, terms));
    if !none && !some {
        let (outside, at) = (counted.outside, json(&example));
        result.report(format_args!(
            "{count} of {outside} outside components cannot be enclosed with {leaves} leaves of T0 and one at {at}"
        ));
    }
}

/// Whether a point lies in a leaf that was deleted from a final mesh, or that is outside in T0.
fn deleted_at(tree: &Tree, at: [f64; 3], kind: Kind, terms: &Manifest) -> bool {
    let Some(cell) = terms.root.quantise(at).and_then(cell_at) else { return false };
    let found = tree.locate(cell);
    match kind {
        Kind::Final => found.is_none(),
        Kind::Base => found.is_some_and(|(leaf, side): (Octant, u8)| {
            side == Side::Outside as u8 && terms.same_place(at, terms.root.to_user(leaf.centre()))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::manifest::{Components, Enclosed, Keep};
    use contract::octant::UNITS_PER_CELL;
    use contract::testing::{leaf_set, words_with_sides};

    /// 8^3 cells of edge 1: a cavity of 2^3 outside leaves in the middle, within a wall of crossing leaves.
    fn cavity() -> Tree {
        let side = |o: &Octant| {
            let within = |low, high| o.corner.iter().all(|c| (low..high).contains(&(c >> 16)));
            Some(if within(2, 6) && !within(3, 5) { Side::Crossing } else { Side::Outside })
        };
        Tree::of_words(&words_with_sides(|o| o.level < 3, side))
    }

    /// Findings on the cavity in a mesh whose outside is kept.
    fn findings(change: impl Fn(&mut Manifest)) -> Vec<String> {
        let mut manifest = leaf_set(vec![]).manifest;
        manifest.keep = Keep::Outside;
        change(&mut manifest);
        let mut result = CheckResult::new("kept");
        check_alone(&cavity(), &manifest.clone(), &manifest, &mut result);
        result.findings
    }

    /// Asserts that there is one finding, with this text.
    fn assert_one(findings: &[String], text: &str) {
        assert!(findings.len() == 1 && findings[0].contains(text), "{findings:?}, not {text}");
    }

    const NONE: [&str; 0] = [];

    #[test]
    fn an_enclosed_component_must_not_be_left_in_a_mesh_that_deletes_it() {
        let text = "so it is enclosed and must be deleted; in it lies octant 0.7.7 (level 3)";
        assert_one(&findings(|_| ()), text);
        assert_eq!(findings(|m| m.enclosed = Enclosed::Keep), NONE);
        assert_eq!(findings(|m| m.keep = Keep::All), NONE);
        assert_eq!(findings(|m| m.tree = Kind::Base), NONE);
    }

    #[test]
    fn every_seed_lies_in_flow_and_every_component_of_flow_has_a_seed() {
        let at = |c: i64| [c * (UNITS_PER_CELL << 16); 3];
        let seeded = |seeds: &[[i64; 3]]| findings(|m| m.seeds = seeds.to_vec());
        assert_eq!(seeded(&[at(0), at(3)]), NONE);
        let text = "no seed lies in a component of flow, that of octant 0.7.7 (level 3)";
        assert_one(&seeded(&[at(0)]), text);
        assert_one(&seeded(&[at(4)]), "no seed lies in a component of flow, that of");
        assert_one(
            &seeded(&[at(0), at(3), at(5)]),
            "seed 2 at [5.0, 5.0, 5.0] is in the crossing leaf",
        );
        assert_one(&seeded(&[at(0), at(3), at(8)]), "is outside the root");
    }

    #[test]
    fn components_are_as_many_as_the_manifest_counts() {
        let enclosed = |count| match count {
            0 => EnclosedComponents::default(),
            _ => EnclosedComponents { count, leaves: 8 * count, example: Some([3.5; 3]) },
        };
        let counted = |tree, outside, inside, count| {
            findings(|m| {
                (m.tree, m.enclosed) = (tree, Enclosed::Keep);
                if count > 0 || tree == Kind::Base {
                    m.enclosed = Enclosed::Delete;
                }
                m.components = Some(Components { outside, inside, enclosed: enclosed(count) });
            })
        };
        assert_eq!(counted(Kind::Final, 2, 0, 0), NONE);
        assert_one(
            &counted(Kind::Final, 3, 0, 0),
            "the manifest leaves 3 outside components, and there are 2",
        );
        // The other side is not in a mesh of one side, but in its base tree.
        assert_eq!(counted(Kind::Final, 2, 1, 0), NONE);
        assert_eq!(counted(Kind::Base, 2, 0, 1), NONE);
        assert_one(
            &counted(Kind::Base, 2, 0, 0),
            "the manifest has 0 enclosed components; T0 has 1",
        );
        assert_one(&counted(Kind::Base, 2, 1, 1), "leaves 1 inside components, and there are 0");
        assert_one(&counted(Kind::Final, 0, 0, 0), "leaves 0 outside components, and there are 2");
        let all = counted(Kind::Base, 2, 0, 2);
        assert!(all[0].starts_with("2 of 2 outside components cannot be enclosed"), "{all:?}");
    }

    #[test]
    fn counts_of_enclosed_components_must_be_possible() {
        // In a base tree whose enclosed component has eight leaves, the first at [3.5; 3].
        let counted = |change: fn(&mut EnclosedComponents)| {
            let mut enclosed = EnclosedComponents { count: 1, leaves: 8, example: Some([3.5; 3]) };
            change(&mut enclosed);
            findings(|m| {
                m.tree = Kind::Base;
                m.components = Some(Components { outside: 2, inside: 0, enclosed });
            })
        };
        assert_eq!(counted(|_| ()), NONE);
        assert_eq!(counted(|e| e.leaves = 1), NONE);
        let none = counted(|e| e.count = 0);
        assert!(
            none[0].contains("0 of 2 outside components cannot be enclosed with 8"),
            "{none:?}"
        );
        let changes: [fn(&mut EnclosedComponents); 4] = [
            |e| e.leaves = 0,
            |e| e.example = None,
            |e| e.example = Some([2.5; 3]),
            |e| e.example = Some([3.25; 3]),
        ];
        for change in changes {
            assert_one(&counted(change), "cannot be enclosed with");
        }
    }

    /// Eight leaves of edge 4: the first is outside, the second inside, the third missing, the others crossing.
    #[test]
    fn a_deleted_leaf_is_missing_from_a_mesh_and_outside_in_its_base_tree() {
        let words = words_with_sides(
            |o| o.level == 0,
            |o| {
                [Some(Side::Outside), Some(Side::Inside), None, Some(Side::Crossing)]
                    [usize::from(o.digit()).min(3)]
            },
        );
        let tree = Tree::of_words(&words);
        let terms = leaf_set(vec![]).manifest;
        let deleted = |at, kind| deleted_at(&tree, at, kind, &terms);
        for (at, in_base, in_final) in [
            ([2.0, 2.0, 2.0], true, false),
            // The example is the centre of a leaf of T0; a mesh that lost the leaf need not have one as large.
            ([2.0, 2.0, 1.0], false, false),
            ([6.0, 2.0, 2.0], false, false),
            ([2.0, 6.0, 2.0], false, true),
            ([1.0, 5.0, 1.0], false, true),
            ([6.0, 6.0, 2.0], false, false),
            ([-1.0, 5.0, 1.0], false, false),
        ] {
            let found = (deleted(at, Kind::Base), deleted(at, Kind::Final));
            assert_eq!(found, (in_base, in_final), "{at:?}");
        }
    }
}
