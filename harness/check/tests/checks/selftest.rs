//! The self test on meshes of the reference: the responsible check reports every corruption.

use crate::support;
use check::selftest;

const CASES: [(&str, &str); 6] = [
    ("outside", include_str!("../../../selftest-cases/outside.toml")),
    ("inside", include_str!("../../../selftest-cases/inside.toml")),
    ("all", include_str!("../../../selftest-cases/all.toml")),
    ("boxes", include_str!("../../../selftest-cases/boxes.toml")),
    ("enclosed", include_str!("../../../selftest-cases/enclosed.toml")),
    ("seeds", include_str!("../../../selftest-cases/seeds.toml")),
];

#[test]
fn every_corruption_is_reported_and_no_correct_mesh_fails() {
    let cases = CASES.map(|(name, text)| support::selftest_case(name, text));
    let scratch = tempfile::tempdir().unwrap();
    let report = selftest::run(&cases, scratch.path()).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
    assert!(selftest::catalogue().len() >= 40);
}
