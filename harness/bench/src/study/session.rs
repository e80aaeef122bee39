//! Executes a study: its series, then the runs that its rows need, row by row.
//!
//! Repetitions are the outer loop, so that a drift of the machine affects all setups equally.

use super::file::{EXPERIMENT, Experiment, Mesh, Row, RunSpec, Series, Study};
use super::judge::{judge, unjudged};
use super::row;
use crate::experiments::entry::{Comm, Entry, Judged, Line, Setup, Verdict};
use crate::experiments::execute::{Failed, has_message_matrix};
use crate::experiments::feasible;
use crate::experiments::session::{
    Bench, BenchError, Planned, SessionOptions, temporary_directory,
};
use crate::experiments::sizing::Sizes;
use crate::experiments::variant::Base;
use contract::case::Case;
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

/// Executes the series and the runs, and judges the rows.
///
/// # Errors
/// If a series is invalid, or the record or a temporary directory cannot be written.
pub fn measure(
    options: &SessionOptions,
    record: &Path,
    study: &Study,
    programs: &Programs,
    progress: &mut dyn FnMut(&str),
) -> Result<Outcome, BenchError> {
    let place = temporary_directory()?;
    let bench = Bench::open(options, record, study.engines(), programs, place.path(), progress)?;
    let mut session = Session {
        bench,
        study,
        options,
        bases: BTreeMap::new(),
        meshes: BTreeMap::new(),
        made: BTreeSet::new(),
        warm: BTreeSet::new(),
        network: false,
    };
    let series = study.series.iter().try_for_each(|series| session.series(series));
    let mut interrupted = match series {
        Err(BenchError::Interrupted) => true,
        other => other.map(|()| false)?,
    };
    let mut rows = Vec::new();
    for (i, row) in study.row.iter().enumerate() {
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
            let of = format!("row {} of {}", i + 1, study.row.len());
            (session.bench.progress)(&format!("{of}: {}", row::line(study, &judged)));
            session.bench.append(Entry::Target(judged.clone()))?;
        }
        rows.push(judged);
    }
    let missing = session.missing();
    Ok(Outcome { rows, lines: session.bench.lines, interrupted, missing })
}

/// A running session.
struct Session<'a> {
    bench: Bench<'a>,
    study: &'a Study,
    options: &'a SessionOptions,
    /// Geometries read so far, by their source, with the known sizes of their meshes by n.
    bases: BTreeMap<String, (Base, BTreeMap<u32, Sizes>)>,
    /// Meshes with a written case file, or the reason for a failure.
    meshes: BTreeMap<String, Result<Ready, String>>,
    /// Runs that are complete.
    made: BTreeSet<String>,
    /// Programs and cases that have been run at least once.
    warm: BTreeSet<(String, PathBuf)>,
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

impl Session<'_> {
    /// Runs a series: every size by all programs in turn.
    fn series(&mut self, series: &Series) -> Result<(), BenchError> {
        let no_mpi = self.mpi_left_out().is_some();
        let mesh = Mesh { case: Some(series.case.clone()), ..Mesh::default() };
        let input = |failed| match failed {
            Failed::Interrupted => BenchError::Interrupted,
            Failed::Reason(why) => BenchError::Input(format!("{}: {why}", series.case)),
        };
        let (experiment, key) = (series.experiment, self.base(&series.case, &mesh).map_err(input)?);
        let base = self.bases[&key].0.clone();
        let layers = if series.layers.is_empty() {
            vec![base.layer_cells_min]
        } else {
            series.layers.clone()
        };
        for cells in series.sizes() {
            let mut points = Vec::new();
            for engine in &series.engines {
                let description = self.bench.runner.programs.labelled(engine).description().clone();
                let layouts = series.layouts(&description, no_mpi);
                if layouts.is_empty() {
                    (self.bench.progress)(&format!("{engine} cannot run the series {experiment}"));
                }
                for (&n, &(comm, ranks)) in
                    layers.iter().flat_map(|n| layouts.iter().map(move |l| (n, l)))
                {
                    for spacing in self.spacings(&key, experiment, cells, ranks).map_err(input)? {
                        let case = base.variant(spacing, n).map_err(BenchError::Input)?;
                        let setup = Setup {
                            experiment: experiment.to_string(),
                            engine: engine.clone(),
                            ranks,
                            comm,
                            ..Setup::serial(&base.name, spacing, n)
                        };
                        let read = Case::read(&case)
                            .map_err(|error| BenchError::Input(error.to_string()))?;
                        if let Some(why) = description.declines(&read) {
                            self.bench.leave_out(setup, why)?;
                            continue;
                        }
                        let choices = series.choices().iter();
                        points.extend(choices.map(|&(weights, partitioner, weight_exposed)| {
                            Planned {
                                setup: Setup {
                                    weights: weights.to_owned(),
                                    partitioner: partitioner.to_owned(),
                                    weight_exposed,
                                    ..setup.clone()
                                },
                                case: case.clone(),
                                repeats: self.options.repeats(series.repeats),
                                warm_up: true,
                                audit: false,
                                failed: false,
                            }
                        }));
                    }
                }
            }
            self.make(&mut points)?;
        }
        Ok(())
    }

    /// Returns the spacings of the meshes of a series for a number of ranks.
    fn spacings(
        &mut self,
        key: &str,
        experiment: Experiment,
        cells: Option<f64>,
        ranks: usize,
    ) -> Result<Vec<f64>, Failed> {
        let base = &self.bases[key].0;
        let (Some(cells), n) = (cells, base.layer_cells_min) else {
            return Ok(vec![base.spacing_min]);
        };
        let target = if experiment == Experiment::Weak { cells * ranks as f64 } else { cells };
        let finest = self.spacing(key, n, target)?;
        if experiment != Experiment::Spacing {
            return Ok(vec![finest]);
        }
        // Coarser by factors of two, while there are enough cells to measure.
        let halvings = (target / 1e5).log(4.0).max(0.0) as i32;
        Ok((0..=halvings).rev().map(|k| finest * 2f64.powi(k)).collect())
    }

    /// Returns the spacing that gives about this number of cells.
    fn spacing(&mut self, key: &str, n: u32, cells: f64) -> Result<f64, Failed> {
        let (base, sizes) = self.bases.get_mut(key).expect("the geometry was read");
        let runner = &self.bench.runner;
        sizes.entry(n).or_default().spacing(cells, base.coarse(), |s| runner.count(base, s, n))
    }

    /// Executes the runs of a row that are not complete, and judges it.
    fn row(&mut self, row: &Row) -> Result<Judged, BenchError> {
        let study = self.study;
        let mut points = Vec::new();
        for name in study.runs_of(row) {
            let spec = &study.run[name];
            if let Some(why) = self.mpi_left_out().filter(|_| spec.comm == Comm::Mpi) {
                return Ok(unjudged(row, Verdict::LeftOut, why.to_owned()));
            }
            if self.made.insert(name.clone()) {
                match self.ready(&spec.mesh) {
                    Ok(ready) => points.push(self.point(spec, ready)),
                    Err(Failed::Interrupted) => return Err(BenchError::Interrupted),
                    Err(Failed::Reason(why)) => {
                        self.made.remove(name);
                        return Ok(unjudged(row, Verdict::Failed, why));
                    }
                }
            }
        }
        self.make(&mut points)?;
        Ok(judge(study, row, &self.bench.lines))
    }

    fn point(&self, spec: &RunSpec, ready: Ready) -> Planned {
        let repeats = self.options.repeats(spec.repeats);
        let setup = Setup {
            experiment: EXPERIMENT.to_owned(),
            ranks: spec.ranks,
            comm: spec.comm,
            partitioner: spec.partitioner.clone(),
            weights: spec.weights.clone(),
            ..Setup::serial(&spec.mesh, ready.spacing_min, ready.layer_cells_min)
        };
        let warm_up = !spec.audit && spec.warm_up.unwrap_or(repeats > 1);
        Planned { setup, case: ready.case, repeats, warm_up, audit: spec.audit, failed: false }
    }

    /// Returns the reason why runs on MPI are skipped; `None` if they are not.
    fn mpi_left_out(&self) -> Option<&'static str> {
        match self.options.no_mpi {
            true => Some("--no-mpi was given"),
            false => (!self.options.launcher.is_found()).then_some("the launcher is missing"),
        }
    }

    /// Executes runs, each mesh of every program after an uncounted one that fills the file cache. A program that would exceed
    /// the time or the memory is not run on that mesh.
    fn make(&mut self, points: &mut [Planned]) -> Result<(), BenchError> {
        if !self.network && points.iter().any(|p| p.setup.comm == Comm::Sim) {
            self.network = true;
            self.bench.measure_network()?;
        }
        for index in warmers(points) {
            let point = &points[index];
            let mesh = (point.setup.engine.clone(), point.case.clone());
            if !self.warm.insert(mesh.clone()) {
                continue;
            }
            let setup = point.setup.clone();
            match feasible::excess(&self.bench.lines, &setup, self.bench.runner.limit) {
                None => self.bench.run(&mut points[index], 0, true)?,
                Some(why) => {
                    points.iter_mut().filter(|p| p.mesh() == mesh).for_each(|p| p.failed = true);
                    self.bench.leave_out(setup, why)?;
                }
            }
        }
        for repeat in 0..points.iter().map(|p| p.repeats).max().unwrap_or(0) {
            for point in points.iter_mut().filter(|p| repeat < p.repeats) {
                match point.audit {
                    _ if point.failed => {}
                    true => self.bench.audit(point)?,
                    false => self.bench.run(point, repeat, false)?,
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
        let made = match self.prepare(name) {
            Err(Failed::Interrupted) => return Err(Failed::Interrupted),
            Err(Failed::Reason(why)) => Err(format!("mesh {name}: {why}")),
            Ok(ready) => Ok(ready),
        };
        self.meshes.insert(name.to_owned(), made.clone());
        made.map_err(Failed::Reason)
    }

    fn prepare(&mut self, name: &str) -> Result<Ready, Failed> {
        let mesh = &self.study.mesh[name];
        let key = self.base(name, mesh)?;
        let base = self.bases[&key].0.clone();
        let n = mesh.layer_cells_min.unwrap_or(base.layer_cells_min);
        let (case, spacing_min) = match mesh.cells {
            None => {
                let spacing = mesh.spacing_min.unwrap_or(base.spacing_min);
                (base.in_own_root(spacing, n), spacing)
            }
            Some(cells) => {
                (self.bench.progress)(&format!("{name}: looking for the spacing"));
                let spacing = self.spacing(&key, n, cells)?;
                (base.variant(spacing, n), spacing)
            }
        };
        Ok(Ready { case: case.map_err(Failed::Reason)?, spacing_min, layer_cells_min: n })
    }

    /// Writes the geometry of a mesh as a binary STL file, once; returns its key.
    fn base(&mut self, name: &str, mesh: &Mesh) -> Result<String, Failed> {
        let Mesh { case, geometry, generator, root_scale, .. } = mesh;
        let key = format!("{case:?} {geometry:?} {generator:?} {root_scale:?}");
        if self.bases.contains_key(&key) {
            return Ok(key);
        }
        (self.bench.progress)(&format!("{name}: reading the geometry"));
        let place = self.bench.runner.place;
        let path = match case {
            Some(case) => {
                let catalogue = &self.bench.runner.programs.paths.catalogue;
                catalogue.case_file(case, &self.study.directory).map_err(Failed::Reason)?
            }
            None => {
                let path = place.join(format!("{name}-given.toml"));
                let text = given_case(mesh, &self.study.directory).map_err(Failed::Reason)?;
                let wrong = |error| Failed::Reason(format!("{}: {error}", path.display()));
                std::fs::write(&path, text).map_err(wrong)?;
                path
            }
        };
        let base = Base::read(&path, place).map_err(Failed::Reason)?;
        self.bases.insert(key.clone(), (base, BTreeMap::new()));
        Ok(key)
    }

    /// Returns the missing prerequisite of skipped rows; `None` if the user excluded them.
    fn missing(&self) -> Option<String> {
        let needs_mpi = |row: &Row| {
            self.study.runs_of(row).iter().any(|n| self.study.run[*n].comm == Comm::Mpi)
        };
        let missing = !self.options.no_mpi && !self.options.launcher.is_found();
        let missing = missing && self.study.row.iter().any(needs_mpi);
        let program = self.options.launcher.program();
        missing.then(|| format!("{} is missing: runs on MPI were left out", program.display()))
    }
}

/// Returns, for every mesh of every engine, the index of the point that warms it up: the one on the most ranks that reports
/// a message matrix, otherwise the first.
fn warmers(points: &[Planned]) -> Vec<usize> {
    let worth = |point: &Planned| match has_message_matrix(&point.setup) {
        true => point.setup.ranks,
        false => 0,
    };
    let mut best: Vec<usize> = Vec::new();
    for (index, point) in points.iter().enumerate().filter(|(_, point)| point.warm_up) {
        match best.iter_mut().find(|b| points[**b].mesh() == point.mesh()) {
            Some(chosen) if worth(point) > worth(&points[*chosen]) => *chosen = index,
            Some(_) => {}
            None => best.push(index),
        }
    }
    best
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

#[cfg(test)]
mod tests {
    use super::*;

    fn point(comm: Comm, ranks: usize, case: &str) -> Planned {
        let setup = crate::testing::run(comm, 1, &[("a", &vec![0.0; ranks])]).setup;
        Planned { setup, case: case.into(), repeats: 1, warm_up: true, audit: false, failed: false }
    }

    #[test]
    fn a_mesh_is_warmed_up_once_on_the_layout_with_a_message_matrix() {
        let points = [
            point(Comm::Sim, 1, "a"),
            point(Comm::Sim, 64, "a"),
            point(Comm::Sim, 16, "a"),
            point(Comm::Sim, 1024, "a"),
            point(Comm::Mpi, 2, "b"),
            point(Comm::Mpi, 4, "b"),
        ];
        assert_eq!(warmers(&points), [1, 4]);
        let mut weak = points;
        weak.iter_mut().for_each(|p| p.setup.experiment = "weak".into());
        assert_eq!(warmers(&weak), [0, 4]);
        weak[2].setup.engine = "another".into();
        assert_eq!(warmers(&weak), [0, 2, 4]);
        weak[4].warm_up = false;
        assert_eq!(warmers(&weak), [0, 2, 5]);
    }
}
