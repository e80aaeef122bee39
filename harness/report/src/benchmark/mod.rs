//! `harness report DIR`: figures, a page, a LaTeX fragment and macros of the numbers from records.

mod figures;
mod groups;
mod models;
pub mod numbers;
mod page;
mod scaling;
pub mod tables;

use crate::figure::format::FORMATS;
use crate::figure::{Figure, check_invariants, file_name, latex, name_apart, svg};
use bench::experiments::entry::Line;
use bench::experiments::group::Groups;
use contract::failure::named;
use contract::files::write_atomically;
use numbers::{Number, numbers};
pub use page::machines;
use page::{Broken, Drawn};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The files of a report.
pub struct Written {
    /// The page.
    pub page: PathBuf,
    /// Number of figures.
    pub figures: usize,
    /// How runs were grouped, and which are left out.
    pub notes: Vec<String>,
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
    let (broken, page) = (page::broken(&groups, lines), directory.join("index.html"));
    write(&page, page::page(&groups, &drawn, &broken, lines))?;
    write(&directory.join("figures.tex"), latex::fragment(&figures))?;
    let numbers = numbers(&groups);
    write(&directory.join("numbers.tex"), numbers::tex(&numbers))?;
    let models: String = models::tables(&groups).iter().map(latex::table).collect();
    write(&directory.join("models.tex"), models)?;
    write(&directory.join("models.csv"), models::csv(&groups))?;
    let notes = groups.notes.into_iter().chain(left_over(&place, &figures)?).collect();
    Ok(Written { page, figures: figures.len(), notes, broken, numbers })
}

/// Names the figures of a directory that are not among these, such as those of an earlier report.
fn left_over(place: &Path, figures: &[Figure]) -> io::Result<Option<String>> {
    let names = fs::read_dir(place)?.map(|entry| Ok(entry?.file_name().display().to_string()));
    let mut names: Vec<String> = names.collect::<io::Result<_>>()?;
    let is_other = |id: &str| figures.iter().all(|figure| figure.id != id);
    names.retain(|name| name.strip_suffix(".svg").is_some_and(is_other));
    names.sort();
    let (of, names) = ("figures/ also has figures that are not of this report", names.join(", "));
    Ok((!names.is_empty()).then(|| format!("{of}: {names}")))
}

/// Writes a figure in all formats; returns it with its SVG.
fn write_figure<'a>(directory: &Path, figure: &'a Figure) -> io::Result<Drawn<'a>> {
    let svg = svg::svg(figure);
    let path = |extension: &str| directory.join(format!("{}.{extension}", figure.id));
    write(&path("csv"), latex::csv(figure))?;
    write(&path("tex"), latex::tex(figure))?;
    for (extension, format) in FORMATS {
        write(&path(extension), format(&svg).map_err(io::Error::other)?)?;
    }
    Ok((figure, svg))
}

fn write(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    write_atomically(path, |out| out.write_all(content.as_ref())).map_err(|e| named(path, &e))
}
