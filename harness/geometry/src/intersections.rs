//! Self-intersections, exactly, on the lattice.
//!
//! Two convex sets have a common point in their interiors unless a plane separates them. For two triangles one
//! of finitely many planes does: with the normal of a triangle, or normal to an edge of each; in a common plane,
//! normal to an edge of either.

use contract::lattice::{FacetLattice, bounds, cross, difference, dot, normal};
use contract::parity::Parity;

use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::shells::Shells;
use super::tree::{FacetTree, from_least};
use std::collections::{BTreeMap, HashMap};
use std::iter::repeat_n;

/// A pair that a shift of this length separates, in lattice units, intersects by the rounding of its vertices or is back to back in
/// one plane. Neither makes two volumes overlap, but the latter is a wall, which matters if the inside is meshed.
const ROUNDING: f64 = 2.0;

/// The search ends when it has found this number of pairs.
const PAIRS_MAX: usize = 1 << 22;

/// Pairs of facets whose interiors intersect, counted once for all copies of each with the same winding. Degenerate facets and pairs of facets with
/// the same vertices are left out.
pub fn intersections(input: &Input, tree: &FacetTree, shells: &Shells, first: usize) -> Finding {
    let facet = |f: u32| &input.case.facets_lattice[f as usize];
    let has_area = |f: &u32| normal(facet(*f)) != [0; 3];
    let are_same = |a: &FacetLattice, b: &FacetLattice| a.iter().all(|v| b.contains(v));
    let (mut pairs, mut visits): (Vec<(u32, u32)>, _) = (Vec::new(), 0);
    let ends = |pairs: usize, visits| pairs >= PAIRS_MAX || visits > tree.visits_max;
    for &f in tree.firsts.iter().filter(|f| has_area(f)) {
        if ends(pairs.len(), visits) {
            break;
        }
        let others: Vec<u32> = tree.in_box(&tree.triangle(f).local_aabb()).collect();
        visits += others.len() as u64;
        let are_pair = |&g: &u32| {
            has_area(&g) && intersect(facet(f), facet(g)) && !are_same(facet(f), facet(g))
        };
        pairs.extend(others.into_iter().filter(|&g| f < g).filter(are_pair).map(|g| (f, g)));
    }
    let are_meshed = input.are_overlaps_meshed();
    let is_rounding = |&(f, g): &(u32, u32)| {
        let agree = shells.outward(f).zip(shells.outward(g)).map(|(f, g)| f == g);
        let is_opposite = agree.map(|agree| agree == (dot(normal(facet(f)), normal(facet(g))) < 0));
        let is_shifted = is_opposite == Some(true) && !input.are_walls_meshed();
        !are_meshed || depth((facet(f), facet(g)), is_shifted) <= ROUNDING
    };
    pairs.sort_by_cached_key(|pair| (is_rounding(pair), *pair));
    Finding {
        count: pairs.len() as u64,
        count_changing: pairs.partition_point(|pair| !is_rounding(pair)) as u64,
        is_lower_bound: ends(pairs.len(), visits),
        places: pairs.iter().take(first).map(|&(f, g)| place(input, f, g)).collect(),
        ..Finding::new(Kind::Intersections)
    }
}

/// Facets with an even number of solids on their inner side. The surfaces that bound them may cross only where facets of both have
/// edges, so that no pair intersects.
pub fn overlaps(input: &Input, solids: &BTreeMap<u32, i64>, first: usize) -> Finding {
    Finding::at(Kind::Overlaps, input, first, |facet| {
        solids.get(&facet).is_some_and(|count| *count > 0 && count % 2 == 0)
    })
}

/// The number of solids just behind the middle of each facet, on its inner side, but for copies of the same winding. Only closed shells of
/// consistent winding count.
pub fn inner_solids(input: &Input, tree: &FacetTree, shells: &Shells) -> BTreeMap<u32, i64> {
    let outward = |f: u32| {
        let [a, b, c] = input.case.facets_lattice[f as usize];
        Some(if shells.outward(f)? { [a, b, c] } else { [a, c, b] })
    };
    let mut copies: HashMap<FacetLattice, usize> = HashMap::new();
    for facet in (0..).zip(&shells.of).filter_map(|(f, _)| outward(f)) {
        *copies.entry(from_least(facet)).or_default() += 1;
    }
    // Rays count all copies, but an even number of them is like two, and an odd one like one.
    let all: Vec<_> = copies.into_iter().flat_map(|(f, n)| repeat_n(f, 2 - n % 2)).collect();
    let parity = Parity::new(&all);
    let outward = tree.firsts.iter().filter_map(|&f| Some((f, outward(f)?)));
    let solids = outward.filter(|(_, facet)| normal(facet) != [0; 3]).map(|(f, facet)| {
        let n = normal(&facet).map(|c| c as f64);
        let step = 3.0 * ROUNDING / n.iter().map(|c| c * c).sum::<f64>().sqrt();
        let behind =
            |a: usize| (facet[0][a] + facet[1][a] + facet[2][a]) / 3 - (step * n[a]).round() as i64;
        (f, parity.winding(std::array::from_fn(behind), 0)[0])
    });
    solids.collect()
}

/// Whether the interiors of two triangles with area, as sets of their planes, have a common point.
pub fn intersect(a: &FacetLattice, b: &FacetLattice) -> bool {
    axes(a, b).all(|axis| overlap(a, b, axis) > 0)
}

/// An upper bound on the length of the least shift that separates the interiors of two intersecting triangles, in
/// lattice units; 0 in one plane, where the smallest shift along the normal does, if they bound volumes on opposite sides of it. Volumes
/// on the same side are not separated by that shift.
fn depth((a, b): (&FacetLattice, &FacetLattice), is_opposite: bool) -> f64 {
    let along = |axis: [i64; 3]| overlap(a, b, axis) as f64 / (dot(axis, axis) as f64).sqrt();
    axes(a, b).chain(is_opposite.then(|| normal(a))).map(along).fold(f64::INFINITY, f64::min)
}

/// The length in which the projections of two triangles on an axis (up to 2^59) overlap, times that of the axis; not positive if they
/// have no interior point in common.
fn overlap(a: &FacetLattice, b: &FacetLattice, axis: [i64; 3]) -> i128 {
    let ((low_a, high_a), (low_b, high_b)) = (range(a, a[0], axis), range(b, a[0], axis));
    (high_a - low_b).min(high_b - low_a)
}

/// The normals of the planes that can separate two triangles with area, none of them zero.
fn axes(a: &FacetLattice, b: &FacetLattice) -> impl Iterator<Item = [i64; 3]> {
    let n = normal(a);
    // Most pairs need none but the first axis.
    let edge = |f: &FacetLattice, i: usize| difference(f[(i + 1) % 3], f[i]);
    let is_coplanar = range(b, a[0], n) == (0, 0);
    // In one plane: the projection along an axis that is not parallel to the plane.
    let along = (0..3).position(|x| n[x] != 0).expect("the facet has an area");
    let unit = std::array::from_fn(|x| i64::from(x == along));
    let axis = move |i: usize| match (is_coplanar, i) {
        (true, 0..3) => cross(edge(a, i), unit),
        (true, _) => cross(edge(b, i - 3), unit),
        (false, 0) => n,
        (false, 1) => normal(b),
        (false, _) => cross(edge(a, (i - 2) / 3), edge(b, (i - 2) % 3)),
    };
    (0..if is_coplanar { 6 } else { 11 }).map(axis).filter(|&axis| axis != [0; 3])
}

/// Least and greatest product of an axis (up to 2^59) with the corners' offsets from a point.
fn range(facet: &FacetLattice, from: [i64; 3], axis: [i64; 3]) -> (i128, i128) {
    let heights = facet.map(|v| dot(axis, difference(v, from)));
    (heights[0].min(heights[1]).min(heights[2]), heights[0].max(heights[1]).max(heights[2]))
}

/// The centre of the common part of the bounding boxes.
fn place(input: &Input, f: u32, g: u32) -> Place {
    let [[low, high], [its_low, its_high]] =
        [f, g].map(|facet| bounds(&input.case.facets_lattice[facet as usize]));
    let middle = std::array::from_fn(|a| (low[a].max(its_low[a]) + high[a].min(its_high[a])) / 2);
    Place::new(vec![f, g], input.case.root.to_user(middle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::Edges;
    use crate::input::Requested;
    use crate::tree::Point;
    use contract::lattice::UNITS_PER_EDGE;
    use parry3d_f64::math::Pose;
    use parry3d_f64::query;
    use parry3d_f64::shape::Triangle;
    use proptest::prelude::*;

    const A: FacetLattice = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];

    fn of(b: FacetLattice) -> bool {
        intersect(&A, &b)
    }

    #[test]
    fn a_search_that_ends_early_is_a_lower_bound() {
        let across = [[2.0, 2.0, -4.0], [2.0, 2.0, 4.0], [3.0, 9.0, 0.0]];
        let plane = A.map(|v| v.map(|c| c as f32));
        let [p, q, r] = plane;
        let facets = vec![plane, across, [r, q, p]];
        let input = Input::of(Default::default(), facets, Requested::default()).unwrap();
        let lattice = &input.case.facets_lattice;
        let shells = Shells::new(&Edges::new(&input.case.facets, lattice), lattice, &[].into());
        let mut tree = FacetTree::new(lattice);
        let found = |tree: &FacetTree| {
            let finding = intersections(&input, tree, &shells, 5);
            (finding.count, finding.is_lower_bound)
        };
        assert_eq!(found(&tree), (2, false));
        tree.visits_max = 1;
        assert_eq!(found(&tree), (1, true));
    }

    #[test]
    fn facets_in_different_planes() {
        assert!(of([[2, 2, -4], [2, 2, 4], [3, 9, 0]]));
        // A vertex on the inside, an edge on an edge, an edge across an edge, a vertex on a vertex.
        assert!(!of([[2, 2, 0], [2, 2, 4], [3, 3, 4]]));
        assert!(!of([[2, 0, 0], [9, 0, 0], [4, 0, 7]]));
        assert!(!of([[4, 0, -3], [4, 0, 3], [4, -5, 0]]));
        assert!(!of([[0, 0, 0], [-1, 0, 3], [0, -1, 3]]));
        assert!(!of([[2, 2, 1], [2, 2, 4], [3, 3, 4]]));
        assert!(!of(A.map(|[x, y, z]| [x, y, z + 1])));
        // On both sides of the other's plane, but beyond its edges.
        assert!(!of([[5, 5, -4], [5, 5, 4], [6, 9, 0]]));
    }

    #[test]
    fn facets_in_one_plane() {
        assert!(of(A));
        assert!(of([[1, 1, 0], [2, 1, 0], [1, 2, 0]]));
        assert!(!of([[0, 0, 0], [8, 0, 0], [0, -8, 0]]));
        assert!(!of([[8, 0, 0], [9, 0, 0], [9, 1, 0]]));
        assert!(!of([[5, 4, 0], [9, 9, 0], [4, 5, 0]]));
    }

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let (near, far) = (-UNITS_PER_EDGE, 2 * UNITS_PER_EDGE);
        let a = [[near, near, far], [far, near, near], [near, far, far]];
        let b = [[far, far, near], [near, near, near], [far, near, far]];
        assert_eq!(intersect(&a, &b), intersect(&b, &a));
        let lowered = a.map(|[x, y, z]| [x, y, z.min(far - 1)]);
        assert!(!intersect(&a, &lowered), "they have a vertex in common");
        let tilted = [[near, near, far - 1], [far, near, near + 1], a[2]];
        assert!(intersect(&a, &tilted));
    }

    fn small() -> impl Strategy<Value = FacetLattice> {
        prop::array::uniform3(prop::array::uniform3(-4i64..=4))
            .prop_filter("has an area", |f| normal(f) != [0; 3])
    }

    #[test]
    fn the_depth_is_the_least_shift_that_separates() {
        let a = [[0, 0, 0], [80, 0, 0], [0, 80, 0]];
        assert_eq!(depth((&a, &[[20, 20, -3], [20, 20, 50], [30, 20, 50]]), false), 3.0);
        let shifted = a.map(|[x, y, z]| [x + 20, y, z]);
        assert_eq!(depth((&a, &shifted), true), 0.0);
        assert!(depth((&a, &shifted), false) > 10.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// Common points are found by cutting each edge with the other triangle's plane.
        #[test]
        fn interiors_intersect_only_if_an_edge_meets_the_other_triangle(a in small(), b in small()) {
            let meets = |f: &FacetLattice, g: &FacetLattice| {
                (0..3).any(|i| edge_meets(f[i], f[(i + 1) % 3], g))
            };
            prop_assert!(!intersect(&a, &b) || meets(&a, &b) || meets(&b, &a));
        }

        /// Interiors intersect exactly if the triangles, slightly shrunk, still have a common point.
        #[test]
        fn intersecting_means_that_shrunk_triangles_meet(a in small(), b in small()) {
            let shrunk = |f: &FacetLattice| {
                let [p, q, r] = f.map(|v| Point::from_array(v.map(|c| c as f64)));
                let centre = (p + q + r) / 3.0;
                let [p, q, r] = [p, q, r].map(|v| v + (centre - v) * 1e-4);
                Triangle::new(p, q, r)
            };
            let distance = query::distance(&Pose::IDENTITY, &shrunk(&a), &Pose::IDENTITY, &shrunk(&b));
            prop_assert_eq!(intersect(&a, &b), distance.unwrap().distance < 1e-7);
        }

        #[test]
        fn neither_order_nor_axes_matter(a in small(), b in small()) {
            let expected = intersect(&a, &b);
            let [p, q, r] = a;
            prop_assert_eq!(intersect(&b, &a), expected);
            prop_assert_eq!(intersect(&[r, q, p], &b), expected);
            let turned = |f: FacetLattice| f.map(|[x, y, z]| [y, z, -x]);
            prop_assert_eq!(intersect(&turned(a), &turned(b)), expected);
        }
    }

    /// Whether a closed segment meets a closed triangle: the point where it meets the plane lies within.
    fn edge_meets(p: [i64; 3], q: [i64; 3], g: &FacetLattice) -> bool {
        let n = normal(g);
        let height = |v: [i64; 3]| (0..3).map(|a| n[a] * (v[a] - g[0][a])).sum::<i64>();
        let (hp, hq) = (height(p), height(q));
        if hp == 0 && hq == 0 {
            return segment_in_plane_meets(p, q, g, n);
        }
        if hp.signum() * hq.signum() > 0 {
            return false;
        }
        // The point p + (q - p) hp / (hp - hq), times hp - hq.
        let d = hp - hq;
        let at: [i64; 3] = std::array::from_fn(|a| p[a] * d + (q[a] - p[a]) * hp);
        within(at, &g.map(|v| v.map(|c| c * d)), n)
    }

    fn within(at: [i64; 3], g: &FacetLattice, n: [i64; 3]) -> bool {
        let side = |i: usize| {
            let c = cross(difference(g[(i + 1) % 3], g[i]), difference(at, g[i]));
            (0..3).map(|a| i128::from(c[a]) * i128::from(n[a])).sum::<i128>().signum()
        };
        (0..3).all(|i| side(i) >= 0)
    }

    fn segment_in_plane_meets(p: [i64; 3], q: [i64; 3], g: &FacetLattice, n: [i64; 3]) -> bool {
        let turn = |a: [i64; 3], b: [i64; 3], c: [i64; 3]| {
            let k = cross(difference(b, a), difference(c, a));
            (0..3).map(|x| k[x] * n[x]).sum::<i64>().signum()
        };
        let between = |a: [i64; 3], b: [i64; 3], c: [i64; 3]| {
            (0..3).all(|x| a[x].min(b[x]) <= c[x] && c[x] <= a[x].max(b[x]))
        };
        let cuts = |a, b| {
            let (s, t, u, v) = (turn(p, q, a), turn(p, q, b), turn(a, b, p), turn(a, b, q));
            (s != t && u != v)
                || (s == 0 && between(p, q, a))
                || (t == 0 && between(p, q, b))
                || (u == 0 && between(a, b, p))
                || (v == 0 && between(a, b, q))
        };
        within(p, g, n) || (0..3).any(|i| cuts(g[i], g[(i + 1) % 3]))
    }
}
