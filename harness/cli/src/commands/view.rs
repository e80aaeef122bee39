//! What a single picture and the pictures of the paper share: views, errors and the command that the data name.

use super::meshed::{Failure, MeshArguments, failed, input};
use export::error::ExportError;
use report::picture::format::{Format, put};
use report::picture::scene::{Scene, html};
use run::engine::paths::Paths;
use run::verify::report::{EXIT_INTERRUPTED, EXIT_MISSING};
use run::view;
use std::io::{self, ErrorKind};
use std::path::Path;

/// A mesh of which no picture could be made.
pub fn unread(error: ExportError) -> Failure {
    match error {
        ExportError::Interrupted => (EXIT_INTERRUPTED, error.to_string()),
        _ => input(error.to_string()),
    }
}

/// Writes a view as HTML or, with pyvista, as PNG.
pub fn write_view(
    scene: &Scene,
    out: &Path,
    paths: &Paths,
    source: &MeshArguments,
) -> Result<(), Failure> {
    let bytes = match Format::of(out) {
        Ok(Format::Png) => {
            let json = report::json::pretty(scene);
            view::png(&json, paths, source.engine.limit()).map_err(|f| failed(&f)).map_err(
                |(code, why)| match code {
                    EXIT_MISSING => (code, format!("{why}; a view as .html needs no Python")),
                    _ => (code, why),
                },
            )?
        }
        _ => html(scene).into_bytes(),
    };
    put(out, &bytes).map_err(unwritten)
}

/// A file of a picture that was not written.
pub fn unwritten(error: io::Error) -> Failure {
    match error.kind() {
        ErrorKind::Interrupted => unread(ExportError::Interrupted),
        _ => input(error.to_string()),
    }
}

/// The command line, as it can be entered again.
pub fn command() -> String {
    let words = std::env::args().skip(1).map(|word| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_=.,/+:".contains(c);
        if word.chars().all(plain) { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
    });
    ["harness".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ")
}
