//! `harness verify`: meshes every case with the reference and with the mesher on every layout, and checks the meshes.
//!
//! [`options`] are the user's choices, [`needs`] records what is missing on this machine, [`case`] verifies one case
//! with a module per family of checks, and [`report`] is the result.

pub mod balance;
pub mod case;
pub mod needs;
pub mod options;
pub mod oracles;
pub mod outcome;
pub mod ranks;
pub mod report;
pub mod run;
pub mod serial;
pub mod workplace;

use crate::engine::description;
use crate::engine::interrupt;
use crate::engine::programs::Programs;
use crate::progress::Progress;
use case::CaseRun;
use contract::catalogue::Selected;
use contract::failure::Failure;
use needs::Needs;
use options::Options;
use report::{Asked, CaseReport, Check, Outcome, Report};
use std::path::Path;
use std::time::Instant;
use workplace::Workplace;

/// Verifies the cases that the options select.
///
/// # Errors
/// If the verification could not begin. Failures after that are in the report.
pub fn verify(options: &Options, programs: &Programs) -> Result<Report, Failure> {
    let start = Instant::now();
    let engine = &programs.engine;
    let used = [("mesher", engine), ("reference", &programs.reference)];
    // Only the definition is compared with the reference.
    let used = &used[..1 + usize::from(engine.description().promises.definition)];
    if let Some((program, engine)) = used.iter().find(|(_, engine)| !engine.program().is_file()) {
        let path = engine.program().display();
        let fix = match description::is_own(engine.name()) {
            true => format!("build {path}, or give another path with --{program}"),
            false => format!(
                "{path} does not exist, which `program` (or else the first word of `serial`) names in the engine file {}: correct it, as \
                 in program = \"{{here}}/my-mesher\", or give --{program} PATH",
                engine.name()
            ),
        };
        return Err(Failure::missing(format!("the {program} is missing: {fix}")));
    }
    let selected = programs.paths.catalogue.select(&options.cases, &options.size)?;
    if selected.is_empty() {
        let why = format!("no case in {} has this size", programs.paths.catalogue.path().display());
        return Err(Failure::input(why));
    }
    let mut workplace = Workplace::new(options)?;
    let mut needs = Needs::probe(options, programs);
    let progress = Progress::new(
        "{spinner} {pos}/{len} [{elapsed}] {prefix}: {wide_msg}",
        Some(selected.len()),
    );
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
    let report = Report {
        schema: report::SCHEMA.to_owned(),
        program: format!("harness {}", env!("CARGO_PKG_VERSION")),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        asked: asked(&selected, options, programs),
        missing: needs.missing(options, &programs.paths, cases.len()),
        cases,
        interrupted,
        time_s: start.elapsed().as_secs_f64(),
    };
    report.check_invariants();
    Ok(report)
}

fn asked(selected: &[Selected], options: &Options, programs: &Programs) -> Asked {
    Asked {
        cases: selected.iter().map(|case| case.name.clone()).collect(),
        named: !options.cases.is_empty(),
        ranks: options.rank_counts(programs.engine.description()),
        subjects: case::steps(&programs.engine.description().promises)
            .iter()
            .map(|(subject, _)| (*subject).to_owned())
            .collect(),
    }
}

fn verify_case(
    selected: &Selected,
    options: &Options,
    programs: &Programs,
    needs: &mut Needs,
    workplace: &mut Workplace,
    progress: &Progress,
) -> Result<CaseReport, Failure> {
    let start = Instant::now();
    progress.case(&selected.name);
    if let Some(why) = &selected.absent {
        needs.note_absent_geometry(why);
        needs.note_unchecked(&selected.name);
        let mut run = CaseRun::new(selected, options, programs, needs, Path::new(""), progress);
        run.add(Check::new("case", "geometry", Outcome::left_out(why)), None);
        run.leave_out_rest();
        return Ok(run.into_report());
    }
    let place = workplace.enter(&selected.name)?;
    let selected = &plain(selected, programs, &place);
    let mut run = CaseRun::new(selected, options, programs, needs, &place, progress);
    run.verify();
    let silent = std::mem::take(&mut run.oracles_silent);
    let mut report = run.into_report();
    needs.note_silent_oracles(silent);
    if !report.is_checked() && report.input_error.is_none() && !interrupt::requested() {
        needs.note_unchecked(&selected.name);
    }
    report.time_s = start.elapsed().as_secs_f64();
    let keep = options.keep || (report.failed() && !interrupt::requested());
    report.kept = workplace.leave(&place, keep).map(|kept| kept.display().to_string());
    if !report.failed() {
        report.repeat_with = None;
    }
    Ok(report)
}

/// The case in a form that the engine can read. A case that the harness cannot read is passed on unchanged, because
/// refusing it is part of the verification.
fn plain(selected: &Selected, programs: &Programs, place: &Path) -> Selected {
    let prepared = programs.engine.prepare(&selected.path, &place.join("plain"));
    let path = prepared.unwrap_or_else(|_| selected.path.clone());
    Selected { path, ..selected.clone() }
}
