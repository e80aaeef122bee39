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
use probe::{Failure, Judged, Probe, Trial, Unknown};
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

impl Shrunk {
    /// What the reduced case has in common with the given one, and where it is smaller.
    ///
    /// # Panics
    /// If it fails otherwise, or is larger in any respect, which is a bug.
    fn check_invariants(&self, given: &Trial, first: &Failure, budget: &Budget) {
        assert!(self.failure.is_same_as(first), "{} in place of {first}", self.failure);
        assert!(self.trials <= budget.trials.max(1), "{} of {} trials", self.trials, budget.trials);
        let measures = |trial: &Trial| {
            let count =
                |key| trial.case.table.get(key).and_then(|v| v.as_array()).map_or(0, Vec::len);
            [trial.case.facets.len(), count("box"), count("seeds"), trial.ranks.count()]
        };
        let (reduced, before) = (measures(&self.trial), measures(given));
        let smaller = reduced.iter().zip(before).all(|(reduced, before)| *reduced <= before);
        assert!(smaller, "facets, boxes, seeds, ranks: {reduced:?} reduced from {before:?}");
        assert_eq!(self.facets_before, before[0], "facets before");
    }
}

/// What a trial shows about a check, or about all.
#[derive(Clone, Debug)]
pub enum Verdict {
    /// It fails.
    Fails(Failure),
    /// It holds, with all others that were run: their number, at least 1.
    Holds(usize),
}

/// How a case fails the check of this name, or else the check that it fails first.
///
/// # Errors
/// If the engine declines the case, no program can be run on it, or the check is not among those that were run.
pub fn verdict(trial: &Trial, probe: &Probe, check: Option<&str>) -> Result<Verdict, Unknown> {
    verdict_of(probe.judge(trial, check)?, check)
}

fn verdict_of(mut judged: Vec<Judged>, check: Option<&str>) -> Result<Verdict, Unknown> {
    let ran: Vec<&str> = judged.iter().map(|one| one.check).collect();
    let ran = ran.join(", ");
    judged.retain(|one| check.is_none_or(|name| one.check == name));
    let count = judged.len();
    match (judged.into_iter().find_map(|one| one.failure), check) {
        (Some(failure), _) => Ok(Verdict::Fails(failure)),
        (None, Some(name)) if count == 0 => {
            Err(Unknown::LeftOut(format!("the check {name} was not run; those that were: {ran}")))
        }
        _ => Ok(Verdict::Holds(count)),
    }
}

/// Reduces a case that fails the check of this name, or else the check that it fails first; returns the number of checks that hold
/// if it does not fail.
///
/// # Errors
/// If the case cannot be read, the engine declines it, or no program can be run on it.
pub fn shrink(
    case: &Path,
    probe: &Probe,
    check: Option<&str>,
    budget: &Budget,
) -> Result<Result<Shrunk, usize>, Unknown> {
    let case = PlainCase::read(case).map_err(Unknown::Error)?;
    let given = Trial { case, ranks: probe.ranks() };
    let first = match verdict(&given, probe, check)? {
        Verdict::Fails(failure) => failure,
        Verdict::Holds(count) => return Ok(Err(count)),
    };
    crate::announce(&format!("harness shrink: the case fails {first}"));
    smallest(given, &first, budget, |trial| probe.judge(trial, None)).map(Ok)
}

/// The smallest trial that fails as the given one does.
fn smallest(
    given: Trial,
    first: &Failure,
    budget: &Budget,
    judge: impl Fn(&Trial) -> Result<Vec<Judged>, Unknown>,
) -> Result<Shrunk, Unknown> {
    let start = Instant::now();
    let mut trials = 1;
    let spent = |trials| {
        trials >= budget.trials || start.elapsed() >= budget.time || interrupt::requested()
    };
    let same = |trial: &Trial| -> Result<Option<Failure>, Unknown> {
        let mut failures = judge(trial)?.into_iter().filter_map(|one| one.failure);
        Ok(failures.find(|failure| failure.is_same_as(first)))
    };
    let mut fails = |trial: &Trial| {
        if spent(trials) {
            return false;
        }
        trials += 1;
        // A trial that cannot be run does not count as the same failure.
        same(trial).is_ok_and(|failure| failure.is_some())
    };
    let trial = reduce::reduce(given.clone(), &mut fails, &mut |text| {
        crate::announce(&format!("harness shrink: {text}"))
    });
    let minimal = !spent(trials);
    let failure = same(&trial)?.ok_or_else(|| {
        let why = "the failure does not repeat: it depends on more than the case";
        Unknown::Error(why.to_owned())
    })?;
    let facets_before = given.case.facets.len();
    let shrunk = Shrunk { trial, failure, facets_before, trials, minimal };
    shrunk.check_invariants(&given, first, budget);
    Ok(shrunk)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Facet;
    use proptest::prelude::*;
    use run::engine::layout::Ranks;
    use std::collections::BTreeSet;

    fn judged() -> Vec<Judged> {
        vec![
            Judged { check: "runs", failure: None },
            Judged { check: "balance", failure: Some(Failure::of("balance", "7 findings")) },
        ]
    }

    #[test]
    fn a_check_that_was_not_run_is_not_green() {
        let verdict = |check| verdict_of(judged(), check);
        assert!(matches!(verdict(None), Ok(Verdict::Fails(failure)) if failure.check == "balance"));
        assert!(matches!(verdict(Some("runs")), Ok(Verdict::Holds(1))));
        let Err(Unknown::LeftOut(why)) = verdict(Some("balnce")) else { panic!("a verdict") };
        assert_eq!(why, "the check balnce was not run; those that were: runs, balance");
    }

    #[test]
    fn every_planted_wrong_answer_is_refused() {
        let table = toml::toml! { seeds = [[0.0, 0.0, 0.0]] };
        let facets = vec![[[0.0; 3]; 3]; 2];
        let given = Trial { case: PlainCase { table, facets }, ranks: Ranks::Mpi(3) };
        let first = Failure::of("balance", "7 findings");
        let budget = Budget { trials: 5, time: Duration::ZERO };
        let right = Shrunk {
            trial: given.clone(),
            failure: Failure::of("balance", "2 findings"),
            facets_before: 2,
            trials: 5,
            minimal: true,
        };
        right.check_invariants(&given, &first, &budget);
        let refused = |change: fn(&mut Shrunk)| {
            let mut wrong = right.clone();
            change(&mut wrong);
            let check = || wrong.check_invariants(&given, &first, &budget);
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)).is_err()
        };
        assert!(refused(|s| s.failure.check = "sides".into()) && refused(|s| s.trials = 6));
        assert!(refused(|s| s.facets_before = 3) && refused(|s| s.trial.ranks = Ranks::Mpi(4)));
        assert!(refused(|s| s.trial.case.facets.push([[1.0; 3]; 3])));
    }

    fn facet(number: u16) -> Facet {
        [[f32::from(number); 3]; 3]
    }

    /// A trial with so many facets, seeds and ranks.
    fn trial(facets: u16, seeds: u8, ranks: usize) -> Trial {
        let seeds = (0..seeds).map(|x| vec![f64::from(x); 3]);
        let mut table = toml::toml! { spacing_min = 0.1 };
        table.insert("seeds".into(), toml::Value::try_from(seeds.collect::<Vec<_>>()).unwrap());
        let facets = (0..facets).map(facet).collect();
        Trial { case: PlainCase { table, facets }, ranks: Ranks::Mpi(ranks) }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..ProptestConfig::default() })]

        /// A check fails where some facets and so many ranks are, and another one where they are not. The answer satisfies its
        /// invariants, has what the failure needs, and, unless the budget is exhausted, nothing else. A larger or another answer is refused.
        #[test]
        fn answers_for_drawn_failures_satisfy_the_invariants(
            (facets, needed) in (1u16..60).prop_flat_map(|n| (Just(n), prop::collection::btree_set(0..n, 0..4))),
            (seeds, ranks, least, budget) in (0u8..4, 2usize..17, 2usize..17, 1usize..400),
            wrong in 0usize..6,
        ) {
            let given = trial(facets, seeds, ranks);
            let least = least.min(ranks);
            let judge = |trial: &Trial| {
                let is_needed = |number: &u16| trial.case.facets.contains(&facet(*number));
                let fails = needed.iter().all(is_needed) && trial.ranks.count() >= least;
                let name = if fails { "balance" } else { "sides" };
                let failure = Some(Failure::of(name, &format!("{} findings", trial.case.facets.len())));
                Ok(vec![Judged { check: name, failure }])
            };
            let first = Failure::of("balance", "7 findings");
            let budget = Budget { trials: budget, time: Duration::MAX };
            let mut shrunk = smallest(given.clone(), &first, &budget, judge).map_err(|_| TestCaseError::fail("an error"))?;
            let left: BTreeSet<_> = shrunk.trial.case.facets.iter().map(|f| f[0][0] as u16).collect();
            prop_assert!(needed.is_subset(&left) && shrunk.trial.ranks.count() >= least);
            if shrunk.minimal {
                prop_assert_eq!((&left, shrunk.trial.ranks.count()), (&needed, least));
            }
            match wrong {
                0 => shrunk.failure = Failure::of("sides", "1 finding"),
                1 => shrunk.trials = budget.trials + 1,
                2 => shrunk.facets_before += 1,
                3 => shrunk.trial.ranks = Ranks::Mpi(ranks + 1),
                4 => shrunk.trial.case.facets = (0..=facets).map(facet).collect(),
                _ => shrunk.trial = trial(0, seeds + 1, 2),
            }
            let check = || shrunk.check_invariants(&given, &first, &budget);
            prop_assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)).is_err());
        }
    }
}
