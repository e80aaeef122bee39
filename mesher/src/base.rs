//! The base tree and its partition (the paper's sections II.A and III): the top of T0, whose leaves
//! are dealt out to the ranks; and the facets' journey to them.
//!
//! Every rank marks the octants that its share of the facets asks to split; the union of the marks is
//! the same tree for all. Where the cut through it goes is a matter of balance: a base leaf that is
//! heavier than a small part of one rank's share is split further, as no partition can divide it; where the
//! partition cuts the Morton curve, only the leaves that a cut falls in. Once dealt out, siblings of one owner
//! are joined: so all that is known to everybody is what separates ranks.

pub(crate) mod cut;
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
use cut::{Cut, Piece, cut_through};
use survey::Survey;

/// Base leaves with children per rank that the paper's way, one level for all, aims at.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// A base leaf heavier than this part of a rank's share is split where that is automatic, if a partitioner
/// may take any of them: it then misses an equal share by a few percent.
const SHARE_PARTS: u64 = 16;
/// The same for the leaves that a cut through the Morton curve falls in; others need not be small.
const CUT_PARTS: u64 = 64;
/// Parts of a share that octants have everywhere, about, before cuts are looked at.
const COARSE_PARTS: u64 = 1;
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
    /// Who owns what.
    pub share: Ownership,
    /// T0 in top bricks, down to the base leaves.
    pub top: Tree,
    /// This rank's base leaves that are split in T0, siblings joined.
    pub starts: Vec<Start>,
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
    let ranks = comm.size();
    let mut cut = match (division.level_base, division.weights) {
        (Some(_), _) => by_level(&survey, survey.levels()[0]),
        (None, Weights::Unit) => by_level(&survey, level_of_pieces(&survey, ranks)),
        (None, Weights::Area) if cuts_anywhere(division) => at_cuts(&mut survey, ranks),
        _ => by_weight(&survey, ranks),
    };
    let mut weights: Vec<u64> = match division.weights {
        Weights::Unit => vec![1; cut.pieces.len()],
        Weights::Area => cut.weights(),
        Weights::Rehearsal => rehearse::weights(facets, rules, &survey.marks, &cut, comm),
    };
    if division.weights == Weights::Rehearsal && cuts_anywhere(division) {
        survey.calibrate(&cut, &weights);
        cut = at_cuts(&mut survey, ranks);
        weights = cut.weights();
    }
    let owners = partition::assign(&cut, &weights, division.partitioner, comm)?;
    let dealt = cut.dealt(&owners);
    let share = Ownership::new(comm.rank(), comm.size(), &dealt);
    Ok(Base {
        top: cut.top(&survey.marks, rules.level_surface, &share),
        starts: cut.starts(&owners, comm.rank()),
        dealt: dealt.into_iter().filter(|b| b.owner == comm.rank()).collect(),
        level_base: cut.level_base(),
        share,
        work: survey.work,
    })
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
        // A rehearsal tells more of smaller leaves; but as much shallower as it is coarser.
        let parts = if division.weights == Weights::Rehearsal { SHARE_PARTS } else { COARSE_PARTS };
        let [first, last] = level_auto(facets, rules, [parts, CUT_PARTS], comm);
        let rehearsed = division.weights == Weights::Rehearsal;
        [if rehearsed { first.min(rehearse::deepest(rules)) } else { first }, last]
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

/// The level of the paper's base leaves, all alike: enough of them for every rank.
fn level_of_pieces(survey: &Survey, ranks: usize) -> Level {
    let enough = SPLIT_LEAVES_PER_RANK * ranks as u64;
    let whole = survey.levels()[0];
    (0..whole).find(|&l| survey.marks.split[l as usize].count() >= enough).unwrap_or(whole)
}

/// Base leaves of one level.
fn by_level(survey: &Survey, level: Level) -> Cut {
    Cut::root(survey).split_while(survey, |all| all.iter().map(|p| p.level < level).collect())
}

/// Base leaves that are light, wherever they are.
fn by_weight(survey: &Survey, ranks: usize) -> Cut {
    let cut = Cut::root(survey);
    let light = cut.pieces[0].weight / (ranks as u64 * SHARE_PARTS);
    // Not as deep as one may look where cuts are.
    let deepest = survey.levels()[0];
    cut.split_while(survey, |all| {
        all.iter().map(|p| p.level < deepest && p.weight > light).collect()
    })
}

/// Base leaves that are light where cuts into equal shares fall, looking deeper where that is needed.
/// Collective.
fn at_cuts(survey: &mut Survey, ranks: usize) -> Cut {
    let mut cut = Cut::root(survey);
    let light = cut.pieces[0].weight / (ranks as u64 * CUT_PARTS);
    let wanted = |all: &[Piece]| -> Vec<bool> {
        cut_through(all, ranks)
            .into_iter()
            .zip(all)
            .map(|(cut, p)| cut && p.weight > light)
            .collect()
    };
    for k in 0..survey.levels().len() - 1 {
        cut = cut.split_while(survey, wanted);
        let level = survey.levels()[k];
        let deeper = wanted(&cut.pieces).into_iter().zip(&cut.pieces);
        let mut octants = BrickSet::default();
        deeper
            .filter(|(wanted, p)| *wanted && p.heavy && p.level == level)
            .for_each(|(_, p)| octants.push(p.code >> 6, 1 << (p.code & 63)));
        survey.look_deeper(k, octants);
        cut.renew(survey);
    }
    cut.split_while(survey, wanted)
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
