//! The prerequisites of a verification, each tried once before the first case.

use super::options::{Need, Options};
use super::report::{CaseReport, Missing};
use crate::engine::description::Description;
use crate::engine::failure::{End, Failure};
use crate::engine::programs::Programs;
use crate::engine::service::Services;
use crate::oracle::{self, ORACLES};
use crate::proof;
use check::promises::Independence;
use std::cell::RefCell;

/// Name of the check of a case whose geometry is absent.
pub(super) const GEOMETRY: &str = "geometry";

/// The programs that stay for the whole verification, and why others are not used.
#[derive(Debug, Default)]
pub(super) struct Needs {
    pub services: Services,
    /// Why MPI is not used.
    pub mpi: Option<String>,
    /// Why no oracle is asked.
    pub oracles: Option<String>,
    /// Why p4est is not used.
    pub p4est: Option<String>,
    /// Why the proven checker is not used.
    pub proof: Option<String>,
    /// Oracles that gave no answer.
    silent: RefCell<Vec<Failure>>,
}

impl Needs {
    /// Tries the prerequisites of these options, and starts what stays while the first case is meshed serially.
    pub fn probe(options: &Options, programs: &Programs) -> Self {
        let (engine, paths) = (programs.engine.description(), &programs.paths);
        let unused = (!engine.promises.definition)
            .then(|| format!("{} does not promise the definition", engine.name));
        let unless = |is_given: bool, option: &str| {
            unused.clone().or_else(|| is_given.then(|| format!("--{option} was given")))
        };
        let built = || {
            (!paths.p4est.is_file())
                .then(|| format!("{} is missing (ci/setup compiles it)", paths.p4est.display()))
        };
        let needs = Self {
            mpi: match options.no_mpi {
                false => programs.engine.lacks_mpi(),
                true => Some("--no-mpi was given".to_owned()),
            },
            oracles: unless(options.no_oracles, "no-oracles"),
            p4est: unless(options.no_p4est, "no-p4est").or_else(built),
            proof: unless(options.no_proof, "no-proof")
                .or_else(|| proof::lacks(&paths.proven_checker)),
            ..Self::default()
        };
        if needs.mpi.is_none() {
            let counts = options.rank_counts(engine).into_iter();
            counts.for_each(|ranks| programs.engine.start_ranks(ranks, &needs.services));
        }
        if needs.oracles.is_none() {
            // Their packages take seconds to import. Those that cannot be started are found when they are asked.
            ORACLES.iter().for_each(|of| drop(oracle::start(of, &needs.services, paths)));
        }
        needs
    }

    /// Notes that an oracle gave no answer.
    pub fn note_silent(&self, failure: &Failure) {
        self.silent.borrow_mut().push(failure.clone());
    }

    /// Why an oracle cannot be asked: it is missing, or has hung, which costs the whole time limit.
    pub fn lacks_oracle(&self, oracle: &str) -> Option<Failure> {
        let is_gone = |failure: &&Failure| {
            failure.program == oracle
                && matches!(failure.end, End::Missing(_) | End::TimedOut { .. })
        };
        self.silent.borrow().iter().find(is_gone).cloned()
    }

    /// Everything that is missing, once each. A check of a case that was named, or of any case at all, is always required.
    pub fn missing(
        self,
        options: &Options,
        engine: &Description,
        cases: &[CaseReport],
        interrupted: bool,
    ) -> Vec<Missing> {
        // The vote needs all oracles, so one that is missing, or gave no answer on a case, counts as all.
        let silent = self.silent.into_inner();
        let absent = |case: &&CaseReport| case.checks.iter().any(|check| check.name == GEOMETRY);
        let absent = cases.iter().filter(absent).count();
        let geometries = format!(
            "{absent} geometries are missing (ci/setup --geometries fetches those that can be fetched)"
        );
        // That an interrupt left the last ones without checks is no news.
        let unchecked =
            |case: &&CaseReport| !interrupted && !case.is_checked() && case.input_error.is_none();
        let unchecked: Vec<&str> = cases.iter().filter(unchecked).map(|case| &*case.name).collect();
        let no_check = format!("no check was run on {}", unchecked.join(", "));
        let of_definition = engine.promises.definition.then_some(false);
        let (ranks, parallel) = (options.ranks.is_some(), engine.run.parallel.is_some());
        let of_ranks = engine.promises.is_independent_of(Independence::Ranks) && parallel;
        let of_ranks = (ranks || parallel).then_some(!options.no_mpi && (ranks || of_ranks));
        let nothing = unchecked.len() == cases.len() || !options.cases.is_empty();
        // Without `--require`, whether it is required; `None` if the engine has no use of it.
        let all = [
            (Need::Mpi, self.mpi, of_ranks),
            (
                Need::Oracles,
                self.oracles.or_else(|| silent.first().map(Failure::to_string)),
                of_definition,
            ),
            (Need::P4est, self.p4est, of_definition),
            (Need::Proof, self.proof, of_definition),
            (Need::Geometries, (absent > 0).then_some(geometries), Some(false)),
            (Need::Checks, (!unchecked.is_empty()).then_some(no_check), Some(nothing)),
        ];
        let missing = all.into_iter().filter_map(|(need, why, required)| {
            let required = if options.require.contains(&need) { true } else { required? };
            Some(Missing { what: need.to_string(), why: why?, required })
        });
        missing.collect()
    }
}
