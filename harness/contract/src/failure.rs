//! Why a command has no result: the exit code and the one sentence that `harness` prints; and what it reports meanwhile to the user, who may
//! interrupt it.

use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write, stderr};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code: all checks hold.
pub const EXIT_HOLDS: u8 = 0;
/// Exit code: at least one check failed.
pub const EXIT_FAILED: u8 = 1;
/// Exit code: invalid input.
pub const EXIT_INPUT: u8 = 2;
/// Exit code: a required prerequisite is missing.
pub const EXIT_MISSING: u8 = 3;
/// Exit code: standard output cannot be written.
pub const EXIT_OUTPUT: u8 = 4;
/// Exit code: interrupted by the user.
pub const EXIT_INTERRUPTED: u8 = 130;

/// Returns the exit code of a command for which both codes apply: the first of 130, 1, 2 and 3.
pub fn exit_first(a: u8, b: u8) -> u8 {
    let order = [EXIT_INTERRUPTED, EXIT_FAILED, EXIT_INPUT, EXIT_MISSING];
    order.into_iter().find(|code| [a, b].contains(code)).unwrap_or(EXIT_HOLDS)
}

/// An error that names the file.
pub fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// A result, or a [`Failure`].
pub type Result<T, E = Failure> = std::result::Result<T, E>;

/// Why a command has no result, or why a file cannot be used: one sentence, or the predicate of one whose subject is the file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{why}")]
pub struct Failure {
    /// The exit code.
    pub code: u8,
    /// The reason.
    pub why: String,
}

impl Failure {
    /// Invalid input, or an output that cannot be written.
    pub fn input(why: impl Display) -> Self {
        Self { code: EXIT_INPUT, why: why.to_string() }
    }

    /// A required program or file is missing, or nothing was checked.
    pub fn missing(why: impl Display) -> Self {
        Self { code: EXIT_MISSING, why: why.to_string() }
    }

    /// An input that cannot be used for a reason, with its path before that.
    pub fn about(path: &Path, why: impl Display) -> Self {
        Self::input(format!("{}: {why}", path.display()))
    }

    /// Invalid input for this reason, unless a condition holds.
    ///
    /// # Errors
    /// If it does not.
    pub fn unless(holds: bool, why: impl Display) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self::input(why)) }
    }

    /// An input that cannot be read.
    pub fn unreadable(error: io::Error) -> Self {
        Self::input(format!("cannot be read: {error}"))
    }

    /// The user interrupted the command.
    pub fn interrupted() -> Self {
        Self { code: EXIT_INTERRUPTED, why: "interrupted".to_owned() }
    }

    /// A file or directory could not be written or read.
    pub fn at(path: &Path, error: io::Error) -> Self {
        named(path, &error).into()
    }

    /// Whether the user interrupted the command.
    pub fn is_interrupt(&self) -> bool {
        self.code == EXIT_INTERRUPTED
    }

    /// The same, if it is one of the input, with the file's name.
    #[must_use]
    pub fn of_file(self, path: &Path) -> Self {
        if self.code == EXIT_INPUT { Self::about(path, self.why) } else { self }
    }
}

impl From<String> for Failure {
    fn from(why: String) -> Self {
        Self::input(why)
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        let is_interrupt = error.kind() == ErrorKind::Interrupted;
        if is_interrupt { Self::interrupted() } else { Self::input(error) }
    }
}

/// Whether the user has interrupted the program.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// A step begins, which a terminal shows as the line of standard error that is empty at first. One without a name removes the line.
pub fn progress(what: &str) {
    if stderr().is_terminal() {
        let _ = write!(stderr().lock(), "\r\x1b[K{what}");
    }
}

/// Whether to continue.
///
/// # Errors
/// If the user has interrupted the program.
pub fn uninterrupted() -> Result<(), Failure> {
    if INTERRUPTED.load(Ordering::SeqCst) { Err(Failure::interrupted()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_check_takes_precedence_over_a_report_that_cannot_be_written() {
        assert_eq!(exit_first(EXIT_FAILED, EXIT_INPUT), EXIT_FAILED);
        assert_eq!(exit_first(EXIT_INPUT, EXIT_MISSING), EXIT_INPUT);
        assert_eq!(exit_first(EXIT_HOLDS, EXIT_INPUT), EXIT_INPUT);
        assert_eq!(exit_first(EXIT_INPUT, EXIT_INTERRUPTED), EXIT_INTERRUPTED);
        assert_eq!(exit_first(EXIT_HOLDS, EXIT_HOLDS), EXIT_HOLDS);
    }
}
