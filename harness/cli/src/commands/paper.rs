//! `harness picture --paper`: the pictures of the paper, made of one case.

use super::meshed::{Failure, MeshArguments, Meshed, input};
use super::view::{command, unread, unwritten, write_view};
use contract::files::{Staging, nearest_directory};
use contract::plain::{PlainCase, StlForm};
use export::mesh::Mesh;
use report::picture::format::{Format, put, write};
use report::picture::scene::Scene;
use report::picture::set::{Drawn, MEMBERS, Made, Member, Part, RANKS, page, request};
use report::picture::{Picture, Request, svg, tikz};
use run::engine::layout::{Layout, Ranks};
use run::engine::paths::Paths;
use run::engine::programs::Programs;
use run::verify::report::EXIT_MISSING;
use std::path::Path;
use std::{fs, io};
use toml::Value;

/// The page of the pictures.
const INDEX: &str = "index.html";

/// Meshes the case as often as the pictures require, and writes them and a page into the directory.
///
/// # Errors
/// If the case cannot be meshed or a file cannot be written.
pub fn draw(source: &MeshArguments, out: &Path) -> Result<(), Failure> {
    if Path::new(&source.mesh).is_dir() {
        let why = format!("{} is a directory: --paper meshes a case several times", source.mesh);
        return Err(input(why));
    }
    let Programs { engine, paths, .. } = source.engine.find()?;
    let path = paths.catalogue.case_file(&source.mesh, Path::new("")).map_err(input)?;
    let plain = PlainCase::read(&path).map_err(input)?;
    let named = |error| input(format!("{}: {error}", out.display()));
    let staging = Staging::inside(nearest_directory(out)).map_err(named)?;
    let layout = Layout::on(Ranks::Simulated { ranks: RANKS, seed: 1 });
    let mut drawn: Vec<Option<Drawn>> = MEMBERS.iter().map(|_| None).collect();
    for (i, first) in MEMBERS.iter().enumerate() {
        if drawn[i].is_some() {
            continue;
        }
        let place = tempfile::tempdir().map_err(|error| input(error.to_string()))?;
        let case = variant(&plain, first.made)
            .write(place.path(), StlForm::Any)
            .map_err(|error| input(error.to_string()))?;
        let meshed = source.engine.mesh(&engine, &case, &layout, first.made == Made::Base)?;
        for (member, drawn) in MEMBERS.iter().zip(&mut drawn) {
            if member.made == first.made {
                *drawn = Some(draw_member(member, &meshed, staging.path(), &paths, source)?);
            }
        }
    }
    let pictures: Vec<_> = MEMBERS.into_iter().zip(drawn.into_iter().flatten()).collect();
    let text = page(&source.mesh, &command(), &pictures);
    put(&staging.path().join(INDEX), text.as_bytes()).map_err(unwritten)?;
    staging.publish(|staged| publish(staged, out)).map_err(named)?;
    println!("{} pictures; the page is {}", pictures.len(), out.join(INDEX).display());
    Ok(())
}

/// Moves the files into the directory, which may have older ones.
fn publish(staged: &Path, out: &Path) -> io::Result<()> {
    fs::create_dir_all(out)?;
    for entry in fs::read_dir(staged)? {
        let entry = entry?;
        fs::rename(entry.path(), out.join(entry.file_name()))?;
    }
    Ok(())
}

/// The case whose final mesh or base tree is needed.
fn variant(plain: &PlainCase, made: Made) -> PlainCase {
    let mut case = plain.clone();
    match made {
        Made::Base | Made::Final => None,
        Made::Layers(n) => case.table.insert("layer_cells_min".into(), Value::Integer(n.into())),
        Made::WithoutCrossing => case.table.insert("keep_crossing".into(), Value::Boolean(false)),
    };
    case
}

fn draw_member(
    member: &Member,
    meshed: &Meshed,
    out: &Path,
    paths: &Paths,
    source: &MeshArguments,
) -> Result<Drawn, Failure> {
    let failed = |error: &dyn std::fmt::Display| input(format!("{}: {error}", member.name));
    let case = meshed.case.as_ref().expect("a case was meshed");
    let mesh = Mesh::open(&meshed.dir).map_err(unread)?;
    let (selection, zoom, level_max) = request(member.part, case);
    let (body, colour) = (Some(&case.facets[..]), member.colour);
    let request = Request { selection, body, colour, zoom, level_max, command: command() };
    let file = |extension: &str| out.join(format!("{}.{extension}", member.name));
    if matches!(member.part, Part::View | Part::ViewOfBody) {
        let mut scene = Scene::collect(&mesh, &request).map_err(unread)?;
        if member.part == Part::ViewOfBody {
            scene = scene.of_body();
        }
        write_view(&scene, &file("html"), paths, source)?;
        return match write_view(&scene, &file("png"), paths, source) {
            Ok(()) => {
                fs::read(file("png")).map(|png| Drawn::View(Some(png))).map_err(|e| failed(&e))
            }
            // Without pyvista the page lacks this picture, and its HTML file remains.
            Err((EXIT_MISSING, why)) => {
                eprintln!("harness: {why}");
                Ok(Drawn::View(None))
            }
            Err(other) => Err(other),
        };
    }
    let collect =
        |format: Format| Picture::collect(&mesh, &request, &format.detail()).map_err(unread);
    let tex = tikz(&collect(Format::Tikz)?);
    put(&file("tex"), tex.as_bytes()).map_err(unwritten)?;
    let picture = collect(Format::Svg)?;
    write(&picture, Format::Svg, &file("svg")).map_err(unwritten)?;
    Ok(Drawn::Slice(svg(&picture)))
}
