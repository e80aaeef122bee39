//! Reading geometry: every rank gets its slice of the facets.
//!
//! A file whose length is 84 + 50 bytes per facet is a binary STL file, whatever its header says; each rank reads its own records.
//! Text is read by rank 0, which sends each rank its slice. The same holds for generated shapes.
//!
//! Invariant: the slices of the ranks are contiguous, in the order of the ranks, and add up to all facets.

use crate::error::Error;
use crate::input::stl;
use geometries::{Facet, Generator};
use ranks::{Comm, MessageBuffer, agree};
use std::path::PathBuf;

/// The source of the facets.
#[derive(Clone, Debug)]
pub enum Source {
    /// An STL file.
    Stl(PathBuf),
    /// A shape that needs no file.
    Generated(Generator),
    /// Facets in memory.
    Given(Vec<Facet>),
}

/// A rank's slice of the facets.
#[derive(Clone, Debug)]
pub struct Slice {
    /// The facets, all finite.
    pub facets: Vec<Facet>,
    /// Index of the first one in the whole geometry.
    pub first: u64,
    /// Number of facets on all ranks.
    pub total: u64,
}

/// Reads this rank's slice. Collective.
///
/// # Errors
/// If the file cannot be read or is no STL file, or a coordinate is not finite.
pub fn read(source: &Source, comm: &dyn Comm) -> Result<Slice, Error> {
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
        Source::Generated(g) => {
            distribute(comm, || g.facets().map_err(|e| Error::input(format!("[generator]: {e}"))))?
        }
        Source::Given(facets) => distribute(comm, || Ok(facets.clone()))?,
    };
    agree(comm, stl::check_finite(&slice.facets, slice.first))?;
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
    let facets = agree(comm, made)?;
    let total = comm.sum(facets.len() as u64);
    let (first, end) = range(total, comm.rank(), comm);
    if comm.size() == 1 {
        return Ok(Slice { facets, first, total });
    }
    let mut messages = MessageBuffer::default();
    if comm.rank() == 0 {
        for r in 1..comm.size() {
            let (start, end) = range(total, r, comm);
            messages.write_values(r, &facets[start as usize..end as usize]);
        }
    }
    let received = comm.sparse_all_to_all(messages);
    let facets = match comm.rank() {
        0 => facets[..end as usize].to_vec(),
        _ => received.values().collect(),
    };
    Ok(Slice { facets, first, total })
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
}
