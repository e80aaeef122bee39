//! `harness audit`: checks a mesh by itself, or against its case, or against promises on a case.

use super::import::Source;
use super::values::{Input, Output};
use check::audit::record::AuditRecord;
use check::audit::{AuditOptions, audit_against};
use check::checks::CheckResult;
use check::promises::Promises;
use clap::Args;
use contract::failure::Failure;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, EXIT_MISSING};
use contract::files::named;
use run::engine::description::Description;
use run::engine::failure::End;
use run::engine::paths::Paths;
use run::engine::process::{self, Watch};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Longest time of the proven checker. It takes four seconds for ten million leaves, but who has more may wait.
const LIMIT: Duration = Duration::from_secs(86_400);

/// `harness audit`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  harness audit mesh                                   what the leaves alone show
  harness audit mesh --case body.toml                  everything: geometry, T0, crossing leaves, sides, layers, needless splits
  harness audit mesh --proved base                     a proof, given T0: see reference/proof
  harness audit mesh.vtu --case body.toml --sides side a mesh of another program, against the definition
  harness audit mesh --case body.toml --promises p4est a mesh that need not keep the whole definition
  harness audit mesh.vtu --promises 'balance = \"face\"' nothing but these promises

Exit codes: 0 all checks hold; 1 a check has findings; 2 invalid input; 3 nothing was checked, memory does not suffice, or \
Python, VTK or the proven checker is missing.")]
pub struct Arguments {
    /// A leaf-set directory, or a mesh in any format of harness import
    mesh: Input,
    /// Check these promises instead of the definition, with the geometry of --case: name in harness/engines, path of a file with
    /// a table of promises, or the promises themselves, such as 'complete = true, balance = "face"'
    #[arg(long, value_name = "ENGINE|PROMISES")]
    promises: Option<String>,
    /// Also prove the mesh right by the checker of reference/proof, given the directory of T0 (mesher --ungraded --out BASE)
    #[arg(long, value_name = "BASE")]
    proved: Option<Input>,
    /// Exit code 3 if a check had nothing to check
    #[arg(long)]
    require_checks: bool,
    /// Maximum number of distinct nodes in memory
    #[arg(long)]
    nodes_max: Option<usize>,
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
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let Arguments { mesh, promises, proved, require_checks, nodes_max, json, source } = arguments;
    let engine = promises.as_deref().map(promising).transpose()?;
    let case = source.read_case()?;
    if let (Some(engine), Some(case)) = (&engine, &case)
        && let Some(why) = engine.declines(case)
    {
        return Err(Failure::missing(format!("left out: {why}")));
    }
    source.refuse_unused(&[mesh])?;
    let opened = source.open(mesh, case.as_ref())?;
    let directory = &opened.dir;
    let default = AuditOptions::default();
    let options = AuditOptions { nodes_max: nodes_max.unwrap_or(default.nodes_max) };
    let definition = Promises::of_definition();
    let promises = engine.as_ref().map_or(&definition, |engine| &engine.promises);
    let checker = proved.as_ref().map(|_| checker()).transpose()?;
    let mut report = audit_against(directory, &options, case.as_ref(), promises);
    let mut unproven = None;
    if let (Some(checker), Some(base)) = (&checker, proved) {
        match prove(checker, directory, base, report.leaves) {
            Ok(proof) => report.checks.push(proof),
            Err(failure) => unproven = Some(failure),
        }
    }
    report.check_invariants();
    println!("{report}");
    if let Some(path) = json {
        let written = AuditRecord::of(&report).write(path);
        written.map_err(|error| named(path, &error))?;
    }
    match unproven {
        Some(failure) if report.holds() => return Err(failure),
        Some(failure) => println!("left out: proof: {}", failure.why),
        None => {}
    }
    let not_run = || report.not_run().next().is_some();
    Ok(match report.holds() {
        false => EXIT_FAILED,
        true if !report.checked_anything() || report.exceeds_memory() => EXIT_MISSING,
        true if *require_checks && not_run() => EXIT_MISSING,
        true => EXIT_HOLDS,
    })
}

/// What an engine promises, or what the text itself states, as a table `[promises]` would.
fn promising(text: &str) -> Result<Description, String> {
    match text.contains('=') && !text.ends_with(".toml") {
        true => Description::parse(&format!("promises = {{ {text} }}")).map_err(|why| {
            format!("--promises '{text}': {why}; for example 'complete = true, balance = \"face\"'")
        }),
        false => Description::find(text, &Paths::find()),
    }
}

/// The proven checker.
fn checker() -> Result<PathBuf, Failure> {
    let checker = Paths::find().proven_checker;
    match checker.is_file() {
        true => Ok(checker),
        false => Err(Failure::missing(format!(
            "{} is missing: ci/prove proves and builds it",
            checker.display()
        ))),
    }
}

/// What the proven checker finds of a mesh with so many leaves.
fn prove(checker: &Path, mesh: &Path, base: &Path, leaves: u64) -> Result<CheckResult, Failure> {
    let place = tempfile::tempdir()?;
    let mut command = Command::new(checker);
    command.arg(mesh).arg(base);
    let mut proof = CheckResult::new("proof");
    proof.examined = leaves;
    proof.note = "proven, given T0: octants, completeness, sides of components, balance, layers, and that no split is needless or missing; \
                  not proven: which leaves facets cross, boxes, and rays"
        .to_owned();
    match process::run(&mut command, &Watch::new("the proven checker", LIMIT, place.path())) {
        Ok(_) => {}
        Err(failure) if matches!(failure.end, End::Exited { code: 1, .. }) => {
            proof.report("the checker of reference/proof rejects the mesh".to_owned());
        }
        Err(failure) => return Err(failure.into()),
    }
    Ok(proof)
}
