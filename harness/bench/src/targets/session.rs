//! Executes the runs that rows need, row by row.

use super::declare::{EXPERIMENT, Mesh, Row, RunSpec, Targets};
use super::judge::{judge, unjudged};
use super::row;
use crate::experiments::entry::{Comm, Entry, Judged, Line, Setup, Verdict};
use crate::experiments::execute::Failed;
use crate::experiments::session::{Bench, BenchError, Options, Point, temporary_directory};
use crate::experiments::sizing::Sizes;
use crate::experiments::variant::Base;
use run::engine::interrupt;
use run::engine::programs::Programs;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The result of a session.
#[derive(Debug)]
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

/// Executes the runs and judges the rows; ignores `options.studies`.
///
/// # Errors
/// If the record or a temporary directory cannot be written.
pub fn measure(
    options: &Options,
    targets: &Targets,
    overrides: &Overrides,
    programs: &Programs,
    progress: &mut dyn FnMut(&str),
) -> Result<Outcome, BenchError> {
    let place = temporary_directory()?;
    let bench = Bench::open(options, programs, place.path(), progress)?;
    let mut session = Session::new(bench, targets, overrides);
    let mut rows = Vec::new();
    let mut interrupted = false;
    for (i, row) in targets.row.iter().enumerate() {
        interrupted |= interrupt::requested();
        let judged = match interrupted {
            true => Err(BenchError::Interrupted),
            false => session.row(row),
        };
        let judged = match judged {
            Err(BenchError::Interrupted) => {
                interrupted = true;
                unjudged(row, Verdict::LeftOut, "interrupted".to_owned())
            }
            judged => judged?,
        };
        // A row that was not measured before the interruption is not a result.
        if !interrupted {
            let of = format!("row {} of {}", i + 1, targets.row.len());
            (session.bench.progress)(&format!("{of}: {}", row::line(targets, &judged)));
            session.bench.append(Entry::Target(judged.clone()))?;
        }
        rows.push(judged);
    }
    let missing = session.missing();
    Ok(Outcome { rows, lines: session.bench.lines, interrupted, missing })
}

/// Options of the command line that override the file.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// Repetitions of every run, instead of the file's.
    pub repeats: Option<usize>,
    /// No runs on MPI, as requested by the user.
    pub no_mpi: bool,
    /// The launcher is missing.
    pub no_launcher: bool,
}

/// A running session.
struct Session<'a> {
    bench: Bench<'a>,
    targets: &'a Targets,
    overrides: &'a Overrides,
    /// Geometries read so far, by their source.
    bases: BTreeMap<String, (Base, BTreeMap<u32, Sizes>)>,
    /// Meshes with a written case file, or the reason for a failure.
    meshes: BTreeMap<String, Result<Ready, String>>,
    /// Runs that are complete.
    made: BTreeSet<String>,
    /// Meshes that have been generated at least once.
    warm: BTreeSet<String>,
    /// Whether latency and bandwidth were measured.
    network: bool,
}

/// A mesh that can be generated.
#[derive(Clone, Debug)]
struct Ready {
    case: PathBuf,
    spacing_min: f64,
    layer_cells_min: u32,
}

/// A run to be repeated.
struct Pending<'a> {
    spec: &'a RunSpec,
    point: Point,
}

impl<'a> Session<'a> {
    fn new(bench: Bench<'a>, targets: &'a Targets, overrides: &'a Overrides) -> Self {
        let (made, warm) = (BTreeSet::new(), BTreeSet::new());
        let (bases, meshes) = (BTreeMap::new(), BTreeMap::new());
        Self { bench, targets, overrides, bases, meshes, made, warm, network: false }
    }

    /// Executes the runs of a row that are not complete, and judges it.
    fn row(&mut self, row: &Row) -> Result<Judged, BenchError> {
        let targets = self.targets;
        let mut pending = Vec::new();
        for name in targets.runs_of(row) {
            let spec = &targets.run[name];
            if let Some(why) = self.mpi_left_out().filter(|_| spec.comm == Comm::Mpi) {
                return Ok(unjudged(row, Verdict::LeftOut, why.to_owned()));
            }
            if self.made.insert(name.clone()) {
                match self.ready(&spec.mesh) {
                    Ok(ready) => pending.push(Pending { spec, point: point(spec, ready) }),
                    Err(Failed::Interrupted) => return Err(BenchError::Interrupted),
                    Err(Failed::Reason(why)) => {
                        self.made.remove(name);
                        return Ok(unjudged(row, Verdict::Failed, why));
                    }
                }
            }
        }
        self.make(&mut pending)?;
        Ok(judge(targets, row, &self.bench.lines))
    }

    /// Returns the reason why runs on MPI are skipped; `None` if they are not.
    fn mpi_left_out(&self) -> Option<&'static str> {
        match (self.overrides.no_mpi, self.overrides.no_launcher) {
            (true, _) => Some("--no-mpi was given"),
            (false, true) => Some("the launcher is missing"),
            _ => None,
        }
    }

    /// Executes runs. Repetitions are the outer loop, as in a session of experiments.
    fn make(&mut self, pending: &mut [Pending]) -> Result<(), BenchError> {
        let overrides = self.overrides;
        let repeats = |spec: &RunSpec| overrides.repeats.unwrap_or(spec.repeats);
        if !self.network && pending.iter().any(|p| p.spec.comm == Comm::Sim) {
            self.network = true;
            self.bench.measure_network()?;
        }
        let most = pending.iter().map(|p| repeats(p.spec)).max().unwrap_or(0);
        for p in pending.iter_mut().filter(|p| !p.spec.audit) {
            let cold = self.warm.insert(p.spec.mesh.clone());
            let warm_up = p.spec.warm_up.unwrap_or(repeats(p.spec) > 1);
            if cold && warm_up {
                self.bench.run(&mut p.point, 0, true)?;
            }
        }
        for repeat in 0..most {
            for p in pending.iter_mut() {
                let due = repeat < repeats(p.spec) && !p.point.failed;
                match p.spec.audit {
                    _ if !due => {}
                    true => self.bench.audit(&mut p.point)?,
                    false => self.bench.run(&mut p.point, repeat, false)?,
                }
            }
        }
        Ok(())
    }

    /// Returns the case file of a mesh, which is written once.
    fn ready(&mut self, name: &str) -> Result<Ready, Failed> {
        if let Some(known) = self.meshes.get(name) {
            return known.clone().map_err(Failed::Reason);
        }
        let made = self.prepare(name, &self.targets.mesh[name]);
        match &made {
            Err(Failed::Interrupted) => {}
            Ok(ready) => drop(self.meshes.insert(name.to_owned(), Ok(ready.clone()))),
            Err(Failed::Reason(why)) => {
                let why = format!("mesh {name}: {why}");
                self.meshes.insert(name.to_owned(), Err(why.clone()));
                return Err(Failed::Reason(why));
            }
        }
        made
    }

    fn prepare(&mut self, name: &str, mesh: &Mesh) -> Result<Ready, Failed> {
        let key = format!(
            "{:?} {:?} {:?} {:?}",
            mesh.case, mesh.geometry, mesh.generator, mesh.root_scale
        );
        if !self.bases.contains_key(&key) {
            (self.bench.progress)(&format!("{name}: reading the geometry"));
            let base = self.base(name, mesh).map_err(Failed::Reason)?;
            self.bases.insert(key.clone(), (base, BTreeMap::new()));
        }
        let (base, sizes) = self.bases.get_mut(&key).expect("the entry was inserted");
        let n = mesh.layer_cells_min.unwrap_or(base.layer_cells_min);
        let ready = |case: Result<PathBuf, String>, spacing_min| {
            case.map(|case| Ready { case, spacing_min, layer_cells_min: n }).map_err(Failed::Reason)
        };
        let Some(cells) = mesh.cells else {
            let spacing = mesh.spacing_min.unwrap_or(base.spacing_min);
            return ready(base.in_own_root(spacing, n), spacing);
        };
        (self.bench.progress)(&format!("{name}: looking for the spacing"));
        let bench = &mut self.bench;
        let known = sizes.entry(n).or_default();
        let spacing = known.spacing(cells, base.coarse(), |spacing| bench.count(base, spacing, n));
        match spacing {
            Ok(spacing) => ready(base.variant(spacing, n), spacing),
            Err(BenchError::Interrupted) => Err(Failed::Interrupted),
            Err(other) => Err(Failed::Reason(other.to_string())),
        }
    }

    /// Writes the geometry of a mesh as a binary STL file.
    fn base(&self, name: &str, mesh: &Mesh) -> Result<Base, String> {
        let place = self.bench.runner.place;
        if let Some(case) = &mesh.case {
            let catalogue = &self.bench.runner.programs.paths.catalogue;
            let path = catalogue.case_file(case, &self.targets.directory)?;
            return Base::read(&path, place);
        }
        let path = place.join(format!("{name}-given.toml"));
        let text = given_case(mesh, &self.targets.directory)?;
        std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        Base::read(&path, place)
    }

    /// Returns the missing prerequisite of skipped rows; `None` if the user excluded them.
    fn missing(&self) -> Option<String> {
        let needs_mpi = |row: &Row| {
            self.targets.runs_of(row).iter().any(|n| self.targets.run[*n].comm == Comm::Mpi)
        };
        let missing = self.overrides.no_launcher && !self.overrides.no_mpi;
        let missing = missing && self.targets.row.iter().any(needs_mpi);
        let program = self.bench.options.launcher.program();
        missing.then(|| format!("{} is missing: runs on MPI were left out", program.display()))
    }
}

/// Returns a case file for a geometry that was given without one.
fn given_case(mesh: &Mesh, directory: &Path) -> Result<String, String> {
    let mut table = toml::Table::new();
    if let Some(file) = &mesh.geometry {
        let path = std::path::absolute(directory.join(file)).map_err(|error| error.to_string())?;
        table.insert("geometry".into(), path.to_string_lossy().into_owned().into());
    }
    if let Some(generator) = &mesh.generator {
        table.insert("generator".into(), generator.clone().into());
    }
    for (key, value) in [("root_scale", mesh.root_scale), ("spacing_min", mesh.spacing_min)] {
        table.extend(value.map(|v| (key.to_owned(), v.into())));
    }
    Ok(table.to_string())
}

fn point(spec: &RunSpec, ready: Ready) -> Point {
    let setup = Setup {
        experiment: EXPERIMENT.to_owned(),
        engine: "mesher".to_owned(),
        case: spec.mesh.clone(),
        spacing_min: ready.spacing_min,
        layer_cells_min: ready.layer_cells_min,
        ranks: spec.ranks,
        comm: spec.comm,
        partitioner: spec.partitioner.clone(),
        weights: spec.weights.clone(),
        weight_exposed: None,
    };
    Point { setup, case: ready.case, failed: false }
}
