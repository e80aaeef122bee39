//! `harness audit`: checks a mesh by itself, or against its case, or against promises on a case.

use super::import::Source;
use crate::options::{Input, Output, examples};
use crate::output::put_forms;
use check::audit::{AuditReport, audit_against};
use check::checks::CheckResult;
use check::forest;
use check::promises::{Promises, Touching};
use clap::Args;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_MISSING, Failure, Result, exit_first};
use run::engine::description::Description;
use run::engine::paths::Paths;
use run::verify::others::proven;
use std::time::{Duration, Instant};

/// Longest time of the proven checker. It takes two seconds for ten million leaves, but who has more may wait.
const LIMIT: Duration = Duration::from_secs(86_400);

/// `harness audit`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/audit.md")))]
pub struct Arguments {
    /// A leaf-set directory, or a mesh in any format of harness import
    mesh: Input,
    /// Check these promises instead of the definition, with the geometry of --case: name in harness/engines, path of a file with
    /// a table of promises, or the promises themselves, such as 'complete = true, balance = "face"'
    #[arg(long, value_name = "ENGINE|PROMISES")]
    promises: Option<String>,
    /// Check that leaves that touch in this way differ by at most one level, instead of the definition; in a forest of p4est also across
    /// the boundaries of trees [default for such a forest: corners]
    #[arg(long, value_enum, conflicts_with = "promises")]
    balance: Option<Touching>,
    /// Also prove the mesh right by the checker of reference/proof, given the directory of T0 (mesher --ungraded --out BASE)
    #[arg(long, value_name = "BASE")]
    proved: Option<Input>,
    /// Exit code 3 if a check had nothing to check
    #[arg(long)]
    require_checks: bool,
    /// Write verdict, times and memory as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// How to read a mesh without a manifest.
    #[command(flatten)]
    source: Source,
}

/// Audits, prints and writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be read, or the engine does not support the case.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let Arguments { mesh, promises, balance, proved, source, .. } = arguments;
    let start = Instant::now();
    if promises.is_none()
        && proved.is_none()
        && let Some(forest) = source.forest(mesh)?
        && (balance.is_some() || !forest.is_one_cube())
    {
        let has_edges = forest.connectivity.dimension != 2;
        let why = "quadrants have no edges but their faces: choose --balance faces or corners";
        Failure::unless(has_edges || *balance != Some(Touching::Edge), why)?;
        let report = forest::audit(&forest, balance.unwrap_or(Touching::Corner), start);
        return publish(&report, arguments, EXIT_HOLDS);
    }
    let engine = promises.as_deref().map(promising).transpose()?;
    let case = source.read_case()?;
    // Promises without a name are no engine's, which could decline a case.
    if let (Some(engine), Some(case)) = (engine.as_ref().filter(|e| !e.name.is_empty()), &case)
        && let Some(why) = engine.declines(case)
    {
        return Err(Failure::missing(format!("left out: {why}")));
    }
    source.refuse_unused(&[mesh])?;
    let opened = source.open(mesh, case.as_ref())?;
    let (directory, definition) = (&opened.dir, balance.is_none());
    let otherwise = Promises { definition, balance: *balance, ..Promises::default() };
    let promises = engine.as_ref().map_or(&otherwise, |engine| &engine.promises);
    let paths = Paths::find();
    if let Some(why) = proved.as_ref().and_then(|_| paths.lacks_checker()) {
        return Err(Failure::missing(why));
    }
    let mut report = audit_against(directory, case.as_ref(), promises);
    let mut code_of_proof = EXIT_HOLDS;
    if let Some(base) = proved {
        let proof = proven(&paths.proven_checker, (directory, base), report.leaves, LIMIT);
        report.checks.push(proof.unwrap_or_else(|failure| {
            let Failure { code, why } = failure.into();
            code_of_proof = code;
            let mut left_out = CheckResult::new("proof");
            left_out.lacks(why);
            left_out
        }));
    }
    let code = publish(&report, arguments, code_of_proof)?;
    let has_holes = report.checks.iter().any(|check| check.name == "complete" && !check.holds());
    if opened.made.is_some() && case.is_none() && has_holes {
        eprintln!(
            "harness: without --case, an imported mesh is taken for one that fills its root, so every hole is a finding"
        );
    }
    Ok(code)
}

/// Prints the report, and writes it if that is asked for; returns the exit code, if that of the proof is this one.
fn publish(report: &AuditReport, arguments: &Arguments, code_of_proof: u8) -> Result<u8> {
    report.check_invariants();
    println!("{report}");
    let not_run = || report.not_run().next().is_some();
    let is_incomplete = !report.checked_anything() || report.exceeds_memory();
    let code = match () {
        () if !report.holds() => EXIT_FAILED,
        () if is_incomplete || arguments.require_checks && not_run() => EXIT_MISSING,
        () => EXIT_HOLDS,
    };
    let code = exit_first(code, code_of_proof);
    let json = || report.json(code == EXIT_HOLDS);
    put_forms(code, &[(arguments.json.as_deref(), &json)], None)
}

/// What an engine promises, or what the text itself states, as a table `[promises]` would.
fn promising(text: &str) -> Result<Description> {
    let example = "for example 'complete = true, balance = \"face\"'";
    let wrong = |why| Failure::input(format!("--promises '{text}': {why}; {example}"));
    match text.contains('=') && !text.ends_with(".toml") {
        true => Description::parse(&format!("promises = {{ {text} }}")).map_err(wrong),
        false => Description::find(text, &Paths::find()),
    }
}
