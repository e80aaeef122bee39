//! Programs that stay and run one command line after another: to start MPI or to import a package of Python takes longer than a
//! small case.
//!
//! A request is a line on the program's standard input, a JSON array of words. The answer is a line on its standard output: the exit
//! code that these words would have given a process of their own. Errors are on the standard error. A program that ends or hangs
//! instead costs that request, and the next one starts it again. A second line for one request is found at the next one, which it costs, if
//! it has arrived by then.

use super::failure::{End, Failure, Result};
use super::interrupt;
use super::process::{self, Watch};
use super::session::{Session, wait_while};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest answer, in bytes.
const ANSWER_MAX: u64 = 100;
/// Time for a program to end after its last request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest time from an answer to its error.
const LATE: Duration = Duration::from_millis(500);
/// Longest time between two looks at the clock and at signals.
const PAUSE: Duration = Duration::from_millis(20);

/// How a service is started: its command, and the directory of its shared memory.
pub type Start = (Command, Option<TempDir>);

/// Services by name. All end with it.
#[derive(Default)]
pub struct Services(RefCell<BTreeMap<String, Service>>);

struct Service {
    session: Session,
    /// Its end is the end of the service.
    requests: Option<ChildStdin>,
    /// Its lines; disconnected at the end of its output.
    answers: Receiver<String>,
    /// What it has written to the standard error since its start or the last answer.
    errors: File,
    /// When it was sent.
    sent: Instant,
    _shared: Option<TempDir>,
}

impl Services {
    /// Starts the service, unless it runs.
    ///
    /// # Errors
    /// [`End::Missing`] if it cannot be started; another end if it has failed since the last answer.
    pub fn start(&self, name: &str, start: impl FnOnce() -> Start) -> Result<()> {
        let failure = |end| Failure::new(name, end);
        let mut services = self.0.borrow_mut();
        if let Some(service) = services.get_mut(name) {
            let ended = service.session.wait(Duration::ZERO).map_err(failure)?;
            let end = match (service.answers.try_recv(), ended) {
                (Ok(_), _) => {
                    Err(End::Unusable("printed more than one line for the run before".to_owned()))
                }
                (Err(_), None) => return Ok(()),
                (Err(_), Some((status, _))) => process::judge(status, &service.errors),
            };
            services.remove(name);
            // A program that has ended well between two requests is started again.
            end.map_err(failure)?;
        }
        let (mut command, shared) = start();
        let service = Service::start(&mut command, shared);
        let missing = |error| failure(process::cannot_be_started(&command, &error));
        services.insert(name.to_owned(), service.map_err(missing)?);
        Ok(())
    }

    /// Sends a request to a service that was started. [`Self::answer`] must be asked for its answer before the next request.
    pub fn send(&self, name: &str, words: &[String]) {
        let mut services = self.0.borrow_mut();
        let service = services.get_mut(name).expect("it has been started");
        service.sent = Instant::now();
        let line = serde_json::to_string(words).expect("words are text");
        // That the program has ended is found when it is waited for.
        let _ = service.requests.as_mut().map(|requests| writeln!(requests, "{line}"));
    }

    /// Waits for the answer to a request, from which the watch's limit counts. Returns the wall time, in seconds.
    ///
    /// # Errors
    /// If the answer is not 0, or the service ends or hangs.
    pub fn answer(&self, name: &str, watch: &Watch) -> Result<f64> {
        let mut services = self.0.borrow_mut();
        let service = services.get_mut(name).expect("it was sent a request");
        let time_s = service.answer(watch);
        let _ = service.errors.set_len(0);
        let is_usable = match &time_s {
            // After an interrupt all services are ended at the same time, after the report, for which there would be no time left.
            Ok(_) | Err(End::Interrupted) => true,
            Err(End::Exited { .. }) => service.session.runs(),
            Err(_) => false,
        };
        if !is_usable {
            service.session.end();
            services.remove(name);
        }
        time_s.map_err(|end| Failure::new(watch.name, end))
    }
}

impl Drop for Services {
    fn drop(&mut self) {
        // All end at the same time.
        self.0.get_mut().values_mut().for_each(|service| drop(service.requests.take()));
        if interrupt::requested() {
            // The end of the harness ends what is left, after its report.
            std::mem::forget(std::mem::take(self.0.get_mut()));
        }
    }
}

impl Service {
    fn start(command: &mut Command, shared: Option<TempDir>) -> io::Result<Self> {
        let errors = tempfile::Builder::new().append(true).tempfile()?.into_file();
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(errors.try_clone()?);
        let (session, (requests, output)) = Session::start(command)?;
        let answers = lines_of(output.expect("it is a pipe"))?;
        Ok(Self { session, requests, answers, errors, sent: Instant::now(), _shared: shared })
    }

    /// The wall time from request to answer, in seconds.
    fn answer(&mut self, watch: &Watch) -> Result<f64, End> {
        let Self { session, answers, errors, .. } = self;
        let unusable = |why: &str| End::Unusable(why.to_owned());
        let code = watch.until(self.sent, &[errors], || {
            let ended = session.wait(Duration::ZERO)?;
            // The last answer of a program that has ended may be on its way.
            let answer = answers.recv_timeout(if ended.is_some() { LATE } else { PAUSE });
            match (answer, ended) {
                (Ok(answer), _) => {
                    let code = answer.strip_suffix('\n').and_then(|code| code.parse().ok());
                    code.map(Some).ok_or_else(|| unusable("gave no exit code"))
                }
                (Err(_), Some((status, _))) => {
                    process::judge(status, errors)?;
                    Err(unusable("ended without an answer"))
                }
                // The end of its output: its own end follows.
                (Err(_), None) => session.wait(Duration::from_millis(1)).map(|_| None),
            }
        });
        let time_s = self.sent.elapsed().as_secs_f64();
        // A launcher may pass on the error after the answer.
        if code.as_ref().is_ok_and(|&code| code != 0) {
            wait_while(LATE, || !process::end_of(errors).ends_with('\n'));
        }
        if code != Ok(0) {
            let _ = fs::write(watch.log("stderr"), process::end_of(errors));
        }
        match code? {
            0 => Ok(time_s),
            code => Err(End::Exited { code, error: process::last_lines(&process::end_of(errors)) }),
        }
    }
}

/// The lines of an output, which another thread reads, so that waiting for one can have a limit.
fn lines_of(output: ChildStdout) -> io::Result<Receiver<String>> {
    let (sender, lines) = sync_channel(1);
    let read = move || {
        let mut output = BufReader::new(output);
        let mut line = Vec::new();
        while output.by_ref().take(ANSWER_MAX).read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
            sender.send(String::from_utf8_lossy(&line).into_owned()).ok()?;
            line.clear();
        }
        Some(())
    };
    thread::Builder::new().name("answers".into()).stack_size(64 << 10).spawn(read)?;
    Ok(lines)
}

impl Drop for Service {
    fn drop(&mut self) {
        drop(self.requests.take());
        wait_while(PATIENCE, || !interrupt::requested() && self.session.runs());
        self.session.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers 0 to every word but `wrong`, and `die`, at which it ends; twice to `twice`.
    const SCRIPT: &str = r#"while read -r line; do case "$line" in *die*) exit 7 ;; *wrong*) echo 5 ;; *twice*) echo 0; echo 0 ;; *) echo 0 ;; esac; done"#;

    fn script() -> Start {
        let mut command = Command::new("sh");
        command.args(["-c", SCRIPT]);
        (command, None)
    }

    #[test]
    fn a_service_that_has_ended_is_started_again() {
        let place = tempfile::tempdir().unwrap();
        let services = Services::default();
        let words = [("good", 0), ("die", 7), ("wrong", 5), ("good", 0)];
        for _ in 0..25 {
            for (name, (word, _)) in words.iter().enumerate() {
                services.start(&name.to_string(), script).unwrap();
                services.send(&name.to_string(), &[(*word).to_owned()]);
            }
            for (name, (_, code)) in words.iter().enumerate() {
                let watch = Watch::new("sh", Duration::from_secs(60), place.path());
                let answer = services.answer(&name.to_string(), &watch);
                match answer.map_err(|failure| failure.end) {
                    Ok(_) => assert_eq!(*code, 0),
                    Err(End::Exited { code: ended, .. }) => assert_eq!(ended, *code),
                    Err(other) => panic!("{other:?}"),
                }
            }
        }
    }

    #[test]
    fn a_second_answer_is_not_that_of_the_next_request() {
        let place = tempfile::tempdir().unwrap();
        let services = Services::default();
        services.start("sh", script).unwrap();
        services.send("sh", &["twice".to_owned()]);
        services.answer("sh", &Watch::new("sh", Duration::from_secs(60), place.path())).unwrap();
        let mut started = Ok(());
        wait_while(Duration::from_secs(60), || {
            started = services.start("sh", script);
            started.is_ok()
        });
        let why = "printed more than one line for the run before".to_owned();
        assert_eq!(started.unwrap_err().end, End::Unusable(why));
        services.start("sh", script).unwrap();
    }

    #[test]
    fn what_a_program_prints_before_its_first_request_is_its_error() {
        let place = tempfile::tempdir().unwrap();
        let start = || {
            let mut command = Command::new("sh");
            command.args(["-c", "echo bang >&2; exit 7"]);
            (command, None)
        };
        for _ in 0..50 {
            let services = Services::default();
            services.start("sh", start).unwrap();
            services.send("sh", &[]);
            let watch = Watch::new("sh", Duration::from_secs(60), place.path());
            let failure = services.answer("sh", &watch).unwrap_err();
            assert_eq!(failure.end, End::Exited { code: 7, error: "bang".to_owned() });
        }
    }
}
