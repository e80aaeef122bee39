//! What lies across the faces of leaves.

use contract::octant::Octant;
use contract::tree::{HOLES, Handle, Hood, Kind, Kinds, Tree};

/// A look across the faces of those leaves that matter.
pub struct Contacts<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// Leaves are looked at only where some of these occur in their parent or across its faces.
    pub sought: Kinds,
    /// Which leaves matter, by kind and level.
    pub matters: &'a dyn Fn(Kind, u8) -> bool,
}

impl Contacts<'_> {
    /// Tells, for every leaf that matters near what is sought, the kinds of all that shares part of a
    /// face with it, holes among them.
    pub fn visit(&self, found: &mut dyn FnMut(Octant, Kind, Kinds)) {
        let hood = Hood::root(self.tree);
        match hood.centre().as_leaf() {
            // Nothing but the root itself.
            Some(kind) if (self.matters)(kind, 0) => found(hood.octant, kind, 0),
            Some(_) => {}
            None => self.below(&hood, found),
        }
    }

    fn below(&self, hood: &Hood, found: &mut dyn FnMut(Octant, Kind, Kinds)) {
        if !hood.centre().is_node() || self.near(hood) & self.sought == 0 {
            return;
        }
        for digit in 0..8 {
            let child = self.tree.child(hood.centre(), digit, hood.octant.level);
            if child.is_node() {
                self.below(&hood.child(self.tree, digit), found);
            } else if let Some(kind) = child.as_leaf()
                && (self.matters)(kind, hood.octant.level + 1)
            {
                found(hood.octant.child(digit), kind, self.across_faces(hood, digit));
            }
        }
    }

    /// Kinds of all in an octant and in those across its faces.
    fn near(&self, hood: &Hood) -> Kinds {
        const ACROSS: [usize; 7] = [4, 10, 12, 13, 14, 16, 22];
        ACROSS.iter().fold(0, |kinds, &place| kinds | self.tree.kinds(hood.around[place]))
    }

    /// Kinds of all that shares part of a face with a child.
    fn across_faces(&self, hood: &Hood, digit: u8) -> Kinds {
        let mut kinds = 0;
        for axis in 0..3 {
            for (by, facing) in [(-1, 1), (1, 0)] {
                kinds |= on_face(self.tree, hood.across(self.tree, digit, axis, by), axis, facing);
            }
        }
        kinds
    }
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
    use contract::testing::random_words;
    use contract::word;
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
            let contacts = Contacts { tree: &tree, sought: !0, matters: &|_, _| true };
            contacts.visit(&mut |octant, _, kinds| {
                let mut want = 0;
                let mut area = 0;
                for &w in &words {
                    let other = word::octant(w);
                    if share_face(&octant, &other) {
                        want |= 1 << (w & 3);
                        area += u64::from(octant.edge().min(other.edge())).pow(2);
                    }
                }
                let edge = u64::from(octant.edge());
                let in_root = (0..3).flat_map(|a| [-1, 1].map(|s| { let mut by = [0; 3]; by[a] = s; by }))
                    .filter(|by| octant.neighbour(*by).is_some()).count() as u64;
                if area < in_root * edge * edge {
                    want |= HOLES;
                }
                assert_eq!(kinds, want, "{octant}");
                seen += 1;
            });
            prop_assert_eq!(seen, words.len());
        }
    }
}
