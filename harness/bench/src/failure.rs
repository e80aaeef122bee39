//! Why a command has no result: the exit code and the one sentence that `harness` prints.

use contract::case::CaseError;
use contract::leafset::ReadError;
use export::error::ExportError;
use run::engine::failure::{self, End};
use run::import::Refusal;
use run::verify::VerifyError;
use run::verify::report::{EXIT_INPUT, EXIT_INTERRUPTED, EXIT_MISSING};
use std::fmt::Display;
use std::io::{self, ErrorKind};

/// Why a command has no result.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub code: u8,
    /// The reason, in one sentence.
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

    /// The user interrupted the command.
    pub fn interrupted() -> Self {
        Self { code: EXIT_INTERRUPTED, why: "interrupted".to_owned() }
    }

    /// Whether the user interrupted the command.
    pub fn is_interrupt(&self) -> bool {
        self.code == EXIT_INTERRUPTED
    }
}

/// Errors that are always those of the input.
macro_rules! inputs {
    ($($error:ty),*) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::input(error)
            }
        }
    )*};
}

inputs!(String, CaseError, ReadError);

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::Interrupted => Self::interrupted(),
            _ => Self::input(error),
        }
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Interrupted => Self::interrupted(),
            _ => Self::input(error),
        }
    }
}

impl From<failure::Failure> for Failure {
    fn from(failure: failure::Failure) -> Self {
        match failure.end {
            End::Missing(_) => Self::missing(failure),
            End::Interrupted => Self::interrupted(),
            _ => Self::input(failure),
        }
    }
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Input(error) => Self::input(error),
            Refusal::Missing(why) => Self::missing(why),
            Refusal::Interrupted => Self::interrupted(),
        }
    }
}

impl From<VerifyError> for Failure {
    fn from(error: VerifyError) -> Self {
        match error {
            VerifyError::Input(why) => Self::input(why),
            VerifyError::Missing(why) => Self::missing(why),
        }
    }
}
