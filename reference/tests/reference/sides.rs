//! Sides of components: ray parities, verified by hand and by a second method; components whose rays disagree, which closed
//! bodies do not produce; and enclosed space, outside components that do not reach the boundary of the root.

use crate::support;
use proptest::array::{uniform3, uniform4};
use proptest::prelude::*;
use reference::ray::parities;
use reference::{Case, Enclosed, Keep, base_tree, mesh};
use std::cell::Cell;
use support::dense::{CROSSING, INSIDE};
use support::leaves;
use support::{
    ROOT_EDGE, UNIT, block, block_of_units, box_of_level, case, crosses_by_axes, dense, levels,
    parities_by_areas, sides, units,
};
use support::{RandomCase, cases_with_a_cavity, facet, for_all};

/// With few different coordinates, most rays pass through edges and vertices.
#[test]
fn both_methods_agree_on_random_facets() {
    let (tested, odd) = (Cell::new(0), Cell::new(0));
    let inputs = prop_oneof![9 => Just(4_i64), 1 => Just(1 << 27)]
        .prop_flat_map(|greatest| (uniform4(facet(0..=greatest)), uniform3(0..=greatest)));
    for_all(file!(), 30_000, inputs, |(facets, point)| {
        // Rays never start on a facet.
        if facets.iter().any(|facet| crosses_by_axes(facet, point, point)) {
            return;
        }
        for axis in 0..3 {
            let found = parities(&facets, point, axis);
            assert_eq!(found, parities_by_areas(&facets, point, axis), "axis {axis}");
            tested.set(tested.get() + 2);
            odd.set(odd.get() + u32::from(found[0]) + u32::from(found[1]));
        }
    });
    let (tested, odd) = (tested.get(), odd.get());
    assert!(odd > tested / 20, "{odd} of {tested} rays are odd");
}

/// The block has even coordinates, so rays from integer points pass through its edges and
/// diagonals. All six rays from a point inside intersect an odd number of facets, those from a
/// point outside an even number.
#[test]
fn all_rays_agree_on_a_block() {
    let facets = block([2, 2, 2], [6, 8, 10]);
    let mut inside = 0;
    for x in 0..=8 {
        for y in 0..=10 {
            for z in 0..=12 {
                let inside_block =
                    (3..=5).contains(&x) && (3..=7).contains(&y) && (3..=9).contains(&z);
                let outside =
                    !((2..=6).contains(&x) && (2..=8).contains(&y) && (2..=10).contains(&z));
                if !inside_block && !outside {
                    continue;
                }
                for axis in 0..3 {
                    assert_eq!(
                        parities(&facets, [x, y, z], axis),
                        [inside_block; 2],
                        "{x} {y} {z} {axis}"
                    );
                }
                inside += u32::from(inside_block);
            }
        }
    }
    assert_eq!(inside, 3 * 5 * 7);
}

/// A ray along z is displaced by eps along x and by eps^2 along y. Of two facets that share an edge
/// through the point, it intersects the one on the positive side.
#[test]
fn the_displacement_decides_which_facet_at_an_edge_counts() {
    let right = [[0, 0, 5], [4, -1, 5], [4, 1, 5]];
    let left = [[0, 0, 5], [-4, -1, 5], [-4, 1, 5]];
    assert_eq!(parities(&[right], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[left], [0, 0, 0], 2), [false, false]);
    // The edge lies along x, so the second displacement, along y, decides.
    let positive = [[0, 0, 5], [4, 0, 5], [4, 4, 5]];
    let negative = [[0, 0, 5], [4, 0, 5], [4, -4, 5]];
    assert_eq!(parities(&[positive], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[negative], [0, 0, 0], 2), [false, false]);
    // No ray intersects a facet that is parallel to it or has no area.
    let edge_on = [[0, 0, 5], [4, 0, 5], [4, 0, 9]];
    let segment = [[-4, 0, 5], [4, 0, 5], [8, 0, 5]];
    assert_eq!(parities(&[edge_on, segment], [0, 0, 0], 2), [false, false]);
}

/// A sheet through the whole root separates two components, neither of which any candidate decides.
#[test]
fn both_sides_of_a_sheet_are_ambiguous() {
    let corner = |x, y| [x * UNIT, y * UNIT, 3 * UNIT + UNIT / 2];
    let corners = [corner(-8, -8), corner(16, -8), corner(16, 16), corner(-8, 16)];
    let sheet = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
    let base = base_tree(&case(&sheet, 3)).unwrap();
    assert_eq!(levels(&base.words), [0, 4, 16, 128, 0]);
    assert_eq!(sides(&base.words), [84, 0, 64]);
    let ambiguous = base.ambiguous.unwrap();
    assert_eq!(ambiguous.components, 2);
    assert_eq!(
        ambiguous.example,
        units([2, 2, 6]).map(|x| x as f64),
        "the coarsest leaf is the example"
    );
}

/// If every facet occurs twice, the surface still crosses the same leaves, but every ray count is
/// even.
#[test]
fn a_surface_of_doubled_facets_has_no_inside() {
    let once = block_of_units([2; 3], [6; 3]);
    let twice = [once.clone(), once].concat();
    assert_eq!(sides(&base_tree(&case(&twice, 3)).unwrap().words), [304, 0, 208]);
}

/// A rectangle in the plane where coordinate `axis` is -1 unit. It lies outside the root, so it
/// crosses no octant, but rays intersect it. `u` and `v` are its ranges along the other two axes,
/// in order.
fn blind(axis: usize, u: [i64; 2], v: [i64; 2]) -> [[[i64; 3]; 3]; 2] {
    let corner = |x: i64, y: i64| {
        let mut others = [x, y].into_iter();
        units(std::array::from_fn(|a| if a == axis { -1 } else { others.next().unwrap() }))
    };
    let [a, b, c, d] =
        [corner(u[0], v[0]), corner(u[1], v[0]), corner(u[1], v[1]), corner(u[0], v[1])];
    [[a, b, c], [a, c, d]]
}

/// All 64 leaves of level 2 form one component. Blinds make the six rays of all but a few leaves
/// disagree. The first leaf whose rays agree is number 31, counted from 0, in one case, and number
/// 32 in the other.
#[test]
fn at_most_thirty_two_candidates_vote() {
    let ambiguous = |facets: Vec<[[[i64; 3]; 3]; 2]>| {
        let boxes = vec![box_of_level([0; 3], units([8; 3]), 2)];
        let base = base_tree(&Case { boxes, ..case(&facets.concat(), 0) }).unwrap();
        assert_eq!(sides(&base.words), [64, 0, 0]);
        base.ambiguous.map(|a| a.components)
    };
    // Blinds below all columns except that of the leaves (3, 3, z), and beside the lowest leaf of
    // this column, number 27. The next leaf of the column, (3, 3, 1), is child 7 of octant 3:
    // number 31.
    let last_candidate =
        vec![blind(2, [0, 6], [0, 8]), blind(2, [6, 8], [0, 6]), blind(1, [6, 8], [0, 2])];
    assert_eq!(ambiguous(last_candidate), None);
    // Blinds below all columns except that of the leaves (0, 0, z), and beside the lower two leaves
    // of this column, numbers 0 and 4. The next leaf, (0, 0, 2), is child 0 of octant 4: number 32.
    let one_too_late =
        vec![blind(2, [2, 8], [0, 8]), blind(2, [0, 2], [2, 8]), blind(1, [0, 2], [0, 4])];
    assert_eq!(ambiguous(one_too_late), Some(1));
}

/// Blinds below, beside and before all 64 leaves of level 2: three of the six rays of every leaf intersect one facet.
#[test]
fn a_tie_of_all_rays_means_outside() {
    let blinds = (0..3).flat_map(|axis| blind(axis, [-2, 10], [-2, 10])).collect::<Vec<_>>();
    let boxes = vec![box_of_level([0; 3], units([8; 3]), 2)];
    let base = base_tree(&Case { boxes, ..case(&blinds, 0) }).unwrap();
    assert_eq!((sides(&base.words), base.ambiguous.unwrap().components), ([64, 0, 0], 1));
}

const FINEST: u32 = 4;

/// The surfaces of blocks with corners given in units, at level 4, whose cells are half units.
fn blocks(corners: &[[i64; 2]]) -> Case {
    let facets = corners.iter().map(|&[min, max]| block_of_units([min; 3], [max; 3]));
    Case { keep: Keep::Outside, ..case(&facets.collect::<Vec<_>>().concat(), 4) }
}

/// The shell of `seeds.rs`: 8 leaves in the cavity, 1,352 around the shell, 784 in it.
#[test]
fn a_sealed_cavity_is_deleted_unless_the_case_keeps_it() {
    let shell = blocks(&[[1, 7], [3, 5]]);
    let base = base_tree(&shell).unwrap();
    assert_eq!(sides(&base.words), [1360, 784, 1952], "its leaves remain outside in T0");
    let found = &base.components;
    assert_eq!((found.outside, found.inside), (2, 1));
    assert_eq!((found.enclosed.count, found.enclosed.leaves), (1, 8));
    assert_eq!(found.enclosed.example, Some([3.75 * UNIT as f64; 3]));
    let meshed = mesh(&shell).unwrap();
    assert_eq!((sides(&meshed.words), &meshed.components), ([1352, 0, 1952], found));

    let with = |change: &dyn Fn(&mut Case)| {
        let mut other = shell.clone();
        change(&mut other);
        let meshed = mesh(&other).unwrap();
        assert_eq!(meshed.components.enclosed.count, 0);
        assert_eq!(meshed.components.enclosed.example, None);
        sides(&meshed.words)
    };
    assert_eq!(with(&|case| case.enclosed = Enclosed::Keep), [1360, 0, 1952]);
    assert_eq!(with(&|case| case.keep = Keep::All), [1360, 784, 1952]);
    assert_eq!(with(&|case| case.keep = Keep::Inside), [0, 784, 1952]);
}

/// The block from 3 to 5 units is the overlap of two blocks. By parity its 8 free leaves are outside.
#[test]
fn the_overlap_of_two_blocks_is_deleted() {
    let blocks = blocks(&[[1, 5], [3, 7]]);
    let found = base_tree(&blocks).unwrap().components;
    assert_eq!((found.outside, found.inside), (2, 2));
    assert_eq!((found.enclosed.count, found.enclosed.leaves), (1, 8));
    let [delete, keep] = [Enclosed::Delete, Enclosed::Keep]
        .map(|enclosed| sides(&mesh(&Case { enclosed, ..blocks.clone() }).unwrap().words));
    assert_eq!([keep[0] - delete[0], delete[1], keep[2] - delete[2]], [8, 0, 0]);
}

/// The outer block fills the root except for crossing leaves, so its cavity is the only outside
/// component.
#[test]
fn nothing_is_enclosed_if_no_outside_component_reaches_the_boundary() {
    let hull = block([UNIT / 2; 3], [ROOT_EDGE - UNIT / 2; 3]);
    let facets = [hull, block_of_units([3; 3], [5; 3])].concat();
    let meshed = mesh(&Case { keep: Keep::Outside, ..case(&facets, 4) }).unwrap();
    let found = meshed.components;
    assert_eq!((found.outside, found.inside, found.enclosed.count), (1, 1, 0));
    assert_eq!(sides(&meshed.words)[0], 8);
}

/// The shell extends below the root, so its cavity reaches the boundary on one face alone.
#[test]
fn a_cavity_that_is_open_at_one_face_of_the_root_is_kept() {
    let outer = block_of_units([2, 2, -2], [6, 6, 6]);
    let inner = block_of_units([3, 3, -1], [5, 5, 4]);
    let meshed = mesh(&Case { keep: Keep::Outside, ..case(&[outer, inner].concat(), 4) }).unwrap();
    assert_eq!((meshed.components.outside, meshed.components.enclosed.count), (2, 0));
}

/// Enclosed leaves are neither refined nor sources. A box of level 4 makes the cavity fine; it lies in
/// a block of level 2, whose other leaves are kept with it or without it.
#[test]
fn enclosed_leaves_cause_no_refinement() {
    let shell = blocks(&[[1, 7], [2, 6]]);
    let fine = support::box_of_level([3 * UNIT; 3], [4 * UNIT; 3], 6);
    let fine = Case { boxes: vec![fine], layer_cells_min: 6, ..shell.clone() };
    let plain = Case { layer_cells_min: 6, ..shell };
    assert_eq!(mesh(&fine).unwrap().words, mesh(&plain).unwrap().words);
    let kept = |case: Case| mesh(&Case { enclosed: Enclosed::Keep, ..case }).unwrap().words;
    assert!(kept(fine).len() > kept(plain).len());
}

/// Compares the two values of `enclosed` leaf by leaf, with components found on the dense grid.
#[test]
fn exactly_the_outside_components_away_from_the_boundary_are_deleted() {
    for_all(file!(), 60, cases_with_a_cavity(FINEST), |random| {
        let RandomCase { facets, level_surface, case } = random;
        let [delete, keep] = [Enclosed::Delete, Enclosed::Keep]
            .map(|enclosed| leaves(&mesh(&Case { enclosed, ..case.clone() }).unwrap().words));
        let mut grid = dense::base(&case, &facets, FINEST, level_surface);
        dense::assign_sides(&mut grid, &case, &facets);
        let outside: Vec<_> = dense::components(&mut grid)
            .into_iter()
            .filter(|component| component[0].side != INSIDE)
            .collect();
        let last = (1 << FINEST) - 1;
        let at_boundary = |index: [i64; 3]| index.iter().any(|&x| x == 0 || x == last);
        let reaches: Vec<bool> = outside
            .iter()
            .map(|component| component.iter().any(|c| at_boundary(c.index)))
            .collect();
        for (component, &reaches_boundary) in outside.iter().zip(&reaches) {
            for cell in component {
                let point = cell.index.map(|x| x * (ROOT_EDGE >> FINEST));
                let occurs = |leaves: &[support::Leaf]| {
                    leaves.iter().any(|leaf| leaf.has(point) && leaf.side != CROSSING)
                };
                assert!(occurs(&keep));
                let stays = reaches_boundary || !reaches.contains(&true);
                assert_eq!(occurs(&delete), stays, "{:?}", cell.index);
            }
        }
    });
}
