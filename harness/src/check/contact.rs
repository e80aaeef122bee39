//! What lies across the faces of leaves.

use crate::tree::{HOLES, Handle, Hood, Kind, Kinds, Tree, walk};

/// Visits every leaf in whose hood all of `needed` occur, with the kinds of what shares part of a
/// face with it, holes among them.
pub fn visit(tree: &Tree, needed: &[Kinds], found: &mut dyn FnMut(&Hood, Kind, Kinds)) {
    let worth_it = |hood: &Hood| {
        let near = hood.around.iter().fold(0, |kinds, &at| kinds | tree.kinds(at));
        needed.iter().all(|&any_of| near & any_of != 0)
    };
    walk(tree, &mut |hood| worth_it(hood), &mut |hood, kind| {
        if worth_it(hood) {
            found(hood, kind, across_faces(tree, hood));
        }
    });
}

/// Kinds of all that shares part of a face with a leaf.
fn across_faces(tree: &Tree, hood: &Hood) -> Kinds {
    let mut kinds = 0;
    for axis in 0..3 {
        for (by, facing) in [(-1, 1), (1, 0)] {
            let mut offset = [0; 3];
            offset[axis] = by;
            kinds |= on_face(tree, hood.place(offset), axis, facing);
        }
    }
    kinds
}

/// Kinds of all in an octant that reach its face on the low (0) or high (1) side of an axis.
fn on_face(tree: &Tree, at: Handle, axis: usize, side: u8) -> Kinds {
    let kinds = tree.kinds(at);
    if !at.is_node() || kinds.is_power_of_two() {
        return kinds;
    }
    let facing = (0..8u8).filter(|d| d >> axis & 1 == side);
    // Levels do not matter here, so any will do.
    facing.fold(0, |k, d| k | on_face(tree, tree.child(at, d, 0), axis, side))
}

/// The kinds, in words.
pub fn name(kinds: Kinds) -> String {
    let names = [(1, "outside"), (2, "inside"), (4, "crossing"), (8, "deleted"), (HOLES, "a hole")];
    let there: Vec<_> = names.iter().filter(|(bit, _)| kinds & bit != 0).map(|n| n.1).collect();
    there.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::testing::random_words;
    use crate::octant::Octant;
    use crate::word;
    use proptest::prelude::*;

    /// Whether two octants share part of a face with positive area.
    fn share_face(a: &Octant, b: &Octant) -> bool {
        let ((al, ah), (bl, bh)) = (a.bounds(), b.bounds());
        let overlap: [i64; 3] = std::array::from_fn(|i| ah[i].min(bh[i]) - al[i].max(bl[i]));
        overlap.iter().all(|&o| o >= 0) && overlap.iter().filter(|&&o| o == 0).count() == 1
    }

    proptest! {
        #[test]
        fn agrees_with_all_pairs(words in random_words(3)) {
            let tree = Tree::of_words(&words);
            let mut seen = 0;
            visit(&tree, &[], &mut |hood, _, kinds| {
                let mut want = 0;
                let mut area = 0;
                for &w in &words {
                    let other = word::octant(w);
                    if share_face(&hood.octant, &other) {
                        want |= 1 << (w & 3);
                        area += u64::from(hood.octant.edge().min(other.edge())).pow(2);
                    }
                }
                let edge = u64::from(hood.octant.edge());
                let in_root = (0..3).flat_map(|a| [-1, 1].map(|s| { let mut by = [0; 3]; by[a] = s; by }))
                    .filter(|by| hood.octant.neighbour(*by).is_some()).count() as u64;
                if area < in_root * edge * edge {
                    want |= HOLES;
                }
                assert_eq!(kinds, want, "{}", hood.octant);
                seen += 1;
            });
            prop_assert_eq!(seen, words.len());
        }
    }
}
