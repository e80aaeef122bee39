//! Reads a study file: series of runs, and meshes, runs and rows by name. reports/README.md describes the format.
//!
//! Invariants of the [`Study`] that [`Study::read`] returns: it has a series or a row; every name that is used is declared; a row
//! has exactly the runs, the other run and the phase that its measure requires.

use super::measure::{Kind, Measure};
use crate::experiments::entry::{Comm, Setup};
use run::engine::description::{Description, is_own};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// The [`Setup::experiment`] of runs for targets.
pub const EXPERIMENT: &str = "targets";
/// Valid numbers of cells.
const CELLS: std::ops::RangeInclusive<f64> = 1e3..=1e12;
/// Maximum number of ranks.
const RANKS_MAX: usize = 65_536;

/// A study file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Meshes by name.
    #[serde(default)]
    pub mesh: BTreeMap<String, Mesh>,
    /// Runs by name.
    #[serde(default)]
    pub run: BTreeMap<String, RunSpec>,
    /// The rows, in order.
    #[serde(default)]
    pub row: Vec<Row>,
    /// The series, in order.
    #[serde(default)]
    pub series: Vec<Series>,
    /// Directory of the file; paths are relative to it.
    #[serde(skip)]
    pub directory: PathBuf,
}

/// A mesh.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// A name in geometries/catalogue.toml, or the path of a case file.
    pub case: Option<String>,
    /// An STL file, as an alternative to `case`.
    pub geometry: Option<PathBuf>,
    /// A generated shape, as an alternative to `case`: the `[generator]` table of a case file.
    pub generator: Option<toml::Table>,
    /// Root edge in longest edges of the bounding box; with `geometry` and `generator` only.
    pub root_scale: Option<f64>,
    /// n; replaces that of the case.
    pub layer_cells_min: Option<u32>,
    /// The spacing; replaces that of the case, in the same root.
    pub spacing_min: Option<f64>,
    /// Approximate number of cells, with `case` only: the spacing is extrapolated from coarser meshes, and the root fits it.
    pub cells: Option<f64>,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSpec {
    /// Name of the mesh.
    pub mesh: String,
    /// Number of ranks.
    #[serde(default = "one")]
    pub ranks: usize,
    /// How ranks communicate.
    #[serde(default = "mpi")]
    pub comm: Comm,
    /// `metis` or `morton`; the default of the mesher if empty.
    #[serde(default)]
    pub partitioner: String,
    /// `unit`, `area` or `rebalance`; the default of the mesher if empty.
    #[serde(default)]
    pub weights: String,
    /// Number of repetitions; results are their medians.
    #[serde(default = "one")]
    pub repeats: usize,
    /// Whether an uncounted run precedes the first run of a mesh. Default: true if the run is repeated.
    pub warm_up: Option<bool>,
    /// Whether the mesh is written to the record's disk and audited, instead of timing the mesher.
    #[serde(default)]
    pub audit: bool,
}

/// A kind of experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Experiment {
    /// The same mesh on increasingly many ranks.
    Strong,
    /// The same number of cells per rank on increasingly many ranks; the spacing is chosen accordingly.
    Weak,
    /// Spacings that differ by factors of two.
    Spacing,
    /// The same spacing with increasing minimum layer thickness n.
    Layers,
    /// Weights of base leaves and partitioners.
    Weights,
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&crate::name_of(self))
    }
}

/// A series of runs on one case.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Series {
    /// The kind of experiment.
    pub experiment: Experiment,
    /// A name in geometries/catalogue.toml, or the path of a case file.
    pub case: String,
    /// Cells, each a series: of the mesh (strong, weights), per rank (weak), of the largest mesh (spacing), at the case's n (layers).
    /// If empty, the case's own spacing.
    #[serde(default)]
    pub cells: Vec<f64>,
    /// The programs, which mesh the same cases in turn: names in harness/engines, or engine files.
    #[serde(default = "mesher")]
    pub engines: Vec<String>,
    /// Values of n; if empty, that of the case.
    #[serde(default)]
    pub layers: Vec<u32>,
    /// Numbers of simulated ranks.
    #[serde(default)]
    pub sim: Vec<usize>,
    /// Numbers of ranks on MPI. Without any ranks, the program is run serially.
    #[serde(default)]
    pub mpi: Vec<usize>,
    /// Number of repetitions, after a warm-up.
    #[serde(default = "one")]
    pub repeats: usize,
}

/// Weights and partitioner of a run, empty to leave the choice to the program, and how many cells an exposed face weighs, if these faces
/// are counted.
pub(super) type Choice = (&'static str, &'static str, Option<u32>);

/// The choices of the experiment on weights, which counts exposed faces. `rebalance` with METIS is identical to `area`;
/// in the last row an exposed face weighs as much as ten cells.
const CHOICES: [Choice; 6] = [
    ("unit", "metis", Some(0)),
    ("unit", "morton", Some(0)),
    ("area", "metis", Some(0)),
    ("area", "morton", Some(0)),
    ("rebalance", "morton", Some(0)),
    ("rebalance", "morton", Some(10)),
];

impl Series {
    /// Returns the numbers of cells, or that of the case.
    pub fn sizes(&self) -> Vec<Option<f64>> {
        match self.cells.is_empty() {
            true => vec![None],
            false => self.cells.iter().copied().map(Some).collect(),
        }
    }

    /// Returns the partitions that are compared.
    pub(super) fn choices(&self) -> &'static [Choice] {
        match self.experiment {
            Experiment::Weights => &CHOICES,
            _ => &[("", "", None)],
        }
    }

    /// Returns the ranks on which an engine is run: those of the series that it offers. A serial run replaces ranks on MPI that
    /// are missing; nothing can replace the ranks of experiments about ranks.
    pub fn layouts(&self, engine: &Description, no_mpi: bool) -> Vec<(Comm, usize)> {
        let has_mpi = engine.run.parallel.is_some() && !no_mpi;
        let sim = self.sim.iter().filter(|_| engine.run.simulated.is_some());
        let mpi = self.mpi.iter().filter(|_| has_mpi);
        let mut all: Vec<(Comm, usize)> =
            sim.map(|r| (Comm::Sim, *r)).chain(mpi.map(|r| (Comm::Mpi, *r))).collect();
        let is_about_ranks = matches!(self.experiment, Experiment::Weak | Experiment::Weights);
        if self.experiment == Experiment::Weights && !is_own(&engine.name) {
            return Vec::new();
        }
        if !is_about_ranks && (all.is_empty() || !self.mpi.is_empty() && !has_mpi) {
            all.push((Comm::Solo, 1));
        }
        all
    }

    fn check(&self) -> Result<(), String> {
        let wrong = |why: &str| Err(format!("series {} of {}: {why}", self.experiment, self.case));
        let ranks = || self.sim.iter().chain(&self.mpi);
        match self.experiment {
            _ if !ranks().all(|ranks| (1..=RANKS_MAX).contains(ranks)) => {
                wrong("ranks are from 1 to 65536")
            }
            _ if self.repeats == 0 => wrong("repeats is at least 1"),
            _ if self.engines.is_empty() => wrong("it has no engines"),
            _ if !self.cells.iter().all(|cells| CELLS.contains(cells)) => {
                wrong("cells is from 1e3 to 1e12")
            }
            Experiment::Weak if self.cells.is_empty() => wrong("give the cells of a rank"),
            Experiment::Weak | Experiment::Weights if ranks().next().is_none() => {
                wrong("give ranks")
            }
            Experiment::Layers if self.layers.is_empty() => wrong("give layers"),
            _ => Ok(()),
        }
    }
}

fn mesher() -> Vec<String> {
    vec!["mesher".to_owned()]
}

fn one() -> usize {
    1
}

fn mpi() -> Comm {
    Comm::Mpi
}

/// A target.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The name, used by `--only`.
    pub name: String,
    /// One or several runs. Each of several runs has its own row, unless the measure is that of a series.
    pub run: OneOrMany,
    /// The run with which it is compared.
    pub against: Option<String>,
    /// The measure.
    pub measure: Measure,
    /// The phase or phases, for measures of phases.
    pub phase: Option<OneOrMany>,
    /// Lower bound.
    pub at_least: Option<f64>,
    /// Upper bound.
    pub at_most: Option<f64>,
}

/// Names of runs or phases.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum OneOrMany {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

impl OneOrMany {
    /// Returns all names.
    pub fn all(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Many(names) => names,
        }
    }
}

impl Study {
    /// Reads a file.
    ///
    /// # Errors
    /// One sentence with the file, the position and the error.
    pub fn read(path: &Path) -> Result<Self, String> {
        let wrong = |why: String| format!("{}: {why}", path.display());
        let text = contract::files::read_text(path).map_err(|error| wrong(error.to_string()))?;
        let mut study: Self = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        study.directory = path.parent().unwrap_or(Path::new(".")).to_owned();
        study.check().map_err(wrong)?;
        study.row = study.row.iter().flat_map(each_run).collect();
        Ok(study)
    }

    /// Keeps only the rows and the experiments with these names, or all if no name is given.
    ///
    /// # Errors
    /// If no row and no experiment has one of the names.
    pub fn only(&mut self, names: &[String]) -> Result<(), String> {
        let is_row = |row: &Row, name: &String| row.name == *name || row.family() == name;
        let is_series = |series: &Series, name: &String| series.experiment.to_string() == *name;
        let is_known = |name: &&String| {
            self.row.iter().any(|row| is_row(row, name))
                || self.series.iter().any(|series| is_series(series, name))
        };
        if let Some(name) = names.iter().find(|name| !is_known(name)) {
            return Err(format!("no row and no experiment is called {name:?}"));
        }
        self.row.retain(|row| names.is_empty() || names.iter().any(|name| is_row(row, name)));
        self.series.retain(|one| names.is_empty() || names.iter().any(|name| is_series(one, name)));
        Ok(())
    }

    /// Returns the programs of all series, and the mesher if a row needs it, each once.
    pub fn engines(&self) -> Vec<String> {
        let mut engines: Vec<String> = Vec::new();
        let of_rows = (!self.row.is_empty()).then(mesher).unwrap_or_default();
        for engine in self.series.iter().flat_map(|series| series.engines.clone()).chain(of_rows) {
            if !engines.contains(&engine) {
                engines.push(engine);
            }
        }
        engines
    }

    /// Returns the runs that a row needs: its own and the one with which it is compared.
    pub fn runs_of<'a>(&self, row: &'a Row) -> Vec<&'a String> {
        row.run.all().iter().chain(&row.against).collect()
    }

    /// Whether a setup of a record is the run of this name.
    pub fn is_run(&self, name: &str, setup: &Setup) -> bool {
        let Some(run) = self.run.get(name) else { return false };
        let mesh = &self.mesh[&run.mesh];
        setup.experiment == EXPERIMENT
            && setup.case == run.mesh
            && (setup.ranks, setup.comm) == (run.ranks, run.comm)
            && (&setup.partitioner, &setup.weights) == (&run.partitioner, &run.weights)
            && mesh.spacing_min.is_none_or(|s| s == setup.spacing_min)
            && mesh.layer_cells_min.is_none_or(|n| n == setup.layer_cells_min)
    }

    fn check(&self) -> Result<(), String> {
        if self.row.is_empty() && self.series.is_empty() {
            return Err("it has no [[series]] and no [[row]]".to_owned());
        }
        self.series.iter().try_for_each(Series::check)?;
        self.mesh.iter().try_for_each(|(name, mesh)| mesh.check(name))?;
        self.run.iter().try_for_each(|(name, run)| self.check_run(name, run))?;
        self.row.iter().try_for_each(|row| self.check_row(row))?;
        let mut names = BTreeSet::new();
        match self.row.iter().find(|row| !names.insert(&row.name)) {
            Some(row) => Err(format!("two rows are called {:?}", row.name)),
            None => Ok(()),
        }
    }

    fn check_run(&self, name: &str, run: &RunSpec) -> Result<(), String> {
        let wrong = |why: String| Err(format!("run {name}: {why}"));
        if !self.mesh.contains_key(&run.mesh) {
            return wrong(format!("no mesh is called {:?}", run.mesh));
        }
        if !(1..=RANKS_MAX).contains(&run.ranks) || run.comm == Comm::Solo && run.ranks != 1 {
            return wrong(format!("it cannot have {} ranks", run.ranks));
        }
        if run.repeats == 0 {
            return wrong("repeats is at least 1".to_owned());
        }
        Ok(())
    }

    fn check_row(&self, row: &Row) -> Result<(), String> {
        let wrong = |why: String| Err(format!("row {:?}: {why}", row.name));
        if let Some(name) = self.runs_of(row).into_iter().find(|n| !self.run.contains_key(*n)) {
            return wrong(format!("no run is called {name:?}"));
        }
        let kind = row.measure.kind();
        let needs_other = kind == Kind::Against;
        if needs_other != row.against.is_some() {
            let what = if needs_other { "requires" } else { "does not accept" };
            return wrong(format!("{} {what} a run in `against`", row.measure));
        }
        let phase = row.measure == Measure::PhaseShare;
        if phase != row.phase.is_some() {
            let what = if phase { "requires" } else { "does not accept" };
            return wrong(format!("{} {what} a name in `phase`", row.measure));
        }
        let least = if kind == Kind::Series { 2 } else { 1 };
        if row.run.all().len() < least {
            return wrong(format!("{} requires {least} or more runs", row.measure));
        }
        let audit = kind == Kind::Audit;
        if let Some(name) = row.run.all().iter().find(|n| self.run[*n].audit != audit) {
            let what = if audit { "a run with audit = true" } else { "no run with audit = true" };
            return wrong(format!("{} is measured of {what}, which {name} is not", row.measure));
        }
        Ok(())
    }
}

impl Mesh {
    fn check(&self, name: &str) -> Result<(), String> {
        let wrong = |why: &str| Err(format!("mesh {name}: {why}"));
        let given = [self.case.is_some(), self.geometry.is_some(), self.generator.is_some()];
        if given.iter().filter(|&&g| g).count() != 1 {
            return wrong("give one of case, geometry and [generator]");
        }
        if self.case.is_some() && self.root_scale.is_some() {
            return wrong("the case defines root_scale");
        }
        if self.case.is_none() && (self.spacing_min.is_none() || self.cells.is_some()) {
            return wrong("without a case, spacing_min is required and cells is not allowed");
        }
        if self.spacing_min.is_some() && self.cells.is_some() {
            return wrong("give spacing_min or cells, not both");
        }
        if self.cells.is_some_and(|cells| !CELLS.contains(&cells)) {
            return wrong("cells is from 1e3 to 1e12");
        }
        Ok(())
    }
}

impl Row {
    /// Returns the row's name in the file, without the appended name of the run.
    fn family(&self) -> &str {
        match self.run.all() {
            [run] => self.name.strip_suffix(&format!(": {run}")).unwrap_or(&self.name),
            _ => &self.name,
        }
    }
}

/// Splits a row of several runs into one row for each, unless its measure is that of a series.
fn each_run(row: &Row) -> Vec<Row> {
    let OneOrMany::Many(names) = &row.run else { return vec![row.clone()] };
    if row.measure.kind() == Kind::Series {
        return vec![row.clone()];
    }
    let of = |name: &String| Row {
        name: format!("{}: {name}", row.name),
        run: OneOrMany::One(name.clone()),
        ..row.clone()
    };
    names.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::study as read;

    const FILE: &str = r#"
        [mesh.cube]
        case = "cube-small"
        spacing_min = 0.1
        [run]
        one = { mesh = "cube", repeats = 3 }
        two = { mesh = "cube", ranks = 2, comm = "sim", weights = "area" }
        disk = { mesh = "cube", audit = true }
        [[row]]
        name = "rate"
        run = ["one", "two"]
        measure = "cells_per_second_per_core"
        at_least = 1e6
        [[row]]
        name = "speed-up"
        run = "two"
        against = "one"
        measure = "speed_up"
        [[row]]
        name = "growth"
        run = ["one", "two"]
        measure = "time_per_cell_growth"
        at_most = 1.05
        [[row]]
        name = "audit"
        run = "disk"
        measure = "audit_holds"
    "#;

    #[test]
    fn several_runs_are_several_rows_except_for_a_series() {
        let mut study = read(FILE).unwrap();
        let names = |t: &Study| t.row.iter().map(|r| r.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&study), ["rate: one", "rate: two", "speed-up", "growth", "audit"]);
        assert!(study.only(&["rat".to_owned()]).unwrap_err().contains("\"rat\""));
        study.only(&["rate".to_owned(), "growth".to_owned()]).unwrap();
        assert_eq!(names(&study), ["rate: one", "rate: two", "growth"]);
    }

    fn of_repository(name: &str) -> Study {
        let reports = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reports");
        Study::read(&reports.join(name)).unwrap()
    }

    #[test]
    fn the_targets_of_this_repository_are_consistent() {
        let study = of_repository("targets.toml");
        // A run that no row needs is a mistake.
        let used = |name| study.row.iter().any(|r| study.runs_of(r).contains(&name));
        let unused: Vec<&String> = study.run.keys().filter(|name| !used(name)).collect();
        assert!(unused.is_empty(), "{unused:?}");
    }

    #[test]
    fn the_series_of_this_repository_have_every_experiment() {
        use Experiment::{Layers, Spacing, Strong, Weak, Weights};
        for name in ["small.toml", "full.toml"] {
            let study = of_repository(name);
            let has = |experiment| study.series.iter().any(|s| s.experiment == experiment);
            assert!([Strong, Weak, Spacing, Layers, Weights].into_iter().all(has), "{name}");
        }
    }

    #[test]
    fn ranks_that_an_engine_does_not_offer_are_replaced_by_a_serial_run_or_left_out() {
        let paths = run::engine::paths::Paths::find();
        let find = |name| Description::find(name, &paths).unwrap();
        let [own, parallel, serial] = ["mesher", "p4est", "discretize"].map(find);
        let mut study = of_repository("small.toml");
        let of = |series: &Series, engine, no_mpi| series.layouts(engine, no_mpi);
        let (sim, solo) = ((Comm::Sim, 64), (Comm::Solo, 1));
        study.series.retain(|series| series.experiment == Experiment::Strong);
        let strong = &study.series[0];
        assert_eq!(of(strong, &own, false).len(), strong.sim.len() + strong.mpi.len());
        assert!(of(strong, &own, true).ends_with(&[sim, solo]));
        assert_eq!(of(strong, &parallel, false).len(), strong.mpi.len());
        assert_eq!(of(strong, &serial, false), [solo]);
        let weak = Series { experiment: Experiment::Weak, ..strong.clone() };
        assert!(of(&weak, &serial, false).is_empty());
        let weights = Series { experiment: Experiment::Weights, ..strong.clone() };
        assert!(of(&weights, &parallel, false).is_empty());
        assert_eq!((weights.choices().len(), strong.choices()), (6, &[("", "", None)][..]));
    }

    #[test]
    fn series_are_selected_by_their_experiment_and_contradictions_are_reported() {
        let text = "[[series]]\nexperiment = 'strong'\ncase = 'cube'\nsim = [1, 2]\n\
                    [[series]]\nexperiment = 'weak'\ncase = 'cube'\ncells = [1e4]\nmpi = [1]\n";
        let mut study = read(text).unwrap();
        study.only(&["weak".to_owned()]).unwrap();
        assert_eq!((study.series.len(), study.engines()), (1, vec!["mesher".to_owned()]));
        for (from, to, why) in [
            ("[1, 2]", "[0]", "ranks are from 1"),
            ("cells = [1e4]", "cells = [1.0]", "cells is from 1e3"),
            ("cells = [1e4]", "", "give the cells of a rank"),
            ("mpi = [1]", "", "give ranks"),
            ("'strong'", "'layers'", "give layers"),
            ("'strong'", "'luck'", "unknown variant"),
            ("sim", "repeats = 0\nsim", "repeats is at least 1"),
        ] {
            let found = read(&text.replacen(from, to, 1)).unwrap_err();
            assert!(found.contains(why), "{why} is not in: {found}");
        }
    }

    #[test]
    fn contradictions_are_reported() {
        for (from, to, why) in [
            ("mesh = \"cube\", repeats", "mesh = \"ball\", repeats", "run one: no mesh"),
            ("repeats = 3", "repeats = 0", "run one: repeats"),
            ("ranks = 2, comm = \"sim\"", "ranks = 2, comm = \"solo\"", "cannot have 2 ranks"),
            ("against = \"one\"", "", "\"speed-up\": speed_up requires a run in `against`"),
            ("against = \"one\"", "against = \"three\"", "no run is called \"three\""),
            ("run = \"disk\"", "run = \"one\"", "which one is not"),
            ("\"speed_up\"", "\"phase_share\"", "does not accept a run"),
            ("spacing_min = 0.1", "spacing_min = 0.1\ncells = 1e6", "not both"),
            ("spacing_min = 0.1", "cells = 5", "from 1e3 to 1e12"),
            (
                "case = \"cube-small\"",
                "case = \"cube-small\"\nroot_scale = 3.0",
                "the case defines",
            ),
            (
                "case = \"cube-small\"\n        spacing_min = 0.1",
                "geometry = \"a.stl\"",
                "spacing_min is required",
            ),
            ("case = \"cube-small\"", "", "give one of"),
            ("measure = \"speed_up\"", "measure = \"speed\"", "unknown variant"),
            ("at_least", "atleast", "unknown field"),
            ("name = \"growth\"", "name = \"rate\"", "two rows are called \"rate\""),
        ] {
            assert!(FILE.contains(from), "{from}");
            let found = read(&FILE.replacen(from, to, 1)).unwrap_err();
            assert!(found.starts_with("FILE: ") && found.contains(why), "{why} is not in: {found}");
        }
        assert!(read("").unwrap_err().contains("no [[series]] and no [[row]]"));
    }
}
