//! METIS: parts of equal weight with few faces between them.

use crate::error::{Error, agree};
use crate::partition::curve::{Bin, Boundary};
use bricks::octant::{LEVEL_MAX, Level, neighbour, start57};
use ranks::{Comm, gather};
use std::sync::{Mutex, PoisonError};

/// Fewest base leaves per rank that METIS partitions, of equal ones or of their equivalent in unequal ones.
const LEAVES_PER_RANK_MIN: usize = 8;

/// A base leaf: the code of its minimum corner, and its level.
pub type Leaf = (u64, Level);

/// The boundaries between base leaves, octants of a level, by METIS on rank 0. The leaves are the same on all ranks, and
/// [enough](has_enough). Collective; the result is the same on all ranks.
pub fn assign(leaves: &[Bin], level: Level, comm: &dyn Comm) -> Result<Vec<Boundary>, Error> {
    let octants: Vec<Leaf> = leaves.iter().map(|leaf| (leaf[0], level)).collect();
    let weights: Vec<u64> = leaves.iter().map(|leaf| leaf[1]).collect();
    let on_rank_0 = || parts(&octants, &weights, comm.size());
    let parts = agree(comm, if comm.rank() == 0 { on_rank_0() } else { Ok(Vec::new()) })?;
    Ok(boundaries(&octants, gather(comm, &parts)))
}

/// The boundaries between base leaves of weight 1, which may be of several levels, in their order along the curve.
pub fn assign_equal(leaves: &[Leaf], ranks: usize) -> Result<Vec<Boundary>, Error> {
    let enough = leaves.len() >= ranks;
    let parts = if enough { parts(leaves, &vec![1; leaves.len()], ranks)? } else { Vec::new() };
    let empty = (0..ranks as u64).filter(|rank| !parts.contains(rank)).count();
    if empty > 0 {
        return Err(Error::input(format!(
            "METIS leaves {empty} of {ranks} ranks without any of the {} cells of the base mesh: use fewer ranks, or a greater --level-base",
            leaves.len()
        )));
    }
    Ok(boundaries(leaves, parts))
}

fn boundaries(leaves: &[Leaf], parts: Vec<u64>) -> Vec<Boundary> {
    leaves.iter().map(|leaf| leaf.0).zip(parts.into_iter().map(|part| part as usize)).collect()
}

/// Whether base leaves are enough for METIS, which bisects recursively, and prints complaints on standard
/// output about empty parts. With few leaves per rank, or few that have nearly all the weight, intervals of the curve are as good.
pub fn has_enough(leaves: &[Bin], ranks: usize) -> bool {
    let total: u128 = leaves.iter().map(|leaf| u128::from(leaf[1])).sum();
    let even: f64 = leaves.iter().map(|leaf| (leaf[1] as f64 / total as f64).powi(2)).sum();
    ranks > 1 && total > 0 && ((LEAVES_PER_RANK_MIN * ranks) as f64) * even <= 1.0
}

/// The part of each base leaf.
fn parts(leaves: &[Leaf], weights: &[u64], ranks: usize) -> Result<Vec<u64>, Error> {
    let total: u128 = weights.iter().copied().map(u128::from).sum();
    let (xadj, adjncy) = graph(leaves);
    // METIS sums weights in i32 without a check for overflow.
    let scale = |w: u64| (u128::from(w) * (1 << 30) / total.max(1 << 30)).max(1) as metis::Idx;
    let scaled: Vec<metis::Idx> = weights.iter().copied().map(scale).collect();
    let mut parts = vec![0 as metis::Idx; leaves.len()];
    // METIS keeps its random state per process: threads that share it would change each other's parts.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut divide = || -> Result<_, Box<dyn std::error::Error>> {
        let graph = metis::Graph::new(1, ranks as metis::Idx, &xadj, &adjncy)?;
        Ok(graph.set_vwgt(&scaled).set_option(metis::option::Seed(1)).part_kway(&mut parts)?)
    };
    divide().map_err(|e| Error::input(format!("METIS failed ({e}): use --partitioner morton")))?;
    Ok(parts.into_iter().map(|part| part as u64).collect())
}

/// The graph of base leaves that share part of a face, in the compressed form of METIS.
fn graph(leaves: &[Leaf]) -> (Vec<metis::Idx>, Vec<metis::Idx>) {
    // The leaf that contains an octant.
    let leaf_at = |start: u64, l: Level| {
        let at = leaves.partition_point(|leaf| leaf.0 <= start).checked_sub(1)?;
        let (first, level) = leaves[at];
        (level <= l && start < first + start57(level, 1)).then_some(at)
    };
    let mut pairs = Vec::new();
    for (a, &(start, l)) in leaves.iter().enumerate() {
        let code = start >> (3 * (LEVEL_MAX - l));
        let faces = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
        let across = faces.filter_map(|(axis, up)| neighbour(l, code, axis, up));
        let others = across.filter_map(|code| leaf_at(start57(l, code), l));
        pairs.extend(others.flat_map(|b| [(a, b), (b, a)]));
    }
    pairs.sort_unstable();
    pairs.dedup();
    let xadj = (0..=leaves.len()).map(|a| pairs.partition_point(|p| p.0 < a) as metis::Idx);
    (xadj.collect(), pairs.iter().map(|p| p.1 as metis::Idx).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::position;

    const LEVEL: Level = 3;

    fn cube(weight: u64) -> Vec<Bin> {
        (0..512).map(|code| [start57(LEVEL, code), weight]).collect()
    }

    fn octants() -> Vec<Leaf> {
        cube(1).into_iter().map(|leaf| (leaf[0], LEVEL)).collect()
    }

    #[test]
    fn parts_are_equal_whatever_the_sum_of_weights() {
        for weight in [1, 1 << 40] {
            let parts = parts(&octants(), &[weight; 512], 8).unwrap();
            for r in 0..8 {
                let n = parts.iter().filter(|&&part| part == r).count();
                assert!((55..=75).contains(&n), "{n} of 64");
            }
        }
    }

    #[test]
    fn few_leaves_and_few_heavy_ones_are_divided_along_the_curve() {
        // As many equal leaves as 8 for each rank suffice.
        assert!(!has_enough(&cube(7)[..31], 4) && has_enough(&cube(7)[..32], 4));
        let mut heavy = cube(7);
        heavy[99][1] = 512 * 7;
        assert!(!has_enough(&heavy, 4), "half of the weight is in one leaf");
        assert!(!has_enough(&[], 1));
    }

    #[test]
    fn leaves_that_share_a_face_are_joined() {
        let (xadj, adjncy) = graph(&octants());
        assert_eq!(adjncy.len(), 2 * 3 * 7 * 64, "three planes of faces within the cube");
        for (a, range) in xadj.windows(2).enumerate() {
            for &b in &adjncy[range[0] as usize..range[1] as usize] {
                let (p, q) = (position(a as u64), position(b as u64));
                let apart: u32 = (0..3).map(|i| p[i].abs_diff(q[i])).sum();
                assert_eq!(apart, 1);
            }
        }
    }

    #[test]
    fn leaves_of_several_levels_are_joined_with_all_across_their_faces() {
        // Seven octants of level 1 and, instead of the last, eight of level 2.
        let coarse = (0..7).map(|code| (start57(1, code), 1));
        let leaves: Vec<Leaf> = coarse.chain((56..64).map(|code| (start57(2, code), 2))).collect();
        let (xadj, adjncy) = graph(&leaves);
        let degree = |a: usize| xadj[a + 1] - xadj[a];
        // Three coarse neighbours; those of the refined octant have four fine ones instead of one.
        assert_eq!((0..7).map(degree).collect::<Vec<_>>(), [3, 3, 3, 6, 3, 6, 6]);
        assert_eq!((degree(7), degree(14)), (6, 3));
        assert_eq!(adjncy.len(), 3 * 4 + 3 * 6 + 8 * 3 + 12);
    }

    #[test]
    fn too_few_equal_leaves_are_an_error() {
        assert_eq!(assign_equal(&octants(), 8).unwrap().len(), 512);
        let why = assign_equal(&octants()[..7], 8).unwrap_err().to_string();
        assert!(why.contains("8 of 8 ranks") && why.contains("7 cells"), "{why}");
    }
}
