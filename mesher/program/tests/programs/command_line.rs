//! The options that print something and exit, rejected values, and output that is printed once per job.

use crate::process::{Finished, Workspace, run, tetrahedron};

/// Runs the mesher as rank `rank` of three under a launcher that sets `variables`, as `_SIZE` and `_RANK`.
fn run_as_rank(workspace: &Workspace, args: &[&str], launcher: &str, rank: usize) -> Finished {
    let mut command = workspace.mesher(args);
    for v in ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"] {
        command.env_remove(v);
    }
    command.env(format!("{launcher}_SIZE"), "3").env(format!("{launcher}_RANK"), rank.to_string());
    run(command)
}

#[test]
fn help_is_printed_once_per_job() {
    let workspace = Workspace::new();
    for launcher in ["OMPI_COMM_WORLD", "PMI", "PMIX"] {
        for (rank, is_printed) in [(0, true), (1, false), (2, false)] {
            for option in ["--help", "--version"] {
                let finished = run_as_rank(&workspace, &[option], launcher, rank);
                finished.succeeds();
                assert_eq!(!finished.stdout.is_empty(), is_printed, "{launcher} {rank} {option}");
            }
        }
    }
}

/// Several ranks without communication would each mesh the case; a single one may.
#[test]
fn ranks_of_a_job_are_not_started_without_communication() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let args = ["body.stl", "--spacing-min", "0.5", "--quiet", "--comm", "solo"];
    for launcher in ["OMPI_COMM_WORLD", "PMI", "PMIX"] {
        run_as_rank(&workspace, &args, launcher, 0).refuses(2, &["--comm", "on its own"]);
        let second = run_as_rank(&workspace, &args, launcher, 1);
        assert_eq!((second.code, second.stderr.as_str()), (Some(2), ""));
        let mut alone = workspace.mesher(&args);
        alone.env(format!("{launcher}_SIZE"), "1").env(format!("{launcher}_RANK"), "0");
        run(alone).succeeds();
    }
    // The shell of an allocation, or what is left of one, is no job.
    for left in ["SLURM_PROCID", "PMIX_RANK"] {
        let mut alone = workspace.mesher(&args[..4]);
        alone.env(left, "0");
        run(alone).succeeds();
    }
}

/// A build without MPI cannot agree on errors: only the launcher's variables distinguish ranks.
#[cfg(not(feature = "mpi"))]
#[test]
fn without_mpi_one_process_of_a_job_prints_the_error() {
    let workspace = Workspace::new();
    for launcher in ["OMPI_COMM_WORLD", "PMI", "PMIX"] {
        for args in [&["case.toml"][..], &["case.toml", "--weights", "no-such-weights"]] {
            run_as_rank(&workspace, args, launcher, 0).refuses(2, &["built without MPI"]);
            for rank in [1, 2] {
                let finished = run_as_rank(&workspace, args, launcher, rank);
                assert_eq!(
                    (finished.code, &*finished.stdout, &*finished.stderr),
                    (Some(2), "", "")
                );
            }
        }
    }
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn ranks_of_mpi_print_help_and_command_line_errors_once() {
    let workspace = Workspace::new();
    let finished = run(workspace.mpirun(3, &["--version"]));
    finished.succeeds();
    assert_eq!(finished.stdout.lines().count(), 1, "{finished:?}");
    run(workspace.mpirun(3, &["case.toml", "--weights", "none-such"]))
        .refuses_under_launcher(2, &["'none-such'", "--weights"]);
}

/// With the launcher of another MPI, each process is a job of one rank. `ci/mpich` tries both pairs of launcher and library.
#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "needs MPI: build with --features mpi")]
fn a_launcher_that_started_more_ranks_than_mpi_sees_is_refused() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    let args = ["body.stl", "--spacing-min", "0.5", "--quiet", "--out", "mesh"];
    run_as_rank(&workspace, &args, "OMPI_COMM_WORLD", 0)
        .refuses(2, &["Open MPI's mpirun has started 3 ranks", "sees 1"]);
    let second = run_as_rank(&workspace, &args, "OMPI_COMM_WORLD", 1);
    assert_eq!((second.code, second.stderr.as_str()), (Some(2), ""));
    assert!(!workspace.path().join("mesh").exists());
}

#[test]
fn the_version_has_the_commit_of_the_work_tree() {
    let workspace = Workspace::new();
    let finished = run(workspace.mesher(&["--version"]));
    finished.succeeds();
    let version = concat!("mesher ", env!("CARGO_PKG_VERSION"));
    let rest =
        finished.stdout.trim_end().strip_prefix(version).expect("the crate's version").trim();
    let commit = rest.strip_prefix('(').and_then(|r| r.strip_suffix(')'));
    let is_hash = |c: &str| c.len() >= 7 && c.chars().all(|c| c.is_ascii_hexdigit());
    let is_tag_or_hash = |c: &str| is_hash(c.trim_end_matches("-dirty")) || c.contains("-g");
    // Sources without git have no commit.
    assert!(rest.is_empty() || commit.is_some_and(is_tag_or_hash), "{finished:?}");
}

/// Standard error is not a terminal here, so clap writes no colours and the mesher no progress.
#[test]
fn output_into_a_pipe_has_no_control_characters() {
    let workspace = Workspace::new();
    workspace.write("body.stl", tetrahedron());
    for args in [&["--help"][..], &["body.stl", "--spacing-min", "0.5"], &["body.stl", "--no"]] {
        let finished = run(workspace.mesher(args));
        let is_plain = |s: &str| s.chars().all(|c| c == '\n' || !c.is_control());
        assert!(is_plain(&finished.stdout) && is_plain(&finished.stderr), "{finished:?}");
    }
}
