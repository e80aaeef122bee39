//! A run on one rank: its options, and what its phases share.

use crate::output::write::Output;
use crate::partition::Division;
use crate::record::{Counters, Recorder};
use ranks::{Comm, uncounted};

/// Options that have no effect on the mesh, but for `ungraded`.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How to divide the work among ranks.
    pub division: Division,
    /// Stop after sides: the mesh is the base tree T0, with all its leaves.
    pub ungraded: bool,
    /// What to write, and where.
    pub out: Option<Output>,
    /// Check invariants after each phase, which debug builds do in any case.
    pub check: bool,
    /// Fail if the geometry leaks.
    pub strict: bool,
    /// What to call the case in advice to the user.
    pub case_name: String,
}

impl Options {
    /// Whether checks run: in debug builds, and in release builds on request.
    pub fn checks(&self) -> bool {
        cfg!(debug_assertions) || self.check
    }
}

/// A run on one rank.
pub struct Job<'a> {
    /// The same on all ranks.
    pub options: &'a Options,
    /// All ranks.
    pub comm: &'a dyn Comm,
    /// Times and messages of the phases.
    pub record: &'a mut Recorder,
    /// Work done by this rank.
    pub counters: Counters,
}

impl<'a> Job<'a> {
    /// A run that has done nothing.
    pub fn new(options: &'a Options, comm: &'a dyn Comm, record: &'a mut Recorder) -> Self {
        Self { options, comm, record, counters: Counters::default() }
    }

    /// Runs and times a phase, or part of it. Collective if `work` is.
    pub fn phase<T>(&mut self, name: &'static str, work: impl FnOnce(&dyn Comm) -> T) -> T {
        self.record.phase(name, self.comm, || work(self.comm))
    }

    /// Checks what a phase has made if checks are on. Messages are not counted. Collective if `check` is.
    pub fn check(&self, check: impl FnOnce(&dyn Comm)) {
        if self.options.checks() {
            uncounted(self.comm, || check(self.comm));
        }
    }
}
