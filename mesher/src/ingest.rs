//! Reading geometry: every rank reads its share of the facets.
//!
//! A binary STL is told by its length, 84 + 50 per facet, whatever its header says; each rank reads
//! its own records. Text is read by rank 0, which deals the facets out; so are generated shapes.

use crate::comm::{Comm, MessageBuffer, agree};
use crate::error::Error;
use crate::stl;
use geometries::{Facet, Generator};
use std::path::PathBuf;

/// Where facets come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// An STL file.
    Stl(PathBuf),
    /// A shape that needs no file.
    Generated(Generator),
    /// Facets in memory.
    Given(Vec<Facet>),
}

/// A rank's share of the geometry.
#[derive(Clone, Debug)]
pub struct Share {
    /// The facets, all finite.
    pub facets: Vec<Facet>,
    /// Number of the first one in the whole geometry.
    pub first: u64,
    /// Number of facets on all ranks.
    pub total: u64,
}

/// Reads this rank's share. Collective.
pub fn read(source: &Source, comm: &dyn Comm) -> Result<Share, Error> {
    let ownership = match source {
        Source::Stl(path) => {
            let file = agree(comm, stl::open(path))?;
            match file.binary {
                Some(total) => {
                    let (first, end) = slice(total, comm);
                    let facets = agree(comm, file.read(first, end))?;
                    Share { facets, first, total }
                }
                None => deal(comm, || file.read_text())?,
            }
        }
        Source::Generated(g) => {
            deal(comm, || g.facets().map_err(|e| Error::input(format!("[generator]: {e}"))))?
        }
        Source::Given(facets) => deal(comm, || Ok(facets.clone()))?,
    };
    comm.agree(stl::check_finite(&ownership.facets, ownership.first))?;
    Ok(ownership)
}

/// This rank's part of `total` things: from the first to before the last.
fn slice(total: u64, comm: &dyn Comm) -> (u64, u64) {
    let at = |r: usize| (u128::from(total) * r as u128 / comm.size() as u128) as u64;
    (at(comm.rank()), at(comm.rank() + 1))
}

/// Rank 0 makes the facets and deals them out. Collective.
fn deal(comm: &dyn Comm, make: impl FnOnce() -> Result<Vec<Facet>, Error>) -> Result<Share, Error> {
    let made = if comm.rank() == 0 { make() } else { Ok(Vec::new()) };
    let facets = agree(comm, made)?;
    let total = comm.sum(facets.len() as u64);
    let (first, end) = slice(total, comm);
    if comm.size() == 1 {
        return Ok(Share { facets, first, total });
    }
    let out = if comm.rank() == 0 {
        let at = |r: usize| (u128::from(total) * r as u128 / comm.size() as u128) as usize;
        (1..comm.size()).map(|r| (r, pack(&facets[at(r)..at(r + 1)]))).collect()
    } else {
        MessageBuffer::default()
    };
    let heard = comm.sparse_all_to_all(out);
    let facets = if comm.rank() == 0 {
        facets[..end as usize].to_vec()
    } else {
        unpack(heard.words()).into_iter().take((end - first) as usize).collect()
    };
    Ok(Share { facets, first, total })
}

/// Coordinates, two to the word.
fn pack(facets: &[Facet]) -> impl Iterator<Item = u64> {
    let flat: &[f32] = facets.as_flattened().as_flattened();
    let word = |c: &[f32]| -> u64 {
        u64::from(c[0].to_bits()) | u64::from(c.get(1).map_or(0, |v| v.to_bits())) << 32
    };
    flat.chunks(2).map(word)
}

/// Inverse of [`pack`], with the padding's facet cut off by the caller's count.
fn unpack(words: &[u64]) -> Vec<Facet> {
    let flat: Vec<f32> = words
        .iter()
        .flat_map(|w| [f32::from_bits(*w as u32), f32::from_bits((w >> 32) as u32)])
        .collect();
    flat.chunks_exact(9)
        .map(|c| std::array::from_fn(|v| std::array::from_fn(|a| c[3 * v + a])))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::sim;

    #[test]
    fn every_facet_is_dealt_once_and_in_order() {
        for total in [0usize, 1, 2, 5, 64, 101] {
            let facets: Vec<Facet> = (0..total).map(|i| [[i as f32, 0.5, -1.0]; 3]).collect();
            for ranks in [1, 2, 3, 7, 30] {
                let shares =
                    sim::run(ranks, 5, |c| read(&Source::Given(facets.clone()), c).unwrap());
                assert!(shares.iter().all(|s| s.total == total as u64));
                let all: Vec<Facet> = shares.iter().flat_map(|s| s.facets.clone()).collect();
                assert_eq!(all, facets);
            }
        }
    }
}
