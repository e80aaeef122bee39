//! An engine: any program that meshes a case, ours included, run as its engine file describes; and the engines of a session.

use super::description::{self, Description};
use super::failure::{End, Failure, Result};
use super::layout::{Launcher, Layout, Ranks, RunOptions};
use super::paths::{Input, Paths, on_path};
use super::process::{self, Finished, Watch};
use super::report::{CLOCKS_S, RunReport};
use super::service::{self, Services};
use super::templates::{LAUNCHER, Values, fill};
use crate::import;
use clap::Args;
use contract::case::Case;
use contract::failure::{Failure as Refusal, named};
use contract::leafset::{self, LeafSet};
use contract::mesh::Mesh;
use contract::plain::PlainCase;
use std::collections::BTreeSet;
use std::fs;
use std::path::{self, Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// An engine, ready to run.
#[derive(Clone, Debug)]
pub struct Engine {
    /// The engine file.
    pub description: Description,
    /// The program.
    pub program: PathBuf,
    /// Whether the program is not the one that the engine file names.
    pub is_given: bool,
    places: Values<'static>,
    launcher: Launcher,
}

/// A completed run.
pub struct Completed {
    /// Its report; values that are missing from it were measured from outside.
    pub report: RunReport,
    /// Its process, with times from outside.
    pub finished: Finished,
    /// The command that was run.
    pub command: Command,
}

impl Engine {
    /// The engine of this name in the repository, or with this engine file. `given` overrides the program that the
    /// file names.
    ///
    /// # Errors
    /// One sentence, if the engine file is missing or wrong, or if the command writes one of the engine's files.
    pub fn find(name: &str, given: Option<&Path>, paths: &Paths) -> Result<Self, Refusal> {
        let description = Description::find(name, paths)?;
        let why = format!("{name} cannot be run: its engine file has no command `serial` in [run]");
        Refusal::unless(!description.run.serial.is_empty(), why)?;
        given.map_or(Ok(()), |_| description.run.check_other_program())?;
        let places = description.places(paths);
        let program = match given {
            // A name without a slash would be searched for on the PATH. A link may lead to a program that behaves by its own name.
            Some(given) => path::absolute(given).unwrap_or_else(|_| given.to_owned()),
            None => {
                let program = fill(&description.program, &places);
                let found = (!program.contains('/')).then(|| on_path(&program)).flatten();
                found.unwrap_or_else(|| PathBuf::from(program))
            }
        };
        let launcher = Launcher::mpirun(&paths.mpirun);
        let engine = Self { description, program, is_given: given.is_some(), places, launcher };
        for file in engine.files() {
            files::register_input(&file).map_err(|error| Refusal::at(&file, error))?;
        }
        Ok(engine)
    }

    /// The same engine with another program: another revision of it.
    ///
    /// # Errors
    /// If a command has no word for the program, or the command writes that program.
    pub fn with_program(&self, program: PathBuf) -> Result<Self, Refusal> {
        self.description.run.check_other_program()?;
        files::register_input(&program).map_err(|error| named(&program, &error))?;
        Ok(Self { program, is_given: true, ..self.clone() })
    }

    /// The files that make the engine what it is: its program and what its commands name beside it, such as a script.
    pub fn files(&self) -> BTreeSet<PathBuf> {
        let words = self.description.run.commands().into_iter().flat_map(|(_, words)| words);
        let named = words.map(|word| PathBuf::from(fill(word, &self.places)));
        named.chain([self.program.clone()]).filter(|path| path.is_file()).collect()
    }

    /// The same engine, whose ranks on MPI are started by another launcher.
    pub fn with_launcher(&self, launcher: Launcher) -> Self {
        Self { launcher, ..self.clone() }
    }

    /// The name or path by which the engine was found.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// Refuses to go on if the program is missing, or what the command starts instead, such as an interpreter.
    ///
    /// # Errors
    /// What to do about it.
    pub fn require(&self) -> Result<(), Refusal> {
        let (name, path) = (self.name(), self.program.display());
        let option = if name == "reference" { name } else { "mesher" };
        let file = format!("in the engine file {name}");
        let first = fill(&self.description.run.serial[0], &self.places);
        let why = match self.program.is_file() {
            // Also an absolute path.
            true if first.contains('{') || on_path(&first).is_some() => return Ok(()),
            true => format!("{first} was not found: install it, or correct `serial` {file}"),
            false => format!(
                "the {option} is missing: build {path}, correct `program` {file}, or give another path with --{option}"
            ),
        };
        Err(Refusal::missing(why))
    }

    /// Why no run on MPI can be started; `None` if one can.
    pub fn lacks_mpi(&self) -> Option<String> {
        let parallel = &self.description.run.parallel;
        if parallel.is_empty() {
            return Some(format!("the engine file of {} has no command `parallel`", self.label()));
        }
        let is_ours = parallel.iter().any(|word| [LAUNCHER, "{mpirun}"].contains(&word.as_str()));
        let program = self.launcher.program();
        (is_ours && !self.launcher.is_found())
            .then(|| format!("{} is not on the PATH (ci/setup installs it)", program.display()))
    }

    /// The leaf-set directory of the mesh of a run, if it writes one.
    fn mesh_path(&self, options: &RunOptions) -> Option<PathBuf> {
        let always = self.description.run.always_writes_mesh();
        options.mesh.map(Path::to_owned).or(always.then(|| options.place.join("mesh")))
    }

    /// A case file equivalent to `case` that the engine can read: `case` itself, or one with a binary STL file
    /// and an explicit root, written to `directory`.
    ///
    /// # Errors
    /// If the case cannot be read or the other one cannot be written.
    pub fn prepare(&self, case: &Path, directory: &Path) -> Result<PathBuf, Refusal> {
        if self.description.takes.generator {
            return Ok(case.to_owned());
        }
        Ok(PlainCase::of(&Case::read(case)?).write(directory)?)
    }

    /// The values of the placeholders that do not depend on a run.
    fn values(&self) -> Values<'static> {
        let program = self.program.to_string_lossy().into_owned();
        self.places.clone().into_iter().chain([("program", program)]).collect()
    }

    /// The command of a run. What it writes in a format of its own has an empty place afterwards.
    ///
    /// # Errors
    /// [`End::Missing`] if the engine file has no template for it; another end if there is no such place.
    pub fn command(&self, case: &Path, layout: &Layout, options: &RunOptions) -> Result<Command> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let mut values = self.values();
        values.insert("case", text(case));
        let templates = &self.description.run;
        let mut out = self.mesh_path(options);
        if let (Some(mesh), Some(_)) = (&out, templates.format) {
            import::clear(options.place, mesh)?;
            out = Some(import::foreign(options.place));
        }
        let out = out.as_deref().map(text);
        let words = templates.words(&self.launcher, layout, options, out, values);
        let words = words.map_err(|end| self.failure(end))?;
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]);
        Ok(command)
    }

    /// Runs the engine on a case and reads its run report.
    ///
    /// # Errors
    /// If the run fails, or its report cannot be used.
    pub fn run(&self, case: &Path, layout: &Layout, options: &RunOptions) -> Result<Completed> {
        fs::create_dir_all(options.place).map_err(|error| named(options.place, &error))?;
        let mut command = self.command(case, layout, options)?;
        let mesh = self.mesh_path(options);
        // An earlier run's files must not be mistaken for this run's.
        let _ = fs::remove_file(options.report_path());
        let finished = self.drive(&mut command, layout.ranks, options)?;
        let written = mesh.as_deref().map(|mesh| {
            import::complete(&self.description, self.label(), &command, case, mesh, options)
        });
        let written = written.transpose().map_err(|end| self.failure(end))?;
        let report = self.report(written.as_ref(), options, layout.ranks.count(), &finished);
        Ok(Completed { report: report.map_err(|why| self.unusable(why))?, finished, command })
    }

    /// Meshes a case in a directory without a run report; returns the leaf-set directory.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn mesh(
        &self,
        case: &Path,
        layout: &Layout,
        ungraded: bool,
        (place, limit): (&Path, Duration),
    ) -> Result<PathBuf> {
        let mesh = place.join("mesh");
        let plain = RunOptions { report: false, ..RunOptions::new(place, limit) };
        self.run(case, layout, &RunOptions { mesh: Some(&mesh), ungraded, ..plain })?;
        Ok(mesh)
    }

    /// The report of a run on so many ranks, of which the mesh was written, with the memory that was measured from outside, if it was, where
    /// the program reported none, or that of rank 0 alone.
    fn report(
        &self,
        written: Option<&Mesh>,
        options: &RunOptions,
        ranks: usize,
        finished: &Finished,
    ) -> Result<RunReport, String> {
        let is_written = options.report && !self.description.run.json.is_empty();
        let mut report = match written {
            // The digest is that of the mesh.
            Some(mesh) if !is_written => {
                RunReport { cells: mesh.manifest.leaves, ..RunReport::default() }
            }
            _ => RunReport::read(&options.report_path()).map_err(|e| format!("ended, but {e}"))?,
        };
        if let Some(mesh) = written {
            // Limits apply to this number, so it must be one of leaves that exist.
            if report.cells != mesh.leaf_count() {
                let (stated, found) = (report.cells, mesh.leaf_count());
                return Err(format!("states {stated} cells, and its mesh has {found}"));
            }
            let digest = mesh.manifest.digest.to_string();
            let reported = report.digest.get_or_insert_with(|| digest.clone());
            if *reported != digest {
                return Err(format!(
                    "reports digest {reported}, but its mesh has, by its manifest, digest {digest}"
                ));
            }
        }
        if let Some(reported) = report.ranks.filter(|&reported| reported != ranks) {
            return Err(format!(
                "was to run on {ranks} ranks, but reports {reported}: if on MPI, it was built without it, or for another than that of {}",
                self.launcher.program().display()
            ));
        }
        // As of milliseconds for seconds.
        let longest_s = 1.01 * finished.time_wall_s + CLOCKS_S;
        if let Some(stated) = report.time_wall_s.filter(|&time_s| time_s > longest_s) {
            let ran = finished.time_wall_s;
            return Err(format!("reports a wall time of {stated} s, and ran for {ran:.3} s"));
        }
        // As of KiB for bytes.
        let (stated, least) = (report.peak_rss_bytes_total(), 100 * ranks as u64);
        if finished.peak_rss_bytes.is_some_and(|took| (1..took / least).contains(&stated)) {
            return Err(format!("reports a peak memory of {stated} bytes, and took far more"));
        }
        // The balance of ranks is that of this counter.
        let leaves = report.counters.get("leaves").filter(|of| of.len() == ranks);
        let sum = leaves.map_or(report.cells, |of| of.iter().sum());
        if sum != report.cells {
            return Err(format!("counts {sum} leaves, but {} cells", report.cells));
        }
        let is_of_one = report.ranks.is_none() && ranks > 1 && report.peak_rss_bytes.len() == 1;
        if is_of_one || report.peak_rss_bytes.is_empty() {
            report.peak_rss_bytes = finished.peak_rss_bytes.into_iter().collect();
        }
        Ok(report)
    }

    /// Reads the mesh of a run that was to write one.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read_mesh(&self, mesh: &Path) -> Result<LeafSet> {
        let unreadable = |error| format!("wrote a mesh that cannot be read: {error}");
        leafset::read(mesh).map_err(|error| self.unusable(unreadable(error)))
    }

    fn drive(&self, command: &mut Command, ranks: Ranks, options: &RunOptions) -> Result<Finished> {
        let status = options.status_path().filter(|_| !self.description.run.status.is_empty());
        status.iter().try_for_each(fs::create_dir_all)?;
        let label = self.label();
        let watch = Watch {
            status: status.as_deref(),
            sampled: (!self.description.reports_memory)
                .then_some(if let Ranks::Mpi(count) = ranks { count } else { 1 }),
            ..Watch::new(&label, options.limit, options.place)
        };
        let Ranks::Mpi(count) = ranks else { return process::run(command, &watch) };
        if let Some((services, (name, start))) = options.services.zip(self.service(count)) {
            let words = command.get_args().map(|word| word.to_string_lossy().into_owned());
            let of_program = |word: &String| Path::new(word) != self.program;
            let words: Vec<String> = words.skip_while(of_program).skip(1).collect();
            services.start(&name, start)?;
            services.send(&name, &words);
            let time_wall_s = services.answer(&name, &watch)?;
            // The CPU time and the memory of a request are not measured.
            let (time_cpu_s, stdout) = (f64::NAN, watch.log("stdout"));
            return Ok(Finished { time_wall_s, time_cpu_s, stdout, peak_rss_bytes: None });
        }
        let _shared = self.launcher.prepare(command);
        process::run(command, &watch)
    }

    /// Starts the ranks that stay for all runs on this number of ranks, unless they run or the engine has none. What fails is found by
    /// the first run.
    pub fn start_ranks(&self, count: usize, services: &Services) {
        if let Some((name, start)) = self.service(count) {
            let _ = services.start(&name, start);
        }
    }

    /// The ranks that stay: their name, and how they are started. `None` if the engine has none.
    fn service(&self, count: usize) -> Option<(String, impl FnOnce() -> service::Start)> {
        let serve = Some(&self.description.run.serve).filter(|serve| !serve.is_empty())?;
        let start = move || {
            let (mut command, shared) = self.launcher.command(count, &self.program);
            let mut values = self.values();
            values.insert("ranks", count.to_string());
            command.args(serve.iter().map(|word| fill(word, &values)));
            (command, shared)
        };
        Some((format!("{} on {count} ranks", self.program.display()), start))
    }

    fn failure(&self, end: End) -> Failure {
        Failure::new(self.label(), end)
    }

    /// The failure of a run with exit code 0 and unusable output, as in "wrote no mesh".
    pub fn unusable(&self, why: String) -> Failure {
        self.failure(End::Unusable(why))
    }

    /// The engine's name in results.
    pub fn label(&self) -> String {
        label(self.name())
    }
}

/// An engine's name in results: without directories, unless it would then pass for one of this repository.
pub fn label(name: &str) -> String {
    let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    let passes = !description::is_own(name) && description::is_own(&stem);
    if passes { name.to_owned() } else { stem.into_owned() }
}

/// Programs that the command line names.
#[derive(Args, Clone, Debug, Default)]
pub struct Given {
    /// The program of the engine that is named, or the mesher; refused with several engines [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<Input>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<Input>,
}

/// The programs of a session.
#[derive(Clone, Debug)]
pub struct Programs {
    /// Paths of everything else.
    pub paths: Paths,
    /// The engine under test.
    pub engine: Engine,
    /// Further engines under test, in a comparison.
    pub others: Vec<Engine>,
    /// The mesher of this repository. It is the engine under test unless another one was named.
    pub mesher: Engine,
    /// The reference of this repository.
    pub reference: Engine,
}

impl Programs {
    /// Finds the programs, with the engine of this name or path under test.
    ///
    /// # Errors
    /// One sentence, if an engine file is missing or wrong.
    pub fn find(name: &str, given: &Given) -> Result<Self, Refusal> {
        let paths = Paths::find();
        let engine = Engine::find(name, given.mesher.as_deref(), &paths)?;
        let mesher = match name {
            "mesher" => engine.clone(),
            _ => Engine::find("mesher", None, &paths)?,
        };
        let reference = Engine::find("reference", given.reference.as_deref(), &paths)?;
        Ok(Self { paths, engine, others: Vec::new(), mesher, reference })
    }

    /// Refuses to go on without the program of the engine, or without the reference if the engine promises the definition: no other mesh is
    /// compared with it.
    ///
    /// # Errors
    /// If one of them is missing.
    pub fn require(&self) -> Result<(), Refusal> {
        self.engine.require()?;
        if self.engine.description.promises.definition { self.reference.require() } else { Ok(()) }
    }

    /// The engine of this name, or that is called so in results: the mesher, the reference or an engine under test.
    pub fn named(&self, name: &str) -> &Engine {
        let mut all = [&self.mesher, &self.reference].into_iter().chain(&self.others);
        all.find(|engine| engine.name() == name || engine.label() == name).unwrap_or(&self.engine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::layout::SERIAL;

    fn words(engine: &Engine, layout: &Layout, options: &RunOptions) -> String {
        let command = engine.command(Path::new("a.toml"), layout, options).unwrap();
        let program = Path::new(command.get_program()).file_name().unwrap();
        let arguments = command.get_args().map(|word| word.to_string_lossy().into_owned());
        let words = arguments.map(|word| match word.ends_with("/mesher") {
            true => "mesher".to_owned(),
            false => word,
        });
        let words: Vec<String> = words.collect();
        format!("{} {}", program.to_string_lossy(), words.join(" "))
    }

    #[test]
    fn command_lines_of_our_programs() {
        let programs = Programs::find("mesher", &Default::default()).unwrap();
        let mesher = programs.mesher.with_launcher(Launcher::parse("mpirun -n {ranks}").unwrap());
        let plain = RunOptions::new(Path::new("p"), Duration::from_secs(1));
        let files = RunOptions {
            mesh: Some(Path::new("mesh")),
            report: false,
            services: Some(&Services::default()),
            ungraded: true,
            ..plain
        };
        let serial = "mesher a.toml --comm solo --quiet --json p/run.json";
        assert_eq!(words(&mesher, &SERIAL, &plain), serial);
        let simulated = Layout {
            partitioner: Some("metis".into()),
            weights: Some("area".into()),
            ..Layout::on(Ranks::Simulated { ranks: 3, seed: 7 })
        };
        let expected = "mesher a.toml --comm sim:3:7 --quiet --json p/run.json \
                        --partitioner metis --weights area";
        assert_eq!(words(&mesher, &simulated, &plain), expected);
        let timed = RunOptions { time_alone: true, ..RunOptions::new(Path::new("p"), plain.limit) };
        let simulated_timed = Layout::on(Ranks::Simulated { ranks: 3, seed: 7 });
        let expected = "mesher a.toml --comm sim:3:7 --quiet --json p/run.json --time-alone";
        assert_eq!(words(&mesher, &simulated_timed, &timed), expected);
        let on_mpi = Layout { level_base: Some("2".into()), ..Layout::on(Ranks::Mpi(3)) };
        let expected = "mpirun -n 3 mesher a.toml --comm mpi --quiet --out mesh --status p/status \
                        --ungraded --level-base 2";
        assert_eq!(words(&mesher, &on_mpi, &files), expected);
        let reference = "reference a.toml --out mesh --ungraded";
        assert_eq!(words(&programs.reference, &on_serial(&simulated), &files), reference);
    }

    #[test]
    fn a_peak_memory_in_another_unit_is_noticed() {
        let place = tempfile::tempdir().unwrap();
        let engine = Programs::find("mesher", &Default::default()).unwrap().mesher;
        let options = RunOptions::new(place.path(), Duration::from_secs(1));
        let (time_wall_s, time_cpu_s, stdout) = (1.0, 1.0, PathBuf::new());
        let peak_rss_bytes = Some(9_000_000);
        let finished = Finished { time_wall_s, time_cpu_s, stdout, peak_rss_bytes };
        let report = |bytes: u64| {
            let text = format!(r#"{{"cells": 8, "digest": "00", "peak_rss_bytes": {bytes}}}"#);
            fs::write(options.report_path(), text).unwrap();
            engine.report(None, &options, 2, &finished)
        };
        assert!(report(9_000).unwrap_err().contains("9000 bytes, and took far more"));
        // That of rank 0 alone, and none.
        assert!(report(4_500_000).is_ok() && report(0).is_ok());
    }

    #[test]
    fn the_words_that_make_ranks_stay_are_filled_in() {
        let programs = Programs::find("mesher", &Default::default()).unwrap();
        let mut engine = programs.mesher;
        engine.description.run.serve = vec!["--serve".into(), "{program} on {ranks}".into()];
        let (_, start) = engine.service(3).unwrap();
        let (command, _) = start();
        let last = format!("{} on 3", engine.program.display());
        assert_eq!(command.get_args().last().unwrap().to_str(), Some(&*last));
    }

    /// The same choices, serially: the reference does not offer them.
    fn on_serial(layout: &Layout) -> Layout {
        Layout { ranks: Ranks::Serial, ..layout.clone() }
    }
}
