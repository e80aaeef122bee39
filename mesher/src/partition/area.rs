//! Estimates of the number of leaves, from the areas of facets and the volumes of boxes.
//!
//! The number of cells that a plane crosses, and that a layer along it holds, is proportional to its area times the sum of
//! the components of its unit normal, as cells are cubes. So area is measured in that norm, in units of a face of a finest
//! cell. A facet wider than the octants of interest is measured at points.

use crate::input::lattice::{ExtentBox, Rules};
use crate::partition::curve::Bin;
use bricks::facet::Facet;
use bricks::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE, corner, edge, morton, start57};
use ranks::{Comm, combine};
use std::ops::Range;

/// Fractions of a leaf that leaves are counted in: sums of integers do not depend on their order.
pub const FRACTIONS: u64 = 1024;

/// Estimated leaves of the mesh per face of a finest cell: the layers on the kept side, a third of them being coarser.
pub fn leaves_per_surface_cell(rules: &Rules) -> u64 {
    (u64::from(rules.layer_cells_min) + 2) * 4 / 3
}

/// The number of leaves that the boxes ask for in an octant.
pub fn leaves_in_boxes(l: Level, code: u64, rules: &Rules) -> u64 {
    let (min, h) = (corner(l, code), edge(l));
    let leaves = |b: &ExtentBox| {
        let span = |a: usize| (b.max[a].min(min[a] + h) - b.min[a].max(min[a])).max(0);
        (0..3).map(|a| (span(a) as u64).div_ceil(edge(b.level) as u64)).product::<u64>()
    };
    rules.boxes.iter().map(leaves).max().unwrap_or(0)
}

/// The leaves that the boxes ask for within an interval of the curve, in [`FRACTIONS`]: by octants of `level`, or larger ones
/// that hold no more than `light` leaves.
pub fn of_boxes(rules: &Rules, level: Level, light: u64, within: &Range<u64>) -> Vec<Bin> {
    let (mut bins, mut open) = (Vec::new(), vec![(0, 0)]);
    while let Some((l, code)) = open.pop() {
        let span = start57(l, code)..start57(l, code + 1);
        let leaves = leaves_in_boxes(l, code, rules);
        if leaves == 0 || span.end <= within.start || within.end <= span.start {
            continue;
        }
        let inside = within.start <= span.start && span.end <= within.end;
        if l >= level || inside && leaves <= light {
            bins.push([span.start, leaves.saturating_mul(FRACTIONS)]);
        } else {
            open.extend((0..8).map(|child| (l + 1, code << 3 | child)));
        }
    }
    bins
}

/// The number of leaves near the facets of all ranks. Collective.
pub fn leaves_at_surface(facets: &[Facet], rules: &Rules, comm: &dyn Comm) -> f64 {
    let area: f64 = facets.iter().map(area_in_root).sum();
    // Whole faces of finest cells: a sum of integers does not depend on its order.
    let faces = comm.sum((area / (edge(rules.level_surface) as f64).powi(2)) as u64);
    leaves_per_surface_cell(rules) as f64 * faces as f64
}

/// The area of a facet within the root, about.
fn area_in_root(f: &Facet) -> f64 {
    if (0..3).map(|a| f.range(a)).all(|(lo, hi)| 0 <= lo && hi <= ROOT_EDGE) {
        return norm(f);
    }
    let mut area = 0.0;
    spread(f, edge(5), &mut |_, part| area += part);
    area
}

/// The area of a facet, in lattice units squared.
fn norm(f: &Facet) -> f64 {
    f.normal().iter().map(|c| (*c as f64).abs()).sum::<f64>() * 0.5
}

/// Number of facets in the sample, if there are many small ones.
const SAMPLE: usize = 2048;

/// Estimated leaves of the mesh near some facets, in [`FRACTIONS`], by octants of a level. Of many facets that are smaller than such an
/// octant, a sample is measured.
pub fn of(facets: &[Facet], rules: &Rules, level: Level) -> Vec<Bin> {
    let (cell, size) = (edge(rules.level_surface) as f64, edge(level));
    let (shift, scale) = (3 * (LEVEL_MAX - level), FRACTIONS as f64 / (cell * cell));
    let mut bins: Vec<Bin> = Vec::new();
    let each = leaves_per_surface_cell(rules);
    let mut add = |start: u64, area: f64| {
        let leaves = ((area * scale) as u64).saturating_mul(each);
        bins.push([start >> shift << shift, leaves]);
    };
    // Odd, as facets come in pairs.
    let every = (facets.len() / SAMPLE) | 1;
    for some in facets.chunks(every) {
        some.iter().filter(|f| width(f) > size).for_each(|f| spread(f, size, &mut add));
        if width(&some[0]) <= size {
            spread(&some[0], size, &mut |start, area| add(start, area * every as f64));
        }
    }
    combine(&mut bins, u64::wrapping_add);
    bins
}

/// The greatest extent of a facet along an axis.
#[inline]
fn width(f: &Facet) -> i64 {
    (0..3).map(|a| f.range(a)).fold(0, |all, (lo, hi)| all.max(hi - lo))
}

/// Most points of a facet: the parts of ten thousand ranks may lie on it.
const POINTS_MAX: f64 = (1 << 20) as f64;

/// Calls `add` with the positions of points of a facet, as far as they are in the root, and the area that each stands for: its centroid alone
/// if it is no wider than octants of the given size, and otherwise about four for the area of such an octant's face and two for its edge; of
/// thin facets fewer, each for a twentieth of that area. A needle across the root, halved until its parts are small, would have billions.
fn spread(f: &Facet, size: i64, add: &mut impl FnMut(u64, f64)) {
    if (0..3).map(|a| f.range(a)).any(|(lo, hi)| hi < 0 || ROOT_EDGE < lo) {
        return;
    }
    let ([a, b, c], area) = (f.v.map(|v| v.map(f64::from)), norm(f));
    let (faces, edges) = (area / (size as f64).powi(2), width(f) as f64 / size as f64);
    let many = (4.0 * faces + (2.0 * edges).min(16.0 * faces)).ceil();
    let count = if edges > 1.0 { many.min(POINTS_MAX) } else { 1.0 };
    for i in 0..count as u64 {
        // A sequence of low discrepancy in the unit square (Roberts, 2018), of which the half beyond the diagonal is turned over.
        let [u, v] = [0.7548776662466927, 0.5698402909980532]
            .map(|step| (1.0 / 3.0 + i as f64 * step).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let at = [0, 1, 2].map(|k| (a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])) as i64);
        // Facets in the maximum faces of the root are crossed by the leaves within.
        if at.iter().all(|c| (0..=ROOT_EDGE).contains(c)) {
            let leaf = at.map(|c| (c.min(ROOT_EDGE - 1) >> (ROOT_BITS - LEVEL_MAX)) as u32);
            add(morton(leaf), area / count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::lattice::Keep;
    use crate::partition::curve;
    use crate::tests::rules as plain_rules;
    use bricks::octant::position;
    use ranks::Solo;

    fn rules(level_surface: Level) -> Rules {
        Rules { level_surface, layer_cells_min: 4, keep: Keep::Outside, ..plain_rules() }
    }

    #[test]
    fn the_area_of_a_large_facet_is_spread_over_the_octants_that_it_crosses() {
        // Half of the face of an octant of level 1, in the plane z = 1.
        let h = (ROOT_EDGE / 2) as i32;
        let f = Facet { v: [[0, 0, 1], [h, 0, 1], [0, h, 1]] };
        let bins = of(&[f], &rules(6), 4);
        let cells = |l: Level, code: u64| {
            let span = start57(l, code)..start57(l, code + 1);
            let inside = bins.iter().filter(|b| span.contains(&b[0]));
            inside.map(|b| b[1]).sum::<u64>() / FRACTIONS / leaves_per_surface_cell(&rules(6))
        };
        // 32 x 32 finest cells, half of them covered.
        assert!((511..=512).contains(&cells(0, 0)));
        assert_eq!((cells(1, 0), cells(1, 1)), (cells(0, 0), 0));
        let parts: Vec<u64> = (0..8).map(|child| cells(2, child)).collect();
        let total: u64 = parts.iter().sum();
        assert!(total.abs_diff(512) <= 4, "{parts:?}");
        // The octant at the right angle is fully covered, its neighbours half.
        assert!(parts[0].abs_diff(256) <= 32 && parts[1].abs_diff(128) <= 32, "{parts:?}");
    }

    #[test]
    fn needles_and_lines_across_the_root_take_few_points() {
        let end = ROOT_EDGE as i32;
        let needle = |width: i32| Facet { v: [[0; 3], [width, 0, 0], [end, end / 2, end / 3]] };
        let bins = |width: i32| of(&[needle(width)], &rules(19), 18);
        assert!(bins(0).iter().all(|b| b[1] == 0) && bins(0).len() < 2);
        // Half as wide as an octant of level 18.
        let all = bins(1 << (ROOT_BITS - 19));
        assert!((1 << 16..1 << 20).contains(&all.len()), "{} octants", all.len());
        // The quarter of its length at its wide end has 7 / 16 of its area.
        let near = all.iter().filter(|b| position(b[0])[0] < 1 << 17);
        let [near, whole] = [near.map(|b| b[1]).sum(), all.iter().map(|b| b[1]).sum::<u64>()];
        assert!((16 * near).abs_diff(7 * whole) < whole / 10, "{near} of {whole}");
    }

    #[test]
    fn what_is_outside_the_root_does_not_count() {
        // A square in the plane z = 1, a quarter of it in the root.
        let (h, rules) = ((ROOT_EDGE / 2) as i32, rules(6));
        let [a, b, c, d] = [[-h, -h, 1], [h, -h, 1], [-h, h, 1], [h, h, 1]];
        let square = [Facet { v: [a, b, c] }, Facet { v: [b, d, c] }];
        let bins = of(&square, &rules, 4);
        assert!(bins.iter().all(|b| b[0] < start57(1, 4)), "{bins:?}");
        let leaves = bins.iter().map(|b| b[1]).sum::<u64>() / FRACTIONS;
        let want = 32 * 32 * leaves_per_surface_cell(&rules);
        assert!(leaves.abs_diff(want) < want / 20, "{leaves} for {want}");
        let all = leaves_at_surface(&square, &rules, &Solo);
        assert!((all as u64).abs_diff(want) < want / 20, "{all} for {want}");
        let end = ROOT_EDGE as i32;
        let ceiling = square.map(|f| Facet { v: f.v.map(|[x, y, _]| [x, y, end]) });
        assert_eq!(leaves_at_surface(&ceiling, &rules, &Solo), all);
        let beyond = Facet { v: [[-9, 1, 1], [-9, h, 1], [-9, 1, h]] };
        assert_eq!(leaves_at_surface(&[beyond], &rules, &Solo), 0.0);
    }

    #[test]
    fn a_small_facet_counts_at_its_centroid() {
        // Its extent has its middle in another octant.
        let (l, h) = (4, edge(4) as i32);
        let f = Facet { v: [[h + 1, 1, 1], [h + 1, 1, h], [2, h, 1]] };
        let bins = of(&[f], &rules(9), l);
        assert_eq!(bins.iter().map(|b| b[0]).collect::<Vec<_>>(), [0]);
        let g = Facet { v: [[h + 1, 1, 1], [h + 1, 1, h], [h / 2 + 2, h, 1]] };
        assert!(of(&[g], &rules(9), l).iter().all(|b| b[0] == 0));
    }

    #[test]
    fn small_facets_are_sampled_and_large_ones_are_all_measured() {
        // A sheet of 140 x 140 squares over a quarter of a face of the root; one large facet in the opposite quarter.
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
        // Not the facet that the sample takes.
        all.insert(7, Facet { v: [[h, h, 1], [2 * h - 1, h, 1], [h, 2 * h - 1, 1]] });
        assert!(all.len() / SAMPLE > 10);
        let sampled = of(&all, &rules(9), level);
        let mut exact: Vec<Bin> =
            all.chunks(SAMPLE / 2).flat_map(|f| of(f, &rules(9), level)).collect();
        combine(&mut exact, u64::wrapping_add);
        assert_eq!(sampled.len(), exact.len());
        for (s, e) in sampled.iter().zip(&exact) {
            let tolerated = if s[0] >= start57(1, 3) { 0 } else { e[1] / 5 };
            assert!(s[0] == e[0] && s[1].abs_diff(e[1]) <= tolerated, "{s:?} for {e:?}");
        }
        let sum = |bins: &[Bin]| bins.iter().map(|b| b[1]).sum::<u64>();
        assert!(sum(&sampled).abs_diff(sum(&exact)) < sum(&exact) / 100);
    }

    #[test]
    fn an_oblique_facet_counts_by_the_cells_that_it_crosses() {
        let h = (ROOT_EDGE / 2) as i32;
        let oblique = Facet { v: [[h, 0, 0], [0, h, 0], [0, 0, h]] };
        // The sum of its projections onto the three coordinate planes.
        assert_eq!(norm(&oblique), 1.5 * f64::from(h) * f64::from(h));
    }

    #[test]
    fn bins_of_boxes_hold_the_leaves_that_the_boxes_ask_for() {
        let h = 1i64 << (ROOT_BITS - 6);
        // 5 x 20 x 33 cells of level 6, at odd positions.
        let (min, max) = ([h * 3, h * 7, h * 11], [h * 8, h * 27, h * 44]);
        let boxes = vec![ExtentBox { min, max, level: 6 }];
        let rules = Rules { level_surface: 6, boxes, ..plain_rules() };
        let weights = |level: Level, light: u64, within: &Range<u64>| {
            let mut bins = of_boxes(&rules, level, light, within);
            combine(&mut bins, u64::wrapping_add);
            bins
        };
        let sum = |bins: &[Bin]| bins.iter().map(|b| b[1]).sum::<u64>();
        for (level, light) in [(2, 0), (5, 0), (6, 0), (5, 100), (5, 3300)] {
            let bins = weights(level, light, &curve::ALL);
            assert_eq!(sum(&bins), FRACTIONS * 5 * 20 * 33, "level {level}, light {light}");
            assert!(bins.iter().all(|b| b[0].trailing_zeros() >= 3 * (LEVEL_MAX - level)));
            let middle = start57(5, 12_345);
            let halves =
                [0..middle, middle..curve::ALL.end].map(|half| sum(&weights(5, light, &half)));
            assert_eq!(halves[0] + halves[1], FRACTIONS * 3300, "each bin belongs to one interval");
        }
        assert_eq!(weights(5, 3300, &curve::ALL).len(), 1, "light octants are not divided");
    }
}
