//! The partition of T0 (the paper's sections II.A and III), and the facets' journey to the ranks.
//!
//! By default the Morton curve is cut into equal shares of the leaves to expect, wherever that is (`shares`): each rank
//! needs to know the owners along the curve, and no more.
//!
//! The paper's way, which METIS, weights of 1 and a chosen `level_base` ask for, cuts T0 itself into *base leaves* and
//! deals those out. For that all ranks survey T0's top: every rank marks the octants that its share of the facets
//! asks to split; the union of the marks is the same tree for all. A base leaf that is heavier than a small part of one
//! rank's share is split further, as no partition can divide it.

pub(crate) mod cut;
mod heaviest;
mod rehearse;
mod route;
mod shares;
mod survey;

pub use heaviest::cells_heaviest;
pub use route::route;

use crate::comm::Comm;
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::{LEVEL_MAX, Level, edge, start57};
use crate::partition::ownership::{BaseLeaf, Ownership};
use crate::partition::{self, Partitioner, Weights, area};
use crate::voxelise::{SubtreeRoot, Work};
use cut::{Cut, Piece};
use survey::Survey;

/// Base leaves with children per rank that the paper's way, one level for all, aims at.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// A base leaf heavier than this part of a rank's share is split where that is automatic: a partition then
/// misses an equal share by a few percent.
const SHARE_PARTS: u64 = 16;
/// Parts of a share that a cut of the Morton curve keeps or gives away as one.
const CUT_PARTS: u64 = 16;
/// Parts of a share, about, by which all ranks know where the weight lies before the curve is cut. Coarser than
/// shares, as what is told to everybody grows with the ranks; so one rank may cut the curve in detail for a few.
const COARSE_PARTS: f64 = 0.25;
/// Deepest automatic `level_base` of all base leaves alike.
const LEVEL_BASE_AUTO_MAX: Level = 12;

/// How to divide the work. Without effect on the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Who cuts the base tree.
    pub partitioner: Partitioner,
    /// What a base leaf weighs.
    pub weights: Weights,
    /// Level at which the tree is cut into base leaves; chosen by ranks and weights if none.
    pub level_base: Option<Level>,
}

impl Division {
    /// Whether the Morton curve is cut wherever weights ask for it, not between base leaves made beforehand.
    pub fn is_of_curve(&self) -> bool {
        self.level_base.is_none()
            && self.partitioner == Partitioner::Morton
            && self.weights != Weights::Unit
    }

    /// Whether it is made anew when it is known what there is.
    pub fn rebalances(&self) -> bool {
        self.is_of_curve() && self.weights == Weights::Rebalance
    }
}

/// The division of T0 as this rank needs to know it.
pub struct Base {
    /// Who owns what.
    pub ownership: Ownership,
    /// This rank's base leaves as they were dealt out, in order; none where the Morton curve is cut anywhere.
    pub dealt: Vec<BaseLeaf>,
    /// Level of the deepest base leaves, or of the octants that the curve is cut between.
    pub level_base: Level,
    /// Work done.
    pub work: Work,
}

/// Divides T0 among the ranks. Collective.
pub fn build(
    facets: &[Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Base, Error> {
    if !division.is_of_curve() {
        return of_leaves(facets, rules, division, comm);
    }
    let rehearsed = division.weights == Weights::Rehearsal;
    // A rehearsal tells more of smaller leaves; but as much shallower as it is coarser.
    let coarse = if rehearsed { SHARE_PARTS as f64 } else { COARSE_PARTS };
    let parts = [coarse, CUT_PARTS as f64];
    let [coarse, fine] = levels_auto(facets, rules, parts, comm);
    let (ownership, work) = if rehearsed {
        let coarse = coarse.min(rehearse::deepest(rules));
        let survey = Survey::new(facets, rules, coarse, true, comm);
        let cut = by_weight(&survey, comm.size());
        let told = rehearse::weights(facets, rules, &cut, comm);
        (shares::by_rehearsal(facets, rules, &cut, &told, fine, comm), survey.work)
    } else {
        (shares::by_area(facets, rules, [coarse, fine], comm), Work::default())
    };
    Ok(Base { ownership, dealt: Vec::new(), level_base: fine, work })
}

/// Deals out base leaves, as the paper does. Collective.
fn of_leaves(
    facets: &[Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Base, Error> {
    let level = match division.level_base {
        Some(level) => level.min(level_last(rules)),
        None => levels_auto(facets, rules, [SHARE_PARTS as f64], comm)[0].min(LEVEL_BASE_AUTO_MAX),
    };
    let survey = Survey::new(facets, rules, level, division.weights != Weights::Unit, comm);
    let cut = match (division.level_base, division.weights) {
        (Some(_), _) => by_level(&survey, level),
        (None, Weights::Unit) => by_level(&survey, level_of_pieces(&survey, comm.size())),
        (None, _) => by_weight(&survey, comm.size()),
    };
    let weights = match division.weights {
        Weights::Unit => vec![1; cut.pieces.len()],
        Weights::Area | Weights::Rebalance => cut.weights(),
        Weights::Rehearsal => rehearse::weights(facets, rules, &cut, comm),
    };
    let owners = partition::assign(&cut, &weights, division.partitioner, comm)?;
    let dealt = cut.dealt(&owners);
    Ok(Base {
        ownership: Ownership::new(comm.rank(), comm.size(), &dealt),
        dealt: dealt.into_iter().filter(|b| b.owner == comm.rank()).collect(),
        level_base: cut.level_base(),
        work: survey.work,
    })
}

/// Where a rank begins to refine: the largest octants that it owns all of.
pub fn starts(ownership: &Ownership) -> Vec<SubtreeRoot> {
    ownership.octants().into_iter().map(|(level, code)| SubtreeRoot { level, code }).collect()
}

/// Deepest level that base leaves may have.
fn level_last(rules: &Rules) -> Level {
    rules.level_deepest().max(1) - 1
}

/// The levels of base leaves that are small enough for such parts of a fair share even where the facets lie
/// closest, by the facets' area and the boxes' volume. Collective.
fn levels_auto<const N: usize>(
    facets: &[Facet],
    rules: &Rules,
    parts: [f64; N],
    comm: &dyn Comm,
) -> [Level; N] {
    // Whole finest faces: a sum of integers is the same on all ranks.
    let face = (edge(rules.level_surface) as f64).powi(2);
    let area = comm.sum((area::total(facets) / face) as u64) as f64 * face;
    let side = |b: &ExtentBox, a: usize| (b.max[a] - b.min[a]) as f64;
    let volumes = rules.boxes.iter().map(|b| (0..3).map(|a| side(b, a)).product::<f64>());
    let volume = volumes.fold(0.0, f64::max);
    parts.map(|parts| {
        // Four sheets of facets in one octant are not unusual: wings, fins.
        let parts = comm.size() as f64 * parts * 4.0;
        let small = |l: &Level| {
            let h = edge(*l) as f64;
            h * h <= area / parts && (volume == 0.0 || h.powi(3) <= volume / parts)
        };
        (0..LEVEL_MAX).find(small).unwrap_or(LEVEL_MAX).min(level_last(rules))
    })
}

/// The level of the paper's base leaves, all alike: enough of them for every rank.
fn level_of_pieces(survey: &Survey, ranks: usize) -> Level {
    let enough = SPLIT_LEAVES_PER_RANK * ranks as u64;
    let whole = survey.level();
    (0..whole).find(|&l| survey.split[l as usize].count() >= enough).unwrap_or(whole)
}

/// Base leaves of one level.
fn by_level(survey: &Survey, level: Level) -> Cut {
    Cut::root(survey).split_while(survey, |p| p.level < level)
}

/// Base leaves that are light, wherever they are.
fn by_weight(survey: &Survey, ranks: usize) -> Cut {
    let cut = Cut::root(survey);
    let light = cut.pieces[0].weight / (ranks as u64 * SHARE_PARTS);
    cut.split_while(survey, |p| p.weight > light)
}

/// Pairs of base leaves that share part of a face, each once, the lower number first.
#[cfg_attr(not(feature = "metis"), allow(dead_code))]
pub(crate) fn face_neighbours(
    leaves: &[Piece],
    leaf_at: impl Fn(u64) -> usize,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, b) in leaves.iter().enumerate() {
        for axis in 0..3 {
            for up in [false, true] {
                let Some(n) = crate::octant::neighbour(b.level, b.code, axis, up) else {
                    continue;
                };
                let j = leaf_at(start57(b.level, n));
                // A finer neighbour finds this one itself.
                if leaves[j].level <= b.level {
                    pairs.push((i.min(j), i.max(j)));
                }
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Level-19 Morton code of the middle of a facet's extent, if that is in the root.
pub(crate) fn middle(f: &Facet) -> Option<u64> {
    let mid = std::array::from_fn(|a| {
        let (lo, hi) = f.range(a);
        (lo + hi) / 2
    });
    let inside = mid.iter().all(|c: &i64| (0..crate::octant::ROOT_EDGE).contains(c));
    inside.then(|| {
        crate::octant::morton(mid.map(|c| (c >> (crate::octant::ROOT_BITS - LEVEL_MAX)) as u32))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::position;

    #[test]
    fn neighbours_of_a_uniform_base_tree() {
        let leaves: Vec<Piece> = (0..64).map(|code| Piece::new(2, code)).collect();
        let pairs = face_neighbours(&leaves, |s| (s >> (3 * (LEVEL_MAX - 2))) as usize);
        assert_eq!(pairs.len(), 3 * 3 * 16);
        let apart = |a: usize, b: usize| -> i64 {
            let (p, q) = (position(a as u64), position(b as u64));
            (0..3).map(|i| (i64::from(p[i]) - i64::from(q[i])).abs()).sum()
        };
        assert!(pairs.iter().all(|&(a, b)| apart(a, b) == 1));
    }
}
