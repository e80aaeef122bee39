//! The prerequisites of a verification, each tried once before the first case.

use super::options::{Need, Options};
use super::report::Missing;
use crate::engine::failure::Failure;
use crate::engine::paths::Paths;
use crate::engine::programs::Programs;
use crate::oracle::{ORACLES, Question};
use check::promises::Independence;
use std::path::Path;
use std::time::Duration;

/// Prerequisites, each with the reason if it is missing.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    /// Why MPI is unavailable.
    pub mpi: Option<String>,
    /// Whether the ranks that were asked for, or a promise about ranks, require MPI.
    mpi_required: bool,
    /// Why no oracle can be used.
    pub oracles: Option<String>,
    /// Oracles that can be used.
    pub oracles_found: Vec<&'static str>,
    /// Failures of the other oracles.
    oracles_missing: Vec<Failure>,
    /// Why p4est is unavailable.
    pub p4est: Option<String>,
    /// Why geometries are missing, one reason each.
    geometries: Vec<String>,
    /// Cases without any check.
    unchecked: Vec<String>,
}

/// Longest time for a probe.
const PROBE_LIMIT_MAX: Duration = Duration::from_secs(60);

fn probe_limit(options: &Options) -> Duration {
    options.limit().min(PROBE_LIMIT_MAX)
}

impl Needs {
    /// Tries the prerequisites of these options.
    pub fn probe(options: &Options, programs: &Programs, place: &Path) -> Self {
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
        let p4est = &programs.paths.p4est;
        needs.p4est = match (options.no_p4est, p4est.is_file()) {
            (true, _) => Some("--no-p4est was given".to_owned()),
            (_, false) => Some(format!("{} is missing (ci/setup compiles it)", p4est.display())),
            (_, true) => None,
        };
        match options.no_oracles {
            false => needs.probe_oracles(&programs.paths, place, probe_limit(options)),
            true => needs.oracles = Some("--no-oracles was given".to_owned()),
        }
        needs
    }

    fn probe_oracles(&mut self, paths: &Paths, place: &Path, limit: Duration) {
        let written = tempfile::tempdir_in(place).and_then(|probe| {
            let question = Question::write(&[[0.0; 3]], &[], probe.path())?;
            Ok((probe, question))
        });
        let (_probe, question) = match written {
            Ok(written) => written,
            Err(error) => return self.oracles = Some(error.to_string()),
        };
        for oracle in ORACLES {
            match question.ask(oracle, paths, limit) {
                Ok(_) => self.oracles_found.push(oracle),
                Err(failure) if failure.is_interrupt() => return,
                Err(failure) => self.oracles_missing.push(failure),
            }
        }
        if self.oracles_found.is_empty() {
            self.oracles = self.oracles_missing.first().map(Failure::to_string);
        }
    }

    /// Records oracles that gave no answer on a case: a required vote needs all of them.
    pub fn note_silent_oracles(&mut self, failures: Vec<Failure>) {
        self.oracles_missing.extend(failures);
    }

    /// Records that no check of a case was run.
    pub fn note_unchecked(&mut self, case: &str) {
        self.unchecked.push(case.to_owned());
    }

    /// Records that the geometry of a case is missing.
    pub fn note_absent_geometry(&mut self, why: &str) {
        self.geometries.push(why.to_owned());
    }

    /// Everything that is missing, once each. A check of a case that was named, or of any case at all, is always required.
    pub fn missing(&self, options: &Options, cases: usize) -> Vec<Missing> {
        // The vote needs all oracles, so one that is missing counts as all.
        let one = || self.oracles_missing.first().map(Failure::to_string);
        let oracles = self.oracles.clone().or_else(one);
        let geometries = match self.geometries.len() {
            0 => None,
            count => Some(format!(
                "{count} geometries are missing (ci/setup --geometries fetches those that can be fetched)"
            )),
        };
        let unchecked = (!self.unchecked.is_empty())
            .then(|| format!("no check was run on {}", self.unchecked.join(", ")));
        let all = [
            (Need::Mpi, self.mpi.clone()),
            (Need::Oracles, oracles),
            (Need::P4est, self.p4est.clone()),
            (Need::Geometries, geometries),
            (Need::Checks, unchecked),
        ];
        let nothing = self.unchecked.len() == cases || !options.cases.is_empty();
        let missing = all.into_iter().filter_map(|(need, why)| {
            let required = match need {
                _ if options.require.contains(&need) => true,
                Need::Mpi => self.mpi_required,
                Need::Checks => nothing,
                _ => false,
            };
            Some(Missing { what: need.to_string(), why: why?, required })
        });
        missing.collect()
    }
}
