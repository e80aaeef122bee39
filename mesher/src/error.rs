//! Errors that a user can correct; bugs panic instead.
//!
//! Exit codes: 0 success, 1 a geometry or a flow that --strict refuses, 2 unusable input, 4 output could not be written, 70 a bug, 71 too little memory, 75 a rank that stalls, 130 interrupted.

use files::OUT_OF_MEMORY;
use ranks::{Comm, pack_bytes, unpack_bytes};
use std::fmt::Display;
use std::path::Path;
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
    fn new(exit_code: i32, message: impl Display) -> Self {
        Self { exit_code, message: message.to_string() }
    }

    /// A geometry or a flow of which the user wants no mesh.
    pub fn leak(message: impl Display) -> Self {
        Self::new(1, message)
    }

    /// The case, the geometry or an option is unusable.
    pub fn input(message: impl Display) -> Self {
        Self::new(2, message)
    }

    /// Output could not be written.
    pub fn output(message: impl Display) -> Self {
        Self::new(4, message)
    }

    /// The memory does not suffice.
    pub fn memory(message: impl Display) -> Self {
        Self::new(OUT_OF_MEMORY, message)
    }

    /// The same error of a file or a directory.
    pub fn at(self, path: &Path) -> Self {
        Self { message: format!("{}: {}", path.display(), self.message), ..self }
    }
}

/// Makes ranks agree on errors: all return the error of the lowest rank that has one. Collective.
///
/// # Errors
/// The same on all ranks.
///
/// # Panics
/// Never: a rank without a value has an error.
pub fn agree<T>(comm: &dyn Comm, mine: Result<T, Error>) -> Result<T, Error> {
    let mut packed = Vec::new();
    let value = mine.map_err(|error| {
        packed.push(error.exit_code as u64);
        pack_bytes(error.message.as_bytes(), &mut packed);
    });
    let gathered = comm.all_gather(&packed);
    let Some((_, words)) = gathered.messages().next() else {
        return Ok(value.expect("no rank has an error"));
    };
    let (message, _) = unpack_bytes(&words[1..]);
    Err(Error::new(words[0] as i32, String::from_utf8_lossy(message)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::sim;

    #[test]
    fn all_ranks_have_the_error_of_the_lowest_rank_that_has_one() {
        for sentence in ["", "no space", "häßlich: 'x'", "12345678"] {
            let results = sim::run(4, 1, |comm| {
                let mine = match comm.rank() {
                    0 | 2 => Ok(comm.rank()),
                    rank => Err(Error::new(rank as i32, sentence)),
                };
                agree(comm, mine)
            });
            assert!(results.iter().all(|r| *r == Err(Error::new(1, sentence))), "{results:?}");
        }
        let results = sim::run(3, 1, |comm| agree(comm, Ok(comm.rank())));
        assert_eq!(results, [Ok(0), Ok(1), Ok(2)]);
    }
}
