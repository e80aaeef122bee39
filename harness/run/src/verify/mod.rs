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
use crate::engine::failure;
use crate::engine::interrupt;
use crate::engine::programs::Programs;
use crate::progress::Progress;
use case::CaseRun;
use contract::catalogue::{Selected, Size};
use contract::failure::Failure;
use needs::{Found, Needs};
use options::Options;
use report::{Asked, CaseReport, Check, Outcome, Report};
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;
use workplace::Workplace;

/// Most cases at a time.
const BESIDE_MAX: usize = 4;

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
    let verification = Verification {
        options,
        programs,
        workplace: Workplace::new(options)?,
        needs: Needs::probe(options, programs),
        progress: Progress::new(
            "{spinner} {pos}/{len} [{elapsed}] {prefix}: {wide_msg}",
            Some(selected.len()),
        ),
    };
    let verified = verification.cases(&selected)?;
    let Verification { needs, workplace, progress, .. } = verification;
    progress.finish();
    let interrupted = interrupt::requested();
    workplace.close(interrupted && !options.keep);
    let (cases, silent): (Vec<_>, Vec<_>) = verified.into_iter().unzip();
    let unchecked = |case: &&CaseReport| !case.is_checked() && case.input_error.is_none();
    let found = Found {
        cases: cases.len(),
        // That an interrupt left the last ones without checks is no news.
        unchecked: match interrupted {
            true => Vec::new(),
            false => cases.iter().filter(unchecked).map(|case| &*case.name).collect(),
        },
        geometries_absent: selected[..cases.len()].iter().filter(|c| c.absent.is_some()).count(),
        oracles_silent: silent.into_iter().flatten().collect(),
    };
    let report = Report {
        schema: report::SCHEMA.to_owned(),
        program: format!("harness {}", env!("CARGO_PKG_VERSION")),
        cores: thread::available_parallelism().map_or(1, usize::from),
        asked: asked(&selected, options, programs),
        missing: needs.missing(options, &programs.paths, &found),
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

/// A case's report, and the oracles that gave no answer on it.
type Verified = (CaseReport, Vec<failure::Failure>);

/// What the verifications of all cases share.
struct Verification<'a> {
    options: &'a Options,
    programs: &'a Programs,
    needs: Needs,
    workplace: Workplace,
    progress: Progress,
}

impl Verification<'_> {
    /// Verifies the cases, in order. Small ones beside each other, because most of a case is one process that waits for another; of the
    /// others, each may need all of the memory.
    fn cases(&self, selected: &[Selected]) -> Result<Vec<Verified>, Failure> {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let are_small = selected.iter().all(|case| case.size == Some(Size::Small));
        let count = if are_small { cores.min(BESIDE_MAX) } else { 1 };
        let next = AtomicUsize::new(0);
        let verify = || {
            let mut verified = Vec::new();
            while !interrupt::requested()
                && let at = next.fetch_add(1, Ordering::Relaxed)
                && let Some(case) = selected.get(at)
            {
                let result = self.case(case);
                if result.is_err() {
                    next.store(selected.len(), Ordering::Relaxed);
                }
                verified.push((at, result));
            }
            verified
        };
        let mut verified = thread::scope(|scope| {
            let others: Vec<_> = (1..count).map(|_| scope.spawn(verify)).collect();
            let mut verified = verify();
            for other in others {
                verified.extend(other.join().unwrap_or_else(|panic| resume_unwind(panic)));
            }
            verified
        });
        verified.sort_by_key(|&(at, _)| at);
        verified.into_iter().map(|(_, result)| result).collect()
    }

    fn case(&self, selected: &Selected) -> Result<Verified, Failure> {
        let start = Instant::now();
        let (options, programs, needs) = (self.options, self.programs, &self.needs);
        self.progress.case(&selected.name);
        if let Some(why) = &selected.absent {
            let place = Path::new("");
            let mut run = CaseRun::new(selected, options, programs, needs, place, &self.progress);
            run.add(Check::new("case", "geometry", Outcome::left_out(why)), None);
            run.leave_out_rest();
            return Ok((run.into_report(), Vec::new()));
        }
        let place = self.workplace.enter(&selected.name)?;
        let selected = &plain(selected, programs, &place);
        let mut run = CaseRun::new(selected, options, programs, needs, &place, &self.progress);
        run.verify();
        let silent = std::mem::take(&mut run.oracles_silent);
        let mut report = run.into_report();
        report.time_s = start.elapsed().as_secs_f64();
        let keep = options.keep || (report.failed() && !interrupt::requested());
        report.kept = self.workplace.leave(&place, keep).map(|kept| kept.display().to_string());
        if !report.failed() {
            report.repeat_with = None;
        }
        Ok((report, silent))
    }
}

/// The case in a form that the engine can read. A case that the harness cannot read is passed on unchanged, because
/// refusing it is part of the verification.
fn plain(selected: &Selected, programs: &Programs, place: &Path) -> Selected {
    let prepared = programs.engine.prepare(&selected.path, &place.join("plain"));
    let path = prepared.unwrap_or_else(|_| selected.path.clone());
    Selected { path, ..selected.clone() }
}
