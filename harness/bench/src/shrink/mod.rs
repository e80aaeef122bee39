//! `harness shrink`: reduces a failing case.
//!
//! [`probe`] finds the checks that a case fails; [`reduce`] removes everything that the failure does not need: depth, facets, layer
//! cells, boxes, seeds, ranks; [`write()`] writes the small case with the command that repeats the failure.
//!
//! Invariant: the reduced case fails the same check as the given one. A different failure is a different bug and does not
//! count.

pub mod probe;
pub mod reduce;

use contract::failure::{Failure, Result};
use contract::files::Staging;
use probe::{Fault, Judged, Trial};
use reduce::size;
use run::engine::interrupt;
use run::engine::layout::Ranks;
use std::path::Path;
use std::time::{Duration, Instant};
use std::{fs, io};

/// The result of a reduction.
#[derive(Clone, Debug)]
pub struct Shrunk {
    /// The smallest trial that fails.
    pub trial: Trial,
    /// How it fails.
    pub fault: Fault,
    /// Facets of the case that was given.
    pub facets_before: usize,
    /// Number of trials.
    pub trials: usize,
    /// Whether nothing more can be removed; otherwise the time is over.
    pub minimal: bool,
}

impl Shrunk {
    /// What the reduced case has in common with the given one, and where it is smaller.
    ///
    /// # Panics
    /// If it fails otherwise, or is larger in any respect, which is a bug.
    fn check_invariants(&self, given: &Trial, first: &Fault) {
        assert!(self.fault.is_same_as(first), "{} in place of {first}", self.fault);
        let (reduced, before) = (self.trial.counts(), given.counts());
        let smaller = reduced.iter().zip(before).all(|(reduced, before)| *reduced <= before);
        assert!(smaller, "facets, boxes, seeds, ranks: {reduced:?} reduced from {before:?}");
        assert_eq!(self.facets_before, before[0], "facets before");
    }
}

/// How a trial fails the check of this name, or else the check that it fails first; `None` if it holds.
///
/// # Errors
/// If the check is not among those that were run.
pub fn fault(judged: &[Judged], check: Option<&str>) -> Result<Option<Fault>> {
    let mut of_name = judged.iter().filter(|one| check.is_none_or(|name| one.0 == name)).peekable();
    if let (Some(name), None) = (check, of_name.peek()) {
        let ran = judged.iter().map(|one| one.0).collect::<Vec<_>>().join(", ");
        let why = format!("left out: the check {name} was not run; those that were: {ran}");
        return Err(Failure::missing(why));
    }
    Ok(of_name.find_map(|one| one.1.clone()))
}

/// The smallest trial that fails as the given one does, as `judge` finds.
///
/// # Errors
/// If the smallest one fails only sometimes.
pub fn shrink(
    given: Trial,
    first: &Fault,
    limit: Duration,
    judge: impl Fn(&Trial) -> Result<Vec<Judged>>,
) -> Result<Shrunk> {
    let (start, mut trials) = (Instant::now(), 1);
    let is_over = || start.elapsed() >= limit || interrupt::requested();
    let same = |trial: &Trial| -> Result<Option<Fault>> {
        Ok(judge(trial)?.into_iter().filter_map(|one| one.1).find(|fault| fault.is_same_as(first)))
    };
    let mut fails = |trial: &Trial| {
        if is_over() {
            return false;
        }
        trials += 1;
        // A trial that cannot be run does not count as the same failure.
        same(trial).is_ok_and(|fault| fault.is_some())
    };
    let (trial, minimal) = (reduce::reduce(given.clone(), &mut fails), !is_over());
    let why = "the failure does not repeat: it depends on more than the case";
    let fault = same(&trial)?.ok_or_else(|| Failure::input(why))?;
    let shrunk = Shrunk { trial, fault, facets_before: given.case.facets.len(), trials, minimal };
    shrunk.check_invariants(&given, first);
    Ok(shrunk)
}

/// Writes `case.toml`, `body.stl` and `README.md` into a new directory, which appears when they are complete; returns the text of the README.
/// `given` chooses the program in the command that repeats the failure.
///
/// # Errors
/// If a file cannot be written.
pub fn write(shrunk: &Shrunk, given: &[&str], staging: &Staging, out: &Path) -> io::Result<String> {
    let Shrunk { trial, fault, facets_before, trials, .. } = shrunk;
    trial.case.write(staging.path())?;
    let case = out.join("case.toml").display().to_string();
    let words = ["harness", "shrink", &case, "--test-only", "--check", &fault.check];
    // Arguments of a process contain no NUL, the one character that a shell cannot quote.
    let line = shlex::try_join(words.into_iter().chain(given.iter().copied()));
    let line = line.expect("no argument contains NUL");
    let ranks = match trial.ranks {
        Ranks::Serial => String::new(),
        Ranks::Mpi(ranks) => format!(" --ranks {ranks} --mpi"),
        Ranks::Simulated { ranks, seed } => format!(" --ranks {ranks} --seed {seed}"),
    };
    let minimal = if shrunk.minimal { "nothing more can be removed" } else { "the time is over" };
    let size = size(trial);
    let text = format!(
        "{fault}\n\nShrunk from {facets_before} facets in {trials} trials ({minimal}) to: {size}.\n\nTo repeat the failure:\n\n    {line}{ranks}\n"
    );
    fs::write(staging.path().join("README.md"), format!("# A case that fails\n\n{text}"))?;
    staging.publish(|made| {
        fs::create_dir_all(out.parent().unwrap_or(out))?;
        fs::rename(made, out)
    })?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Facet;
    use contract::plain::PlainCase;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn judged() -> Vec<Judged> {
        vec![("runs", None), ("balance", Some(Fault::of("balance", "7 findings")))]
    }

    #[test]
    fn a_check_that_was_not_run_is_not_green() {
        let fault = |check| fault(&judged(), check).map_err(|failure| failure.why);
        assert_eq!(fault(None).unwrap().unwrap().check, "balance");
        assert!(fault(Some("runs")).unwrap().is_none());
        let why = "left out: the check balnce was not run; those that were: runs, balance";
        assert_eq!(fault(Some("balnce")).unwrap_err(), why);
    }

    #[test]
    fn every_planted_wrong_answer_is_refused() {
        let table = toml::toml! { seeds = [[0.0, 0.0, 0.0]] };
        let facets = vec![[[0.0; 3]; 3]; 2];
        let given = Trial { case: PlainCase { table, facets }, ranks: Ranks::Mpi(3) };
        let first = Fault::of("balance", "7 findings");
        let right = Shrunk {
            trial: given.clone(),
            fault: Fault::of("balance", "2 findings"),
            facets_before: 2,
            trials: 5,
            minimal: true,
        };
        right.check_invariants(&given, &first);
        let refused = |change: fn(&mut Shrunk)| {
            let mut wrong = right.clone();
            change(&mut wrong);
            let check = || wrong.check_invariants(&given, &first);
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)).is_err()
        };
        assert!(refused(|s| s.fault.check = "sides".into()));
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
        /// invariants, has what the failure needs, and, unless the time is over, nothing else. A larger or another answer is refused.
        #[test]
        fn answers_for_drawn_failures_satisfy_the_invariants(
            (facets, needed) in (1u16..60).prop_flat_map(|n| (Just(n), prop::collection::btree_set(0..n, 0..4))),
            (seeds, ranks, least, wrong) in (0u8..4, 2usize..17, 2usize..17, 0usize..5),
            limit in prop_oneof![Just(Duration::MAX), (0u64..400).prop_map(Duration::from_micros)],
        ) {
            let given = trial(facets, seeds, ranks);
            let least = least.min(ranks);
            let judge = |trial: &Trial| {
                let is_needed = |number: &u16| trial.case.facets.contains(&facet(*number));
                let fails = needed.iter().all(is_needed) && trial.ranks.count() >= least;
                let name = if fails { "balance" } else { "sides" };
                let failure = Some(Fault::of(name, &format!("{} findings", trial.case.facets.len())));
                Ok(vec![(name, failure)])
            };
            let first = Fault::of("balance", "7 findings");
            let mut shrunk = shrink(given.clone(), &first, limit, judge).map_err(|_| TestCaseError::fail("an error"))?;
            let left: BTreeSet<_> = shrunk.trial.case.facets.iter().map(|f| f[0][0] as u16).collect();
            prop_assert!(needed.is_subset(&left) && shrunk.trial.ranks.count() >= least);
            if shrunk.minimal {
                prop_assert_eq!((&left, shrunk.trial.ranks.count()), (&needed, least));
            }
            match wrong {
                0 => shrunk.fault = Fault::of("sides", "1 finding"),
                1 => shrunk.facets_before += 1,
                2 => shrunk.trial.ranks = Ranks::Mpi(ranks + 1),
                3 => shrunk.trial.case.facets = (0..=facets).map(facet).collect(),
                _ => shrunk.trial = trial(0, seeds + 1, 2),
            }
            let check = || shrunk.check_invariants(&given, &first);
            prop_assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(check)).is_err());
        }
    }
}
