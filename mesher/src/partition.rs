//! Dealing base leaves out to ranks: what they weigh, and where the cuts go.

pub mod area;
pub mod curve;
pub mod initial;
#[cfg(feature = "metis")]
mod metis;
pub mod ownership;
pub mod repartition;

use crate::comm::{Comm, agree};
use crate::error::Error;
use crate::lattice::Rules;
use crate::octant::{Level, corner, edge};
use crate::partition::initial::cut::{Cut, Piece};

/// Who cuts the base tree into parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Partitioner {
    /// METIS on the graph of base leaves that share a face (the paper's choice).
    Metis,
    /// Equal pieces of the Morton curve.
    Morton,
}

/// What a base leaf weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Weights {
    /// 1 each: the paper's choice, and the comparison.
    Unit,
    /// By the leaves to expect: the facets' area in it in finest cells, with the layers around them,
    /// and the boxes' volume.
    Area,
    /// By the leaves of the same mesh made a few levels coarser.
    Rehearsal,
    /// By area at first; then by what there is, after refinement and once more after gradation. With METIS or a chosen
    /// level of base leaves, which stay where they are, the same as area.
    Rebalance,
}

/// Leaves of the mesh that a finest cell's face of a facet brings: a facet's cells come with the layers on its
/// kept side, a third of them being coarser.
pub fn thickness(rules: &Rules) -> u64 {
    (u64::from(rules.layer_cells_min) + 2) * 4 / 3
}

/// Leaves that the boxes ask for in an octant.
pub fn boxed(l: Level, code: u64, rules: &Rules) -> u64 {
    if rules.boxes.is_empty() {
        return 0;
    }
    let (at, h) = (corner(l, code), edge(l));
    let volume = |e: &crate::lattice::ExtentBox| {
        let span = |a: usize| (e.max[a].min(at[a] + h) - e.min[a].max(at[a])).max(0);
        (0..3).map(|a| (span(a) as u64).div_ceil(edge(e.level) as u64)).product::<u64>()
    };
    rules.boxes.iter().map(volume).max().unwrap_or(0)
}

/// The owner of each base leaf, the same on all ranks. Collective.
pub fn assign(
    cut: &Cut,
    weights: &[u64],
    partitioner: Partitioner,
    comm: &dyn Comm,
) -> Result<Vec<usize>, Error> {
    match partitioner {
        _ if comm.size() == 1 => Ok(vec![0; weights.len()]),
        Partitioner::Morton => Ok(morton_cuts(weights, comm.size())),
        Partitioner::Metis => {
            let made = if comm.rank() == 0 {
                metis_cuts(&cut.pieces, weights, comm.size())
            } else {
                Ok(Vec::new())
            };
            let mine: Vec<u64> = agree(comm, made)?.into_iter().map(|o| o as u64).collect();
            Ok(comm.all_gather(&mine).words().iter().map(|&o| o as usize).collect())
        }
    }
}

/// Cuts the curve so that each leaf goes to the rank whose equal share its middle falls in. Weights are not all
/// zero.
pub fn morton_cuts(weights: &[u64], ranks: usize) -> Vec<usize> {
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let mut before = 0u128;
    let mut owner = |w: &u64| {
        let middle = 2 * before + u128::from(*w);
        before += u128::from(*w);
        ((middle * ranks as u128 / (2 * total)) as usize).min(ranks - 1)
    };
    weights.iter().map(&mut owner).collect()
}

#[cfg(feature = "metis")]
fn metis_cuts(leaves: &[Piece], weights: &[u64], ranks: usize) -> Result<Vec<usize>, Error> {
    metis::cuts(leaves, weights, ranks)
}

#[cfg(not(feature = "metis"))]
fn metis_cuts(_: &[Piece], _: &[u64], _: usize) -> Result<Vec<usize>, Error> {
    Err(Error::input(
        "this mesher was built without METIS: use --partitioner morton, or build with --features metis",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_cuts_are_fair_and_in_order() {
        let owners = morton_cuts(&[1; 100], 7);
        assert!(owners.is_sorted());
        for r in 0..7 {
            let n = owners.iter().filter(|&&o| o == r).count();
            assert!((14..=15).contains(&n), "{n}");
        }
        assert!(morton_cuts(&[1, 1], 5).iter().all(|&o| o < 5));
        assert_eq!(morton_cuts(&[1 << 63, 1 << 63, 1 << 63], 3), [0, 1, 2]);
    }
}
