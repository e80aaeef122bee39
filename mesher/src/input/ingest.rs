//! Reading geometry: every rank gets its slice of the facets.
//!
//! A file whose length is 84 + 50 bytes per facet is a binary STL file, whatever its header says; each rank reads its own records.
//! Text is read by rank 0, which sends each rank its slice. The same holds for generated shapes.
//!
//! Invariant: the slices of the ranks are contiguous, in the order of the ranks, and add up to all facets.

use crate::error::{Error, agree};
use crate::input::stl;
use bytemuck::cast_slice;
use geometries::{Facet, Generator};
use ranks::{Comm, MessageBuffer, first_other, uncounted};
use std::hash::Hash;
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The source of the facets.
#[derive(Clone, Debug)]
pub enum Source {
    /// An STL file.
    Stl(PathBuf),
    /// A shape that needs no file.
    Generated(Generator),
    /// Facets in memory: all of them, on each rank.
    Given(Vec<Facet>),
}

/// A rank's slice of the facets.
pub struct Slice {
    /// The facets, all finite.
    pub facets: Vec<Facet>,
    /// Index of the first one in the whole geometry.
    pub first: u64,
    /// Number of facets on all ranks.
    pub total: u64,
}

/// The name of a source, for errors.
fn name(source: &Source) -> &Path {
    if let Source::Stl(path) = source { path } else { Path::new("facets") }
}

/// Reads this rank's slice. Collective.
///
/// # Errors
/// If the ranks have different geometries, the file cannot be read or is no STL file, or a coordinate is not finite.
pub fn read(source: &Source, comm: &dyn Comm) -> Result<Slice, Error> {
    agree_on(source, comm)?;
    let slice = match source {
        Source::Stl(path) => {
            let file = agree(comm, stl::open(path))?;
            match file.binary {
                Some(total) => {
                    let (first, end) = range(total, comm.rank(), comm);
                    let facets = agree(comm, file.read(first, end))?;
                    Slice { facets, first, total }
                }
                None => distribute(comm, || file.read_text())?,
            }
        }
        Source::Generated(g) => distribute(comm, || g.facets().map_err(Error::input))?,
        Source::Given(facets) => distribute(comm, || Ok(facets.clone()))?,
    };
    agree(comm, stl::check_finite(&slice.facets, slice.first).map_err(|e| e.at(name(source))))?;
    Ok(slice)
}

/// The start and the end of a rank's slice of `total` facets.
fn range(total: u64, rank: usize, comm: &dyn Comm) -> (u64, u64) {
    let start = |r: usize| (u128::from(total) * r as u128 / comm.size() as u128) as u64;
    (start(rank), start(rank + 1))
}

/// Rank 0 makes the facets and sends each rank its slice. Collective.
fn distribute(
    comm: &dyn Comm,
    make: impl FnOnce() -> Result<Vec<Facet>, Error>,
) -> Result<Slice, Error> {
    let made = if comm.rank() == 0 { make() } else { Ok(Vec::new()) };
    let mut facets = agree(comm, made)?;
    let total = comm.sum(facets.len() as u64);
    let (first, end) = range(total, comm.rank(), comm);
    if comm.size() > 1 {
        let mut messages = MessageBuffer::default();
        for r in (1..comm.size()).filter(|_| comm.rank() == 0) {
            let (start, end) = range(total, r, comm);
            messages.write_values(r, &facets[start as usize..end as usize]);
        }
        // Rank 0 keeps its own slice, and the others have none yet.
        facets.truncate(end as usize);
        facets.shrink_to_fit();
        facets.extend(comm.sparse_all_to_all(messages).values::<Facet>());
    }
    Ok(Slice { facets, first, total })
}

/// Makes sure that all ranks have the same geometry: with different files they would mesh parts of different meshes. Nothing of this
/// is counted as communication of the mesher. Collective.
///
/// # Errors
/// Names the first rank with another one than rank 0.
fn agree_on(source: &Source, comm: &dyn Comm) -> Result<(), Error> {
    let other = uncounted(comm, || match source {
        // Copies on several machines differ in their times only.
        Source::Stl(path) => {
            first_other(comm, &identity(path)).and_then(|_| first_other(comm, &content(path)))
        }
        Source::Generated(_) => None,
        Source::Given(all) => first_other(comm, &cast_slice::<_, u8>(all)),
    });
    let Some(rank) = other else { return Ok(()) };
    let why = "has another geometry than rank 0: start all ranks with the same files or facets";
    Err(Error::input(format!("rank {rank} {why}")).at(name(source)))
}

/// What the ranks of one machine, or of one network file system, have in common if they read the same file.
fn identity(path: &Path) -> Result<impl Hash + PartialEq + use<>, ErrorKind> {
    let m = path.metadata().map_err(|e| e.kind())?;
    // Copies may be given the same time of modification, but not of the change of their status.
    Ok((m.ino(), m.len(), m.mtime(), m.mtime_nsec(), m.ctime(), m.ctime_nsec()))
}

/// The file's bytes, or why it cannot be read.
fn content(path: &Path) -> Result<Vec<u8>, ErrorKind> {
    // What is not a regular file may have no end.
    let bytes = if path.is_file() { std::fs::read(path) } else { Ok(Vec::new()) };
    bytes.map_err(|e| e.kind())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::sim;

    #[test]
    fn every_facet_is_in_one_slice_and_slices_are_in_order() {
        for total in [0usize, 1, 2, 5, 64, 101] {
            let facets: Vec<Facet> = (0..total).map(|i| [[i as f32, 0.5, -1.0]; 3]).collect();
            for ranks in [1, 2, 3, 7, 30] {
                let slices =
                    sim::run(ranks, 5, |c| read(&Source::Given(facets.clone()), c).unwrap());
                assert!(slices.iter().all(|s| s.total == total as u64));
                let all: Vec<Facet> = slices.iter().flat_map(|s| s.facets.clone()).collect();
                assert_eq!(all, facets);
            }
        }
    }

    #[test]
    fn copies_of_a_geometry_are_the_same_and_others_are_not() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        for (name, text) in [("a.stl", "solid"), ("b.stl", "solid"), ("c.stl", "Solid")] {
            std::fs::write(path(name), text).unwrap();
        }
        assert!(identity(&path("a.stl")) != identity(&path("b.stl")));
        assert_eq!(content(&path("a.stl")), content(&path("b.stl")));
        assert_ne!(content(&path("a.stl")), content(&path("c.stl")));
        assert_eq!(content(place.path()), Ok(Vec::new()), "what is no file is not read");
        assert_eq!(content(&path("absent")), content(place.path()));
        let found = |of: [&str; 2]| {
            let source = |rank: usize| Source::Stl(path(of[rank]));
            let agreed = sim::run(2, 1, |comm| agree_on(&source(comm.rank()), comm));
            agreed.into_iter().map(|agreed| agreed.map_err(|e| e.to_string())).collect::<Vec<_>>()
        };
        assert_eq!(found(["a.stl", "b.stl"]), [Ok(()), Ok(())]);
        assert!(found(["a.stl", "c.stl"]).iter().all(|agreed| {
            agreed.as_ref().is_err_and(|e| e.contains("rank 1 has another geometry"))
        }));
    }
    #[test]
    fn facets_in_memory_are_the_same_on_all_ranks_or_refused() {
        let read = |of: [usize; 2]| {
            let source = |rank: usize| Source::Given(vec![[[rank as f32; 3]; 3]; 4]);
            sim::run(2, 1, |comm| read(&source(of[comm.rank()]), comm).map(|slice| slice.total))
        };
        assert!(read([1, 1]).into_iter().all(|total| total.is_ok_and(|total| total == 4)));
        assert!(read([0, 1]).into_iter().all(|total| total.is_err()));
    }
}
