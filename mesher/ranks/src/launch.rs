//! The environment that launchers of parallel jobs set for each process.

use std::env::var;

#[cfg(feature = "mpi")]
pub use crate::mpi::{check_size, join};

/// What launchers call the number of processes that they have started, with the launcher's name. The first that is set counts: mpirun
/// starts its own helpers with Slurm.
const SIZES: [(&str, &str); 6] = [
    ("OMPI_COMM_WORLD_SIZE", "Open MPI's mpirun"),
    ("MV2_COMM_WORLD_SIZE", "MVAPICH's mpirun"),
    ("PMI_SIZE", "MPICH's or Intel MPI's mpirun"),
    ("PMIX_SIZE", "a PMIx launcher"),
    ("SLURM_STEP_NUM_TASKS", "Slurm's srun"),
    ("MPI_LOCALNRANKS", "MPICH's mpirun"),
];

/// The launcher of this process, and the number of processes that it has started.
pub(crate) fn launcher() -> Option<(&'static str, usize)> {
    SIZES.iter().find_map(|(v, name)| Some((*name, var(v).ok()?.parse().ok()?)))
}

/// Number of ranks that a launcher of MPI jobs has started; none without a launcher.
pub fn ranks() -> Option<usize> {
    launcher().map(|(_, ranks)| ranks)
}

/// Ends all ranks of the job at once.
pub fn abort(code: i32) -> ! {
    #[cfg(feature = "mpi")]
    crate::mpi::abort(code);
    #[cfg(not(feature = "mpi"))]
    std::process::exit(code)
}

/// Whether a launcher has started this process as a rank of an MPI job.
pub fn is_mpi_job() -> bool {
    ranks().is_some() || var("SLURM_PROCID").is_ok() && var("PMIX_RANK").is_ok()
}

/// Whether this process prints what the job has to print before its ranks can communicate: rank 0 of a job, or the only
/// process.
pub fn is_first() -> bool {
    ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID"]
        .iter()
        .find_map(|v| var(v).ok()?.parse::<usize>().ok())
        .is_none_or(|rank| rank == 0)
}
