//! The output of a child process in a file whose size on disk is bounded.
//!
//! A child that floods its output would fill the disk. So blocks between the first and the last [`KEPT`] bytes are returned to
//! the file system while the child runs, and removed from the file when it has ended. The file's length, at which the child
//! appends, does not change meanwhile.

use rustix::fs::{FallocateFlags, fallocate};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Stdio;

/// Number of bytes that are kept at the beginning and at the end.
const KEPT: u64 = 1 << 20;

/// The file that receives a child's output.
#[derive(Debug)]
pub(super) struct Output {
    file: File,
    /// End of the bytes that were discarded.
    discarded: u64,
}

impl Output {
    /// Creates the file, or empties an existing one.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        File::create(path)?;
        let file = OpenOptions::new().read(true).append(true).open(path)?;
        Ok(Self { file, discarded: KEPT })
    }

    /// What the child writes to.
    ///
    /// # Errors
    /// If the process has too many open files.
    pub(super) fn stdio(&self) -> io::Result<Stdio> {
        self.file.try_clone().map(Stdio::from)
    }

    /// What was written so far, in bytes.
    pub(super) fn length(&self) -> u64 {
        self.file.metadata().map_or(0, |metadata| metadata.len())
    }

    /// The end of what was written after the first `before` bytes.
    pub(super) fn since(&self, before: u64) -> String {
        let length = self.length();
        let start = before.max(length.saturating_sub(KEPT));
        let mut end = vec![0; (length - start.min(length)) as usize];
        let _ = self.file.read_exact_at(&mut end, start);
        String::from_utf8_lossy(&end).into_owned()
    }

    /// Frees the disk space of what is neither at the beginning nor at the end. On a file system without holes in files, this
    /// has no effect.
    pub(super) fn discard_middle(&mut self) {
        let until = self.length().saturating_sub(KEPT);
        if until > self.discarded + KEPT {
            let flags = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
            let _ = fallocate(&self.file, flags, self.discarded, until - self.discarded);
            self.discarded = until;
        }
    }

    /// Leaves the beginning, a line that states how much is missing, and the end, if the child wrote more. The child and its
    /// descendants must have ended.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub(super) fn finish(mut self) -> io::Result<()> {
        let length = self.file.metadata()?.len();
        if length <= 2 * KEPT {
            return Ok(());
        }
        let mut end = vec![0; KEPT as usize];
        self.file.read_exact_at(&mut end, length - KEPT)?;
        self.file.set_len(KEPT)?;
        writeln!(self.file, "\n[{} bytes left out]", length - 2 * KEPT)?;
        self.file.write_all(&end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::MetadataExt;

    #[test]
    fn of_a_flood_the_beginning_and_the_end_remain() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("log");
        let mut output = Output::create(&path).unwrap();
        output.file.write_all(b"first").unwrap();
        let megabyte = vec![b'.'; 1 << 20];
        for _ in 0..64 {
            output.file.write_all(&megabyte).unwrap();
            output.discard_middle();
        }
        output.file.write_all(b"last").unwrap();
        let on_disk = 512 * fs::metadata(&path).unwrap().blocks();
        assert!(on_disk < 8 << 20, "{on_disk} bytes on disk");
        output.finish().unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("first.") && text.ends_with(".last"));
        assert!(text.len() < 3 << 20 && text.contains("bytes left out]"), "{}", text.len());
    }

    #[test]
    fn ordinary_output_is_unchanged() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("log");
        fs::write(&path, "of an earlier run").unwrap();
        let mut output = Output::create(&path).unwrap();
        output.file.write_all(b"yes\n").unwrap();
        output.discard_middle();
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"yes\n");
    }
}
