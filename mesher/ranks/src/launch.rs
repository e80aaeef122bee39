//! The environment that launchers of parallel jobs set for each process.

use crate::Comm;
use std::env::var;

#[cfg(feature = "mpi")]
use crate::{Metered, mpi};

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

/// Whether this program was built with MPI.
pub const HAS_MPI: bool = cfg!(feature = "mpi");

/// Joins the job of MPI that the launcher has started. Once per process, and only if the program [has MPI](HAS_MPI).
///
/// # Panics
/// If MPI was initialised before, or is not built in.
#[cfg(feature = "mpi")]
pub fn join() -> Box<dyn Comm> {
    // A launcher that is interrupted twice ends at once and leaves its ranks running: its end interrupts them. Where that is impossible, they end
    // when they next communicate.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM));
    Box::new(Metered::new(mpi::Mpi::start()))
}

/// The same for a program without MPI: never called.
#[cfg(not(feature = "mpi"))]
pub fn join() -> Box<dyn Comm> {
    unreachable!("MPI is chosen only where it is built in")
}

/// Ends all ranks of the job at once.
pub fn abort(code: i32) -> ! {
    #[cfg(feature = "mpi")]
    mpi::abort(code);
    #[cfg(not(feature = "mpi"))]
    std::process::exit(code)
}

/// Refuses a communicator that is not the whole job: with another MPI's launcher, every process would be a job of its own.
///
/// # Errors
/// If the launcher has started another number of ranks than the MPI library sees, in a sentence.
pub fn check_size(comm: &dyn Comm) -> Result<(), String> {
    #[cfg(feature = "mpi")]
    let library = mpi::library();
    #[cfg(not(feature = "mpi"))]
    let library = String::new();
    check(launcher(), comm.size(), &library)
}

fn check(launcher: Option<(&str, usize)>, size: usize, library: &str) -> Result<(), String> {
    match launcher {
        Some((name, ranks)) if ranks != size => Err(format!(
            "{name} has started {ranks} ranks, but the MPI library of this mesher, {}, sees {size}: use the mpirun of that library",
            name_of(library)
        )),
        _ => Ok(()),
    }
}

/// The first words of what an MPI library says of itself: some go on for pages.
fn name_of(library: &str) -> String {
    let first = library.split(['\n', ',']).next().unwrap_or_default();
    first.split_whitespace().collect::<Vec<_>>().join(" ")
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
        let message = check(Some(SIZES[0]).map(|(_, name)| (name, 3)), 1, library).unwrap_err();
        let expected = "Open MPI's mpirun has started 3 ranks, but the MPI library of this mesher, MPICH Version: 4.0.2, sees 1: \
                        use the mpirun of that library";
        assert_eq!(message, expected);
        assert!(check(Some(("srun", 3)), 3, library).is_ok() && check(None, 1, library).is_ok());
    }
}
