//! Base trees and meshes: some small enough to verify by hand; and properties on random cases, and equality with those of the
//! dense-grid implementation.

use crate::support;
use reference::{Case, Components, Keep, base_tree, mesh};
use std::cell::Cell;
use support::dense::{self, CROSSING, Dense, INSIDE};
use support::{
    Leaf, ROOT_EDGE, UNIT, block, block_of_units, box_of_level, case, leaves, levels, sides, units,
};
use support::{RandomCase, cases, cases_with_a_cavity, for_all};

#[test]
fn without_facets_the_root_is_the_only_leaf_and_outside() {
    let empty = case(&[], 5);
    assert_eq!(base_tree(&empty).unwrap().words, [0]);
    assert_eq!(mesh(&empty).unwrap().words, [0]);
    let inside = Case { keep: Keep::Inside, ..empty };
    assert!(mesh(&inside).unwrap().words.is_empty());
}

/// A point at the centre of the root touches the eight leaves around it at every level.
#[test]
fn a_point_at_the_centre_crosses_eight_leaves() {
    let point = [[units([4; 3]); 3]];
    let base = |level| base_tree(&case(&point, level)).unwrap().words;
    assert_eq!(base(0), [2], "the root itself, crossing");
    assert_eq!((levels(&base(1)), sides(&base(1))), ([0, 8, 0, 0, 0], [0, 0, 8]));
    assert_eq!((levels(&base(2)), sides(&base(2))), ([0, 0, 64, 0, 0], [56, 0, 8]));
    assert_eq!((levels(&base(3)), sides(&base(3))), ([0, 0, 56, 64, 0], [112, 0, 8]));
    let layers =
        |cells| levels(&mesh(&Case { layer_cells_min: cells, ..case(&point, 3) }).unwrap().words);
    assert_eq!(layers(1), [0, 0, 56, 64, 0], "T0 is balanced");
    assert_eq!(
        layers(2),
        [0, 0, 0, 512, 0],
        "the second cell reaches into every octant of level 2"
    );
    assert_eq!(layers(u32::MAX), [0, 0, 0, 512, 0], "a layer may be thicker than the root");
}

/// A second layer splits the octants of level 2 at the corner, and balance then splits the octants
/// that touch them.
#[test]
fn a_point_in_a_corner_of_the_root_is_graded_from_there() {
    let point = [[[0; 3]; 3]];
    let layers =
        |cells| levels(&mesh(&Case { layer_cells_min: cells, ..case(&point, 3) }).unwrap().words);
    assert_eq!(layers(1), [0, 7, 7, 8, 0]);
    assert_eq!(layers(2), [0, 0, 56, 64, 0]);
    assert_eq!(levels(&mesh(&case(&point, 4)).unwrap().words), [0, 7, 7, 7, 8]);
}

/// A point close to the centre lies in one octant of level 1. The seven other octants touch its
/// leaf of level 3 by a face, an edge or a corner, and all of them are split.
#[test]
fn balance_extends_over_corners() {
    let point = [[[ROOT_EDGE / 2 - 1; 3]; 3]];
    assert_eq!(levels(&base_tree(&case(&point, 3)).unwrap().words), [0, 7, 7, 8, 0]);
    assert_eq!(levels(&mesh(&case(&point, 3)).unwrap().words), [0, 0, 63, 8, 0]);
}

/// A block from 2 to 6 in a root of 8 units at level 3. Its faces are cell faces, so the cells on
/// both sides cross: those from 1 to 7, without those from 3 to 5.
#[test]
fn cells_on_both_sides_of_a_face_in_a_cell_plane_cross() {
    let block = case(&block_of_units([2; 3], [6; 3]), 3);
    let base = base_tree(&block).unwrap();
    assert_eq!(levels(&base.words), [0, 0, 0, 512, 0]);
    assert_eq!(sides(&base.words), [512 - 216, 8, 216 - 8]);
    assert_eq!((base.level_surface, base.ambiguous), (3, None));
    let kept = |keep, keep_crossing| {
        sides(&mesh(&Case { keep, keep_crossing, ..block.clone() }).unwrap().words)
    };
    assert_eq!(kept(Keep::Outside, true), [296, 0, 208]);
    assert_eq!(kept(Keep::Outside, false), [296, 0, 0]);
    assert_eq!(kept(Keep::Inside, true), [0, 8, 208]);
    assert_eq!(kept(Keep::Inside, false), [0, 8, 0]);
    assert_eq!(kept(Keep::All, false), [296, 8, 0]);
}

/// Deleted leaves are neither refined nor sources. The hull is a block from 0.5 to 7.5 at level 4,
/// whose cells are half units. Cells 0, 1, 14 and 15 of each axis touch it. The rest, from 1 to 7
/// units, consists of eight leaves of level 2 surrounded by 6^3 - 4^3 = 152 leaves of level 3.
#[test]
fn deleted_leaves_are_not_refined() {
    let hull = block([UNIT / 2; 3], [ROOT_EDGE - UNIT / 2; 3]);
    let hull = Case { layer_cells_min: 2, ..case(&hull, 4) };
    let base = base_tree(&hull).unwrap();
    assert_eq!(levels(&base.words), [0, 0, 8, 152, 2368]);
    assert_eq!(sides(&base.words), [0, 160, 2368]);
    // The second layer splits the 152 leaves; balance then splits the eight, which touch the
    // result.
    let all = mesh(&hull).unwrap();
    assert_eq!(levels(&all.words), [0, 0, 0, 64, 2368 + 8 * 152]);
    let outside = Case { keep: Keep::Outside, ..hull };
    let outside = mesh(&outside).unwrap();
    assert_eq!((levels(&outside.words), sides(&outside.words)), ([0, 0, 0, 0, 2368], [0, 0, 2368]));
}

/// Boxes refine the octants that their interior meets, but not those that touch their faces.
#[test]
fn boxes_refine_where_interiors_meet() {
    let with = |boxes| Case { boxes, ..case(&[], 0) };
    let base = |boxes| levels(&base_tree(&with(boxes)).unwrap().words);
    assert_eq!(base(vec![box_of_level([0; 3], units([1; 3]), 3)]), [0, 7, 7, 8, 0]);
    assert_eq!(base(vec![box_of_level([0; 3], units([4; 3]), 3)]), [0, 7, 0, 64, 0]);
    assert_eq!(base(vec![box_of_level([0; 3], [UNIT * 4 + 1, UNIT, UNIT], 2)]), [0, 6, 16, 0, 0]);
    // A box outside the root, and one thinner than a lattice unit: neither has volume after
    // clamping and quantisation.
    assert_eq!(base(vec![box_of_level(units([8; 3]), units([9; 3]), 3)]), [1, 0, 0, 0, 0]);
    let mut thin = box_of_level(units([1; 3]), units([2; 3]), 3);
    thin.max[0] = thin.min[0] + 0.25;
    let thin = base_tree(&with(vec![thin])).unwrap();
    assert_eq!((levels(&thin.words), thin.boxes.len()), ([1, 0, 0, 0, 0], 1));
}

/// Where a box finer than D meets the surface, crossing leaves have the level of the box.
#[test]
fn a_box_finer_than_the_surface_refines_crossing_leaves() {
    let point = [[[1; 3]; 3]];
    let boxes = vec![box_of_level([0; 3], units([2; 3]), 3)];
    let base = base_tree(&Case { boxes, ..case(&point, 1) }).unwrap();
    assert_eq!((levels(&base.words), sides(&base.words)), ([0, 7, 7, 8, 0], [21, 0, 1]));
    assert_eq!(base.level_surface, 1);
}

/// The leaf of a point just below the centre touches all eight octants of level 1. The extra layer
/// refines each of them to level 3 there; balance alone would stop at level 2.
#[test]
fn the_extra_layer_refines_to_the_level_of_the_surface() {
    let point = [[[ROOT_EDGE / 2 - 1; 3]; 3]];
    let without = Case { keep_crossing: false, ..case(&point, 3) };
    // Eight times 7 leaves of level 2 and 8 of level 3, without the one that crosses.
    assert_eq!(levels(&mesh(&without).unwrap().words), [0, 0, 56, 63, 0]);
    // With n = 3 the layer suffices: from 3 to 4 units, enlarged by 2 on both sides, it meets three
    // octants of level 2 along each axis.
    let thicker = Case { layer_cells_min: 3, ..without };
    assert_eq!(levels(&mesh(&thicker).unwrap().words), [0, 0, 64 - 27, 27 * 8 - 1, 0]);
}

/// The finest level of the random cases of most properties: at most 4,096 leaves.
const FINEST: u32 = 4;

fn base_leaves(random: &RandomCase) -> Vec<Leaf> {
    leaves(&base_tree(&random.case).unwrap().words)
}

fn mesh_leaves(random: &RandomCase) -> Vec<Leaf> {
    leaves(&mesh(&random.case).unwrap().words)
}

/// The results of the dense-grid implementation.
struct Expected {
    base: Vec<u64>,
    /// The words of the leaves of T0 that gradation keeps.
    base_kept: Vec<u64>,
    components_ambiguous: u64,
    components: Components,
    graded: Dense,
}

impl Expected {
    fn of(RandomCase { facets, level_surface, case }: &RandomCase, finest: u32) -> Self {
        let mut grid = dense::base(case, facets, finest, *level_surface);
        let components_ambiguous = dense::assign_sides(&mut grid, case, facets);
        let base = grid.words(|_| true);
        let components = dense::keep(&mut grid, case);
        let base_kept = grid.words(|leaf| leaf.kept);
        dense::grade(&mut grid, case.layer_cells_min.into(), case.keep_crossing, *level_surface);
        Self { base, base_kept, components_ambiguous, components, graded: grid }
    }

    /// The words of the kept leaves whose side satisfies `wanted`.
    fn words(&self, wanted: impl Fn(u64) -> bool) -> Vec<u64> {
        self.graded.words(|leaf| leaf.kept && wanted(leaf.side))
    }
}

fn assert_equals_dense_grid(random: &RandomCase, finest: u32) -> Expected {
    let expected = Expected::of(random, finest);
    let base = base_tree(&random.case).unwrap();
    assert_eq!(base.words, expected.base, "base tree");
    assert_eq!(base.ambiguous.map_or(0, |a| a.components), expected.components_ambiguous);
    assert_eq!(base.components, expected.components);
    let words = expected.words(|side| random.case.keep_crossing || side != CROSSING);
    assert_eq!(mesh(&random.case).unwrap().words, words, "final mesh");
    expected
}

#[test]
fn base_tree_and_mesh_equal_those_of_the_dense_grid() {
    let [tested, inside, ambiguous, crossing_deep, seeded] = [const { Cell::new(0) }; 5];
    for_all(file!(), 400, cases(FINEST), |random| {
        let expected = assert_equals_dense_grid(&random, FINEST);
        let cells = &expected.graded.cells;
        let count =
            |counter: &Cell<u32>, occurs: bool| counter.set(counter.get() + u32::from(occurs));
        count(&tested, true);
        count(&inside, cells.iter().any(|cell| cell.side == INSIDE));
        count(&ambiguous, expected.components_ambiguous > 0);
        count(&seeded, !random.case.seeds.is_empty());
        let is_deep = |level: u32| level > random.level_surface;
        count(&crossing_deep, cells.iter().any(|c| c.side == CROSSING && is_deep(c.level)));
    });
    // Rare situations must occur among the random cases. The bounds are far below the mean rates,
    // so that the test does not fail by chance.
    let [tested, inside, ambiguous, crossing_deep, seeded] =
        [tested, inside, ambiguous, crossing_deep, seeded].map(Cell::into_inner);
    assert!(inside >= tested / 20, "{inside} of {tested} cases have an inside");
    assert!(ambiguous >= tested / 50, "{ambiguous} of {tested} cases are ambiguous");
    assert!(seeded >= tested / 20, "{seeded} of {tested} cases have seeds");
    assert!(
        crossing_deep >= tested / 20,
        "{crossing_deep} of {tested} cases have boxes finer than the surface"
    );
}

#[test]
fn base_tree_and_mesh_of_finer_cases_equal_those_of_the_dense_grid() {
    for_all(file!(), 20, cases(5), |random| {
        assert_equals_dense_grid(&random, 5);
    });
}

#[test]
fn base_tree_and_mesh_of_cases_with_a_cavity_equal_those_of_the_dense_grid() {
    let [tested, enclosed] = [const { Cell::new(0) }; 2];
    for_all(file!(), 100, cases_with_a_cavity(FINEST), |random| {
        let expected = assert_equals_dense_grid(&random, FINEST);
        tested.set(tested.get() + 1);
        enclosed.set(enclosed.get() + u32::from(expected.components.enclosed.count > 0));
    });
    let [tested, enclosed] = [tested, enclosed].map(Cell::into_inner);
    assert!(enclosed >= tested / 5, "{enclosed} of {tested} cases have enclosed space");
}

#[test]
fn base_trees_are_linear_and_complete() {
    for_all(file!(), 200, cases(FINEST), |random| {
        let leaves = base_leaves(&random);
        assert_eq!(leaves[0].keys.0, 0);
        assert!(leaves.windows(2).all(|pair| pair[0].keys.1 == pair[1].keys.0));
        assert_eq!(leaves.last().unwrap().keys.1, 1 << 57);
    });
}

#[test]
fn base_leaves_have_the_level_that_facets_and_boxes_require() {
    for_all(file!(), 100, cases(FINEST), |random| {
        for leaf in base_leaves(&random) {
            let is_crossed = leaf.is_crossed(&random);
            assert_eq!(leaf.side == CROSSING, is_crossed, "{leaf:?}");
            assert!(!is_crossed || leaf.level >= random.level_surface, "{leaf:?}");
            assert!(leaf.level >= leaf.level_of_boxes(&random.case), "{leaf:?}");
        }
    });
}

/// A rule that requires the split of an octant also requires the split of its ancestors, so it
/// suffices to test the parents of leaves.
#[test]
fn base_trees_split_no_octant_without_need() {
    for_all(file!(), 100, cases(FINEST), |random| {
        for parent in base_leaves(&random).iter().filter_map(Leaf::parent) {
            let by_facets = parent.level < random.level_surface && parent.is_crossed(&random);
            let by_boxes = parent.level < parent.level_of_boxes(&random.case);
            assert!(by_facets || by_boxes, "{parent:?}");
        }
    });
}

/// Each leaf of the mesh lies in a kept leaf of T0 and has its side, and the kept leaves of T0 are
/// filled.
#[test]
fn meshes_are_linear_and_fill_the_kept_leaves_of_the_base_tree() {
    for_all(file!(), 200, cases(FINEST), |random| {
        let kept = leaves(&Expected::of(&random, FINEST).base_kept);
        let leaves = mesh_leaves(&random);
        assert!(leaves.windows(2).all(|pair| pair[0].keys.1 <= pair[1].keys.0));
        let mut rest = &leaves[..];
        let stays = |base: &&Leaf| random.case.keep_crossing || base.side != CROSSING;
        for base in kept.iter().filter(stays) {
            let (within, after) =
                rest.split_at(rest.iter().take_while(|l| base.contains(l)).count());
            assert!(within.iter().all(|leaf| leaf.side == base.side), "{base:?}");
            let filled: u64 = within.iter().map(|leaf| leaf.keys.1 - leaf.keys.0).sum();
            assert_eq!(filled, base.keys.1 - base.keys.0, "{base:?}");
            rest = after;
        }
        assert!(rest.is_empty(), "{:?} lies in no kept leaf of T0", rest[0]);
    });
}

/// Calls `check` for every pair of kept leaves, the finer first. Crossing leaves that the mesh does
/// not contain are included; only the dense grid still has them.
fn for_all_pairs(random: &RandomCase, check: impl Fn(&Leaf, &Leaf)) {
    let mut leaves = mesh_leaves(random);
    if !random.case.keep_crossing {
        let deleted = Expected::of(random, FINEST).words(|side| side == CROSSING);
        leaves.extend(deleted.into_iter().map(Leaf::of));
    }
    leaves.sort_by_key(|leaf| std::cmp::Reverse(leaf.level));
    for (i, fine) in leaves.iter().enumerate() {
        for coarse in &leaves[i + 1..] {
            check(fine, coarse);
        }
    }
}

#[test]
fn levels_of_touching_leaves_differ_by_at_most_one() {
    for_all(file!(), 100, cases(FINEST), |random| {
        for_all_pairs(&random, |fine, coarse| {
            assert!(
                fine.level - coarse.level <= 1 || fine.distance(coarse) > 0,
                "{fine:?} {coarse:?}"
            );
        });
    });
}

#[test]
fn layers_are_at_least_n_cells_thick() {
    for_all(file!(), 100, cases(FINEST), |random| {
        let RandomCase { case, level_surface, .. } = &random;
        let n = i64::from(case.layer_cells_min);
        let is_deleted = |leaf: &Leaf| !case.keep_crossing && leaf.side == CROSSING;
        let edge = |level: u32| ROOT_EDGE >> level;
        for_all_pairs(&random, |fine, coarse| {
            let holds = |&l: &u32| l < *level_surface || case.keep == Keep::All;
            // The thickest of these layers is that of the coarsest level.
            if let Some(level) = (coarse.level + 1..fine.level).find(holds)
                && !is_deleted(fine)
                && !is_deleted(coarse)
            {
                assert!(fine.distance(coarse) >= n * edge(level), "{fine:?} {coarse:?}");
            }
            let is_surface = fine.side == CROSSING && fine.level == *level_surface;
            if is_surface && fine.distance(coarse) < (n - 1) * edge(*level_surface) {
                assert!(coarse.level >= *level_surface, "{fine:?} {coarse:?}");
            }
        });
    });
}
