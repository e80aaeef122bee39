//! `harness picture --paper`: the pictures of the paper, made of one case.

use super::meshed::MeshArguments;
use contract::failure::Failure;
use contract::files::{Staging, named, nearest_directory};
use contract::plain::{PlainCase, StlForm};
use export::mesh::Mesh;
use report::picture::set::{MEMBERS, Made, RANKS, page, request};
use report::picture::{NO_LEAF, Picture, svg, write};
use run::engine::layout::{Layout, Ranks};
use run::engine::programs::Programs;
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
        return Err(Failure::input(why));
    }
    let Programs { engine, paths, .. } = source.engine.find()?;
    let path = paths.catalogue.case_file(&source.mesh, Path::new(""))?;
    let plain = PlainCase::read(&path)?;
    let named = |error| named(out, &error);
    let staging = Staging::inside(nearest_directory(out)).map_err(named)?;
    let layout = Layout::on(Ranks::Simulated { ranks: RANKS, seed: 1 });
    let mut pictures = Vec::new();
    for members in MEMBERS.chunk_by(|a, b| a.1 == b.1) {
        let (_, made, ..) = members[0];
        let place = tempfile::tempdir()?;
        let case = variant(&plain, made).write(place.path(), StlForm::Any)?;
        let meshed = source.engine.mesh(&engine, &case, &layout, made == Made::Base)?;
        let case = meshed.case.as_ref().expect("a case was meshed");
        let mesh = Mesh::open(&meshed.dir)?;
        for member @ (name, _, part, colour, _) in members {
            match Picture::collect(&mesh, &request(*part, *colour, case)) {
                Ok(picture) => {
                    let svg = svg(&picture);
                    write(&staging.path().join(format!("{name}.svg")), svg.as_bytes())?;
                    pictures.push((*member, svg));
                }
                // In a close-up everything may be deleted.
                Err(failure) if failure.why == NO_LEAF => {
                    eprintln!("harness: {name} is left out: no leaf is in its slice");
                }
                Err(failure) => return Err(failure),
            }
        }
    }
    write(&staging.path().join(INDEX), page(&source.mesh, &pictures).as_bytes())?;
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
