//! The prerequisites of a verification, each tried once before the first case.

use super::options::{Need, Options};
use super::report::Missing;
use crate::engine::failure::{End, Failure};
use crate::engine::layout::{Layout, Ranks};
use crate::engine::options::RunOptions;
use crate::engine::paths::Paths;
use crate::engine::programs::Programs;
use crate::oracle::{ORACLES, Question};
use contract::case::Case;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Prerequisites, each with the reason if it is missing.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    /// Why MPI is unavailable.
    pub mpi: Option<String>,
    /// Why it is unknown whether the engine's ranks on MPI communicate.
    pub mpi_doubt: Option<String>,
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

/// A case for trying programs out: eight cells around a cube.
const PROBE: &str = "spacing_min = 1.0\nroot_scale = 2.0\nkeep = KEEP\n[generator]\n\
                     shape = \"cube\"\nfacets = 12\n";
const PROBE_RANKS: usize = 2;
/// Longest time for a probe.
const PROBE_LIMIT_MAX: Duration = Duration::from_secs(60);

fn probe_limit(options: &Options) -> Duration {
    options.limit.min(PROBE_LIMIT_MAX)
}

impl Needs {
    /// Tries the prerequisites of these options.
    pub fn probe(options: &Options, programs: &Programs, place: &Path) -> Self {
        let probed = match options.mpi {
            true => probe_mpi(programs, place, probe_limit(options)),
            false => Err("--no-mpi was given".to_owned()),
        };
        let mut needs = match probed {
            Ok(mpi_doubt) => Self { mpi_doubt, ..Self::default() },
            Err(why) => Self { mpi: Some(why), ..Self::default() },
        };
        let p4est = &programs.paths.p4est;
        needs.p4est = match (options.p4est, p4est.is_file()) {
            (false, _) => Some("--no-p4est was given".to_owned()),
            (true, false) => Some(format!("{} is missing (ci/setup compiles it)", p4est.display())),
            (true, true) => None,
        };
        match options.oracles {
            true => needs.probe_oracles(&programs.paths, place, probe_limit(options)),
            false => needs.oracles = Some("--no-oracles was given".to_owned()),
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

    /// Everything that is missing, once each. If no case was checked, that counts as required with any requirement.
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
        let nothing = self.unchecked.len() == cases && !options.require.is_empty();
        let missing = all.into_iter().filter_map(|(need, why)| {
            let required = options.require.contains(&need) || need == Need::Checks && nothing;
            Some(Missing { what: need.to_string(), why: why?, required })
        });
        missing.collect()
    }
}

/// Checks that `mpirun` starts the engine and, if the engine reports the number of its ranks, that they communicate,
/// which the ranks of a mesher without MPI do not. Returns what remains unknown.
fn probe_mpi(programs: &Programs, place: &Path, limit: Duration) -> Result<Option<String>, String> {
    if !programs.paths.mpirun.is_file() {
        return Err("mpirun is not on the PATH (ci/setup installs it)".to_owned());
    }
    let engine = &programs.engine;
    let probe = tempfile::tempdir_in(place).map_err(|error| error.to_string())?;
    let case = probe.path().join("probe.toml");
    let keep = engine.description().takes.keep.first();
    let keep = format!("{:?}", keep.copied().unwrap_or_default()).to_lowercase();
    fs::write(&case, PROBE.replace("KEEP", &format!("{keep:?}")))
        .map_err(|error| error.to_string())?;
    let read = Case::read(&case).map_err(|error| error.to_string())?;
    if let Some(why) = engine.description().declines(&read) {
        return Err(format!("no case tries it out: {why}"));
    }
    let case = engine.prepare(&case, &probe.path().join("plain"))?;
    let layout = Layout {
        partitioner: Some("morton".into()),
        level_base: Some("auto".into()),
        ..Layout::on(Ranks::Mpi(PROBE_RANKS))
    };
    let completed = engine.run(&case, &layout, &RunOptions::new(probe.path(), limit));
    let failed = |failure: Failure| match failure.end {
        End::Missing(_) => failure.to_string(),
        _ => format!("on MPI, {failure}"),
    };
    let ranks = completed.map_err(failed)?.report.ranks;
    match (engine.writes_report(), ranks) {
        (false, _) => {
            let why =
                "it is unknown whether the ranks communicate: the engine writes no run report";
            Ok(Some(why.to_owned()))
        }
        (true, PROBE_RANKS) => Ok(None),
        (true, ranks) => Err(format!(
            "the mesher runs on {ranks} of {PROBE_RANKS} ranks: it was built without MPI"
        )),
    }
}
