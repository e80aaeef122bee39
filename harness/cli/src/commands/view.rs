//! What a single picture and the pictures of the paper share: views, and the command that the data name.

use super::meshed::MeshArguments;
use contract::failure::Failure;
use report::picture::format::{Format, put};
use report::picture::scene::{Scene, html};
use run::engine::failure::End;
use run::engine::paths::Paths;
use run::view;
use std::path::Path;

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
            view::png(&json, paths, source.engine.limit()).map_err(|failure| match failure.end {
                End::Missing(_) => {
                    Failure::missing(format!("{failure}; a view as .html needs no Python"))
                }
                _ => failure.into(),
            })?
        }
        _ => html(scene).into_bytes(),
    };
    Ok(put(out, &bytes)?)
}

/// The command line, as it can be entered again.
pub fn command() -> String {
    let words = std::env::args().skip(1).map(|word| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_=.,/+:".contains(c);
        if word.chars().all(plain) { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
    });
    ["harness".to_owned()].into_iter().chain(words).collect::<Vec<_>>().join(" ")
}
