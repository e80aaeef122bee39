//! Meshes small enough to be worked out by hand.
mod support;

use reference::{Case, Keep, base_tree, mesh};
use support::{ROOT_EDGE, UNIT, block, block_of_units, box_of_level, case, levels, sides, units};

#[test]
fn nothing_is_one_leaf_outside() {
    let nothing = case(&[], 5);
    assert_eq!(base_tree(&nothing).unwrap().words, [0]);
    assert_eq!(mesh(&nothing).unwrap().words, [0]);
    let inside = Case { keep: Keep::Inside, ..nothing };
    assert!(mesh(&inside).unwrap().words.is_empty());
}

/// A point at the centre of the root touches the eight leaves around it, whatever the level.
#[test]
fn point_in_the_middle() {
    let point = [[units([4; 3]); 3]];
    let base = |level| base_tree(&case(&point, level)).unwrap().words;
    assert_eq!(base(0), [2], "the root itself, crossing");
    assert_eq!((levels(&base(1)), sides(&base(1))), ([0, 8, 0, 0, 0], [0, 0, 8]));
    assert_eq!((levels(&base(2)), sides(&base(2))), ([0, 0, 64, 0, 0], [56, 0, 8]));
    assert_eq!((levels(&base(3)), sides(&base(3))), ([0, 0, 56, 64, 0], [112, 0, 8]));
    let layers =
        |cells| levels(&mesh(&Case { layer_cells_min: cells, ..case(&point, 3) }).unwrap().words);
    assert_eq!(layers(1), [0, 0, 56, 64, 0], "balanced already");
    assert_eq!(layers(2), [0, 0, 0, 512, 0], "one cell more reaches into every octant of level 2");
    assert_eq!(layers(u32::MAX), [0, 0, 0, 512, 0], "a layer may be thicker than the root");
}

/// A point in the corner: the octants of level 2 by the corner are split for a second layer, and what
/// touches those must follow.
#[test]
fn point_in_the_corner() {
    let point = [[[0; 3]; 3]];
    let layers =
        |cells| levels(&mesh(&Case { layer_cells_min: cells, ..case(&point, 3) }).unwrap().words);
    assert_eq!(layers(1), [0, 7, 7, 8, 0]);
    assert_eq!(layers(2), [0, 0, 56, 64, 0]);
    assert_eq!(levels(&mesh(&case(&point, 4)).unwrap().words), [0, 7, 7, 7, 8]);
}

/// Balance over a corner only: a point next to the centre, in one octant of level 1 alone, makes all
/// seven others split, for they touch a leaf of level 3.
#[test]
fn balance_over_corners() {
    let point = [[[ROOT_EDGE / 2 - 1; 3]; 3]];
    assert_eq!(levels(&base_tree(&case(&point, 3)).unwrap().words), [0, 7, 7, 8, 0]);
    assert_eq!(levels(&mesh(&case(&point, 3)).unwrap().words), [0, 0, 63, 8, 0]);
}

/// A block from 2 to 6 in an 8-unit root at level 3: its faces are cell faces, so cells on both sides
/// cross, 1 to 7 without 3 to 5.
#[test]
fn block_in_cell_planes() {
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

/// What is deleted is neither refined nor a source: a block from 0.5 to 7.5 at level 4, whose cells are
/// half units. Cells 0, 1, 14 and 15 of each axis touch the hull; what they leave, from 1 to 7, is
/// eight leaves of level 2 and around them 6^3 - 4^3 = 152 of level 3.
#[test]
fn deleted_leaves_stay_as_they_are() {
    let hull = block([UNIT / 2; 3], [ROOT_EDGE - UNIT / 2; 3]);
    let hull = Case { layer_cells_min: 2, ..case(&hull, 4) };
    let base = base_tree(&hull).unwrap();
    assert_eq!(levels(&base.words), [0, 0, 8, 152, 2368]);
    assert_eq!(sides(&base.words), [0, 160, 2368]);
    // A second layer takes the 152, and the eight touch that.
    let all = mesh(&hull).unwrap();
    assert_eq!(levels(&all.words), [0, 0, 0, 64, 2368 + 8 * 152]);
    let outside = Case { keep: Keep::Outside, ..hull };
    let outside = mesh(&outside).unwrap();
    assert_eq!((levels(&outside.words), sides(&outside.words)), ([0, 0, 0, 0, 2368], [0, 0, 2368]));
}

/// Boxes ask for a level where interiors meet, and for nothing beyond their faces.
#[test]
fn boxes() {
    let with = |boxes| Case { boxes, ..case(&[], 0) };
    let base = |boxes| levels(&base_tree(&with(boxes)).unwrap().words);
    assert_eq!(base(vec![box_of_level([0; 3], units([1; 3]), 3)]), [0, 7, 7, 8, 0]);
    assert_eq!(base(vec![box_of_level([0; 3], units([4; 3]), 3)]), [0, 7, 0, 64, 0]);
    assert_eq!(base(vec![box_of_level([0; 3], [UNIT * 4 + 1, UNIT, UNIT], 2)]), [0, 6, 16, 0, 0]);
    // Outside the root, and thinner than the lattice: no interior is left.
    assert_eq!(base(vec![box_of_level(units([8; 3]), units([9; 3]), 3)]), [1, 0, 0, 0, 0]);
    let mut thin = box_of_level(units([1; 3]), units([2; 3]), 3);
    thin.max[0] = thin.min[0] + 0.25;
    let thin = base_tree(&with(vec![thin])).unwrap();
    assert_eq!((levels(&thin.words), thin.boxes.len()), ([1, 0, 0, 0, 0], 1));
}

/// Where a box finer than the surface meets it, crossing leaves are of the box's level.
#[test]
fn box_finer_than_the_surface() {
    let point = [[[1; 3]; 3]];
    let boxes = vec![box_of_level([0; 3], units([2; 3]), 3)];
    let base = base_tree(&Case { boxes, ..case(&point, 1) }).unwrap();
    assert_eq!((levels(&base.words), sides(&base.words)), ([0, 7, 7, 8, 0], [21, 0, 1]));
    assert_eq!(base.level_surface, 1);
}

/// The extra layer: the leaf of a point just below the centre touches all eight octants of level 1, so
/// each is cut to level 3 there, where balance alone would stop at level 2.
#[test]
fn extra_layer() {
    let point = [[[ROOT_EDGE / 2 - 1; 3]; 3]];
    let without = Case { keep_crossing: false, ..case(&point, 3) };
    // Eight times 7 leaves of level 2 and 8 of level 3, one of which crosses and goes.
    assert_eq!(levels(&mesh(&without).unwrap().words), [0, 0, 56, 63, 0]);
    // With n = 3 the layer does it: from 2 to 4 units, enlarged by 2, is three octants of level 2.
    let thicker = Case { layer_cells_min: 3, ..without };
    assert_eq!(levels(&mesh(&thicker).unwrap().words), [0, 0, 64 - 27, 27 * 8 - 1, 0]);
}
