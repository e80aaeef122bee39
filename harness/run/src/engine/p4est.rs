//! The p4est engine: balances a base tree, leaf for leaf, with code that is not ours.

use super::mpi;
use std::path::Path;
use std::process::Command;

/// The engine's exit code for a tree deeper than p4est goes.
pub const EXIT_TOO_DEEP: i32 = 3;

/// The engine's command: reads the leaf-set directory `tree`, writes `leaves-00000.npy` into the existing
/// directory `out`.
pub fn command(engine: &Path, tree: &Path, out: &Path) -> Command {
    let mut command = Command::new(engine);
    command.arg(tree).arg(out);
    mpi::set_environment(&mut command);
    command
}
