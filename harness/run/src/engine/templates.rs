//! The command templates of an engine file: the table `[run]`.

use super::placeholders::{LAUNCHER, placeholders};
use check::promises::{Independence, Promises};
use contract::import::{Format, Position};
use serde::Deserialize;
use std::collections::BTreeMap;

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
    /// standard input (`harness/engines/README.md`). Not with `environment`.
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
    /// Appended to choose the number of `{threads}`.
    pub threads: Option<Vec<String>>,
    /// Variables to add to the environment.
    #[serde(default)]
    pub environment: BTreeMap<String, String>,
}

impl Templates {
    /// The commands that start the engine.
    fn commands(&mut self) -> impl Iterator<Item = &mut Vec<String>> {
        let others = [self.parallel.as_mut(), self.simulated.as_mut()];
        std::iter::once(&mut self.serial).chain(others.into_iter().flatten())
    }

    /// Replaces the program in all commands by its placeholder, so that another one can be run.
    pub(super) fn name_program(&mut self, program: &str) {
        for word in self.commands().flatten().filter(|word| *word == program) {
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
        let environment = self.environment.values();
        let mut words = environment.chain(&self.serial).chain(self.threads.iter().flatten());
        let threads = words.any(|word| word.contains("{threads}"));
        let ranks = self.parallel.is_some() || self.simulated.is_some();
        let choices = self.partitioner.is_some() || self.level_base.is_some();
        let needs = [
            (Independence::Ranks, ranks, "command for ranks (`parallel` or `simulated`)"),
            (Independence::Partitioner, choices, "`partitioner` or `level_base`"),
            (Independence::Threads, threads, "place for {threads}"),
        ];
        let lacks = |(of, has, _): &&(Independence, bool, &str)| {
            promises.independent_of.contains(of) && !has
        };
        match needs.iter().find(lacks) {
            Some((of, _, what)) => {
                let of = format!("{of:?}").to_lowercase();
                Err(format!(
                    "`independent_of` names {of}, but [run] has no {what} with which to vary it"
                ))
            }
            None => Ok(()),
        }
    }

    /// Refuses placeholders that have no value in the template that contains them, and commands that write no mesh.
    pub(super) fn check_placeholders(&self) -> Result<(), String> {
        let common =
            ["program", "case", "ranks", "threads", "here", "root", "python", "mpirun", "target"];
        let environment: Vec<String> = self.environment.values().cloned().collect();
        // A command that contains {out} needs no template that appends it.
        let (in_command, in_simulated): (&[&str], &[&str]) = match self.out {
            None => (&["out"], &["seed", "out"]),
            Some(_) => (&[], &["seed"]),
        };
        let templates: [(_, _, &[&str]); 13] = [
            ("serial", Some(&self.serial), in_command),
            ("parallel", self.parallel.as_ref(), in_command),
            ("serve", self.serve.as_ref(), &[]),
            ("simulated", self.simulated.as_ref(), in_simulated),
            ("out", self.out.as_ref(), &["out"]),
            ("json", self.json.as_ref(), &["json"]),
            ("status", self.status.as_ref(), &["status"]),
            ("ungraded", self.ungraded.as_ref(), &[]),
            ("partitioner", self.partitioner.as_ref(), &["partitioner"]),
            ("level_base", self.level_base.as_ref(), &["level_base"]),
            ("weights", self.weights.as_ref(), &["weights"]),
            ("threads", self.threads.as_ref(), &[]),
            ("environment", Some(&environment), &[]),
        ];
        for (key, template, own) in templates {
            let words = template.into_iter().flatten();
            let words = words.filter(|word| key != "parallel" || *word != LAUNCHER);
            let unknown = |name: &&str| !common.contains(name) && !own.contains(name);
            if let Some(name) = words.flat_map(|word| placeholders(word)).find(unknown) {
                let known = [&common[..], own].concat().join(" ");
                return Err(format!(
                    "`{key}` has the unknown placeholder {{{name}}}; known there are {known}"
                ));
            }
            let is_named =
                || template.is_some_and(|words| words.iter().any(|word| word == "{program}"));
            if key == "parallel" && self.serve.is_some() && !is_named() {
                return Err("`serve` needs the word {program} in `parallel`".to_owned());
            }
            let starts = ["serial", "parallel", "simulated"].contains(&key);
            let writes = |words: &Vec<String>| words.iter().any(|word| word.contains("{out}"));
            if starts && self.out.is_none() && template.is_some_and(|words| !writes(words)) {
                return Err(format!(
                    "`{key}` has no {{out}}, the place of the mesh: add it, as in [\"my-mesher\", \"{{case}}\", \"{{out}}\"], or the \
                     key `out`, as in out = [\"--out\", \"{{out}}\"]"
                ));
            }
        }
        Ok(())
    }
}
