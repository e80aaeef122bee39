//! `harness shrink`: reduces a failing case.
//!
//! [`probe`] tests whether and how a case fails; [`reduce`] removes everything that the failure does not need: depth, facets, layer
//! cells, boxes, seeds, ranks; [`bundle`] writes the small case with the command that repeats the failure.
//!
//! Invariant: the reduced case fails in the same way as the given one. A different failure is a different bug.

pub mod bundle;
pub mod probe;
pub mod reduce;

use contract::plain::PlainCase;
use probe::{Failure, Probe, Trial};
use run::engine::interrupt;
use std::path::Path;
use std::time::{Duration, Instant};

/// Limits of a reduction.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Maximum number of trials.
    pub trials: usize,
    /// Maximum time.
    pub time: Duration,
}

/// The result of a reduction.
#[derive(Clone, Debug)]
pub struct Shrunk {
    /// The smallest trial that fails.
    pub trial: Trial,
    /// How it fails.
    pub failure: Failure,
    /// Facets of the case that was given.
    pub facets_before: usize,
    /// Number of trials.
    pub trials: usize,
    /// Whether nothing more can be removed; otherwise the budget is exhausted.
    pub minimal: bool,
}

/// Reduces a case; `None` if it does not fail.
///
/// # Errors
/// One sentence, if the case cannot be read or no program can be run on it.
pub fn shrink(case: &Path, probe: &Probe, budget: &Budget) -> Result<Option<Shrunk>, String> {
    let start = Instant::now();
    let given = Trial { case: PlainCase::read(case)?, ranks: probe.ranks() };
    let Some(failure) = probe.failure(&given)? else { return Ok(None) };
    eprintln!("harness shrink: the case fails: {failure}");
    let facets_before = given.case.facets.len();
    let mut trials = 1;
    let spent = |trials| {
        trials >= budget.trials || start.elapsed() >= budget.time || interrupt::requested()
    };
    let mut fails = |trial: &Trial| {
        if spent(trials) {
            return false;
        }
        trials += 1;
        // A trial that cannot be run does not count as the same failure.
        probe.failure(trial).ok().flatten().is_some_and(|other| other.kind == failure.kind)
    };
    let trial = reduce::reduce(given, &mut fails, &mut |text| eprintln!("harness shrink: {text}"));
    let minimal = !spent(trials);
    let failure = probe
        .failure(&trial)?
        .ok_or("the failure does not repeat: it depends on more than the case")?;
    Ok(Some(Shrunk { trial, failure, facets_before, trials, minimal }))
}
