//! The self test on meshes of the reference: every corruption is caught by the check meant for it.

use crate::support;
use harness::selftest;

const SPECIMENS: [(&str, &str); 4] = [
    ("outside", include_str!("../../specimens/outside.toml")),
    ("inside", include_str!("../../specimens/inside.toml")),
    ("all", include_str!("../../specimens/all.toml")),
    ("boxes", include_str!("../../specimens/boxes.toml")),
];

#[test]
fn every_corruption_is_killed_and_no_correct_mesh_is_accused() {
    let specimens = SPECIMENS.map(|(name, text)| support::specimen(name, text));
    let scratch = tempfile::tempdir().unwrap();
    let report = selftest::run(&specimens, scratch.path()).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
    assert!(selftest::catalogue().len() >= 40);
}
