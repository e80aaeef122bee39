//! Agreement of all ranks on what they are to mesh, before they begin: ranks with different options or files would make different
//! calls and wait for each other forever, or mesh different parts of different meshes.
//!
//! Ranks compare digests. Only if these differ do they exchange what they differ in. Nothing of this is counted as communication
//! of the mesher.

use crate::case::Case;
use crate::error::Error;
use crate::ingest::Source;
use ranks::{Comm, agree, pack_bytes, uncounted, unpack_bytes};
use std::fs::File;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Makes sure that all ranks have understood their options, and that these are the same: `words` are the program's version and the
/// options as they were given. Collective.
///
/// # Errors
/// That of the lowest rank that has one, or the first difference.
pub fn on_options(
    understood: Result<(), Error>,
    words: &[String],
    comm: &dyn Comm,
) -> Result<(), Error> {
    uncounted(comm, || {
        agree(comm, understood)?;
        same("option", words, comm)
    })
}

/// Makes sure that all ranks have read the same case, and that they will read the same geometry. Collective.
///
/// # Errors
/// The first difference.
pub fn on_case(case: &Case, comm: &dyn Comm) -> Result<(), Error> {
    uncounted(comm, || {
        let lines = format!("{case:#?}").lines().map(|line| line.trim().into()).collect::<Vec<_>>();
        same("case", &lines, comm)?;
        match &case.source {
            Source::Stl(path) if same("file", &[identity(path)], comm).is_err() => {
                // Copies on several machines differ in their times only.
                same("geometry", &[content(path)], comm)
            }
            _ => Ok(()),
        }
    })
}

/// An error with the first difference between the words of rank 0 and those of the first rank that has others. Collective.
fn same(what: &str, words: &[String], comm: &dyn Comm) -> Result<(), Error> {
    let mut hasher = DefaultHasher::new();
    words.hash(&mut hasher);
    let digests = comm.all_gather(&[hasher.finish()]);
    let of_first = digests.words()[0];
    let Some(rank) = digests.words().iter().position(|&digest| digest != of_first) else {
        return Ok(());
    };
    let sends = [0, rank].contains(&comm.rank());
    let text = comm.all_gather(&if sends { pack(words) } else { Vec::new() });
    let [ours, theirs] = [0, rank].map(|r| unpack(text.of(r)));
    let differ = |&at: &usize| ours.get(at) != theirs.get(at);
    let at = (0..ours.len().max(theirs.len())).find(differ).unwrap_or_default();
    let shown = |words: &[String]| words.get(at).map_or("nothing".into(), |w| format!("`{w}`"));
    Err(Error::input(format!(
        "rank {rank} has the {what} {} where rank 0 has {}: start all ranks with the same options and files",
        shown(&theirs),
        shown(&ours)
    )))
}

fn pack(words: &[String]) -> Vec<u64> {
    let mut packed = Vec::new();
    words.iter().for_each(|w| pack_bytes(w.as_bytes(), &mut packed));
    packed
}

fn unpack(mut packed: &[u64]) -> Vec<String> {
    let mut words = Vec::new();
    while !packed.is_empty() {
        let (word, rest) = unpack_bytes(packed);
        words.push(String::from_utf8_lossy(&word).into_owned());
        packed = rest;
    }
    words
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
    use ranks::sim;

    #[test]
    fn the_first_difference_of_the_first_rank_is_named_on_all_ranks() {
        let errors = sim::run(5, 3, |comm| {
            let words = match comm.rank() {
                2 => ["1.0", "body.stl", "--check"].to_vec(),
                4 => ["1.0"].to_vec(),
                _ => ["1.0", "body.stl", "--quiet"].to_vec(),
            };
            let words: Vec<String> = words.into_iter().map(Into::into).collect();
            let error = on_options(Ok(()), &words, comm).unwrap_err().to_string();
            assert_eq!(comm.traffic().messages, 0);
            error
        });
        let expected = "rank 2 has the option `--check` where rank 0 has `--quiet`";
        assert!(errors.iter().all(|e| e.starts_with(expected)), "{errors:?}");
    }

    #[test]
    fn a_missing_option_and_an_error_are_differences() {
        let error = |wrong: usize| {
            let errors = sim::run(3, 1, |comm| {
                let words = ["1.0".to_owned(), "body.stl".to_owned()];
                let mine = if comm.rank() == 1 { &words[..1] } else { &words[..] };
                let understood = match comm.rank() == wrong {
                    true => Err(Error::input("what is that?")),
                    false => Ok(()),
                };
                on_options(understood, mine, comm).unwrap_err().to_string()
            });
            assert!(errors.iter().all(|e| *e == errors[0]));
            errors[0].clone()
        };
        assert!(error(9).starts_with("rank 1 has the option nothing where rank 0 has `body.stl`"));
        assert_eq!(error(2), "what is that?");
    }

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
