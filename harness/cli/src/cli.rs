//! What may be said on the command line.

use crate::commands;
use clap::{Parser, Subcommand};

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
    Verify(Box<commands::verify::Arguments>),
    /// Corrupts correct meshes in every way of a catalogue; each must be caught by the check meant for it
    Selftest(commands::selftest::Arguments),
    /// Holds a candidate against a baseline: correctness, exact counters, instructions, time
    Gate(Box<commands::gate::Arguments>),
    /// Measures: strong and weak scaling, spacing, layers, weights; every result is appended to a record
    Bench(Box<commands::bench::Arguments>),
    /// Makes the runs that a table of targets needs, and reports which targets are met
    Targets(Box<commands::targets::Arguments>),
    /// Makes figures, a page, a LaTeX fragment and an artifact description from records of bench
    Report(commands::report::Arguments),
    /// Keeps a history of numbers by commit and finds where they changed
    Track(Box<commands::track::Arguments>),
    /// Reduces a case that fails to the smallest that still does
    Shrink(Box<commands::shrink::Arguments>),
    /// Checks a leaf-set directory of any size by itself
    Audit(commands::audit::Arguments),
    /// Diagnoses a geometry before it is meshed: which defects it has, and what each means for the mesh
    Geometry(commands::geometry::Arguments),
    /// Writes a leaf-set directory as a VTK unstructured grid, to look at in ParaView or pyvista
    Export(commands::export::Arguments),
    /// Tells where two leaf-set directories differ, and which rule of the definition decides
    Diff(commands::diff::Arguments),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use run::verify::options::Need;

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

    #[test]
    fn ranks_launcher_and_cells_are_read() {
        let words = [
            "harness",
            "bench",
            "uav-small",
            "--ranks",
            "1..8",
            "--cells",
            "1e6,2e6",
            "--launcher",
            "srun -n {ranks}",
        ];
        let Command::Bench(bench) = Arguments::try_parse_from(words).unwrap().command else {
            panic!()
        };
        assert_eq!(bench.ranks.unwrap().0, [1, 2, 4, 8]);
        assert_eq!(bench.cells, [1_000_000, 2_000_000]);
        assert!(Arguments::try_parse_from(["harness", "bench", "--launcher", "mpirun"]).is_err());
        assert!(Arguments::try_parse_from(["harness", "bench", "--cells", "5"]).is_err());
    }

    #[test]
    fn targets_is_a_command_with_the_options_of_a_measuring_session() {
        let words = ["harness", "targets", "t.toml", "--only", "a,b", "--repeat", "2", "--show"];
        let Command::Targets(targets) = Arguments::try_parse_from(words).unwrap().command else {
            panic!()
        };
        assert_eq!(targets.only, ["a", "b"]);
        assert!(targets.show && targets.session.repeat == Some(2));
        assert!(Arguments::try_parse_from(["harness", "targets"]).is_err());
        let old = ["harness", "bench", "--targets", "t.toml"];
        assert!(Arguments::try_parse_from(old).is_err());
    }
}
