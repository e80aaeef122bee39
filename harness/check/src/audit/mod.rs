//! Every check that needs nothing but a leaf-set directory, at any size.
//!
//! One pass over the part files, merged as they are read, feeds the tally, the order check and the
//! tree; leaves are not kept. The tree stores equal subtrees once, so that memory grows with the
//! variety of a mesh and not with its size; how far it may grow is an option. Against the
//! manifest's own terms, and without T0, facets or another mesh: what that misses, each check says.

use std::fmt;
use std::path::Path;
use std::time::Instant;

use crate::checks::{self, CheckResult, Terms};
use contract::leafset;
use contract::manifest::{Keep, Manifest, Tree as Kind};

pub(crate) mod merge;
mod pass;
pub mod record;

use pass::Pass;

/// How an audit is run.
#[derive(Clone, Debug)]
pub struct AuditOptions {
    /// Distinct nodes that may be kept in memory. Each takes up to 120 bytes while the tables grow.
    pub nodes_max: usize,
}

impl Default for AuditOptions {
    fn default() -> Self {
        Self { nodes_max: 32_000_000 }
    }
}

/// What an audit found.
#[derive(Clone, Debug)]
pub struct AuditReport {
    /// One per check.
    pub checks: Vec<CheckResult>,
    /// Leaves read.
    pub leaves: u64,
    /// Distinct nodes that they came down to.
    pub nodes: u64,
    /// Time for reading, merging, counting and building the tree.
    pub time_read_s: f64,
    /// Time for all.
    pub time_wall_s: f64,
}

impl AuditReport {
    /// Whether every check holds.
    pub fn holds(&self) -> bool {
        self.checks.iter().all(CheckResult::holds)
    }
}

impl fmt::Display for AuditReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for check in &self.checks {
            writeln!(f, "{check}")?;
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

/// Name of the check that the tree fits the memory allowed.
pub const CAPACITY: &str = "capacity";

/// Audits a directory. What cannot be read as a leaf set at all is a finding of `files`.
pub fn audit(dir: &Path, options: &AuditOptions) -> AuditReport {
    let start = Instant::now();
    let mut report =
        AuditReport { checks: Vec::new(), leaves: 0, nodes: 0, time_read_s: 0.0, time_wall_s: 0.0 };
    let pass = leafset::open(dir).and_then(|set| Pass::over(&set, options).map(|pass| (set, pass)));
    report.time_read_s = start.elapsed().as_secs_f64();
    match pass {
        Ok((set, pass)) => {
            (report.leaves, report.nodes) = (pass.tally.leaves, pass.nodes() as u64);
            report.checks = checks(&set.manifest, pass);
        }
        Err(e) => report.checks.push(CheckResult::unreadable(&e)),
    }
    report.time_wall_s = start.elapsed().as_secs_f64();
    report
}

fn checks(manifest: &Manifest, pass: Pass) -> Vec<CheckResult> {
    let (terms, leaves) = (Terms::of_manifest(manifest), pass.tally.leaves);
    let mut files = CheckResult::new(checks::FILES);
    files.examined = manifest.parts.len() as u64;
    let mut checks =
        vec![files, checks::manifest::check_leaves(manifest, &pass.tally, &pass.parts)];
    checks.push(pass.linear);
    let Some(tree) = pass.tree else {
        checks.extend(pass.capacity);
        return checks;
    };
    let mut of_tree = match manifest.tree {
        Kind::Final => vec![
            checks::complete::check_holes(&tree, &terms),
            checks::spacing::check_tree(&tree, &terms),
            checks::sides::check_tree(&tree, &terms),
            checks::balance::check_tree(&tree, &terms.root),
            checks::layer::check_tree(&tree, &terms),
        ],
        // Deletion and gradation make the final mesh; of T0 neither is promised.
        Kind::Base => {
            let everything = Terms { keep: Keep::All, keep_crossing: true, ..terms };
            vec![
                checks::complete::check_holes(&tree, &everything),
                checks::spacing::check_tree(&tree, &everything),
                checks::sides::check_tree(&tree, &everything),
            ]
        }
    };
    of_tree.iter_mut().for_each(|c| c.examined = leaves);
    checks.extend(of_tree);
    checks
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::leafset::LeafSet;
    use contract::testing::{leaf_set, random_words, words_of};
    use proptest::prelude::*;

    fn audited(set: &LeafSet, options: &AuditOptions) -> AuditReport {
        let dir = tempfile::tempdir().unwrap();
        set.write(dir.path()).unwrap();
        audit(dir.path(), options)
    }

    fn found(report: &AuditReport) -> Vec<&'static str> {
        report.checks.iter().filter(|c| !c.holds()).map(|c| c.name).collect()
    }

    /// A balanced mesh of three levels.
    fn sound() -> Vec<u64> {
        words_of(|o| o.level == 0 || o.level < 3 && o.corner == [0; 3])
    }

    proptest! {
        /// However leaves are dealt to parts, the audit says the same; and it counts every leaf.
        #[test]
        fn parts_do_not_matter(words in random_words(3), deal in prop::collection::vec(0usize..5, 600)) {
            let mut parts = vec![Vec::new(); 5];
            words.iter().zip(&deal).for_each(|(&w, &part)| parts[part].push(w));
            let dealt: Vec<u64> = words.iter().take(deal.len()).copied().collect();
            let options = AuditOptions::default();
            let (whole, cut) = (audited(&leaf_set(vec![dealt]), &options), audited(&leaf_set(parts), &options));
            prop_assert_eq!(found(&whole), found(&cut));
            prop_assert!(!found(&cut).contains(&"manifest") && !found(&cut).contains(&"linear"));
            prop_assert_eq!(cut.leaves, words.len().min(deal.len()) as u64);
        }
    }

    #[test]
    fn a_sound_mesh_is_sound_and_a_disordered_part_is_not() {
        let words = sound();
        assert!(audited(&leaf_set(vec![words.clone(), vec![]]), &AuditOptions::default()).holds());
        let mut disordered = words;
        disordered.swap(3, 4);
        let report = audited(&leaf_set(vec![disordered]), &AuditOptions::default());
        assert!(found(&report).contains(&"linear"));
    }

    /// Where memory does not suffice the audit must not pass, but counts and digests are still checked.
    #[test]
    fn too_small_a_capacity_is_a_finding() {
        let mut set = leaf_set(vec![words_of(|o| o.level < 5 && o.corner[0] < 1 << 18)]);
        set.manifest.leaves += 1;
        let report = audited(&set, &AuditOptions { nodes_max: 1 });
        assert_eq!(found(&report), ["manifest", CAPACITY]);
    }
}
