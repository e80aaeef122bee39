//! What may be said on the command line.

use crate::cli_bench::BenchArguments;
use crate::cli_report::ReportArguments;
use clap::{Args, Parser, Subcommand};
use harness::verify::options::{Need, Size};
use std::path::PathBuf;

/// Verifies oct-tree meshes and the programs that make them.
///
/// Exit codes: 0 all holds; 1 a check failed; 2 the user's input is at fault; 3 something that was asked for
/// is missing; 130 ended by Ctrl-C.
#[derive(Debug, Parser)]
#[command(version, verbatim_doc_comment)]
pub struct Arguments {
    /// What is to be done.
    #[command(subcommand)]
    pub command: Command,
}

/// The programs of the harness.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs reference and mesher on cases, on every layout of ranks, and checks what comes out
    Verify(Box<VerifyArguments>),
    /// Corrupts correct meshes in every way of a catalogue; each must be caught by the check meant for it
    Selftest(SelftestArguments),
    /// Holds a candidate against a baseline: correctness, exact counters, instructions, time
    Gate(Box<crate::cli_gate::GateArguments>),
    /// Measures: strong and weak scaling, spacing, layers, weights; every result is appended to a record
    Bench(Box<BenchArguments>),
    /// Makes figures, a page, a LaTeX fragment and an artifact description from records of bench
    Report(ReportArguments),
    /// Keeps a history of numbers by commit and finds where they changed
    Track(Box<crate::cli_track::TrackArguments>),
    /// Reduces a case that fails to the smallest that still does
    Shrink(Box<crate::cli_shrink::ShrinkArguments>),
    /// Checks a leaf-set directory of any size by itself
    Audit {
        /// The leaf-set directory
        mesh: PathBuf,
        /// Distinct nodes that may be kept in memory
        #[arg(long)]
        nodes_max: Option<usize>,
        /// Write verdict, times and memory as JSON
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
    },
    /// Writes a leaf-set directory as a VTK unstructured grid, to look at in ParaView or pyvista
    Export {
        /// The leaf-set directory
        mesh: PathBuf,
        /// The file to write, .vtu
        #[arg(value_name = "FILE")]
        to: PathBuf,
    },
    /// Tells where two leaf-set directories differ, and which rule of the definition decides
    Diff {
        /// A leaf-set directory
        a: PathBuf,
        /// Another
        b: PathBuf,
        /// The case that both are meshes of: its facets help to decide
        #[arg(long)]
        case: Option<PathBuf>,
    },
}

/// Where the programs are.
#[derive(Args, Clone, Debug)]
pub struct ProgramArguments {
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<PathBuf>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<PathBuf>,
}

/// `harness verify`.
#[derive(Args, Debug)]
pub struct VerifyArguments {
    /// Names in geometries/catalogue.toml or paths of case files [default: all of --size]
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases
    #[arg(long, value_delimiter = ',', default_value = "small")]
    pub size: Vec<Size>,
    /// Rank counts of the runs on MPI
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,7,8,16,32,64", value_parser = rank_count)]
    pub ranks: Vec<usize>,
    /// Partitioners, each at every rank count
    #[arg(long, value_delimiter = ',', default_value = "metis,morton")]
    pub partitioners: Vec<String>,
    /// Base depths, each with every partitioner
    #[arg(long, value_delimiter = ',', default_value = "auto,3")]
    pub level_bases: Vec<String>,
    /// Directory for reports and for results that are kept [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Keep the results of cases that hold, too
    #[arg(long)]
    pub keep: bool,
    /// Write the report as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
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
    /// Verify another mesher: name in harness/engines or path of a description [default: the mesher itself]
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<String>,
    /// What must not be missing: exit code 3 if it is
    #[arg(long, value_delimiter = ',')]
    pub require: Vec<Need>,
    /// Most points put to the oracles on cases that are not small
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    pub oracle_points: usize,
    /// Chooses those points
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Largest number of cells that is checked; larger meshes are only measured (see `harness audit`)
    #[arg(long, value_name = "CELLS", default_value_t = 100_000_000)]
    pub cells_max: u64,
    /// Largest number of cells up to which the reference is run
    #[arg(long, value_name = "CELLS", default_value_t = 3_000_000)]
    pub reference_cells_max: u64,
    /// Where the programs are.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

/// `harness selftest`.
#[derive(Args, Debug)]
pub struct SelftestArguments {
    /// Corrupt the meshes of this case file instead of the built-in ones; may be repeated
    #[arg(long, value_name = "CASE")]
    pub case: Vec<PathBuf>,
    /// Corrupt a mesh of any size instead, for the audit to find: a leaf-set directory, or a case file to be
    /// meshed; may be repeated
    #[arg(long, value_name = "DIR|CASE", conflicts_with = "case")]
    pub at_scale: Vec<PathBuf>,
    /// Cells of the meshes of case files, about; the spacing is chosen so [default: the case's own]
    #[arg(long, value_name = "N", requires = "at_scale", value_parser = crate::cli_bench::cell_count)]
    pub cells: Option<u64>,
    /// Trials at a time, at scale; each takes the memory of an audit
    #[arg(long, value_name = "N", requires = "at_scale", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// Chooses the places of corruptions, at scale
    #[arg(long, value_name = "N", requires = "at_scale", default_value_t = 1)]
    pub seed: u64,
    /// Where scratch files go, at scale: two to four times the size of a mesh [default: the temporary directory]
    #[arg(long, value_name = "DIR", requires = "at_scale")]
    pub scratch: Option<PathBuf>,
    /// Time limit of every run of reference or mesher
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    pub timeout: u64,
    /// Where the programs are.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

fn rank_count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) => Err("a run has at least one rank".to_owned()),
        Ok(ranks) => Ok(ranks),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_has_no_contradiction() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn lists_are_separated_by_commas() {
        let words = ["harness", "verify", "cube", "--ranks", "1,7", "--require", "mpi,p4est"];
        let Command::Verify(verify) = Arguments::try_parse_from(words).unwrap().command else {
            panic!()
        };
        assert_eq!((verify.ranks, verify.require), (vec![1, 7], vec![Need::Mpi, Need::P4est]));
        assert!(Arguments::try_parse_from(["harness", "verify", "--ranks", "0"]).is_err());
        assert!(Arguments::try_parse_from(["harness", "verify", "--require", "luck"]).is_err());
    }
}
