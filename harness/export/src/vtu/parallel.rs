//! A `.pvtu` file and the directory of `.vtu` files that it names.
//!
//! `NAME.pvtu` names `NAME_pieces/NAME_0000.vtu` and so on. The directory is filled under another name. An older one in
//! its place is deleted if this program wrote every file in it, and is otherwise an error. The old `NAME.pvtu` is deleted before its
//! directory, and the new one gets its name last, so a `.pvtu` always has its files. If that fails, neither the old nor the new export is left.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use contract::files::{self, Staging};

use super::file::VtuFile;
use super::header::{Content, MARK};
use super::{PIECE, content, encode, leaves};
use crate::error::ExportError;
use crate::mesh::Mesh;
use crate::options::{Options, Summary};
use crate::pieces::pieces;
use crate::selection::Selection;

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
) -> Result<Summary, ExportError> {
    let names = Names::of(path)?;
    names.refuse_other_files()?;
    let pieces = pieces(mesh, selection, PIECE, options)?;
    let named = |error| ExportError::write(&names.directory, error);
    let place = Staging::beside(&names.directory).map_err(named)?;
    let (mut whole, mut bytes, mut written) = (content(mesh), 0, Vec::new());
    let mut begun: Option<VtuFile> = None;
    let cells = encode(mesh, selection, &pieces, options, |index, piece| {
        let mut file = match begun.take() {
            Some(file) => file,
            None => {
                let name = names.file(written.len());
                let file = File::create_new(place.path().join(&name)).map_err(named)?;
                written.push(name);
                let count = PIECES.min(pieces.len() - index);
                VtuFile::begin(file, content(mesh), count).map_err(named)?
            }
        };
        file.append(&piece).map_err(named)?;
        whole.digest.merge(piece.digest);
        match index % PIECES == PIECES - 1 || index == pieces.len() - 1 {
            true => bytes += file.finish().map_err(named)?,
            false => begun = Some(file),
        }
        Ok(())
    })?;
    cells.check_invariants(mesh, selection, leaves(&pieces));
    options.check()?;
    bytes += place.publish(|staged| names.publish(staged, &whole, &written))?;
    Ok(Summary {
        leaves: leaves(&pieces),
        files: written.len() as u64 + 1,
        bytes,
        notes: Vec::new(),
    })
}

/// The names of all files.
#[derive(Debug)]
struct Names {
    /// The `.pvtu` file.
    path: PathBuf,
    /// Its name without the extension.
    stem: String,
    /// The directory of the others.
    directory: PathBuf,
}

impl Names {
    fn of(path: &Path) -> Result<Self, ExportError> {
        let stem = path.file_stem().and_then(|stem| stem.to_str()).ok_or_else(|| {
            ExportError::Request(format!(
                "{}: the name is not UTF-8: choose another",
                path.display()
            ))
        })?;
        let directory = path.with_file_name(format!("{stem}_pieces"));
        Ok(Self { path: path.to_owned(), stem: stem.to_owned(), directory })
    }

    /// The name of a file in the directory.
    fn file(&self, index: usize) -> String {
        format!("{}_{index:04}.vtu", self.stem)
    }

    /// An error if the directory exists and has a file that an earlier export did not write.
    fn refuse_other_files(&self) -> Result<(), ExportError> {
        let entries = match fs::read_dir(&self.directory) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            entries => entries.map_err(|error| ExportError::write(&self.directory, error))?,
        };
        for entry in entries {
            let path = entry.map_err(|error| ExportError::write(&self.directory, error))?.path();
            if !is_ours(&path).unwrap_or(false) {
                return Err(ExportError::Request(format!(
                    "{}: was not written by harness export, and its directory would be replaced: move it, or choose \
                     another name for the export",
                    path.display()
                )));
            }
        }
        Ok(())
    }

    /// Gives all files their final names; returns the size of the `.pvtu` file.
    fn publish(
        &self,
        staged: &Path,
        content: &Content,
        written: &[String],
    ) -> Result<u64, ExportError> {
        let named = |error| ExportError::write(&self.directory, error);
        File::open(staged).and_then(|directory| directory.sync_all()).map_err(named)?;
        self.refuse_other_files()?;
        let directory = format!("{}_pieces", self.stem);
        let files: Vec<_> = written.iter().map(|name| format!("{directory}/{name}")).collect();
        let xml = content.pvtu(&files);
        let mut is_replaced = false;
        // Whatever may fail for want of space comes before anything is deleted.
        let published = files::fill_atomically(&self.path, to_write(&self.path), |file| {
            file.write_all(xml.as_bytes()).map_err(to_write(&self.path))?;
            delete(|| fs::remove_file(&self.path)).map_err(to_write(&self.path))?;
            delete(|| fs::remove_dir_all(&self.directory)).map_err(named)?;
            fs::rename(staged, &self.directory).map_err(named)?;
            is_replaced = true;
            Ok(())
        });
        if is_replaced && published.is_err() {
            let _ = fs::remove_dir_all(&self.directory);
        }
        published.map(|()| xml.len() as u64)
    }
}

/// Makes an error of a file that names it.
fn to_write(path: &Path) -> impl Fn(io::Error) -> ExportError + '_ {
    |error| ExportError::write(path, error)
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
