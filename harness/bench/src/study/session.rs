//! Executes a study: its series, then the runs that its rows need, row by row.
//!
//! Repetitions are the outer loop, so that a drift of the machine affects all setups equally.

use super::file::{EXPERIMENT, Experiment, Mesh, Row, Series, Study};
use super::judge::{judge, unjudged};
use crate::experiments::entry::{Comm, Entry, Judged, Line, Setup, Verdict};
use crate::experiments::execute::has_message_matrix;
use crate::experiments::feasible;
use crate::experiments::session::{Bench, BenchError, Planned, SessionOptions};
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
    let place = tempfile::Builder::new().prefix("harness-bench-").tempdir();
    let place = place.map_err(|error| format!("no temporary directory: {error}"))?;
    let bench = Bench::open(options, record, study.engines(), programs, place.path(), progress)?;
    let (bases, made, warm) = Default::default();
    let mut session = Session { bench, study, options, bases, made, warm };
    let series = study.series.iter().try_for_each(|series| session.series(series));
    let mut interrupted = match series {
        Err(BenchError::Interrupted) => true,
        other => other.map(|()| false)?,
    };
    let mut rows = Vec::new();
    for (i, row) in study.row.iter().enumerate() {
        interrupted |= interrupt::requested();
        let judged = if interrupted { Err(BenchError::Interrupted) } else { session.row(row) };
        rows.push(match judged {
            Err(BenchError::Interrupted) => {
                interrupted = true;
                // A row that was not measured before the interruption is not a result.
                unjudged(row, Verdict::LeftOut, "interrupted".to_owned())
            }
            judged => {
                let judged = judged?;
                let [name, target, value, how, verdict] = judged.fields();
                let line = format!("{name}: {value} ({how}), target {target}: {verdict}");
                (session.bench.progress)(&format!("row {} of {}: {line}", i + 1, study.row.len()));
                session.bench.append(Entry::Target(judged.clone()))?;
                judged
            }
        });
    }
    let needs_mpi =
        |row: &Row| study.runs_of(row).into_iter().any(|name| study.run[name].comm == Comm::Mpi);
    let is_missing = !options.no_mpi && !options.launcher.is_found();
    let program = options.launcher.program();
    let missing = (is_missing && study.row.iter().any(needs_mpi))
        .then(|| format!("{} is missing: runs on MPI were left out", program.display()));
    Ok(Outcome { rows, lines: session.bench.lines, interrupted, missing })
}

/// A running session.
struct Session<'a> {
    bench: Bench<'a>,
    study: &'a Study,
    options: &'a SessionOptions,
    /// Geometries read so far, by their source, with the known sizes of their meshes by n.
    bases: BTreeMap<String, (Base, BTreeMap<u32, Sizes>)>,
    /// Runs that are complete.
    made: BTreeSet<String>,
    /// Programs and cases that have been run at least once.
    warm: BTreeSet<(String, PathBuf)>,
}

impl Session<'_> {
    /// Runs a series: every size by all programs in turn.
    fn series(&mut self, series: &Series) -> Result<(), BenchError> {
        for cells in series.sizes() {
            let mut points = Vec::new();
            for engine in &series.engines {
                points.extend(self.points(series, engine, cells)?);
            }
            self.make(&mut points)?;
        }
        Ok(())
    }

    /// Plans the runs of a series by one engine at one size; those of cases that it declines are left out.
    fn points(
        &mut self,
        series: &Series,
        engine: &str,
        cells: Option<f64>,
    ) -> Result<Vec<Planned>, BenchError> {
        let description = self.bench.runner.programs.labelled(engine).description().clone();
        let layouts = series.layouts(&description, self.mpi_left_out().is_some());
        if layouts.is_empty() {
            let experiment = series.experiment;
            (self.bench.progress)(&format!("{engine} cannot run the series {experiment}"));
        }
        let mesh = Mesh { case: Some(series.case.clone()), ..Mesh::default() };
        let key = self.base(&series.case, &mesh)?;
        let of_case = [self.bases[&key].0.layer_cells_min];
        let layers = if series.layers.is_empty() { &of_case[..] } else { &series.layers };
        let mut points = Vec::new();
        for &n in layers {
            for &(comm, ranks) in &layouts {
                for spacing in self.spacings(&key, series.experiment, cells, ranks)? {
                    let base = &self.bases[&key].0;
                    let path = base.variant(spacing, n)?;
                    let setup = Setup {
                        experiment: series.experiment.to_string(),
                        engine: engine.to_owned(),
                        ranks,
                        comm,
                        ..Setup::serial(&base.name, spacing, n)
                    };
                    let case = Case::read(&path).map_err(|error| error.to_string())?;
                    if let Some(why) = description.declines(&case) {
                        self.bench.leave_out(setup, why)?;
                        continue;
                    }
                    points.extend(series.choices().iter().map(|&choice| {
                        let (weights, partitioner, weight_exposed) = choice;
                        let (weights, partitioner) = (weights.to_owned(), partitioner.to_owned());
                        let setup = Setup { weights, partitioner, weight_exposed, ..setup.clone() };
                        let repeats = self.options.repeats(series.repeats);
                        let (case, audit, failed) = (path.clone(), false, false);
                        Planned { setup, case, repeats, warm_up: true, audit, failed }
                    }));
                }
            }
        }
        Ok(points)
    }

    /// Returns the spacings of the meshes of a series for a number of ranks.
    fn spacings(
        &mut self,
        key: &str,
        experiment: Experiment,
        cells: Option<f64>,
        ranks: usize,
    ) -> Result<Vec<f64>, BenchError> {
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
    fn spacing(&mut self, key: &str, n: u32, cells: f64) -> Result<f64, BenchError> {
        let (base, sizes) = self.bases.get_mut(key).expect("the geometry was read");
        let runner = &self.bench.runner;
        sizes.entry(n).or_default().spacing(cells, base.coarse(), |s| runner.count(base, s, n))
    }

    /// Executes the runs of a row that are not complete, and judges it.
    fn row(&mut self, row: &Row) -> Result<Judged, BenchError> {
        let study = self.study;
        let mut points = Vec::new();
        for name in study.runs_of(row) {
            let is_mpi = study.run[name].comm == Comm::Mpi;
            if let Some(why) = self.mpi_left_out().filter(|_| is_mpi) {
                return Ok(unjudged(row, Verdict::LeftOut, why.to_owned()));
            }
            if self.made.contains(name) {
                continue;
            }
            match self.point(name) {
                Ok(point) => points.push(point),
                Err(BenchError::Interrupted) => return Err(BenchError::Interrupted),
                Err(BenchError::Input(why)) => {
                    let why = format!("mesh {}: {why}", study.run[name].mesh);
                    return Ok(unjudged(row, Verdict::Failed, why));
                }
            }
        }
        self.make(&mut points)?;
        self.made.extend(study.runs_of(row).into_iter().cloned());
        Ok(judge(study, row, &self.bench.lines))
    }

    /// Plans the run of this name, and writes its case.
    fn point(&mut self, name: &str) -> Result<Planned, BenchError> {
        let spec = &self.study.run[name];
        let mesh = &self.study.mesh[&spec.mesh];
        let key = self.base(&spec.mesh, mesh)?;
        let base = self.bases[&key].0.clone();
        let n = mesh.layer_cells_min.unwrap_or(base.layer_cells_min);
        let (case, spacing) = match mesh.cells {
            None => {
                let spacing = mesh.spacing_min.unwrap_or(base.spacing_min);
                (base.in_own_root(spacing, n), spacing)
            }
            Some(cells) => {
                (self.bench.progress)(&format!("{}: looking for the spacing", spec.mesh));
                let spacing = self.spacing(&key, n, cells)?;
                (base.variant(spacing, n), spacing)
            }
        };
        let repeats = self.options.repeats(spec.repeats);
        let setup = Setup {
            experiment: EXPERIMENT.to_owned(),
            ranks: spec.ranks,
            comm: spec.comm,
            partitioner: spec.partitioner.clone(),
            weights: spec.weights.clone(),
            ..Setup::serial(&spec.mesh, spacing, n)
        };
        let warm_up = !spec.audit && spec.warm_up.unwrap_or(repeats > 1);
        let case = case?;
        Ok(Planned { setup, case, repeats, warm_up, audit: spec.audit, failed: false })
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
        if points.iter().any(|p| p.setup.comm == Comm::Sim) {
            self.bench.measure_network()?;
        }
        for index in warmers(points) {
            let (mesh, setup) = (points[index].mesh(), points[index].setup.clone());
            if !self.warm.insert(mesh.clone()) {
                continue;
            }
            match feasible::excess(&self.bench.lines, &setup, self.bench.runner.limit) {
                None => self.bench.run(&mut points[index], 0, true)?,
                Some(why) => {
                    points.iter_mut().filter(|p| p.mesh() == mesh).for_each(|p| p.failed = true);
                    self.bench.leave_out(setup, why)?;
                }
            }
        }
        for repeat in 0..points.iter().map(|p| p.repeats).max().unwrap_or(0) {
            for point in points.iter_mut().filter(|p| repeat < p.repeats && !p.failed) {
                self.bench.run(point, repeat, false)?;
            }
        }
        Ok(())
    }

    /// Writes the geometry of a mesh as a binary STL file, once; returns its key.
    fn base(&mut self, name: &str, mesh: &Mesh) -> Result<String, BenchError> {
        let Mesh { case, geometry, generator, root_scale, .. } = mesh;
        let key = format!("{case:?} {geometry:?} {generator:?} {root_scale:?}");
        if self.bases.contains_key(&key) {
            return Ok(key);
        }
        (self.bench.progress)(&format!("{name}: reading the geometry"));
        let (place, directory) = (self.bench.runner.place, &self.study.directory);
        let path = match case {
            Some(case) => self.bench.runner.programs.paths.catalogue.case_file(case, directory),
            None => given_case(mesh, directory, place.join(format!("{name}-given.toml"))),
        };
        let base = path.and_then(|path| Base::read(&path, place))?;
        self.bases.insert(key.clone(), (base, BTreeMap::new()));
        Ok(key)
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

/// Writes a case file for a geometry that was given without one; returns its path.
fn given_case(mesh: &Mesh, directory: &Path, path: PathBuf) -> Result<PathBuf, String> {
    let wrong = |error| format!("{}: {error}", path.display());
    let mut table = toml::Table::new();
    if let Some(file) = &mesh.geometry {
        let file = std::path::absolute(directory.join(file)).map_err(wrong)?;
        table.insert("geometry".into(), file.to_string_lossy().into_owned().into());
    }
    table.extend(mesh.generator.clone().map(|generator| ("generator".into(), generator.into())));
    for (key, value) in [("root_scale", mesh.root_scale), ("spacing_min", mesh.spacing_min)] {
        table.extend(value.map(|v| (key.to_owned(), v.into())));
    }
    std::fs::write(&path, table.to_string()).map_err(wrong)?;
    Ok(path)
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
