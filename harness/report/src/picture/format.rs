//! The formats of pictures, by the name of the file.

use super::{Picture, svg};
use clap::ValueEnum;
use contract::files::{named, write_atomically};
use run::engine::interrupt;
use std::io::{self, Write};
use std::path::Path;

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A slice as SVG.
    Svg,
    /// A slice as PNG, or a view.
    Png,
    /// A slice as PDF.
    Pdf,
    /// A view as HTML.
    Html,
}

impl Format {
    /// The format that a file name states.
    ///
    /// # Errors
    /// One sentence, if it states none.
    pub fn of(path: &Path) -> Result<Self, String> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let endings = ".svg, .png, .pdf or .html";
        let file = path.display();
        Self::from_str(extension, true)
            .map_err(|_| format!("{file}: the file name of a picture must end in {endings}"))
    }

    /// The slice in this format.
    ///
    /// # Errors
    /// One sentence, if slices do not have this format, or if it was not compiled.
    pub fn draw(self, picture: &Picture) -> Result<Vec<u8>, String> {
        match self {
            Self::Svg => Ok(svg(picture).into_bytes()),
            #[cfg(feature = "figures")]
            Self::Png => crate::figure::raster::png(&svg(picture)),
            #[cfg(feature = "figures")]
            Self::Pdf => crate::figure::raster::pdf(&svg(picture)),
            #[cfg(not(feature = "figures"))]
            Self::Png | Self::Pdf => {
                Err("PNG and PDF need a harness with the feature figures: choose .svg".to_owned())
            }
            Self::Html => Err("a slice is no view: choose .svg".to_owned()),
        }
    }
}

/// Writes a slice.
///
/// # Errors
/// If the file cannot be written or the format is not available; the message names the file.
pub fn write(picture: &Picture, format: Format, path: &Path) -> io::Result<()> {
    put(path, &format.draw(picture).map_err(io::Error::other)?)
}

/// Writes a file, which is either complete or absent.
///
/// # Errors
/// If it cannot be written; the message names it.
pub fn put(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_atomically(path, |out| fill(out, bytes)).map_err(|error| named(path, &error))
}

/// Fills a file, which is not published if the user has interrupted the drawing.
fn fill(out: &mut dyn Write, bytes: &[u8]) -> io::Result<()> {
    out.write_all(bytes)?;
    if interrupt::requested() { Err(io::ErrorKind::Interrupted.into()) } else { Ok(()) }
}
