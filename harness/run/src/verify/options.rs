//! The options of a verification.

use crate::engine::description::Description;
use crate::engine::layout::{Layout, Ranks};
use check::promises::Independence;
use contract::catalogue::Size;
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// A prerequisite of a verification that a machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Need {
    /// `mpirun`, and a mesher that was built with MPI.
    Mpi,
    /// Python with the packages of all three oracles.
    Oracles,
    /// The p4est program.
    P4est,
    /// The geometries that are downloaded and not kept in the repository.
    Geometries,
    /// At least one check of every case.
    Checks,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Mpi => "mpi",
            Self::Oracles => "oracles",
            Self::P4est => "p4est",
            Self::Geometries => "geometries",
            Self::Checks => "checks",
        })
    }
}

/// The options.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names in the catalogue or paths of case files; if empty, all cases of the catalogue that have one of `sizes`.
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases, if `cases` is empty.
    pub sizes: Vec<Size>,
    /// Rank counts of the runs on MPI.
    pub ranks: Vec<usize>,
    /// Whether the user gave them: then MPI must not be missing.
    pub ranks_given: bool,
    /// Partitioners, each tried at each rank count.
    pub partitioners: Vec<String>,
    /// Levels of the partition, each tried with each partitioner.
    pub level_bases: Vec<String>,
    /// Directory for results and reports; if `None`, a temporary one that is removed at the end.
    pub out: Option<PathBuf>,
    /// Keep every result, not only those of failing cases.
    pub keep: bool,
    /// Time limit of every single run.
    pub limit: Duration,
    /// Run on MPI.
    pub mpi: bool,
    /// Compare with the oracles.
    pub oracles: bool,
    /// Compare with p4est.
    pub p4est: bool,
    /// Prerequisites that must not be missing.
    pub require: Vec<Need>,
    /// Greatest number of points that the oracles classify on a case that is not small.
    pub oracle_points: usize,
    /// Seed for choosing those points.
    pub seed: u64,
    /// Meshes with more cells are only measured, because the checks hold a mesh in memory.
    pub cells_max: u64,
    /// The greatest number of cells up to which the reference is run; beyond it, a run would take hours.
    pub reference_cells_max: u64,
}

impl Options {
    /// A verification by reference and checks only, without MPI, oracles and p4est.
    pub fn of_leaves_alone(cases: Vec<String>) -> Self {
        Self {
            cases,
            sizes: Vec::new(),
            ranks: Vec::new(),
            ranks_given: false,
            partitioners: Vec::new(),
            level_bases: Vec::new(),
            out: None,
            keep: false,
            limit: Duration::from_secs(600),
            mpi: false,
            oracles: false,
            p4est: false,
            require: Vec::new(),
            oracle_points: 0,
            seed: 1,
            cells_max: 100_000_000,
            reference_cells_max: 3_000_000,
        }
    }

    /// Every layout of a run on MPI, in the order of rank counts. The partition is varied as far as the engine offers a choice
    /// and promises that its mesh does not depend on it.
    pub fn layouts(&self, engine: &Description) -> Vec<Layout> {
        let templates = &engine.run;
        let independent = engine.promises.is_independent_of(Independence::Partitioner);
        let varied = |offered: bool, values: &[String]| match offered && independent {
            true => values.iter().cloned().map(Some).collect(),
            false => vec![None],
        };
        let partitioners = varied(templates.partitioner.is_some(), &self.partitioners);
        let level_bases = varied(templates.level_base.is_some(), &self.level_bases);
        let mut layouts = Vec::new();
        for &ranks in &self.ranks {
            for partitioner in &partitioners {
                for level_base in &level_bases {
                    layouts.push(Layout {
                        partitioner: partitioner.clone(),
                        level_base: level_base.clone(),
                        ..Layout::on(Ranks::Mpi(ranks))
                    });
                }
            }
        }
        layouts
    }
}
