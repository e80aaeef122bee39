//! Child programs under a time limit, ended with everything that they started.
//!
//! Invariants:
//! - a child leads a session of its own, so that its descendants can be found even when they left its
//!   process group, as the ranks of OpenMPI's `mpirun` do;
//! - when [`run`] returns, no process of that session is left, however the child ended;
//! - what the child printed is in files, so that no pipe can fill and no output is lost with a hang.

use super::interrupt;
use super::memory::Scales;
use super::session;
use rustix::process::{Signal, kill_process, kill_process_group, setsid};
use std::fs::{self, File};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How a child ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// By itself, with this code.
    Exited(i32),
    /// By a signal that the harness did not send.
    Signalled(i32),
    /// Killed by the harness at the end of its time limit.
    TimedOut,
    /// Killed by the harness because the user asked it to end.
    Interrupted,
}

/// One child's run.
#[derive(Debug)]
pub struct Finished {
    /// How it ended.
    pub end: End,
    /// From start to end, in seconds.
    pub time_wall_s: f64,
    /// What it printed on standard output.
    pub stdout: PathBuf,
    /// What it printed on standard error.
    pub stderr: PathBuf,
    /// What each rank was last doing, in the order of ranks; filled only when the child timed out.
    pub last_doing: Vec<(usize, String)>,
}

impl Finished {
    /// The first line that the child printed as an error: where our own programs say what is wrong, and
    /// `mpirun` has much to say after them.
    pub fn first_error_line(&self) -> String {
        self.error_lines().into_iter().next().unwrap_or_else(|| "it printed no error".to_owned())
    }

    /// The last line that the child printed as an error: where Python says what is wrong.
    pub fn last_error_line(&self) -> String {
        self.error_lines().pop().unwrap_or_else(|| "it printed no error".to_owned())
    }

    /// Lines with at least one letter in them, so that rulers are none.
    fn error_lines(&self) -> Vec<String> {
        let text = fs::read_to_string(&self.stderr).unwrap_or_default();
        let lines = text.lines().filter(|line| line.contains(char::is_alphabetic));
        lines.map(|line| line.trim().to_owned()).collect()
    }
}

/// What a child is allowed, and where it leaves its traces.
#[derive(Debug)]
pub struct Watch<'a> {
    /// Killed after this.
    pub limit: Duration,
    /// Directory, existing, that receives `NAME.stdout` and `NAME.stderr`.
    pub logs: &'a Path,
    /// The NAME above; also what the child is called in messages.
    pub name: &'a str,
    /// Directory in which each rank keeps a file `rank-NNNNN.txt` with what it is doing.
    pub status: Option<&'a Path>,
}

/// Runs the child to its end, or to its time limit, or to the user's Ctrl-C.
///
/// # Errors
/// Where the child could not be started or its output files not be made.
pub fn run(command: &mut Command, watch: &Watch) -> io::Result<Finished> {
    run_seen(command, watch, &mut |_| {})
}

/// The same, with the memory of the child and of all that it starts weighed.
///
/// # Errors
/// Those of [`run`].
pub fn run_weighed(
    command: &mut Command,
    watch: &Watch,
    scales: &mut Scales,
) -> io::Result<Finished> {
    run_seen(command, watch, &mut |leader| scales.weigh(leader))
}

/// Runs the child; while it is waited for, `look` is called with its id.
fn run_seen(
    command: &mut Command,
    watch: &Watch,
    look: &mut dyn FnMut(u32),
) -> io::Result<Finished> {
    let stdout = watch.logs.join(format!("{}.stdout", watch.name));
    let stderr = watch.logs.join(format!("{}.stderr", watch.name));
    command.stdin(Stdio::null()).stdout(File::create(&stdout)?).stderr(File::create(&stderr)?);
    // SAFETY: setsid is async-signal-safe and touches no memory of the parent.
    unsafe { command.pre_exec(|| setsid().map(drop).map_err(io::Error::from)) };
    let start = Instant::now();
    let mut child = command.spawn()?;
    let (end, last_doing) = wait(&mut child, start, watch, look)?;
    kill_session(child.id());
    Ok(Finished { end, time_wall_s: start.elapsed().as_secs_f64(), stdout, stderr, last_doing })
}

fn wait(
    child: &mut Child,
    start: Instant,
    watch: &Watch,
    look: &mut dyn FnMut(u32),
) -> io::Result<(End, Vec<(usize, String)>)> {
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = child.try_wait()? {
            // A Ctrl-C in a terminal may reach a child by other ways; its end is then no result.
            let end = if interrupt::requested() { End::Interrupted } else { end_of(status) };
            return Ok((end, Vec::new()));
        }
        if interrupt::requested() {
            end_child(child)?;
            return Ok((End::Interrupted, Vec::new()));
        }
        if start.elapsed() >= watch.limit {
            let last_doing = watch.status.map(read_status).unwrap_or_default();
            end_child(child)?;
            return Ok((End::TimedOut, last_doing));
        }
        look(child.id());
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}

fn end_of(status: ExitStatus) -> End {
    match status.code() {
        Some(code) => End::Exited(code),
        None => End::Signalled(status.signal().unwrap_or(0)),
    }
}

/// Asks the child to end, which lets `mpirun` end its ranks, and kills it if it does not.
fn end_child(child: &mut Child) -> io::Result<()> {
    if let Some(group) = session::pid_of(child.id()) {
        let _ = kill_process_group(group, Signal::TERM);
    }
    let patience = Instant::now() + Duration::from_secs(3);
    while Instant::now() < patience {
        if child.try_wait()?.is_some() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    kill_session(child.id());
    child.wait().map(drop)
}

/// Kills every process of the session that this process led. Processes of a session can be started while
/// it is being killed, so it looks until it finds none.
fn kill_session(leader: u32) {
    for _ in 0..100 {
        let members = session::members(leader);
        if members.is_empty() {
            return;
        }
        for member in members {
            let _ = kill_process(member, Signal::KILL);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// What the ranks' status files say, in the order of ranks.
fn read_status(directory: &Path) -> Vec<(usize, String)> {
    let Ok(entries) = fs::read_dir(directory) else {
        return Vec::new();
    };
    let of_file = |path: PathBuf| {
        let rank = path.file_stem()?.to_str()?.strip_prefix("rank-")?.parse().ok()?;
        Some((rank, fs::read_to_string(&path).ok()?.trim().to_owned()))
    };
    let mut status: Vec<_> = entries.flatten().filter_map(|entry| of_file(entry.path())).collect();
    status.sort();
    status
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, limit_ms: u64) -> (Finished, tempfile::TempDir) {
        let logs = tempfile::tempdir().unwrap();
        let limit = Duration::from_millis(limit_ms);
        let watch = Watch { limit, logs: logs.path(), name: "child", status: Some(logs.path()) };
        let mut command = Command::new("sh");
        command.arg("-c").arg(script).current_dir(logs.path());
        (run(&mut command, &watch).unwrap(), logs)
    }

    #[test]
    fn exit_code_and_output_are_kept() {
        let (finished, _logs) = shell(
            "echo yes; echo ---- >&2; echo first >&2; echo last >&2; echo >&2; exit 7",
            60_000,
        );
        assert_eq!(finished.end, End::Exited(7));
        assert_eq!(fs::read_to_string(&finished.stdout).unwrap(), "yes\n");
        assert_eq!(finished.first_error_line(), "first");
        assert_eq!(finished.last_error_line(), "last");
    }

    #[test]
    fn a_signal_is_no_exit_code() {
        assert_eq!(shell("kill -9 $$", 60_000).0.end, End::Signalled(9));
    }

    #[test]
    fn a_hang_is_killed_with_what_the_ranks_were_doing() {
        let script = "echo layer > rank-00001.txt; echo balance > rank-00000.txt; sleep 600";
        let (finished, _logs) = shell(script, 300);
        assert_eq!(finished.end, End::TimedOut);
        assert_eq!(finished.last_doing, [(0, "balance".to_owned()), (1, "layer".to_owned())]);
        assert!(finished.time_wall_s < 60.0);
    }

    #[test]
    fn a_child_that_ignores_sigterm_is_killed() {
        let (finished, _logs) = shell("trap '' TERM; while :; do sleep 1; done", 200);
        assert_eq!(finished.end, End::TimedOut);
    }

    #[test]
    fn nothing_of_the_session_survives_its_leader() {
        // The background process leaves the group, as the ranks of mpirun do, but not the session.
        let script = "exec bash -c 'set -m; sleep 600 & echo $! > id'";
        let (finished, logs) = shell(script, 30_000);
        assert_eq!(finished.end, End::Exited(0));
        let id = fs::read_to_string(logs.path().join("id")).unwrap();
        let stat = fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
        assert!(!session::session_and_life(&stat).is_some_and(|(_, alive)| alive), "{stat}");
    }

    #[test]
    fn a_childs_child_is_weighed() {
        let logs = tempfile::tempdir().unwrap();
        let limit = Duration::from_secs(60);
        let watch = Watch { limit, logs: logs.path(), name: "child", status: None };
        let mut command = std::process::Command::new("sh");
        // `tail` keeps the last line, which is all 30 MB of it, until its input ends.
        command.arg("-c").arg("(head -c 30000000 /dev/zero; sleep 1) | tail -n 1 > /dev/null");
        let mut scales = Scales::new();
        run_weighed(&mut command, &watch, &mut scales).unwrap();
        assert!(scales.peak_bytes() > 30_000_000, "{}", scales.peak_bytes());
    }
}
