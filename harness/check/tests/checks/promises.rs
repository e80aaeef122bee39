//! The promise `complete` where the case and not the mesh decides which region is kept.

use crate::no_false_alarms::hull;
use crate::support;
use check::checks::{self, Subject};
use check::promises::Promises;

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
        let subject = Subject::new(&of.case, &mesh.mesh).promising(&complete);
        let [.., result] = &checks::all(&subject)[..] else { panic!("one promise is one check") };
        assert!(result.was_run(), "{result}");
        let first = result.findings.first().map(|finding| finding.as_str());
        match finding {
            Some(what) => assert!(first.is_some_and(|detail| detail.contains(what)), "{result}"),
            None => assert_eq!(first, None, "{result}"),
        }
    }
}
