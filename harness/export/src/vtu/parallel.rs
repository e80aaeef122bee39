//! A `.pvtu` file and the directory of `.vtu` files that it names.
//!
//! `NAME.pvtu` names `NAME_pieces/NAME_0000.vtu` and so on. The directory is filled under another name. An older one in
//! its place is deleted if this program wrote every file in it, and is otherwise an error. The old `NAME.pvtu` is deleted before its
//! directory, and the new one gets its name last, so a `.pvtu` always has its files. If that fails, neither the old nor the new export is left.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

use contract::files::{self, Staging};

use super::file::VtuFile;
use super::header::MARK;
use super::{PIECE, content, encode};
use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::selection::Selection;
use contract::failure::Failure;

/// Pieces in one file.
const PIECES: usize = 4;

/// Writes a `.pvtu` file and the directory that it names.
///
/// # Errors
/// If no leaf is selected, if the mesh cannot be read or a file cannot be written, if the directory exists and has files of
/// another program, or if the user interrupts.
pub fn write_files(
    mesh: &Mesh,
    selection: &Selection,
    path: &Path,
    options: &Options<'_>,
) -> Result<Summary, Failure> {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).ok_or_else(|| {
        let path = path.display();
        Failure::input(format!("{path}: the name is not UTF-8: choose another"))
    })?;
    let folder = format!("{stem}_pieces");
    let directory = path.with_file_name(&folder);
    refuse_other_files(&directory)?;
    let leaves = mesh.count(selection, &|| options.check())?;
    let mut left = leaves.div_ceil(PIECE) as usize;
    let named = |error| Failure::at(&directory, error);
    let place = Staging::beside(&directory).map_err(named)?;
    let (mut whole, mut bytes, mut files) = (content(mesh), 0, Vec::new());
    let mut begun: Option<VtuFile> = None;
    encode(mesh, selection, leaves, options, &mut |piece| {
        let mut file = match begun.take() {
            Some(file) => file,
            None => {
                let name = format!("{stem}_{:04}.vtu", files.len());
                let file = File::create_new(place.path().join(&name)).map_err(named)?;
                files.push(format!("{folder}/{name}"));
                VtuFile::begin(file, content(mesh), PIECES.min(left)).map_err(named)?
            }
        };
        file.append(&piece).map_err(named)?;
        whole.digest.merge(piece.digest);
        left -= 1;
        match file.is_full() {
            true => bytes += file.finish().map_err(named)?,
            false => begun = Some(file),
        }
        Ok(())
    })?;
    options.check()?;
    let xml = whole.pvtu(&files);
    place.publish(|staged| publish(path, &directory, staged, &xml))?;
    bytes += xml.len() as u64;
    Ok(Summary { leaves, files: files.len() as u64 + 1, bytes, notes: Vec::new() })
}

/// An error if the directory exists and has a file that an earlier export did not write.
fn refuse_other_files(directory: &Path) -> Result<(), Failure> {
    let entries = match fs::read_dir(directory) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(to_write(directory))?,
    };
    for entry in entries {
        let path = entry.map_err(to_write(directory))?.path();
        if !is_ours(&path).unwrap_or(false) {
            return Err(Failure::input(format!(
                "{}: was not written by harness export, and its directory would be replaced: move it, or choose \
                 another name for the export",
                path.display()
            )));
        }
    }
    Ok(())
}

/// Gives all files their final names.
fn publish(path: &Path, directory: &Path, staged: &Path, xml: &str) -> Result<(), Failure> {
    let synchronised = File::open(staged).and_then(|directory| directory.sync_all());
    synchronised.map_err(to_write(directory))?;
    refuse_other_files(directory)?;
    let mut is_replaced = false;
    // Whatever may fail for want of space comes before anything is deleted.
    let published = files::fill_atomically(path, to_write(path), |file| {
        file.write_all(xml.as_bytes()).map_err(to_write(path))?;
        delete(|| fs::remove_file(path)).map_err(to_write(path))?;
        delete(|| fs::remove_dir_all(directory)).map_err(to_write(directory))?;
        fs::rename(staged, directory).map_err(to_write(directory))?;
        is_replaced = true;
        Ok(())
    });
    if is_replaced && published.is_err() {
        let _ = fs::remove_dir_all(directory);
    }
    published
}

/// Makes an error of a file that names it.
fn to_write(path: &Path) -> impl Fn(io::Error) -> Failure + '_ {
    |error| Failure::at(path, error)
}

/// Deletes something that may be missing.
fn delete(delete: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
    match delete() {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Whether the file carries the mark of an export.
fn is_ours(path: &Path) -> io::Result<bool> {
    let mut head = Vec::new();
    File::open(path)?.take(200).read_to_end(&mut head)?;
    Ok(head.windows(MARK.len()).any(|bytes| bytes == MARK.as_bytes()))
}
