//! The prerequisites of a verification, each tried once before the first case.

use super::options::{Need, Options};
use super::report::Missing;
use crate::engine::failure::Failure;
use crate::engine::paths::Paths;
use crate::engine::programs::Programs;
use crate::engine::service::Services;
use crate::oracle::{self, ORACLES, Question};
use crate::proof;
use check::promises::Independence;
use std::sync::OnceLock;
use std::time::Duration;

/// Prerequisites, each with the reason if it is missing, and the programs that stay for the whole verification.
#[derive(Debug, Default)]
pub struct Needs {
    /// Why MPI is unavailable.
    pub mpi: Option<String>,
    /// Whether the ranks that were asked for, or a promise about ranks, require MPI.
    mpi_required: bool,
    /// Of what the engine has no use: of MPI without a command for it, and of what is compared with the definition if it does not
    /// promise that.
    unused: Vec<Need>,
    /// Programs that stay.
    pub services: Services,
    /// The oracles, once they were tried: their packages are imported while the first case is meshed.
    oracles: OnceLock<Oracles>,
    /// Why p4est is unavailable.
    pub p4est: Option<String>,
    /// Why the proven checker is unavailable.
    pub proof: Option<String>,
}

/// What the cases lacked.
#[derive(Debug)]
pub struct Found<'a> {
    /// Number of cases.
    pub cases: usize,
    /// Cases without any check.
    pub unchecked: Vec<&'a str>,
    /// Number of cases without their geometry.
    pub geometries_absent: usize,
    /// Oracles that gave no answer on a case.
    pub oracles_silent: Vec<Failure>,
}

/// The oracles of this machine.
#[derive(Debug, Default)]
pub struct Oracles {
    /// Those that can be used.
    pub found: Vec<&'static str>,
    /// Why none can be used.
    pub lacking: Option<String>,
    /// Failures of the others.
    missing: Vec<Failure>,
}

/// Longest time for a probe.
const PROBE_LIMIT_MAX: Duration = Duration::from_secs(60);

impl Needs {
    /// Tries the prerequisites of these options.
    pub fn probe(options: &Options, programs: &Programs) -> Self {
        let engine = programs.engine.description();
        let promised = engine.promises.is_independent_of(Independence::Ranks);
        let mut needs = Self {
            mpi: match options.no_mpi {
                false => programs.engine.lacks_mpi(),
                true => Some("--no-mpi was given".to_owned()),
            },
            mpi_required: !options.no_mpi
                && (options.ranks.is_some() || promised && engine.run.parallel.is_some()),
            ..Self::default()
        };
        if needs.mpi.is_none() {
            // All start at the same time, while the first case is meshed serially.
            let counts = options.rank_counts(engine).into_iter();
            counts.for_each(|ranks| programs.engine.start_ranks(ranks, &needs.services));
        }
        let unused = (!engine.promises.definition)
            .then(|| format!("{} does not promise the definition", engine.name));
        let unless = |given: bool, option: &str| {
            unused.clone().or_else(|| given.then(|| format!("--{option} was given")))
        };
        let p4est = &programs.paths.p4est;
        let built = || format!("{} is missing (ci/setup compiles it)", p4est.display());
        needs.p4est =
            unless(options.no_p4est, "no-p4est").or_else(|| (!p4est.is_file()).then(built));
        needs.proof = unless(options.no_proof, "no-proof")
            .or_else(|| proof::lacks(&programs.paths.proven_checker));
        match unless(options.no_oracles, "no-oracles") {
            // Those that cannot be started are found when they are tried.
            None => ORACLES
                .iter()
                .for_each(|o| drop(oracle::start(o, &needs.services, &programs.paths))),
            lacking => needs.oracles = OnceLock::from(Oracles { lacking, ..Oracles::default() }),
        }
        let of_definition =
            [Need::Oracles, Need::P4est, Need::Proof].into_iter().filter(|_| unused.is_some());
        needs.unused = of_definition.collect();
        if engine.run.parallel.is_none() && options.ranks.is_none() {
            needs.unused.push(Need::Mpi);
        }
        needs
    }

    /// The oracles. The first call waits until they have imported their packages.
    pub fn oracles(&self, options: &Options, paths: &Paths) -> &Oracles {
        let limit = options.limit().min(PROBE_LIMIT_MAX);
        self.oracles.get_or_init(|| probe_oracles(&self.services, paths, limit))
    }

    /// Everything that is missing, once each. A check of a case that was named, or of any case at all, is always required.
    pub fn missing(&self, options: &Options, paths: &Paths, found: &Found) -> Vec<Missing> {
        let oracles = self.oracles(options, paths);
        // The vote needs all oracles, so one that is missing, or gave no answer on a case, counts as all.
        let one =
            || oracles.missing.iter().chain(&found.oracles_silent).next().map(Failure::to_string);
        let oracles = oracles.lacking.clone().or_else(one);
        let geometries = match found.geometries_absent {
            0 => None,
            count => Some(format!(
                "{count} geometries are missing (ci/setup --geometries fetches those that can be fetched)"
            )),
        };
        let unchecked = (!found.unchecked.is_empty())
            .then(|| format!("no check was run on {}", found.unchecked.join(", ")));
        let all = [
            (Need::Mpi, self.mpi.clone()),
            (Need::Oracles, oracles),
            (Need::P4est, self.p4est.clone()),
            (Need::Proof, self.proof.clone()),
            (Need::Geometries, geometries),
            (Need::Checks, unchecked),
        ];
        let nothing = found.unchecked.len() == found.cases || !options.cases.is_empty();
        let missing = all.into_iter().filter_map(|(need, why)| {
            let required = match need {
                _ if options.require.contains(&need) => true,
                _ if self.unused.contains(&need) => return None,
                Need::Mpi => self.mpi_required,
                Need::Checks => nothing,
                _ => false,
            };
            Some(Missing { what: need.to_string(), why: why?, required })
        });
        missing.collect()
    }
}

fn probe_oracles(services: &Services, paths: &Paths, limit: Duration) -> Oracles {
    let mut oracles = Oracles::default();
    let written = tempfile::tempdir().and_then(|probe| {
        let question = Question::write(&[[0.0; 3]], &[], probe.path())?;
        Ok((probe, question))
    });
    let (_probe, question) = match written {
        Ok(written) => written,
        Err(error) => return Oracles { lacking: Some(error.to_string()), ..oracles },
    };
    for (oracle, answer) in question.ask(&ORACLES, services, paths, limit) {
        match answer {
            Ok(_) => oracles.found.push(oracle),
            Err(failure) => oracles.missing.push(failure),
        }
    }
    if oracles.found.is_empty() {
        oracles.lacking = oracles.missing.first().map(Failure::to_string);
    }
    oracles
}
