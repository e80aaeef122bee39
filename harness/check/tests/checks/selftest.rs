//! The self test on meshes of the reference: the responsible check reports every corruption.

use crate::support;
use check::selftest::{self, SelftestCase};

const CASES: [(&str, &str); 6] = [
    ("outside", include_str!("../../../selftest-cases/outside.toml")),
    ("inside", include_str!("../../../selftest-cases/inside.toml")),
    ("all", include_str!("../../../selftest-cases/all.toml")),
    ("boxes", include_str!("../../../selftest-cases/boxes.toml")),
    ("enclosed", include_str!("../../../selftest-cases/enclosed.toml")),
    ("seeds", include_str!("../../../selftest-cases/seeds.toml")),
];

fn case(index: usize) -> SelftestCase {
    let (name, text) = CASES[index];
    support::selftest_case(name, text)
}

/// Every corruption that applies to a case is reported, and the correct mesh is not. Returns the corruptions that do not apply.
fn unused(index: usize) -> Vec<&'static str> {
    let scratch = tempfile::tempdir().unwrap();
    let mut report = selftest::run(&[case(index)], scratch.path()).unwrap();
    println!("{report}");
    let unused = std::mem::take(&mut report.unused);
    assert!(report.holds() && report.kills.len() + unused.len() == selftest::catalogue().len());
    unused
}

#[test]
fn every_corruption_of_an_outer_flow_is_reported() {
    unused(0);
}

#[test]
fn every_corruption_of_an_inner_flow_is_reported() {
    unused(1);
}

#[test]
fn every_corruption_of_a_mesh_of_both_sides_is_reported() {
    unused(2);
}

#[test]
fn every_corruption_of_a_mesh_with_boxes_is_reported() {
    unused(3);
}

#[test]
fn every_corruption_of_a_mesh_with_enclosed_components_is_reported() {
    unused(4);
}

#[test]
fn every_corruption_of_a_mesh_with_seeds_is_reported() {
    unused(5);
}

/// The numbers are those of the catalogue when this test was written: a corruption that applies to fewer cases than before has lost
/// part of its effect.
#[test]
fn every_corruption_applies_to_a_case() {
    let cases: Vec<SelftestCase> = (0..CASES.len()).map(case).collect();
    let catalogue = selftest::catalogue();
    assert!(catalogue.len() >= 40);
    for mutant in catalogue {
        let applies = |case: &SelftestCase| (mutant.make)(case).is_some();
        assert!(cases.iter().any(applies), "{}", mutant.name);
    }
}
