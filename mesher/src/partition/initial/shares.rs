//! Equal shares of the Morton curve, by the leaves to expect.
//!
//! Nobody need know all of it. Where the weight lies roughly, all ranks are told; that cuts the curve roughly. What a
//! rank's facets weigh in small octants goes to whoever has the rough share that they lie in; so each rank knows one
//! stretch of the curve exactly, and the true cuts follow from the sums of the stretches.

use super::cut::Cut;
use crate::comm::{Comm, MessageBuffer, all_gather_reduced};
use crate::facet::Facet;
use crate::lattice::Rules;
use crate::octant::{LEVEL_MAX, Level, start57};
use crate::partition::area::{self, PARTS};
use crate::partition::curve::{self, Bin};
use crate::partition::ownership::Ownership;
use crate::partition::thickness;

/// Shares by the facets' area, roughly in octants of the first level, finally in those of the second. Collective.
pub fn by_area(facets: &[Facet], rules: &Rules, levels: [Level; 2], comm: &dyn Comm) -> Ownership {
    let [coarse, fine] = levels;
    let mine = expected(facets, rules, fine);
    let shift = 3 * (LEVEL_MAX - coarse);
    let roughly = mine.iter().map(|b| [b.0 >> shift << shift, b.1]).collect();
    let told = all_gather_reduced(roughly, |a, b| a + b, comm);
    let mut bins: Vec<Bin> = told.into_iter().map(|e| (e[0], e[1])).collect();
    let leaves = |bins: &[Bin]| bins.iter().map(|b| b.1 / PARTS).sum::<u64>();
    let light = leaves(&bins) / comm.size() as u64;
    curve::add_boxes(&mut bins, rules, coarse, light, PARTS, &curve::ALL);
    curve::merge(&mut bins);
    let bins = Bins { light: leaves(&bins) / (comm.size() as u64 * super::CUT_PARTS), bins };
    finely(&bins, mine, rules, fine, |_, _| {}, comm)
}

/// Shares by what a rehearsal told of the pieces of a cut; within a piece by the facets' area, in octants of level
/// `fine`. Collective.
pub fn by_rehearsal(
    facets: &[Facet],
    rules: &Rules,
    cut: &Cut,
    told: &[u64],
    fine: Level,
    comm: &dyn Comm,
) -> Ownership {
    let start = |i: usize| start57(cut.pieces[i].level, cut.pieces[i].code);
    let bins = told.iter().enumerate().map(|(i, &leaves)| (start(i), leaves.saturating_mul(PARTS)));
    let light = told.iter().sum::<u64>() / (comm.size() as u64 * super::CUT_PARTS);
    let mut mine = expected(facets, rules, fine);
    for b in &mut mine {
        let i = cut.pieces.partition_point(|p| start57(p.level, p.code) <= b.0) - 1;
        let ratio = told[i] as f64 / cut.pieces[i].weight as f64;
        b.1 = (b.1 as f64 * ratio.min(1.0)) as u64;
    }
    // What a piece has more than area lets expect is taken to be at its corner; pieces are small.
    let more = |bins: &mut Vec<Bin>, ownership: &Ownership| {
        for (i, (piece, &leaves)) in cut.pieces.iter().zip(told).enumerate() {
            if ownership.owner_at(start(i)) == comm.rank() {
                bins.push((start(i), leaves.saturating_sub(piece.weight).saturating_mul(PARTS)));
            }
        }
    };
    finely(&Bins { bins: bins.collect(), light }, mine, rules, fine, more, comm)
}

/// Leaves to expect along some facets, in `PARTS`, by octants of a level.
fn expected(facets: &[Facet], rules: &Rules, level: Level) -> Vec<Bin> {
    let mut bins = area::of(facets, rules, level);
    bins.iter_mut().for_each(|b| b.1 = b.1.saturating_mul(thickness(rules)));
    curve::merge(&mut bins);
    bins
}

/// What all ranks know.
struct Bins {
    bins: Vec<Bin>,
    /// Leaves that need not be told apart.
    light: u64,
}

/// Cuts the curve where bins in which all ranks have parts, `mine` here, ask for it; `more` adds what is this
/// rank's to know in rough shares. Collective.
fn finely(
    known: &Bins,
    mine: Vec<Bin>,
    rules: &Rules,
    fine: Level,
    more: impl Fn(&mut Vec<Bin>, &Ownership),
    comm: &dyn Comm,
) -> Ownership {
    let everything = || vec![(0, 0)];
    let changes = curve::cut_known(&known.bins, comm.size()).unwrap_or_else(everything);
    let roughly = Ownership::along(comm.rank(), comm.size(), changes);
    let told = |(start, weight)| (roughly.owner_at(start), [start, weight]);
    let heard =
        comm.sparse_all_to_all(MessageBuffer::of_entries(mine.into_iter().map(told).collect()));
    let mut bins: Vec<Bin> = heard.words().as_chunks().0.iter().map(|&[at, w]| (at, w)).collect();
    more(&mut bins, &roughly);
    for interval in roughly.intervals() {
        curve::add_boxes(&mut bins, rules, fine, known.light, PARTS, &interval);
    }
    curve::merge(&mut bins);
    let changes = curve::cut(&bins, comm).unwrap_or_else(everything);
    Ownership::along(comm.rank(), comm.size(), changes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::sim;
    use crate::lattice::{ExtentBox, Keep, Root};
    use crate::octant::{ROOT_BITS, ROOT_EDGE};

    const RANKS: usize = 9;
    const FINE: Level = 7;

    fn rules(boxes: Vec<ExtentBox>) -> Rules {
        Rules {
            root: Root { origin: [0.0; 3], edge: 1.0 },
            level_surface: 9,
            layer_cells_min: 4,
            keep: Keep::All,
            keep_crossing: true,
            boxes,
        }
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

    /// The shares as all ranks see them, facet number `i` being on rank `dealt(i)`.
    fn shares(rules: &Rules, dealt: impl Fn(usize) -> usize + Sync) -> Vec<usize> {
        let all = sheet();
        let seen = sim::run(RANKS, 5, |comm| {
            let on_this = |(i, f): (usize, &Facet)| (dealt(i) == comm.rank()).then_some(*f);
            let mine: Vec<Facet> = all.iter().enumerate().filter_map(on_this).collect();
            let ownership = by_area(&mine, rules, [4, FINE], comm);
            (0..1 << (3 * FINE))
                .map(|code| ownership.owner_at(start57(FINE, code)))
                .collect::<Vec<_>>()
        });
        assert!(seen.iter().all(|s| *s == seen[0]), "all ranks see the same");
        seen.into_iter().next().unwrap_or_default()
    }

    /// What each rank has, by the area and the boxes.
    fn weights(rules: &Rules, owners: &[usize]) -> Vec<u64> {
        let mut bins = expected(&sheet(), rules, FINE);
        curve::add_boxes(&mut bins, rules, FINE, 0, PARTS, &curve::ALL);
        let mut sums = vec![0; RANKS];
        for (start, weight) in bins {
            sums[owners[(start / start57(FINE, 1)) as usize]] += weight;
        }
        sums
    }

    #[test]
    fn shares_are_equal_however_the_facets_come() {
        let h = ROOT_EDGE >> 3;
        let slab = ExtentBox { min: [h, h, 5 * h], max: [6 * h, 6 * h, 6 * h], level: 8 };
        assert_eq!(ROOT_EDGE, 1 << ROOT_BITS);
        for boxes in [vec![], vec![slab]] {
            let rules = rules(boxes);
            let owners = shares(&rules, |i| i % RANKS);
            assert_eq!(owners, shares(&rules, |i| i * RANKS / 4000));
            assert_eq!(owners, shares(&rules, |_| 3), "one rank may have all facets");
            assert!(owners.is_sorted());
            let sums = weights(&rules, &owners);
            let mean = sums.iter().sum::<u64>() as f64 / RANKS as f64;
            let far = |&w: &u64| (w as f64 / mean - 1.0).abs() > 0.1;
            assert!(!sums.iter().any(far), "{sums:?}");
        }
    }

    #[test]
    fn where_nothing_is_one_rank_has_all() {
        let owners = sim::run(3, 1, |comm| {
            let ownership = by_area(&[], &rules(vec![]), [2, 3], comm);
            ownership.octants().len()
        });
        assert_eq!(owners, [1, 0, 0]);
    }
}
