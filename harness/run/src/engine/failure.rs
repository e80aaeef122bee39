//! Why a program gave no result, and the one sentence for it.

use std::io;
use std::time::Duration;
use thiserror::Error;

/// Exit code of mesher, reference and the readers in Python for an error in the user's input.
pub const CODE_INPUT: i32 = 2;

/// A result, or why a program gave none.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

/// How a program failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum End {
    /// It cannot be run; the reason, as in "cannot be started: ...".
    #[error("{0}")]
    Missing(String),
    /// It exited with a code other than 0.
    #[error("ended with code {code}: {error}")]
    Exited {
        /// The exit code.
        code: i32,
        /// The line of its standard error that describes the error.
        error: String,
    },
    /// It was killed by a signal that the harness did not send.
    #[error("was killed by signal {0}")]
    Signalled(i32),
    /// The harness killed it at its time limit.
    #[error("did not end within {} s and was killed{}", limit.as_secs(), activity.as_ref().map_or(String::new(), |of| format!("; {of}")))]
    TimedOut {
        /// The limit.
        limit: Duration,
        /// The last activity of its ranks, if they reported it.
        activity: Option<String>,
    },
    /// The user interrupted the harness.
    #[error("was interrupted")]
    Interrupted,
    /// It exited with code 0, but its output cannot be used; the reason, as in "wrote no mesh".
    #[error("{0}")]
    Unusable(String),
}

/// A program without a result.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{program} {end}")]
pub struct Failure {
    /// The program's name.
    pub program: String,
    /// How it failed.
    pub end: End,
}

impl Failure {
    /// A failure of the named program.
    pub fn new(program: impl Into<String>, end: End) -> Self {
        Self { program: program.into(), end }
    }

    /// Whether the user interrupted the harness; the failure is then not the program's.
    pub fn is_interrupt(&self) -> bool {
        self.end == End::Interrupted
    }
}

/// A directory or a file of a run could not be made or read, which is no program's fault.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::new("the harness", End::Unusable(format!("cannot use its files: {error}")))
    }
}

impl From<Failure> for contract::failure::Failure {
    fn from(failure: Failure) -> Self {
        match failure.end {
            End::Missing(_) => Self::missing(failure),
            End::Interrupted => Self::interrupted(),
            _ => Self::input(failure),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_end_has_its_own_message() {
        let sentence = |end| Failure::new("mesher", end).to_string();
        let error = "no memory".to_owned();
        assert_eq!(sentence(End::Exited { code: 7, error }), "mesher ended with code 7: no memory");
        assert_eq!(sentence(End::Signalled(9)), "mesher was killed by signal 9");
        let limit = Duration::from_secs(5);
        let hang = "mesher did not end within 5 s and was killed";
        assert_eq!(sentence(End::TimedOut { limit, activity: None }), hang);
        let activity = Some("its ranks were in balance".to_owned());
        let with_activity = format!("{hang}; its ranks were in balance");
        assert_eq!(sentence(End::TimedOut { limit, activity }), with_activity);
        assert_eq!(sentence(End::Missing("cannot be started".into())), "mesher cannot be started");
    }
}
