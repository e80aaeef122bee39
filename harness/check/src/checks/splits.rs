//! An octant is split if and only if a facet, a box, a layer or the balance requires it.
//!
//! Section 6 of reference/DEFINITION.md: refinement is least. Together with the other checks this establishes that the mesh is
//! the one of the definition, without another mesh to compare it with ([`crate::why::Mesh::audit`]). `layer` and `balance` check what a reader
//! may rely on, which is less: layers around leaves that balance made are required, too, and meshes that lack them pass both. The check
//! needs the facets and, for a final mesh, memory in proportion to the leaves.

use std::fs;

use super::{CheckResult, Subject};
use crate::why::Mesh;
use contract::number::labelled;

pub(crate) const NAME: &str = "splits";

/// Memory that the audit takes for each leaf: 22 bytes were measured on 4 million cells, and tables double when they are full.
const BYTES_PER_LEAF: u64 = 40;

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    let Some(truth) = subject.truth() else {
        return result.lacks("T0 does not fit its limit, as `capacity` states");
    };
    let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    if let Err(why) = refuse_too_large(subject.pass.tally.leaves, &meminfo) {
        return result.lacks(why);
    }
    Mesh::of(&subject.inputs, subject.tree(), Some(truth)).audit(&mut |octant, fault| {
        result.examined += 1;
        if let Some(what) = fault {
            result.report(format_args!("{what} {}", subject.terms.root.place(octant)));
        }
    });
}

/// Refuses a mesh that needs more memory than is available according to `/proc/meminfo`; without that file none.
fn refuse_too_large(leaves: u64, meminfo: &str) -> Result<(), String> {
    let available = labelled(meminfo, "MemAvailable:").map_or(u64::MAX, |kib| 1024 * kib);
    let needed = leaves.saturating_mul(BYTES_PER_LEAF);
    if needed <= available {
        return Ok(());
    }
    let [needed, available] = [needed, available].map(|bytes| bytes as f64 / 1e9);
    Err(format!(
        "the check of splits needs about {needed:.1} GB of memory for {leaves} leaves, and {available:.1} GB are available: audit a \
         coarser mesh of the same case, or use a machine with more memory"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::manifest::Tree;
    use contract::testing::{leaf_set, words_of};

    /// A manifest may state any number.
    #[test]
    fn memory_is_needed_for_the_leaves_that_exist() {
        let text =
            "spacing_min = 8.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let case = Case::from_parts(text, vec![]).unwrap();
        let mut mesh = leaf_set(vec![words_of(|_| false)]);
        mesh.manifest.leaves = u64::MAX;
        let subject = Subject::new(&case, Tree::Final, &mesh);
        let results = super::super::all(&subject);
        let result = results.iter().find(|result| result.name == NAME).unwrap();
        assert!(result.was_run() && result.holds(), "{result}");
    }

    #[test]
    fn a_mesh_that_exceeds_the_available_memory_is_refused_before_the_audit() {
        let meminfo = "MemTotal:       24000000 kB\nMemAvailable:    1000000 kB\n";
        assert_eq!(refuse_too_large(25_000_000, meminfo), Ok(()));
        let why = refuse_too_large(30_000_000, meminfo).unwrap_err();
        assert!(why.contains("1.2 GB") && why.contains("1.0 GB are available"), "{why}");
        assert!(refuse_too_large(u64::MAX, meminfo).is_err());
        assert_eq!(refuse_too_large(u64::MAX, ""), Ok(()));
        let status = "Name:\tharness\nVmPeak:\t   99 kB\nVmHWM:\t     3 kB\nVmRSS:\t     2 kB\n";
        assert_eq!(["VmHWM:", "VmSwap:"].map(|label| labelled(status, label)), [Some(3), None]);
    }
}
