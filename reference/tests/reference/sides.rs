//! Sides of components whose rays disagree, which closed bodies do not produce.
use crate::support;

use reference::{Case, base_tree};
use support::{UNIT, block_of_units, box_of_level, case, levels, sides, units};

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
