//! METIS: parts of equal weight with few faces between them.

use crate::error::Error;
use crate::partition::curve::{Bin, Boundary};
use bricks::octant::{LEVEL_MAX, Level, neighbour};
use ranks::{Comm, agree, gather};
use std::sync::{Mutex, PoisonError};

/// METIS keeps its random state per process: threads that share it would change each other's parts.
static TURN: Mutex<()> = Mutex::new(());

/// Fewest base leaves per rank that METIS partitions, of equal ones or of their equivalent in unequal ones.
const LEAVES_PER_RANK_MIN: usize = 8;

/// The boundaries between base leaves, octants of a level, by METIS on rank 0; none if it is not used. The leaves are the same on all
/// ranks. Collective; the result is the same on all ranks.
pub fn assign(
    leaves: &[Bin],
    level: Level,
    comm: &dyn Comm,
) -> Result<Option<Vec<Boundary>>, Error> {
    if comm.size() == 1 || !has_enough(leaves, comm.size()) {
        return Ok(None);
    }
    let on_rank_0 = || parts(leaves, level, comm.size());
    let parts = agree(comm, if comm.rank() == 0 { on_rank_0() } else { Ok(Vec::new()) })?;
    let starts = leaves.iter().map(|leaf| leaf.0);
    let owners = gather(comm, &parts).into_iter().map(|part| part as usize);
    let mut boundaries: Vec<Boundary> = starts.zip(owners).collect();
    boundaries[0].0 = 0;
    Ok(Some(boundaries))
}

/// Whether base leaves are enough for METIS, which bisects recursively, and prints complaints on standard
/// output about empty parts. With few leaves per rank, or few that have nearly all the weight, intervals of the curve are as good.
fn has_enough(leaves: &[Bin], ranks: usize) -> bool {
    let total: u128 = leaves.iter().map(|leaf| u128::from(leaf.1)).sum();
    let even: f64 = leaves.iter().map(|leaf| (leaf.1 as f64 / total as f64).powi(2)).sum();
    total > 0 && ((LEAVES_PER_RANK_MIN * ranks) as f64) * even <= 1.0
}

/// The part of each base leaf.
fn parts(leaves: &[Bin], level: Level, ranks: usize) -> Result<Vec<u64>, Error> {
    let total: u128 = leaves.iter().map(|leaf| u128::from(leaf.1)).sum();
    let (xadj, adjncy) = graph(leaves, level);
    // METIS sums weights in i32 without a check for overflow.
    let scale = |w: u64| (u128::from(w) * (1 << 30) / total.max(1 << 30)).max(1) as metis::Idx;
    let scaled: Vec<metis::Idx> = leaves.iter().map(|leaf| scale(leaf.1)).collect();
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
    Ok(parts.into_iter().map(|part| part as u64).collect())
}

/// The graph of base leaves that share a face, in the compressed form of METIS.
fn graph(leaves: &[Bin], level: Level) -> (Vec<metis::Idx>, Vec<metis::Idx>) {
    let shift = 3 * (LEVEL_MAX - level);
    let index = |code: u64| leaves.binary_search_by_key(&(code << shift), |leaf| leaf.0).ok();
    let (mut xadj, mut adjncy) = (vec![0], Vec::new());
    for leaf in leaves {
        let across = |(axis, up)| neighbour(level, leaf.0 >> shift, axis, up).and_then(index);
        let faces = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
        adjncy.extend(faces.filter_map(across).map(|at| at as metis::Idx));
        xadj.push(adjncy.len() as metis::Idx);
    }
    (xadj, adjncy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::{position, start57};

    const LEVEL: Level = 3;

    fn cube(weight: u64) -> Vec<Bin> {
        (0..512).map(|code| (start57(LEVEL, code), weight)).collect()
    }

    #[test]
    fn parts_are_equal_whatever_the_sum_of_weights() {
        for weight in [1, 1 << 40] {
            let parts = parts(&cube(weight), LEVEL, 8).unwrap();
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
        heavy[99].1 = 512 * 7;
        assert!(!has_enough(&heavy, 4), "half of the weight is in one leaf");
        assert!(!has_enough(&[], 1));
    }

    #[test]
    fn leaves_that_share_a_face_are_joined() {
        let (xadj, adjncy) = graph(&cube(1), LEVEL);
        assert_eq!(adjncy.len(), 2 * 3 * 7 * 64, "three planes of faces within the cube");
        for (a, range) in xadj.windows(2).enumerate() {
            for &b in &adjncy[range[0] as usize..range[1] as usize] {
                let (p, q) = (position(a as u64), position(b as u64));
                let apart: u32 = (0..3).map(|i| p[i].abs_diff(q[i])).sum();
                assert_eq!(apart, 1);
            }
        }
    }
}
