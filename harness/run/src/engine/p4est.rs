//! The p4est program, which balances a base tree independently of our code.
//!
//! It is not an [`Engine`](super::runner::Engine): it reads a leaf-set directory and not a case file, and it writes
//! bare leaves without a manifest, so no key of an engine file would describe its run.

use super::launcher;
use std::path::Path;
use std::process::Command;

/// The exit code for a tree that is deeper than p4est supports.
pub const EXIT_TOO_DEEP: i32 = 3;

/// The command that reads the leaf-set directory `tree` and writes `leaves-00000.npy` into the existing directory
/// `out`.
pub fn command(program: &Path, tree: &Path, out: &Path) -> Command {
    let mut command = Command::new(program);
    command.arg(tree).arg(out);
    launcher::set_environment(&mut command);
    command
}
