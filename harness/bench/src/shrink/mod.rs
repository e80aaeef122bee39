//! `harness shrink`: the smallest case that still fails.
//!
//! [`probe`] says whether a case fails and how; [`reduce`] takes away whatever does not matter: depth, facets, layer
//! cells, boxes, ranks; [`leave`] writes the tiny case with the one line that repeats the failure.
//!
//! Invariant: what is left fails in the same way as what was given. A case that fails in another way is
//! another bug.

pub mod leave;
pub mod probe;
pub mod reduce;

use contract::plain::PlainCase;
use probe::{Failure, Probe, Trial};
use run::engine::interrupt;
use std::path::Path;
use std::time::{Duration, Instant};

/// What may be spent.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Trials at most.
    pub trials: usize,
    /// Time at most.
    pub time: Duration,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Shrunk {
    /// The smallest trial that fails.
    pub trial: Trial,
    /// How it fails.
    pub failure: Failure,
    /// Facets of the case that was given.
    pub facets_before: usize,
    /// Trials made.
    pub trials: usize,
    /// Whether nothing more can be taken away; otherwise the budget was spent.
    pub minimal: bool,
}

/// Shrinks a case; nothing if it does not fail.
///
/// # Errors
/// One sentence, where the case cannot be read or nothing can be run on it.
pub fn shrink(case: &Path, probe: &Probe, budget: &Budget) -> Result<Option<Shrunk>, String> {
    let start = Instant::now();
    let given = Trial { case: PlainCase::read(case)?, ranks: probe.ranks() };
    let Some(failure) = probe.failure(&given)? else { return Ok(None) };
    eprintln!("harness shrink: it fails: {failure}");
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
        // A trial that cannot be made fails in no way, least of all in the same.
        probe.failure(trial).ok().flatten().is_some_and(|other| other.kind == failure.kind)
    };
    let trial = reduce::reduce(given, &mut fails, &mut |told| eprintln!("harness shrink: {told}"));
    let minimal = !spent(trials);
    let failure = probe
        .failure(&trial)?
        .ok_or("the failure does not repeat: it depends on more than the case")?;
    Ok(Some(Shrunk { trial, failure, facets_before, trials, minimal }))
}
