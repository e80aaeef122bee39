//! Options that say where the programs are.

use clap::Args;
use run::engine::programs::Given;
use std::path::PathBuf;

/// Where the programs are.
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
    /// What was given, for the search for programs.
    pub fn given(&self) -> Given {
        Given { mesher: self.mesher.clone(), reference: self.reference.clone() }
    }
}
