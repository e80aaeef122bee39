//! The command line: the commands, one file each with its arguments.

mod archive;
mod audit;
mod bench;
mod diff;
mod export;
mod gate;
mod geometry;
mod import;
mod leak;
mod picture;
mod report;
mod selftest;
mod shrink;
mod track;
mod verify;
mod why;

use clap::{Parser, Subcommand};
use contract::failure::Result;
use std::hint::black_box;
use std::thread;

/// Verifies and benchmarks oct-tree meshers.
///
/// Exit codes: 0 success; 1 a check failed, two meshes differ or a target was missed; 2 invalid input, or a file that cannot be
/// read or written; 3 a required program or file is missing, or something that was asked for could not be checked; 4 standard
/// output cannot be written; 70 a bug; 71 memory ran out; 130 interrupted by a signal.
#[derive(Debug, Parser)]
#[command(version = env!("VERSION"), verbatim_doc_comment)]
pub struct Arguments {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run mesher and reference on cases, serially and on MPI ranks, and check the meshes
    Verify(Box<verify::Arguments>),
    /// Corrupt correct meshes in every catalogued way and test that the intended check detects it
    Selftest(selftest::Arguments),
    /// Compare a candidate with a baseline: correctness, exact counters, memory, instructions, time
    Gate(Box<gate::Arguments>),
    /// Execute a study: series of runs, and targets that are met or missed; append every result to a record
    #[command(visible_alias = "targets")]
    Bench(Box<bench::Arguments>),
    /// Make figures, models, a web page, and LaTeX fragments from benchmark records
    Report(report::Arguments),
    /// Put a report, its study and what a repetition must give into one directory, an RO-Crate
    Archive(archive::Arguments),
    /// Repeat the runs of an archive here, and compare: digests and counts exactly, ratios within bands
    Replay(Box<archive::ReplayArguments>),
    /// Keep a history of metrics by commit and detect where they changed
    Track(Box<track::Arguments>),
    /// Reduce a failing case to the smallest one that fails in the same way
    Shrink(Box<shrink::Arguments>),
    /// Check a mesh of any size and format by itself
    Audit(audit::Arguments),
    /// Diagnose a geometry before meshing: its defects, and what each means for the mesh
    Geometry(geometry::Arguments),
    /// Search for an opening through which two places are joined, and the spacing that closes it
    Leak(Box<leak::Arguments>),
    /// Write a mesh, or part of it, for ParaView and other programs
    Export(export::Arguments),
    /// Draw a slice of a mesh
    Picture(Box<picture::Arguments>),
    /// Make a leaf-set directory from a mesh in another program's format
    Import(import::Arguments),
    /// Report where two meshes differ and which rule of the definition decides
    Diff(diff::Arguments),
    /// Explain the size and the side of the leaf at a point
    Why(why::Arguments),
    /// End with a fault, for the tests of the exit codes
    #[command(hide = true)]
    Planted {
        /// A `panic` on the main thread, a panic on another `thread` for which it waits, or a request for too much `memory`
        #[arg(long)]
        fault: String,
    },
}

impl Command {
    /// Runs it; returns the exit code.
    ///
    /// # Errors
    /// If it has no result.
    pub fn run(self) -> Result<u8> {
        match self {
            Self::Verify(arguments) => verify::run(&arguments),
            Self::Selftest(arguments) => selftest::run(&arguments),
            Self::Gate(arguments) => gate::run(&arguments),
            Self::Bench(arguments) => bench::run(&arguments),
            Self::Report(arguments) => report::run(&arguments),
            Self::Archive(arguments) => archive::run(&arguments),
            Self::Replay(arguments) => archive::replay(&arguments),
            Self::Track(arguments) => track::run(&arguments),
            Self::Shrink(arguments) => shrink::run(&arguments),
            Self::Audit(arguments) => audit::run(&arguments),
            Self::Geometry(arguments) => geometry::run(&arguments),
            Self::Leak(arguments) => leak::run(&arguments),
            Self::Export(arguments) => export::run(&arguments),
            Self::Picture(arguments) => picture::run(&arguments),
            Self::Import(arguments) => import::run(&arguments),
            Self::Diff(arguments) => diff::run(&arguments),
            Self::Why(arguments) => why::run(&arguments),
            Self::Planted { fault } => plant(&fault),
        }
    }
}

fn plant(fault: &str) -> ! {
    let _place = tempfile::tempdir();
    let panic = || panic!("a fault that was asked for");
    match fault {
        "memory" => _ = black_box(vec![0_u8; 1 << 62]),
        "thread" => thread::scope(|scope| _ = scope.spawn(panic)),
        _ => panic(),
    }
    unreachable!("{fault} has ended the harness")
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
    fn help_ends_with_the_examples_of_the_page() {
        let mut count = 0;
        for command in Arguments::command().get_subcommands() {
            let Some(help) = command.get_after_help().map(ToString::to_string) else { continue };
            assert!(
                help.contains(&format!("Examples:\n  harness {} ", command.get_name())),
                "{help}"
            );
            count += 1;
        }
        assert_eq!(count, 11);
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
