//! Files for readers that take a path.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

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
