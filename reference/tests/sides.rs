//! Sides, where rays disagree: what no body with an inside would show.
mod support;

use reference::{Case, base_tree};
use support::{UNIT, block_of_units, box_of_level, case, levels, sides, units};

/// A sheet through the whole root: its two sides are components that no candidate decides.
#[test]
fn sheet_is_ambiguous() {
    let at = |x, y| [x * UNIT, y * UNIT, 3 * UNIT + UNIT / 2];
    let corners = [at(-8, -8), at(16, -8), at(16, 16), at(-8, 16)];
    let sheet = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
    let base = base_tree(&case(&sheet, 3)).unwrap();
    assert_eq!(levels(&base.words), [0, 4, 16, 128, 0]);
    assert_eq!(sides(&base.words), [84, 0, 64]);
    let ambiguous = base.ambiguous.unwrap();
    assert_eq!(ambiguous.components, 2);
    assert_eq!(ambiguous.example, units([2, 2, 6]).map(|x| x as f64), "of the coarsest leaf");
}

/// Every facet twice: the surface still crosses, but every ray count is even.
#[test]
fn doubled_facets_have_no_inside() {
    let once = block_of_units([2; 3], [6; 3]);
    let twice = [once.clone(), once].concat();
    assert_eq!(sides(&base_tree(&case(&twice, 3)).unwrap().words), [304, 0, 208]);
}

/// A rectangle in the plane where coordinate `axis` is -1 unit: below the root, so that it crosses
/// nothing, but in the way of rays. `u` and `v` are its ranges along the two other axes, in order.
fn blind(axis: usize, u: [i64; 2], v: [i64; 2]) -> [[[i64; 3]; 3]; 2] {
    let corner = |x: i64, y: i64| {
        let mut others = [x, y].into_iter();
        units(std::array::from_fn(|a| if a == axis { -1 } else { others.next().unwrap() }))
    };
    let [a, b, c, d] =
        [corner(u[0], v[0]), corner(u[1], v[0]), corner(u[1], v[1]), corner(u[0], v[1])];
    [[a, b, c], [a, c, d]]
}

/// All 64 leaves of level 2 are one component. Blinds make the six rays of all but a few disagree: of
/// these the first is candidate 31 of 0 to 31 in one case, and would be candidate 32 in the other.
#[test]
fn candidates_are_thirty_two() {
    let ambiguous = |facets: Vec<[[[i64; 3]; 3]; 2]>| {
        let boxes = vec![box_of_level([0; 3], units([8; 3]), 2)];
        let base = base_tree(&Case { boxes, ..case(&facets.concat(), 0) }).unwrap();
        assert_eq!(sides(&base.words), [64, 0, 0]);
        base.ambiguous.map(|a| a.components)
    };
    // Below all columns but that of the leaves (3, 3, z), and beside the lowest of those, which is
    // candidate 27. Next is (3, 3, 1): octant 3, child 7.
    let last = vec![blind(2, [0, 6], [0, 8]), blind(2, [6, 8], [0, 6]), blind(1, [6, 8], [0, 2])];
    assert_eq!(ambiguous(last), None);
    // Below all columns but that of the leaves (0, 0, z), and beside the lower two of those, which are
    // candidates 0 and 4. Next is (0, 0, 2): octant 4, child 0.
    let one_too_late =
        vec![blind(2, [2, 8], [0, 8]), blind(2, [0, 2], [2, 8]), blind(1, [0, 2], [0, 4])];
    assert_eq!(ambiguous(one_too_late), Some(1));
}
