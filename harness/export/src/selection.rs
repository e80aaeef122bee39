//! Parts of a mesh: which leaves an export contains.

use contract::failure::Result;
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::mesh::{Each, Leaf, Mesh};
use contract::octant::{CELLS_PER_EDGE, Octant, UNITS_PER_CELL};
use contract::word::Side;

/// The leaves that satisfy every condition; without conditions, all leaves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Leaves whose interior meets this box, given by its two corners in lattice units.
    pub clip: Option<[[i64; 3]; 2]>,
    /// Leaves of at most this level.
    pub level_max: Option<u8>,
    /// Leaves of this side.
    pub side: Option<Side>,
    /// Leaves of this rank.
    pub rank: Option<u32>,
    /// Leaves that a plane normal to an axis cuts.
    pub slice: Option<Slice>,
}

/// A plane normal to an axis. A plane in the common face of two leaves cuts the one on its positive side; on the root's
/// maximum face, it cuts the last leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slice {
    /// The axis: 0, 1 or 2.
    pub axis: usize,
    /// Position along the axis, in lattice units.
    pub at: i64,
}

impl Slice {
    /// The plane at a coordinate in the user's units; `None` if it does not meet the root.
    pub fn new(root: &Root, axis: usize, coordinate: f64) -> Option<Self> {
        let units = UNITS_PER_EDGE as f64;
        // Rounding comes first, as the sum of corner and edge may lie beyond the root.
        let at = ((coordinate - root.origin[axis]) / root.edge * units).round_ties_even();
        (0.0..=units).contains(&at).then_some(Self { axis, at: at as i64 })
    }

    /// The layer of level-19 cells that the plane cuts.
    pub fn layer(&self) -> u32 {
        (self.at / UNITS_PER_CELL).min(i64::from(CELLS_PER_EDGE) - 1) as u32
    }

    /// Whether the plane cuts the octant.
    pub fn cuts(&self, octant: &Octant) -> bool {
        let low = octant.corner[self.axis];
        (low..low + octant.edge()).contains(&self.layer())
    }
}

impl Selection {
    /// Whether an octant is in the slice and in the box, at least in part.
    fn meets(&self, octant: &Octant) -> bool {
        let (low, high) = octant.bounds();
        let meets = |[from, to]: [[i64; 3]; 2]| (0..3).all(|a| low[a] < to[a] && from[a] < high[a]);
        self.slice.is_none_or(|slice| slice.cuts(octant)) && self.clip.is_none_or(meets)
    }

    /// Whether the leaf is selected.
    pub fn has(&self, leaf: &Leaf) -> bool {
        self.meets(&leaf.octant)
            && self.level_max.is_none_or(|level| leaf.octant.level <= level)
            && self.side.is_none_or(|side| leaf.side == side)
            && self.rank.is_none_or(|rank| leaf.rank == rank)
    }

    /// Visits the selected leaves of a mesh in Morton order. All leaves are read once.
    ///
    /// # Errors
    /// As [`Mesh::leaves`].
    pub fn visit(&self, mesh: &Mesh, visit: Each<'_>) -> Result<()> {
        let mut selected = |leaf| if self.has(&leaf) { visit(leaf) } else { Ok(()) };
        mesh.leaves(&|octant| self.meets(octant), &mut selected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::on_disk;
    use contract::testing::random_words;
    use contract::word;
    use proptest::prelude::*;

    fn words(mesh: &Mesh, selection: &Selection) -> Result<Vec<u64>> {
        let mut words = Vec::new();
        selection.visit(mesh, &mut |leaf| {
            words.push(word::encode(leaf.octant, leaf.side));
            Ok(())
        })?;
        Ok(words)
    }

    proptest! {
        #[test]
        fn all_leaves_of_interleaved_parts_are_visited_in_order(
            leaves in random_words(5), parts in 1usize..4, run in 1usize..40
        ) {
            let (_dir, mesh) = on_disk(&leaves, parts, |i| i / run);
            prop_assert_eq!(&words(&mesh, &Selection::default()).unwrap(), &leaves);
        }

        #[test]
        fn a_selection_has_the_leaves_that_satisfy_it(
            leaves in random_words(5), axis in 0usize..3, at in 0.0f64..=1.0, level in 0u8..6
        ) {
            let (_dir, mesh) = on_disk(&leaves, 2, |i| i / 9);
            let slice = Slice::new(&mesh.manifest.root, axis, at);
            let selection = Selection { slice, level_max: Some(level), rank: Some(1), ..Selection::default() };
            let mut expected = Vec::new();
            let mut index = 0;
            mesh.leaves(&|_| true, &mut |leaf| {
                assert_eq!(leaf.index, index);
                index += 1;
                expected.extend(selection.has(&leaf).then(|| {
                    word::encode(leaf.octant, leaf.side)
                }));
                Ok(())
            }).unwrap();
            prop_assert_eq!(words(&mesh, &selection).unwrap(), expected);
        }
    }

    #[test]
    fn leaves_out_of_order_and_invalid_words_are_errors_that_name_the_leaf() {
        let leaves: Vec<u64> = contract::testing::words_of(|o| o.level < 1);
        let mut swapped = leaves.clone();
        swapped.swap(2, 3);
        let mut overlapping = leaves.clone();
        overlapping.insert(0, word::encode(Octant::ROOT, Side::Inside));
        let invalid: Vec<u64> = leaves.iter().map(|w| w | 3).collect();
        for (leaves, expected) in [
            (swapped, "precedes the leaf before"),
            (overlapping, "overlaps or precedes"),
            (invalid, "is not a leaf"),
        ] {
            let (_dir, mesh) = on_disk(&leaves, 1, |_| 0);
            let error = words(&mesh, &Selection::default()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_plane_cuts_exactly_one_of_the_two_leaves_that_share_a_face() {
        let root = Root { origin: [-1.0, 0.0, 0.0], edge: 2.0 };
        let children: Vec<Octant> = (0..8).map(|d| Octant::ROOT.child(d)).collect();
        for (coordinate, digit) in [(-1.0, 0), (-0.3, 0), (0.0, 1), (0.5, 1), (1.0, 1)] {
            let slice = Slice::new(&root, 0, coordinate).unwrap();
            let cut: Vec<u8> = (0..8).filter(|&d| slice.cuts(&children[d as usize])).collect();
            assert_eq!(cut.len(), 4, "{coordinate}");
            assert!(cut.iter().all(|d| d & 1 == digit), "{coordinate}");
        }
        // The sum of this corner and edge is beyond the root by a rounding error.
        let rounded = Root { origin: [0.1; 3], edge: 0.3 };
        let last = Slice::new(&rounded, 2, 0.1 + 0.3).unwrap();
        assert_eq!((last.at, last.layer()), (UNITS_PER_EDGE, CELLS_PER_EDGE - 1));
        assert_eq!(Slice::new(&root, 0, 1.1), None);
        assert_eq!(Slice::new(&root, 0, f64::NAN), None);
    }

    #[test]
    fn a_clip_box_excludes_leaves_that_only_touch_it() {
        let half = UNITS_PER_EDGE / 2;
        let selection =
            Selection { clip: Some([[half; 3], [half + 1; 3]]), ..Selection::default() };
        let leaf = |digit| Leaf {
            octant: Octant::ROOT.child(digit),
            side: Side::Outside,
            rank: 0,
            index: 0,
        };
        let chosen: Vec<u8> = (0..8).filter(|&d| selection.has(&leaf(d))).collect();
        assert_eq!(chosen, [7]);
    }
}
