//! `harness report DIR`: figures, a page, a LaTeX fragment and macros of the numbers from records.

mod balance;
mod figures;
mod groups;
mod html;
mod latex;
pub mod numbers;
mod paper;
pub mod prose;
mod rules;
mod scaling;
pub mod tables;

use crate::figure::check::check_invariants;
#[cfg(feature = "figures")]
use crate::figure::raster;
use crate::figure::{Figure, csv, file_name, name_apart, svg, tex};
use bench::experiments::entry::Line;
use bench::experiments::group::Groups;
use contract::files::{named, write_atomically};
use html::Drawn;
pub use latex::machines;
use numbers::{Number, numbers};
use rules::Broken;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The files of a report.
#[derive(Debug)]
pub struct Written {
    /// The page.
    pub page: PathBuf,
    /// Number of figures.
    pub figures: usize,
    /// The rules that are broken.
    pub broken: Vec<Broken>,
    /// The results in `numbers.tex`.
    pub numbers: Vec<Number>,
}

/// Writes figures, page, LaTeX fragment and macros of a record into `directory`.
///
/// # Errors
/// If a file cannot be written.
pub fn report(directory: &Path, lines: &[Line]) -> io::Result<Written> {
    let groups = Groups::of(lines);
    let figures = figures::figures(&groups);
    let mut figures: Vec<Figure> = figures.into_iter().map(Figure::without_zeros).collect();
    figures.iter_mut().for_each(|figure| figure.id = file_name(&figure.id));
    name_apart(figures.iter_mut().map(|figure| &mut figure.id));
    check_invariants(&figures);
    let place = directory.join("figures");
    fs::create_dir_all(&place)?;
    let drawn: Vec<Drawn> =
        figures.iter().map(|figure| write_figure(&place, figure)).collect::<io::Result<_>>()?;
    let broken = rules::broken(&groups, lines);
    let page = directory.join("index.html");
    write(&page, html::page(&groups, &drawn, &broken, lines))?;
    write(&directory.join("figures.tex"), latex::fragment(&figures))?;
    let numbers = numbers(&groups);
    write(&directory.join("numbers.tex"), numbers::tex(&numbers))?;
    Ok(Written { page, figures: figures.len(), broken, numbers })
}

/// Writes a figure in all formats.
fn write_figure<'a>(directory: &Path, figure: &'a Figure) -> io::Result<Drawn<'a>> {
    let (svg, csv) = (svg::svg(figure), csv::csv(figure));
    let path = |extension: &str| directory.join(format!("{}.{extension}", figure.id));
    write(&path("svg"), &svg)?;
    write(&path("csv"), &csv)?;
    write(&path("tex"), tex::tex(figure))?;
    #[cfg(feature = "figures")]
    {
        write(&path("png"), raster::png(&svg).map_err(io::Error::other)?)?;
        write(&path("pdf"), raster::pdf(&svg).map_err(io::Error::other)?)?;
    }
    Ok((figure, svg))
}

fn write(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    write_atomically(path, |out| out.write_all(content.as_ref())).map_err(|e| named(path, &e))
}
