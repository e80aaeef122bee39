//! Errors that a user can correct; bugs panic instead.
//!
//! Exit codes: 0 success, 1 a geometry that leaks, on request, 2 unusable input, 4 output could not be written, 70 a bug, 71 too little memory, 130 interrupted.

use files::OUT_OF_MEMORY;
use thiserror::Error;

/// An error with a message of one sentence: what, where, what to do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Error {
    /// The geometry leaks, and the user wants no mesh then.
    #[error("{0}")]
    Leak(String),
    /// The case, the geometry or an option is unusable.
    #[error("{0}")]
    Input(String),
    /// Output could not be written.
    #[error("{0}")]
    Output(String),
    /// The memory does not suffice.
    #[error("{0}")]
    Memory(String),
}

impl Error {
    /// An [`Error::Input`].
    pub fn input(message: impl Into<String>) -> Self {
        Self::Input(message.into())
    }

    /// An [`Error::Output`].
    pub fn output(message: impl Into<String>) -> Self {
        Self::Output(message.into())
    }

    /// An [`Error::Memory`].
    pub fn memory(message: impl Into<String>) -> Self {
        Self::Memory(message.into())
    }

    /// The process's exit code.
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Leak(_) => 1,
            Self::Input(_) => 2,
            Self::Output(_) => 4,
            Self::Memory(_) => OUT_OF_MEMORY,
        }
    }
}

/// For ranks to [agree](ranks::agree) on.
impl From<Error> for (i32, String) {
    fn from(error: Error) -> Self {
        (error.exit_code(), error.to_string())
    }
}

impl From<(i32, String)> for Error {
    fn from((exit_code, message): (i32, String)) -> Self {
        match exit_code {
            1 => Self::Leak(message),
            2 => Self::Input(message),
            OUT_OF_MEMORY => Self::Memory(message),
            _ => Self::Output(message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_pass_between_ranks_as_they_are() {
        let of = |make: fn(String) -> Error| make("no space".into());
        for e in [Error::Leak, Error::Input, Error::Output, Error::Memory].map(of) {
            assert_eq!(Error::from(<(i32, String)>::from(e.clone())), e);
        }
    }
}
