//! What was asked of a verification.

use crate::engine::mesher::Layout;
use contract::catalogue::Size;
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// Something that a verification needs and a machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Need {
    /// `mpirun`, and a mesher that was built with MPI.
    Mpi,
    /// Python with the packages of all three oracles.
    Oracles,
    /// The p4est engine.
    P4est,
    /// The geometries that are fetched, not kept in the repository.
    Geometries,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Mpi => "mpi",
            Self::Oracles => "oracles",
            Self::P4est => "p4est",
            Self::Geometries => "geometries",
        })
    }
}

/// What was asked.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names in the catalogue or paths of case files; none means all of the catalogue's of `size`.
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases, where `cases` names none.
    pub sizes: Vec<Size>,
    /// Rank counts of the runs on MPI.
    pub ranks: Vec<usize>,
    /// Partitioners, each tried at each rank count.
    pub partitioners: Vec<String>,
    /// Base depths, each tried with each partitioner.
    pub level_bases: Vec<String>,
    /// Directory for results and reports; a temporary one, removed at the end, if none is given.
    pub out: Option<PathBuf>,
    /// Keep every result, not only those of failing cases.
    pub keep: bool,
    /// Time limit of every single run.
    pub limit: Duration,
    /// Run on MPI.
    pub mpi: bool,
    /// Ask the oracles.
    pub oracles: bool,
    /// Compare with p4est.
    pub p4est: bool,
    /// What must not be missing.
    pub require: Vec<Need>,
    /// Most points that are put to the oracles on a case that is not small.
    pub oracle_points: usize,
    /// Chooses those points.
    pub seed: u64,
    /// Cases of more cells are only measured: the checks hold a mesh in memory.
    pub cells_max: u64,
    /// The reference is run on cases of up to so many cells; beyond, it would take hours.
    pub reference_cells_max: u64,
}

impl Options {
    /// A verification of leaves alone: reference and checks, neither MPI nor oracles nor p4est.
    pub fn of_leaves_alone(cases: Vec<String>) -> Self {
        Self {
            cases,
            sizes: Vec::new(),
            ranks: Vec::new(),
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

    /// Every layout of a run on MPI, in the order of rank counts.
    pub fn layouts(&self) -> Vec<Layout> {
        let mut layouts = Vec::new();
        for &ranks in &self.ranks {
            for partitioner in &self.partitioners {
                for level_base in &self.level_bases {
                    let (partitioner, level_base) = (partitioner.clone(), level_base.clone());
                    layouts.push(Layout { ranks, partitioner, level_base });
                }
            }
        }
        layouts
    }
}
