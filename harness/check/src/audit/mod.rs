//! All checks that need only a leaf-set directory, for meshes of any size.
//!
//! One pass over the part files, which are merged while they are read, or over the tree if there are none, computes the tally, checks the order and
//! builds the tree. Leaves are not stored. The tree stores equal subtrees once, so memory grows with the
//! variety of a mesh and not with its size; an option limits it. Without promises, the checks are those of the
//! definition; they use the requirements in the manifest, without T0, facets or another mesh, and the head of each names
//! what it cannot detect without them. With promises, exactly those are checked, against a case if there is one.

#[cfg(test)]
mod tests;

use std::fmt;
use std::path::Path;
use std::time::Instant;

use crate::checks::{self, CheckResult, Terms};
use crate::promises::Promises;
use contract::case::Case;
use contract::digest::Digest;
use contract::leafset::{self, Leaves, ReadError};
use contract::manifest::{Keep, Manifest, Tree as Kind};
use contract::tree::Tree;

pub(crate) mod merge;
mod pass;
pub mod record;

use pass::Pass;

/// Options of an audit.
#[derive(Clone, Debug)]
pub struct AuditOptions {
    /// Maximum number of distinct nodes in memory. A node needs up to 120 bytes while the tables grow.
    pub nodes_max: usize,
}

impl Default for AuditOptions {
    fn default() -> Self {
        Self { nodes_max: 32_000_000 }
    }
}

/// The result of an audit.
#[derive(Clone, Debug)]
pub struct AuditReport {
    /// One result per check.
    pub checks: Vec<CheckResult>,
    /// Number of leaves.
    pub leaves: u64,
    /// Number of distinct nodes of their tree.
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

    /// Whether any property of the leaves was checked, beyond their files and counts.
    pub fn checked_anything(&self) -> bool {
        let formal = [checks::FILES, "manifest", "linear"];
        self.checks.iter().any(|c| !c.holds() || c.was_run() && !formal.contains(&c.name))
    }
}

impl fmt::Display for AuditReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            writeln!(f, "{check}")?;
        }
        if !self.checked_anything() {
            writeln!(f, "left out: the mesh gave no check of its leaves anything to check")?;
        }
        let Self { leaves, nodes, time_read_s, time_wall_s, .. } = self;
        let rate = *leaves as f64 / time_wall_s.max(1e-9) / 1e6;
        write!(
            f,
            "{leaves} leaves ({nodes} distinct octants) in {time_wall_s:.2} s, of which reading \
             {time_read_s:.2} s: {rate:.1} M leaves/s"
        )
    }
}

/// Name of the check that the tree does not exceed the memory limit.
pub const CAPACITY: &str = "capacity";

/// Name of the check that the tree has the leaves of the parts.
pub const TREE: &str = "tree file";

/// What a mesh is required to be.
#[derive(Clone, Copy, Debug)]
pub enum Requirements<'a> {
    /// A mesh of the definition, as far as its leaves show.
    Definition,
    /// These promises, on this case.
    Promises(&'a Promises, Option<&'a Case>),
}

/// Audits a directory against the definition. If it cannot be read as a leaf set, that is a finding of `files`.
pub fn audit(dir: &Path, options: &AuditOptions) -> AuditReport {
    audit_against(dir, options, Requirements::Definition)
}

/// Audits a directory against the requirements. If it cannot be read as a leaf set, that is a finding of `files`.
pub fn audit_against(
    dir: &Path,
    options: &AuditOptions,
    requirements: Requirements,
) -> AuditReport {
    let start = Instant::now();
    let mut report =
        AuditReport { checks: Vec::new(), leaves: 0, nodes: 0, time_read_s: 0.0, time_wall_s: 0.0 };
    let pass =
        leafset::open_any(dir).and_then(|set| Pass::over(&set, options).map(|pass| (set, pass)));
    report.time_read_s = start.elapsed().as_secs_f64();
    match pass {
        Ok((set, pass)) => {
            (report.leaves, report.nodes) = (pass.tally.leaves, pass.nodes() as u64);
            report.checks = checks(set.manifest(), pass, requirements);
            if let (Leaves::Words(set), Some(_)) = (&set, &set.manifest().hyper_tree_grid) {
                report.checks.push(tree_file(dir, &set.manifest));
            }
        }
        Err(e) => report.checks.push(CheckResult::unreadable(&e)),
    }
    report.time_wall_s = start.elapsed().as_secs_f64();
    report
}

/// Compares the tree of a mesh that also has parts with the manifest.
fn tree_file(dir: &Path, manifest: &Manifest) -> CheckResult {
    let mut result = CheckResult::new(TREE);
    let mut digest = Digest::default();
    let read = leafset::open_tree(dir, manifest).and_then(|tree| {
        let Some(tree) = tree else { return Ok(()) };
        let read = tree.words(&mut |run| {
            result.examined += run.len() as u64;
            run.iter().for_each(|&word| digest.add(word));
            true
        });
        read.map_err(|error| ReadError::tree(&tree, error))
    });
    match read {
        Err(error) => result.report(error.to_string()),
        Ok(()) if digest != manifest.digest => result.report(format!(
            "the leaves of the tree have the digest {digest}, but those of the manifest {}",
            manifest.digest
        )),
        Ok(()) => {}
    }
    result
}

fn checks(manifest: &Manifest, pass: Pass, requirements: Requirements) -> Vec<CheckResult> {
    let leaves = pass.tally.leaves;
    let mut files = CheckResult::new(checks::FILES);
    let tree = manifest.hyper_tree_grid.is_some();
    files.examined = manifest.parts.len() as u64 + u64::from(tree);
    let mut claims = checks::manifest::check_leaves(manifest, &pass.tally, &pass.parts);
    if let Requirements::Promises(_, Some(case)) = requirements {
        checks::manifest::check_terms(manifest, &Terms::of_case(case), &mut claims);
    }
    let mut checks = vec![files, claims, pass.linear];
    let Some(tree) = pass.tree else {
        checks.extend(pass.capacity);
        return checks;
    };
    let mut of_tree = match requirements {
        Requirements::Promises(promises, case) if !promises.definition => {
            let terms = case.map_or_else(|| Terms::of_manifest(manifest), Terms::of_case);
            let terms = Terms { sides: manifest.sides, ..terms };
            checks::promised(&tree, &terms, case, promises)
        }
        _ => of_definition(manifest, &tree),
    };
    of_tree.iter_mut().filter(|c| c.examined == 0 && c.was_run()).for_each(|c| c.examined = leaves);
    checks.extend(of_tree);
    checks
}

/// The checks of the definition that need the leaves only.
fn of_definition(manifest: &Manifest, tree: &Tree) -> Vec<CheckResult> {
    let terms = Terms::of_manifest(manifest);
    let (results, terms) = match manifest.tree {
        Kind::Final => {
            let results = vec![
                checks::complete::check_holes(tree, &terms),
                checks::spacing::check_tree(tree, &terms),
                checks::sides::check_tree(tree, &terms),
                checks::kept::check_tree(tree, &terms, manifest),
                checks::balance::check_tree(tree, &terms.root),
                checks::layer::check_tree(tree, &terms),
            ];
            (results, terms)
        }
        // T0 precedes deletion and gradation.
        Kind::Base => {
            let kept = checks::kept::check_tree(tree, &terms, manifest);
            let terms = Terms { keep: Keep::All, keep_crossing: true, ..terms };
            let results = vec![
                checks::complete::check_holes(tree, &terms),
                checks::spacing::check_tree(tree, &terms),
                checks::sides::check_tree(tree, &terms),
                kept,
            ];
            (results, terms)
        }
    };
    results.into_iter().map(|result| checks::with_premise(result, tree, None, &terms)).collect()
}
