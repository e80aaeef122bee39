//! Options for the paths of the programs.

use clap::Args;
use run::engine::programs::Given;
use std::path::PathBuf;

/// Paths of the programs.
#[derive(Args, Clone, Debug)]
pub struct ProgramArguments {
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<PathBuf>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<PathBuf>,
}

impl ProgramArguments {
    /// Returns the given paths, which take precedence over the search.
    pub fn given(&self) -> Given {
        Given { mesher: self.mesher.clone(), reference: self.reference.clone() }
    }
}
