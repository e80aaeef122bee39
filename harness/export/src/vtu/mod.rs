//! Cells as VTK's unstructured grid, in one `.vtu` file.
//!
//! Each leaf is a hexahedron. The mesh is written in pieces of at most [`PIECE`] leaves, one per thread at a time, so memory does
//! not depend on the size of the mesh: about 60 MB per thread. A file depends on mesh and selection alone, and not on the
//! number of threads.
//!
//! - `header`: the XML, and which arrays exist; `piece`: the arrays; `points`: their numbers; `zlib`: their compression.

mod header;
mod piece;
mod points;
mod zlib;

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::thread;

use contract::digest::Digest;
use contract::files;

use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use crate::written::Written;
use contract::failure::Failure;
use header::{Content, Place};
use piece::{Encoded, Encoder};

/// Maximum number of leaves in a piece.
pub const PIECE: u64 = 1 << 19;

/// What follows the data.
const END: &str = "\n  </AppendedData>\n</VTKFile>\n";

/// Writes the file. The XML precedes the data that it describes. Its place is reserved for as many pieces as there will be, and it is
/// written last.
///
/// # Errors
/// If no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let leaves = mesh.count(selection, &|| options.check())?;
    let content = Content::of(mesh);
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, named, |file| {
        let (mut places, mut digest, mut data_bytes) = (Vec::new(), Digest::default(), 0);
        let longest = vec![Place::longest(); leaves.div_ceil(PIECE) as usize];
        let header_bytes = content.header(&longest, digest, 0).len();
        file.seek(SeekFrom::Start(header_bytes as u64)).map_err(named)?;
        encode(mesh, selection, leaves, &content, options, &mut |piece| {
            // The user's interrupt waits for a flush to end, so none may have much to flush.
            file.write_all(&piece.bytes).and_then(|()| file.sync_data()).map_err(named)?;
            places.push(piece.place(data_bytes));
            data_bytes += piece.bytes.len() as u64;
            digest.merge(piece.digest);
            Ok(())
        })?;
        let header = content.header(&places, digest, header_bytes);
        file.write_all(END.as_bytes()).map_err(named)?;
        file.seek(SeekFrom::Start(0)).map_err(named)?;
        file.write_all(header.as_bytes()).and_then(|()| file.sync_all()).map_err(named)?;
        options.check()?;
        Ok(header_bytes as u64 + data_bytes + END.len() as u64)
    })?;
    Ok(Summary { leaves, files: 1, bytes, notes: Vec::new() })
}

/// Encodes the selected leaves, of which the number is known, and hands their pieces to `take` in order. As many pieces as there are threads are
/// read one after the other and encoded together.
fn encode(
    mesh: &Mesh,
    selection: &Selection,
    leaves: u64,
    content: &Content,
    options: &Options<'_>,
    take: &mut dyn FnMut(Encoded) -> Result<(), Failure>,
) -> Result<(), Failure> {
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
