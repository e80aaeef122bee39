//! The kinds of leaves across the faces of a leaf.

use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Kind, Kinds, Neighbourhood, Tree};

/// A visit of leaves with the kinds of their neighbours across faces.
pub struct Contacts<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// Only leaves whose parent contains or adjoins one of these kinds are visited.
    pub sought: Kinds,
    /// Selects the leaves to visit, by kind and level.
    pub matters: &'a dyn Fn(Kind, u8) -> bool,
}

impl Contacts<'_> {
    /// Calls `visit` with the octant and the kind of every selected leaf, and with the kinds of everything that
    /// shares part of a face with it, holes included.
    pub fn visit(&self, visit: &mut dyn FnMut(Octant, Kind, Kinds)) {
        let neighbourhood = Neighbourhood::root(self.tree);
        match neighbourhood.centre().as_leaf() {
            Some(kind) if (self.matters)(kind, 0) => visit(neighbourhood.octant, kind, 0),
            Some(_) => {}
            None => self.below(&neighbourhood, visit),
        }
    }

    fn below(&self, neighbourhood: &Neighbourhood, visit: &mut dyn FnMut(Octant, Kind, Kinds)) {
        if !neighbourhood.centre().is_node() || self.near(neighbourhood) & self.sought == 0 {
            return;
        }
        for digit in 0..8 {
            let child = self.tree.child(neighbourhood.centre(), digit, neighbourhood.octant.level);
            if child.is_node() {
                self.below(&neighbourhood.child(self.tree, digit), visit);
            } else if let Some(kind) = child.as_leaf()
                && (self.matters)(kind, neighbourhood.octant.level + 1)
            {
                visit(
                    neighbourhood.octant.child(digit),
                    kind,
                    self.across_faces(neighbourhood, digit),
                );
            }
        }
    }

    /// Kinds of all leaves in an octant and in its neighbours across faces.
    fn near(&self, neighbourhood: &Neighbourhood) -> Kinds {
        const ACROSS: [usize; 7] = [4, 10, 12, 13, 14, 16, 22];
        ACROSS.iter().fold(0, |kinds, &i| kinds | self.tree.kinds(neighbourhood.handles[i]))
    }

    /// Kinds of everything that shares part of a face with a child.
    fn across_faces(&self, neighbourhood: &Neighbourhood, digit: u8) -> Kinds {
        let mut kinds = 0;
        for axis in 0..3 {
            for (by, facing) in [(-1, 1), (1, 0)] {
                kinds |= on_face(
                    self.tree,
                    neighbourhood.across(self.tree, digit, axis, by),
                    axis,
                    facing,
                );
            }
        }
        kinds
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
            words in random_words(3), matter in prop::array::uniform3(any::<bool>()), deepest in 0u8..=3,
        ) {
            let tree = Tree::of_words(&words);
            let mut seen = 0;
            let matters = |kind: Kind, level| matter[usize::from(kind)] && level <= deepest;
            let contacts = Contacts { tree: &tree, sought: !0, matters: &matters };
            contacts.visit(&mut |octant, kind, kinds| {
                assert!(matters(kind, octant.level), "{octant}");
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
                seen += 1;
            });
            let selected = words.iter().filter(|&&w| matters((w & 3) as Kind, word::level(w)));
            prop_assert_eq!(seen, selected.count());
        }
    }
}
