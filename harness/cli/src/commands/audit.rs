//! `harness audit`: checks a leaf-set directory by itself.

use check::audit::record::AuditRecord;
use check::audit::{self, AuditOptions};
use clap::Args;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT};
use std::path::PathBuf;

/// `harness audit`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The leaf-set directory
    mesh: PathBuf,
    /// Maximum number of distinct nodes in memory
    #[arg(long)]
    nodes_max: Option<usize>,
    /// Write verdict, times and memory as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Audits, prints and writes; returns the exit code.
pub fn run(Arguments { mesh, nodes_max, json }: &Arguments) -> u8 {
    if !mesh.is_dir() {
        eprintln!("harness: {} is not a directory", mesh.display());
        return EXIT_INPUT;
    }
    let default = AuditOptions::default();
    let options = AuditOptions { nodes_max: nodes_max.unwrap_or(default.nodes_max) };
    let report = audit::audit(mesh, &options);
    println!("{report}");
    if let Some(path) = json
        && let Err(error) = AuditRecord::of(&report).write(path)
    {
        eprintln!("harness: {}: {error}", path.display());
        return EXIT_INPUT;
    }
    if report.holds() { EXIT_HOLDS } else { EXIT_FAILED }
}
