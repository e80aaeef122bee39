//! `harness picture`: draws a slice of a mesh.

use super::meshed::MeshArguments;
use crate::options::{Output, SelectionArguments, number_in};
use clap::Args;
use contract::failure::{EXIT_HOLDS, Failure};
use contract::mesh::Mesh;
use report::picture::colour::Colour;
use report::picture::{Picture, Request, format_of, write};
use run::engine::layout::{Layout, Ranks, SERIAL};
use std::io;
use std::path::Path;

const EXAMPLES: &str = "\
A slice is drawn at page width with the section of the geometry, axes and a legend; cells too small to be seen \
are merged, and their greatest value counts. An existing file is replaced.

Examples:
  harness picture uav-small --out uav.svg                             mesh a case and draw its middle
  harness picture body.toml --out nose.png --slice y=0 --zoom 8       closer, in another plane
  harness picture mesh --case body.toml --out mesh.pdf --colour side  a mesh on disk; without --case, no geometry is drawn
  harness picture uav-small --out ranks.svg --ranks 16 --colour rank  the partition

Exit codes: 0 success; 2 invalid input or an unknown format; 3 the mesher is missing; 130 interrupted.";

/// `harness picture`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The mesh.
    #[command(flatten)]
    source: MeshArguments,
    /// The picture: .svg, .png or .pdf
    #[arg(short, long, value_name = "FILE")]
    out: Output,
    /// What colours show
    #[arg(long, value_enum, default_value = "level")]
    colour: Colour,
    /// Magnification: edges of the root per edge of the picture, which is centred on the geometry
    #[arg(long, value_name = "X", default_value = "1", value_parser = number_in(1.0..=1e6), conflicts_with = "clip")]
    zoom: f64,
    /// Simulated ranks that mesh a case
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    ranks: Option<u16>,
    /// Draw the base tree of a case
    #[arg(long)]
    ungraded: bool,
    /// Which cells are drawn.
    #[command(flatten)]
    selection: SelectionArguments,
}

/// Draws; returns the exit code.
///
/// # Errors
/// If the mesh cannot be made or read, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let Arguments { source, out, ranks, ungraded, .. } = arguments;
    let format = format_of(out)?;
    if Path::new(&source.mesh).is_dir() && (ranks.is_some() || *ungraded) {
        let why =
            "--ranks and --ungraded are for a case: a mesh on disk has its ranks and its tree";
        return Err(Failure::input(why));
    }
    let layout = match *ranks {
        Some(ranks) => Layout::on(Ranks::Simulated { ranks: ranks.into(), seed: 1 }),
        None => SERIAL.clone(),
    };
    let (meshed, case) = source.open(&layout, *ungraded)?;
    let mesh = Mesh::open(&meshed.dir)?;
    if let (Some(_), Some(case)) = (&source.case, &case) {
        mesh.require_case(case)?;
    }
    let request = Request {
        selection: arguments.selection.of(&mesh)?,
        body: case.as_ref().map(|case| &case.facets[..]),
        colour: arguments.colour,
        zoom: arguments.zoom,
    };
    let picture = Picture::collect(&mesh, &request)?;
    write(out, &format(&picture.svg()).map_err(io::Error::other)?)?;
    println!("{}\n{}", picture.title(), out.display());
    if case.is_none() {
        println!("the geometry is not drawn: name its case with --case");
    }
    Ok(EXIT_HOLDS)
}
