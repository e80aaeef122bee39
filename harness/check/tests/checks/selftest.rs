//! The self test on meshes of the reference: every corruption is caught by the check meant for it.

use crate::support;
use check::selftest;

const CASES: [(&str, &str); 4] = [
    ("outside", include_str!("../../../selftest-cases/outside.toml")),
    ("inside", include_str!("../../../selftest-cases/inside.toml")),
    ("all", include_str!("../../../selftest-cases/all.toml")),
    ("boxes", include_str!("../../../selftest-cases/boxes.toml")),
];

#[test]
fn every_corruption_is_killed_and_no_correct_mesh_is_accused() {
    let cases = CASES.map(|(name, text)| support::selftest_case(name, text));
    let scratch = tempfile::tempdir().unwrap();
    let report = selftest::run(&cases, scratch.path()).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
    assert!(selftest::catalogue().len() >= 40);
}
