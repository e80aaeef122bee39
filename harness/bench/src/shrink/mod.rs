//! `harness shrink`: reduces a failing case.
//!
//! [`probe`] finds the checks that a case fails; [`reduce`] removes everything that the failure does not need: depth, facets, layer
//! cells, boxes, seeds, ranks; [`bundle`] writes the small case with the command that repeats the failure.
//!
//! Invariant: the reduced case fails the same check as the given one. A different failure is a different bug and does not
//! count.

pub mod bundle;
pub mod probe;
pub mod reduce;

use contract::plain::PlainCase;
use probe::{Failure, Probe, Trial, Unknown};
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

/// How a case fails the check of this name, or else the check that it fails first; `None` if it does not fail it.
///
/// # Errors
/// If the engine declines the case, or no program can be run on it.
pub fn failure(
    trial: &Trial,
    probe: &Probe,
    check: Option<&str>,
) -> Result<Option<Failure>, Unknown> {
    let failures = probe.failures(trial)?;
    Ok(failures.into_iter().find(|failure| check.is_none_or(|name| failure.check == name)))
}

/// Reduces a case that fails the check of this name, or else the check that it fails first; `None` if it does not fail it.
///
/// # Errors
/// If the case cannot be read, the engine declines it, or no program can be run on it.
pub fn shrink(
    case: &Path,
    probe: &Probe,
    check: Option<&str>,
    budget: &Budget,
) -> Result<Option<Shrunk>, Unknown> {
    let start = Instant::now();
    let case = PlainCase::read(case).map_err(Unknown::Error)?;
    let given = Trial { case, ranks: probe.ranks() };
    let Some(first) = failure(&given, probe, check)? else { return Ok(None) };
    crate::announce(&format!("harness shrink: the case fails {first}"));
    let facets_before = given.case.facets.len();
    let mut trials = 1;
    let spent = |trials| {
        trials >= budget.trials || start.elapsed() >= budget.time || interrupt::requested()
    };
    let same = |trial: &Trial| -> Result<Option<Failure>, Unknown> {
        let failures = probe.failures(trial)?;
        Ok(failures.into_iter().find(|failure| failure.is_same_as(&first)))
    };
    let mut fails = |trial: &Trial| {
        if spent(trials) {
            return false;
        }
        trials += 1;
        // A trial that cannot be run does not count as the same failure.
        same(trial).is_ok_and(|failure| failure.is_some())
    };
    let trial = reduce::reduce(given, &mut fails, &mut |text| {
        crate::announce(&format!("harness shrink: {text}"))
    });
    let minimal = !spent(trials);
    let failure = same(&trial)?.ok_or_else(|| {
        let why = "the failure does not repeat: it depends on more than the case";
        Unknown::Error(why.to_owned())
    })?;
    Ok(Some(Shrunk { trial, failure, facets_before, trials, minimal }))
}
