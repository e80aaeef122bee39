//! METIS: parts of equal weight with few faces between them.

use crate::error::Error;
use bricks::octant::{Level, neighbour, start57};
use std::sync::{Mutex, PoisonError};

/// METIS keeps its random state per process: threads that share it would change each other's parts.
static TURN: Mutex<()> = Mutex::new(());

/// Fewest base leaves per rank that METIS partitions, of equal ones or of their equivalent in unequal ones.
const LEAVES_PER_RANK_MIN: usize = 8;

/// Whether base leaves of these weights are enough for METIS, which bisects recursively, and prints complaints on standard
/// output about empty parts. With few leaves per rank, or few that have nearly all the weight, intervals of the curve are as good.
pub fn has_enough(weights: &[u64], ranks: usize) -> bool {
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let even: f64 = weights.iter().map(|&w| (w as f64 / total as f64).powi(2)).sum();
    ((LEAVES_PER_RANK_MIN * ranks) as f64) * even <= 1.0
}

/// The owner of each base leaf, given by level and code.
pub fn assign(leaves: &[(Level, u64)], weights: &[u64], ranks: usize) -> Result<Vec<usize>, Error> {
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let starts: Vec<u64> = leaves.iter().map(|&(l, code)| start57(l, code)).collect();
    let pairs = face_neighbours(leaves, |s| starts.partition_point(|&t| t <= s) - 1);
    let (xadj, adjncy) = adjacency(leaves.len(), &pairs);
    // METIS sums weights in i32 without a check for overflow.
    let scale = |w: u64| (u128::from(w) * (1 << 30) / total.max(1 << 30)).max(1) as metis::Idx;
    let scaled: Vec<metis::Idx> = weights.iter().map(|&w| scale(w)).collect();
    let mut parts = vec![0 as metis::Idx; leaves.len()];
    let failed = |e: &dyn std::fmt::Display| {
        Error::input(format!("METIS failed ({e}): use --partitioner morton"))
    };
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    metis::Graph::new(1, ranks as metis::Idx, &xadj, &adjncy)
        .map_err(|e| failed(&e))?
        .set_vwgt(&scaled)
        .set_option(metis::option::Seed(1))
        .part_kway(&mut parts)
        .map_err(|e| failed(&e))?;
    Ok(parts.into_iter().map(|p| p as usize).collect())
}

/// Pairs of base leaves that share part of a face, each once, the lower number first.
fn face_neighbours(
    leaves: &[(Level, u64)],
    leaf_index: impl Fn(u64) -> usize,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, &(level, code)) in leaves.iter().enumerate() {
        for axis in 0..3 {
            for up in [false, true] {
                let Some(n) = neighbour(level, code, axis, up) else {
                    continue;
                };
                let j = leaf_index(start57(level, n));
                // A finer neighbour adds the pair itself.
                if leaves[j].0 <= level {
                    pairs.push((i.min(j), i.max(j)));
                }
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// The graph in the compressed form of METIS.
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
    use bricks::octant::{LEVEL_MAX, position};

    #[test]
    fn parts_are_equal_whatever_the_sum_of_weights() {
        let leaves: Vec<(Level, u64)> = (0..512).map(|code| (3, code)).collect();
        for weight in [1, 1 << 40] {
            let owners = assign(&leaves, &[weight; 512], 8).unwrap();
            for r in 0..8 {
                let n = owners.iter().filter(|&&o| o == r).count();
                assert!((55..=75).contains(&n), "{n} of 64");
            }
        }
    }

    #[test]
    fn few_leaves_and_few_heavy_ones_are_divided_along_the_curve() {
        // As many equal leaves as 8 for each rank suffice.
        assert!(!has_enough(&[7; 31], 4) && has_enough(&[7; 32], 4));
        let mut heavy = [7; 512];
        heavy[99] = 512 * 7;
        assert!(!has_enough(&heavy, 4), "half of the weight is in one leaf");
    }

    #[test]
    fn a_uniform_base_tree_has_three_pairs_per_octant_but_for_its_faces() {
        let leaves: Vec<(Level, u64)> = (0..64).map(|code| (2, code)).collect();
        let pairs = face_neighbours(&leaves, |s| (s >> (3 * (LEVEL_MAX - 2))) as usize);
        assert_eq!(pairs.len(), 3 * 3 * 16);
        let apart = |a: usize, b: usize| -> i64 {
            let (p, q) = (position(a as u64), position(b as u64));
            (0..3).map(|i| (i64::from(p[i]) - i64::from(q[i])).abs()).sum()
        };
        assert!(pairs.iter().all(|&(a, b)| apart(a, b) == 1));
    }
}
