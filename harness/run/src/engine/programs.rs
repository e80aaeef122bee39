//! The programs of a session: the engine under test, our mesher, the reference.

use super::paths::{Input, Paths};
use super::runner::Engine;
use clap::Args;

/// Programs that the command line names.
#[derive(Args, Clone, Debug, Default)]
pub struct Given {
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<Input>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<Input>,
}

/// The programs of a session.
#[derive(Clone, Debug)]
pub struct Programs {
    /// Paths of everything else.
    pub paths: Paths,
    /// The engine under test.
    pub engine: Engine,
    /// Further engines under test, in a comparison.
    pub others: Vec<Engine>,
    /// The mesher of this repository. It is the engine under test unless another one was named.
    pub mesher: Engine,
    /// The reference of this repository.
    pub reference: Engine,
}

impl Programs {
    /// Finds the programs, with the engine of this name or path under test.
    ///
    /// # Errors
    /// One sentence, if an engine file is missing or wrong.
    pub fn find(name: &str, given: &Given) -> Result<Self, String> {
        let paths = Paths::find();
        let engine = Engine::find(name, given.mesher.as_deref(), &paths)?;
        let mesher = match name {
            "mesher" => engine.clone(),
            _ => Engine::find("mesher", None, &paths)?,
        };
        let reference = Engine::find("reference", given.reference.as_deref(), &paths)?;
        Ok(Self { paths, engine, others: Vec::new(), mesher, reference })
    }

    /// The engine that is called `label` in results: the mesher, the reference or an engine under test.
    pub fn labelled(&self, label: &str) -> &Engine {
        let own = [&self.mesher, &self.reference];
        let mut all = own.into_iter().chain(&self.others);
        all.find(|engine| engine.label() == label).unwrap_or(&self.engine)
    }
}
