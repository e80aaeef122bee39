//! Reads a study file: series of runs, and meshes, runs and rows by name. reports/README.md describes the format.
//!
//! Invariants of the [`Study`] that [`Study::read`] returns: it has a series or a row; every name that is used is declared; a row
//! has exactly the runs, the other run and the phase that its measure requires.

use super::measure::{self, Input, Measure};
use crate::experiments::cases::grown;
use crate::experiments::entry::{Comm, Line, Setup, TARGETS};
use crate::order::distinct;
use crate::{name_of, read_toml, refuse};
use contract::case::Case;
use contract::failure::Failure;
use run::engine::description::{Description, is_own};
use run::engine::paths::Paths;
use run::engine::report::one_or_many;
use run::engine::runner::label;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Valid numbers of cells.
const CELLS: RangeInclusive<f64> = 1e3..=1e12;
const WRONG_LAYERS: &str = "a layer has at least one cell";
const WRONG_CELLS: &str = "cells is from 1e3 to 1e12";
/// Valid numbers of facets per rank.
const FACETS: RangeInclusive<usize> = 1..=100_000_000;
/// Valid numbers of ranks.
const RANKS: RangeInclusive<usize> = 1..=65_536;

/// A study file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Study {
    /// Meshes by name.
    pub mesh: BTreeMap<String, Mesh>,
    /// Runs by name.
    pub run: BTreeMap<String, RunSpec>,
    /// The rows, in order.
    pub row: Vec<Row>,
    /// The series, in order.
    pub series: Vec<Series>,
    /// Directory of the file; paths are relative to it.
    #[serde(skip)]
    pub directory: PathBuf,
    /// In a replay, the runs that are repeated, and how often; no others are executed.
    #[serde(skip)]
    pub repeated: Option<Vec<(Setup, usize)>>,
}

/// A mesh.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// A name in geometries/catalogue.toml, or the path of a case file.
    pub case: String,
    /// n; replaces that of the case.
    pub layer_cells_min: Option<u32>,
    /// The spacing; replaces that of the case, in the same root.
    pub spacing_min: Option<f64>,
    /// Approximate number of cells: the spacing is extrapolated from coarser meshes, and the root fits it.
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
    /// `metis`, `morton` or `paper`; the default of the mesher if empty.
    #[serde(default, alias = "preset")]
    pub partitioner: String,
    /// Level of the base leaves: the depth of the paper's base mesh.
    pub level_base: Option<u32>,
    /// `unit`, `area` or `rebalance`; the default of the mesher if empty.
    #[serde(default)]
    pub weights: String,
    /// Number of repetitions; results are their medians.
    #[serde(default = "one")]
    pub repeats: usize,
}

impl RunSpec {
    /// The run's parameters on a mesh with this spacing and n.
    pub(super) fn setup(&self, spacing_min: f64, layer_cells_min: u32) -> Setup {
        Setup {
            experiment: TARGETS.to_owned(),
            ranks: self.ranks,
            comm: self.comm,
            partitioner: self.partitioner.clone(),
            weights: self.weights.clone(),
            level_base: self.level_base,
            ..Setup::serial(&self.mesh, spacing_min, layer_cells_min)
        }
    }
}

fn mpi() -> Comm {
    Comm::Mpi
}

fn one() -> usize {
    1
}

fn mesher() -> Vec<String> {
    vec!["mesher".to_owned()]
}

/// A target.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The name, used by `--only`.
    pub name: String,
    /// One or several runs. Each of several runs has its own row, unless the measure is that of a series.
    #[serde(deserialize_with = "one_or_many")]
    pub run: Vec<String>,
    /// The run with which it is compared.
    pub against: Option<String>,
    /// The measure.
    #[serde(deserialize_with = "measure::named")]
    pub measure: &'static Measure,
    /// The phase or phases, for measures of phases.
    #[serde(default, deserialize_with = "one_or_many")]
    pub phase: Vec<String>,
    /// Lower bound.
    pub at_least: Option<f64>,
    /// Upper bound.
    pub at_most: Option<f64>,
}

impl Row {
    /// Returns the runs that it needs: its own and the one with which it is compared.
    pub(super) fn runs(&self) -> impl Iterator<Item = &String> {
        self.run.iter().chain(&self.against)
    }
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
    /// Facets per rank (weak), which the case's generator makes; if missing, the facets of the case.
    pub facets: Option<usize>,
    /// The programs, which mesh the same cases in turn: names in harness/engines, or engine files, whose paths in the file are relative to
    /// it.
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

impl Study {
    /// Reads a file.
    ///
    /// # Errors
    /// One sentence with the file, the position and the error.
    pub fn read(path: &Path) -> Result<Self, String> {
        let mut study: Self = read_toml(path).map_err(|failure| failure.why)?;
        study.directory = path.parent().unwrap_or(Path::new(".")).to_owned();
        study.check().map_err(|why| format!("{}: {why}", path.display()))?;
        let engines = study.series.iter_mut().flat_map(|series| &mut series.engines);
        for file in engines.filter(|name| name.ends_with(".toml")) {
            *file = study.directory.join(&*file).to_string_lossy().into_owned();
        }
        study.row = study.row.iter().flat_map(each_run).collect();
        Ok(study)
    }

    /// Keeps only the rows and the experiments with these names, or all if no name is given.
    ///
    /// # Errors
    /// If no row and no experiment has one of the names.
    pub fn only(&mut self, names: &[String]) -> Result<(), String> {
        // A row of several runs has the name of the run at its end.
        let of_row = |Row { name, run, .. }: &Row| {
            [name, name.strip_suffix(&format!(": {}", run[0])).unwrap_or(name)].map(str::to_owned)
        };
        let of_series = |series: &Series| name_of(&series.experiment);
        let rows = self.row.iter().flat_map(of_row);
        let known: Vec<String> = rows.chain(self.series.iter().map(of_series)).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(name)) {
            return Err(format!("no row and no experiment is called {name:?}"));
        }
        if !names.is_empty() {
            self.row.retain(|row| of_row(row).iter().any(|name| names.contains(name)));
            self.series.retain(|series| names.contains(&of_series(series)));
        }
        Ok(())
    }

    /// Returns the programs of all series, and the mesher if a row needs it, each once.
    pub fn engines(&self) -> Vec<String> {
        let of_rows = (!self.row.is_empty()).then(mesher).unwrap_or_default();
        distinct(self.series.iter().flat_map(|series| series.engines.clone()).chain(of_rows))
    }

    /// Whether a setup of a record is the run of this name.
    pub(super) fn is_run(&self, name: &str, setup: &Setup) -> bool {
        let Some(run) = self.run.get(name) else { return false };
        let Mesh { spacing_min, layer_cells_min, .. } = self.mesh[&run.mesh];
        let (spacing, n) = (setup.spacing_min, setup.layer_cells_min);
        *setup == run.setup(spacing_min.unwrap_or(spacing), layer_cells_min.unwrap_or(n))
    }

    /// Returns the case of a run of this study, its facets per rank, and whether it keeps its root; `None` for a run of another study.
    pub(super) fn source(&self, setup: &Setup) -> Option<(&String, Option<usize>, bool)> {
        let series = self.series.iter().find(|series| series.is_of(setup));
        let mesh = self.mesh.get(&setup.case).filter(|_| setup.experiment == TARGETS);
        let of_mesh = mesh.map(|mesh| (&mesh.case, None, mesh.cells.is_none()));
        series.map(|series| (&series.case, series.facets, false)).or(of_mesh)
    }

    /// Returns the setup of a line that this study does not ask for.
    pub fn unasked<'a>(&self, line: &'a Line) -> Option<&'a Setup> {
        let setup = line.setup()?;
        let cells = line.run().filter(|_| is_own(&setup.engine)).map(|run| run.cells);
        let is_of_series = self.series.iter().any(|series| series.asks_for(setup, cells));
        let is_of_row = |(name, run): (&String, &RunSpec)| {
            let asked = self.mesh[&run.mesh].cells;
            self.is_run(name, setup) && asked.is_none_or(|asked| is_near(cells, asked))
        };
        (!is_of_series && !self.run.iter().any(is_of_row)).then_some(setup)
    }

    /// Returns what this study asks for and these lines have not, a sentence each. Spacings are found in execution, so meshes are counted.
    ///
    /// # Errors
    /// If a case cannot be read.
    pub(super) fn lacking(&self, lines: &[Line], paths: &Paths) -> Result<Vec<String>, Failure> {
        let made = lines.iter().filter(|line| line.run().is_none_or(|run| !run.warm_up));
        let mut made = distinct(made.filter_map(Line::setup));
        let is_made = |name: &&String| made.iter().any(|setup| self.is_run(name, setup));
        let rows = self.row.iter().flat_map(Row::runs).filter(|name| !is_made(name));
        let mut lacks = distinct(rows.map(|name| format!("the run {name}")));
        let mut asked = Vec::new();
        for (series, cells) in self.series.iter().flat_map(Series::sizes) {
            let case = Case::read(&paths.catalogue.case_file(&series.case, &self.directory)?)?;
            for name in &series.engines {
                // One that cannot be read here is taken to be serial.
                let on = series.layouts(&Description::find(name, paths).unwrap_or_default(), false);
                let all = series.setups(&label(name), cells, case.layer_cells_min, &on);
                asked.extend(all.into_iter().map(|setup| (setup, cells)));
            }
        }
        for (asked, _) in distinct(asked) {
            let plain = |of: &Setup| Setup { spacing_min: 0.0, ..of.clone() };
            match made.iter().position(|made| plain(made) == plain(&asked)) {
                Some(at) => drop(made.remove(at)),
                None => lacks.push(plain(&asked).to_string().replace(" 0e0", "")),
            }
        }
        Ok(lacks.iter().map(|of| format!("{of} is not in the record")).collect())
    }

    fn check(&self) -> Result<(), String> {
        let is_empty = self.row.is_empty() && self.series.is_empty();
        refuse(&[(is_empty, "it has no [[series]] and no [[row]]")])?;
        for (i, series) in self.series.iter().enumerate() {
            series.check(&self.series[..i])?;
        }
        let mut cases = BTreeMap::new();
        let of_series = self.series.iter().map(|series| &series.case);
        for case in of_series.chain(self.mesh.values().map(|mesh| &mesh.case)) {
            let name = Path::new(case).file_stem().map(|name| plain(&name.to_string_lossy()));
            let other = *cases.entry(name).or_insert(case);
            let why = format!("the cases {other} and {case} have the same name: rename one");
            refuse(&[(other != case, &why)])?;
        }
        for (name, Mesh { spacing_min, cells, layer_cells_min, .. }) in &self.mesh {
            refuse(&[
                (*layer_cells_min == Some(0), WRONG_LAYERS),
                (spacing_min.is_some() && cells.is_some(), "give spacing_min or cells, not both"),
                (!cells.iter().all(|cells| CELLS.contains(cells)), WRONG_CELLS),
                (spacing_min.is_some_and(|s| !s.is_normal() || s < 0.0), "spacing_min is positive"),
            ])
            .map_err(|why| format!("mesh {name}: {why}"))?;
        }
        for (name, run) in &self.run {
            self.check_run(run).map_err(|why| format!("run {name}: {why}"))?;
        }
        for (i, row) in self.row.iter().enumerate() {
            self.check_row(row).map_err(|why| format!("row {:?}: {why}", row.name))?;
            let is_second = self.row[..i].iter().any(|other| other.name == row.name);
            refuse(&[(is_second, &format!("two rows are called {:?}", row.name))])?;
        }
        Ok(())
    }

    fn check_run(&self, run: &RunSpec) -> Result<(), String> {
        let is_unit = ["", "unit"].contains(&run.weights.as_str());
        let wrong_weights = run.partitioner == "paper" && !is_unit;
        let wrong_ranks = !RANKS.contains(&run.ranks) || run.comm == Comm::Solo && run.ranks != 1;
        refuse(&[
            (!self.mesh.contains_key(&run.mesh), &format!("no mesh is called {:?}", run.mesh)),
            (wrong_ranks, &format!("it cannot have {} ranks", run.ranks)),
            (run.repeats == 0, "repeats is at least 1"),
            (wrong_weights, "the paper's partition has weights of 1"),
        ])
    }

    fn check_row(&self, row: &Row) -> Result<(), String> {
        if let Some(name) = row.runs().find(|n| !self.run.contains_key(*n)) {
            return Err(format!("no run is called {name:?}"));
        }
        let (name, input) = (row.measure.name, row.measure.input);
        let [against, phase] = [input == Input::Against, input == Input::Phases];
        let wrong_against = against != row.against.is_some();
        let least = if input == Input::Series { 2 } else { 1 };
        let needs = |needs: bool| if needs { "requires" } else { "does not accept" };
        let is_sim = |name: &String| self.run[name].comm == Comm::Sim;
        let is_of_several = matches!(input, Input::Series | Input::Against);
        // Ranks in one process have projected times, and share their memory. Their cells are those of any ranks.
        let is_mixed = is_of_several && name != "lambda_cells_ratio";
        let is_mixed = is_mixed && row.runs().any(is_sim) && !row.runs().all(is_sim);
        let (least_value, most) = (row.at_least.unwrap_or(0.0), row.at_most.unwrap_or(f64::MAX));
        let is_range = least_value.is_finite() && most.is_finite() && least_value <= most;
        refuse(&[
            (!is_range, "at_least and at_most are finite, and at_least is not more"),
            (wrong_against, &format!("{name} {} a run in `against`", needs(against))),
            (phase == row.phase.is_empty(), &format!("{name} {} a name in `phase`", needs(phase))),
            (is_mixed, &format!("{name} compares simulated ranks with other ranks")),
            (row.run.len() < least, &format!("{name} requires {least} or more runs")),
        ])
    }
}

/// Weights and partitioner of a run, empty to leave the choice to the program.
pub(super) type Choice = (&'static str, &'static str);

/// How ranks communicate, and their number.
type Ranks = (Comm, usize);

/// The choices of the experiment on weights. `rebalance` with METIS is identical to `area`.
const CHOICES: [Choice; 6] = [
    ("", "paper"),
    ("unit", "metis"),
    ("unit", "morton"),
    ("area", "metis"),
    ("area", "morton"),
    ("rebalance", "morton"),
];

/// Whether a mesh, if its size is known, has about as many cells as were asked for.
fn is_near(cells: Option<u64>, asked: f64) -> bool {
    cells.is_none_or(|cells| (0.25..4.0).contains(&(cells as f64 / asked)))
}

impl Series {
    /// The name of its case in results.
    pub(super) fn name(&self) -> String {
        let case = Path::new(&self.case).file_stem().unwrap_or_default().to_string_lossy();
        self.facets.map_or(case.clone().into(), |facets| grown(&case, facets))
    }

    /// Whether the run is of this experiment on this case.
    fn is_of(&self, setup: &Setup) -> bool {
        (name_of(&self.experiment), self.name()) == (setup.experiment.clone(), setup.case.clone())
    }

    /// Whether it is a run of this series, of any program if that names none, or a serial one in place of it. `cells` are those of the mesh, if that is ours: meshes of others may be far from
    /// what was asked for, and where the number of cells jumps with the spacing, ours are not close either.
    fn asks_for(&self, setup: &Setup, cells: Option<u64>) -> bool {
        let has_ranks = match setup.comm {
            Comm::Solo => true,
            Comm::Mpi => self.mpi.contains(&setup.ranks),
            Comm::Sim => self.sim.contains(&setup.ranks),
        };
        let fits = |asked: &f64| match setup.series_cells {
            Some(of_series) => of_series == *asked,
            None => is_near(cells, *asked),
        };
        let division = (setup.weights.as_str(), setup.partitioner.as_str());
        self.is_of(setup)
            && has_ranks
            && (self.layers.is_empty() || self.layers.contains(&setup.layer_cells_min))
            && (self.cells.is_empty() || self.cells.iter().any(fits))
            && self.choices().contains(&division)
            && (self.engines.is_empty() || self.engines.iter().any(|of| label(of) == setup.engine))
    }

    /// The runs of a program at one size, in units of the finest spacing, on these ranks; `n` is that of the case.
    pub(super) fn setups(&self, of: &str, cells: Option<f64>, n: u32, on: &[Ranks]) -> Vec<Setup> {
        use Experiment::{Spacing, Strong, Weights};
        // Coarser by factors of two, while there are enough cells to measure.
        let least = if self.experiment == Spacing { 1e5 } else { f64::INFINITY };
        let halvings = (cells.unwrap_or_default() / least).log(4.0).max(0.0) as i32;
        let series_cells = cells.filter(|_| !matches!(self.experiment, Strong | Weights));
        let layers = if self.layers.is_empty() { vec![n] } else { self.layers.clone() };
        let each = layers.iter().flat_map(|n| on.iter().map(move |layout| (*n, *layout)));
        let each = each.flat_map(|at| (0..=halvings).rev().map(move |k| (at, 2f64.powi(k))));
        let of_choice = |((n, (comm, ranks)), spacing), (weights, partitioner): &Choice| Setup {
            experiment: name_of(&self.experiment),
            engine: of.to_owned(),
            ranks,
            comm,
            weights: (*weights).to_owned(),
            partitioner: (*partitioner).to_owned(),
            series_cells,
            ..Setup::serial(&self.name(), spacing, n)
        };
        // What is named twice is no repetition.
        distinct(each.flat_map(|at| self.choices().iter().map(move |of| of_choice(at, of))))
    }

    /// Each series that it is, with its cells.
    pub(super) fn sizes(&self) -> impl Iterator<Item = (&Self, Option<f64>)> {
        let own = self.cells.is_empty().then_some(None);
        let sizes = distinct(self.cells.iter().copied().map(Some).chain(own));
        sizes.into_iter().map(move |cells| (self, cells))
    }

    /// Returns the partitions that are compared.
    pub(super) fn choices(&self) -> &'static [Choice] {
        if self.experiment == Experiment::Weights { &CHOICES } else { &[("", "")] }
    }

    /// Returns the ranks on which an engine is run: those of the series that it offers. A serial run replaces ranks on MPI that
    /// are missing; nothing can replace the ranks of experiments about ranks.
    pub(super) fn layouts(&self, engine: &Description, no_mpi: bool) -> Vec<Ranks> {
        let has_mpi = !engine.run.parallel.is_empty() && !no_mpi;
        let sim = self.sim.iter().filter(|_| !engine.run.simulated.is_empty());
        let mpi = self.mpi.iter().filter(|_| has_mpi);
        let mut all: Vec<Ranks> =
            sim.map(|r| (Comm::Sim, *r)).chain(mpi.map(|r| (Comm::Mpi, *r))).collect();
        match self.experiment {
            Experiment::Weights if !is_own(&engine.name) => all.clear(),
            Experiment::Weights | Experiment::Weak => {}
            _ if all.is_empty() || !self.mpi.is_empty() && !has_mpi => all.push((Comm::Solo, 1)),
            _ => {}
        }
        all
    }

    /// Checks it; `before` are the series before it.
    fn check(&self, before: &[Self]) -> Result<(), String> {
        use Experiment::{Layers, Spacing, Weak, Weights};
        let (what, ranks) = (self.experiment, [&self.sim[..], &self.mpi].concat());
        let is_about_ranks = matches!(what, Weak | Weights);
        let wrong = [
            (!ranks.iter().all(|ranks| RANKS.contains(ranks)), "ranks are from 1 to 65536"),
            (self.repeats == 0, "repeats is at least 1"),
            (before.contains(self), "it is given twice"),
            (self.layers.contains(&0), WRONG_LAYERS),
            (self.engines.is_empty(), "it has no engines"),
            (!self.cells.iter().all(|cells| CELLS.contains(cells)), WRONG_CELLS),
            (
                what == Spacing && (self.cells.is_empty() || self.cells.iter().any(|n| *n < 4e5)),
                "give cells of 4e5 or more, for two spacings",
            ),
            (what == Weak && self.cells.is_empty(), "give the cells of a rank"),
            (what != Weak && self.facets.is_some(), "facets per rank are for weak"),
            (self.facets.is_some_and(|n| !FACETS.contains(&n)), "facets is from 1 to 1e8"),
            (is_about_ranks && ranks.is_empty(), "give ranks"),
            (what == Layers && self.layers.is_empty(), "give layers"),
        ];
        refuse(&wrong).map_err(|why| format!("series {} of {}: {why}", name_of(&what), self.case))
    }
}

/// Splits a row of several runs into one row for each, unless its measure is that of a series.
fn each_run(row: &Row) -> Vec<Row> {
    if row.run.len() == 1 || row.measure.input == Input::Series {
        return vec![row.clone()];
    }
    let of = |run: &String| Row {
        name: format!("{}: {run}", row.name),
        run: vec![run.clone()],
        ..row.clone()
    };
    row.run.iter().map(of).collect()
}

/// A name in the keys and the files of results, which have `-` in place of punctuation: others must differ from it there.
pub fn plain(name: &str) -> String {
    name.replace(|c: char| !c.is_ascii_alphanumeric(), "-")
}

#[cfg(test)]
mod tests;
