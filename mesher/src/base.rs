//! The base tree and its partition (the paper's sections II.A and III): the top of T0, whose leaves
//! are dealt out to the ranks; and the facets' journey to them.
//!
//! Every rank marks the octants that its share of the facets asks to split; the union of the marks is
//! the same tree for all. Where the cut through it goes is a matter of balance: a base leaf that is
//! heavier than a small part of one rank's share is split further, as no partition can divide it; where the
//! partition cuts the Morton curve, only the leaves that a cut falls in. Once dealt out, siblings of one owner
//! are joined: so all that is known to everybody is what separates ranks.

mod cut;
mod heaviest;
mod rehearse;
mod route;
mod survey;

pub use heaviest::cells_heaviest;
pub use route::route;

use crate::brickset::BrickSet;
use crate::comm::Comm;
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::{ExtentBox, Rules};
use crate::octant::{LEVEL_MAX, Level, edge, start57};
use crate::partition::{self, Partitioner, Weights, area};
use crate::share::{BaseLeaf, Ownership};
use crate::tree::Tree;
use crate::voxelise::{Start, Work};
use cut::{Cut, adaptive, uniform};
use survey::Survey;

/// Base leaves with children per rank that the paper's way, one level for all, aims at.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// A base leaf heavier than this part of a rank's share is split where that is automatic, if a partitioner
/// may cut anywhere: it then misses an equal share by a few percent, and what everyone holds stays small.
const SHARE_PARTS: u64 = 16;
/// The same for the leaves that a cut through the Morton curve falls in; others need not be small.
const CUT_PARTS: u64 = 64;
/// Parts of a share that base leaves have wherever they are, at least, before cuts are looked at.
const COARSE_PARTS: u64 = 2;
/// Levels from one look at the cuts to the next.
const LOOK_LEVELS: Level = 2;
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

/// The base tree as all ranks know it: splits and crossing leaves down to the base leaves.
pub struct Base {
    /// Who owns which base leaf; siblings of one owner are joined.
    pub share: Ownership,
    /// T0 down to the base leaves.
    pub top: Tree,
    /// This rank's base leaves that are split in T0.
    pub starts: Vec<Start>,
    /// Levels of base leaves that are split in T0, of any rank; ascending.
    pub levels_split: Vec<Level>,
    /// This rank's base leaves as they were dealt out, in order.
    pub dealt: Vec<BaseLeaf>,
    /// Level of the deepest base leaves that were dealt out.
    pub level_base: Level,
    /// Work done.
    pub work: Work,
}

/// Builds the base tree and deals it out. Collective.
pub fn build(
    facets: &[Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Base, Error> {
    let levels = levels(facets, rules, division, comm);
    let with_areas = division.weights != Weights::Unit;
    let mut survey = Survey::new(facets, rules, levels, with_areas, comm);
    let mut cut = divide(&mut survey, rules, division, comm);
    let mut weights: Vec<u64> = match division.weights {
        Weights::Unit => vec![1; cut.leaves.len()],
        _ => cut.leaves.iter().map(|b| survey.expected(b)).collect(),
    };
    if division.weights == Weights::Rehearsal {
        let told = rehearse::weights(facets, rules, &survey.marks, &cut, &weights, comm);
        if cuts_anywhere(division) {
            survey.calibrate(&cut.leaves, &told);
            cut = divide(&mut survey, rules, division, comm);
            weights = cut.leaves.iter().map(|b| survey.expected(b)).collect();
        } else {
            weights = told;
        }
    }
    let owners = partition::assign(&cut.leaves, &weights, division.partitioner, comm)?;
    cut.leaves.iter_mut().zip(owners).for_each(|(b, owner)| b.owner = owner);
    let dealt = cut.leaves.iter().filter(|b| b.owner == comm.rank()).copied().collect();
    let level_base = cut.level_base;
    let Survey { marks, work, .. } = survey;
    let cut = cut.joined(&marks, rules.level_surface);
    let (starts, levels_split) = (cut.starts(comm.rank()), cut.levels_split());
    let share = Ownership::new(comm.rank(), comm.size(), cut.internal, cut.leaves);
    share.check_invariants();
    Ok(Base { share, top: cut.top, starts, levels_split, dealt, level_base, work })
}

/// Whether cuts fall where weights ask for them, so that only there base leaves need be small.
fn cuts_anywhere(division: &Division) -> bool {
    division.level_base.is_none()
        && division.partitioner == Partitioner::Morton
        && division.weights != Weights::Unit
}

/// Levels that base leaves may have: the first everywhere, others where cuts are. Collective.
fn levels(facets: &[Facet], rules: &Rules, division: &Division, comm: &dyn Comm) -> Vec<Level> {
    let deepest = rules.level_deepest().max(1) - 1;
    if let Some(level) = division.level_base {
        return vec![level.min(deepest)];
    }
    let [first, last] = if cuts_anywhere(division) {
        level_auto(facets, rules, [COARSE_PARTS, CUT_PARTS], comm)
    } else {
        level_auto(facets, rules, [SHARE_PARTS; 2], comm).map(|l| l.min(LEVEL_BASE_AUTO_MAX))
    };
    let (first, last) = (first.min(deepest), last.min(deepest));
    let mut levels: Vec<Level> = (first..last).step_by(LOOK_LEVELS as usize).collect();
    levels.push(last);
    levels
}

/// The levels of base leaves that are small enough for such parts of a fair share even where the facets lie
/// closest, by the facets' area and the boxes' volume. Collective.
fn level_auto(facets: &[Facet], rules: &Rules, parts: [u64; 2], comm: &dyn Comm) -> [Level; 2] {
    // Whole finest faces: a sum of integers is the same on all ranks.
    let face = (edge(rules.level_surface) as f64).powi(2);
    let area = comm.sum((area::total(facets) / face) as u64) as f64 * face;
    let side = |b: &ExtentBox, a: usize| (b.max[a] - b.min[a]) as f64;
    let volumes = rules.boxes.iter().map(|b| (0..3).map(|a| side(b, a)).product::<f64>());
    let volume = volumes.fold(0.0, f64::max);
    parts.map(|parts| {
        // Four sheets of facets in one octant are not unusual: wings, fins.
        let parts = (comm.size() as u64 * parts * 4) as f64;
        let small = |l: &Level| {
            let h = edge(*l) as f64;
            h * h <= area / parts && (volume == 0.0 || h.powi(3) <= volume / parts)
        };
        (0..LEVEL_MAX).find(small).unwrap_or(LEVEL_MAX)
    })
}

/// Cuts the tree into base leaves, looking deeper where that is needed. Collective.
fn divide(survey: &mut Survey, rules: &Rules, division: &Division, comm: &dyn Comm) -> Cut {
    let (surface, ranks) = (rules.level_surface, comm.size() as u64);
    let whole = survey.levels()[0];
    match (division.level_base, division.weights) {
        (Some(_), _) => return Cut::new(&survey.marks, uniform(&survey.marks, whole), surface),
        (None, Weights::Unit) => {
            let enough = SPLIT_LEAVES_PER_RANK * ranks;
            let level = (0..whole).find(|&l| survey.marks.split[l as usize].count() >= enough);
            let internal = uniform(&survey.marks, level.unwrap_or(whole));
            return Cut::new(&survey.marks, internal, surface);
        }
        _ => {}
    }
    let parts = if cuts_anywhere(division) { CUT_PARTS } else { SHARE_PARTS };
    let limit = survey.expected(&BaseLeaf { level: 0, code: 0, owner: 0 }) / (ranks * parts);
    let cut = |survey: &Survey| {
        let internal = adaptive(
            &survey.marks,
            |l, code| survey.may_divide(l, code),
            |b| survey.expected(b),
            limit,
        );
        Cut::new(&survey.marks, internal, surface)
    };
    for k in 0..survey.levels().len() - 1 {
        let octants = cut_through(&cut(survey), survey, survey.levels()[k], comm.size());
        survey.look_deeper(k, octants);
    }
    cut(survey)
}

/// The base leaves of level `l`, split in T0, that a cut into equal shares falls in.
fn cut_through(cut: &Cut, survey: &Survey, l: Level, ranks: usize) -> BrickSet {
    let weights: Vec<u64> = cut.leaves.iter().map(|b| survey.expected(b)).collect();
    let total: u128 = weights.iter().map(|&w| u128::from(w)).sum();
    let share_at = |weight: u128| weight * ranks as u128 / total;
    let mut octants = BrickSet::default();
    let mut before = 0;
    for ((b, heavy), weight) in cut.leaves.iter().zip(&cut.heavy).zip(weights) {
        let after = before + u128::from(weight);
        if *heavy && b.level == l && share_at(before) != share_at(after) {
            octants.push(b.code >> 6, 1 << (b.code & 63));
        }
        before = after;
    }
    octants
}

/// Pairs of base leaves that share part of a face, each once, the lower number first.
#[cfg_attr(not(feature = "metis"), allow(dead_code))]
pub(crate) fn face_neighbours(
    leaves: &[BaseLeaf],
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
        let leaves: Vec<BaseLeaf> =
            (0..64).map(|code| BaseLeaf { level: 2, code, owner: 0 }).collect();
        let pairs = face_neighbours(&leaves, |s| (s >> (3 * (LEVEL_MAX - 2))) as usize);
        assert_eq!(pairs.len(), 3 * 3 * 16);
        let apart = |a: usize, b: usize| -> i64 {
            let (p, q) = (position(a as u64), position(b as u64));
            (0..3).map(|i| (i64::from(p[i]) - i64::from(q[i])).abs()).sum()
        };
        assert!(pairs.iter().all(|&(a, b)| apart(a, b) == 1));
    }
}
