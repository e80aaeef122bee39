//! All checks of a mesh on disk, of any size.
//!
//! One pass over the part files, which are merged while they are read, or over the tree if there are none, computes the tally, checks the order and
//! builds the tree. Leaves are not stored. The tree stores equal subtrees once, so memory grows with the
//! variety of a mesh and not with its size, up to [`NODES_MAX`]. Without a case, the checks use the requirements in the
//! manifest, and the head of each names what it cannot detect. With a case, they are a whole check: a mesh that passes is the
//! mesh of the definition, and T0 in its place is a finding. With promises of less than the definition, exactly those are checked.
//!
//! Invariants of a report: each result has its own invariants; the tree of a mesh has no more distinct octants than leaves and their
//! ancestors.

#[cfg(test)]
mod tests;

use std::path::Path;
use std::time::Instant;
use std::{fmt, fs};

use crate::checks::{self, CheckResult, Pass, Subject};
use crate::promises::Promises;
use contract::case::Case;
use contract::manifest::{Manifest, Tree as Kind};
use contract::mesh::{Mesh, NODES_MAX};
use contract::number::labelled;
use contract::octant::LEVEL_MAX;
use contract::tree::Tree;
use cpu_time::ProcessTime;
use serde::Serialize;

/// The result of an audit.
#[derive(Clone, Debug, Default, Serialize)]
pub struct AuditReport {
    /// One result per check.
    pub checks: Vec<CheckResult>,
    /// Number of leaves.
    pub leaves: u64,
    /// Number of distinct nodes of their tree; 0 for a forest, which is audited leaf by leaf.
    pub nodes: u64,
    /// Wall time for reading, merging, counting and building the tree.
    pub time_read_s: f64,
    /// Wall time of the audit.
    pub time_wall_s: f64,
}

impl AuditReport {
    /// Whether no check has findings.
    pub fn holds(&self) -> bool {
        self.checks.iter().all(CheckResult::holds)
    }

    /// The checks that had nothing to check.
    pub fn not_run(&self) -> impl Iterator<Item = &CheckResult> {
        self.checks.iter().filter(|check| !check.was_run())
    }

    /// Whether splits were not checked, or T0 was not made, because memory does not suffice.
    pub fn exceeds_memory(&self) -> bool {
        let needs_memory = [checks::SPLITS, checks::CAPACITY];
        self.leaves > 0 && self.not_run().any(|check| needs_memory.contains(&check.name))
    }

    /// Whether any property of the leaves was checked, beyond their files and counts.
    pub fn checked_anything(&self) -> bool {
        let is_formal =
            |name| checks::FORMAL.contains(name) || [checks::FILES, TREE].contains(name);
        self.checks.iter().any(|c| !c.holds() || c.was_run() && !is_formal(&c.name))
    }

    /// The report as JSON, with its verdict, the CPU time and peak memory of the process so far. They describe the audit only if the
    /// process did nothing else, as in `harness audit`.
    pub fn json(&self, holds: bool) -> String {
        let mut record = serde_json::to_value(self).expect("a report has string keys only");
        record["schema"] = "octree-audit/1".into();
        record["holds"] = holds.into();
        record["time_cpu_s"] = ProcessTime::now().as_duration().as_secs_f64().into();
        // 0 if the system does not report it.
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        record["peak_rss_bytes"] = (1024 * labelled(&status, "VmHWM:").unwrap_or(0)).into();
        format!("{record:#}\n")
    }

    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        self.checks.iter().for_each(CheckResult::check_invariants);
        let Self { leaves, nodes, .. } = *self;
        let nodes_max = leaves.saturating_mul(u64::from(LEVEL_MAX));
        assert!(nodes <= nodes_max, "{leaves} leaves have {nodes} distinct octants above them");
    }
}

impl fmt::Display for AuditReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.checks.iter().try_for_each(|check| writeln!(f, "{check}"))?;
        if !self.checked_anything() {
            writeln!(f, "left out: the mesh gave no check of its leaves anything to check")?;
        }
        let Self { leaves, nodes, time_read_s, time_wall_s, .. } = self;
        let rate = *leaves as f64 / time_wall_s.max(1e-9) / 1e6;
        let nodes = if *nodes > 0 { format!(" ({nodes} distinct octants)") } else { String::new() };
        write!(f, "{leaves} leaves{nodes} in {time_wall_s:.2} s, of which reading ")?;
        write!(f, "{time_read_s:.2} s: {rate:.1} M leaves/s")
    }
}

/// Name of the check that the tree has the leaves of the parts.
pub const TREE: &str = "tree file";

/// Audits a mesh of which these promises are made, against its case if it is known. A mesh that cannot be read is a finding.
pub fn audit_against(dir: &Path, case: Option<&Case>, promises: &Promises) -> AuditReport {
    audit_within(NODES_MAX, dir, case, promises)
}

/// The same with room for `most` nodes of the tree.
fn audit_within(most: usize, dir: &Path, case: Option<&Case>, promises: &Promises) -> AuditReport {
    let start = Instant::now();
    let mut report = AuditReport::default();
    let read = Mesh::open(dir).and_then(|mesh| Pass::over(&mesh, most).map(|pass| (mesh, pass)));
    report.time_read_s = start.elapsed().as_secs_f64();
    match read {
        Ok((mesh, pass)) => {
            let manifest = &mesh.manifest;
            report.leaves = pass.tally.leaves;
            report.nodes = pass.tree.as_ref().map_or(0, Tree::nodes) as u64;
            let mut files = CheckResult::new(checks::FILES);
            let tree = manifest.hyper_tree_grid.as_deref();
            files.examined = manifest.parts.len() as u64 + u64::from(tree.is_some());
            if manifest.tree == Kind::Base && case.is_some_and(|case| case.tree == Kind::Final) {
                files.report("mesh.json states the tree \"base\": T0, which is not the final mesh");
            }
            files.needs_objects("mesh.json names no file of leaves");
            let subject = Subject::of(manifest, manifest.tree, pass, case).promising(promises);
            report.checks = std::iter::once(files).chain(checks::all(&subject)).collect();
            let beside_parts = tree.filter(|_| mesh.tree_file.is_none());
            report.checks.extend(beside_parts.map(|name| tree_file(dir, name, manifest)));
        }
        Err(e) => report.checks.push(CheckResult::unreadable(&e)),
    }
    report.time_wall_s = start.elapsed().as_secs_f64();
    report.check_invariants();
    report
}

/// Compares the tree of a mesh that also has parts with the manifest.
fn tree_file(dir: &Path, name: &str, manifest: &Manifest) -> CheckResult {
    let mut result = CheckResult::new(TREE);
    // Counts and digests are enough.
    match Mesh::of_tree(dir, name, manifest).and_then(|tree| Pass::over(&tree, 0)) {
        Err(error) => result.report(error),
        Ok(Pass { tally, .. }) => {
            result.examined = tally.leaves;
            let (digest, stated) = (tally.digest, manifest.digest);
            if digest != stated {
                result.report(format_args!(
                    "the leaves of the tree have the digest {digest}, but those of the manifest {stated}"
                ));
            }
            result.needs_objects("the mesh has no leaf");
        }
    }
    result
}
