//! The table `[run]` of an engine file: command templates, and the command lines made of them.

use super::failure::End;
use super::layout::{Launcher, Layout, Ranks, RunOptions};
use check::promises::{Independence, Promises};
use contract::failure::{Failure, Result};
use contract::import::{Format, Position};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Values of placeholders, which are names between braces.
pub type Values<'a> = BTreeMap<&'a str, String>;

/// The word in `parallel` that stands for the launcher's words.
pub(super) const LAUNCHER: &str = "{launcher}";

/// Placeholders that have a value in every template.
const COMMON: [&str; 7] = ["program", "ranks", "here", "root", "python", "mpirun", "target"];

/// Command templates, as lists of words. An empty template is a capability that the engine does not have.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Templates {
    /// A serial run.
    pub serial: Vec<String>,
    /// A run on `{ranks}` processes, started by `{launcher}`.
    pub parallel: Vec<String>,
    /// Appended to `{launcher} {program}` in place of a run's arguments, so that the ranks stay and run the command lines of their
    /// standard input (`harness/engines/README.md`).
    pub serve: Vec<String>,
    /// A run on `{ranks}` ranks within one process, scheduled by `{seed}`.
    pub simulated: Vec<String>,
    /// Appended to write the leaf-set directory `{out}`. Without it, the commands themselves contain `{out}`, and every
    /// run writes its mesh.
    pub out: Vec<String>,
    /// What the engine writes, if not leaf words: `{out}` then begins the path of that file or directory.
    pub format: Option<Format>,
    /// The cell array or column with the sides, in that format.
    pub sides: Option<String>,
    /// What x, y and z are in a table.
    pub position: Position,
    /// Appended to write the run report `{json}`.
    pub json: Vec<String>,
    /// Appended to keep the current activity of each rank in the directory `{status}`.
    pub status: Vec<String>,
    /// Appended to stop at the base tree.
    pub ungraded: Vec<String>,
    /// Appended to time each simulated rank alone.
    pub time_alone: Vec<String>,
    /// Appended to choose the `{partitioner}`.
    pub partitioner: Vec<String>,
    /// Appended to choose the level of the partition, `{level_base}`.
    pub level_base: Vec<String>,
    /// Appended to choose the `{weights}` of the partition.
    pub weights: Vec<String>,
}

impl Templates {
    /// The commands that start a run, by key.
    pub(super) fn commands(&self) -> [(&'static str, &[String]); 3] {
        [("serial", &self.serial), ("parallel", &self.parallel), ("simulated", &self.simulated)]
    }

    /// What is appended to a command, by key, which is also the placeholder that has a value there.
    fn appended(&self) -> [(&'static str, &[String]); 8] {
        [
            ("out", &self.out),
            ("json", &self.json),
            ("status", &self.status),
            ("ungraded", &self.ungraded),
            ("time_alone", &self.time_alone),
            ("partitioner", &self.partitioner),
            ("level_base", &self.level_base),
            ("weights", &self.weights),
        ]
    }

    /// Whether every run writes a mesh, because the engine cannot describe it in another way.
    pub fn always_writes_mesh(&self) -> bool {
        self.json.is_empty() || self.out.is_empty()
    }

    /// Refuses promises that no command could show to be kept.
    pub(super) fn check_promises(&self, promises: &Promises) -> Result<()> {
        let on_sides = promises.definition || promises.crossing || promises.sides.is_some();
        let why = "the promises include sides (`definition` does, which is assumed without [promises]), but [run] names no cell array \
             for them: add it, as in sides = \"side\", or promise less, as in balance = \"face\"";
        Failure::unless(self.format.is_none() || self.sides.is_some() || !on_sides, why)?;
        let varies = |of, keys: [&[String]; 2]| {
            !promises.independent_of.contains(&of) || !keys.concat().is_empty()
        };
        let why = "`independent_of` names ranks, but [run] has neither `parallel` nor `simulated` with which to vary it";
        Failure::unless(varies(Independence::Ranks, [&self.parallel, &self.simulated]), why)?;
        let why = "`independent_of` names partitioner, but [run] has neither `partitioner` nor `level_base` with which to vary it";
        let keys: [&[String]; 2] = [&self.partitioner, &self.level_base];
        Failure::unless(varies(Independence::Partitioner, keys), why)?;
        // On several ranks alone, where the mesh is then compared with that of other numbers.
        let is_compared = promises.is_independent_of(Independence::Ranks);
        let why =
            "`independent_of` names partitioner without ranks, which vary with it: add \"ranks\"";
        let on_partitioner = promises.independent_of.contains(&Independence::Partitioner);
        Failure::unless(is_compared || !on_partitioner, why)
    }

    /// Refuses placeholders that have no value in the template that contains them, and templates without those that they are for.
    pub(super) fn check_placeholders(&self) -> Result<()> {
        // A command that contains {out} needs no template that appends it.
        let needs_out = self.out.is_empty();
        for (key, template) in self.commands().into_iter().filter(|(_, of)| !of.is_empty()) {
            let seed = (key == "simulated").then_some("seed");
            let out = needs_out.then_some("out");
            let own: Vec<&str> = [Some("case"), seed, out].into_iter().flatten().collect();
            let words = template.iter().filter(|word| key != "parallel" || *word != LAUNCHER);
            check_known(key, &words.cloned().collect::<Vec<_>>(), &own)?;
            let has = |text: &str| template.iter().any(|word| word.contains(text));
            let why = format!("`{key}` has no {{ranks}}, the number of ranks to start");
            Failure::unless(key == "serial" || has("{ranks}") || has(LAUNCHER), why)?;
            let why = format!("`{key}` has no {{out}}, for the mesh: add it, or the key `out`");
            Failure::unless(!needs_out || has("{out}"), why)?;
            let why = format!("`{key}` has no {{case}}: add it, as in [\"mine\", \"{{case}}\"]");
            Failure::unless(has("{case}") || self.out.concat().contains("{case}"), why)?;
        }
        check_known("serve", &self.serve, &[])?;
        let is_served = self.serve.is_empty() || self.parallel.concat().contains("{program}");
        Failure::unless(is_served, "`serve` needs the word {program} in `parallel`")?;
        self.appended().into_iter().try_for_each(|(key, of)| {
            let is_switch = ["ungraded", "time_alone"].contains(&key) || of.is_empty();
            let why = format!("`{key}` has no {{{key}}}, which it is for");
            Failure::unless(is_switch || of.concat().contains(&format!("{{{key}}}")), why)?;
            check_known(key, of, &["case", key])
        })
    }

    /// Refuses another program for commands that do not contain the word for it.
    pub(super) fn check_other_program(&self) -> Result<()> {
        let fixed = |of: &[String]| !of.is_empty() && !of.concat().contains("{program}");
        let why = "a command of the engine file has no {program}, so that no other one can be run";
        Failure::unless(!self.commands().iter().any(|(_, words)| fixed(words)), why)
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
            Err(End::Missing(format!("cannot be {what}: its engine file has no `{key}` in [run]")))
        };
        let (template, what, key) = match layout.ranks {
            Ranks::Serial => (&self.serial, "run", "serial"),
            Ranks::Simulated { .. } => (&self.simulated, "run on simulated ranks", "simulated"),
            Ranks::Mpi(_) => (&self.parallel, "run on MPI", "parallel"),
        };
        if template.is_empty() {
            return lacks(what, key);
        }
        if let Ranks::Simulated { seed, .. } = layout.ranks {
            values.insert("seed", seed.to_string());
        }
        if options.ungraded && self.ungraded.is_empty() {
            return lacks("stopped at the base tree", "ungraded");
        }
        let ranks = layout.ranks.count();
        values.insert("ranks", ranks.to_string());
        let expand = |word: &String| match word == LAUNCHER {
            true => launcher.words(ranks).collect(),
            false => vec![word.clone()],
        };
        let mut words: Vec<String> = template.iter().flat_map(expand).collect();
        let text = |path: PathBuf| path.to_string_lossy().into_owned();
        let chosen = [
            out,
            options.report.then(|| text(options.report_path())),
            options.status_path().map(text),
            options.ungraded.then(String::new),
            options.time_alone.then(String::new),
            layout.partitioner.clone(),
            layout.level_base.clone(),
            layout.weights.clone(),
        ];
        for ((key, template), value) in self.appended().into_iter().zip(chosen) {
            if let Some(value) = value {
                values.insert(key, value);
                words.extend_from_slice(template);
            }
        }
        Ok(words.iter().map(|word| fill(word, &values)).collect())
    }
}

/// Refuses placeholders of a template that have no value in it.
pub(super) fn check_known(key: &str, words: &[String], own: &[&str]) -> Result<()> {
    let known = [&COMMON, own].concat();
    let mut named = words.iter().flat_map(|word| placeholders(word));
    let Some(name) = named.find(|name| !known.contains(name)) else { return Ok(()) };
    let known = known.join(" ");
    let why = format!("`{key}` has the unknown placeholder {{{name}}}; known are {known}");
    Err(Failure::input(why))
}

/// The placeholders of a word, without their braces.
fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    word.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name)
}

/// A word with its placeholders replaced by their values; those without a value are left as they are.
pub fn fill(word: &str, values: &Values) -> String {
    let known = placeholders(word).filter_map(|name| Some((name, values.get(name)?)));
    known.fold(word.to_owned(), |word, (name, value)| word.replace(&format!("{{{name}}}"), value))
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
