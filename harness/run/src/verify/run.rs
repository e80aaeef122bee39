//! One run of an engine on a case, with its mesh and its run report read and compared.

use super::case::CaseRun;
use super::report::Run;
use crate::engine::failure::Failure;
use crate::engine::layout::Layout;
use crate::engine::options::RunOptions;
use crate::engine::report::RunReport;
use crate::engine::runner::{Completed, Engine};
use contract::leafset::LeafSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The two programs of a verification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// The reference.
    Reference,
    /// The engine under test, always called `mesher` in reports.
    Mesher,
}

/// A requested run.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The program.
    pub program: Program,
    /// How it is distributed over ranks.
    pub layout: &'a Layout,
    /// The case file.
    pub case: &'a Path,
    /// Name of the run's directory below that of the case.
    pub name: &'a str,
    /// Make the base tree instead of the final mesh.
    pub ungraded: bool,
    /// Write the mesh; otherwise the run is only measured.
    pub write: bool,
}

/// A run that ended well.
#[derive(Debug)]
pub struct Meshed {
    /// Its measurements.
    pub run: Run,
    /// Its report.
    pub report: RunReport,
    /// The mesh, if it was requested.
    pub mesh: Option<LeafSet>,
    /// Directory of the run.
    pub place: PathBuf,
}

impl CaseRun<'_> {
    /// Performs a run. The caller removes its directory.
    ///
    /// # Errors
    /// If the run fails, its output cannot be read, or its run report contradicts its mesh.
    pub fn run(&self, request: &Request) -> Result<Meshed, Failure> {
        let engine = self.engine(request.program);
        let place = self.place.join(request.name);
        fs::create_dir_all(&place).map_err(|error| {
            engine.unusable(format!("has no directory {}: {error}", place.display()))
        })?;
        let mesh = place.join("mesh");
        let options = RunOptions {
            mesh: request.write.then_some(&mesh),
            status: true,
            ungraded: request.ungraded,
            sample_memory: true,
            services: Some(&self.needs.services),
            ..RunOptions::new(&place, self.options.limit())
        };
        let completed = engine.run(request.case, request.layout, &options)?;
        let mesh = match request.write {
            true => completed.read_mesh().map_err(|why| {
                engine.unusable(format!("wrote a mesh that cannot be read: {why}"))
            })?,
            false => None,
        };
        if let Some(mesh) = &mesh {
            compare(&completed.report, mesh).map_err(|why| engine.unusable(why))?;
        }
        Ok(Meshed { run: measurements(request, &completed), report: completed.report, mesh, place })
    }

    fn engine(&self, program: Program) -> &Engine {
        match program {
            Program::Reference => &self.programs.reference,
            Program::Mesher => &self.programs.engine,
        }
    }
}

/// Compares cells and digest in the run report with those of the mesh.
fn compare(report: &RunReport, mesh: &LeafSet) -> Result<(), String> {
    let (digest, leaves) = (mesh.manifest.digest.to_string(), mesh.words.len() as u64);
    let reported = report.digest.as_ref().unwrap_or(&digest);
    if *reported != digest || report.cells != leaves {
        return Err(format!(
            "reports {} cells and digest {reported}, but its mesh has {leaves} leaves and, by its manifest, digest {digest}",
            report.cells
        ));
    }
    Ok(())
}

fn measurements(request: &Request, completed: &Completed) -> Run {
    let program = match request.program {
        Program::Reference => "reference",
        Program::Mesher => "mesher",
    };
    let report = &completed.report;
    Run {
        program: program.to_owned(),
        layout: request.layout.rank_count().map(|_| request.layout.clone()),
        cells: report.cells,
        digest: report.digest.clone().unwrap_or_default(),
        time_wall_s: report.time_wall_s.unwrap_or(completed.time_process_s),
        is_time_reported: report.time_wall_s.is_some(),
        time_process_s: completed.time_process_s,
        peak_rss_bytes: report.peak_rss_bytes_total(),
    }
}
