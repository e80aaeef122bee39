//! Options for the paths of the programs.

use super::values::Input;
use clap::Args;
use run::engine::programs::Given;
use std::path::Path;

/// Paths of the programs.
#[derive(Args, Clone, Debug)]
pub struct ProgramArguments {
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<Input>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<Input>,
}

impl ProgramArguments {
    /// Returns the given paths, which take precedence over the search.
    pub fn given(&self) -> Given {
        let path = |given: &Option<Input>| given.as_deref().map(Path::to_owned);
        Given { mesher: path(&self.mesher), reference: path(&self.reference) }
    }
}
