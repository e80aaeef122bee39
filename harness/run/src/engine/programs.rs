//! The programs of a run: their paths, and the engine in the mesher's place where there is one.

use super::description::Description;
use super::paths::{Given, Paths};
use super::runner::Engine;
use std::time::Duration;

/// The programs of a run.
#[derive(Clone, Debug)]
pub struct Programs {
    /// Where they are.
    pub paths: Paths,
    /// The engine that stands in for the mesher, where one was named.
    pub engine: Option<Engine>,
}

impl Programs {
    /// The programs where [`Paths::find`] finds them, and no engine in the mesher's place.
    pub fn find(given: Given) -> Self {
        Self { paths: Paths::find(given), engine: None }
    }

    /// The same with another engine in the mesher's place.
    ///
    /// # Errors
    /// One sentence, where there is no such engine.
    pub fn with_engine(self, name: &str, limit: Duration) -> Result<Self, String> {
        let description = Description::find(name, &self.paths)?;
        let engine = Engine::new(description, &self.paths, limit);
        let paths = Paths { mesher: engine.program().to_owned(), ..self.paths };
        Ok(Self { paths, engine: Some(engine) })
    }

    /// The same with an engine besides the mesher, which stays our own.
    ///
    /// # Errors
    /// One sentence, where there is no such engine.
    pub fn and_engine(self, name: &str, limit: Duration) -> Result<Self, String> {
        let mesher = self.paths.harness.with_file_name("mesher");
        let with_engine = self.with_engine(name, limit)?;
        let paths = Paths { mesher, ..with_engine.paths };
        Ok(Self { paths, ..with_engine })
    }
}
