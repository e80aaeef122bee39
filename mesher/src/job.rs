//! A run on one rank: what its phases share.

use crate::counters::Counters;
use crate::options::Options;
use crate::record::Recorder;
use ranks::{Comm, uncounted};

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

    /// Whether checks run: in debug builds, and in release builds if the options ask for them.
    pub fn checks(&self) -> bool {
        self.options.checks()
    }

    /// Checks what a phase has made if checks are on. Messages are not counted. Collective if `check` is.
    pub fn check(&self, check: impl FnOnce(&dyn Comm)) {
        if self.checks() {
            uncounted(self.comm, || check(self.comm));
        }
    }
}
