//! Where the facets' area lies: what leaves are to be expected where.
//!
//! A plane crosses cells, and a layer of cells along it holds cells, in proportion to its area times the
//! sum of its normal's components, as cells and layers are cubes. So area is measured by that norm, in
//! units of a finest cell's face; a facet larger than the octants asked for is split in four until it is
//! not.

use crate::comm::{Comm, Entry, all_gather_reduced};
use crate::facet::Facet;
use crate::lattice::Rules;
use crate::octant::{LEVEL_MAX, Level, edge};
use crate::partition::curve::Bin;
use crate::partition::initial::middle;
use std::ops::Range;

/// Parts of a finest cell's face: sums of integers do not depend on their order.
pub const PARTS: u64 = 1024;

/// Area by place.
#[derive(Debug, Default)]
pub struct Areas {
    /// Level-19 codes of octants with area, ascending.
    starts: Vec<u64>,
    /// Area in all octants before each of them, and in all at the end.
    before: Vec<u64>,
}

/// The area of some facets, by the norm above, in lattice units squared.
pub fn total(facets: &[Facet]) -> f64 {
    facets.iter().map(norm).sum()
}

fn norm(f: &Facet) -> f64 {
    f.normal().iter().map(|c| (*c as f64).abs()).sum::<f64>() * 0.5
}

impl Areas {
    /// Gathers the area of all ranks' facets by octants of a level. Collective.
    pub fn gather(facets: &[Facet], rules: &Rules, level: Level, comm: &dyn Comm) -> Self {
        let mut areas = Self::default();
        let mine = of(facets, rules, level).into_iter().map(Entry::from).collect();
        areas.set(&all_gather_reduced(mine, |a, b| a + b, comm));
        areas
    }

    fn set(&mut self, entries: &[Entry]) {
        self.starts = entries.iter().map(|e| e[0]).collect();
        self.before = vec![0];
        let sums = entries.iter().scan(0, |sum, e| {
            *sum += e[1];
            Some(*sum)
        });
        self.before.extend(sums);
    }

    /// The octants with area, by number.
    pub fn places(&self) -> Range<usize> {
        0..self.starts.len()
    }

    /// Those, by number, whose level-19 codes are in `span`, which are among some.
    pub fn places_within(&self, among: &Range<usize>, span: Range<u64>) -> Range<usize> {
        let part = &self.starts[among.clone()];
        let first = part.partition_point(|s| *s < span.start);
        let count = part[first..].partition_point(|s| *s < span.end);
        among.start + first..among.start + first + count
    }

    /// Finest cells' faces in some of them.
    pub fn cells(&self, places: &Range<usize>) -> u64 {
        // Unit weights gather nothing.
        if places.is_empty() {
            return 0;
        }
        (self.before[places.end] - self.before[places.start]) / PARTS
    }
}

/// Octants, a power of two, that may come in turns without being weighed anew each time: facets often come in strips.
const IN_TURNS: usize = 8192;

/// Facets that are looked at, of many that are small.
const SAMPLE: usize = 2048;

/// The area of some facets by octants of a level, in `PARTS` of a finest cell's face; some octants more than once. Of many
/// facets, each in about one octant, some stand for all.
pub fn of(facets: &[Facet], rules: &Rules, level: Level) -> Vec<Bin> {
    let cell = edge(rules.level_surface) as f64;
    let (shift, scale) = (3 * (LEVEL_MAX - level), PARTS as f64 / (cell * cell));
    let mut bins: Vec<Bin> = Vec::new();
    // The bin that an octant had last, by the last bits of its code.
    let mut last = vec![0u32; IN_TURNS];
    let mut add = |at: u64, area: f64| {
        let (code, area) = (at >> shift, (area * scale) as u64);
        let last = &mut last[code as usize % IN_TURNS];
        match bins.get_mut(*last as usize).filter(|bin| bin.0 == code << shift) {
            Some(bin) => bin.1 += area,
            None => {
                *last = bins.len() as u32;
                bins.push((code << shift, area));
            }
        }
    };
    // Odd, as facets come in pairs.
    let every = (facets.len() / SAMPLE) | 1;
    for some in facets.chunks(every) {
        some.iter()
            .filter(|f| is_wide(f, edge(level)))
            .for_each(|f| spread(f, edge(level), &mut add));
        if !is_wide(&some[0], edge(level)) {
            spread(&some[0], edge(level), &mut |at, area| add(at, area * every as f64));
        }
    }
    bins
}

/// Whether a facet's extent is greater than `extent`.
#[inline]
fn is_wide(f: &Facet, extent: i64) -> bool {
    (0..3).any(|a| f.range(a).1 - f.range(a).0 > extent)
}

/// Tells the facet's area to `add`, in pieces whose extent is at most `extent`.
fn spread(f: &Facet, extent: i64, add: &mut impl FnMut(u64, f64)) {
    if !is_wide(f, extent) {
        if let Some(at) = middle(f) {
            add(at, norm(f));
        }
        return;
    }
    let half = |i: usize, j: usize| -> [i32; 3] {
        std::array::from_fn(|a| ((i64::from(f.v[i][a]) + i64::from(f.v[j][a])) / 2) as i32)
    };
    let (ab, bc, ca) = (half(0, 1), half(1, 2), half(2, 0));
    for v in [[f.v[0], ab, ca], [ab, f.v[1], bc], [ca, bc, f.v[2]], [ab, bc, ca]] {
        spread(&Facet { v }, extent, add);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::Solo;
    use crate::lattice::{Keep, Root};
    use crate::octant::{ROOT_EDGE, start57};
    use crate::partition::curve;

    fn rules(level_surface: Level) -> Rules {
        Rules {
            root: Root { origin: [0.0; 3], edge: 1.0 },
            level_surface,
            layer_cells_min: 4,
            keep: Keep::Outside,
            keep_crossing: true,
            boxes: Vec::new(),
        }
    }

    #[test]
    fn a_large_facet_is_spread_over_the_octants_that_it_crosses() {
        // Half of the face of an octant of level 1, in the plane z = 1.
        let h = (ROOT_EDGE / 2) as i32;
        let f = Facet { v: [[0, 0, 1], [h, 0, 1], [0, h, 1]] };
        let areas = Areas::gather(&[f], &rules(6), 4, &Solo);
        let cells = |l: Level, code: u64| {
            let span = start57(l, code)..start57(l, code + 1);
            areas.cells(&areas.places_within(&areas.places(), span))
        };
        // 32 x 32 finest cells, half of them covered.
        assert_eq!((cells(0, 0), cells(1, 0), cells(1, 1)), (512, 512, 0));
        let parts: Vec<u64> = (0..8).map(|child| cells(2, child)).collect();
        let total: u64 = parts.iter().sum();
        assert!(total.abs_diff(512) <= 4, "{parts:?}");
        // The octant at the right angle is covered whole, its neighbours half.
        assert!(parts[0].abs_diff(256) <= 32 && parts[1].abs_diff(128) <= 32, "{parts:?}");
    }

    #[test]
    fn of_many_small_facets_some_stand_for_all_and_large_ones_are_all_counted() {
        // A sheet of 140 x 140 squares over a quarter of a face of the root; a large facet in the quarter opposite.
        let (n, level) = (140, 4);
        let step = (ROOT_EDGE / 2) as i32 / n;
        let at = |i: i32, j: i32| [i * step, j * step, 1];
        let square = |i: i32, j: i32| {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
            [Facet { v: [a, b, c] }, Facet { v: [b, d, c] }]
        };
        let mut all: Vec<Facet> =
            (0..n).flat_map(|i| (0..n).flat_map(move |j| square(i, j))).collect();
        let h = (ROOT_EDGE / 2) as i32;
        // Not the first of those that one stands for.
        all.insert(7, Facet { v: [[h, h, 1], [2 * h - 1, h, 1], [h, 2 * h - 1, 1]] });
        assert!(all.len() / SAMPLE > 10);
        let mut sampled = of(&all, &rules(9), level);
        curve::merge(&mut sampled);
        let mut exact: Vec<Bin> =
            all.chunks(SAMPLE / 2).flat_map(|f| of(f, &rules(9), level)).collect();
        curve::merge(&mut exact);
        assert_eq!(sampled.len(), exact.len());
        for (s, e) in sampled.iter().zip(&exact) {
            let tolerated = if s.0 >= start57(1, 3) { 0 } else { e.1 / 5 };
            assert!(s.0 == e.0 && s.1.abs_diff(e.1) <= tolerated, "{s:?} for {e:?}");
        }
        let sum = |bins: &[Bin]| bins.iter().map(|b| b.1).sum::<u64>();
        assert!(sum(&sampled).abs_diff(sum(&exact)) < sum(&exact) / 100);
    }

    #[test]
    fn an_oblique_facet_counts_by_the_cells_that_it_crosses() {
        let h = (ROOT_EDGE / 2) as i32;
        let oblique = Facet { v: [[h, 0, 0], [0, h, 0], [0, 0, h]] };
        // Its shadows on the three coordinate planes together.
        assert_eq!(total(&[oblique]), 1.5 * f64::from(h) * f64::from(h));
    }
}
