//! The environment that launchers of parallel jobs set for each process.

use std::env::var;

#[cfg(feature = "mpi")]
pub use crate::mpi::join;

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
fn launcher() -> Option<(&'static str, usize)> {
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
    std::process::exit(code)
}

/// Refuses a communicator that is not the whole job: with another MPI's launcher, every process would be a job of its own.
///
/// # Errors
/// If the launcher has started another number of ranks than the MPI library sees, in a sentence.
#[cfg(feature = "mpi")]
pub fn check_size(comm: &dyn crate::Comm) -> Result<(), String> {
    let library = ::mpi::environment::library_version();
    check(launcher(), comm.size(), library.as_deref().unwrap_or("of unknown version"))
}

#[cfg(any(feature = "mpi", test))]
fn check(launcher: Option<(&str, usize)>, size: usize, library: &str) -> Result<(), String> {
    // Some libraries go on for pages.
    let first = library.split(['\n', ',']).next().unwrap_or_default();
    let library = first.split_whitespace().collect::<Vec<_>>().join(" ");
    match launcher {
        Some((name, ranks)) if ranks != size => Err(format!(
            "{name} has started {ranks} ranks, but the MPI library of this mesher, {library}, sees {size}: use the mpirun of that library"
        )),
        _ => Ok(()),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_communicator_of_another_size_than_the_job_is_refused_with_both_names() {
        let library = "MPICH Version:\t4.0.2\nMPICH Release date";
        let message = check(Some(("Open MPI's mpirun", 3)), 1, library).unwrap_err();
        let expected = "Open MPI's mpirun has started 3 ranks, but the MPI library of this mesher, MPICH Version: 4.0.2, sees 1: \
                        use the mpirun of that library";
        assert_eq!(message, expected);
        assert!(check(Some(("srun", 3)), 3, library).is_ok() && check(None, 1, library).is_ok());
    }
}
