//! The command line.

use crate::commands;
use clap::{Parser, Subcommand};
use clap_complete::Shell;

/// Verifies and benchmarks oct-tree meshers.
///
/// Exit codes: 0 success; 1 a check failed, two meshes differ or a target was missed; 2 invalid input; 3 a required program or
/// file is missing; 4 standard output cannot be written; 70 a bug; 71 memory ran out; 130 interrupted by a signal.
#[derive(Debug, Parser)]
#[command(version = env!("HARNESS_VERSION"), verbatim_doc_comment)]
pub struct Arguments {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run mesher and reference on cases, serially and on MPI ranks, and check the meshes
    Verify(Box<commands::verify::Arguments>),
    /// Corrupt correct meshes in every catalogued way and test that the intended check detects it
    Selftest(commands::selftest::Arguments),
    /// Compare a candidate with a baseline: correctness, exact counters, instructions, time
    Gate(Box<commands::gate::Arguments>),
    /// Execute a study: series of runs, and targets that are met or missed; append every result to a record
    #[command(visible_alias = "targets")]
    Bench(Box<commands::bench::Arguments>),
    /// Make figures, a web page, and a LaTeX fragment from benchmark records
    Report(commands::report::Arguments),
    /// Put a report, its study and what a repetition must give into one directory, an RO-Crate
    Archive(commands::archive::Arguments),
    /// Repeat the runs of an archive here, and compare: digests and counts exactly, ratios within bands
    Replay(Box<commands::replay::Arguments>),
    /// Keep a history of metrics by commit and detect where they changed
    Track(Box<commands::track::Arguments>),
    /// Reduce a failing case to the smallest one that fails in the same way
    Shrink(Box<commands::shrink::Arguments>),
    /// Check a mesh of any size and format by itself
    Audit(commands::audit::Arguments),
    /// Diagnose a geometry before meshing: its defects, and what each means for the mesh
    Geometry(commands::geometry::Arguments),
    /// Search for an opening through which two places are joined, and the spacing that closes it
    Leak(Box<commands::leak::Arguments>),
    /// Write a mesh, or part of it, for ParaView and other programs
    Export(commands::export::Arguments),
    /// Draw a slice of a mesh, or a view in three dimensions
    Picture(Box<commands::picture::Arguments>),
    /// Make a leaf-set directory from a mesh in another program's format
    Import(commands::import::Arguments),
    /// Report where two leaf-set directories differ and which rule of the definition decides
    Diff(commands::diff::Arguments),
    /// Explain the size and the side of the leaf at a point
    Why(commands::why::Arguments),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: Shell,
    },
    /// End with a fault, for the tests of the exit codes
    #[command(hide = true)]
    Planted(commands::planted::Arguments),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use run::verify::options::Need;

    #[test]
    fn the_definition_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn lists_are_separated_by_commas() {
        let words = ["harness", "verify", "cube", "--ranks", "1,7", "--require", "mpi,p4est"];
        let Command::Verify(verify) = Arguments::try_parse_from(words).unwrap().command else {
            panic!()
        };
        assert_eq!(
            (verify.options.ranks, verify.options.require),
            (Some(vec![1, 7]), vec![Need::Mpi, Need::P4est])
        );
        assert!(Arguments::try_parse_from(["harness", "verify", "--ranks", "0"]).is_err());
        assert!(Arguments::try_parse_from(["harness", "verify", "--require", "luck"]).is_err());
    }

    #[test]
    fn a_study_and_the_options_of_its_session_are_parsed() {
        for name in ["bench", "targets"] {
            let words =
                ["harness", name, "t.toml", "--only", "a,b", "--launcher", "srun -n {ranks}"];
            let parsed = Arguments::try_parse_from(words).unwrap().command;
            assert!(matches!(parsed, Command::Bench(_)));
            assert!(Arguments::try_parse_from(["harness", name, "--launcher", "mpirun"]).is_err());
            assert!(Arguments::try_parse_from(["harness", name, "--repeat", "0"]).is_err());
        }
    }
}
