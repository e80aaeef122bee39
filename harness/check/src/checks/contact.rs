//! The kinds of leaves across the faces of a leaf.

use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Kinds, Neighbourhood, Tree};

/// Visits leaves with their kinds, and with the kinds of everything that shares part of a face with them, holes included: all leaves
/// whose parent contains or adjoins one of the kinds that are sought.
pub fn visit(tree: &Tree, sought: Kinds, visit: &mut dyn FnMut(Octant, Kind, Kinds)) {
    below(tree, sought, &Neighbourhood::root(tree), visit);
}

fn below(
    tree: &Tree,
    sought: Kinds,
    around: &Neighbourhood,
    visit: &mut dyn FnMut(Octant, Kind, Kinds),
) {
    let across = |axis: usize, by: i32| {
        let mut offset = [0; 3];
        offset[axis] = by;
        around.at_offset(offset)
    };
    if let Some(kind) = around.centre().as_leaf() {
        let faces = (0..3).flat_map(|axis| [(axis, -1, 1), (axis, 1, 0)]);
        let kinds = faces.map(|(axis, by, facing)| on_face(tree, across(axis, by), axis, facing));
        return visit(around.octant, kind, kinds.fold(0, |all, kinds| all | kinds));
    }
    let mut near = (0..3).flat_map(|axis| [0, -1, 1].map(|by| across(axis, by)));
    if around.centre().is_node() && near.any(|handle| tree.kinds(handle) & sought != 0) {
        (0..8).for_each(|digit| below(tree, sought, &around.child(tree, digit), visit));
    }
}

/// Kinds of all leaves in an octant that adjoin its face on the low (0) or high (1) side of an axis.
fn on_face(tree: &Tree, handle: Handle, axis: usize, side: u8) -> Kinds {
    let kinds = tree.kinds(handle);
    if !handle.is_node() || kinds.is_power_of_two() {
        return kinds;
    }
    let facing = (0..8u8).filter(|d| d >> axis & 1 == side);
    // Kinds do not depend on the level, so any level serves.
    facing.fold(0, |k, d| k | on_face(tree, tree.child(handle, d, 0), axis, side))
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
            words in random_words(3), sought in 0u8..32,
        ) {
            let tree = Tree::of_words(&words);
            let mut touching = 0;
            visit(&tree, sought, &mut |octant, kind, kinds| {
                assert_eq!(tree.locate(octant.corner), Some((octant, kind)));
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
            visit(&tree, !0, &mut |_, _, kinds| all += u64::from(kinds & sought != 0));
            prop_assert_eq!(touching, all);
            let mut seen = 0;
            visit(&tree, !0, &mut |_, _, _| seen += 1);
            prop_assert_eq!(seen, words.len());
        }
    }
}
