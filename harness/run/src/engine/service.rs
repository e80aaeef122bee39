//! Programs that stay and run one command line after another: to start MPI or to import a package of Python takes longer than a
//! small case.
//!
//! A request is a line on the program's standard input, a JSON array of words. The answer is a line on its standard output: the exit
//! code that these words would have given a process of their own. Errors are on the standard error. A program that ends or hangs
//! instead costs that request, and the next one starts it again.

use super::failure::{End, Failure};
use super::interrupt;
use super::launcher::SharedMemory;
use super::output::Output;
use super::process::{self, Watch, end_child, kill_session};
use super::reap::try_reap;
use super::session;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest answer, in bytes.
const ANSWER_MAX: usize = 100;
/// Time for a program to end after its last request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest time from an answer to its error.
const LATE: Duration = Duration::from_millis(500);
/// Longest time between two looks at the clock and at signals.
const PAUSE: Timespec = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };

/// How a service is started: its command, and the directory of its shared memory.
pub type Start = (Command, Option<SharedMemory>);

/// Services by name, for several threads: each service runs one request at a time. All end with it.
#[derive(Debug, Default)]
pub struct Services {
    /// `None` for one that has not been started, or has ended.
    by_name: Mutex<BTreeMap<String, Arc<Mutex<Option<Service>>>>>,
    /// Held by a run on MPI: ranks that wait for each other spin, and would take the cores from those of another run.
    ranks: Mutex<()>,
}

/// A lock that a thread held when it panicked is as good as any: the panic ends the program.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug)]
struct Service {
    child: Child,
    /// Its end is the end of the service.
    requests: Option<ChildStdin>,
    answers: ChildStdout,
    errors: Output,
    /// Length of the standard error at the last answer.
    errors_before: u64,
    sent: Instant,
    _shared: Option<SharedMemory>,
}

impl Services {
    /// Starts the service, unless it runs.
    ///
    /// # Errors
    /// [`End::Missing`] if it cannot be started; another end if it has failed since the last answer.
    pub fn start(&self, name: &str, start: impl FnOnce() -> Start) -> Result<(), Failure> {
        Self::started(&mut lock(&self.slot(name)), name, start).map(drop)
    }

    /// Sends a request to the service, which is started unless it runs, and waits for the answer. The watch's limit counts from the
    /// request. Returns the wall time, in seconds.
    ///
    /// # Errors
    /// If it cannot be started, the answer is not 0, or the service ends or hangs.
    pub fn request(
        &self,
        name: &str,
        start: impl FnOnce() -> Start,
        words: &[String],
        watch: &Watch,
    ) -> Result<f64, Failure> {
        let slot = self.slot(name);
        let mut slot = lock(&slot);
        // While this thread waited for another one.
        if interrupt::requested() {
            return Err(Failure::new(watch.name, End::Interrupted));
        }
        let service = Self::started(&mut slot, name, start)?;
        service.send(words);
        let answer = service.wait(watch);
        let time_s = service.sent.elapsed().as_secs_f64();
        // A launcher may pass on the error after the answer.
        let late = Instant::now() + LATE;
        let is_late = || answer.as_ref().is_ok_and(|&code| code != 0) && Instant::now() < late;
        while is_late() && !service.error().ends_with('\n') {
            sleep(Duration::from_millis(5));
        }
        let error = service.error();
        service.errors_before = service.errors.length();
        if answer == Ok(0) {
            return Ok(time_s);
        }
        let _ = fs::write(watch.log("stderr"), &error);
        // After an interrupt all services are ended at the same time: one after the other, there is no time left for a report.
        if answer.as_ref().is_err_and(|end| *end != End::Interrupted) {
            let _ = end_child(&service.child);
            *slot = None;
        }
        let exited = |code| End::Exited { code, error: process::last_lines(&error) };
        Err(Failure::new(watch.name, answer.map_or_else(|end| end, exited)))
    }

    /// Waits until no other thread runs ranks on MPI, and keeps them from it.
    pub fn ranks(&self) -> MutexGuard<'_, ()> {
        lock(&self.ranks)
    }

    fn slot(&self, name: &str) -> Arc<Mutex<Option<Service>>> {
        lock(&self.by_name).entry(name.to_owned()).or_default().clone()
    }

    fn started<'a>(
        slot: &'a mut Option<Service>,
        name: &str,
        start: impl FnOnce() -> Start,
    ) -> Result<&'a mut Service, Failure> {
        if let Some(service) = slot
            && let Ok(Some((status, _))) = try_reap(&service.child)
        {
            let end = process::judge(status, || service.error());
            *slot = None;
            // A program that has ended well between two requests is started again.
            end.map_or(Ok(()), |end| Err(Failure::new(name, end)))?;
        }
        if slot.is_none() {
            let (mut command, shared) = start();
            let started = Service::start(&mut command, shared).map_err(|error| {
                let program = command.get_program().to_string_lossy();
                Failure::new(name, End::Missing(format!("cannot be started: {program}: {error}")))
            })?;
            *slot = Some(started);
        }
        Ok(slot.as_mut().expect("it has just been started"))
    }
}

impl Drop for Services {
    fn drop(&mut self) {
        // All end at the same time.
        for slot in lock(&self.by_name).values() {
            for service in lock(slot).iter_mut() {
                drop(service.requests.take());
                if interrupt::requested() {
                    session::signal(service.child.id(), Signal::TERM);
                }
            }
        }
    }
}

impl Service {
    fn start(command: &mut Command, shared: Option<SharedMemory>) -> io::Result<Self> {
        let place = tempfile::Builder::new().prefix("harness-service-").tempdir()?;
        let errors = Output::create(&place.path().join("stderr"))?;
        // The open file stays.
        drop(place);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(errors.stdio()?);
        process::lead_session(command);
        let mut child = interrupt::spawn(command, true)?;
        let requests = child.stdin.take();
        let answers = child.stdout.take().expect("it is a pipe");
        let sent = Instant::now();
        Ok(Self { child, requests, answers, errors, errors_before: 0, sent, _shared: shared })
    }

    fn send(&mut self, words: &[String]) {
        self.sent = Instant::now();
        let line = serde_json::to_string(words).expect("words are text");
        // That the program has ended is found when it is waited for.
        let _ = self.requests.as_mut().map(|requests| writeln!(requests, "{line}"));
    }

    /// The answer, or how the service ended without one.
    fn wait(&mut self, watch: &Watch) -> Result<i32, End> {
        let mut answer = Vec::new();
        loop {
            let unusable = |why: &str| End::Unusable(why.to_owned());
            if let Some(byte) = self.next_byte() {
                match byte {
                    b'\n' => {
                        let text = String::from_utf8_lossy(&answer);
                        return text.parse().map_err(|_| unusable("gave no exit code"));
                    }
                    _ if answer.len() == ANSWER_MAX => return Err(unusable("gave no exit code")),
                    _ => answer.push(byte),
                }
                continue;
            }
            if interrupt::requested() {
                return Err(End::Interrupted);
            }
            match try_reap(&self.child) {
                Ok(None) => {}
                Ok(Some((status, _))) => {
                    let end = process::judge(status, || self.error());
                    return Err(end.unwrap_or_else(|| unusable("ended without an answer")));
                }
                Err(error) => return Err(unusable(&format!("could not be waited for: {error}"))),
            }
            if self.sent.elapsed() >= watch.limit {
                return Err(End::TimedOut { limit: watch.limit, activity: watch.activity() });
            }
            self.errors.discard_middle();
        }
    }

    /// The next byte of an answer, if there is one soon.
    fn next_byte(&mut self) -> Option<u8> {
        let mut fds = [PollFd::new(&self.answers, PollFlags::IN)];
        let found = poll(&mut fds, Some(&PAUSE)).unwrap_or(0);
        if found == 0 {
            return None;
        }
        let mut byte = [0];
        match self.answers.read(&mut byte) {
            Ok(1) => Some(byte[0]),
            // The end of its output: its own end follows.
            _ => {
                sleep(Duration::from_millis(2));
                None
            }
        }
    }

    /// What it has written to the standard error since the last answer.
    fn error(&self) -> String {
        self.errors.since(self.errors_before)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        drop(self.requests.take());
        let patience = Instant::now() + PATIENCE;
        let runs = |child: &Child| matches!(try_reap(child), Ok(None));
        while runs(&self.child) {
            if interrupt::requested() || Instant::now() > patience {
                let _ = end_child(&self.child);
                break;
            }
            sleep(Duration::from_millis(5));
        }
        kill_session(self.child.id());
        interrupt::forget_child(self.child.id());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    /// Writes 0 for every word but `die`, at which it ends.
    const SCRIPT: &str = r#"while read -r line; do case "$line" in *die*) exit 7 ;; *wrong*) echo 5 ;; *) echo 0 ;; esac; done"#;

    #[test]
    fn requests_of_several_threads_get_their_own_answers() {
        let place = tempfile::tempdir().unwrap();
        let services = Services::default();
        let start = || {
            let mut command = Command::new("sh");
            command.args(["-c", SCRIPT]);
            (command, None)
        };
        let ask = &|word: &str| {
            let watch = Watch::new("sh", Duration::from_secs(60), place.path());
            let answer = services.request("sh", start, &[word.to_owned()], &watch);
            match answer.map_err(|failure| failure.end) {
                Ok(_) => 0,
                Err(End::Exited { code, .. }) => code,
                Err(other) => panic!("{word}: {other:?}"),
            }
        };
        thread::scope(|scope| {
            for (word, code) in [("good", 0), ("die", 7), ("wrong", 5), ("good", 0)] {
                scope.spawn(move || (0..25).for_each(|_| assert_eq!(ask(word), code, "{word}")));
            }
        });
    }
}
