//! The table `[run]` of an engine file: command templates, and the command lines made of them.

use super::failure::End;
use super::launcher::Launcher;
use super::layout::{Layout, Ranks};
use super::options::RunOptions;
use check::promises::{Independence, Promises};
use contract::import::{Format, Position};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::{iter, slice};

/// Values of placeholders, which are names between braces.
pub type Values<'a> = BTreeMap<&'a str, String>;

/// The word in `parallel` that stands for the launcher's words.
pub(super) const LAUNCHER: &str = "{launcher}";

/// Placeholders that have a value in every template.
const COMMON: [&str; 8] =
    ["program", "case", "ranks", "here", "root", "python", "mpirun", "target"];

/// Those that have one in the template of the same name.
const OWN: [&str; 6] = ["out", "json", "status", "partitioner", "level_base", "weights"];

/// Command templates, as lists of words. A missing template is a capability that the engine does not have.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Templates {
    /// A serial run.
    #[serde(default)]
    pub serial: Vec<String>,
    /// A run on `{ranks}` processes, started by `{launcher}`.
    pub parallel: Option<Vec<String>>,
    /// Appended to `{launcher} {program}` in place of a run's arguments, so that the ranks stay and run the command lines of their
    /// standard input (`harness/engines/README.md`).
    pub serve: Option<Vec<String>>,
    /// A run on `{ranks}` ranks within one process, scheduled by `{seed}`.
    pub simulated: Option<Vec<String>>,
    /// Appended to write the leaf-set directory `{out}`. Without it, the commands themselves contain `{out}`, and every
    /// run writes its mesh.
    pub out: Option<Vec<String>>,
    /// What the engine writes, if not leaf words: `{out}` then begins the path of that file or directory.
    pub format: Option<Format>,
    /// The cell array or column with the sides, in that format.
    pub sides: Option<String>,
    /// What x, y and z are in a table.
    #[serde(default)]
    pub position: Position,
    /// Appended to write the run report `{json}`.
    pub json: Option<Vec<String>>,
    /// Appended to keep the current activity of each rank in the directory `{status}`.
    pub status: Option<Vec<String>>,
    /// Appended to stop at the base tree.
    pub ungraded: Option<Vec<String>>,
    /// Appended to choose the `{partitioner}`.
    pub partitioner: Option<Vec<String>>,
    /// Appended to choose the level of the partition, `{level_base}`.
    pub level_base: Option<Vec<String>>,
    /// Appended to choose the `{weights}` of the partition.
    pub weights: Option<Vec<String>>,
}

impl Templates {
    /// The templates of the file, by key.
    fn all(&self) -> impl Iterator<Item = (&'static str, &Vec<String>)> {
        let optional = [
            ("parallel", &self.parallel),
            ("serve", &self.serve),
            ("simulated", &self.simulated),
            ("out", &self.out),
            ("json", &self.json),
            ("status", &self.status),
            ("ungraded", &self.ungraded),
            ("partitioner", &self.partitioner),
            ("level_base", &self.level_base),
            ("weights", &self.weights),
        ];
        let optional = optional.into_iter().filter_map(|(key, of)| Some((key, of.as_ref()?)));
        iter::once(("serial", &self.serial)).chain(optional)
    }

    /// Replaces the program in all commands by its placeholder, so that another one can be run.
    pub(super) fn name_program(&mut self, program: &str) {
        let commands = [Some(&mut self.serial), self.parallel.as_mut(), self.simulated.as_mut()];
        for word in commands.into_iter().flatten().flatten().filter(|word| *word == program) {
            *word = "{program}".to_owned();
        }
    }

    /// Whether every run writes a mesh, because the engine cannot describe it in another way.
    pub fn always_writes_mesh(&self) -> bool {
        self.json.is_none() || self.out.is_none()
    }

    /// Refuses promises that no command could show to be kept.
    pub(super) fn check_promises(&self, promises: &Promises) -> Result<(), String> {
        let on_sides = promises.definition || promises.crossing || promises.sides.is_some();
        if self.format.is_some() && self.sides.is_none() && on_sides {
            return Err(
                "the promises include sides (`definition` does, which is assumed without [promises]), but [run] names no cell array \
                 for them: add it, as in sides = \"side\", or promise less, as in balance = \"face\""
                    .to_owned(),
            );
        }
        let ranks = self.parallel.is_some() || self.simulated.is_some();
        let choices = self.partitioner.is_some() || self.level_base.is_some();
        for (of, has, what) in [
            (Independence::Ranks, ranks, "ranks, but [run] has neither `parallel` nor `simulated`"),
            (
                Independence::Partitioner,
                choices,
                "partitioner, but [run] has neither `partitioner` nor `level_base`",
            ),
        ] {
            if promises.independent_of.contains(&of) && !has {
                return Err(format!("`independent_of` names {what} with which to vary it"));
            }
        }
        Ok(())
    }

    /// Refuses placeholders that have no value in the template that contains them, and commands that write no mesh.
    pub(super) fn check_placeholders(&self) -> Result<(), String> {
        for (key, template) in self.all() {
            let has = |text: &str| template.iter().any(|word| word.contains(text));
            let starts = ["serial", "parallel", "simulated"].contains(&key);
            // A command that contains {out} needs no template that appends it.
            let contains_out = starts && self.out.is_none();
            let own: &[&str] = match key {
                "simulated" => &["seed"],
                _ if OWN.contains(&key) => slice::from_ref(&key),
                _ => &[],
            };
            let out: &[&str] = if contains_out { &["out"] } else { &[] };
            let known = [&COMMON, own, out].concat();
            let words = template.iter().filter(|word| key != "parallel" || *word != LAUNCHER);
            let mut names = words.flat_map(|word| placeholders(word));
            if let Some(name) = names.find(|name| !known.contains(name)) {
                return Err(format!(
                    "`{key}` has the unknown placeholder {{{name}}}; known there are {}",
                    known.join(" ")
                ));
            }
            if key == "parallel" && self.serve.is_some() && !has("{program}") {
                return Err("`serve` needs the word {program} in `parallel`".to_owned());
            }
            if contains_out && !has("{out}") {
                return Err(format!(
                    "`{key}` has no {{out}}, the place of the mesh: add it, as in [\"my-mesher\", \"{{case}}\", \"{{out}}\"], or the \
                     key `out`, as in out = [\"--out\", \"{{out}}\"]"
                ));
            }
        }
        Ok(())
    }

    /// The words of a run's command line, of which `out` is the place of the mesh, if it is written, and `values` are those of the
    /// placeholders of all runs. A run report, a status or a choice that the engine does not offer is omitted.
    ///
    /// # Errors
    /// [`End::Missing`] if the engine has no template for it. The final mesh is no substitute for a base tree.
    pub(super) fn words(
        &self,
        launcher: &Launcher,
        layout: &Layout,
        options: &RunOptions,
        out: Option<String>,
        mut values: Values,
    ) -> Result<Vec<String>, End> {
        let lacks = |what: &str, key: &str| {
            End::Missing(format!("cannot be {what}: its engine file has no `{key}` in [run]"))
        };
        let template = match layout.ranks {
            Ranks::Serial => &self.serial,
            Ranks::Simulated { seed, .. } => {
                values.insert("seed", seed.to_string());
                let command = self.simulated.as_ref();
                command.ok_or_else(|| lacks("run on simulated ranks", "simulated"))?
            }
            Ranks::Mpi(_) => {
                self.parallel.as_ref().ok_or_else(|| lacks("run on MPI", "parallel"))?
            }
        };
        if options.ungraded && self.ungraded.is_none() {
            return Err(lacks("stopped at the base tree", "ungraded"));
        }
        let ranks = layout.ranks.count();
        values.insert("ranks", ranks.to_string());
        let expand = |word: &String| match word == LAUNCHER {
            true => launcher.words(ranks).collect(),
            false => vec![word.clone()],
        };
        let mut words: Vec<String> = template.iter().flat_map(expand).collect();
        let text = |path: PathBuf| path.to_string_lossy().into_owned();
        for (key, value, template) in [
            ("out", out, &self.out),
            ("json", options.report.then(|| text(options.report_path())), &self.json),
            ("status", options.status.then(|| text(options.status_path())), &self.status),
            ("ungraded", options.ungraded.then(String::new), &self.ungraded),
            ("partitioner", layout.partitioner.clone(), &self.partitioner),
            ("level_base", layout.level_base.clone(), &self.level_base),
            ("weights", layout.weights.clone(), &self.weights),
        ] {
            if let Some(value) = value {
                values.insert(key, value);
                words.extend(template.iter().flatten().cloned());
            }
        }
        Ok(words.iter().map(|word| fill(word, &values)).collect())
    }
}

/// The placeholders of a word, without their braces.
fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    word.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name)
}

/// A word with its placeholders replaced by their values; those without a value are left as they are.
pub fn fill(word: &str, values: &Values) -> String {
    let mut filled = word.to_owned();
    for name in placeholders(word) {
        if let Some(value) = values.get(name) {
            filled = filled.replace(&format!("{{{name}}}"), value);
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_not_searched_for_placeholders() {
        let values = Values::from([("case", "{out}".to_owned()), ("out", "o".to_owned())]);
        assert_eq!(fill("a{case}b", &values), "a{out}b");
        assert_eq!(fill("{none}", &values), "{none}");
    }
}
