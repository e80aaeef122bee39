//! The engine file: a TOML file with the command templates, capabilities, limits and promises of a mesher.
//! `harness/engines/README.md` explains how one is written.
//!
//! Invariants: an engine has a capability if and only if its file has the command template for it; unknown keys and
//! unknown placeholders are errors when the file is read.

use super::paths::Paths;
use super::templates::{LAUNCHER, Templates, Values, check_known};
use check::promises::{Independence, Promises, Touching};
use contract::case::{Case, explain};
use contract::failure::{Failure, Result};
use contract::manifest::{Enclosed, Keep};
use contract::octant::LEVEL_MAX;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Our own engine files, which belong to the version of the harness.
const OWN: [(&str, &str); 2] = [
    ("mesher", include_str!("../../../engines/mesher.toml")),
    ("reference", include_str!("../../../engines/reference.toml")),
];

/// Whether an engine of this repository has this name.
pub fn is_own(name: &str) -> bool {
    OWN.iter().any(|(own, _)| *own == name)
}

/// The page that has an example of every key.
const PAGE: &str = include_str!("../../../engines/README.md");

/// An engine file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Description {
    /// A sentence about the engine.
    pub about: String,
    /// The program, `{program}` in templates; by default the first word of `serial`. The command line may name another
    /// one.
    pub program: String,
    /// Command templates. A file without them states promises only, and its engine cannot be run.
    pub run: Templates,
    /// Features of a case that the engine supports.
    pub takes: Takes,
    /// Limits on cases.
    pub limits: Limits,
    /// What its meshes guarantee; by default the definition.
    #[serde(default = "Promises::of_definition")]
    pub promises: Promises,
    /// Whether the run report has the peak memory, so that the harness need not sample it.
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

/// How a revision is built.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Build {
    /// Run in the root directory of the revision, `{root}`. `{target}` is a directory for the results, which are kept whole.
    pub command: Vec<String>,
    /// The program that the command builds.
    pub program: String,
}

/// What an engine lacks whose meshes depend on the number of ranks.
pub const EQUAL_RANKS: &str = "equal meshes on any number of ranks";

/// What an engine lacks that is not deterministic.
pub const EQUAL_RUNS: &str = "equal meshes from equal runs";

/// The word of a command that names its program, which may follow variables of the environment: `env THREADS=4 my-mesher`.
fn named_program(words: &[String]) -> Option<&String> {
    let mut rest = words.iter().skip_while(|word| *word == "env" || word.contains('='));
    let is_env = words.first().is_some_and(|first| first == "env");
    rest.next().filter(|word| is_env && !word.starts_with('-')).or(words.first())
}

/// Features of a case file that an engine supports.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Takes {
    /// `[generator]` and `root_scale`. If not, the engine is given a binary STL file and an explicit root.
    pub generator: bool,
    /// Extent boxes.
    pub boxes: bool,
    /// Values of `keep`.
    pub keep: Vec<Keep>,
    /// `keep_crossing = false`.
    pub drop_crossing: bool,
    /// `seeds`.
    pub seeds: bool,
    /// `enclosed = "keep"`. The default, `delete`, cannot be declined: whether anything is enclosed is known after
    /// meshing only.
    pub keep_enclosed: bool,
}

impl Default for Takes {
    fn default() -> Self {
        let (boxes, drop_crossing) = (true, true);
        let [generator, seeds, keep_enclosed] = [false; 3];
        let keep = vec![Keep::Outside, Keep::Inside, Keep::All];
        Self { generator, boxes, keep, drop_crossing, seeds, keep_enclosed }
    }
}

/// Limits: the engine is not run on a case beyond them.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Deepest level.
    pub level_max: Option<u8>,
    /// Greatest number of facets.
    pub facets_max: Option<u64>,
}

impl Description {
    /// Reads the engine file with this name in the repository, or at this path if it ends in `.toml`.
    ///
    /// # Errors
    /// One sentence, if the file is missing or wrong.
    pub fn find(name: &str, paths: &Paths) -> Result<Self> {
        let engines = paths.root.join("harness/engines");
        let path = match name.ends_with(".toml") {
            true => PathBuf::from(name),
            false => engines.join(format!("{name}.toml")),
        };
        let text = match OWN.iter().find(|(own, _)| *own == name) {
            Some((_, text)) => (*text).to_owned(),
            None => {
                let (file, engines) = (path.display(), engines.display());
                let why = format!("give a name in {engines}, or a path that ends in .toml");
                Failure::unless(path.exists(), format!("{file} does not exist: {why}"))?;
                contract::files::read_text(&path).map_err(|error| Failure::at(&path, error))?
            }
        };
        let here = path.parent().unwrap_or(Path::new(""));
        let here = std::fs::canonicalize(here.join(".")).unwrap_or(here.to_owned());
        let parsed = Self::parse(&text).map_err(|why| why.of_file(&path))?;
        Ok(Self { name: name.to_owned(), here, ..parsed })
    }

    /// Parses an engine file.
    ///
    /// # Errors
    /// One sentence, if it is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let page = PAGE.split_once("## Promises").map_or(PAGE, |(_, page)| page);
        let mut description: Self = toml::from_str(text).map_err(|e| explain(text, &e, page))?;
        geometries::refuse_surplus::<Self>(text)?;
        description.promises.fault().map_or(Ok(()), |why| Err(Failure::input(why)))?;
        let templates = &mut description.run;
        if let Some(first) = named_program(&templates.serial).cloned() {
            check_known("program", &[first.clone(), description.program.clone()], &[])?;
            if description.program.is_empty() {
                // So that another program can be run.
                let Templates { serial, parallel, simulated, .. } = templates;
                let words = [serial, parallel, simulated].into_iter().flatten();
                words.filter(|word| **word == first).for_each(|word| *word = "{program}".into());
                description.program = first;
            }
            templates.check_placeholders()?;
            templates.check_promises(&description.promises)?;
        }
        Ok(description)
    }

    /// Values of the placeholders for paths on this machine.
    pub fn places(&self, paths: &Paths) -> Values<'static> {
        let places = [
            ("here", &*self.here),
            ("root", &paths.root),
            ("target", paths.harness.parent().unwrap_or(Path::new("."))),
            ("python", &paths.python),
            ("mpirun", &paths.mpirun),
        ];
        places.map(|(name, path)| (name, path.to_string_lossy().into_owned())).into()
    }

    /// Why the engine is not run on a case; `None` if it is.
    pub fn declines(&self, case: &Case) -> Option<String> {
        let (takes, limits) = (&self.takes, &self.limits);
        let (level, facets) = (case.level_deepest(), case.facets.len() as u64);
        let keep = format!("{:?}", case.keep).to_lowercase();
        let is_deeper = limits.level_max.is_some_and(|max| level > max);
        let has_more = limits.facets_max.is_some_and(|max| facets > max);
        let drops_crossing = !case.keep_crossing && !takes.drop_crossing;
        let keeps_enclosed = case.enclosed == Enclosed::Keep && !takes.keep_enclosed;
        let beyond = [
            (is_deeper, format!("level {level} (level_max in [limits])")),
            (has_more, format!("{facets} facets (facets_max in [limits])")),
            (!case.boxes.is_empty() && !takes.boxes, "extent boxes (boxes in [takes])".to_owned()),
            (drops_crossing, "keep_crossing = false (drop_crossing in [takes])".to_owned()),
            (!case.seeds.is_empty() && !takes.seeds, "seeds (seeds in [takes])".to_owned()),
            (keeps_enclosed, "enclosed = keep (keep_enclosed in [takes])".to_owned()),
            (!takes.keep.contains(&case.keep), format!("keep = {keep} (keep in [takes])")),
        ];
        let (_, what) = beyond.into_iter().find(|(is_beyond, _)| *is_beyond)?;
        Some(format!("{} does not support {what}", self.name))
    }

    /// What the engine does not do or promise, in a few words each, for comparisons; empty if it keeps the whole definition on any
    /// number of ranks.
    pub fn lacks(&self) -> Vec<String> {
        let (promises, takes) = (&self.promises, &self.takes);
        let promised = |has: bool| has || promises.definition;
        let parallel = !self.run.parallel.is_empty();
        let is_launched = !parallel || self.run.parallel.concat().contains(LAUNCHER);
        let of_ranks = promises.is_independent_of(Independence::Ranks);
        let features = [
            (promised(promises.complete), "meshes without holes"),
            (promised(promises.surface.is_some()), "the asked level at the surface"),
            (promised(promises.balance.is_some()), "2:1 balance over faces"),
            (promised(promises.balance == Some(Touching::Corner)), "2:1 balance over corners"),
            (promised(promises.layers), "layers"),
            (takes.boxes && promised(promises.boxes), "extent boxes"),
            (promised(promises.sides.is_some()), "inside and outside"),
            (takes.keep.iter().any(|keep| *keep != Keep::All), "deletion of either side"),
            (takes.seeds, "seeds"),
            (promises.is_deterministic(), EQUAL_RUNS),
            (parallel, "MPI"),
            (is_launched, "a choice of the launcher"),
            (!parallel || of_ranks, EQUAL_RANKS),
        ];
        let missing = features.into_iter().filter(|(has, _)| !has).map(|(_, name)| name.to_owned());
        let deepest = self.limits.level_max.filter(|level| *level < LEVEL_MAX);
        missing.chain(deepest.map(|level| format!("levels beyond {level}"))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "about = 'x'\nprogram = '{here}/m.py'\n[run]\nserial = ['{program}', '{case}']\n\
                         out = ['--out', '{out}']\n";

    const LEAST_FILE: &str = "[run]\nserial = ['m', '{case}', '{out}']\n";

    #[test]
    fn our_own_engine_files_are_valid() {
        for (name, text) in OWN {
            let own = Description::parse(text).unwrap();
            assert!(!own.run.json.is_empty() && own.promises.definition, "{name}");
        }
    }

    #[test]
    fn an_engine_file_needs_nothing_but_a_command() {
        let text = "[run]\nserial = ['meshit', '{case}', '{out}']\nparallel = ['{launcher}', 'meshit', '{case}', '{out}']";
        let least = Description::parse(text).unwrap();
        assert_eq!(least.program, "meshit");
        assert_eq!(least.run.serial, ["{program}", "{case}", "{out}"]);
        assert_eq!(least.run.parallel[1], "{program}");
        assert!(least.run.always_writes_mesh() && least.promises.definition);
        let least_with = |case| format!("[run]\nserial = ['meshit']\nout = [{case}'{{out}}']\n");
        let nowhere = Description::parse("[run]\nserial = ['meshit', '{case}']").unwrap_err().why;
        assert!(nowhere.contains("`serial` has no {out}"), "{nowhere}");
        let of_any = Description::parse(&least_with("")).unwrap_err().why;
        assert!(of_any.contains("`serial` has no {case}"), "{of_any}");
        assert!(Description::parse(&least_with("'{case}', ")).is_ok());
    }

    #[test]
    fn a_missing_template_is_a_missing_capability() {
        let least = Description::parse(LEAST).unwrap();
        assert!(
            least.run.parallel.is_empty() && least.run.json.is_empty() && !least.takes.generator
        );
        assert_eq!((least.limits.level_max, least.run.always_writes_mesh()), (None, true));
    }

    #[test]
    fn errors_name_the_invalid_key_or_placeholder() {
        let why = |text: &str| Description::parse(text).unwrap_err().why;
        let unknown = why(&LEAST.replace("{case}", "{cas}"));
        assert!(unknown.contains("`serial` has the unknown placeholder {cas}"), "{unknown}");
        assert!(why(&LEAST.replace("'{case}'", "'{launcher}'")).contains("{launcher}"));
        assert!(why(&format!("{LEAST}status = ['{{out}}']\n")).contains("`status`"));
        assert!(why(&format!("{LEAST}outt = []\n")).contains("outt"));
        assert!(why(&format!("{LEAST}serve = ['{{case}}']\n")).contains("`serve`"));
        let lacking = [
            ("parallel = ['mpirun', '{program}', '{case}']", "`parallel` has no {ranks}"),
            ("simulated = ['{program}', '{case}']", "`simulated` has no {ranks}"),
            ("partitioner = ['--metis']", "`partitioner` has no {partitioner}"),
        ];
        for (line, expected) in lacking {
            let why = why(&format!("{LEAST}{line}\n"));
            assert!(why.contains(expected), "{why}");
        }
        let first = |words: &str| Description::parse(&LEAST_FILE.replace("'m'", words));
        let program = |words| first(words).unwrap().program;
        let words = ["'env', 'A=1', 'm'", "'env', '-i', 'm'", "'a=1/m'", "'env', 'm'"];
        assert_eq!(words.map(program), ["m", "env", "a=1/m", "m"]);
        assert!(first("'{hree}/m'").unwrap_err().why.contains("unknown placeholder {hree}"));
    }

    #[test]
    fn a_program_that_no_command_names_cannot_be_replaced() {
        let two = "parallel = ['mpirun', '-n', '{ranks}', 'of-ranks', '{case}', '{out}']\n";
        let run = |more| Description::parse(&format!("{LEAST_FILE}{more}")).unwrap().run;
        assert!(run("").check_other_program().is_ok());
        let of_ranks = Description::parse(&format!("{LEAST_FILE}{two}")).unwrap().lacks();
        assert!(of_ranks.contains(&"a choice of the launcher".to_owned()), "{of_ranks:?}");
        let why = run(two).check_other_program().unwrap_err().why;
        assert!(why.contains("has no {program}"), "{why}");
    }

    #[test]
    fn a_promise_that_no_command_could_show_is_refused() {
        let with = |of: &str, more: &str| {
            Description::parse(&format!(
                "{LEAST_FILE}{more}[promises]\nindependent_of = ['{of}']\n"
            ))
        };
        for of in ["ranks", "partitioner"] {
            assert!(with(of, "").unwrap_err().why.contains("with which to vary it"), "{of}");
        }
        let ranks = "parallel = ['{launcher}', 'm', '{case}', '{out}']\n";
        let parallel = &format!("{ranks}partitioner = ['{{partitioner}}']\n");
        let alone = with("partitioner", parallel).unwrap_err().why;
        assert!(alone.contains("add \"ranks\""), "{alone}");
        assert!(with("ranks', 'partitioner", parallel).is_ok());
        assert!(with("ranks", ranks).is_ok());
        let empty = Description::parse(&format!("{LEAST_FILE}[promises]\n")).unwrap_err().why;
        assert!(empty.contains("[promises] is empty"), "{empty}");
    }

    #[test]
    fn our_mesher_lacks_nothing_and_a_simple_one_what_it_does_not_promise() {
        let own = Description::parse(include_str!("../../../engines/mesher.toml")).unwrap();
        assert_eq!(own.lacks(), [""; 0]);
        let text = "[run]\nserial = ['m', '{case}', '{out}']\n[takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 14\n\
                    [promises]\ncomplete = true\nsurface = { tolerance_cells = 0.0 }\nbalance = 'edge'\ndeterministic = true\n";
        let lacks = Description::parse(text).unwrap().lacks().join("; ");
        let expected = "2:1 balance over corners; layers; extent boxes; inside and outside; deletion of either side; \
                        seeds; MPI; levels beyond 14";
        assert_eq!(lacks, expected);
    }

    #[test]
    fn a_case_beyond_the_capabilities_is_declined_with_the_reason() {
        let text = "[run]\nserial = ['m', '{case}', '{out}']\n\
                    [takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 3\n";
        let engine = Description::parse(text).unwrap();
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";
        let declines = |case: &str| {
            engine.declines(&Case::from_parts(&case.replace("ROOT", root), vec![]).unwrap())
        };
        assert_eq!(declines("spacing_min = 1.0\nkeep = 'all'\nROOT"), None);
        let deep = declines("spacing_min = 0.5\nkeep = 'all'\nROOT").unwrap();
        assert!(deep.ends_with("does not support level 4 (level_max in [limits])"), "{deep}");
        assert!(declines("spacing_min = 1.0\nROOT").unwrap().contains("outside"));
        let seeds = declines("spacing_min = 1.0\nkeep = 'all'\nseeds = [[1, 1, 1]]\nROOT").unwrap();
        assert!(seeds.ends_with("does not support seeds (seeds in [takes])"), "{seeds}");
        let enclosed =
            declines("spacing_min = 1.0\nkeep = 'all'\nenclosed = 'keep'\nROOT").unwrap();
        assert!(enclosed.ends_with("enclosed = keep (keep_enclosed in [takes])"), "{enclosed}");
        let boxed = "spacing_min = 1.0\nkeep = 'all'\nROOT[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                     max = [1.0, 1.0, 1.0]\nspacing = 1.0";
        assert!(declines(boxed).unwrap().contains("boxes"));
    }
}
