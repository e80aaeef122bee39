//! Executes a study: its series, then the runs that its rows need, row by row. Every result is appended to the record at once.
//!
//! Repetitions are the outer loop, so that a drift of the machine affects all setups equally. Equal meshes have equal digests: the time of
//! a wrong mesh is not a result.

use super::file::{Row, Series, Study};
use super::judge::{Judged, Verdict, judge, unjudged};
use super::plan::{Plan, Planned, SessionOptions};
use crate::experiments::entry::{
    Comm, Entry, Failure as Failed, LeftOut, Line, Run, Session as Opening, Setup,
};
use crate::experiments::execute::Runner;
use crate::experiments::group::another_mesh;
use crate::experiments::record::Record;
use crate::experiments::{feasible, machine, network};
use contract::failure::Failure;
use run::engine::interrupt;
use run::engine::programs::Programs;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::time::Duration;

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
    progress: &dyn Fn(&str),
) -> Result<Outcome, Failure> {
    let place = tempfile::Builder::new().prefix("harness-bench-").tempdir()?;
    let (launcher, limit) = (&options.launcher, Duration::from_secs(options.timeout));
    let runner = Runner { programs, launcher, limit, place: place.path() };
    let mut session = Session {
        plan: Plan { study, options, runner, progress, bases: BTreeMap::new() },
        lines: Vec::new(),
        record: Record::new(record),
        digests: HashMap::new(),
        network: false,
        made: BTreeSet::new(),
        warm: BTreeSet::new(),
    };
    let mut rows = Vec::new();
    let done = session.all(&mut rows);
    let interrupted = done.as_ref().is_err_and(Failure::is_interrupt);
    if !interrupted {
        done?;
    }
    // A row that was not measured before the interruption is not a result.
    let rest = study.row[rows.len()..].iter();
    rows.extend(rest.map(|row| unjudged(row, Verdict::LeftOut, "interrupted".to_owned())));
    let needs_mpi =
        |row: &Row| study.runs_of(row).into_iter().any(|name| study.run[name].comm == Comm::Mpi);
    let is_missing = !options.no_mpi && !options.launcher.is_found();
    let program = options.launcher.program();
    let missing = (is_missing && study.row.iter().any(needs_mpi))
        .then(|| format!("{} is missing: runs on MPI were left out", program.display()));
    Ok(Outcome { rows, lines: session.lines, interrupted, missing })
}

/// A running session.
struct Session<'a> {
    plan: Plan<'a>,
    lines: Vec<Line>,
    record: Record,
    /// Digests of the meshes.
    digests: HashMap<String, String>,
    /// Whether the cost of messages is known.
    network: bool,
    /// Runs that are complete.
    made: BTreeSet<String>,
    /// Programs and cases that have been run at least once.
    warm: BTreeSet<(String, PathBuf)>,
}

impl Session<'_> {
    /// Executes the series and the rows, which are added as soon as they are judged.
    fn all(&mut self, rows: &mut Vec<Judged>) -> Result<(), Failure> {
        self.open()?;
        let study = self.plan.study;
        study.series.iter().try_for_each(|series| self.series(series))?;
        for (row, number) in study.row.iter().zip(1..) {
            if interrupt::requested() {
                return Err(Failure::interrupted());
            }
            let judged = self.row(row)?;
            let [name, target, value, how, verdict] = judged.fields();
            let line = format!("{name}: {value} ({how}), target {target}: {verdict}");
            (self.plan.progress)(&format!("row {number} of {}: {line}", study.row.len()));
            rows.push(judged);
        }
        Ok(())
    }

    /// Records the circumstances.
    fn open(&mut self) -> Result<(), Failure> {
        let programs = self.plan.runner.programs;
        let catalogue = programs.paths.catalogue.path();
        let repository = catalogue.parent().and_then(Path::parent).unwrap_or(Path::new("."));
        let lacks = |engine: String| {
            let lacks = programs.labelled(&engine).description().lacks();
            (engine, lacks)
        };
        let opening = Opening {
            command: std::env::args().collect(),
            machine: machine::describe(&self.plan.runner.launcher.program(), repository),
            nodes: machine::nodes(),
            load_average: machine::load_average(),
            lacks: self.plan.study.engines().into_iter().map(lacks).collect(),
        };
        self.append(Entry::Session(Box::new(opening)))
    }

    fn append(&mut self, entry: Entry) -> Result<(), Failure> {
        let line = self.record.append(entry)?;
        self.lines.push(line);
        Ok(())
    }

    /// Runs a series: every size by all programs in turn.
    fn series(&mut self, series: &Series) -> Result<(), Failure> {
        for cells in series.sizes() {
            let mut points = Vec::new();
            for engine in &series.engines {
                points.extend(self.plan.series(series, engine, cells)?);
            }
            self.make(&mut points)?;
        }
        Ok(())
    }

    /// Executes the runs of a row that are not complete, and judges it.
    fn row(&mut self, row: &Row) -> Result<Judged, Failure> {
        let study = self.plan.study;
        let mut points = Vec::new();
        for name in study.runs_of(row) {
            let is_mpi = study.run[name].comm == Comm::Mpi;
            if let Some(why) = self.plan.mpi_left_out().filter(|_| is_mpi) {
                return Ok(unjudged(row, Verdict::LeftOut, why.to_owned()));
            }
            if self.made.contains(name) {
                continue;
            }
            match self.plan.run(name) {
                Ok(point) => points.push(point),
                Err(failure) if failure.is_interrupt() => return Err(failure),
                Err(Failure { why, .. }) => {
                    let why = format!("mesh {}: {why}", study.run[name].mesh);
                    return Ok(unjudged(row, Verdict::Failed, why));
                }
            }
        }
        self.make(&mut points)?;
        self.made.extend(study.runs_of(row).into_iter().cloned());
        Ok(judge(study, row, &self.lines))
    }

    /// Executes runs, each mesh of every program after an uncounted one that fills the file cache. A program that would exceed
    /// the time or the memory is not run on that mesh.
    fn make(&mut self, points: &mut [Planned]) -> Result<(), Failure> {
        for point in points.iter() {
            if let Some(why) = &point.declined {
                self.leave_out(point.setup.clone(), why.clone())?;
            }
        }
        if points.iter().any(|p| p.setup.comm == Comm::Sim) {
            self.measure_network()?;
        }
        for index in 0..points.len() {
            let (mesh, setup) = (points[index].mesh(), points[index].setup.clone());
            let may_warm_up = points[index].warm_up && !points[index].failed;
            if !may_warm_up || !self.warm.insert(mesh.clone()) {
                continue;
            }
            match feasible::excess(&self.lines, &setup, self.plan.runner.limit) {
                None => self.run(&mut points[index], 0, true)?,
                Some(why) => {
                    points.iter_mut().filter(|p| p.mesh() == mesh).for_each(|p| p.failed = true);
                    self.leave_out(setup, why)?;
                }
            }
        }
        for repeat in 0..points.iter().map(|p| p.repeats).max().unwrap_or(0) {
            for point in points.iter_mut().filter(|p| repeat < p.repeats && !p.failed) {
                self.run(point, repeat, false)?;
            }
        }
        Ok(())
    }

    /// Records the cost of messages, once.
    fn measure_network(&mut self) -> Result<(), Failure> {
        if std::mem::replace(&mut self.network, true) {
            return Ok(());
        }
        // All projections depend on it, and any one ping-pong may be disturbed: that of median latency counts.
        let measured = || {
            let one = |_| self.plan.runner.ping_pong().and_then(|text| network::parse(&text));
            let mut three = (0..3).map(one).collect::<Result<Vec<_>, String>>()?;
            three.sort_by(|a, b| a.latency_s.total_cmp(&b.latency_s));
            Ok::<_, String>(three[1])
        };
        let network = self.plan.options.network.map_or_else(measured, Ok).unwrap_or_else(|why| {
            (self.plan.progress)(&format!("latency 2 us and bandwidth 10 GB/s are assumed: {why}"));
            network::ASSUMED
        });
        self.append(Entry::Network(network))
    }

    /// Runs a point and records the result.
    fn run(&mut self, point: &mut Planned, repeat: usize, warm_up: bool) -> Result<(), Failure> {
        let s = &point.setup;
        let repetition = match warm_up {
            true => "warm-up".to_owned(),
            false => format!("{}, repeat {}", s.division(), repeat + 1),
        };
        (self.plan.progress)(&format!(
            "{} {} by {}: {} ranks ({}), spacing {:.3e}, n {}, {repetition}",
            s.experiment,
            s.case,
            s.engine,
            s.ranks,
            crate::name_of(&s.comm),
            s.spacing_min,
            s.layer_cells_min,
        ));
        let run = self.plan.runner.run(s, &point.case, repeat, warm_up).and_then(|run| {
            self.check_mesh(point, &run)?;
            Ok(run)
        });
        match run {
            Ok(run) => self.append(Entry::Run(Box::new(run))),
            Err(failure) if failure.is_interrupt() => Err(failure),
            Err(Failure { why, .. }) => {
                (self.plan.progress)(&format!("failed: {why}"));
                point.failed = true;
                let setup = point.setup.clone();
                let command = format!("{} on {} ranks", setup.engine, setup.ranks);
                self.append(Entry::Failure(Failed { setup, command, why }))
            }
        }
    }

    /// Leaves a run out, with the reason.
    fn leave_out(&mut self, setup: Setup, why: String) -> Result<(), Failure> {
        (self.plan.progress)(&format!("left out, spacing {:.3e}: {why}", setup.spacing_min));
        self.append(Entry::LeftOut(LeftOut { setup, why }))
    }

    /// Requires runs that must have the same mesh to have the same digest: the time of a wrong mesh is not a result. The mesh of an
    /// engine that promises the definition must be that of the mesher, which is made once for each mesh.
    fn check_mesh(&mut self, point: &Planned, run: &Run) -> Result<(), String> {
        let engine = self.plan.runner.programs.labelled(&point.setup.engine);
        let (promises, s) = (&engine.description().promises, &run.setup);
        if run.warm_up && engine.name() != "mesher" && promises.definition {
            let setup = Setup::serial(&s.case, s.spacing_min, s.layer_cells_min);
            // Whether the mesher can be run is not a property of this engine.
            let expected = self.plan.runner.run(&setup, &point.case, 0, true);
            if let Some(expected) = expected.ok().filter(|other| other.digest != run.digest) {
                return Err(format!(
                    "the mesh has digest {}, but that of the definition has {}",
                    run.digest, expected.digest
                ));
            }
        }
        let lacks = self.lines.iter().find_map(Line::session).map(|opening| opening.lacks.clone());
        let other = another_mesh(run, &lacks.unwrap_or_default(), &mut self.digests);
        other.map_or(Ok(()), Err)
    }
}
