//! Why a program gave no result, and the one sentence for it.

use std::fmt;
use std::time::Duration;

/// Exit code of mesher and reference for an error in the user's input.
pub const CODE_INPUT: i32 = 2;

/// How a program failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// It cannot be run; the reason, as in "cannot be started: ...".
    Missing(String),
    /// It exited with a code other than 0, and this line of its standard error describes the error.
    Exited {
        /// The exit code.
        code: i32,
        /// The line.
        error: String,
    },
    /// It was killed by a signal that the harness did not send.
    Signalled(i32),
    /// The harness killed it at its time limit.
    TimedOut {
        /// The limit.
        limit: Duration,
        /// The last activity of its ranks, if they reported it.
        activity: Option<String>,
    },
    /// The user interrupted the harness.
    Interrupted,
    /// It exited with code 0, but its output cannot be used; the reason, as in "wrote no mesh".
    Unusable(String),
}

/// A program without a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The program's name.
    pub program: String,
    /// How it failed.
    pub end: End,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ", self.program)?;
        match &self.end {
            End::Missing(why) | End::Unusable(why) => f.write_str(why),
            End::Exited { code, error } => write!(f, "ended with code {code}: {error}"),
            End::Signalled(signal) => write!(f, "was killed by signal {signal}"),
            End::TimedOut { limit, activity } => {
                write!(f, "did not end within {} s and was killed", limit.as_secs())?;
                activity.iter().try_for_each(|activity| write!(f, "; {activity}"))
            }
            End::Interrupted => f.write_str("was interrupted"),
        }
    }
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
