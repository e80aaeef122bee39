//! `harness audit`: checks a mesh by itself.

use super::import::{Failure, Source};
use check::audit::record::AuditRecord;
use check::audit::{self, AuditOptions};
use clap::Args;
use contract::case::Case;
use contract::manifest;
use run::verify::report::{EXIT_FAILED, EXIT_HOLDS, EXIT_INPUT};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// `harness audit`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A leaf-set directory, or a mesh in any format of harness import
    mesh: PathBuf,
    /// Maximum number of distinct nodes in memory
    #[arg(long)]
    nodes_max: Option<usize>,
    /// Write verdict, times and memory as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// How to read a mesh without a manifest.
    #[command(flatten)]
    source: Source,
}

/// Audits, prints and writes; returns the exit code.
pub fn run(arguments: &Arguments) -> u8 {
    audited(arguments).unwrap_or_else(|(code, why)| {
        eprintln!("harness: {why}");
        code
    })
}

fn audited(Arguments { mesh, nodes_max, json, source }: &Arguments) -> Result<u8, Failure> {
    // The temporary directory of an imported mesh lives as long as this value.
    let case = source.read_case()?;
    let imported = imported(mesh, source, case.as_ref())?;
    let directory = imported.as_ref().map_or(mesh.as_path(), TempDir::path);
    let default = AuditOptions::default();
    let options = AuditOptions { nodes_max: nodes_max.unwrap_or(default.nodes_max) };
    let report = audit::audit(directory, &options);
    println!("{report}");
    if let Some(path) = json {
        let written = AuditRecord::of(&report).write(path);
        written.map_err(|error| (EXIT_INPUT, format!("{}: {error}", path.display())))?;
    }
    Ok(if report.holds() { EXIT_HOLDS } else { EXIT_FAILED })
}

/// The leaf set of a mesh without a manifest, in a temporary directory; `None` for a leaf-set directory.
fn imported(mesh: &Path, source: &Source, case: Option<&Case>) -> Result<Option<TempDir>, Failure> {
    if mesh.join(manifest::FILE).exists() {
        return match source.is_given() {
            false => Ok(None),
            true => Err((
                EXIT_INPUT,
                format!(
                    "{} has a manifest, which states root, case and sides: omit the options for them",
                    mesh.display()
                ),
            )),
        };
    }
    let io = |error: std::io::Error| (EXIT_INPUT, error.to_string());
    let set = source.read(mesh, case)?;
    let place = tempfile::tempdir().map_err(io)?;
    set.create(place.path()).map_err(io)?;
    Ok(Some(place))
}
