//! Fuzz targets: every reader of a file that somebody else may have written, and the mesher against the reference.
//!
//! A target is a function of some bytes. It panics if it has found a fault: programs that read a file differently, or a mesh that is not
//! that of the definition. A reader's own panic, an allocation beyond the limit of `ci/fuzz`, and an input that takes seconds are faults, too.
//! `ci/fuzz` generates inputs with libFuzzer; the inputs in `corpus/TARGET` are tried by an ordinary test.

pub mod drawn;
mod repair;
mod scratch;
mod targets;

pub use scratch::Scratch;
pub use targets::TARGETS;

use std::path::{Path, PathBuf};

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, which is that of its directory in the corpus.
    pub name: &'static str,
    /// Tries an input; returns whether it was accepted. Panics if it has found a fault.
    pub run: fn(&mut Scratch, &[u8]) -> bool,
}

impl Target {
    /// The target with a name.
    pub fn named(name: &str) -> Option<Self> {
        TARGETS.into_iter().find(|target| target.name == name)
    }

    /// The directory with its committed inputs.
    pub fn corpus(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(self.name)
    }
}
