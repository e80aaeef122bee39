//! Child processes. Each leads a session of its own, so that its descendants can be found even if they left its process group, as the
//! ranks of OpenMPI's `mpirun` do. Those that left the session as well become children of this process when their parents end.
//!
//! Invariant: when a [`Session`] was dropped or [`end_all`] has returned, no process of it is left.

use super::failure::End;
use contract::number::labelled;
use rustix::process::{Pid, Signal, WaitOptions, kill_process, setsid, waitpid};
use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, MutexGuard, OnceLock};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};
use std::{fs, io};
use wait4::{ResourceUsage, Wait4};

/// Time for child processes to remove their files.
pub(super) const PATIENCE: Duration = Duration::from_millis(350);
/// How often processes are ended that start others meanwhile.
const ATTEMPTS: usize = 500;

/// The leaders of all sessions.
static RUNNING: Mutex<Vec<Pid>> = Mutex::new(Vec::new());

/// Children that this process had when it began: what a shell started before it became the harness.
static INHERITED: OnceLock<Vec<i32>> = OnceLock::new();

/// Leaves the children alone that there are by now, and their sessions.
pub(super) fn keep_children() {
    INHERITED.get_or_init(children);
}

fn running() -> MutexGuard<'static, Vec<Pid>> {
    RUNNING.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// How a child ended, and the CPU time, in seconds, of it and of all its descendants that were waited for.
pub(super) type Ended = (ExitStatus, f64);

/// The pipes to a child's standard input and from its standard output; none where the command asks for none.
pub(super) type Pipes = (Option<ChildStdin>, Option<ChildStdout>);

/// The session of a child.
pub(super) struct Session {
    pub(super) leader: Pid,
    /// What the thread sends that waits for the leader. A pause of fixed length would round the leader's wall time up to a multiple of it.
    waited: Receiver<Ended>,
    ended: Option<Ended>,
}

impl Session {
    /// Starts the leader.
    pub(super) fn start(command: &mut Command) -> io::Result<(Self, Pipes)> {
        // SAFETY: setsid is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| setsid().map(drop).map_err(io::Error::from)) };
        let (sender, waited) = sync_channel(1);
        // Either `end_all` finds the child, or it was started after that.
        let mut running = running();
        let mut child = command.spawn()?;
        let leader = Pid::from_child(&child);
        running.push(leader);
        drop(running);
        let session = Self { leader, waited, ended: None };
        let pipes = (child.stdin.take(), child.stdout.take());
        // `Child::wait` gives no CPU time.
        let wait = move || {
            let used = loop {
                match child.wait4() {
                    Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                    used => break used.ok()?,
                }
            };
            let ResourceUsage { utime, stime, .. } = used.rusage;
            sender.send((used.status, (utime + stime).as_secs_f64())).ok()
        };
        thread::Builder::new().name("wait".into()).stack_size(64 << 10).spawn(wait)?;
        Ok((session, pipes))
    }

    /// How the leader ended; `None` if it runs for longer than this.
    pub(super) fn wait(&mut self, limit: Duration) -> Result<Option<Ended>, End> {
        if self.ended.is_none() {
            let waited = self.waited.recv_timeout(limit);
            if waited == Err(RecvTimeoutError::Disconnected) {
                return Err(End::Unusable("could not be waited for".to_owned()));
            }
            self.ended = waited.ok();
        }
        Ok(self.ended)
    }

    /// Whether the leader runs.
    pub(super) fn runs(&mut self) -> bool {
        matches!(self.wait(Duration::ZERO), Ok(None))
    }

    /// Sends SIGTERM to the leader and all its descendants, ranks included, and kills those that do not end in time.
    pub(super) fn end(&self) {
        end(&[self.leader], &running());
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let mut running = running();
        running.retain(|&other| other != self.leader);
        kill(&[self.leader], &running);
    }
}

/// Ends all sessions at the same time, and removes what they left. None is started as long as the result exists.
pub(super) fn end_all() -> MutexGuard<'static, Vec<Pid>> {
    let running = running();
    end(&running, &running);
    kill(&running, &[]);
    running
}

fn end(leaders: &[Pid], running: &[Pid]) {
    signal(leaders, Signal::TERM);
    wait_while(PATIENCE, || leaders.iter().any(|&leader| !members(leader).is_empty()));
    kill(leaders, running);
}

/// Waits as long as a condition holds, and no longer than this.
pub(super) fn wait_while(limit: Duration, mut holds: impl FnMut() -> bool) {
    let end = Instant::now() + limit;
    while holds() && Instant::now() < end {
        sleep(Duration::from_millis(5));
    }
}

/// Kills every process of these sessions, and those that this process has adopted: its children in other sessions than those that are
/// `kept`. Processes may be started meanwhile, and the children of adopted ones are adopted in turn, so this repeats until none is found.
fn kill(leaders: &[Pid], kept: &[Pid]) {
    for _ in 0..ATTEMPTS {
        let adopted = adopted(kept);
        for &process in &adopted {
            let _ = kill_process(process, Signal::KILL);
            let _ = waitpid(Some(process), WaitOptions::NOHANG);
        }
        if !signal(leaders, Signal::KILL) && adopted.is_empty() {
            return;
        }
        sleep(Duration::from_millis(2));
    }
}

/// Sends a signal to every process of these sessions. Returns whether there are any.
fn signal(leaders: &[Pid], signal: Signal) -> bool {
    let members: Vec<Pid> = leaders.iter().flat_map(|&leader| members(leader)).collect();
    for &member in &members {
        // It may have ended since then.
        let _ = kill_process(member, signal);
    }
    !members.is_empty()
}

/// The live processes of a session. The leader is no longer among them after it was waited for.
fn members(leader: Pid) -> Vec<Pid> {
    let leader = leader.as_raw_nonzero().get();
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    // A machine has hundreds of processes. To read a file of each takes longer than to mesh a small case.
    let of_session = ids.filter(|&id| session(id) == leader);
    let stat = |id: &i32| fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    of_session.filter(|id| is_alive(&stat(id))).filter_map(Pid::from_raw).collect()
}

fn adopted(kept: &[Pid]) -> Vec<Pid> {
    let (own, inherited) = (session(0), INHERITED.get().map_or(&[][..], Vec::as_slice));
    let is_ours = |&child: &i32| {
        let session = session(child);
        session != own && !inherited.contains(&child) && !inherited.contains(&session)
    };
    let ours = children().into_iter().filter(is_ours).filter_map(Pid::from_raw);
    ours.filter(|child| !kept.contains(child)).collect()
}

/// The children of this process.
fn children() -> Vec<i32> {
    let threads = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let of_thread = |thread: fs::DirEntry| {
        let text = fs::read_to_string(thread.path().join("children")).unwrap_or_default();
        text.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<i32>>()
    };
    threads.flat_map(of_thread).collect()
}

/// The session of a process, with 0 for this one itself. It is 0 for kernel threads and for sessions whose leader is outside of a container,
/// and negative if there is no such process.
fn session(id: i32) -> i32 {
    // SAFETY: getsid touches no memory. That of rustix panics where the session is 0.
    unsafe { libc::getsid(id) }
}

/// Whether a process is alive (not a zombie), by the text of `/proc/ID/stat`.
fn is_alive(stat: &str) -> bool {
    // The name, in parentheses, may itself contain spaces and parentheses.
    stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
}

/// The sum of the peaks of memory of all live processes of a session, for programs that do not report it; none if these are fewer than the
/// `least`, as where another program than the leader starts ranks. The system keeps the peak of each, so only memory that is first used after
/// the last look is missed.
pub(super) fn peak_bytes(leader: Pid, least: usize) -> Option<u64> {
    let statuses = members(leader).into_iter().filter_map(|id| {
        let status = fs::read_to_string(format!("/proc/{}/status", id.as_raw_nonzero())).ok()?;
        Some((id.as_raw_nonzero().get().cast_unsigned().into(), Status::parse(&status)?))
    });
    let statuses: BTreeMap<u64, Status> = statuses.collect();
    (statuses.len() >= least).then(|| total_bytes(&statuses))
}

/// A process, of which `/proc/ID/status` has the parent and the peaks of the address space and of resident memory.
struct Status {
    parent: u64,
    space_kb: u64,
    peak_bytes: u64,
}

impl Status {
    fn parse(text: &str) -> Option<Self> {
        let (parent, space_kb) = (labelled(text, "PPid:")?, labelled(text, "VmPeak:")?);
        Some(Self { parent, space_kb, peak_bytes: labelled(text, "VmHWM:")? * 1024 })
    }
}

/// The sum of the peaks. Between its start and that of its program, a process has its parent's memory, which counts once.
fn total_bytes(processes: &BTreeMap<u64, Status>) -> u64 {
    // The kernel counts pages in batches.
    let is_of_parent = |of: &&Status| {
        processes.get(&of.parent).is_some_and(|parent| {
            parent.space_kb == of.space_kb
                && parent.peak_bytes.abs_diff(of.peak_bytes) <= parent.peak_bytes / 64
        })
    };
    processes.values().filter(|of| !is_of_parent(of)).map(|of| of.peak_bytes).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::process::Stdio;

    #[test]
    fn a_pause_ends_with_the_child() {
        let mut command = Command::new("cat");
        let (mut session, pipes) = Session::start(command.stdin(Stdio::piped())).unwrap();
        assert!(session.wait(Duration::ZERO).unwrap().is_none());
        drop(pipes);
        let start = Instant::now();
        assert!(session.wait(Duration::from_secs(600)).unwrap().unwrap().0.success());
        assert!(start.elapsed() < Duration::from_secs(300));
    }

    #[test]
    fn the_state_is_found_after_a_name_with_parentheses() {
        assert!(is_alive("12 (a) Z) S 1 12 77 0 -1"));
        assert!(!is_alive("12 (x) Z 1 12 77 0 -1") && !is_alive(""));
    }

    #[test]
    fn the_memory_of_a_grandchild_is_sampled() {
        let mut command = Command::new("setsid");
        // `tail` keeps the last line, which is all 30 MB of it, until its input ends, and then waits to print it.
        command.args([
            "sh",
            "-c",
            "(head -c 30000000 /dev/zero; echo ready >&2; cat) | tail -n 1 > /dev/null",
        ]);
        command.stdin(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = [0; 6];
        child.stderr.take().unwrap().read_exact(&mut line).unwrap();
        // The last bytes may still be in the pipe.
        while peak_bytes(Pid::from_child(&child), 1) < Some(29_000_000) {}
        drop(child.stdin.take());
        assert!(child.wait().unwrap().success());
    }

    #[test]
    fn peaks_add_up_and_memory_that_parent_and_child_share_counts_once() {
        let total = |all: &[(u64, u64, u64, u64)]| {
            let parsed = all.iter().map(|(id, parent, space, peak)| {
                let text = format!(
                    "Name:\ta\nPPid:\t{parent}\nVmPeak:\t {space} kB\nVmHWM:\t  {peak} kB\n"
                );
                (*id, Status::parse(&text).unwrap())
            });
            total_bytes(&parsed.collect()) / 1024
        };
        let python = (7, 1, 50_000, 9000);
        assert_eq!(total(&[python, (8, 7, 50_000, 9004)]), 9000, "a child without its program yet");
        assert_eq!(total(&[python, (8, 7, 60_000, 9000)]), 18_000, "a program of its own");
        let siblings = [(8, 7, 60_000, 10_000), (9, 7, 60_000, 10_000)];
        assert_eq!(total(&[python, siblings[0], siblings[1]]), 29_000);
        assert!(Status::parse("Name:\ta\nPPid:\t1\n").is_none());
    }
}
