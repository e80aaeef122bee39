//! Agreement of all ranks on the geometry before they read it: with different files they would mesh parts of different meshes. Options
//! and case are those of rank 0.
//!
//! Nothing of this is counted as communication of the mesher.

use crate::error::Error;
use crate::input::ingest::Source;
use ranks::{Comm, gather, uncounted};
use std::fs::File;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Makes sure that all ranks will read the same geometry. Collective.
///
/// # Errors
/// Names the first rank with another one than rank 0.
pub fn on_geometry(source: &Source, comm: &dyn Comm) -> Result<(), Error> {
    let Source::Stl(path) = source else { return Ok(()) };
    let other = uncounted(comm, || {
        // Copies on several machines differ in their times only.
        other_rank(&identity(path), comm).and_then(|_| other_rank(&content(path), comm))
    });
    other.map_or(Ok(()), |rank| {
        Err(Error::input(format!(
            "rank {rank} has another file {} than rank 0: start all ranks with the same files",
            path.display()
        )))
    })
}

/// The first rank with another text than rank 0. Collective.
fn other_rank(text: &str, comm: &dyn Comm) -> Option<usize> {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    let digests = gather(comm, &[hasher.finish()]);
    digests.iter().position(|&digest| digest != digests[0])
}

/// What the ranks of one machine, or of one network file system, have in common if they read the same file.
fn identity(path: &Path) -> String {
    match path.metadata() {
        Ok(m) => format!("{} {} {} {}", m.ino(), m.len(), m.mtime(), m.mtime_nsec()),
        Err(e) => e.to_string(),
    }
}

/// The file's length and digest, or why it cannot be read.
fn content(path: &Path) -> String {
    let read = || {
        let mut file = File::open(path)?;
        let mut hasher = DefaultHasher::new();
        let (mut buffer, mut bytes) = (vec![0; 1 << 20], 0);
        // What is not a regular file may have no end.
        while file.metadata()?.is_file() {
            match file.read(&mut buffer)? {
                0 => break,
                n => {
                    hasher.write(&buffer[..n]);
                    bytes += n;
                }
            }
        }
        Ok(format!("of {bytes} bytes, digest {:016x}", hasher.finish()))
    };
    read().unwrap_or_else(|e: std::io::Error| format!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_a_geometry_are_the_same_and_others_are_not() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        for (name, text) in [("a.stl", "solid"), ("b.stl", "solid"), ("c.stl", "Solid")] {
            std::fs::write(path(name), text).unwrap();
        }
        assert_ne!(identity(&path("a.stl")), identity(&path("b.stl")));
        assert_eq!(content(&path("a.stl")), content(&path("b.stl")));
        assert_ne!(content(&path("a.stl")), content(&path("c.stl")));
        assert!(content(&path("absent")).contains("absent"));
        assert!(content(&path("a.stl")).starts_with("of 5 bytes, digest "));
        std::fs::write(path("large.stl"), vec![7; (2 << 20) + 3]).unwrap();
        assert!(content(&path("large.stl")).starts_with("of 2097155 bytes, digest "));
        assert_eq!(
            content(place.path()),
            format!("of 0 bytes, digest {:016x}", DefaultHasher::new().finish())
        );
    }
}
