//! `harness near-body`: the surface that a mesh hands over to a near-body mesher, and its gap to the wall.

use super::selection::SelectionArguments;
use super::values::{Input, Output, read_case, with_extension};
use clap::Args;
use contract::failure::EXIT_HOLDS;
use contract::failure::Failure;
use contract::files::{Content, write_together};
use export::mesh::Mesh;
use export::near_body::files;
use export::near_body::front::{Face, front};
use export::near_body::gap::{Gap, gaps};
use export::near_body::polygons::Polygons;
use export::near_body::report::Report;
use run::engine::interrupt;
use std::path::Path;

/// `harness near-body`.
#[derive(Args, Debug)]
#[command(after_help = "\
The surface consists of the faces at which cells that no facet touches border a crossing cell, deleted or not. Its normals point \
away from the body. It is closed unless it reaches the root's boundary or a selection cuts it.

Examples:
  harness near-body mesh --case body.toml                       size, gap to the wall, distribution to ranks
  harness near-body mesh --case body.toml -o front.vtp          the same, and the surface with the gap of every face
  harness near-body mesh -o front.stl                           the surface as triangles

Exit codes: 0 success; 2 invalid input, or a mesh without such faces; 130 interrupted, after which no file remains.")]
pub struct Arguments {
    /// The mesh: a leaf-set directory
    mesh: Input,
    /// The case that was meshed, for the gap to the wall: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE")]
    case: Option<String>,
    /// Write the surface: triangles in binary STL (.stl), or polygons for VTK with level, side, rank, spacing and gap of every face (.vtp); may be repeated
    #[arg(short, long, value_name = "FILE.stl|FILE.vtp", value_parser = with_extension(&["stl", "vtp"]))]
    out: Vec<Output>,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Which cells' faces are considered.
    #[command(flatten)]
    selection: SelectionArguments,
}

/// Measures, prints and writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be read or has no such surface, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let check = || if interrupt::requested() { Err(Failure::interrupted()) } else { Ok(()) };
    let mesh = Mesh::open(&arguments.mesh)?;
    mesh.require_sides()?;
    let case = arguments.case.as_deref().map(read_case).transpose()?;
    case.iter().try_for_each(|case| mesh.require_case(case))?;
    let selection = arguments.selection.of(&mesh)?;
    let faces = front(&mesh, &selection, &check)?;
    if faces.is_empty() {
        let why = "no selected cell borders a crossing cell, deleted or not, so there is no surface to hand over";
        return Err(Failure::input(why));
    }
    let gaps = case.map(|case| gaps(&case, &faces, &check)).transpose()?;
    let polygons = Polygons::new(&faces);
    let report =
        Report::new(&mesh, &faces, &polygons, gaps.as_deref(), selection == Default::default())?;
    write(arguments, &mesh, &faces, &polygons, gaps.as_deref(), &report)?;
    print!("{report}");
    Ok(EXIT_HOLDS)
}

fn write(
    arguments: &Arguments,
    mesh: &Mesh,
    faces: &[Face],
    polygons: &Polygons,
    gaps: Option<&[Gap]>,
    report: &Report,
) -> Result<(), Failure> {
    let root = &mesh.manifest.root;
    let stl: Content<'_> = &|out| files::stl(root, faces, polygons, out);
    let vtp: Content<'_> = &|out| files::vtp(root, faces, polygons, gaps, mesh.has_ranks(), out);
    let json: Content<'_> = &|out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        out.write_all(b"\n")
    };
    let surface =
        |path: &Path| if path.extension().is_some_and(|e| e == "stl") { stl } else { vtp };
    let surfaces = arguments.out.iter().map(|path| (&**path, surface(path)));
    let report = arguments.json.iter().map(|path| (&**path, json));
    write_together(&surfaces.chain(report).collect::<Vec<_>>(), Failure::at)
}
