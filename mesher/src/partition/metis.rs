//! METIS: parts of equal weight with few faces between them.
//!
//! METIS bisects again and again, and complains on standard output about parts that get nothing: with
//! hardly more leaves than ranks, the curve's cuts serve as well.

use super::morton_cuts;
use crate::error::Error;
use crate::octant::start57;
use crate::partition::initial::cut::Piece;
use crate::partition::initial::face_neighbours;

/// Fewest base leaves per rank that METIS is asked to cut, of as many equal ones as they amount to.
const LEAVES_PER_RANK_METIS: usize = 8;

/// The owner of each base leaf.
pub fn cuts(leaves: &[Piece], weights: &[u64], ranks: usize) -> Result<Vec<usize>, Error> {
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

/// The graph in METIS's compressed form.
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
    fn parts_are_fair_however_heavy_the_leaves() {
        let leaves: Vec<Piece> = (0..512).map(|code| Piece::new(3, code)).collect();
        for weight in [1, 1 << 40] {
            let owners = cuts(&leaves, &[weight; 512], 8).unwrap();
            for r in 0..8 {
                let n = owners.iter().filter(|&&o| o == r).count();
                assert!((55..=75).contains(&n), "{n} of 64");
            }
        }
    }
}
