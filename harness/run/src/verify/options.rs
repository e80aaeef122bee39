//! The options of a verification.

use crate::engine::description::Description;
use crate::engine::layout::{Layout, Ranks};
use check::promises::Independence;
use clap::{Args, Parser};
use contract::catalogue::Size;
use std::collections::BTreeSet;
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
    /// The proven checker of reference/proof.
    Proof,
    /// The geometries that are downloaded and not kept in the repository.
    Geometries,
    /// At least one check of every case.
    Checks,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

/// The options, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Names in geometries/catalogue.toml or paths of case files [default: all of --size]
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases
    #[arg(long, value_delimiter = ',', default_value = "small")]
    pub size: Vec<Size>,
    /// Rank counts of the runs on MPI; given, they require it [default: 1,2,3,4,7,8,16,32,64]
    #[arg(long, value_delimiter = ',', value_parser = rank_count)]
    pub ranks: Option<Vec<usize>>,
    /// Partitioners, each at every rank count
    #[arg(long, value_delimiter = ',', default_value = "metis,morton")]
    pub partitioners: Vec<String>,
    /// Base depths, each with every partitioner
    #[arg(long, value_delimiter = ',', default_value = "auto,3")]
    pub level_bases: Vec<String>,
    /// Directory for reports and for results that are kept [default: a temporary one]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Also keep the results of passing cases
    #[arg(long)]
    pub keep: bool,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = TIMEOUT_S, value_parser = whole_seconds)]
    pub timeout: u64,
    /// Leave out the runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Leave out trimesh, open3d and pyvista
    #[arg(long)]
    pub no_oracles: bool,
    /// Leave out the comparison with p4est
    #[arg(long)]
    pub no_p4est: bool,
    /// Leave out the proof of the serial mesh
    #[arg(long)]
    pub no_proof: bool,
    /// Required components: exit code 3 if one is missing
    #[arg(long, value_delimiter = ',')]
    pub require: Vec<Need>,
}

/// Time limit without `--timeout`, in seconds.
pub(super) const TIMEOUT_S: u64 = 600;
/// Rank counts without `--ranks`.
const RANKS: [usize; 9] = [1, 2, 3, 4, 7, 8, 16, 32, 64];

fn rank_count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) => Err("a run has at least one rank".to_owned()),
        Ok(ranks) => Ok(ranks),
        Err(error) => Err(error.to_string()),
    }
}

/// Parses a whole number of seconds: at least 1, and at most a week.
pub fn whole_seconds(text: &str) -> Result<u64, String> {
    const WEEK: u64 = 7 * 86_400;
    let number = text.trim().parse().ok().filter(|n| (1..=WEEK).contains(n));
    number.ok_or_else(|| format!("give a whole number of seconds from 1 to {WEEK}"))
}

impl Options {
    /// A verification by reference and checks only, without MPI, oracles, p4est and proof.
    pub fn of_leaves_alone(cases: Vec<String>) -> Self {
        #[derive(Parser)]
        struct Defaults {
            #[command(flatten)]
            options: Options,
        }
        let Defaults { options } = Defaults::parse_from(["verify"]);
        let no = true;
        Self { cases, no_mpi: no, no_oracles: no, no_p4est: no, no_proof: no, ..options }
    }

    /// Time limit of every single run.
    pub(super) fn limit(&self) -> Duration {
        Duration::from_secs(self.timeout)
    }

    /// Rank counts of the runs on MPI, each once: a run has one directory. They are those that were asked for, or all of which the
    /// engine is capable.
    pub(super) fn rank_counts(&self, engine: &Description) -> Vec<usize> {
        if self.no_mpi || (self.ranks.is_none() && engine.run.parallel.is_none()) {
            return Vec::new();
        }
        let counts: BTreeSet<usize> =
            self.ranks.as_deref().unwrap_or(&RANKS).iter().copied().collect();
        counts.into_iter().collect()
    }

    /// Every layout of a run on MPI, in the order of rank counts. The partition is varied as far as the engine offers a choice
    /// and promises that its mesh does not depend on it.
    pub(super) fn layouts(&self, engine: &Description) -> Vec<Layout> {
        let templates = &engine.run;
        let independent = engine.promises.is_independent_of(Independence::Partitioner);
        let varied = |offered: bool, values: &[String]| match offered && independent {
            true => values.iter().cloned().map(Some).collect(),
            false => vec![None],
        };
        let partitioners = varied(templates.partitioner.is_some(), &self.partitioners);
        let level_bases = varied(templates.level_base.is_some(), &self.level_bases);
        let mut layouts = Vec::new();
        for ranks in self.rank_counts(engine).into_iter().map(Ranks::Mpi) {
            for partitioner in &partitioners {
                layouts.extend(level_bases.iter().map(|level_base| Layout {
                    partitioner: partitioner.clone(),
                    level_base: level_base.clone(),
                    ..Layout::on(ranks)
                }));
            }
        }
        layouts
    }
}
