//! `harness audit`: checks a leaf-set directory by itself, or against promises on a case.

use check::audit::record::AuditRecord;
use check::audit::{AuditOptions, Requirements, audit_against};
use clap::Args;
use contract::case::Case;
use run::engine::description::Description;
use run::engine::paths::Paths;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT, EXIT_MISSING};
use std::path::{Path, PathBuf};

/// `harness audit`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The leaf-set directory
    mesh: PathBuf,
    /// Check these promises instead of the definition: name in harness/engines or path of a file with [promises]
    #[arg(long, value_name = "ENGINE")]
    promises: Option<String>,
    /// The case of the mesh, for promises about its geometry: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE", requires = "promises")]
    case: Option<String>,
    /// Exit code 3 if a check had nothing to check
    #[arg(long)]
    require_checks: bool,
    /// Maximum number of distinct nodes in memory
    #[arg(long)]
    nodes_max: Option<usize>,
    /// Write verdict, times and memory as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Audits, prints and writes; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    try_run(arguments).unwrap_or_else(|why| {
        eprintln!("harness: {why}");
        EXIT_INPUT
    })
}

fn try_run(arguments: &Arguments) -> Result<u8, String> {
    let mesh = &arguments.mesh;
    if !mesh.is_dir() {
        return Err(format!("{} is not a directory", mesh.display()));
    }
    let paths = Paths::find();
    let engine =
        arguments.promises.as_ref().map(|name| Description::find(name, &paths)).transpose()?;
    let case = arguments.case.as_ref().map(|name| read_case(name, &paths)).transpose()?;
    if let (Some(engine), Some(case)) = (&engine, &case)
        && let Some(why) = engine.declines(case)
    {
        println!("left out: {why}");
        return Ok(if arguments.require_checks { EXIT_MISSING } else { EXIT_HOLDS });
    }
    let default = AuditOptions::default();
    let options = AuditOptions { nodes_max: arguments.nodes_max.unwrap_or(default.nodes_max) };
    let requirements = match &engine {
        Some(engine) => Requirements::Promises(&engine.promises, case.as_ref()),
        None => Requirements::Definition,
    };
    let report = audit_against(mesh, &options, requirements);
    println!("{report}");
    if let Some(path) = &arguments.json {
        let written = AuditRecord::of(&report).write(path);
        written.map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(match report.holds() {
        false => EXIT_FAILED,
        true if arguments.require_checks && report.not_run().next().is_some() => EXIT_MISSING,
        true => EXIT_HOLDS,
    })
}

fn read_case(name: &str, paths: &Paths) -> Result<Case, String> {
    let path = paths.catalogue.case_file(name, Path::new(""))?;
    Case::read(&path).map_err(|error| error.to_string())
}
