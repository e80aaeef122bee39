//! `harness verify`: every case through reference and mesher, on every layout of ranks, and every check on
//! what comes out.
//!
//! [`options`] is what was asked, [`needs`] what of it this machine can
//! do; [`case`] does one case, with a file per family of checks; [`report`] is what was found.

pub mod balance;
pub mod case;
pub mod needs;
pub mod options;
pub mod oracles;
pub mod outcome;
pub mod progress;
pub mod ranks;
pub mod report;
pub mod run;
pub mod serial;
pub mod workplace;

use crate::engine::interrupt;
use crate::engine::programs::Programs;
use case::CaseRun;
use contract::catalogue::Selected;
use needs::Needs;
use options::Options;
use progress::Progress;
use report::{CaseReport, Check, Outcome, Report};
use std::time::Instant;
use workplace::Workplace;

/// Why a verification could not begin.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The user's: an unknown case, a directory that is not ours to write into.
    #[error("{0}")]
    Input(String),
    /// A program without which nothing can be verified.
    #[error("{0}")]
    Missing(String),
}

/// Verifies what the options name and reports what was found.
///
/// # Errors
/// Only where it could not begin; what goes wrong later is in the report.
pub fn verify(options: &Options, programs: &Programs) -> Result<Report, VerifyError> {
    let start = Instant::now();
    for (program, path) in
        [("mesher", &programs.paths.mesher), ("reference", &programs.paths.reference)]
    {
        if !path.is_file() {
            let path = path.display();
            return Err(VerifyError::Missing(format!(
                "there is no {program} at {path}: build it, or say where it is"
            )));
        }
    }
    let selected = programs
        .paths
        .catalogue
        .select(&options.cases, &options.sizes)
        .map_err(VerifyError::Input)?;
    let mut workplace = Workplace::new(options)?;
    let mut needs = Needs::probe(options, programs, workplace.root());
    let progress = Progress::new(&selected);
    let mut cases = Vec::new();
    for one in &selected {
        if interrupt::requested() {
            break;
        }
        cases.push(verify_case(one, options, programs, &mut needs, &mut workplace, &progress)?);
    }
    progress.finish();
    let interrupted = interrupt::requested();
    workplace.close(interrupted && !options.keep);
    Ok(Report {
        schema: report::SCHEMA.to_owned(),
        program: format!("harness {}", env!("CARGO_PKG_VERSION")),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        missing: needs.missing(options),
        cases,
        interrupted,
        time_s: start.elapsed().as_secs_f64(),
    })
}

fn verify_case(
    selected: &Selected,
    options: &Options,
    programs: &Programs,
    needs: &mut Needs,
    workplace: &mut Workplace,
    progress: &Progress,
) -> Result<CaseReport, VerifyError> {
    let start = Instant::now();
    progress.case(&selected.name);
    if let Some(why) = &selected.absent {
        needs.note_absent_geometry(why);
        let check = Check::new("case", "geometry", Outcome::LeftOut(why.clone()));
        return Ok(CaseReport {
            name: selected.name.clone(),
            checks: vec![check],
            ..CaseReport::default()
        });
    }
    let place = workplace.enter(&selected.name)?;
    let selected = &plain(selected, programs, &place);
    let mut run = CaseRun::new(selected, options, programs, needs, &place, progress);
    run.verify();
    let mut report = run.into_report();
    report.time_s = start.elapsed().as_secs_f64();
    let keep = options.keep || (report.failed() && !interrupt::requested());
    report.kept = workplace.leave(&place, keep).map(|kept| kept.display().to_string());
    if !report.failed() {
        report.repeat_with = None;
    }
    Ok(report)
}

/// The case as the engine that stands in for the mesher can read it. One that cannot be read at all stays as it
/// is: to refuse it is part of what is verified.
fn plain(selected: &Selected, programs: &Programs, place: &std::path::Path) -> Selected {
    let prepared = programs
        .engine
        .as_ref()
        .and_then(|engine| engine.prepare(&selected.path, &place.join("plain")).ok());
    let path = prepared.unwrap_or_else(|| selected.path.clone());
    Selected { path, ..selected.clone() }
}
