//! Any mesher as the harness sees it: a TOML file with command templates, capabilities and limits.
//! `harness/engines/README.md` says how one is written.
//!
//! Invariants: a capability is the presence of the words that ask for it, so that a description cannot
//! claim what it does not say how to do; an unknown key is an error; a placeholder that nothing fills is
//! an error before anything is run.

use super::paths::Paths;
use contract::case::Case;
use contract::manifest::Keep;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// An engine's description.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// What it is, in a sentence.
    pub about: String,
    /// The program that `{program}` stands for; `--mesher` replaces it.
    pub program: String,
    /// Command templates.
    pub run: Templates,
    /// What of a case it understands.
    #[serde(default)]
    pub takes: Takes,
    /// What is asked of it at most.
    #[serde(default)]
    pub limits: Limits,
    /// How a revision of it is built, for `harness gate --baseline REVISION`.
    pub build: Option<Build>,
    /// What selects it: a name in the repository, or a path.
    #[serde(skip)]
    pub name: String,
    /// The file's directory: `{here}`.
    #[serde(skip)]
    pub here: PathBuf,
}

/// Words of command lines. Those that are missing are things that the engine cannot do.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Templates {
    /// A serial run.
    pub serial: Vec<String>,
    /// A run on `{ranks}` processes.
    pub parallel: Option<Vec<String>>,
    /// A run on `{ranks}` ranks within one process, scheduled by `{seed}`.
    pub simulated: Option<Vec<String>>,
    /// Appended to write the leaf-set directory `{out}`.
    pub out: Vec<String>,
    /// Appended to write the record of the run to `{json}`.
    pub json: Option<Vec<String>>,
    /// Appended to keep what each rank is doing in `{status}`.
    pub status: Option<Vec<String>>,
    /// Appended to stop at the base tree.
    pub ungraded: Option<Vec<String>>,
    /// Added to the environment.
    #[serde(default)]
    pub environment: BTreeMap<String, String>,
}

/// What of a case file an engine understands.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Takes {
    /// `[generator]` and `root_scale`. Where not, it is given an STL file and the root that these mean.
    pub generator: bool,
    /// Extent boxes.
    pub boxes: bool,
    /// The values of `keep`.
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

/// What an engine is spared.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Deepest level.
    pub level_max: u8,
    /// Most facets.
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
    /// Run at the root of the revision's files; `{target}` is a directory for what it makes.
    pub command: Vec<String>,
    /// The program that comes of it.
    pub program: String,
}

/// What placeholders stand for.
pub type Values<'a> = BTreeMap<&'a str, String>;

impl Description {
    /// The description with this name in the repository, or at this path.
    ///
    /// # Errors
    /// One sentence, where there is none, or it is not what it should be.
    pub fn find(name: &str, paths: &Paths) -> Result<Self, String> {
        let path = match name.ends_with(".toml") {
            true => PathBuf::from(name),
            false => paths.engines.join(format!("{name}.toml")),
        };
        let wrong = |why: String| format!("{}: {why}", path.display());
        let text = std::fs::read_to_string(&path).map_err(|error| wrong(error.to_string()))?;
        let mut description = Self::parse(&text).map_err(wrong)?;
        description.name = name.to_owned();
        let here = path.parent().unwrap_or(Path::new(""));
        description.here = std::fs::canonicalize(here.join(".")).unwrap_or(here.to_owned());
        Ok(description)
    }

    fn parse(text: &str) -> Result<Self, String> {
        let description: Self =
            toml::from_str(text).map_err(|error| error.message().replace('\n', " "))?;
        let templates = &description.run;
        let known = [
            "program",
            "case",
            "out",
            "json",
            "status",
            "ranks",
            "seed",
            "partitioner",
            "level_base",
            "here",
            "root",
            "python",
            "mpirun",
            "target",
        ];
        let optional = [
            &templates.parallel,
            &templates.simulated,
            &templates.json,
            &templates.status,
            &templates.ungraded,
        ];
        let words =
            optional.into_iter().flatten().chain([&templates.serial, &templates.out]).flatten();
        for word in words.chain(templates.environment.values()) {
            if let Some(name) = placeholders(word).find(|name| !known.contains(name)) {
                return Err(format!(
                    "{{{name}}} stands for nothing; known are {}",
                    known.join(", ")
                ));
            }
        }
        Ok(description)
    }

    /// The program: what the command line gave, or what the file says.
    pub fn program(&self, paths: &Paths) -> PathBuf {
        match &paths.mesher_given {
            // A name without a slash would be looked for on the PATH.
            Some(given) => std::fs::canonicalize(given).unwrap_or_else(|_| given.clone()),
            None => PathBuf::from(fill(&self.program, &self.places(paths))),
        }
    }

    /// Where things are on this machine.
    pub fn places(&self, paths: &Paths) -> Values<'static> {
        let told = |path: &Path| path.to_string_lossy().into_owned();
        let beside = paths.harness.parent().unwrap_or(Path::new("."));
        Values::from([
            ("here", told(&self.here)),
            ("root", told(&paths.root)),
            ("target", told(beside)),
            ("python", told(&paths.python)),
            ("mpirun", told(&paths.mpirun)),
        ])
    }

    /// Why the engine is not run on a case; nothing if it is.
    pub fn declines(&self, case: &Case) -> Option<String> {
        let (level, facets) = (case.level_deepest(), case.facets.len() as u64);
        let name = &self.name;
        if level > self.limits.level_max {
            let most = self.limits.level_max;
            return Some(format!("{name} goes to level {most}, the case to {level}"));
        }
        if facets > self.limits.facets_max {
            let most = self.limits.facets_max;
            return Some(format!("{name} takes {most} facets, the case has {facets}"));
        }
        if !case.boxes.is_empty() && !self.takes.boxes {
            return Some(format!("{name} does not know extent boxes"));
        }
        if !self.takes.keep.contains(&case.keep) {
            return Some(format!("{name} does not know keep = {:?}", case.keep).to_lowercase());
        }
        if !case.keep_crossing && !self.takes.drop_crossing {
            return Some(format!("{name} does not know keep_crossing = false"));
        }
        None
    }
}

/// Names between braces.
fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    word.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name)
}

/// A word with its placeholders filled; those that have no value stay as they are.
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
    fn what_is_not_said_cannot_be_done() {
        let least = Description::parse(LEAST).unwrap();
        assert!(least.run.parallel.is_none() && least.run.json.is_none() && !least.takes.generator);
        assert_eq!(least.limits.level_max, 19);
    }

    #[test]
    fn mistakes_are_named() {
        let why = |text: &str| Description::parse(text).unwrap_err();
        assert!(why(&LEAST.replace("{case}", "{cas}")).contains("{cas} stands for nothing"));
        assert!(why(&format!("{LEAST}outt = []\n")).contains("outt"));
        assert!(why("about = 'x'").contains("program"));
    }

    #[test]
    fn cases_beyond_its_means_are_declined_with_the_reason() {
        let text =
            format!("{LEAST}[takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 3\n");
        let engine = Description::parse(&text).unwrap();
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";
        let declines = |case: &str| {
            engine.declines(&Case::from_parts(&case.replace("ROOT", root), vec![]).unwrap())
        };
        assert_eq!(declines("spacing_min = 1.0\nkeep = 'all'\nROOT"), None);
        assert!(declines("spacing_min = 0.5\nkeep = 'all'\nROOT").unwrap().contains("level 3"));
        assert!(declines("spacing_min = 1.0\nROOT").unwrap().contains("outside"));
        let boxed = "spacing_min = 1.0\nkeep = 'all'\nROOT[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                     max = [1.0, 1.0, 1.0]\nspacing = 1.0";
        assert!(declines(boxed).unwrap().contains("boxes"));
    }

    #[test]
    fn words_are_filled_once() {
        let values = Values::from([("case", "{out}".to_owned()), ("out", "o".to_owned())]);
        assert_eq!(fill("a{case}b", &values), "a{out}b");
        assert_eq!(fill("{none}", &values), "{none}");
    }
}
