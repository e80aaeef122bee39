//! Runs child processes under a time limit, ends them with all their descendants, and classifies the end.
//!
//! Invariants:
//! - a child leads a session of its own, so that its descendants can be found even if they left its process group, as
//!   the ranks of OpenMPI's `mpirun` do;
//! - when [`run`] returns, no process of that session is left, however the child ended;
//! - the child's output goes to files of bounded size, so that no pipe can fill, and neither can the disk, and no output is
//!   lost with a hang.

use super::failure::{End, Failure, describe_activity};
use super::interrupt;
use super::memory::MemorySampler;
use super::output::Output;
use super::reap::{Ending, try_reap};
use super::session;
use rustix::process::{Signal, setsid};
use std::fs;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// A child that exited with code 0.
#[derive(Debug)]
pub struct Finished {
    /// Wall time from start to end, in seconds.
    pub time_wall_s: f64,
    /// CPU time of the child and of all descendants that were waited for, in seconds.
    pub time_cpu_s: f64,
    /// File with the standard output.
    pub stdout: PathBuf,
    /// Peak memory of the child and its descendants, if it was sampled.
    pub peak_rss_bytes: Option<u64>,
}

/// A child's name and limits, and where its output goes.
#[derive(Clone, Debug)]
pub struct Watch<'a> {
    /// The child's name in messages, and the `NAME` of its output files.
    pub name: &'a str,
    /// Time after which it is killed.
    pub limit: Duration,
    /// Existing directory that receives `NAME.stdout` and `NAME.stderr`.
    pub logs: &'a Path,
    /// Directory in which rank N keeps its current activity in the file `rank-NNNNN.txt`.
    pub status: Option<&'a Path>,
    /// Sample the memory of the child and its descendants.
    pub sample_memory: bool,
}

impl<'a> Watch<'a> {
    /// A child without status files and memory samples.
    pub fn new(name: &'a str, limit: Duration, logs: &'a Path) -> Self {
        Self { name, limit, logs, status: None, sample_memory: false }
    }

    pub(super) fn log(&self, stream: &str) -> PathBuf {
        self.logs.join(format!("{}.{stream}", self.name))
    }

    /// What the ranks are doing, if they report it.
    pub(super) fn activity(&self) -> Option<String> {
        self.status.map(|status| describe_activity(&read_status(status)))
    }
}

/// Runs the child to its end, to its time limit or to the user's interrupt.
///
/// # Errors
/// If the child cannot be started or does not exit with code 0.
pub fn run(command: &mut Command, watch: &Watch) -> Result<Finished, Failure> {
    let failure = |end| Failure::new(watch.name, end);
    if interrupt::requested() {
        return Err(failure(End::Interrupted));
    }
    let mut sampler = watch.sample_memory.then(MemorySampler::new);
    let (start, child, mut outputs) = start(command, watch).map_err(|error| {
        let program = Path::new(command.get_program()).display();
        failure(End::Missing(format!("cannot be started: {program}: {error}")))
    })?;
    let end = wait(&child, start, watch, sampler.as_mut(), &mut outputs);
    let time_wall_s = start.elapsed().as_secs_f64();
    kill_session(child.id());
    interrupt::forget_child(child.id());
    let finished = outputs.into_iter().try_for_each(Output::finish);
    finished.map_err(|error| failure(End::Unusable(format!("has no readable output: {error}"))))?;
    match end {
        Ok(Ok(time_cpu_s)) => Ok(Finished {
            time_wall_s,
            time_cpu_s,
            stdout: watch.log("stdout"),
            peak_rss_bytes: sampler.map(|sampler| sampler.peak_bytes()),
        }),
        Ok(Err(end)) => Err(failure(end)),
        Err(error) => Err(failure(End::Unusable(format!("could not be waited for: {error}")))),
    }
}

fn start(command: &mut Command, watch: &Watch) -> io::Result<(Instant, Child, [Output; 2])> {
    let outputs = [Output::create(&watch.log("stdout"))?, Output::create(&watch.log("stderr"))?];
    command.stdin(Stdio::null()).stdout(outputs[0].stdio()?).stderr(outputs[1].stdio()?);
    lead_session(command);
    let start = Instant::now();
    let child = interrupt::spawn(command, false)?;
    Ok((start, child, outputs))
}

/// Makes the child lead a session of its own.
pub(super) fn lead_session(command: &mut Command) {
    // SAFETY: setsid is async-signal-safe and touches no memory of the parent.
    unsafe { command.pre_exec(|| setsid().map(drop).map_err(io::Error::from)) };
}

/// The CPU time of a child that exited with code 0, or how it ended otherwise.
fn wait(
    child: &Child,
    start: Instant,
    watch: &Watch,
    mut sampler: Option<&mut MemorySampler>,
    outputs: &mut [Output; 2],
) -> io::Result<Result<f64, End>> {
    let ending = Ending::of(child);
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some((status, time_cpu_s)) = try_reap(child)? {
            let errors = || outputs[1].since(0);
            // Ctrl-C in a terminal also reaches the child directly; its exit code is then not a result.
            let interrupted = interrupt::requested().then_some(End::Interrupted);
            return Ok(interrupted.or_else(|| judge(status, errors)).map_or(Ok(time_cpu_s), Err));
        }
        if interrupt::requested() {
            end_child(child)?;
            return Ok(Err(End::Interrupted));
        }
        if start.elapsed() >= watch.limit {
            let activity = watch.activity();
            end_child(child)?;
            return Ok(Err(End::TimedOut { limit: watch.limit, activity }));
        }
        outputs.iter_mut().for_each(Output::discard_middle);
        if let Some(sampler) = &mut sampler {
            sampler.sample(child.id());
        }
        ending.wait(pause);
        // Samples of memory are taken between pauses, often enough in a run of any length.
        let longest = if sampler.is_some() { 5 } else { 20 };
        pause = (pause * 2).min(Duration::from_millis(longest));
    }
}

/// How a child failed, from its status and its standard error.
pub(super) fn judge(status: ExitStatus, errors: impl FnOnce() -> String) -> Option<End> {
    match status.code() {
        Some(0) => None,
        Some(code) => Some(End::Exited { code, error: last_lines(&errors()) }),
        None => Some(End::Signalled(status.signal().unwrap_or(0))),
    }
}

/// Lines of the standard error that a message shows.
const LINES_SHOWN: usize = 3;

/// The last lines of a standard error, in one line: programs print the error at the end. Lines without a word are
/// ignored, and so are the paragraphs between rules of dashes and the messages that `mpirun` adds after the program's own error.
pub(super) fn last_lines(text: &str) -> String {
    let mut of_mpirun = false;
    let is_own = |line: &&str| {
        let rule = line.len() >= 60 && line.chars().all(|c| c == '-');
        of_mpirun ^= rule;
        let of_mpirun = of_mpirun || line.contains("ORTE_ERROR_LOG");
        !of_mpirun && line.contains(char::is_alphabetic)
    };
    let lines: Vec<&str> = text.lines().map(str::trim).filter(is_own).collect();
    match lines.len() {
        0 => "it printed no error".to_owned(),
        count => lines[count.saturating_sub(LINES_SHOWN)..]
            .iter()
            .map(start_of)
            .collect::<Vec<_>>()
            .join(" | "),
    }
}

/// Characters of a line that a message shows.
const CHARACTERS_SHOWN: usize = 300;

/// A line, cut if it is too long for a message.
fn start_of(line: &&str) -> String {
    match line.char_indices().nth(CHARACTERS_SHOWN) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => (*line).to_owned(),
    }
}

/// Sends SIGTERM to the child and all its descendants, ranks included, and kills those that do not end in time.
pub(super) fn end_child(child: &Child) -> io::Result<()> {
    session::signal(child.id(), Signal::TERM);
    let patience = Instant::now() + interrupt::PATIENCE;
    while Instant::now() < patience {
        if try_reap(child)?.is_some() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    kill_session(child.id());
    while try_reap(child)?.is_none() {
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

/// Kills every process of the session that `leader` led. Processes may be started while the session is being killed,
/// so this repeats until none is found.
pub(super) fn kill_session(leader: u32) {
    for _ in 0..100 {
        if session::members(leader).is_empty() {
            return;
        }
        session::signal(leader, Signal::KILL);
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The activity in each rank's status file, in the order of ranks.
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

    fn shell(script: &str, watch: &Watch) -> Result<Finished, Failure> {
        let mut command = Command::new("sh");
        command.arg("-c").arg(script).current_dir(watch.logs);
        run(&mut command, watch)
    }

    fn end_of(script: &str, limit_ms: u64) -> End {
        end_with_activity(script, limit_ms, &[])
    }

    /// `activity` are the texts of the ranks' status files.
    fn end_with_activity(script: &str, limit_ms: u64, activity: &[&str]) -> End {
        let logs = tempfile::tempdir().unwrap();
        for (rank, text) in activity.iter().enumerate() {
            fs::write(logs.path().join(format!("rank-{rank:05}.txt")), text).unwrap();
        }
        let limit = Duration::from_millis(limit_ms);
        let watch = Watch { status: Some(logs.path()), ..Watch::new("child", limit, logs.path()) };
        shell(script, &watch).unwrap_err().end
    }

    #[test]
    fn standard_output_is_kept_in_a_file() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(60), logs.path());
        let finished = shell("echo yes", &watch).unwrap();
        assert_eq!(fs::read_to_string(&finished.stdout).unwrap(), "yes\n");
        assert_eq!(finished.peak_rss_bytes, None);
    }

    /// A run that has just been started is not taken for one that another run has left running.
    #[test]
    fn runs_on_several_threads_do_not_end_each_other() {
        let runs = || {
            let logs = tempfile::tempdir().unwrap();
            let watch = Watch::new("child", Duration::from_secs(60), logs.path());
            (0..20).for_each(|_| _ = shell("exit 0", &watch).unwrap());
        };
        std::thread::scope(|scope| (0..8).for_each(|_| _ = scope.spawn(runs)));
    }

    #[test]
    fn an_exit_code_comes_with_the_last_lines() {
        let script = "echo ---- >&2; for i in 1 2 3 4; do echo line $i >&2; done; echo >&2; exit 7";
        let error = "line 2 | line 3 | line 4".to_owned();
        assert_eq!(end_of(script, 60_000), End::Exited { code: 7, error });
        let error = "it printed no error".to_owned();
        assert_eq!(end_of("exit 7", 60_000), End::Exited { code: 7, error });
    }

    #[test]
    fn what_mpirun_adds_to_an_error_is_not_shown() {
        let rule = "-".repeat(74);
        let text = format!(
            "too deep\n{rule}\nPrimary job terminated\n{rule}\n{rule}\nmpirun detected\n{rule}\n"
        );
        assert_eq!(last_lines(&text), "too deep");
    }

    #[test]
    fn a_flood_of_output_does_not_hide_the_error_at_its_end() {
        let script =
            "head -c 50000000 /dev/zero | tr '\\0' x >&2; echo >&2; echo the reason >&2; exit 7";
        let End::Exited { code: 7, error } = end_of(script, 60_000) else { panic!() };
        assert!(error.ends_with("... | the reason") && error.len() < 1000, "{}", error.len());
    }

    #[test]
    fn a_signal_is_not_an_exit_code() {
        assert_eq!(end_of("kill -9 $$", 60_000), End::Signalled(9));
    }

    #[test]
    fn a_program_that_does_not_exist_cannot_be_started() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(60), logs.path());
        let failure = run(&mut Command::new("/nowhere/program"), &watch).unwrap_err();
        assert!(matches!(&failure.end, End::Missing(why) if why.contains("/nowhere/program")));
    }

    #[test]
    fn a_hang_is_killed_and_reported_with_the_activity_of_the_ranks() {
        let activity = Some("rank 0 was in: balance; rank 1 was in: layer".to_owned());
        let limit = Duration::from_millis(300);
        let end = end_with_activity("sleep 600", 300, &["balance\n", "layer\n"]);
        assert_eq!(end, End::TimedOut { limit, activity });
    }

    #[test]
    fn a_child_that_ignores_sigterm_is_killed() {
        let end = end_of("trap '' TERM; while :; do sleep 1; done", 200);
        assert!(matches!(end, End::TimedOut { .. }), "{end:?}");
    }

    #[test]
    fn no_process_of_a_session_survives_its_leader() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(30), logs.path());
        // The background process leaves the process group, as the ranks of mpirun do, but not the session.
        shell("exec bash -c 'set -m; sleep 600 & echo $! > id'", &watch).unwrap();
        let id = fs::read_to_string(logs.path().join("id")).unwrap();
        let stat = fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
        assert!(!session::session_and_liveness(&stat).is_some_and(|(_, alive)| alive), "{stat}");
    }

    #[test]
    fn the_cpu_time_is_that_of_all_processes() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(60), logs.path());
        // A grandchild computes, and its parent waits for it.
        let count = "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done";
        let finished = shell(&format!("sh -c '{count}'; true"), &watch).unwrap();
        assert!(finished.time_cpu_s > 0.005, "{finished:?}");
        let idle = shell("sleep 0.2", &watch).unwrap();
        assert!(idle.time_cpu_s < idle.time_wall_s / 2.0, "{idle:?}");
    }
}
