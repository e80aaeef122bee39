//! `harness picture`: draws a slice of a mesh.

use crate::options::{MeshArguments, Output, SelectionArguments, examples, number_in};
use crate::output::put;
use clap::Args;
use contract::failure::{EXIT_HOLDS, Result};
use contract::mesh::Mesh;
use report::picture::colour::Colour;
use report::picture::{Picture, Request, format_of};
use run::engine::layout::{Layout, Ranks, SERIAL};

/// `harness picture`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/picture.md")))]
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
pub fn run(arguments: &Arguments) -> Result<u8> {
    let Arguments { source, out, ranks, ungraded, .. } = arguments;
    let format = format_of(out)?;
    let layout = match *ranks {
        Some(ranks) => Layout::on(Ranks::Simulated { ranks: ranks.into(), seed: 1 }),
        None => SERIAL.clone(),
    };
    let (meshed, case) = source.open(&layout, *ungraded)?;
    let mesh = Mesh::open(&meshed.dir)?;
    case.as_ref().map_or(Ok(()), |case| mesh.require_case(case))?;
    let request = Request {
        selection: arguments.selection.of(&mesh)?,
        body: case.as_ref().map(|case| &case.facets[..]),
        colour: arguments.colour,
        zoom: arguments.zoom,
    };
    let picture = Picture::collect(&mesh, &request)?;
    put(out, format(&picture.svg())?)?;
    println!("{}\n{}", picture.title(), out.display());
    if case.is_none() {
        println!("the geometry is not drawn: name its case with --case");
    }
    Ok(EXIT_HOLDS)
}
