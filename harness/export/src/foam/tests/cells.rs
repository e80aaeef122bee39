//! Cells are closed and joined where they touch: on random trees with holes, and on every tree of two levels.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn cells_of_any_tree_are_closed_and_joined_where_they_touch(words in random_words(3)) {
        prop_assume!(!words.is_empty());
        let (dir, mesh) = on_disk(&leaf_set(vec![words.clone()]));
        let target = dir.path().join("case/constant/polyMesh");
        let summary = write(&whole(&mesh, &options()), &target).unwrap();
        let complex = complex_in(&target);
        complex.assert_ordered();
        complex.assert_closed(words.len());
        let octants: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
        complex.assert_adjacent(&octants, mesh.manifest.root.edge / f64::from(CELLS_PER_EDGE));
        prop_assert_eq!(summary.leaves, words.len() as u64);
    }

    #[test]
    fn cells_that_differ_by_many_levels_are_closed(words in random_words(5)) {
        complex_of(&words).assert_closed(words.len());
    }
}

/// At both ends of the root's diagonal.
#[test]
fn cells_of_the_finest_level_are_closed() {
    let is_at_end = |o: &Octant| [0, CELLS_PER_EDGE - o.edge()].iter().any(|&c| o.corner == [c; 3]);
    let words = contract::testing::words_of(|o| o.level < LEVEL_MAX && is_at_end(o));
    complex_of(&words).assert_closed(words.len());
}

/// Every octant of level 1 is a hole, a leaf, or eight leaves: 6,560 trees.
#[test]
fn cells_of_every_tree_of_two_levels_are_closed() {
    for tree in 1..3u32.pow(8) {
        let content = |digit: u8| tree / 3u32.pow(u32::from(digit)) % 3;
        let words = words_with_sides(
            |o| o.level == 0 || o.level == 1 && content(o.digit()) == 2,
            |o| (content(o.ancestor(1).digit()) > 0).then_some(Side::Outside),
        );
        let complex = complex_of(&words);
        complex.assert_closed(words.len());
        // The pairs of cells are compared for some: there are many in each tree.
        if tree % 13 == 0 {
            let octants: Vec<_> = words.iter().map(|&w| word::octant(w)).collect();
            complex.assert_adjacent(&octants, 1.0);
        }
    }
}

/// The point in the middle of an edge belongs to all faces at that edge, also those of cells that touch finer cells nowhere else.
#[test]
fn a_hanging_node_belongs_to_all_faces_at_its_edge() {
    let words = contract::testing::words_of(|o| o.level == 0 || o.level == 1 && o.corner == [0; 3]);
    let complex = complex_of(&words);
    let half = f64::from(CELLS_PER_EDGE) / 2.0;
    // On the edge along x between the fine octant and the one that touches it in this edge only.
    let node = complex.points.iter().position(|&p| p == [half / 2.0, half, half]).unwrap();
    let faces = complex.faces.iter().filter(|vertices| vertices.contains(&node));
    // Two fine cells at each of two coarse ones and between themselves, and the two faces among coarse cells.
    assert_eq!(faces.count(), 7);
}
