//! Runs child processes under a time limit, and classifies how they end.
//!
//! Invariants:
//! - when [`run`] returns, no process of the child's `Session` is left, however the child ended;
//! - the child's output goes to files, so that no pipe can fill and no output is lost with a hang; a child that prints more than
//!   `OUTPUT_MAX` is ended, so that the disk cannot fill either.

use super::failure::{End, Failure};
use super::interrupt;
use super::session::{Session, peak_bytes};
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Longest output of a child, in bytes.
const OUTPUT_MAX: u64 = 64 << 20;
/// Bytes at the end of a standard error in which the error is looked for.
const ERROR_MAX: u64 = 1 << 20;

/// Time for a program to say its version, and for git to answer.
const QUERY: Duration = Duration::from_secs(10);

/// Looks at a child of any age, at least: what a short run uses last is missed as seldom as in a long one.
const LOOKS: u32 = 16;
/// Shortest and longest time between them.
const PAUSES: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(50)];

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
pub struct Watch<'a> {
    /// The child's name in messages, and the `NAME` of its output files.
    pub name: &'a str,
    /// Time after which it is killed.
    pub limit: Duration,
    /// Existing directory that receives `NAME.stdout` and `NAME.stderr`.
    pub logs: &'a Path,
    /// Directory in which rank N keeps its current activity in the file `rank-NNNNN.txt`.
    pub status: Option<&'a Path>,
    /// The least number of processes of which the memory is sampled together; none if it is not.
    pub sampled: Option<usize>,
}

impl<'a> Watch<'a> {
    /// A child without status files and memory samples.
    pub fn new(name: &'a str, limit: Duration, logs: &'a Path) -> Self {
        Self { name, limit, logs, status: None, sampled: None }
    }

    pub(super) fn log(&self, stream: &str) -> PathBuf {
        // The name of an engine may be the path of its file.
        self.logs.join(format!("{}.{stream}", self.name.replace('/', "-")))
    }

    /// Waits until `look` finds what it looks for. After an error the child may still run.
    pub(super) fn until<T>(
        &self,
        start: Instant,
        outputs: &[&File],
        mut look: impl FnMut() -> Result<Option<T>, End>,
    ) -> Result<T, End> {
        loop {
            if let Some(found) = look()? {
                return Ok(found);
            }
            check_interrupt()?;
            if start.elapsed() >= self.limit {
                let activity = self.status.map(activity);
                return Err(End::TimedOut { limit: self.limit, activity });
            }
            if outputs.iter().any(|output| length(output) > OUTPUT_MAX) {
                let mib = OUTPUT_MAX >> 20;
                return Err(End::Unusable(format!("printed more than {mib} MiB and was killed")));
            }
        }
    }
}

/// Runs the child to its end, to its time limit or to the user's interrupt.
///
/// # Errors
/// If the child cannot be started or does not exit with code 0.
pub fn run(command: &mut Command, watch: &Watch) -> Result<Finished, Failure> {
    to_its_end(command, watch).map_err(|end| Failure::new(watch.name, end))
}

/// What a program prints that answers at once; none if it fails, or takes longer than `QUERY`. The output goes through a pipe: git does
/// not repeat a write to a file that a signal interrupts.
pub fn printed(command: &mut Command) -> Option<String> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let (mut session, (_, out)) = Session::start(command).ok()?;
    let mut out = out?;
    let (mut bytes, reader) = (Vec::new(), thread::Builder::new());
    let reader = reader.spawn(move || out.read_to_end(&mut bytes).map(|_| bytes)).ok()?;
    let (status, _) = session.wait(QUERY).ok()??;
    // Descendants that hold the pipe end with the session.
    drop(session);
    let bytes = reader.join().ok()?.ok().filter(|_| status.success())?;
    Some(String::from_utf8_lossy(&bytes).trim_end().to_owned())
}

fn to_its_end(command: &mut Command, watch: &Watch) -> Result<Finished, End> {
    check_interrupt()?;
    let mut start = || -> io::Result<_> {
        let (stdout, stderr) = (log(&watch.log("stdout"))?, log(&watch.log("stderr"))?);
        command.stdin(Stdio::null()).stdout(stdout.try_clone()?).stderr(stderr.try_clone()?);
        let start = Instant::now();
        Ok((start, Session::start(command)?.0, [stdout, stderr]))
    };
    let (start, mut session, outputs) = start().map_err(|e| cannot_be_started(command, &e))?;
    let mut peak_rss_bytes = None;
    let outputs = outputs.each_ref();
    let ended = watch.until(start, &outputs, || {
        let sample = watch.sampled.and_then(|least| peak_bytes(session.leader, least));
        peak_rss_bytes = peak_rss_bytes.max(sample);
        session.wait((start.elapsed() / LOOKS).clamp(PAUSES[0], PAUSES[1]))
    });
    let time_wall_s = start.elapsed().as_secs_f64();
    if ended.is_err() {
        session.end();
        // Of a flood, the beginning suffices.
        let floods = outputs.iter().filter(|output| length(output) > OUTPUT_MAX);
        floods.for_each(|output| _ = output.set_len(ERROR_MAX));
    }
    let (status, time_cpu_s) = ended?;
    // Ctrl-C in a terminal also reaches the child directly; its exit code is then not a result.
    check_interrupt()?;
    judge(status, outputs[1])?;
    Ok(Finished { time_wall_s, time_cpu_s, stdout: watch.log("stdout"), peak_rss_bytes })
}

fn check_interrupt() -> Result<(), End> {
    if interrupt::requested() { Err(End::Interrupted) } else { Ok(()) }
}

pub(super) fn cannot_be_started(command: &Command, error: &io::Error) -> End {
    let program = Path::new(command.get_program()).display();
    End::Missing(format!("cannot be started: {program}: {error}"))
}

/// An empty file that receives a child's output.
fn log(path: &Path) -> io::Result<File> {
    File::create(path)?;
    OpenOptions::new().read(true).append(true).open(path)
}

fn length(output: &File) -> u64 {
    output.metadata().map_or(0, |metadata| metadata.len())
}

/// The end of a standard error.
pub(super) fn end_of(errors: &File) -> String {
    let start = length(errors).saturating_sub(ERROR_MAX);
    let mut end = vec![0; (length(errors) - start) as usize];
    let _ = errors.read_exact_at(&mut end, start);
    String::from_utf8_lossy(&end).into_owned()
}

/// How a child failed, from its status and its standard error, unless it exited with code 0.
pub(super) fn judge(status: ExitStatus, errors: &File) -> Result<(), End> {
    match status.code() {
        Some(0) => Ok(()),
        Some(code) => Err(End::Exited { code, error: last_lines(&end_of(errors)) }),
        None => Err(End::Signalled(status.signal().unwrap_or(0))),
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
    let last = &lines[lines.len().saturating_sub(LINES_SHOWN)..];
    match last.is_empty() {
        true => "it printed no error".to_owned(),
        // A line is cut where it is too long for a message.
        false => last.iter().map(|line| format!("{line:.300}")).collect::<Vec<_>>().join(" | "),
    }
}

/// What the ranks are doing, by the status files in a directory.
fn activity(directory: &Path) -> String {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let texts = entries.filter_map(|entry| fs::read_to_string(entry.path()).ok());
    let texts: BTreeSet<String> = texts.map(|text| text.trim().to_owned()).collect();
    match texts.is_empty() {
        true => "no rank had reported its phase".to_owned(),
        false => format!("its ranks were in {}", Vec::from_iter(texts).join(", ")),
    }
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
        let (logs, status) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for (rank, text) in activity.iter().enumerate() {
            fs::write(status.path().join(format!("rank-{rank:05}.txt")), text).unwrap();
        }
        let limit = Duration::from_millis(limit_ms);
        let watch =
            Watch { status: Some(status.path()), ..Watch::new("child", limit, logs.path()) };
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
        assert!(error.ends_with("x | the reason") && error.len() < 1000, "{}", error.len());
    }

    #[test]
    fn a_flood_of_output_ends_the_child() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(60), logs.path());
        let End::Unusable(why) = shell("yes", &watch).unwrap_err().end else { panic!() };
        assert!(why.contains("64 MiB"), "{why}");
        assert_eq!(fs::metadata(watch.log("stdout")).unwrap().len(), ERROR_MAX);
    }

    #[test]
    fn ranks_with_the_same_activity_share_a_clause() {
        let end = end_with_activity("sleep 600", 100, &["layer 7", "balance", "layer 7"]);
        let End::TimedOut { activity: Some(activity), .. } = end else { panic!("{end:?}") };
        assert_eq!(activity, "its ranks were in balance, layer 7");
        let End::TimedOut { activity, .. } = end_of("sleep 600", 100) else { panic!() };
        assert_eq!(activity.unwrap(), "no rank had reported its phase");
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
        let activity = Some("its ranks were in balance, layer".to_owned());
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
    fn an_answer_ends_with_its_program() {
        let of = |script: &str| printed(Command::new("sh").arg("-c").arg(script));
        assert_eq!(of("echo yes; sleep 600 &").as_deref(), Some("yes"));
        assert_eq!(
            (of("echo no; exit 1"), printed(&mut Command::new("/no/program"))),
            (None, None)
        );
    }

    #[test]
    fn no_process_of_a_session_survives_its_leader() {
        let logs = tempfile::tempdir().unwrap();
        let watch = Watch::new("child", Duration::from_secs(30), logs.path());
        // The background process leaves the process group, as the ranks of mpirun do, but not the session.
        shell("exec bash -c 'set -m; sleep 600 & echo $! > id'", &watch).unwrap();
        let id = fs::read_to_string(logs.path().join("id")).unwrap();
        let stat = fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
        assert!(stat.is_empty() || stat.contains(") Z "), "{stat}");
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
