//! The paper's partition: the subtrees of T0 below its *base leaves* are assigned to ranks.
//!
//! All ranks need the top of T0 for it. Each rank marks the octants that its slice of the facets splits; the union of the
//! marks is the same tree on all ranks. Base leaves tile the root, in Morton order.

mod heaviest;

pub use heaviest::Heaviest;

use crate::error::Error;
use crate::input::lattice::Rules;
use crate::partition::curve::assign_morton;
#[cfg(feature = "metis")]
use crate::partition::metis;
use crate::partition::ownership::{BaseLeaf, KEY_BITS};
use crate::partition::{Division, Partitioner, Weights, area};
use area::Areas;
use bricks::brick::{self, Brick};
use bricks::facet::Facet;
use bricks::octant::{Level, start57};
use bricks::tree::{PerLevel, per_level};
use ranks::{Comm, agree, all_gather_reduced};
use std::ops::Range;

/// Base leaves with children per rank, at least, where all base leaves have one level.
const SPLIT_LEAVES_PER_RANK: u64 = 32;
/// Subtrees heavier than this fraction of a rank's mean load are split further: the load imbalance is then a few percent.
pub const SUBTREES_PER_RANK: u64 = 16;

/// The top of T0, the same on all ranks.
struct Survey<'a> {
    rules: &'a Rules,
    /// Octants that split in T0, of all levels above `level`.
    split: PerLevel,
    areas: Areas,
    /// Deepest level that base leaves may have.
    level: Level,
}

impl<'a> Survey<'a> {
    /// Gathers areas, unless weights are 1, and the octants that any rank's facets split (`marked` on this rank) above a level.
    /// Collective.
    fn gather(
        facets: &[Facet],
        marked: &PerLevel,
        rules: &'a Rules,
        level: Level,
        weights: Weights,
        comm: &dyn Comm,
    ) -> Self {
        let areas = match weights {
            Weights::Unit => Areas::default(),
            _ => Areas::gather(facets, rules, level, comm),
        };
        let mut split = per_level();
        let sets = (0..u64::from(level)).zip(marked);
        let entry = |l: u64| move |b: Brick| [l << KEY_BITS | b.key, b.bits];
        let entries = sets.flat_map(|(l, set)| set.bricks().map(entry(l)));
        for [key, bits] in all_gather_reduced(entries.collect(), |a, b| a | b, comm) {
            split[(key >> KEY_BITS) as usize].push(key & ((1 << KEY_BITS) - 1), bits);
        }
        Self { rules, split, areas, level }
    }

    /// Estimated leaves of the mesh in an octant with these entries of the areas.
    fn weight(&self, l: Level, code: u64, areas: &Range<usize>) -> u64 {
        let by_area =
            self.areas.cells(areas).saturating_mul(area::leaves_per_surface_cell(self.rules));
        1 + by_area + area::leaves_in_boxes(l, code, self.rules)
    }
}

/// A base leaf with the subtree of T0 below it.
#[derive(Clone, Debug)]
struct Subtree {
    /// Level of its root.
    level: Level,
    /// Morton code of its root.
    code: u64,
    /// Whether its root is split in T0; true or false only above the survey's level.
    is_split: bool,
    /// Estimated leaves of the mesh in it.
    weight: u64,
    /// Its entries in the survey's areas.
    areas: Range<usize>,
}

impl Subtree {
    fn root(survey: &Survey) -> Self {
        let areas = survey.areas.within(&survey.areas.all(), span(0, 0));
        let weight = survey.weight(0, 0, &areas);
        Self { level: 0, code: 0, is_split: survey.split[0].contains(0), weight, areas }
    }

    fn children(self, survey: &Survey) -> [Self; 8] {
        let level = self.level + 1;
        let split = survey.split[level as usize].get(self.code >> 3);
        let split = brick::byte(split, self.code & 7);
        let mut rest = self.areas;
        std::array::from_fn(|child| {
            let code = self.code << 3 | child as u64;
            let areas = survey.areas.within(&rest, span(level, code));
            rest.start = areas.end;
            let weight = survey.weight(level, code, &areas);
            Self { level, code, is_split: split >> child & 1 == 1, weight, areas }
        })
    }
}

/// The interval of the Morton curve, in level-19 codes, that an octant fills.
fn span(level: Level, code: u64) -> Range<u64> {
    start57(level, code)..start57(level, code + 1)
}

/// The base leaves, in order, with their owners, and the partitioner that chose them: METIS is not used where there are too few
/// base leaves for it. The same on all ranks. No base leaf is deeper than `level`; `marked` are the
/// octants above that level that this rank's facets split. Collective.
pub fn partition(
    facets: &[Facet],
    marked: &PerLevel,
    rules: &Rules,
    division: &Division,
    level: Level,
    comm: &dyn Comm,
) -> Result<(Vec<BaseLeaf>, Partitioner), Error> {
    let survey = Survey::gather(facets, marked, rules, level, division.weights, comm);
    let ranks = comm.size() as u64;
    let root = Subtree::root(&survey);
    let heavy = root.weight / (ranks * SUBTREES_PER_RANK);
    let subtrees = match (division.level_base, division.weights) {
        (Some(_), _) => split_while(root, &survey, |_| true),
        (None, Weights::Unit) => {
            let enough =
                |l: &Level| survey.split[*l as usize].count() >= SPLIT_LEAVES_PER_RANK * ranks;
            let level = (0..level).find(enough).unwrap_or(level);
            split_while(root, &survey, |s| s.level < level)
        }
        (None, _) => split_while(root, &survey, |s| s.weight > heavy),
    };
    let weights: Vec<u64> = match division.weights {
        Weights::Unit => vec![1; subtrees.len()],
        Weights::Area | Weights::Rebalance => subtrees.iter().map(|s| s.weight).collect(),
    };
    let partitioner = match division.partitioner {
        Partitioner::Metis if !metis_has_enough(&weights, comm.size()) => Partitioner::Morton,
        chosen => chosen,
    };
    let owners = assign(&subtrees, &weights, partitioner, comm)?;
    let leaf = |(s, owner): (Subtree, usize)| BaseLeaf { level: s.level, code: s.code, owner };
    Ok((subtrees.into_iter().zip(owners).map(leaf).collect(), partitioner))
}

/// Splits subtrees whose root is split in T0, down to the survey's level at most, as long as `wanted` is true for any.
fn split_while(root: Subtree, survey: &Survey, wanted: impl Fn(&Subtree) -> bool) -> Vec<Subtree> {
    let mut subtrees = vec![root];
    loop {
        let before = subtrees.len();
        let mut divided = Vec::with_capacity(before);
        for s in subtrees {
            if s.is_split && s.level < survey.level && wanted(&s) {
                divided.extend(s.children(survey));
            } else {
                divided.push(s);
            }
        }
        subtrees = divided;
        if subtrees.len() == before {
            return subtrees;
        }
    }
}

/// The owner of each subtree, the same on all ranks. Collective.
fn assign(
    subtrees: &[Subtree],
    weights: &[u64],
    partitioner: Partitioner,
    comm: &dyn Comm,
) -> Result<Vec<usize>, Error> {
    match partitioner {
        _ if comm.size() == 1 => Ok(vec![0; weights.len()]),
        Partitioner::Morton => Ok(assign_morton(weights, comm.size())),
        Partitioner::Metis => {
            let on_rank_0 = if comm.rank() == 0 {
                assign_metis(subtrees, weights, comm.size())
            } else {
                Ok(Vec::new())
            };
            let owners: Vec<u64> = agree(comm, on_rank_0)?.into_iter().map(|o| o as u64).collect();
            Ok(comm.all_gather(&owners).words().iter().map(|&o| o as usize).collect())
        }
    }
}

#[cfg(feature = "metis")]
use metis::has_enough as metis_has_enough;

/// True, so that METIS is asked for and reported as missing.
#[cfg(not(feature = "metis"))]
fn metis_has_enough(_: &[u64], _: usize) -> bool {
    true
}

#[cfg(feature = "metis")]
fn assign_metis(leaves: &[Subtree], weights: &[u64], ranks: usize) -> Result<Vec<usize>, Error> {
    let octants: Vec<(Level, u64)> = leaves.iter().map(|s| (s.level, s.code)).collect();
    metis::assign(&octants, weights, ranks)
}

#[cfg(not(feature = "metis"))]
fn assign_metis(_: &[Subtree], _: &[u64], _: usize) -> Result<Vec<usize>, Error> {
    Err(Error::input(
        "this mesher was built without METIS: use --partitioner morton, or build with --features metis",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::refine_top;
    use crate::tests::rules as plain_rules;
    use bricks::octant::ROOT_EDGE;
    use ranks::Solo;

    const LEVEL: Level = 5;

    #[test]
    fn base_leaves_are_as_deep_as_the_division_asks_for() {
        let rules = Rules { level_surface: 9, layer_cells_min: 4, ..plain_rules() };
        let h = ROOT_EDGE as i32;
        let facets = [Facet { v: [[1, 1, 5], [h / 2, 1, 5], [1, h / 4, h / 8]] }];
        let marked = refine_top(&facets, &rules, LEVEL).0.split;
        let leaves = |weights, level_base| {
            let division = Division { partitioner: Partitioner::Morton, weights, level_base };
            partition(&facets, &marked, &rules, &division, LEVEL, &Solo).expect("no METIS").0
        };
        let survey = Survey::gather(&facets, &marked, &rules, LEVEL, Weights::Area, &Solo);
        let is_split = |b: &BaseLeaf| marked[b.level as usize].contains(b.code);
        let weight = |level: Level, code: u64| {
            let areas = survey.areas.within(&survey.areas.all(), span(level, code));
            survey.weight(level, code, &areas)
        };
        let heavy = weight(0, 0) / SUBTREES_PER_RANK;
        let by_weight = leaves(Weights::Area, None);
        let depth = |leaves: &[BaseLeaf]| leaves.iter().map(|b| b.level).max();
        assert!((2..LEVEL).contains(&depth(&by_weight).unwrap()), "{by_weight:?}");
        for b in &by_weight {
            assert!(!is_split(b) || weight(b.level, b.code) <= heavy, "{b:?} is too heavy");
            assert!(weight(b.level - 1, b.code >> 3) > heavy, "{b:?} need not be so deep");
        }
        // Every split octant above the level is divided.
        let all = leaves(Weights::Area, Some(LEVEL));
        let splits: u64 = (0..LEVEL).map(|l| marked[l as usize].count()).sum();
        assert_eq!(all.len() as u64, 1 + 7 * splits);
        // The first level with enough split octants is that of the deepest base leaves.
        let enough = (0..LEVEL).find(|&l| marked[l as usize].count() >= SPLIT_LEAVES_PER_RANK);
        let unit = leaves(Weights::Unit, None);
        assert_eq!(depth(&unit), enough);
        let above: u64 = (0..enough.unwrap()).map(|l| marked[l as usize].count()).sum();
        assert_eq!(unit.len() as u64, 1 + 7 * above);
    }
}
