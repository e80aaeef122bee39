//! The engine file: a TOML file with the command templates, capabilities and limits of a mesher.
//! `harness/engines/README.md` explains how one is written.
//!
//! Invariants: an engine has a capability if and only if its file has the command template for it; unknown keys and
//! unknown placeholders are errors when the file is read.

use super::paths::Paths;
use contract::case::Case;
use contract::manifest::Keep;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Our own engine files, for a harness that runs outside the repository.
const OWN: [(&str, &str); 2] = [
    ("mesher", include_str!("../../../engines/mesher.toml")),
    ("reference", include_str!("../../../engines/reference.toml")),
];

/// An engine file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// A sentence about the engine.
    pub about: String,
    /// The program, `{program}` in templates. The command line may name another one.
    pub program: String,
    /// Command templates.
    pub run: Templates,
    /// Features of a case that the engine supports.
    #[serde(default)]
    pub takes: Takes,
    /// Limits on cases.
    #[serde(default)]
    pub limits: Limits,
    /// Whether the run report has the peak memory, so that the harness need not sample it.
    #[serde(default)]
    pub reports_memory: bool,
    /// How a revision is built, for `harness gate --baseline REVISION`.
    pub build: Option<Build>,
    /// The name or path by which the file was found.
    #[serde(skip)]
    pub name: String,
    /// The file's directory, `{here}` in templates.
    #[serde(skip)]
    pub here: PathBuf,
}

/// Command templates, as lists of words. A missing template is a capability that the engine does not have.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Templates {
    /// A serial run.
    pub serial: Vec<String>,
    /// A run on `{ranks}` processes, started by `{launcher}`.
    pub parallel: Option<Vec<String>>,
    /// A run on `{ranks}` ranks within one process, scheduled by `{seed}`.
    pub simulated: Option<Vec<String>>,
    /// Appended to write the leaf-set directory `{out}`.
    pub out: Vec<String>,
    /// Appended to write the run report `{json}`.
    pub json: Option<Vec<String>>,
    /// Appended to include the message matrix in the run report.
    pub message_matrix: Option<Vec<String>>,
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
    /// Variables to add to the environment.
    #[serde(default)]
    pub environment: BTreeMap<String, String>,
}

/// Features of a case file that an engine supports.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Takes {
    /// `[generator]` and `root_scale`. If not, the engine is given an STL file and an explicit root.
    pub generator: bool,
    /// Extent boxes.
    pub boxes: bool,
    /// Values of `keep`.
    pub keep: Vec<Keep>,
    /// `keep_crossing = false`.
    pub drop_crossing: bool,
}

impl Default for Takes {
    fn default() -> Self {
        let keep = vec![Keep::Outside, Keep::Inside, Keep::All];
        Self { generator: false, boxes: true, keep, drop_crossing: true }
    }
}

/// Limits: the engine is not run on a case beyond them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Deepest level.
    pub level_max: u8,
    /// Greatest number of facets.
    pub facets_max: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { level_max: contract::octant::LEVEL_MAX, facets_max: u64::MAX }
    }
}

/// How a revision is built.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Build {
    /// Run in the root directory of the revision, `{root}`. `{target}` is a directory for the results, which are kept whole;
    /// `{shared}` is one for what the builds of all revisions may share.
    pub command: Vec<String>,
    /// The program that the command builds.
    pub program: String,
}

/// Values of placeholders.
pub type Values<'a> = BTreeMap<&'a str, String>;

impl Description {
    /// Reads the engine file with this name in the repository, or at this path if it ends in `.toml`.
    ///
    /// # Errors
    /// One sentence, if the file is missing or wrong.
    pub fn find(name: &str, paths: &Paths) -> Result<Self, String> {
        let path = match name.ends_with(".toml") {
            true => PathBuf::from(name),
            false => paths.engines.join(format!("{name}.toml")),
        };
        let wrong = |why: String| format!("{}: {why}", path.display());
        let own = OWN.iter().find(|(own, _)| *own == name);
        let text = match (std::fs::read_to_string(&path), own) {
            (Err(error), Some((_, text))) if error.kind() == ErrorKind::NotFound => {
                (*text).to_owned()
            }
            (text, _) => text.map_err(|error| wrong(error.to_string()))?,
        };
        let mut description = Self::parse(&text).map_err(wrong)?;
        description.name = name.to_owned();
        let here = path.parent().unwrap_or(Path::new(""));
        description.here = std::fs::canonicalize(here.join(".")).unwrap_or(here.to_owned());
        Ok(description)
    }

    fn parse(text: &str) -> Result<Self, String> {
        let description: Self =
            toml::from_str(text).map_err(|error| error.message().replace('\n', " "))?;
        description.run.check_placeholders()?;
        Ok(description)
    }

    /// Values of the placeholders for paths on this machine.
    pub fn places(&self, paths: &Paths) -> Values<'static> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let target = paths.harness.parent().unwrap_or(Path::new("."));
        Values::from([
            ("here", text(&self.here)),
            ("root", text(&paths.root)),
            ("target", text(target)),
            ("python", text(&paths.python)),
            ("mpirun", text(&paths.mpirun)),
        ])
    }

    /// Why the engine is not run on a case; `None` if it is.
    pub fn declines(&self, case: &Case) -> Option<String> {
        let (level, facets) = (case.level_deepest(), case.facets.len() as u64);
        let name = &self.name;
        if level > self.limits.level_max {
            let limit = self.limits.level_max;
            return Some(format!(
                "{name} supports levels up to {limit}, and the case needs {level}"
            ));
        }
        if facets > self.limits.facets_max {
            let limit = self.limits.facets_max;
            return Some(format!("{name} supports {limit} facets, and the case has {facets}"));
        }
        if !case.boxes.is_empty() && !self.takes.boxes {
            return Some(format!("{name} does not support extent boxes"));
        }
        if !self.takes.keep.contains(&case.keep) {
            return Some(format!("{name} does not support keep = {:?}", case.keep).to_lowercase());
        }
        if !case.keep_crossing && !self.takes.drop_crossing {
            return Some(format!("{name} does not support keep_crossing = false"));
        }
        None
    }
}

impl Templates {
    /// Refuses placeholders that have no value in the template that contains them.
    fn check_placeholders(&self) -> Result<(), String> {
        let common = ["program", "case", "ranks", "here", "root", "python", "mpirun", "target"];
        let environment: Vec<String> = self.environment.values().cloned().collect();
        let templates = [
            ("serial", Some(&self.serial), ""),
            ("parallel", self.parallel.as_ref(), ""),
            ("simulated", self.simulated.as_ref(), "seed"),
            ("out", Some(&self.out), "out"),
            ("json", self.json.as_ref(), "json"),
            ("message_matrix", self.message_matrix.as_ref(), ""),
            ("status", self.status.as_ref(), "status"),
            ("ungraded", self.ungraded.as_ref(), ""),
            ("partitioner", self.partitioner.as_ref(), "partitioner"),
            ("level_base", self.level_base.as_ref(), "level_base"),
            ("weights", self.weights.as_ref(), "weights"),
            ("environment", Some(&environment), ""),
        ];
        for (key, template, own) in templates {
            let words = template.into_iter().flatten();
            let words = words.filter(|word| key != "parallel" || *word != LAUNCHER);
            let unknown = |name: &&str| !common.contains(name) && *name != own;
            if let Some(name) = words.flat_map(|word| placeholders(word)).find(unknown) {
                let known = [&common[..], &[own]].concat().join(" ");
                return Err(format!(
                    "`{key}` has the unknown placeholder {{{name}}}; known there are {}",
                    known.trim()
                ));
            }
        }
        Ok(())
    }
}

/// The word in `parallel` that stands for the launcher's words.
pub const LAUNCHER: &str = "{launcher}";

/// Names between braces.
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

    const LEAST: &str = "about = 'x'\nprogram = '{here}/m.py'\n[run]\nserial = ['{program}', '{case}']\n\
                         out = ['--out', '{out}']\n";

    #[test]
    fn our_own_engine_files_are_valid() {
        for (name, text) in OWN {
            assert!(Description::parse(text).unwrap().run.json.is_some(), "{name}");
        }
    }

    #[test]
    fn a_missing_template_is_a_missing_capability() {
        let least = Description::parse(LEAST).unwrap();
        assert!(least.run.parallel.is_none() && least.run.json.is_none() && !least.takes.generator);
        assert_eq!(least.limits.level_max, 19);
    }

    #[test]
    fn errors_name_the_invalid_key_or_placeholder() {
        let why = |text: &str| Description::parse(text).unwrap_err();
        let unknown = why(&LEAST.replace("{case}", "{cas}"));
        assert!(unknown.contains("`serial` has the unknown placeholder {cas}"), "{unknown}");
        assert!(why(&LEAST.replace("'{case}'", "'{launcher}'")).contains("{launcher}"));
        assert!(why(&format!("{LEAST}status = ['{{out}}']\n")).contains("`status`"));
        assert!(why(&format!("{LEAST}outt = []\n")).contains("outt"));
        assert!(why("about = 'x'").contains("program"));
    }

    #[test]
    fn a_case_beyond_the_capabilities_is_declined_with_the_reason() {
        let text =
            format!("{LEAST}[takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 3\n");
        let engine = Description::parse(&text).unwrap();
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";
        let declines = |case: &str| {
            engine.declines(&Case::from_parts(&case.replace("ROOT", root), vec![]).unwrap())
        };
        assert_eq!(declines("spacing_min = 1.0\nkeep = 'all'\nROOT"), None);
        let deep = declines("spacing_min = 0.5\nkeep = 'all'\nROOT").unwrap();
        assert!(deep.contains("levels up to 3"), "{deep}");
        assert!(declines("spacing_min = 1.0\nROOT").unwrap().contains("outside"));
        let boxed = "spacing_min = 1.0\nkeep = 'all'\nROOT[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                     max = [1.0, 1.0, 1.0]\nspacing = 1.0";
        assert!(declines(boxed).unwrap().contains("boxes"));
    }

    #[test]
    fn a_value_is_not_searched_for_placeholders() {
        let values = Values::from([("case", "{out}".to_owned()), ("out", "o".to_owned())]);
        assert_eq!(fill("a{case}b", &values), "a{out}b");
        assert_eq!(fill("{none}", &values), "{none}");
    }
}
