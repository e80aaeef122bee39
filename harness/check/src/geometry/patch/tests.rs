use super::super::distance::nearest;
use super::super::facets::is_degenerate;
use super::super::opposite::opposite;
use super::*;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// Facets over a plane at a height, wound upward or downward, and turned with all others by a rotation of the axes.
fn facets(is_up: bool) -> impl Strategy<Value = Vec<FacetLattice>> {
    let corner = |size: i64, rough: i64| (-size..=size, -size..=size, -rough..=rough);
    let place = (-2_000i64..2_000, -2_000i64..2_000, 0i64..9_000);
    let shape = prop_oneof![Just((900, 0)), Just((400, 60)), Just((900, 900))];
    (place, shape).prop_flat_map(move |((x, y, z), (size, rough))| {
        let facet = prop::array::uniform3(corner(size, rough)).prop_map(move |corners| {
            let [a, b, c] = corners.map(|(u, v, w)| [x + u, y + v, z + w]);
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if (area > 0) == is_up { [a, b, c] } else { [a, c, b] }
        });
        let facet = facet.prop_filter("no area", |facet| !is_degenerate(facet));
        prop::collection::vec(facet, 1..6)
    })
}

/// Two sets of facets that may face each other, in any direction.
fn sets() -> impl Strategy<Value = [Vec<FacetLattice>; 2]> {
    (facets(true), any::<bool>().prop_flat_map(facets), 0usize..3).prop_map(|(a, b, turn)| {
        let turned = |v: [i64; 3]| [v[turn], v[(turn + 1) % 3], v[(turn + 2) % 3]];
        [a, b].map(|set| set.iter().map(|facet| facet.map(turned)).collect())
    })
}

fn one(facet: &FacetLattice) -> Patch {
    let end = |f: fn(i64, i64) -> i64| {
        std::array::from_fn(|a| f(f(facet[0][a], facet[1][a]), facet[2][a]) as i32)
    };
    Patch::of(facet, Bounds { low: end(i64::min), high: end(i64::max) }, 0)
}

/// The patch of a leaf, and the patch of a node with a leaf for every facet.
fn both_patches(set: &[FacetLattice]) -> [Patch; 2] {
    let leaf = Patch::of_all(set.iter().map(|facet| (facet, one(facet)))).unwrap();
    let node = set[1..].iter().fold(one(&set[0]), |all, facet| all.union(&one(facet)));
    [leaf, node]
}

/// Compares what two patches imply with all pairs of facets. Returns how many verdicts were certain: that no pair is opposite, and
/// that all are.
fn compare(sets: &[Vec<FacetLattice>; 2], limit: f64) -> Result<[usize; 2], TestCaseError> {
    let pairs: Vec<(&FacetLattice, &FacetLattice)> =
        sets[0].iter().flat_map(|a| sets[1].iter().map(move |b| (a, b))).collect();
    let corners = |facet: &FacetLattice| facet.map(|v| v.map(|c| c as f64));
    let squares: Vec<f64> =
        pairs.iter().map(|(a, b)| nearest(&corners(a), &corners(b)).0).collect();
    let found: Vec<_> = pairs.iter().map(|(a, b)| opposite(a, b, 0.0, [limit; 2])).collect();
    let mut certain = [0; 2];
    for (x, y) in both_patches(&sets[0]).into_iter().zip(both_patches(&sets[1])) {
        // With the rounding errors of the distances.
        prop_assert!(squares.iter().all(|&s| x.squared_min(&y) <= s * (1.0 + 1e-9)));
        let [p, q] = [x, y].map(|patch| patch.bundle([4_000.0; 3], 16_000.0));
        let verdict = p.verdicts(&q, [limit; 2]);
        prop_assert!(squares.iter().all(|&squared| f64::from(verdict.squared_min[0]) <= squared));
        for side in 0..2 {
            let is_found = |found: &Option<(usize, f64)>| found.is_some_and(|(s, _)| s == side);
            let (may, must) = (verdict.may[side][0] > 0.0, verdict.must[side][0] > 0.0);
            prop_assert!(may || !found.iter().any(is_found));
            prop_assert!(!must || may && found.iter().all(is_found));
            let squared_max = f64::from(verdict.squared_max[0]);
            prop_assert!(!must || squares.iter().all(|&squared| squared <= squared_max));
            certain[0] += usize::from(!may);
            certain[1] += usize::from(must);
        }
        // A limit of 0 excludes a side, and many patches are compared as one is.
        let mut many = Bundle::<3>::EMPTY;
        many.set(2, &p);
        let none = many.verdicts(&q, [0.0, limit]);
        prop_assert!(none.may[0][2] <= 0.0 && none.must[0][2] <= 0.0);
        prop_assert_eq!((none.may[1][2], none.must[1][2]), (verdict.may[1][0], verdict.must[1][0]));
    }
    Ok(certain)
}

proptest! {
    #[test]
    fn what_two_patches_imply_holds_for_all_pairs_of_their_facets(sets in sets(), limit in 100.0f64..12_000.0) {
        compare(&sets, limit * limit)?;
    }

    #[test]
    fn heights_normals_and_boxes_of_a_patch_are_bounds(sets in sets()) {
        for patch in both_patches(&sets[0]) {
            for facet in &sets[0] {
                let unit = unit_normal(facet);
                for a in 0..3 {
                    let off = (unit[a] - f64::from(patch.normal[a])).abs();
                    prop_assert!(off <= f64::from(patch.spread[a]));
                }
                for vertex in facet {
                    let height: f64 = (0..3).map(|a| f64::from(patch.normal[a]) * vertex[a] as f64).sum();
                    prop_assert!(patch.heights[0] - 1e-6 <= height && height <= patch.heights[1] + 1e-6);
                }
            }
        }
    }
}

/// Bounds that were looser would still be bounds, but the searches would take longer.
#[test]
fn as_many_pairs_of_patches_as_ever_are_decided() {
    let mut runner = TestRunner::deterministic();
    let (mut certain, mut lengths) = ([[0; 2]; 3], [0.0; 3]);
    for _ in 0..400 {
        let sets = sets().new_tree(&mut runner).unwrap().current();
        for (certain, limit) in certain.iter_mut().zip([1_000.0f64, 4_000.0, 12_000.0]) {
            let [none, all] = compare(&sets, limit.powi(2)).unwrap();
            *certain = [certain[0] + none, certain[1] + all];
        }
        for (x, y) in both_patches(&sets[0]).into_iter().zip(both_patches(&sets[1])) {
            let [p, q] = [x, y].map(|patch| patch.bundle([4_000.0; 3], 16_000.0));
            let verdict = p.verdicts(&q, [1e8; 2]);
            let [least, greatest] = [verdict.squared_min[0], verdict.squared_max[0]].map(f64::from);
            for (sum, squared) in lengths.iter_mut().zip([x.squared_min(&y), least, greatest]) {
                *sum += squared.sqrt();
            }
        }
    }
    assert_eq!(certain, [[1496, 0], [1215, 12], [1084, 68]]);
    let [least, least_rounded, greatest] = lengths.map(|sum| (sum / 1e3).round());
    assert_eq!([least, least_rounded, greatest], [2439.0, 2438.0, 4245.0]);
}

#[test]
fn a_patch_is_of_no_shell_if_its_facets_are_of_several() {
    let facet = [[0, 0, 0], [9, 0, 0], [0, 9, 0]];
    let mut other = one(&facet);
    other.shell = Some(1);
    assert_eq!(one(&facet).union(&one(&facet)).shell, Some(0));
    assert_eq!(one(&facet).union(&other).shell, None);
    assert_eq!(
        Patch::of_all([(&facet, one(&facet)), (&facet, other)].into_iter()).unwrap().shell,
        None
    );
    assert!(Patch::of_all([].into_iter()).is_none());
}
