//! The independent check of balance: with n = 1 and all leaves kept, the mesh equals the base tree as balanced by
//! p4est.

use super::case::{BALANCE, CaseRun};
use super::report::{Check, Outcome};
use super::run::{MESHER, Makes};
use super::serial::Base;
use crate::engine::failure::{End, Failure};
use crate::engine::launcher;
use crate::engine::layout::SERIAL;
use crate::engine::process::{self, Watch};
use check::checks::{CheckResult, identical};
use contract::npy::PartFile;
use contract::plain::{PlainCase, StlForm};
use std::fs;
use std::path::Path;
use std::process::Command;
use toml::Value;

/// p4est's exit code for a tree that is deeper than it supports.
const EXIT_TOO_DEEP: i32 = 3;

impl CaseRun<'_> {
    /// Meshes the case with n = 1 and all leaves kept, balances the base tree with p4est, and compares the leaves
    /// without their sides.
    pub(super) fn verify_balance(&mut self, base: &Base) {
        let (subject, name) = BALANCE;
        if let Some(why) = &self.all.needs.p4est {
            return self.add(Check::new(subject, name, Outcome::left_out(why)), None);
        }
        self.step("p4est");
        let plain = match self.mesh_plainly() {
            Ok(words) => words,
            Err(failure) => return self.add_failure("p4est: n = 1, all kept", None, &failure),
        };
        let outcome = match self.balance_by_p4est(&base.place) {
            Ok(words) => {
                let root = &base.tree.manifest.root;
                let compared = identical::compare(&sideless(&plain), &words, root);
                let result = CheckResult { name, ..compared };
                return self.add_results(subject, None, vec![result]);
            }
            Err(failure) => match failure.end {
                End::Interrupted => return,
                End::Exited { code: EXIT_TOO_DEEP, .. } => {
                    Outcome::left_out("the base tree has leaves of level 19, p4est stops at 18")
                }
                // A failure of p4est shows nothing about the mesh, and it must not count as agreement.
                _ => Outcome::fail(failure.to_string()),
            },
        };
        self.add(Check::new(subject, name, outcome), None);
    }

    /// The leaf words of the same case with n = 1 and all leaves kept.
    fn mesh_plainly(&self) -> Result<Vec<u64>, Failure> {
        let place = self.place.join("plain-case");
        let unusable = |why: String| Failure::new("the harness", End::Unusable(why));
        let case = PlainCase::read(&self.file).map_err(unusable)?;
        let written = fs::create_dir_all(&place)
            .and_then(|()| plain(case).write(&place, StlForm::Any))
            .map_err(|error| unusable(format!("cannot write a case with n = 1: {error}")))?;
        let meshed = self.run(&written, "plain", MESHER, Makes::Mesh, &SERIAL)?;
        Ok(meshed.mesh.map(|mesh| mesh.words).unwrap_or_default())
    }

    fn balance_by_p4est(&self, base: &Path) -> Result<Vec<u64>, Failure> {
        let unusable = |why: String| Failure::new("p4est", End::Unusable(why));
        let out = self.place.join("p4est");
        fs::create_dir_all(&out)
            .map_err(|error| unusable(format!("has no {}: {error}", out.display())))?;
        let mut command = Command::new(&self.all.programs.paths.p4est);
        command.arg(base).arg(&out);
        launcher::set_environment(&mut command);
        let _files = launcher::own_directory(&mut command);
        process::run(&mut command, &Watch::new("p4est", self.all.options.limit(), &out))?;
        let part = PartFile::open(&out.join("leaves-00000.npy"));
        let part = part.map_err(|error| unusable(format!("wrote no leaves: {error}")))?;
        part.read_all().map_err(|error| unusable(format!("wrote leaves in part: {error}")))
    }
}

/// The case with n = 1 and all leaves kept.
fn plain(mut case: PlainCase) -> PlainCase {
    case.table.insert("layer_cells_min".into(), Value::Integer(1));
    case.table.insert("keep".into(), Value::String("all".into()));
    case.table.insert("keep_crossing".into(), Value::Boolean(true));
    case
}

/// Leaf words with side bits 0. They stay sorted, because no two leaves have the same octant.
fn sideless(words: &[u64]) -> Vec<u64> {
    words.iter().map(|word| word & !3).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_case_differs_only_in_layer_and_keep() {
        let table = toml::toml! { spacing_min = 0.1 keep = "inside" keep_crossing = false };
        let facets = vec![[[0.5; 3]; 3]];
        let case = plain(PlainCase { table, facets: facets.clone() });
        let expected =
            toml::toml! { spacing_min = 0.1 keep = "all" keep_crossing = true layer_cells_min = 1 };
        assert_eq!((case.table, case.facets), (expected, facets));
    }

    #[test]
    fn sides_are_cleared_and_octants_kept() {
        assert_eq!(
            sideless(&[0b0100, 1 << 7 | 0b1001, 2 << 7 | 0b1010]),
            [4, 1 << 7 | 8, 2 << 7 | 8]
        );
    }
}
