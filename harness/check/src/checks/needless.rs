//! No octant is split without a cause.
//!
//! Section 6 of reference/DEFINITION.md: refinement is least. Together with the other checks this establishes that the mesh is
//! the one of the definition, without another mesh to compare it with ([`crate::why::unneeded`]). It needs the facets and, for a
//! final mesh, memory in proportion to the leaves.

use super::{Check, CheckResult, FINDINGS_LISTED, NO_GEOMETRY, Subject, nothing};
use crate::why::Mesh;

pub(crate) const NAME: &str = "needless";

pub(super) const CHECK: Check = Check {
    name: NAME,
    // `identical` finds the same, by comparison.
    wanted: |subject| {
        subject.promises.definition && subject.case.is_some() && subject.reference.is_none()
    },
    needs: nothing,
    run,
};

fn run(subject: &Subject, result: &mut CheckResult) {
    let Some(body) = subject.facets().zip(subject.truth()) else {
        return result.lacks(NO_GEOMETRY);
    };
    let mesh = Mesh::new(subject.manifest, subject.tree(), subject.inputs.clone(), Some(body));
    let found = match mesh.unneeded(FINDINGS_LISTED) {
        Ok(found) => found,
        Err(why) => return result.lacks(&why),
    };
    result.examined = found.splits;
    for subtree in &found.first {
        let place = subject.terms.root.describe(&subtree.octant);
        result.report(format!(
            "nothing requires the split of {place}, which has {} leaves",
            subtree.leaves
        ));
    }
    result.findings_total = found.subtrees;
}
