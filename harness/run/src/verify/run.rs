//! One run of an engine on a case, with its mesh and its run report read and compared.

use super::case::CaseRun;
use super::report::Run;
use crate::engine::failure::Failure;
use crate::engine::layout::Layout;
use crate::engine::options::RunOptions;
use crate::engine::report::RunReport;
use contract::leafset::LeafSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The engine under test, in reports.
pub(super) const MESHER: &str = "mesher";
/// The reference, in reports.
pub(super) const REFERENCE: &str = "reference";

/// What a run makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Makes {
    /// The final mesh, which is not written: the run is only measured.
    Nothing,
    /// The final mesh.
    Mesh,
    /// The base tree.
    Base,
}

/// A run that ended well.
#[derive(Debug)]
pub(super) struct Meshed {
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
    /// Runs [`MESHER`] or [`REFERENCE`] on a case, with its files in the directory `name` below that of the case. The caller removes it.
    ///
    /// # Errors
    /// If the run fails, its output cannot be read, or its run report contradicts its mesh.
    pub(super) fn run(
        &self,
        case: &Path,
        name: &str,
        program: &str,
        makes: Makes,
        layout: &Layout,
    ) -> Result<Meshed, Failure> {
        let programs = self.all.programs;
        let engine = match program {
            REFERENCE => &programs.reference,
            _ => &programs.engine,
        };
        let place = self.place.join(name);
        fs::create_dir_all(&place).map_err(|error| {
            engine.unusable(format!("has no directory {}: {error}", place.display()))
        })?;
        let (mesh, is_written) = (place.join("mesh"), makes != Makes::Nothing);
        let options = RunOptions {
            mesh: is_written.then_some(&mesh),
            status: true,
            ungraded: makes == Makes::Base,
            sample_memory: true,
            services: Some(&self.all.needs.services),
            ..RunOptions::new(&place, self.all.options.limit())
        };
        let completed = engine.run(case, layout, &options)?;
        let mesh = is_written.then(|| engine.read_mesh(&completed)).transpose()?;
        let report = completed.report;
        if let (Some(mesh), Some(reported)) = (&mesh, &report.digest) {
            let digest = mesh.manifest.digest.to_string();
            if *reported != digest {
                return Err(engine.unusable(format!(
                    "reports digest {reported}, but its mesh has, by its manifest, digest {digest}"
                )));
            }
        }
        let run = Run {
            program: program.to_owned(),
            layout: layout.rank_count().map(|_| layout.clone()),
            cells: report.cells,
            digest: report.digest.clone().unwrap_or_default(),
            time_wall_s: report.time_wall_s.unwrap_or(completed.time_process_s),
            is_time_reported: report.time_wall_s.is_some(),
            time_process_s: completed.time_process_s,
            peak_rss_bytes: report.peak_rss_bytes_total(),
        };
        Ok(Meshed { run, report, mesh, place })
    }
}
