//! Meshes small enough to verify by hand.
use crate::support;

use reference::{Case, Keep, base_tree, mesh};
use support::{ROOT_EDGE, UNIT, block, block_of_units, box_of_level, case, levels, sides, units};

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
