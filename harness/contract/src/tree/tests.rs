use super::*;
use crate::neighbourhood::{Neighbourhood, OFFSETS};
use crate::octant::CELLS_PER_EDGE;
use crate::testing::{octants_of, random_words, words_of};
use proptest::prelude::*;

#[test]
fn a_handle_is_a_leaf_part_of_a_coarser_one_a_node_or_neither() {
    for handle in [Handle::HOLE, Handle::OUTSIDE_ROOT] {
        assert_eq!(
            (handle.as_leaf(), handle.as_coarser_leaf(), handle.is_node()),
            (None, None, false)
        );
    }
    for kind in 0..=DELETED {
        let leaf = Handle::leaf(kind);
        assert_eq!(
            (leaf.as_leaf(), leaf.as_coarser_leaf(), leaf.is_node()),
            (Some(kind), None, false)
        );
        for level in 0..=crate::octant::LEVEL_MAX {
            let part = Handle::coarser_leaf(kind, level);
            assert_eq!(
                (part.as_leaf(), part.as_coarser_leaf(), part.is_node()),
                (None, Some((kind, level)), false)
            );
        }
    }
    for index in [0, 1, 1 << 30] {
        let node = Handle::node(index);
        assert_eq!((node.as_leaf(), node.as_coarser_leaf(), node.is_node()), (None, None, true));
        assert_eq!(node.index(), index);
    }
}

#[test]
fn summaries_of_holes_leaves_and_parts_of_leaves_agree() {
    let tree = Tree::default();
    let of =
        |handle| (tree.finest_level(handle, 7), tree.coarsest_level(handle, 7), tree.kinds(handle));
    assert_eq!(of(Handle::HOLE), (0, NO_LEAF, HOLES));
    assert_eq!(of(Handle::OUTSIDE_ROOT), (0, NO_LEAF, 0));
    for kind in 0..=DELETED {
        let coarsest = |level| if kind == DELETED { NO_LEAF } else { level };
        assert_eq!(of(Handle::leaf(kind)), (7, coarsest(7), 1 << kind));
        assert_eq!(of(Handle::coarser_leaf(kind, 4)), (4, coarsest(4), 1 << kind));
        assert_eq!(tree.child(Handle::leaf(kind), 3, 7), Handle::coarser_leaf(kind, 7));
        let part = Handle::coarser_leaf(kind, 4);
        assert_eq!(tree.child(part, 3, 7), part);
    }
    for handle in [Handle::HOLE, Handle::OUTSIDE_ROOT] {
        assert_eq!(tree.child(handle, 5, 2), handle);
    }
}

#[test]
fn a_deleted_leaf_bounds_no_level_from_above_and_is_a_kind() {
    let mut builder = Builder::default();
    for digit in 0..8 {
        let child = Octant::ROOT.child(digit);
        let kind = if digit == 2 { DELETED } else { 0 };
        let octants =
            if digit == 5 { (0..8).map(|d| child.child(d)).collect() } else { vec![child] };
        for octant in octants {
            builder.push_leaf(word::key_of(octant.corner), octant.level, kind);
        }
    }
    let last = Block { first: (word::KEY_END - 1) << 7 | 19 << 2, depth: 0 };
    assert!(builder.push_block(&last).unwrap_err().contains("overlaps"));
    let invalid = Block { first: 25 << 2, depth: 0 };
    assert_eq!(builder.push_block(&invalid), Err(word::check(25 << 2).unwrap_err()));
    let tree = builder.finish();
    let root = tree.root;
    assert_eq!(
        (tree.finest_level(root, 0), tree.coarsest_level(root, 0), tree.kinds(root)),
        (2, 1, 1 | 1 << DELETED)
    );
    let deleted = tree.child(root, 2, 0);
    assert_eq!((deleted.as_leaf(), tree.coarsest_level(deleted, 1)), (Some(DELETED), NO_LEAF));
    let only = Tree::of_words(&[0]);
    assert_eq!((only.nodes(), only.locate([5; 3])), (0, Some((Octant::ROOT, 0))));
}

#[test]
fn many_distinct_nodes_are_stored_and_found_again() {
    // Every leaf of level 4 has a kind of its own digits, so that most nodes differ.
    let kind = |o: &Octant| (crate::digest::mix(word::key_of(o.corner)) % 3) as u64;
    let mut words = words_of(|o| o.level < 5);
    words.iter_mut().for_each(|w| *w |= kind(&word::octant(*w)));
    let tree = Tree::of_words(&words);
    assert!(tree.nodes() > 2048);
    for &w in words.iter().step_by(11) {
        assert_eq!(tree.locate(word::octant(w).corner), Some((word::octant(w), (w & 3) as Kind)));
    }
}

#[test]
fn equal_subtrees_are_stored_once() {
    let level_4 = words_of(|octant| octant.level < 4);
    let tree = Tree::of_words(&level_4);
    assert_eq!(level_4.len(), 4096);
    assert_eq!(tree.nodes(), 4);
    assert_eq!(tree.finest_level(tree.root, 0), 4);
    assert_eq!(tree.coarsest_level(tree.root, 0), 4);
}

/// Visits every leaf with its neighbourhood, in Morton order.
fn walk(tree: &Tree, at: &Neighbourhood, leaf: &mut dyn FnMut(&Neighbourhood, Kind)) {
    if let Some(kind) = at.centre().as_leaf() {
        leaf(at, kind);
    } else if at.centre().is_node() {
        (0..8).for_each(|d| walk(tree, &at.child(tree, d), leaf));
    }
}

proptest! {
    #[test]
    fn locating_a_cell_agrees_with_a_linear_search(words in random_words(4), cells in prop::collection::vec(any::<[u32; 3]>(), 50)) {
        let tree = Tree::of_words(&words);
        for cell in cells {
            let cell = cell.map(|c| c % CELLS_PER_EDGE);
            let contains = |w: &&u64| word::octant(**w).contains(&Octant { corner: cell, level: 19 });
            let expected = words.iter().find(contains).map(|&w| (word::octant(w), (w & 3) as Kind));
            prop_assert_eq!(tree.locate(cell), expected);
        }
    }

    #[test]
    fn a_walk_enters_the_octants_that_it_is_asked_to(words in random_words(3), deepest in 0u8..4) {
        let tree = Tree::of_words(&words);
        let mut found = Vec::new();
        tree.walk(&mut |octant, handle| {
            assert_eq!(handle, Neighbourhood::of(&tree, octant).centre(), "{octant}");
            found.push(octant);
            octant.level < deepest
        });
        let is_split = |octant: &Octant| words.iter().any(|&w| octant.contains(&word::octant(w)) && word::level(w) > octant.level);
        let mut expected = vec![Octant::ROOT];
        let mut at = 0;
        while at < expected.len() {
            let octant = expected[at];
            at += 1;
            if octant.level < deepest && is_split(&octant) {
                expected.splice(at..at, (0..8).map(|digit| octant.child(digit)));
            }
        }
        prop_assert_eq!(found, expected);
    }

}

proptest! {
    // Each case searches among all leaves for every neighbour of every octant.
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn a_walk_visits_every_leaf_with_its_neighbourhood(words in random_words(3)) {
        let tree = Tree::of_words(&words);
        let mut found = Vec::new();
        walk(&tree, &Neighbourhood::root(&tree), &mut |neighbourhood, kind| {
            let Octant { corner, level } = neighbourhood.octant;
            found.push(word::key_of(corner) << 7 | u64::from(level) << 2 | u64::from(kind));
            let same = Neighbourhood::of(&tree, neighbourhood.octant);
            assert_eq!(same.handles, neighbourhood.handles);
            let faces = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];
            for (face, beyond) in faces.iter().enumerate() {
                let i = OFFSETS.iter().position(|offset| offset == beyond).unwrap();
                assert_eq!(same.at_face(face), same.handles[i]);
            }
        });
        prop_assert_eq!(found, words);
    }

    #[test]
    fn neighbourhoods_agree_with_a_search_for_each_neighbour(words in random_words(3)) {
        let tree = Tree::of_words(&words);
        for octant in octants_of(&words).into_iter().step_by(5) {
            let neighbourhood = Neighbourhood::of(&tree, octant);
            for (i, offset) in OFFSETS.iter().enumerate() {
                let handle = neighbourhood.handles[i];
                let Some(neighbour) = octant.neighbour(*offset) else {
                    prop_assert_eq!(handle, Handle::OUTSIDE_ROOT);
                    continue;
                };
                let inside: Vec<_> = words.iter().filter(|&&w| neighbour.contains(&word::octant(w))).collect();
                let above = words.iter().find(|&&w| word::octant(w).contains(&neighbour));
                if let Some(&w) = above {
                    let (level, kind) = (word::level(w), (w & 3) as Kind);
                    let expected = if level == octant.level { Handle::leaf(kind) } else { Handle::coarser_leaf(kind, level) };
                    prop_assert_eq!(handle, expected);
                } else if inside.is_empty() {
                    prop_assert_eq!(handle, Handle::HOLE);
                } else {
                    prop_assert!(handle.is_node());
                    let levels = inside.iter().map(|&&w| word::level(w));
                    prop_assert_eq!(tree.finest_level(handle, octant.level), levels.clone().max().unwrap());
                    prop_assert_eq!(tree.coarsest_level(handle, octant.level), levels.min().unwrap());
                }
            }
        }
    }
}
