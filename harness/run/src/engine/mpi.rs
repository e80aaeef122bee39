//! Starting a program on many ranks.
//!
//! Invariant: shared memory that a run leaves behind lies in a directory of its own, so that cleaning up
//! after a killed run cannot touch another's.

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// One run's place in shared memory, removed with whatever is left in it.
#[derive(Debug)]
pub struct SharedMemory(Option<TempDir>);

impl SharedMemory {
    /// A new place; none where the machine has no `/dev/shm`, and OpenMPI then chooses for itself.
    pub fn new() -> Self {
        Self(tempfile::Builder::new().prefix("harness-").tempdir_in("/dev/shm").ok())
    }

    /// Has a command use it.
    pub fn add_to(&self, command: &mut Command) {
        if let Some(place) = &self.0 {
            command.env("OMPI_MCA_btl_vader_backing_directory", place.path());
            command.env("OMPI_MCA_orte_tmpdir_base", place.path());
        }
    }
}

impl Default for SharedMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// `mpirun -n RANKS PROGRAM`, as root and on fewer cores than ranks too; arguments are the caller's to add.
pub fn command(mpirun: &Path, ranks: usize, program: &Path, shared: &SharedMemory) -> Command {
    let mut command = Command::new(mpirun);
    command.arg("-n").arg(ranks.to_string()).arg(program);
    set_environment(&mut command);
    shared.add_to(&mut command);
    command
}

/// What OpenMPI wants to be told; also wanted by a program that starts MPI without `mpirun`.
pub fn set_environment(command: &mut Command) {
    command
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        // On a shared machine the cores that ranks would be bound to may be busy with others' work.
        .env("OMPI_MCA_hwloc_base_binding_policy", "none");
}

/// Where `mpirun` is, if the machine has it.
pub fn found(mpirun: &Path) -> Option<PathBuf> {
    mpirun.is_file().then(|| mpirun.to_owned())
}
