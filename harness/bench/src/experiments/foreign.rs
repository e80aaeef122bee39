//! Runs of engines that are described by a file: timed and weighed from outside where they tell nothing.

use super::entry::{Comm, Setup};
use super::execute::{Failed, Runner, Told};
use contract::leafset;
use run::engine::memory::Scales;
use run::engine::mpi::{SharedMemory, set_environment};
use run::engine::process::Finished;
use run::engine::runner::{Engine, Ranks, Wanted};
use std::path::Path;
use std::process::Command;

/// Engines that `harness bench` knows without a description.
pub const OWN: [&str; 2] = ["mesher", "reference"];

/// What an engine is called in a record: its name, or that of its file without directories.
pub fn label(given: &str) -> String {
    let stem = Path::new(given).file_stem().map(|s| s.to_string_lossy().into_owned());
    match stem {
        Some(stem) if given.ends_with(".toml") && !OWN.contains(&stem.as_str()) => stem,
        _ => given.to_owned(),
    }
}

impl Runner<'_> {
    /// The engine that a setup is for, where that is none of our own.
    pub(super) fn foreign(&self, setup: &Setup) -> Option<&Engine> {
        let own = OWN.contains(&setup.engine.as_str());
        self.programs.engine.as_ref().filter(|_| !own)
    }

    /// Runs an engine. The mesh is written only where there is no other way to learn what it is; the time has
    /// that in it then.
    pub(super) fn told_by_engine(
        &self,
        engine: &Engine,
        setup: &Setup,
        case: &Path,
    ) -> Result<(Told, String, Finished), Failed> {
        let (json, mesh) = (self.place.join("run.json"), self.place.join("mesh"));
        let silent = engine.description().run.json.is_none();
        let out = silent.then_some(mesh.as_path());
        let wanted = Wanted { out, json: Some(&json), ..Wanted::default() };
        let command = engine.command(case, ranks(setup), &wanted);
        let mut command = command.map_err(|why| Failed::Because(why.to_string()))?;
        let shown = super::execute::shown(&command, self.place);
        let (finished, scales) = self.weighed(&mut command, setup)?;
        let told = if silent { of_mesh(&mesh) } else { Told::read(&json) };
        // The next run wants an empty place, however this one ended.
        let _ = std::fs::remove_dir_all(&mesh);
        let mut told = told.map_err(Failed::Because)?;
        told.seen(finished.time_wall_s, scales.peak_bytes());
        if setup.comm == Comm::Sim && told.phases.is_empty() {
            let why = "it tells no phases, without which simulated ranks cannot be projected";
            return Err(Failed::Because(why.to_owned()));
        }
        Ok((told, shown, finished))
    }

    fn weighed(&self, command: &mut Command, setup: &Setup) -> Result<(Finished, Scales), Failed> {
        let shared = SharedMemory::new();
        if setup.comm == Comm::Mpi {
            set_environment(command);
            shared.add_to(command);
        }
        let mut scales = Scales::new();
        let finished = self.watched(command, &[0], Some(&mut scales))?;
        Ok((finished, scales))
    }
}

fn ranks(setup: &Setup) -> Ranks {
    match setup.comm {
        Comm::Solo => Ranks::Serial,
        Comm::Sim => Ranks::Simulated { ranks: setup.ranks, seed: 1 },
        Comm::Mpi => Ranks::Mpi(setup.ranks),
    }
}

/// What a mesh's manifest tells of it.
fn of_mesh(mesh: &Path) -> Result<Told, String> {
    let manifest = leafset::read_manifest(mesh).map_err(|error| error.to_string())?;
    Ok(Told::of_mesh(manifest.leaves, manifest.digest.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::Run;
    use crate::experiments::launcher::Launcher;
    use run::engine::paths::Given;
    use run::engine::programs::Programs;
    use std::time::Duration;

    /// What a run of an engine gives that is played by a shell script.
    fn played(script: &str, json: &str, comm: Comm) -> Result<Run, String> {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("play.sh"), script).unwrap();
        let words =
            "serial = ['sh', '{program}', '{case}']\nsimulated = ['sh', '{program}', '{case}']\n";
        let text = format!(
            "about = 'x'\nprogram = '{{here}}/play.sh'\n[run]\n{words}out = ['{{out}}']\n{json}"
        );
        let file = place.path().join("played.toml");
        std::fs::write(&file, text).unwrap();
        let limit = Duration::from_secs(60);
        let programs = Programs::find(Given::default());
        let programs = programs.and_engine(file.to_str().unwrap(), limit).unwrap();
        let launcher = Launcher::parse("mpirun -n {ranks}").unwrap();
        let runner =
            Runner { programs: &programs, launcher: &launcher, limit, place: place.path() };
        let setup = crate::testing::run(comm, 1, &[("a", &[0.0, 0.0])]).setup;
        let ranks = if comm == Comm::Solo { 1 } else { 2 };
        let setup = Setup { engine: label(file.to_str().unwrap()), ranks, ..setup };
        runner.run(&setup, Path::new("case.toml"), 0, false).map_err(|why| format!("{why:?}"))
    }

    const TELLS: &str = "json = ['{json}']\n";

    #[test]
    fn what_an_engine_does_not_tell_is_seen_from_outside() {
        let script = "sleep 0.05; echo '{\"cells\": 8, \"digest\": \"ab\"}' > $2";
        let run = played(script, TELLS, Comm::Solo).unwrap();
        assert_eq!(
            (run.setup.engine.as_str(), run.cells, run.digest.as_str()),
            ("played", 8, "ab")
        );
        assert!(run.time_wall_s >= 0.05 && run.time_wall_s == run.time_launch_s);
        assert!(run.peak_rss_bytes.sum > 1e5 && run.useful_s.sum > 0.0);
        assert!(run.command.starts_with("sh play.sh case.toml"), "{}", run.command);
    }

    #[test]
    fn what_it_tells_counts() {
        let told = r#"{"cells": 8, "digest": "ab", "time_wall_s": 7.5, "peak_rss_bytes": [3, 4],
            "phases": [{"name": "all", "time_cpu_s": [2.0, 1.0]}]}"#;
        let run = played(&format!("echo '{told}' > $2"), TELLS, Comm::Sim).unwrap();
        assert_eq!((run.time_wall_s, run.peak_rss_bytes.sum), (7.5, 4.0));
        assert_eq!((run.useful_s.by_rank, run.phases[0].useful_s.max), (vec![2.0, 1.0], 2.0));
    }

    #[test]
    fn what_cannot_be_told_is_a_failure() {
        let script = "echo '{\"cells\": 8, \"digest\": \"ab\"}' > $2";
        assert!(played(script, TELLS, Comm::Sim).unwrap_err().contains("no phases"));
        assert!(played("mkdir $2", "", Comm::Solo).unwrap_err().contains("mesh.json"));
        assert!(
            played("echo no >&2; exit 3", TELLS, Comm::Solo).unwrap_err().contains("code 3: no")
        );
    }

    #[test]
    fn a_record_names_no_directories() {
        assert_eq!(label("python"), "python");
        assert_eq!(label("some/where/fast.toml"), "fast");
        // Never mistaken for one of our own.
        assert_eq!(label("some/mesher.toml"), "some/mesher.toml");
    }
}
