//! The self test's corruptions of leaves in a larger mesh whose many parts interleave, as ranks of a large run write them.

use crate::support;
use check::audit::audit_against;
use check::promises::Promises;
use check::selftest;
use contract::case::Case;
use contract::leafset::LeafSet;

/// The faces of the cube bisect octants, so that eight siblings are crossing.
const CASE: &str = "spacing_min = 0.05\nlayer_cells_min = 3\n[root]\norigin = [-3.45, -3.45, -3.45]\nedge = 6.4\n\
                    [generator]\nshape = \"cube\"\nfacets = 12\n";
const PARTS: usize = 16;
/// Leaves that follow each other in a part: an odd number, so that siblings are in two parts.
const INTERVAL: usize = 173;

fn in_many_parts(set: &LeafSet) -> LeafSet {
    let mut parts = vec![Vec::new(); PARTS];
    for (i, interval) in set.words.chunks(INTERVAL).enumerate() {
        parts[i % PARTS].extend_from_slice(interval);
    }
    set.with_parts(parts)
}

/// The checks with findings.
fn found(set: &LeafSet, case: Option<&Case>) -> Vec<&'static str> {
    let dir = tempfile::tempdir().unwrap();
    set.write(dir.path()).unwrap();
    let definition = Promises::of_definition();
    let report = audit_against(dir.path(), case, &definition);
    report.checks.iter().filter(|check| !check.holds()).map(|check| check.name).collect()
}

#[test]
fn every_corruption_of_leaves_is_found_in_many_parts() {
    let mut correct = support::selftest_case("outside", CASE);
    assert!(correct.mesh.words.len() > 20_000);
    correct.mesh = in_many_parts(&correct.mesh);
    assert_eq!(found(&correct.mesh, Some(&correct.case)), [""; 0]);
    let mut planted = 0;
    for mutant in selftest::catalogue() {
        let Some(mutation) = mutant.make(&correct) else { continue };
        if mutation.mesh.words == correct.mesh.words {
            continue;
        }
        planted += 1;
        let wrong = in_many_parts(&mutation.mesh);
        let (alone, whole) = (found(&wrong, None), found(&wrong, Some(&correct.case)));
        assert!(!mutant.audit || alone.contains(&mutant.expected), "{}: {alone:?}", mutant.name);
        assert!(!whole.is_empty(), "{}", mutant.name);
    }
    assert!(planted > 25, "{planted}");
}
