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

use std::cell::RefCell;
use std::path::Path;

use contract::digest::Digest;
use contract::files;
use contract::manifest::Sides;

use crate::error::ExportError;
use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::ordered::in_order;
use crate::pieces::{Piece, pieces};
use crate::selection::Selection;
use crate::written::Written;
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
) -> Result<Summary, ExportError> {
    let pieces = pieces(mesh, selection, PIECE, options)?;
    let named = |error| ExportError::write(path, error);
    let bytes = files::fill_atomically(path, named, |file| {
        let file = file.try_clone().map_err(named)?;
        let mut file = VtuFile::begin(file, content(mesh), pieces.len()).map_err(named)?;
        let written = encode(mesh, selection, &pieces, options, |_, piece| {
            file.append(&piece).map_err(named)
        })?;
        written.check_invariants(mesh, selection, leaves(&pieces));
        let bytes = file.finish().map_err(named)?;
        options.check()?;
        Ok(bytes)
    })?;
    Ok(Summary { leaves: leaves(&pieces), files: 1, bytes, notes: Vec::new() })
}

thread_local! {
    static ENCODER: RefCell<Encoder> = RefCell::default();
}

/// Encodes pieces on threads and hands them to `take` in order; returns all that was taken.
fn encode(
    mesh: &Mesh,
    selection: &Selection,
    pieces: &[Piece],
    options: &Options<'_>,
    mut take: impl FnMut(usize, Encoded) -> Result<(), ExportError> + Send,
) -> Result<Written, ExportError> {
    let content = content(mesh);
    let visitor = mesh.visitor();
    let make = |index: usize| {
        options.check()?;
        let keys = &pieces[index].keys;
        ENCODER.with_borrow_mut(|encoder| {
            encoder.leaves.clear();
            visitor.visit(keys.clone(), selection, &mut |leaf| {
                encoder.leaves.push(leaf);
                Ok::<(), ExportError>(())
            })?;
            options.check()?;
            Ok::<Encoded, ExportError>(encoder.encode(&content))
        })
    };
    let total = leaves(pieces);
    let mut written = Written::default();
    in_order(pieces.len(), options.jobs, make, |index, piece| {
        written.append(&piece.written);
        take(index, piece)?;
        options.watch.progress(written.cells, total);
        Ok(())
    })?;
    Ok(written)
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

fn leaves(pieces: &[Piece]) -> u64 {
    pieces.iter().map(|piece| piece.leaves).sum()
}
