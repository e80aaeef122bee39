//! Cells as VTK's unstructured grids: `.vtu`, and `.pvtu` with files of its own.
//!
//! Each leaf is a hexahedron. The mesh is written in pieces of at most [`PIECE`] leaves, one per thread at a time, so memory does
//! not depend on the size of the mesh: about 60 MB per thread. A file depends on mesh and selection alone, and not on the
//! number of threads.
//!
//! - `header`: the XML, and which arrays exist; `piece`: the arrays; `points`: their numbers; `zlib`: their compression;
//! - `file`: one `.vtu` file; `parallel`: the files of a `.pvtu`.

mod file;
mod header;
mod parallel;
mod piece;
mod points;
mod zlib;

use std::path::Path;
use std::thread;

use contract::digest::Digest;
use contract::files;
use contract::manifest::Sides;

use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use crate::written::Written;
use contract::failure::Failure;
use file::VtuFile;
use header::Content;
use piece::{Encoded, Encoder};

pub use parallel::write_files;

/// Maximum number of leaves in a piece.
pub const PIECE: u64 = 1 << 19;

/// Writes one `.vtu` file.
///
/// # Errors
/// If no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write_file(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let leaves = mesh.count(selection, &|| options.check())?;
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, named, |file| {
        let file = file.try_clone().map_err(named)?;
        let mut file =
            VtuFile::begin(file, content(mesh), leaves.div_ceil(PIECE) as usize).map_err(named)?;
        encode(mesh, selection, leaves, options, &mut |piece| file.append(&piece).map_err(named))?;
        let bytes = file.finish().map_err(named)?;
        options.check()?;
        Ok(bytes)
    })?;
    Ok(Summary { leaves, files: 1, bytes, notes: Vec::new() })
}

/// Encodes the selected leaves, of which the number is known, and hands their pieces to `take` in order. As many pieces as there are threads are
/// read one after the other and encoded together.
fn encode(
    mesh: &Mesh,
    selection: &Selection,
    leaves: u64,
    options: &Options<'_>,
    take: &mut dyn FnMut(Encoded) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let content = &content(mesh);
    let (mut written, check) = (Written::default(), || options.check());
    let mut flush = |encoders: &mut [Encoder]| {
        check()?;
        let pieces: Vec<Encoded> = thread::scope(|scope| {
            let encode = |encoder| scope.spawn(move || Encoder::encode(encoder, content));
            let threads: Vec<_> = encoders.iter_mut().map(encode).collect();
            threads.into_iter().map(|thread| thread.join().expect("it does not panic")).collect()
        });
        for piece in pieces {
            check()?;
            written.append(&piece.written);
            take(piece)?;
            options.watch.progress(written.cells, leaves);
        }
        Ok::<(), Failure>(())
    };
    let jobs = options.jobs.get().min(leaves.div_ceil(PIECE) as usize);
    let mut encoders: Vec<Encoder> = (0..jobs).map(|_| Encoder::default()).collect();
    let mut filling = 0;
    mesh.visit(selection, &check, &mut |leaf| {
        if encoders[filling].leaves.len() as u64 == PIECE {
            filling += 1;
            if filling == jobs {
                flush(&mut encoders)?;
                encoders.iter_mut().for_each(|encoder| encoder.leaves.clear());
                filling = 0;
            }
        }
        encoders[filling].leaves.push(leaf);
        Ok(())
    })?;
    flush(&mut encoders[..=filling])?;
    written.check_invariants(mesh, selection, leaves);
    Ok(())
}

/// What files of this mesh state about themselves before they have leaves.
fn content(mesh: &Mesh) -> Content {
    Content {
        root: mesh.manifest.root,
        with_ranks: mesh.has_ranks(),
        with_sides: mesh.manifest.sides == Sides::Known,
        digest: Digest::default(),
    }
}
