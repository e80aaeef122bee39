//! Executes a study: its series, then the runs that its rows need, row by row. Every result is appended to the record at once.
//!
//! Repetitions are the outer loop, so that a drift of the machine affects all setups equally. Equal meshes have equal digests: the time of
//! a wrong mesh is not a result.

use super::file::{Experiment, Row, Series, Study};
use super::judge::{Judged, judge, unjudged};
use crate::experiments::cases::{self, Base, Sizes};
use crate::experiments::entry::{
    ASSUMED, Comm, Entry, Line, Network, NoResult, Run, Session as Opening, Setup, TARGETS, now_utc,
};
use crate::experiments::execute::{Runner, excess};
use crate::experiments::group::{Meshes, another_mesh};
use crate::experiments::{machine, network};
use crate::jsonl;
use check::promises::Independence;
use clap::Args;
use contract::case::Case;
use contract::failure::{Failure, Result, uninterrupted};
use run::engine::interrupt;
use run::engine::layout::{Launcher, node_count};
use run::engine::runner::Programs;
use run::verify::options::whole_seconds;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The options of a session, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct SessionOptions {
    /// No runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Repetitions of every run; 95 % intervals of a median need six
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub repeat: Option<u16>,
    /// Command that starts ranks; {ranks} is replaced by their number
    #[arg(long, default_value = "mpirun -n {ranks}", value_parser = Launcher::parse)]
    pub launcher: Launcher,
    /// Latency and bandwidth of messages in the projection [default: measured by a ping-pong]
    #[arg(long, value_name = "SECONDS,BYTES/S", value_parser = network::given)]
    pub network: Option<Network>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value = "1800", value_parser = whole_seconds)]
    pub timeout: Duration,
    /// What the harness prints as its version.
    #[arg(skip)]
    pub version: &'static str,
}

/// Why a row on MPI is left out on request.
pub const NO_MPI: &str = "--no-mpi was given";
/// Why a row on MPI is left out without a launcher.
const NO_LAUNCHER: &str = "the launcher is missing";

/// A run to be repeated.
struct Planned {
    setup: Setup,
    case: PathBuf,
    /// [`Base::inputs`] of the case from which it is derived.
    inputs: String,
    /// Facets of its geometry.
    facets: u64,
    repeats: usize,
    /// Whether an uncounted run of its mesh comes first.
    warm_up: bool,
    /// Whether a run failed.
    failed: bool,
}

impl Planned {
    /// The program and the case.
    fn mesh(&self) -> (String, PathBuf) {
        (self.setup.engine.clone(), self.case.clone())
    }
}

/// The result of a session.
pub struct Outcome {
    /// The rows, in the order of the file.
    pub rows: Vec<Judged>,
    /// The lines of the session in the record.
    pub lines: Vec<Line>,
    /// Whether the user interrupted it.
    pub interrupted: bool,
    /// The missing prerequisite, if any.
    pub missing: Option<String>,
}

/// Executes the series and the runs, and judges the rows.
///
/// # Errors
/// If a series is invalid, or the record or a temporary directory cannot be written.
pub fn measure(
    options: &SessionOptions,
    record: &Path,
    study: &Study,
    programs: &Programs,
    progress: &dyn Fn(&str),
) -> Result<Outcome> {
    let place = tempfile::Builder::new().prefix("harness-bench-").tempdir()?;
    let (launcher, limit) = (&options.launcher, options.timeout);
    let mut session = Session {
        study,
        options,
        runner: Runner { programs, launcher, limit, place: place.path() },
        progress,
        name: format!("{}-{}-{}", now_utc(), machine::nodes(), std::process::id()),
        record,
        lines: Vec::new(),
        bases: BTreeMap::new(),
        sizes: BTreeMap::new(),
        meshes: Meshes::new(),
        made: BTreeSet::new(),
        warm: BTreeSet::new(),
    };
    let mut rows = Vec::new();
    let interrupted = match session.all(&mut rows) {
        Err(failure) if failure.is_interrupt() => true,
        done => done.map(|()| false)?,
    };
    // A row that was not measured before the interruption is not a result.
    let rest = study.row[rows.len()..].iter();
    rows.extend(rest.map(|row| unjudged(row, false, "interrupted".to_owned())));
    let in_rows = study.row.iter().flat_map(Row::runs).any(|run| study.run[run].comm == Comm::Mpi);
    let is_mpi = |(of, _): &(Setup, usize)| of.comm == Comm::Mpi;
    let asks = in_rows || study.series.iter().any(|series| !series.mpi.is_empty());
    let has_mpi = study.repeated.as_ref().map_or(asks, |runs| runs.iter().any(is_mpi));
    let is_missing = has_mpi && session.mpi_left_out() == Some(NO_LAUNCHER);
    let why = format!("{} is missing: runs on MPI were left out", launcher.program().display());
    Ok(Outcome { rows, lines: session.lines, interrupted, missing: is_missing.then_some(why) })
}

/// A running session.
struct Session<'a> {
    study: &'a Study,
    options: &'a SessionOptions,
    runner: Runner<'a>,
    progress: &'a dyn Fn(&str),
    /// Its identifier in the record.
    name: String,
    record: &'a Path,
    lines: Vec<Line>,
    /// Geometries read so far, by case, facets per rank and ranks.
    bases: BTreeMap<(String, Option<[usize; 2]>), Base>,
    /// The known sizes of meshes, by geometry and n.
    sizes: BTreeMap<(String, u32), Sizes>,
    /// What is known of the meshes.
    meshes: Meshes,
    /// Runs that are complete.
    made: BTreeSet<String>,
    /// Programs and cases that have been run at least once; and numbers of ranks, where the mesh may depend on it.
    warm: BTreeSet<((String, PathBuf), Option<usize>)>,
}

impl Session<'_> {
    /// Executes the series and the rows, which are added as soon as they are judged.
    fn all(&mut self, rows: &mut Vec<Judged>) -> Result<()> {
        self.open()?;
        let study = self.study;
        if let Some(runs) = &study.repeated {
            return self.repeat(runs);
        }
        // A case that cannot be read ends the session before its first run.
        study.series.iter().try_for_each(|series| self.base(&series.case, None).map(drop))?;
        for (series, cells) in study.series.iter().flat_map(Series::sizes) {
            let points = self.of_series(series, cells)?;
            self.make(points)?;
        }
        for (row, number) in study.row.iter().zip(1..) {
            uninterrupted()?;
            let judged = self.row(row)?;
            let [name, target, value, how, verdict] = judged.fields();
            let line = format!("{name}: {value} ({how}), target {target}: {verdict}");
            (self.progress)(&format!("row {number} of {}: {line}", study.row.len()));
            rows.push(judged);
        }
        Ok(())
    }

    /// Repeats the runs of an archive, each so often, at their spacings: a search would begin with other meshes and might end elsewhere.
    fn repeat(&mut self, runs: &[(Setup, usize)]) -> Result<()> {
        let (study, engines) = (self.study, self.study.engines());
        let no_mpi = self.mpi_left_out().is_some();
        let is_here = |s: &Setup| engines.contains(&s.engine) && !(no_mpi && s.comm == Comm::Mpi);
        let series = |of: &(Setup, usize)| (of.0.experiment.clone(), of.0.case.clone());
        for runs in runs.chunk_by(|a, b| series(a) == series(b)) {
            let here = runs.iter().filter(|(of, _)| is_here(of) && study.source(of).is_some());
            let points = here.map(|(of, repeats)| self.planned(of.clone(), *repeats));
            let points = points.collect::<Result<_>>()?;
            self.make(points)?;
        }
        Ok(())
    }

    /// Records the circumstances.
    fn open(&mut self) -> Result<()> {
        let Runner { programs, launcher, .. } = self.runner;
        let (root, version) = (&programs.paths.root, self.options.version);
        let lacks = |name: String| (name.clone(), programs.named(&name).description.lacks());
        let opening = Opening {
            command: std::env::args().collect(),
            machine: machine::describe(&launcher.program(), root, version),
            nodes: machine::nodes(),
            load_average: machine::load_average(),
            lacks: self.study.engines().into_iter().map(lacks).collect(),
        };
        self.append(Entry::Session(Box::new(opening)))?;
        self.options.network.map_or(Ok(()), |given| self.append(Entry::Network(given)))
    }

    fn append(&mut self, entry: Entry) -> Result<()> {
        let line = Line::new(&self.name, entry);
        let appended = jsonl::append(self.record, &line);
        self.lines.push(line);
        appended.map_err(|error| Failure::at(self.record, error))
    }

    /// Returns the reason why runs on MPI are skipped; `None` if they are not.
    fn mpi_left_out(&self) -> Option<&'static str> {
        let SessionOptions { no_mpi, launcher, .. } = self.options;
        if *no_mpi { Some(NO_MPI) } else { (!launcher.is_found()).then_some(NO_LAUNCHER) }
    }

    /// Plans the runs of a series at one size.
    fn of_series(&mut self, series: &Series, cells: Option<f64>) -> Result<Vec<Planned>> {
        let base = self.base(&series.case, None)?;
        let (n, mut points) = (base.layer_cells_min, Vec::new());
        for engine in &crate::order::distinct(series.engines.clone()) {
            let description = &self.runner.programs.named(engine).description;
            let layouts = series.layouts(description, self.mpi_left_out().is_some());
            if layouts.is_empty() {
                let is_able = !series.layouts(description, false).is_empty();
                let why = self.mpi_left_out().filter(|_| is_able);
                let why = why.unwrap_or("its engine file does not offer them");
                let serial = series.setups(engine, None, n, &[(Comm::Solo, 1)]).remove(0);
                let setup = Setup { spacing_min: base.spacing_min, ..serial };
                let why = format!("{engine} cannot run the series {}: {why}", setup.experiment);
                (self.progress)(&why);
                self.append(Entry::LeftOut(NoResult { setup, why }))?;
            }
            for setup in series.setups(engine, cells, n, &layouts) {
                let base = self.base(&series.case, series.facets.map(|of| [of, setup.ranks]))?;
                let parts = if series.experiment == Experiment::Weak { setup.ranks } else { 1 };
                let finest = cells.map(|cells| self.spacing(&base, n, cells * parts as f64));
                let finest = match finest.transpose() {
                    Ok(finest) => finest.unwrap_or(base.spacing_min),
                    // The search would fail for the other setups, too.
                    Err(failure) => {
                        let (of, why) = (cells.unwrap_or(0.0), &failure.why);
                        let why = format!("no spacing is known for {of:.1e} cells: {why}");
                        let setup = Setup { spacing_min: base.spacing_min, ..setup };
                        return self.failed(setup, Failure { why, ..failure }).map(|()| points);
                    }
                };
                let setup = Setup { spacing_min: finest * setup.spacing_min, ..setup };
                points.push(self.planned(setup, series.repeats)?);
            }
        }
        Ok(points)
    }

    /// Returns the spacing that gives about this number of cells; meshes on one rank are counted for it.
    fn spacing(&mut self, base: &Base, n: u32, cells: f64) -> Result<f64> {
        let sizes = self.sizes.entry((base.stem.clone(), n)).or_default();
        cases::spacing(sizes, cells, base.coarse(), |spacing| {
            let setup = Setup::serial(&base.name, spacing, n);
            self.runner.run(&setup, &base.write(spacing, n, false)?, None).map(|run| run.cells)
        })
    }

    /// Plans the run of this name; appends a failure if no spacing is found for it.
    fn of_run(&mut self, name: &str) -> Result<Option<Planned>> {
        let spec = &self.study.run[name];
        let mesh = &self.study.mesh[&spec.mesh];
        let base = self.base(&mesh.case, None)?;
        let n = mesh.layer_cells_min.unwrap_or(base.layer_cells_min);
        let spacing = match mesh.cells {
            None => mesh.spacing_min.unwrap_or(base.spacing_min),
            Some(cells) => {
                (self.progress)(&format!("{}: looking for the spacing", spec.mesh));
                match self.spacing(&base, n, cells) {
                    Ok(spacing) => spacing,
                    Err(failure) => {
                        let why =
                            format!("no spacing is known for {cells:.1e} cells: {}", failure.why);
                        let setup = spec.setup(base.spacing_min, n);
                        return self.failed(setup, Failure { why, ..failure }).map(|()| None);
                    }
                }
            }
        };
        self.planned(spec.setup(spacing, n), spec.repeats).map(Some)
    }

    /// Plans a run of the study, and writes its case.
    fn planned(&mut self, setup: Setup, repeats: usize) -> Result<Planned> {
        let (case, facets, in_own_root) = self.study.source(&setup).expect("it is of the study");
        let inputs = self.base(case, None)?.inputs;
        let base = self.base(case, facets.map(|of| [of, setup.ranks]))?;
        let case = base.write(setup.spacing_min, setup.layer_cells_min, in_own_root)?;
        let repeats = self.options.repeat.map_or(repeats, usize::from);
        let warm_up = setup.experiment != TARGETS || repeats > 1;
        Ok(Planned { setup, case, inputs, facets: base.facets, repeats, warm_up, failed: false })
    }

    /// Returns a case, with facets for each of some ranks if they are given; writes its geometry as a binary STL file, once.
    fn base(&mut self, case: &str, per_rank: Option<[usize; 2]>) -> Result<Base> {
        let key = (case.to_owned(), per_rank);
        if let Some(known) = self.bases.get(&key) {
            return Ok(known.clone());
        }
        (self.progress)(&format!("{case}: reading the geometry"));
        let path = self.runner.programs.paths.catalogue.case_file(case, &self.study.directory)?;
        let base = Base::read(&path, per_rank, self.runner.place)?;
        self.bases.insert(key, base.clone());
        Ok(base)
    }

    /// Executes the runs of a row that are not complete, and judges it.
    fn row(&mut self, row: &Row) -> Result<Judged> {
        let (study, mut points) = (self.study, Vec::new());
        for name in row.runs() {
            if let Some(why) = self.mpi_left_out().filter(|_| study.run[name].comm == Comm::Mpi) {
                return Ok(unjudged(row, false, why.to_owned()));
            }
            if self.made.contains(name) {
                continue;
            }
            match self.of_run(name) {
                Ok(point) => points.extend(point),
                Err(failure) if failure.is_interrupt() => return Err(failure),
                Err(Failure { why, .. }) => {
                    let why = format!("mesh {}: {why}", study.run[name].mesh);
                    return Ok(unjudged(row, true, why));
                }
            }
        }
        self.make(points)?;
        self.made.extend(row.runs().cloned());
        Ok(judge(study, row, &self.lines))
    }

    /// Executes runs, each mesh of every program after an uncounted one that fills the file cache. A program that declines
    /// a mesh, or would exceed the time or the memory, is not run on it.
    fn make(&mut self, mut points: Vec<Planned>) -> Result<()> {
        let is_known = self.lines.iter().any(|line| line.network().is_some());
        if points.iter().any(|p| p.setup.comm == Comm::Sim) && !is_known {
            self.measure_network()?;
        }
        for index in 0..points.len() {
            let (mesh, setup) = (points[index].mesh(), points[index].setup.clone());
            if !points[index].warm_up || points[index].failed {
                continue;
            }
            let engine = &self.runner.programs.named(&setup.engine).description;
            let declined = engine.declines(&Case::read(&mesh.1)?);
            let (is_declined, layout) = (declined.is_some(), (setup.ranks, setup.comm));
            let is_one_mesh = engine.promises.is_independent_of(Independence::Ranks);
            let warm = (mesh.clone(), (!is_one_mesh).then_some(setup.ranks));
            let most = (self.runner.limit, node_count());
            match declined.or_else(|| excess(&self.lines, &setup, most)) {
                Some(why) => {
                    // What takes too long on one rank may not on two.
                    let is_left = |p: &&mut Planned| {
                        p.mesh() == mesh && (is_declined || (p.setup.ranks, p.setup.comm) == layout)
                    };
                    points.iter_mut().filter(is_left).for_each(|p| p.failed = true);
                    (self.progress)(&format!("left out, spacing {:.3e}: {why}", setup.spacing_min));
                    self.append(Entry::LeftOut(NoResult { setup, why }))?;
                }
                None if !self.warm.contains(&warm) => {
                    self.run(&mut points[index], None)?;
                    // If it failed, the mesh of the next run is checked, too.
                    self.warm.extend((!points[index].failed).then_some(warm));
                }
                None => {}
            }
        }
        for repeat in 0..points.iter().map(|p| p.repeats).max().unwrap_or(0) {
            for point in points.iter_mut().filter(|p| repeat < p.repeats && !p.failed) {
                self.run(point, Some(repeat))?;
            }
        }
        Ok(())
    }

    /// Records the cost of messages, on which all projections depend.
    fn measure_network(&mut self) -> Result<()> {
        let left_out = self.mpi_left_out().map(|why| Err(why.to_owned()));
        let network = match left_out.unwrap_or_else(|| network::measured(&self.runner)) {
            Ok(network) => network,
            Err(_) if interrupt::requested() => return Err(Failure::interrupted()),
            Err(why) => {
                (self.progress)(&format!("latency 2 us and bandwidth 10 GB/s are assumed: {why}"));
                ASSUMED
            }
        };
        self.append(Entry::Network(network))
    }

    /// Runs a point and records the result.
    fn run(&mut self, point: &mut Planned, repeat: Option<usize>) -> Result<()> {
        let s = &point.setup;
        let which = repeat.map_or("warm-up".to_owned(), |number| format!("repeat {}", number + 1));
        (self.progress)(&format!("{s}, {which}"));
        let run = self.runner.run(s, &point.case, repeat);
        match run.and_then(|run| self.check_mesh(point, &run).map(|()| run)) {
            Ok(run) => {
                self.append(Entry::Run(Box::new(Run { inputs: point.inputs.clone(), ..run })))
            }
            Err(failure) => {
                point.failed = true;
                self.failed(point.setup.clone(), failure)
            }
        }
    }

    /// Records that a setup has no result, unless the user interrupted it.
    fn failed(&mut self, setup: Setup, failure: Failure) -> Result<()> {
        if failure.is_interrupt() {
            return Err(failure);
        }
        (self.progress)(&format!("failed: {}", failure.why));
        self.append(Entry::Failure(NoResult { setup, why: failure.why }))
    }

    /// Requires runs that must have the same mesh to report the same: the time of a wrong mesh is not a result. The mesh of an
    /// engine that promises the definition must be that of the mesher, which is made once for each mesh.
    fn check_mesh(&mut self, point: &Planned, run: &Run) -> Result<()> {
        Failure::unless(run.cells > 0, "the mesh has no cells")?;
        let why = format!("it reports {} facets, and the case has {}", run.facets, point.facets);
        Failure::unless([0, point.facets].contains(&run.facets), why)?;
        let engine = self.runner.programs.named(&point.setup.engine);
        let (promises, s) = (&engine.description.promises, &run.setup);
        if run.warm_up && engine.name() != "mesher" && promises.definition {
            let setup = Setup::serial(&s.case, s.spacing_min, s.layer_cells_min);
            let expected = self.runner.run(&setup, &point.case, None).map_err(|failure| {
                let why = "the mesh was not compared with that of the definition, because the mesher failed";
                Failure { why: format!("{why}: {}", failure.why), ..failure }
            })?;
            let (here, there) = (&run.digest, &expected.digest);
            let why = format!("the mesh has digest {here}, but that of the definition has {there}");
            Failure::unless(here == there, why)?;
        }
        let lacks = self.lines.iter().find_map(Line::session).map(|opening| opening.lacks.clone());
        let other = another_mesh(run, &lacks.unwrap_or_default(), &mut self.meshes);
        other.map_or(Ok(()), |why| Err(Failure::input(why)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::engine::runner::Given;

    const CUBE: &str =
        "spacing_min = 0.5\nroot_scale = 2.0\n[generator]\nshape = 'cube'\nfacets = 12\n";

    /// The lines of a study of a cube, with an engine that takes one facet and a mesher that fails.
    fn lines_of(series: &str) -> Vec<Line> {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let put = |name: &str, text: &str| std::fs::write(at(name), text).unwrap();
        put("cube.toml", CUBE);
        let run =
            "[run]\nserial = ['{program}', '{case}']\nout = ['{out}']\n[limits]\nfacets_max = 1\n";
        put("few.toml", &format!("about = 'x'\nprogram = '{{here}}/none'\n{run}"));
        put("study.toml", series);
        let study = Study::read(&at("study.toml")).unwrap();
        let engine = at("few.toml").display().to_string();
        let mut programs = Programs::find(&engine, &Given::default()).unwrap();
        programs.mesher = programs.mesher.with_program("/bin/false".into()).unwrap();
        let launcher = Launcher::parse("mpirun -n {ranks}").unwrap();
        let (no_mpi, repeat, network) = (true, None, None);
        let timeout = Duration::from_secs(60);
        let options = SessionOptions { no_mpi, repeat, launcher, network, timeout, version: "" };
        let record = at("record.jsonl");
        measure(&options, &record, &study, &programs, &|_| ()).unwrap().lines
    }

    /// A mesh of the first series is known in the second, and is declined again.
    #[test]
    fn a_mesh_that_a_program_declines_is_left_out_of_every_series() {
        let series =
            "[[series]]\nexperiment = 'strong'\ncase = 'cube.toml'\nengines = ['few', 'few']\n";
        let lines = lines_of(&format!("{series}{series}repeats = 2\n"));
        let is_left_out = |line: &Line| match &line.entry {
            Entry::LeftOut(left) => left.why.contains("facets_max"),
            _ => false,
        };
        let kinds: Vec<bool> = lines.iter().map(is_left_out).collect();
        assert_eq!(kinds, [false, true, true], "a session, and each series: {lines:?}");
    }

    #[test]
    fn a_search_for_a_spacing_that_fails_is_a_failure_of_its_series_only() {
        let series = "[[series]]\nexperiment = 'strong'\ncase = 'cube.toml'\nengines = ['few']\n";
        let lines = lines_of(&format!("{series}cells = [1e3, 1e4]\n{series}"));
        let kinds: Vec<&str> = lines
            .iter()
            .map(|line| match &line.entry {
                Entry::Session(_) => "session",
                Entry::Failure(of) if of.why.starts_with("no spacing is known") => "no spacing",
                Entry::LeftOut(_) => "left out",
                _ => "other",
            })
            .collect();
        assert_eq!(kinds, ["session", "no spacing", "no spacing", "left out"], "{lines:?}");
    }
}
