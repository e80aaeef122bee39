//! `harness report DIR`: figures, one page, a LaTeX fragment and an artifact description, all from records.

pub mod balance;
pub mod canvas;
pub mod csv;
pub mod figure;
pub mod figures;
pub mod groups;
pub mod heat;
pub mod html;
pub mod latex;
pub mod lint;
pub mod matrix;
pub mod paint;
pub mod paper;
#[cfg(feature = "figures")]
pub mod raster;
pub mod scale;
pub mod scaling;
pub mod tikz;
pub mod trend;

use bench::experiments::entry::Line;
use bench::experiments::group::Groups;
use bench::statistics::change_points::Rules;
use bench::track::analyse;
use bench::track::history::Record;
use html::Drawn;
use lint::{Finding, Verdict};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Debug)]
pub struct Written {
    /// The page.
    pub page: PathBuf,
    /// Number of figures.
    pub figures: usize,
    /// What the lint found broken.
    pub broken: Vec<Finding>,
}

/// Writes everything that the lines of a record give into `directory`, and the trend of a history that is not empty.
///
/// # Errors
/// Where a file cannot be written.
pub fn report(directory: &Path, lines: &[Line], history: &[Record]) -> io::Result<Written> {
    let groups = Groups::of(lines);
    let tracked = analyse(history, &Rules::default());
    let mut figures = figures::figures(&groups);
    figures.extend(trend::figures(history, &tracked));
    let trend = (!history.is_empty()).then(|| trend::told(history, &tracked));
    let place = directory.join("figures");
    fs::create_dir_all(&place)?;
    let mut drawn = Vec::new();
    for figure in &figures {
        let (svg, csv) = (paint::svg(figure), csv::csv(figure));
        let put =
            |kind: &str, bytes: &[u8]| write(&place.join(format!("{}.{kind}", figure.id)), bytes);
        put("svg", svg.as_bytes())?;
        put("csv", csv.as_bytes())?;
        put("tex", tikz::tikz(figure).as_bytes())?;
        rasters(&svg, &put)?;
        drawn.push(Drawn { figure, svg, csv });
    }
    let findings = lint::lint(&figures, lines);
    let page = directory.join("index.html");
    let text = html::page(&groups, &drawn, &findings, lines, trend.as_deref());
    write(&page, text.as_bytes())?;
    write(&directory.join("figures.tex"), latex::fragment(&figures).as_bytes())?;
    write(&directory.join("artifact.md"), latex::artifact(&figures, lines).as_bytes())?;
    let broken = findings.into_iter().filter(|f| f.verdict == Verdict::Broken).collect();
    Ok(Written { page, figures: figures.len(), broken })
}

#[cfg(feature = "figures")]
fn rasters(svg: &str, put: &dyn Fn(&str, &[u8]) -> io::Result<()>) -> io::Result<()> {
    put("png", &raster::png(svg).map_err(io::Error::other)?)?;
    put("pdf", &raster::pdf(svg).map_err(io::Error::other)?)
}

#[cfg(not(feature = "figures"))]
fn rasters(_: &str, _: &dyn Fn(&str, &[u8]) -> io::Result<()>) -> io::Result<()> {
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::write(path, bytes)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}
