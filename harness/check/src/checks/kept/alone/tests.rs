use super::*;
use contract::manifest::{Components, Enclosed, Keep};
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
    check(&cavity(), &manifest.clone(), &manifest, &mut result);
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
        "seed 2 at [5.0, 5.0, 5.0] lies in the crossing leaf",
    );
    assert_one(&seeded(&[at(0), at(3), at(8)]), "lies outside the root");
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
        "the manifest counts 0 enclosed components, and T0 has 1",
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
    assert!(none[0].contains("0 of 2 outside components cannot be enclosed with 8"), "{none:?}");
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
