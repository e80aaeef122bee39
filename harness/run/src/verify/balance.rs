//! The independent check of balance: with n = 1 and all leaves kept, the mesh equals the base tree as balanced by
//! p4est.

use super::case::CaseRun;
use super::report::{Check, Outcome};
use super::run::{Program, Request};
use super::serial::Base;
use crate::engine::failure::{End, Failure};
use crate::engine::layout::SERIAL;
use crate::engine::p4est::{self, EXIT_TOO_DEEP};
use crate::engine::process::{self, Watch};
use check::checks::{CheckResult, identical};
use contract::npy::PartFile;
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Its subject.
pub const SUBJECT: &str = "p4est";
/// Name of the check.
pub const NAME: &str = "balance";

impl CaseRun<'_> {
    /// Meshes the case with n = 1 and all leaves kept, balances the base tree with p4est, and compares the leaves
    /// without their sides.
    pub fn verify_balance(&mut self, base: &Base) {
        if let Some(why) = self.needs.p4est.clone() {
            return self.add(Check::new(SUBJECT, NAME, Outcome::left_out(why)), None);
        }
        self.progress.step("p4est");
        let plain = match self.mesh_plainly() {
            Ok(words) => words,
            Err(failure) => return self.add_failure("p4est: n = 1, all kept", None, &failure),
        };
        let failure = match self.balance_by_p4est(&base.place) {
            Ok(words) => {
                let root = &base.tree.manifest.root;
                let compared = identical::compare(&sideless(&plain), &words, root);
                let result = CheckResult { name: NAME, ..compared };
                return self.add_results(SUBJECT, None, vec![result]);
            }
            Err(failure) => failure,
        };
        let outcome = match failure.end {
            End::Interrupted => return,
            End::Exited { code: EXIT_TOO_DEEP, .. } => {
                Outcome::left_out("the base tree has leaves of level 19, p4est stops at 18")
            }
            // A failure of p4est shows nothing about the mesh, and it must not count as agreement.
            _ => Outcome::fail(failure.to_string()),
        };
        self.add(Check::new(SUBJECT, NAME, outcome), None);
    }

    /// The leaf words of the same case with n = 1 and all leaves kept.
    fn mesh_plainly(&self) -> Result<Vec<u64>, Failure> {
        let case =
            self.plain_case().map_err(|why| Failure::new("the harness", End::Unusable(why)))?;
        let meshed = self.run(&Request {
            program: Program::Mesher,
            layout: &SERIAL,
            case: &case,
            name: "plain",
            ungraded: false,
            write: true,
        })?;
        Ok(meshed.mesh.map(|mesh| mesh.words).unwrap_or_default())
    }

    fn plain_case(&self) -> Result<PathBuf, String> {
        let wrong = |error: std::io::Error| format!("cannot write a case with n = 1: {error}");
        let text = fs::read_to_string(&self.selected.path).map_err(wrong)?;
        let directory = self.selected.path.parent().unwrap_or(Path::new(""));
        let directory = fs::canonicalize(directory.join(".")).map_err(wrong)?;
        let path = self.place.join("plain.toml");
        fs::write(&path, plain(&text, &directory)?).map_err(wrong)?;
        Ok(path)
    }

    fn balance_by_p4est(&self, base: &Path) -> Result<Vec<u64>, Failure> {
        let unusable = |why: String| Failure::new("p4est", End::Unusable(why));
        let out = self.place.join("p4est");
        fs::create_dir_all(&out)
            .map_err(|error| unusable(format!("has no {}: {error}", out.display())))?;
        let watch = Watch::new("p4est", self.options.limit, &out);
        process::run(&mut p4est::command(&self.programs.paths.p4est, base, &out), &watch)?;
        let part = PartFile::open(&out.join("leaves-00000.npy"));
        let part = part.map_err(|error| unusable(format!("wrote no leaves: {error}")))?;
        part.read_all().map_err(|error| unusable(format!("wrote leaves in part: {error}")))
    }
}

/// The text of the case file with n = 1, all leaves kept and an absolute path of the geometry.
fn plain(text: &str, directory: &Path) -> Result<String, String> {
    let mut case: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    case.insert("layer_cells_min".into(), Value::Integer(1));
    case.insert("keep".into(), Value::String("all".into()));
    case.insert("keep_crossing".into(), Value::Boolean(true));
    if let Some(Value::String(geometry)) = case.get_mut("geometry") {
        *geometry = directory.join(&*geometry).to_string_lossy().into_owned();
    }
    toml::to_string(&case).map_err(|error| error.to_string())
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
        let text = "geometry = \"../a.stl\"\nspacing_min = 0.1\nkeep = \"inside\"\nkeep_crossing = false\n\
                    [root]\norigin = [0.1, 0.2, 0.3]\nedge = 1.5\n[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                    max = [1.0, 1.0, 1.0]\nspacing = 0.25\n";
        let case: Table = plain(text, Path::new("/cases")).unwrap().parse().unwrap();
        let mut expected: Table = text.parse().unwrap();
        expected["geometry"] = "/cases/../a.stl".into();
        expected["keep"] = "all".into();
        expected["keep_crossing"] = true.into();
        expected.insert("layer_cells_min".into(), 1.into());
        assert_eq!(case, expected);
    }

    #[test]
    fn sides_are_cleared_and_octants_kept() {
        assert_eq!(
            sideless(&[0b0100, 1 << 7 | 0b1001, 2 << 7 | 0b1010]),
            [4, 1 << 7 | 8, 2 << 7 | 8]
        );
    }
}
