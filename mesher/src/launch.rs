//! The environment that launchers of parallel jobs set for each process.

use std::env::var;

/// Number of ranks that a launcher of MPI jobs has started; none without a launcher.
pub fn ranks() -> Option<usize> {
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS"]
        .iter()
        .find_map(|v| var(v).ok()?.parse().ok())
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

/// Makes the end of the launcher an interrupt of this rank: a launcher that is interrupted twice ends at once and leaves its ranks
/// running.
#[cfg(all(feature = "mpi", target_os = "linux"))]
pub fn end_with_launcher() {
    use rustix::process::{Signal, set_parent_process_death_signal};
    // Without it, the ranks end when they next communicate.
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
}
