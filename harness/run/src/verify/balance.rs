//! The outside proof of balance: with n = 1 and all kept, the mesh is what p4est makes of the base tree.

use super::case::CaseRun;
use super::outcome::Trouble;
use super::report::{Check, Outcome};
use super::run::{Order, What};
use super::serial::Meshes;
use crate::engine::p4est::{self, EXIT_TOO_DEEP};
use crate::engine::process::{self, End, Watch};
use check::checks::identical;
use contract::npy::PartFile;
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

const SUBJECT: &str = "p4est";
const NAME: &str = "balance";

/// Why there is nothing to compare with.
enum NoTree {
    TooDeep,
    Failed(String),
    Interrupted,
}

impl CaseRun<'_> {
    /// Meshes the derived case, balances the base tree with p4est, compares leaf by leaf but for the sides.
    pub fn verify_balance(&mut self, meshes: &Meshes) {
        if let Some(why) = self.needs.p4est.clone() {
            return self.add(Check::new(SUBJECT, NAME, Outcome::LeftOut(why)), None);
        }
        self.progress.step("p4est");
        let plain = match self.mesh_plainly() {
            Ok(words) => words,
            Err(trouble) => return self.add_trouble("p4est: n = 1, all kept", None, trouble),
        };
        let outcome = match self.balance_by_p4est(&meshes.base_place) {
            Ok(words) => {
                let compared =
                    identical::compare(&sideless(&plain), &words, &meshes.mesh.manifest.root);
                return self.add_results(
                    SUBJECT,
                    None,
                    vec![check::checks::CheckResult { name: NAME, ..compared }],
                );
            }
            Err(NoTree::Interrupted) => return,
            Err(NoTree::TooDeep) => {
                Outcome::LeftOut("the base tree has leaves of level 19, p4est stops at 18".into())
            }
            // An engine that fails says nothing about the mesh, and must not pass for having agreed.
            Err(NoTree::Failed(why)) => Outcome::Fail(format!("the engine failed: {why}")),
        };
        self.add(Check::new(SUBJECT, NAME, outcome), None);
    }

    /// The mesh of the same case with n = 1 and everything kept.
    fn mesh_plainly(&self) -> Result<Vec<u64>, Trouble> {
        let case = self.plain_case().map_err(Trouble::Failed)?;
        let order =
            Order { what: What::Serial, case: &case, name: "plain", ungraded: false, write: true };
        Ok(self.run(&order)?.mesh.map(|mesh| mesh.words).unwrap_or_default())
    }

    fn plain_case(&self) -> Result<PathBuf, String> {
        let text = fs::read_to_string(&self.selected.path).map_err(|error| error.to_string())?;
        let directory = self.selected.path.parent().unwrap_or(Path::new(""));
        let directory = fs::canonicalize(directory.join(".")).map_err(|error| error.to_string())?;
        let path = self.place.join("plain.toml");
        fs::write(&path, plain(&text, &directory)?).map_err(|error| error.to_string())?;
        Ok(path)
    }

    fn balance_by_p4est(&self, base: &Path) -> Result<Vec<u64>, NoTree> {
        let failed = |why: String| NoTree::Failed(why);
        let out = self.place.join("p4est");
        fs::create_dir_all(&out).map_err(|error| failed(error.to_string()))?;
        let watch = Watch { limit: self.options.limit, logs: &out, name: "p4est", status: None };
        let mut command = p4est::command(&self.programs.paths.p4est, base, &out);
        let done = process::run(&mut command, &watch).map_err(|error| failed(error.to_string()))?;
        match done.end {
            End::Exited(0) => {}
            End::Exited(EXIT_TOO_DEEP) => return Err(NoTree::TooDeep),
            End::Interrupted => return Err(NoTree::Interrupted),
            End::TimedOut => {
                return Err(failed(format!("did not end within {} s", watch.limit.as_secs())));
            }
            End::Exited(code) => {
                return Err(failed(format!("exit {code}: {}", done.first_error_line())));
            }
            End::Signalled(signal) => return Err(failed(format!("died of signal {signal}"))),
        }
        let part = PartFile::open(&out.join("leaves-00000.npy"))
            .map_err(|error| failed(error.to_string()))?;
        part.read_all().map_err(|error| failed(error.to_string()))
    }
}

/// The case file's text with n = 1 and everything kept, meaning the same from any directory.
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

/// Leaf words with side bits 0; they stay sorted, since no two leaves have one place.
fn sideless(words: &[u64]) -> Vec<u64> {
    words.iter().map(|word| word & !3).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_case_differs_in_layer_and_keep_alone() {
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
    fn sides_go_and_places_stay() {
        assert_eq!(
            sideless(&[0b0100, 1 << 7 | 0b1001, 2 << 7 | 0b1010]),
            [4, 1 << 7 | 8, 2 << 7 | 8]
        );
    }
}
