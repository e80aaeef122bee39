//! Fuzz targets: every reader of a file that somebody else may have written, and the mesher against the reference.
//!
//! A target is a function of some bytes. It panics if it has found a fault: programs that read a file differently, or a mesh that is not
//! that of the definition. A reader's own panic, an allocation beyond the limit of `ci/fuzz`, and an input that takes seconds are faults, too.
//! `ci/fuzz` generates inputs with libFuzzer; the inputs in `corpus` are tried by an ordinary test.

pub mod drawn;
mod targets;

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub use targets::TARGETS;

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, which is that of its file in the corpus.
    pub name: &'static str,
    /// Tries an input; returns whether it was accepted. Panics if it has found a fault.
    pub run: fn(&mut Scratch, &[u8]) -> bool,
}

impl Target {
    /// The target with a name.
    ///
    /// # Panics
    /// If there is none.
    pub const fn named(name: &str) -> Self {
        let mut at = 0;
        while !is_same(TARGETS[at].name.as_bytes(), name.as_bytes()) {
            at += 1;
        }
        TARGETS[at]
    }
}

/// Whether the bytes are the same; `==` is not constant.
const fn is_same(a: &[u8], b: &[u8]) -> bool {
    match (a, b) {
        ([], []) => true,
        ([a, rest_of_a @ ..], [b, rest_of_b @ ..]) => *a == *b && is_same(rest_of_a, rest_of_b),
        _ => false,
    }
}

/// A temporary directory whose files are rewritten in place: creating one takes ten times as long. `TMPDIR` should be in memory.
#[derive(Debug)]
pub struct Scratch {
    place: TempDir,
    files: Vec<(PathBuf, File, usize)>,
}

impl Default for Scratch {
    /// An empty directory.
    fn default() -> Self {
        let place = tempfile::tempdir().expect("a temporary directory");
        Self { place, files: Vec::new() }
    }
}

impl Scratch {
    /// The directory.
    pub fn path(&self) -> &Path {
        self.place.path()
    }

    /// The file with this name, which may be below the directory, with these bytes.
    pub fn file(&mut self, name: &str, bytes: &[u8]) -> &Path {
        let path = self.place.path().join(name);
        let index = self.files.iter().position(|(known, ..)| *known == path).unwrap_or_else(|| {
            fs::create_dir_all(path.parent().expect("a directory")).expect("a writable directory");
            self.files.push((path.clone(), File::create(&path).expect("a writable directory"), 0));
            self.files.len() - 1
        });
        let (path, file, length) = &mut self.files[index];
        if bytes.len() < *length {
            file.set_len(bytes.len() as u64).expect("a writable file");
        }
        *length = bytes.len();
        file.write_all_at(bytes, 0).expect("room for a small file");
        path
    }
}
