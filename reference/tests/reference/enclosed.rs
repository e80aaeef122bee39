//! Enclosed space: outside components that do not reach the boundary of the root.
use crate::support;

use reference::{Case, Enclosed, Keep, base_tree, mesh};
use support::dense::{self, CROSSING, INSIDE};
use support::leaf::leaves;
use support::random::{RandomCase, cases_with_a_cavity, for_all};
use support::{ROOT_EDGE, UNIT, block, block_of_units, case, sides};

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
                let occurs = |leaves: &[support::leaf::Leaf]| {
                    leaves.iter().any(|leaf| leaf.has(point) && leaf.side != CROSSING)
                };
                assert!(occurs(&keep));
                let stays = reaches_boundary || !reaches.contains(&true);
                assert_eq!(occurs(&delete), stays, "{:?}", cell.index);
            }
        }
    });
}
