//! `harness picture`: draws a slice of a mesh, a view in three dimensions, or the pictures of the paper.

use super::meshed::MeshArguments;
use super::paper;
use super::selection::SelectionArguments;
use clap::Args;
use contract::failure::EXIT_HOLDS;
use contract::failure::Failure;
use contract::octant::LEVEL_MAX;
use export::mesh::Mesh;
use report::picture::colour::Colour;
use report::picture::{Format, Picture, Request, svg, write};
use run::engine::layout::{Layout, Ranks, SERIAL};
use std::io;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
A slice is drawn at page width with the section of the geometry, axes and a legend; cells too small to be seen \
are merged, and their greatest value counts. A view shows the slice and the surface of the geometry in three dimensions. An existing file is replaced.

Examples:
  harness picture uav-small --out uav.svg                             mesh a case and draw its middle
  harness picture body.toml --out nose.png --slice y=0 --zoom 8       closer, in another plane
  harness picture mesh --case body.toml --out mesh.pdf --colour side  a mesh on disk; without --case, no geometry is drawn
  harness picture uav-small --out ranks.svg --ranks 16 --colour rank --view  the partition in three dimensions
  harness picture uav-medium --paper --out pictures                   every step of the algorithm, and a page of them

Exit codes: 0 success; 2 invalid input or an unknown format; 3 the mesher is missing; 130 interrupted.";

/// `harness picture`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The mesh.
    #[command(flatten)]
    source: MeshArguments,
    /// The picture: .svg, .png or .pdf; with --paper a directory
    #[arg(short, long, value_name = "FILE|DIR")]
    out: PathBuf,
    /// What colours show
    #[arg(long, value_enum, default_value = "level")]
    colour: Colour,
    /// Magnification: edges of the root per edge of the picture, which is centred on the geometry. A view is close to it by itself
    #[arg(long, value_name = "X", default_value = "1", value_parser = zoom, conflicts_with = "clip")]
    zoom: f64,
    /// Draw a view in three dimensions
    #[arg(long)]
    view: bool,
    /// Simulated ranks that mesh a case
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    ranks: Option<u16>,
    /// Draw the base tree of a case
    #[arg(long)]
    ungraded: bool,
    /// Draw the pictures of the paper for a case, and a page of them
    #[arg(long, conflicts_with_all = ["view", "ranks", "ungraded", "zoom", "colour", "clip", "slice", "level_max", "side", "rank", "case"])]
    paper: bool,
    /// Which cells are drawn.
    #[command(flatten)]
    selection: SelectionArguments,
}

/// Draws; returns the exit code.
///
/// # Errors
/// If the mesh cannot be made or read, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    match arguments.paper {
        true => paper::draw(&arguments.source, &arguments.out)?,
        false => draw(arguments)?,
    }
    Ok(EXIT_HOLDS)
}

fn draw(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { source, out, ranks, ungraded, .. } = arguments;
    let format = requested(out)?;
    if Path::new(&source.mesh).is_dir() && (ranks.is_some() || *ungraded) {
        let why =
            "--ranks and --ungraded are for a case: a mesh on disk has its ranks and its tree";
        return Err(Failure::input(why));
    }
    let layout = match *ranks {
        Some(ranks) => Layout::on(Ranks::Simulated { ranks: ranks.into(), seed: 1 }),
        None => SERIAL.clone(),
    };
    let meshed = source.open(&layout, *ungraded)?;
    let mesh = Mesh::open(&meshed.dir)?;
    if let (Some(_), Some(case)) = (&source.case, &meshed.case) {
        mesh.require_case(case)?;
    }
    let request = Request {
        selection: arguments.selection.of(&mesh)?,
        body: meshed.case.as_ref().map(|case| &case.facets[..]),
        colour: arguments.colour,
        zoom: arguments.zoom,
        level_max: LEVEL_MAX,
        view: arguments.view,
    };
    let picture = Picture::collect(&mesh, &request)?;
    write(out, &format.bytes(&svg(&picture)).map_err(io::Error::other)?)?;
    println!("{}\n{}", picture.title(), out.display());
    if meshed.case.is_none() {
        println!("the geometry is not drawn: name its case with --case");
    }
    Ok(())
}

/// The format of the file, if its directory exists.
fn requested(out: &Path) -> Result<Format, String> {
    let format = Format::of(out)?;
    let directory = out.parent().filter(|d| !d.as_os_str().is_empty());
    match directory.filter(|d| !d.is_dir()) {
        Some(missing) => Err(format!("{} is not a directory: create it", missing.display())),
        None => Ok(format),
    }
}

fn zoom(text: &str) -> Result<f64, String> {
    let zoom = text.parse().ok().filter(|zoom: &f64| (1.0..=1e6).contains(zoom));
    zoom.ok_or_else(|| "give a number from 1 to 1e6".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zoom_is_at_least_one() {
        assert_eq!(zoom("2.5"), Ok(2.5));
        for wrong in ["0.5", "-1", "nan", "inf", ""] {
            assert!(zoom(wrong).is_err(), "{wrong}");
        }
    }
}
