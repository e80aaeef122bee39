//! Errors that a user can correct; bugs panic instead.
//!
//! Exit codes: 0 success, 1 a geometry that leaks, on request, 2 unusable input, 4 output could not be written, 70 a bug, 71 too little memory, 130 interrupted.

use files::OUT_OF_MEMORY;
use thiserror::Error;

/// An error with a message of one sentence: what, where, what to do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct Error {
    /// The process's exit code.
    pub exit_code: i32,
    message: String,
}

impl Error {
    /// The geometry leaks, and the user wants no mesh then.
    pub fn leak(message: impl Into<String>) -> Self {
        Self::from((1, message.into()))
    }

    /// The case, the geometry or an option is unusable.
    pub fn input(message: impl Into<String>) -> Self {
        Self::from((2, message.into()))
    }

    /// Output could not be written.
    pub fn output(message: impl Into<String>) -> Self {
        Self::from((4, message.into()))
    }

    /// The memory does not suffice.
    pub fn memory(message: impl Into<String>) -> Self {
        Self::from((OUT_OF_MEMORY, message.into()))
    }
}

/// For ranks to [agree](ranks::agree) on.
impl From<Error> for (i32, String) {
    fn from(error: Error) -> Self {
        (error.exit_code, error.message)
    }
}

impl From<(i32, String)> for Error {
    fn from((exit_code, message): (i32, String)) -> Self {
        Self { exit_code, message }
    }
}
