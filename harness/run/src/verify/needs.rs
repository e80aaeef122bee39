//! What of a verification this machine can do, tried out once at its beginning.

use super::options::{Need, Options};
use super::report::Missing;
use crate::engine::mesher::{self, Files, Layout, Record};
use crate::engine::mpi::SharedMemory;
use crate::engine::process::{self, End, Watch};
use crate::engine::programs::Programs;
use crate::oracle::{NoAnswer, ORACLES, Question};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// For each need, the reason why it is not there.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    /// MPI.
    pub mpi: Option<String>,
    /// The oracles: why none can be asked.
    pub oracles: Option<String>,
    /// Oracles that can be asked.
    pub oracles_there: Vec<&'static str>,
    /// Oracles that cannot, each with its reason.
    pub oracles_absent: Vec<String>,
    /// p4est.
    pub p4est: Option<String>,
    /// Geometries that are not there.
    geometries: Vec<String>,
}

/// A case for trying things out: eight cells around a cube.
const PROBE: &str =
    "spacing_min = 1.0\nroot_scale = 2.0\n[generator]\nshape = \"cube\"\nfacets = 12\n";
const PROBE_RANKS: usize = 2;
const PROBE_LIMIT: Duration = Duration::from_secs(60);

impl Needs {
    /// Tries what the options ask for.
    pub fn probe(options: &Options, programs: &Programs, place: &Path) -> Self {
        let mpi = match options.mpi {
            true => probe_mpi(programs, place).err(),
            false => Some("--no-mpi was given".to_owned()),
        };
        let mut needs = Self { mpi, ..Self::default() };
        needs.p4est = match (options.p4est, programs.paths.p4est.is_file()) {
            (false, _) => Some("--no-p4est was given".to_owned()),
            (true, false) => Some(format!(
                "there is no {} (ci/setup compiles it)",
                programs.paths.p4est.display()
            )),
            (true, true) => None,
        };
        match options.oracles {
            true => needs.probe_oracles(programs, place),
            false => needs.oracles = Some("--no-oracles was given".to_owned()),
        }
        needs
    }

    fn probe_oracles(&mut self, programs: &Programs, place: &Path) {
        let written = tempfile::tempdir_in(place).and_then(|probe| {
            let question = Question::write(&[[0.0; 3]], &[], probe.path())?;
            Ok((probe, question))
        });
        let (_probe, question) = match written {
            Ok(written) => written,
            Err(error) => return self.oracles = Some(error.to_string()),
        };
        for oracle in ORACLES {
            match question.ask(oracle, programs, PROBE_LIMIT) {
                Ok(_) => self.oracles_there.push(oracle),
                Err(NoAnswer::Missing(why) | NoAnswer::Failed(why)) => {
                    self.oracles_absent.push(why)
                }
                Err(NoAnswer::Interrupted) => return,
            }
        }
        if self.oracles_there.is_empty() {
            self.oracles = self.oracles_absent.first().cloned();
        }
    }

    /// Remembers that a case's geometry is not there.
    pub fn note_absent_geometry(&mut self, why: &str) {
        self.geometries.push(why.to_owned());
    }

    /// Everything that is missing, once each.
    pub fn missing(&self, options: &Options) -> Vec<Missing> {
        // One oracle that is missing is a vote that is missing.
        let oracles = self.oracles.iter().chain(&self.oracles_absent).next().cloned();
        let geometries = match self.geometries.len() {
            0 => None,
            count => Some(format!(
                "{count} geometries are not here (ci/setup --geometries fetches what may be fetched)"
            )),
        };
        let all = [
            (Need::Mpi, self.mpi.clone()),
            (Need::Oracles, oracles),
            (Need::P4est, self.p4est.clone()),
            (Need::Geometries, geometries),
        ];
        let missing = all.into_iter().filter_map(|(need, why)| {
            Some(Missing {
                what: need.to_string(),
                why: why?,
                required: options.require.contains(&need),
            })
        });
        missing.collect()
    }
}

/// Whether `mpirun` starts ranks that know of each other, which a mesher built without MPI would not.
fn probe_mpi(programs: &Programs, place: &Path) -> Result<(), String> {
    if !programs.paths.mpirun.is_file() {
        return Err("there is no mpirun on the PATH (ci/setup installs it)".to_owned());
    }
    let probe = tempfile::tempdir_in(place).map_err(|error| error.to_string())?;
    let (case, json) = (probe.path().join("probe.toml"), probe.path().join("probe.json"));
    fs::write(&case, PROBE).map_err(|error| error.to_string())?;
    let case = match &programs.engine {
        Some(engine) => engine.prepare(&case, &probe.path().join("plain"))?,
        None => case,
    };
    let files = Files { case: &case, out: None, json: Some(&json), status: None, ungraded: false };
    let layout =
        Layout { ranks: PROBE_RANKS, partitioner: "morton".into(), level_base: "auto".into() };
    let shared = SharedMemory::new();
    let mut command = mesher::parallel(programs, &files, &layout, &shared)?;
    let watch = Watch { limit: PROBE_LIMIT, logs: probe.path(), name: "mpi", status: None };
    let done = process::run(&mut command, &watch)
        .map_err(|error| format!("mpirun cannot be started: {error}"))?;
    match done.end {
        End::Exited(0) => {}
        End::TimedOut => {
            return Err(format!("mpirun did not end within {} s", PROBE_LIMIT.as_secs()));
        }
        _ => {
            return Err(format!("the mesher does not run on MPI: {}", done.first_error_line()));
        }
    }
    match Record::read(&json)?.ranks {
        PROBE_RANKS => Ok(()),
        ranks => {
            Err(format!("the mesher sees {ranks} of {PROBE_RANKS} ranks: it was built without MPI"))
        }
    }
}
