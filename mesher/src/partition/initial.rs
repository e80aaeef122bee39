//! The initial partition, from an estimate of the number of leaves.
//!
//! By default the Morton curve is divided into intervals of equal weight. No rank needs to know the weight everywhere. All ranks
//! know it in coarse octants, which gives a rough partition. Each rank then sends the weights of its facets, by fine octants, to
//! the owners in the rough partition. So each rank knows one interval of the curve in detail, and the final boundaries
//! follow from the sums over the intervals.
//!
//! METIS, weights of 1 and a given `level_base` need *base leaves*, octants that are assigned to ranks as a whole. Here they are the octants of one level in which facets or boxes have weight, the same on all ranks; an octant without weight goes
//! with the base leaf before it.

use crate::error::Error;
use crate::input::lattice::{ExtentBox, Rules};
use crate::partition::area::{self, FRACTIONS};
use crate::partition::curve::{self, Bin};
use crate::partition::ownership::Ownership;
use crate::partition::{Division, Partitioner, Weights, metis};
use bricks::facet::Facet;
use bricks::octant::{LEVEL_MAX, Level, edge};
use ranks::{Comm, MessageBuffer, Solo, all_gather_reduced, combine};

/// Fine octants per rank, about, which are the base leaves: boundaries lie between them.
const FINE_PER_RANK: u64 = 16;
/// Coarse octants per rank, about. Few, as all ranks gather them; the rough partition then gives several ranks' loads to some.
const COARSE_PER_RANK: f64 = 0.25;
/// The partition of T0 as one rank knows it.
pub struct Partition {
    /// The owner of every octant.
    pub ownership: Ownership,
    /// Level of the base leaves, or of the octants between which the boundaries of the curve lie.
    pub level_base: Level,
    /// The partitioner that was used; none for a single rank.
    pub partitioner: Option<Partitioner>,
}

/// The estimate of the leaves.
pub struct Estimate<'a> {
    /// This rank's slice of the geometry.
    pub facets: &'a [Facet],
    /// The rules on the lattice.
    pub rules: &'a Rules,
    /// All ranks.
    pub comm: &'a dyn Comm,
}

impl Estimate<'_> {
    /// Partitions T0. Collective.
    pub fn partition(&self, division: &Division) -> Result<Partition, Error> {
        if !division.is_of_curve() {
            return self.by_base_leaves(division);
        }
        let levels = self.levels();
        let (ownership, partitioner) = (self.by_area(levels), Some(Partitioner::Morton));
        Ok(Partition { ownership, level_base: levels[1], partitioner })
    }

    /// The coarse and the fine level, each the coarsest of which an octant at a surface or in a box has at most a rank's share of the leaves
    /// divided by [`COARSE_PER_RANK`] or [`FINE_PER_RANK`]; and the fine one of the facets alone, as if there were no boxes. Collective.
    fn levels(&self) -> [Level; 3] {
        let &Self { facets, rules, comm } = self;
        let each = area::leaves_per_surface_cell(rules) as f64;
        let face = (edge(rules.level_surface) as f64).powi(2);
        let at_surface = area::leaves_at_surface(facets, rules, comm);
        let level = |per_rank: f64, leaves: f64, boxes: &[ExtentBox]| {
            // Four sheets of facets in one octant are not unusual: wings, fins.
            let most = leaves / (comm.size() as f64 * per_rank * 4.0);
            let small = |l: &Level| {
                let h = edge(*l);
                let in_box = |b: &ExtentBox| {
                    let side = |a: usize| (b.max[a] - b.min[a]).min(h) as f64;
                    (0..3).map(side).product::<f64>() / (edge(b.level) as f64).powi(3)
                };
                each * (h as f64).powi(2) / face <= most && boxes.iter().all(|b| in_box(b) <= most)
            };
            (0..LEVEL_MAX).find(small).unwrap_or(LEVEL_MAX).min(level_last(rules))
        };
        let all = at_surface + area::leaves_in_boxes(0, 0, rules) as f64;
        let fine = FINE_PER_RANK as f64;
        let of_all = |per_rank| level(per_rank, all, &rules.boxes);
        [of_all(COARSE_PER_RANK), of_all(fine), level(fine, at_surface, &[])]
    }

    /// The partition by base leaves. METIS is not used where there are too few of them for it. Collective.
    fn by_base_leaves(&self, division: &Division) -> Result<Partition, Error> {
        let comm = self.comm;
        // In octants as small as boxes may need, facets would be in millions of them.
        let [_, fine, of_facets] = self.levels();
        let level = division.level_base.unwrap_or(fine.min(of_facets + 2));
        let level = level.min(level_last(self.rules));
        let (_, mut leaves) =
            self.all_bins(&area::of(self.facets, self.rules, level), level, 0, FINE_PER_RANK);
        if division.weights == Weights::Unit {
            leaves.iter_mut().for_each(|leaf| leaf[1] = 1);
        }
        let (boundaries, partitioner) = match division.partitioner {
            Partitioner::Metis if metis::has_enough(&leaves, comm.size()) => {
                (metis::assign(&leaves, level, comm)?, Partitioner::Metis)
            }
            _ => (curve::partition(&leaves, comm.size(), &Solo), Partitioner::Morton),
        };
        let ownership = Ownership::along(comm.rank(), comm.size(), boundaries);
        Ok(Partition { ownership, level_base: level, partitioner: Some(partitioner) })
    }

    /// Intervals of the curve with equal estimated numbers of leaves, given the [levels](Self::levels). Facets are not resolved to the level of
    /// boxes that are finer than the surface. Collective.
    fn by_area(&self, [coarse, fine, of_facets]: [Level; 3]) -> Ownership {
        let of_facets = of_facets.min(self.rules.level_surface);
        let (comm, local) = (self.comm, area::of(self.facets, self.rules, of_facets));
        let in_boxes = area::leaves_in_boxes(0, 0, self.rules);
        let (light, bins) = self.all_bins(&local, coarse, in_boxes, 1);
        let boundaries = curve::partition(&bins, comm.size(), &Solo);
        let rough = Ownership::along(comm.rank(), comm.size(), boundaries);
        let entry = |bin: Bin| (rough.owner_at(bin[0]), bin);
        let messages = MessageBuffer::of_entries(local.into_iter().map(entry).collect());
        let mut bins: Vec<Bin> = comm.sparse_all_to_all(messages).values();
        let boxed = |interval| area::of_boxes(self.rules, fine, light, &interval);
        bins.extend(rough.intervals().flat_map(boxed));
        combine(&mut bins, u64::wrapping_add);
        Ownership::along(comm.rank(), comm.size(), curve::partition(&bins, comm.size(), comm))
    }

    /// The bins of all ranks, the same on all ranks, by octants of a level; in boxes by larger ones as far as these have no more leaves than a
    /// `per_rank`-th of a rank's share. In that, leaves in boxes count as `boxed`: as none for base leaves, which METIS takes for octants of
    /// one level. Before the bins the number of leaves that need not be resolved further after that, at least 1. Collective.
    fn all_bins(&self, local: &[Bin], level: Level, boxed: u64, per_rank: u64) -> (u64, Vec<Bin>) {
        let comm = self.comm;
        let shift = 3 * (LEVEL_MAX - level);
        let coarse = local.iter().map(|b| [b[0] >> shift << shift, b[1]]).collect();
        let mut bins = all_gather_reduced(coarse, |a, b| a + b, comm);
        let leaves = |bins: &[Bin]| bins.iter().map(|b| b[1] / FRACTIONS).sum::<u64>();
        let light = ((leaves(&bins) + boxed) / (comm.size() as u64 * per_rank)).max(1);
        bins.extend(area::of_boxes(self.rules, level, light, &curve::ALL));
        combine(&mut bins, u64::wrapping_add);
        ((leaves(&bins) / (comm.size() as u64 * FINE_PER_RANK)).max(1), bins)
    }
}

/// Deepest level that base leaves may have.
pub fn level_last(rules: &Rules) -> Level {
    rules.level_deepest().max(1) - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::rules as plain_rules;
    use bricks::octant::{ROOT_EDGE, start57};
    use ranks::sim;

    const RANKS: usize = 9;
    const FINE: Level = 7;

    fn rules(boxes: Vec<ExtentBox>) -> Rules {
        Rules { level_surface: 9, layer_cells_min: 4, boxes, ..plain_rules() }
    }

    /// A sheet of facets, oblique and of all sizes, denser to one side.
    fn sheet() -> Vec<Facet> {
        let at = |i: i32, j: i32| {
            let (x, y) = (i * i * (1 << 15), j * (1 << 21));
            [x, y, (1 << 24) + x / 3 + y / 2]
        };
        let square = |i: i32, j: i32| {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
            [Facet { v: [a, b, c] }, Facet { v: [b, d, c] }]
        };
        (0..50).flat_map(|i| (0..40).flat_map(move |j| square(i, j))).collect()
    }

    /// Owners of the fine octants.
    fn owners(ownership: &Ownership) -> Vec<usize> {
        (0..1 << (3 * FINE)).map(|code| ownership.owner_at(start57(FINE, code))).collect()
    }

    /// The partition on which all ranks agree, where rank `rank_of(i)` has facet number `i` in its slice.
    fn partitioned(rules: &Rules, rank_of: impl Fn(usize) -> usize + Sync) -> Ownership {
        let all = sheet();
        let known = sim::run(RANKS, 5, |comm| {
            let on_this = |(i, f): (usize, &Facet)| (rank_of(i) == comm.rank()).then_some(*f);
            let mine: Vec<Facet> = all.iter().enumerate().filter_map(on_this).collect();
            Estimate { facets: &mine, rules, comm }.by_area([4, FINE, FINE])
        });
        assert!(known.iter().all(|o| o.boundaries() == known[0].boundaries()), "one partition");
        known.into_iter().next().expect("a rank")
    }

    /// Estimated leaves on each rank.
    fn weights(rules: &Rules, owners: &[usize]) -> Vec<u64> {
        let mut bins = area::of(&sheet(), rules, FINE);
        bins.extend(area::of_boxes(rules, FINE, 0, &curve::ALL));
        let mut sums = vec![0; RANKS];
        for [start, weight] in bins {
            sums[owners[(start / start57(FINE, 1)) as usize]] += weight;
        }
        sums
    }

    #[test]
    fn loads_are_equal_and_the_partition_does_not_depend_on_the_slices() {
        let h = ROOT_EDGE >> 3;
        let slab = ExtentBox { min: [h, h, 5 * h], max: [6 * h, 6 * h, 6 * h], level: 8 };
        for boxes in [vec![], vec![slab]] {
            let rules = rules(boxes);
            let ownership = partitioned(&rules, |i| i % RANKS);
            for slices in [|i| i * RANKS / 4000, |_| 3] {
                assert_eq!(partitioned(&rules, slices).boundaries(), ownership.boundaries());
            }
            let owners = owners(&ownership);
            assert!(owners.is_sorted());
            let sums = weights(&rules, &owners);
            let mean = sums.iter().sum::<u64>() as f64 / RANKS as f64;
            let far = |&w: &u64| (w as f64 / mean - 1.0).abs() > 0.1;
            assert!(!sums.iter().any(far), "{sums:?}");
        }
    }

    #[test]
    fn base_leaves_of_equal_weight_are_divided_along_the_curve() {
        let rules = rules(vec![]);
        let division =
            |weights, level_base| Division { weights, level_base, ..Division::default() };
        let of = |division: Division| {
            let known = sim::run(RANKS, 5, |comm| {
                let mine: Vec<Facet> =
                    sheet().into_iter().skip(comm.rank()).step_by(RANKS).collect();
                let estimate = Estimate { facets: &mine, rules: &rules, comm };
                estimate.partition(&division).expect("no METIS")
            });
            let same = |p: &Partition| p.ownership.boundaries() == known[0].ownership.boundaries();
            assert!(known.iter().all(same), "all ranks have the same partition");
            known.into_iter().next().expect("a rank")
        };
        let area = of(division(Weights::Area, Some(FINE)));
        assert_eq!(area.level_base, FINE);
        let sums = weights(&rules, &owners(&area.ownership));
        let mean = sums.iter().sum::<u64>() as f64 / RANKS as f64;
        assert!(sums.iter().all(|&w| (w as f64 / mean - 1.0).abs() < 0.1), "{sums:?}");
        let unit = of(division(Weights::Unit, Some(FINE)));
        assert_ne!(unit.ownership.boundaries(), area.ownership.boundaries());
        for level in [0, 2] {
            let coarse = of(division(Weights::Rebalance, Some(level)));
            let is_between = |&(at, _): &(u64, usize)| at % start57(level, 1) == 0;
            assert!(
                coarse.ownership.boundaries().iter().all(is_between) && coarse.level_base == level
            );
        }
    }

    #[test]
    fn boxes_are_resolved_to_the_parts_of_ranks_where_facets_are_few() {
        let h = ROOT_EDGE / 2;
        let half = ExtentBox { min: [0; 3], max: [2 * h, 2 * h, h], level: 9 };
        let rules = rules(vec![half]);
        let facets = &sheet()[..1];
        let bins = sim::run(RANKS, 5, |comm| {
            let local = area::of(facets, &rules, FINE);
            let in_boxes = area::leaves_in_boxes(0, 0, &rules);
            let (light, bins) =
                Estimate { facets, rules: &rules, comm }.all_bins(&local, FINE, in_boxes, 1);
            assert!(light >= 1, "a leaf need not be resolved");
            bins.len()
        });
        assert!(bins.iter().all(|n| (RANKS..=8 * RANKS + 8).contains(n)), "{bins:?}");
    }

    #[test]
    fn levels_follow_from_the_leaves_of_facets_and_boxes_together() {
        let levels = |facets: &[Facet], boxes: Vec<ExtentBox>| {
            let rules = rules(boxes);
            let of_rank = |comm: &dyn Comm| {
                let mine = if comm.rank() == 0 { facets } else { &[] };
                Estimate { facets: mine, rules: &rules, comm }.levels()
            };
            sim::run(RANKS, 5, |comm| of_rank(comm))
        };
        let (all, h) = (sheet(), ROOT_EDGE / 2);
        let box_of = |edge: i64| ExtentBox { min: [0; 3], max: [edge; 3], level: 9 };
        assert_eq!(levels(&all, vec![box_of(h >> 6)]), levels(&all, vec![]), "a small box");
        // An eighth of the root for nine ranks, with a quarter and with sixteen parts each, in octants a quarter as large.
        for [coarse, fine, _] in levels(&all[..1], vec![box_of(h)]) {
            assert!(coarse <= 3 && (4..=5).contains(&fine), "few facets: {coarse} {fine}");
        }
        // The box has most leaves, and octants of a few of them are far finer than the surface.
        let deep = ExtentBox { min: [0; 3], max: [256 * edge(18); 3], level: 18 };
        let alone = levels(&all, vec![])[0];
        for [_, fine, of_facets] in levels(&all, vec![deep]) {
            assert!(fine >= 13 && of_facets == alone[2], "{fine} {of_facets}");
        }
        let rules = rules(vec![deep]);
        let unit = Division { weights: Weights::Unit, ..Division::default() };
        let of_unit = sim::run(RANKS, 5, |comm| {
            let mine = if comm.rank() == 0 { &all[..] } else { &[] };
            let estimate = Estimate { facets: mine, rules: &rules, comm };
            estimate.partition(&unit).expect("no METIS").level_base
        });
        assert_eq!(of_unit, [alone[2] + 2; RANKS], "facets would be in many octants");
    }

    #[test]
    fn a_cell_of_a_box_is_not_divided() {
        let h = ROOT_EDGE / 4;
        let cell = ExtentBox { min: [h; 3], max: [2 * h; 3], level: 2 };
        let rules = rules(vec![cell]);
        let bins = sim::run(RANKS, 5, |comm| {
            let estimate = Estimate { facets: &[], rules: &rules, comm };
            [0, 1].map(|in_boxes| estimate.all_bins(&[], FINE, in_boxes, 1).1.len())
        });
        assert_eq!(bins, [[1; 2]; RANKS]);
    }

    #[test]
    fn without_any_facet_one_rank_owns_everything() {
        let owners = sim::run(3, 1, |comm| {
            let ownership =
                Estimate { facets: &[], rules: &rules(vec![]), comm }.by_area([2, 3, 3]);
            ownership.octants().len()
        });
        assert_eq!(owners, [1, 0, 0]);
    }
}
