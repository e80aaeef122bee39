//! `harness verify`: meshes every case with the reference and with the mesher on every layout, and checks the meshes.
//!
//! [`options`] are the user's choices and what is missing on this machine, [`case`] verifies one case
//! with a module per family of checks, and [`report`] is the result.

pub mod case;
mod meshes;
pub mod options;
mod others;
mod ranks;
pub mod report;
mod workplace;

use crate::engine::interrupt;
use crate::engine::programs::Programs;
use crate::progress::Progress;
use case::CaseRun;
use contract::catalogue::Selected;
use contract::failure::Failure;
use options::{Needs, Options};
use report::{Asked, CaseReport, Report};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Instant;
use workplace::Workplace;

/// Verifies the cases that the options select.
///
/// # Errors
/// If the verification could not begin. Failures after that are in the report.
pub fn verify(options: &Options, programs: &Programs) -> Result<Report, Failure> {
    let start = Instant::now();
    programs.engine.require()?;
    if programs.engine.description().promises.definition {
        // Only the definition is compared with it.
        programs.reference.require()?;
    }
    let selected = programs.paths.catalogue.select(&options.cases, &options.size)?;
    if selected.is_empty() {
        let why = format!("no case in {} has this size", programs.paths.catalogue.path().display());
        return Err(Failure::input(why));
    }
    let verification = Verification {
        options,
        programs,
        workplace: Workplace::new(options)?,
        needs: Needs::probe(options, programs),
        progress: Progress::new(),
    };
    let mut cases = Vec::new();
    for case in selected.iter().take_while(|_| !interrupt::requested()) {
        cases.push(verification.case(case)?);
    }
    let Verification { needs, workplace, progress, .. } = verification;
    progress.finish();
    let interrupted = interrupt::requested();
    workplace.close(cases.iter().any(|case| case.kept.is_some()) && (options.keep || !interrupted));
    let engine = programs.engine.description();
    let report = Report {
        schema: report::SCHEMA.to_owned(),
        program: format!("harness {}", env!("CARGO_PKG_VERSION")),
        cores: thread::available_parallelism().map_or(1, usize::from),
        asked: Asked {
            cases: selected.iter().map(|case| case.name.clone()).collect(),
            named: !options.cases.is_empty(),
            ranks: options.rank_counts(engine),
            subjects: case::steps(engine)
                .iter()
                .map(|((subject, _), _)| (*subject).into())
                .collect(),
        },
        missing: needs.missing(options, engine, &cases, interrupted),
        cases,
        interrupted,
        time_s: start.elapsed().as_secs_f64(),
    };
    report.check_invariants();
    Ok(report)
}

/// What the verifications of all cases share.
#[derive(Debug)]
struct Verification<'a> {
    options: &'a Options,
    programs: &'a Programs,
    needs: Needs,
    workplace: Workplace,
    progress: Progress,
}

impl Verification<'_> {
    fn case(&self, selected: &Selected) -> Result<CaseReport, Failure> {
        let start = Instant::now();
        if let Some(why) = &selected.absent {
            let mut run = CaseRun::new(self, selected, PathBuf::new(), Path::new(""));
            run.leave_out(("case", options::GEOMETRY), why);
            run.leave_out_rest();
            return Ok(run.report);
        }
        let place = self.workplace.enter(&selected.name)?;
        // A case that the harness cannot read is passed on unchanged, because refusing it is part of the verification.
        let prepared = self.programs.engine.prepare(&selected.path, &place.join("plain"));
        let file = prepared.unwrap_or_else(|_| selected.path.clone());
        let mut run = CaseRun::new(self, selected, file, &place);
        run.verify();
        let mut report = run.report;
        report.time_s = start.elapsed().as_secs_f64();
        let keep = self.options.keep || (report.failed() && !interrupt::requested());
        report.kept = self.workplace.leave(&place, keep).map(|kept| kept.display().to_string());
        Ok(report)
    }
}
