//! The programs under test, and those that this test compiles.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use tempfile::TempDir;

/// The command `harness`.
pub const HARNESS: &str = env!("CARGO_BIN_EXE_harness");

/// The extent of the test, a number or nothing.
fn extent() -> Option<usize> {
    std::env::var("FAULTS").ok()?.parse().ok()
}

/// Whether faults occur in all phases and under all commands, and not in a sample.
pub fn is_full() -> bool {
    extent().is_some()
}

/// Calls per program that fail in the same way: all of them, or as many that are spread over the run.
pub fn calls_max() -> usize {
    extent().unwrap_or(1)
}

/// Reports, even if the output of the test is captured, that something was left out.
pub fn skip(what: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {what}: {why}");
}

/// A program of the workspace, which is built together with the command `harness`.
pub fn program(name: &str) -> Option<PathBuf> {
    Some(Path::new(HARNESS).with_file_name(name)).filter(|path| path.is_file())
}

/// Whether `mpirun` starts ranks of the mesher.
pub fn mpi() -> Result<PathBuf, String> {
    static MPI: LazyLock<Result<PathBuf, String>> = LazyLock::new(|| {
        let mesher = program("mesher").ok_or("the mesher was not built")?;
        let mut command = mpirun(2);
        let output = command.arg(&mesher).arg("--help").output();
        let output = output.map_err(|e| format!("mpirun: {e}"))?;
        let mut command = Command::new(&mesher);
        let built =
            command.args(["absent.toml", "--comm", "mpi"]).output().map_err(|e| e.to_string())?;
        match output.status.success() {
            true if !String::from_utf8_lossy(&built.stderr).contains("without MPI") => Ok(mesher),
            true => Err("the mesher was built without MPI".to_owned()),
            false => Err("mpirun starts no ranks".to_owned()),
        }
    });
    MPI.clone()
}

/// A command that starts ranks.
pub fn mpirun(ranks: usize) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["-n", &ranks.to_string()]);
    for name in ["ALLOW_RUN_AS_ROOT", "ALLOW_RUN_AS_ROOT_CONFIRM", "MCA_rmaps_base_oversubscribe"] {
        command.env(format!("OMPI_{name}"), "1");
    }
    command
}

static COMPILED: LazyLock<TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());

/// Compiles a C source of this directory.
///
/// # Panics
/// If the compiler refuses it.
fn compile(name: &str, options: &[&str]) -> Result<PathBuf, String> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(name);
    let to = COMPILED.path().join(name).with_extension("");
    let output = Command::new("cc").args(["-O1", "-o"]).arg(&to).arg(source).args(options).output();
    let output = output.map_err(|e| format!("cc: {e}"))?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Ok(to)
}

/// The program that injects faults into system calls.
pub fn injector() -> Result<PathBuf, String> {
    static INJECTOR: LazyLock<Result<PathBuf, String>> =
        LazyLock::new(|| {
            let path = compile("inject.c", &[])?;
            let log = COMPILED.path().join("log");
            let mut command = Command::new(&path);
            command.args(["open", "count", "0", "/etc"]).arg(log).arg("true");
            match command.status() {
                Ok(status) if status.success() => Ok(path),
                _ => Err("system calls cannot be watched here (seccomp with user notification)"
                    .to_owned()),
            }
        });
    INJECTOR.clone()
}

/// The library whose clock jumps.
pub fn clock() -> Result<PathBuf, String> {
    static CLOCK: LazyLock<Result<PathBuf, String>> =
        LazyLock::new(|| compile("clock.c", &["-shared", "-fPIC", "-ldl"]));
    CLOCK.clone()
}
