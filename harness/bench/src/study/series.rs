//! Series of runs, as a study file declares them.

use crate::experiments::entry::Comm;
use crate::refuse;
use run::engine::description::{Description, is_own};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Valid numbers of cells.
pub(super) const CELLS: std::ops::RangeInclusive<f64> = 1e3..=1e12;
/// Maximum number of ranks.
const RANKS_MAX: usize = 65_536;

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

impl Experiment {
    /// Whether the runs of a series are of several meshes.
    pub(super) fn has_several_meshes(self) -> bool {
        matches!(self, Experiment::Weak | Experiment::Spacing | Experiment::Layers)
    }
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

/// Weights and partitioner of a run, empty to leave the choice to the program.
pub(super) type Choice = (&'static str, &'static str);

/// The choices of the experiment on weights. `rebalance` with METIS is identical to `area`.
const CHOICES: [Choice; 6] = [
    ("", "paper"),
    ("unit", "metis"),
    ("unit", "morton"),
    ("area", "metis"),
    ("area", "morton"),
    ("rebalance", "morton"),
];

impl Series {
    /// Returns the numbers of cells, or that of the case.
    pub(super) fn sizes(&self) -> Vec<Option<f64>> {
        match self.cells.is_empty() {
            true => vec![None],
            false => self.cells.iter().copied().map(Some).collect(),
        }
    }

    /// Returns the partitions that are compared.
    pub(super) fn choices(&self) -> &'static [Choice] {
        match self.experiment {
            Experiment::Weights => &CHOICES,
            _ => &[("", "")],
        }
    }

    /// Returns the ranks on which an engine is run: those of the series that it offers. A serial run replaces ranks on MPI that
    /// are missing; nothing can replace the ranks of experiments about ranks.
    pub(super) fn layouts(&self, engine: &Description, no_mpi: bool) -> Vec<(Comm, usize)> {
        let has_mpi = engine.run.parallel.is_some() && !no_mpi;
        let sim = self.sim.iter().filter(|_| engine.run.simulated.is_some());
        let mpi = self.mpi.iter().filter(|_| has_mpi);
        let mut all: Vec<(Comm, usize)> =
            sim.map(|r| (Comm::Sim, *r)).chain(mpi.map(|r| (Comm::Mpi, *r))).collect();
        match self.experiment {
            Experiment::Weights if !is_own(&engine.name) => all.clear(),
            Experiment::Weights | Experiment::Weak => {}
            _ if all.is_empty() || !self.mpi.is_empty() && !has_mpi => all.push((Comm::Solo, 1)),
            _ => {}
        }
        all
    }

    pub(super) fn check(&self) -> Result<(), String> {
        use Experiment::{Layers, Weak, Weights};
        let (what, ranks) = (self.experiment, [&self.sim[..], &self.mpi].concat());
        let is_about_ranks = matches!(what, Weak | Weights);
        let wrong = [
            (!are_ranks(&ranks), "ranks are from 1 to 65536"),
            (self.repeats == 0, "repeats is at least 1"),
            (self.engines.is_empty(), "it has no engines"),
            (!self.cells.iter().all(|cells| CELLS.contains(cells)), "cells is from 1e3 to 1e12"),
            (what == Weak && self.cells.is_empty(), "give the cells of a rank"),
            (is_about_ranks && ranks.is_empty(), "give ranks"),
            (what == Layers && self.layers.is_empty(), "give layers"),
        ];
        refuse(&wrong).map_err(|why| format!("series {what} of {}: {why}", self.case))
    }
}

pub(super) fn are_ranks(all: &[usize]) -> bool {
    all.iter().all(|ranks| (1..=RANKS_MAX).contains(ranks))
}

pub(super) fn mesher() -> Vec<String> {
    vec!["mesher".to_owned()]
}

pub(super) fn one() -> usize {
    1
}
