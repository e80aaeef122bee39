//! Reads a study file: series of runs, and meshes, runs and rows by name. reports/README.md describes the format.
//!
//! Invariants of the [`Study`] that [`Study::read`] returns: it has a series or a row; every name that is used is declared; a row
//! has exactly the runs, the other run and the phase that its measure requires.

use super::measure::{self, Input, Measure};
use super::series::{CELLS, are_ranks, mesher, one};
pub use super::series::{Experiment, Series};
use crate::experiments::entry::{Comm, Setup};
use crate::order::distinct;
use crate::refuse;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The [`Setup::experiment`] of runs for targets.
pub const EXPERIMENT: &str = "targets";
/// A study file.
#[derive(Clone, Debug, Deserialize)]
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

fn mpi() -> Comm {
    Comm::Mpi
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

/// Reads a name or a list of names.
fn one_or_many<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a name or a list of names was expected")]
    enum OneOrMany {
        One(String),
        Many(Vec<String>),
    }
    Ok(match OneOrMany::deserialize(from)? {
        OneOrMany::One(name) => vec![name],
        OneOrMany::Many(names) => names,
    })
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
        if names.is_empty() {
            return Ok(());
        }
        let is_row = |row: &Row, name: &String| {
            // A row of several runs has the name of the run at its end.
            row.name == *name || row.name == format!("{name}: {}", row.run[0])
        };
        let is_series = |series: &Series, name: &String| series.experiment.to_string() == *name;
        let is_known = |name: &&String| {
            self.row.iter().any(|row| is_row(row, name))
                || self.series.iter().any(|series| is_series(series, name))
        };
        if let Some(name) = names.iter().find(|name| !is_known(name)) {
            return Err(format!("no row and no experiment is called {name:?}"));
        }
        self.row.retain(|row| names.iter().any(|name| is_row(row, name)));
        self.series.retain(|series| names.iter().any(|name| is_series(series, name)));
        Ok(())
    }

    /// Returns the programs of all series, and the mesher if a row needs it, each once.
    pub fn engines(&self) -> Vec<String> {
        let of_rows = (!self.row.is_empty()).then(mesher).unwrap_or_default();
        distinct(self.series.iter().flat_map(|series| series.engines.clone()).chain(of_rows))
    }

    /// Returns the runs that a row needs: its own and the one with which it is compared.
    pub fn runs_of<'a>(&self, row: &'a Row) -> Vec<&'a String> {
        row.run.iter().chain(&row.against).collect()
    }

    /// Whether a setup of a record is the run of this name.
    pub(super) fn is_run(&self, name: &str, setup: &Setup) -> bool {
        let Some(run) = self.run.get(name) else { return false };
        let mesh = &self.mesh[&run.mesh];
        setup.experiment == EXPERIMENT
            && setup.case == run.mesh
            && (setup.ranks, setup.comm) == (run.ranks, run.comm)
            && (&setup.partitioner, &setup.weights) == (&run.partitioner, &run.weights)
            && setup.level_base == run.level_base
            && mesh.spacing_min.is_none_or(|s| s == setup.spacing_min)
            && mesh.layer_cells_min.is_none_or(|n| n == setup.layer_cells_min)
    }

    /// Whether runs on a case of this name are of the study.
    pub fn has_case(&self, name: &str) -> bool {
        let is_of =
            |series: &Series| Path::new(&series.case).file_stem().is_some_and(|s| s == name);
        self.mesh.contains_key(name) || self.series.iter().any(is_of)
    }

    fn check(&self) -> Result<(), String> {
        if self.row.is_empty() && self.series.is_empty() {
            return Err("it has no [[series]] and no [[row]]".to_owned());
        }
        self.series.iter().try_for_each(Series::check)?;
        let stem = |case: &str| Path::new(case).file_stem().map(|name| name.to_owned());
        let cases: Vec<&String> = self.series.iter().map(|series| &series.case).collect();
        for (i, case) in cases.iter().enumerate() {
            if let Some(other) = cases[..i].iter().find(|of| of != &case && stem(of) == stem(case))
            {
                return Err(format!(
                    "the cases {other} and {case} have the same name in results: rename one"
                ));
            }
        }
        for (name, mesh) in &self.mesh {
            mesh.check().map_err(|why| format!("mesh {name}: {why}"))?;
        }
        for (name, run) in &self.run {
            self.check_run(run).map_err(|why| format!("run {name}: {why}"))?;
        }
        for (i, row) in self.row.iter().enumerate() {
            self.check_row(row).map_err(|why| format!("row {:?}: {why}", row.name))?;
            if self.row[..i].iter().any(|other| other.name == row.name) {
                return Err(format!("two rows are called {:?}", row.name));
            }
        }
        Ok(())
    }

    fn check_run(&self, run: &RunSpec) -> Result<(), String> {
        let wrong_ranks = !are_ranks(&[run.ranks]) || run.comm == Comm::Solo && run.ranks != 1;
        refuse(&[
            (!self.mesh.contains_key(&run.mesh), &format!("no mesh is called {:?}", run.mesh)),
            (wrong_ranks, &format!("it cannot have {} ranks", run.ranks)),
            (run.repeats == 0, "repeats is at least 1"),
            (
                run.partitioner == "paper" && !["", "unit"].contains(&run.weights.as_str()),
                "the paper's partition has weights of 1",
            ),
        ])
    }

    fn check_row(&self, row: &Row) -> Result<(), String> {
        if let Some(name) = self.runs_of(row).into_iter().find(|n| !self.run.contains_key(*n)) {
            return Err(format!("no run is called {name:?}"));
        }
        let (name, input) = (row.measure.name, row.measure.input);
        let [against, phase] = [input == Input::Against, input == Input::Phases];
        let least = if input == Input::Series { 2 } else { 1 };
        let needs = |needs: bool| if needs { "requires" } else { "does not accept" };
        refuse(&[
            (
                against != row.against.is_some(),
                &format!("{name} {} a run in `against`", needs(against)),
            ),
            (phase == row.phase.is_empty(), &format!("{name} {} a name in `phase`", needs(phase))),
            (row.run.len() < least, &format!("{name} requires {least} or more runs")),
        ])
    }
}

impl Mesh {
    fn check(&self) -> Result<(), String> {
        let Self { spacing_min, cells, .. } = self;
        refuse(&[
            (spacing_min.is_some() && cells.is_some(), "give spacing_min or cells, not both"),
            (cells.is_some_and(|cells| !CELLS.contains(&cells)), "cells is from 1e3 to 1e12"),
        ])
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

#[cfg(test)]
mod tests;
