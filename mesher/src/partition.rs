//! Dealing base leaves out to ranks: what they weigh, and where the cuts go.

#[cfg(feature = "metis")]
use crate::base::face_neighbours;
use crate::base::middle;
use crate::comm::{Comm, agree};
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::Rules;
use crate::octant::{corner, edge, start57};
use crate::share::BaseLeaf;

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
}

/// Weights of the base leaves, the same on all ranks; `heavy` tells which are split. Collective.
pub fn weigh(
    leaves: &[BaseLeaf],
    heavy: &[bool],
    facets: &[Facet],
    rules: &Rules,
    weights: Weights,
    comm: &dyn Comm,
) -> Vec<u64> {
    if weights == Weights::Unit {
        return vec![1; leaves.len()];
    }
    let starts: Vec<u64> = leaves.iter().map(|b| start57(b.level, b.code)).collect();
    let mut area = vec![0u64; leaves.len()];
    // Area is summed in 1/1024 of a finest cell's square: sums of integers do not depend on the order.
    let cell = edge(rules.level_surface) as f64;
    for f in facets {
        if let Some(at) = middle(f) {
            let n = f.normal().map(|c| c as f64);
            let cells = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt() * 0.5 / (cell * cell);
            area[starts.partition_point(|&s| s <= at) - 1] += (cells * 1024.0) as u64;
        }
    }
    let mut sums = vec![0u64; leaves.len()];
    for theirs in comm.all_gather(&area) {
        sums.iter_mut().zip(theirs).for_each(|(s, t)| *s += t);
    }
    let layers = 2 * u64::from(rules.layer_cells_min) + 1;
    leaves
        .iter()
        .zip(heavy)
        .zip(sums)
        .map(|((b, heavy), a)| 1 + u64::from(*heavy) * 8 + a * layers / 1024 + boxed(b, rules))
        .collect()
}

/// Leaves that the boxes ask for in a base leaf.
fn boxed(b: &BaseLeaf, rules: &Rules) -> u64 {
    let (at, h) = (corner(b.level, b.code), edge(b.level));
    let volume = |e: &crate::lattice::ExtentBox| {
        let span = |a: usize| (e.max[a].min(at[a] + h) - e.min[a].max(at[a])).max(0);
        (0..3).map(|a| (span(a) as u64).div_ceil(edge(e.level) as u64)).product::<u64>()
    };
    rules.boxes.iter().map(volume).max().unwrap_or(0)
}

/// The owner of each base leaf, the same on all ranks. Collective.
pub fn assign(
    leaves: &[BaseLeaf],
    weights: &[u64],
    partitioner: Partitioner,
    comm: &dyn Comm,
) -> Result<Vec<usize>, Error> {
    match partitioner {
        _ if comm.size() == 1 => Ok(vec![0; leaves.len()]),
        Partitioner::Morton => Ok(morton_cuts(weights, comm.size())),
        Partitioner::Metis => {
            let made = if comm.rank() == 0 {
                metis_cuts(leaves, weights, comm.size())
            } else {
                Ok(Vec::new())
            };
            let mine: Vec<u64> = agree(comm, made)?.into_iter().map(|o| o as u64).collect();
            Ok(comm.all_gather(&mine).concat().into_iter().map(|o| o as usize).collect())
        }
    }
}

/// Cuts the curve so that each leaf goes to the rank whose equal share its middle falls in.
fn morton_cuts(weights: &[u64], ranks: usize) -> Vec<usize> {
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let mut before = 0u128;
    let mut owner = |w: &u64| {
        let middle = 2 * before + u128::from(*w);
        before += u128::from(*w);
        ((middle * ranks as u128 / (2 * total)) as usize).min(ranks - 1)
    };
    weights.iter().map(&mut owner).collect()
}

/// Fewest base leaves per rank that METIS is asked to cut, of as many equal ones as they amount to.
#[cfg(feature = "metis")]
const LEAVES_PER_RANK_METIS: usize = 8;

#[cfg(feature = "metis")]
fn metis_cuts(leaves: &[BaseLeaf], weights: &[u64], ranks: usize) -> Result<Vec<usize>, Error> {
    // METIS bisects again and again, and complains on standard output about parts that get nothing:
    // with hardly more leaves than ranks, or few that hold nearly all, the curve's cuts serve as well.
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let even: f64 = weights.iter().map(|&w| (w as f64 / total as f64).powi(2)).sum();
    if ((LEAVES_PER_RANK_METIS * ranks) as f64) * even > 1.0 {
        return Ok(morton_cuts(weights, ranks));
    }
    let starts: Vec<u64> = leaves.iter().map(|b| start57(b.level, b.code)).collect();
    let pairs = face_neighbours(leaves, |s| starts.partition_point(|&t| t <= s) - 1);
    let (xadj, adjncy) = adjacency(leaves.len(), &pairs);
    // METIS counts in i32 and puts nearly all in one part when the sum overflows, saying nothing.
    let scale = |w: u64| (u128::from(w) * (1 << 30) / total.max(1 << 30)).max(1) as metis::Idx;
    let scaled: Vec<metis::Idx> = weights.iter().map(|&w| scale(w)).collect();
    let mut parts = vec![0 as metis::Idx; leaves.len()];
    let failed = |e: &dyn std::fmt::Display| {
        Error::input(format!("METIS failed ({e}): use --partitioner morton"))
    };
    metis::Graph::new(1, ranks as metis::Idx, &xadj, &adjncy)
        .map_err(|e| failed(&e))?
        .set_vwgt(&scaled)
        .set_option(metis::option::Seed(1))
        .part_kway(&mut parts)
        .map_err(|e| failed(&e))?;
    Ok(parts.into_iter().map(|p| p as usize).collect())
}

#[cfg(not(feature = "metis"))]
fn metis_cuts(_: &[BaseLeaf], _: &[u64], _: usize) -> Result<Vec<usize>, Error> {
    Err(Error::input(
        "this mesher was built without METIS: use --partitioner morton, or build with --features metis",
    ))
}

/// The graph in METIS's compressed form.
#[cfg(feature = "metis")]
fn adjacency(vertices: usize, pairs: &[(usize, usize)]) -> (Vec<metis::Idx>, Vec<metis::Idx>) {
    let mut lists = vec![Vec::new(); vertices];
    for &(a, b) in pairs {
        lists[a].push(b as metis::Idx);
        lists[b].push(a as metis::Idx);
    }
    let mut xadj = vec![0];
    for list in &lists {
        xadj.push(xadj[xadj.len() - 1] + list.len() as metis::Idx);
    }
    (xadj, lists.concat())
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

    #[cfg(feature = "metis")]
    #[test]
    fn metis_is_fair_however_heavy_the_leaves() {
        let leaves: Vec<BaseLeaf> =
            (0..512).map(|code| BaseLeaf { level: 3, code, owner: 0 }).collect();
        for weight in [1, 1 << 40] {
            let owners = metis_cuts(&leaves, &[weight; 512], 8).unwrap();
            for r in 0..8 {
                let n = owners.iter().filter(|&&o| o == r).count();
                assert!((55..=75).contains(&n), "{n} of 64");
            }
        }
    }
}
