//! The kinds of leaves across the faces of a leaf.

use contract::neighbourhood::Neighbourhood;
use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Kinds, Tree};

/// Is called with a leaf, its kind and the kinds across its faces.
type Visit<'v> = &'v mut dyn FnMut(Octant, Kind, Kinds);

/// Visits leaves of some kinds, with the kinds of everything that shares part of a face with them, holes included: all such leaves whose
/// parent contains or adjoins one of the kinds that are sought. A leaf that is the root has no faces to look across.
pub fn visit(tree: &Tree, of: Kinds, sought: Kinds, visit: Visit) {
    below(tree, [of, sought], &Neighbourhood::root(tree), visit);
}

fn below(tree: &Tree, [of, sought]: [Kinds; 2], around: &Neighbourhood, visit: Visit) {
    let mut across = (0..6).map(|face| around.at_face(face));
    let near = |h| tree.kinds(h) & sought != 0;
    if !around.centre().is_node() || !(near(around.centre()) || across.any(near)) {
        return;
    }
    for digit in 0..8 {
        let child = tree.child(around.centre(), digit, around.octant.level);
        if tree.kinds(child) & of == 0 {
            continue;
        }
        if let Some(kind) = child.as_leaf() {
            // Of a leaf's neighbours, only those across its faces are found: the other twenty cost most of the time.
            let facing = |face| on_face(tree, around.across(tree, digit, face), face ^ 1);
            let kinds = (0..6).map(facing).fold(0, |all, kinds| all | kinds);
            visit(around.octant.child(digit), kind, kinds);
        } else {
            below(tree, [of, sought], &around.child(tree, digit), visit);
        }
    }
}

/// Kinds of all leaves in an octant that adjoin a face of it.
fn on_face(tree: &Tree, handle: Handle, face: usize) -> Kinds {
    let kinds = tree.kinds(handle);
    if !handle.is_node() || kinds.is_power_of_two() {
        return kinds;
    }
    let facing = (0..8u8).filter(|d| d >> (face / 2) & 1 == face as u8 & 1);
    // Kinds do not depend on the level, so any level serves.
    facing.fold(0, |k, d| k | on_face(tree, tree.child(handle, d, 0), face))
}

/// The names of the kinds.
pub fn name(kinds: Kinds) -> String {
    let names = [(1, "outside"), (2, "inside"), (4, "crossing"), (8, "deleted"), (HOLES, "a hole")];
    let present: Vec<_> = names.iter().filter(|(bit, _)| kinds & bit != 0).map(|n| n.1).collect();
    present.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::random_words;
    use contract::word;
    use proptest::prelude::*;

    /// Whether two octants share a part of a face that has positive area.
    fn share_face(a: &Octant, b: &Octant) -> bool {
        let ((al, ah), (bl, bh)) = (a.bounds(), b.bounds());
        let overlap: [i64; 3] = std::array::from_fn(|i| ah[i].min(bh[i]) - al[i].max(bl[i]));
        overlap.iter().all(|&o| o >= 0) && overlap.iter().filter(|&&o| o == 0).count() == 1
    }

    proptest! {
        #[test]
        fn contacts_agree_with_a_comparison_of_all_pairs(
            words in random_words(3), of in 0u8..8, sought in 0u8..32,
        ) {
            let tree = Tree::of_words(&words);
            let mut touching = 0;
            visit(&tree, of, sought, &mut |octant, kind, kinds| {
                assert_eq!(tree.locate(octant.corner), Some((octant, kind)));
                assert!(of >> kind & 1 == 1);
                let mut expected = 0;
                let mut area = 0;
                for &w in &words {
                    let other = word::octant(w);
                    if share_face(&octant, &other) {
                        expected |= 1 << (w & 3);
                        area += u64::from(octant.edge().min(other.edge())).pow(2);
                    }
                }
                let edge = u64::from(octant.edge());
                let offsets = (0..3).flat_map(|a| [-1, 1].map(|s| { let mut offset = [0; 3]; offset[a] = s; offset }));
                let in_root = offsets.filter(|offset| octant.neighbour(*offset).is_some()).count() as u64;
                if area < in_root * edge * edge {
                    expected |= HOLES;
                }
                assert_eq!(kinds, expected, "{octant}");
                touching += u64::from(kinds & sought != 0);
            });
            let mut all = 0;
            visit(&tree, of, !0, &mut |_, _, kinds| all += u64::from(kinds & sought != 0));
            prop_assert_eq!(touching, all);
            let mut seen = 0;
            visit(&tree, of, !0, &mut |_, _, _| seen += 1);
            let wanted = words.iter().filter(|&w| of >> (w & 3) & 1 == 1 && words.len() > 1);
            prop_assert_eq!(seen, wanted.count());
        }
    }
}
