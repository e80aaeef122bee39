//! The points of a piece: the corners of its leaves without duplicates.

use rustc_hash::FxHashMap;

use crate::leaf::Leaf;

/// Corners of a hexahedron in VTK's order, in cell edges.
const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// Points and cells of a piece.
#[derive(Debug, Default)]
pub struct Points {
    /// The points in order of their numbers, packed: 20 bits per axis, because coordinates range from 0 to 2^19 level-19 cells inclusive.
    pub packed: Vec<u64>,
    /// Eight numbers for each leaf, in VTK's order.
    pub connectivity: Vec<u32>,
    /// The number of each point by its packed coordinates.
    numbers: FxHashMap<u64, u32>,
}

impl Points {
    /// Replaces the content by that of these leaves, which are in Morton order.
    pub fn set(&mut self, leaves: &[Leaf]) {
        self.packed.clear();
        self.connectivity.clear();
        self.numbers.clear();
        for Leaf { octant, .. } in leaves {
            for corner in CORNERS {
                let at = packed([0, 1, 2].map(|a| octant.corner[a] + octant.edge() * corner[a]));
                let number = *self.numbers.entry(at).or_insert(self.packed.len() as u32);
                if number as usize == self.packed.len() {
                    self.packed.push(at);
                }
                self.connectivity.push(number);
            }
        }
    }

    /// Asserts that every cell has eight points, of which the first and the seventh are its lowest and its highest corner, and that the
    /// last point is that of a cell.
    ///
    /// # Panics
    /// If that is not so.
    pub fn check_invariants(&self, leaves: &[Leaf]) {
        assert_eq!(self.connectivity.len(), 8 * leaves.len(), "eight points per cell");
        for (Leaf { octant, .. }, corners) in leaves.iter().zip(self.connectivity.chunks_exact(8)) {
            let [low, high] = [0, 6].map(|i| unpacked(self.packed[corners[i] as usize]));
            let expected = octant.corner.map(|c| c + octant.edge());
            assert!(low == octant.corner && high == expected, "{octant} from {low:?} to {high:?}");
        }
        let last = self.connectivity.iter().max().map_or(0, |last| *last as usize + 1);
        assert_eq!(last, self.packed.len(), "points of cells and all points");
    }
}

/// A corner as one number.
pub fn packed(corner: [u32; 3]) -> u64 {
    corner.iter().rev().fold(0, |p, &c| p << 20 | u64::from(c))
}

/// The inverse of [`packed`].
pub fn unpacked(packed: u64) -> [u32; 3] {
    [0, 20, 40].map(|shift| (packed >> shift & 0xf_ffff) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_of};
    use contract::word;
    use proptest::prelude::*;

    /// Every vertex of a cell is the point at that corner of its leaf, and no two points coincide.
    fn check(words: &[u64]) -> Points {
        let leaf =
            |&w: &u64| Leaf { octant: word::octant(w), side: word::side(w), rank: 0, index: 0 };
        let leaves: Vec<Leaf> = words.iter().map(leaf).collect();
        let mut points = Points::default();
        // What is left of another piece has no effect.
        points.set(&leaves[leaves.len() / 2..]);
        points.set(&leaves);
        assert_eq!(points.connectivity.len(), 8 * leaves.len());
        for (vertices, Leaf { octant, .. }) in points.connectivity.chunks(8).zip(&leaves) {
            for (&vertex, c) in vertices.iter().zip(CORNERS) {
                let corner = [0, 1, 2].map(|a| octant.corner[a] + octant.edge() * c[a]);
                assert_eq!(unpacked(points.packed[vertex as usize]), corner);
            }
        }
        let mut distinct = points.packed.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), points.packed.len());
        points
    }

    #[test]
    fn planted_wrong_points_are_noticed() {
        let noticed = |why: &str, change: &dyn Fn(&mut Points)| {
            let words = words_of(|o| o.level < 2);
            let leaf =
                |&w: &u64| Leaf { octant: word::octant(w), side: word::side(w), rank: 0, index: 0 };
            let leaves: Vec<Leaf> = words.iter().map(leaf).collect();
            let mut points = Points::default();
            points.set(&leaves);
            points.check_invariants(&leaves);
            change(&mut points);
            let check = std::panic::AssertUnwindSafe(|| points.check_invariants(&leaves));
            let caught = std::panic::catch_unwind(check).unwrap_err();
            let message = caught.downcast_ref::<String>().unwrap();
            assert!(message.contains(why), "{message}");
        };
        noticed("eight points", &|p| p.connectivity.truncate(500));
        noticed("from [", &|p| p.connectivity.swap(0, 1));
        noticed("from [", &|p| p.packed[40] += 1);
        noticed("all points", &|p| p.packed.push(0));
    }

    #[test]
    fn leaves_of_one_level_have_a_lattice_of_points() {
        for level in 0..5 {
            let points = check(&words_of(|o| o.level < level));
            assert_eq!(points.packed.len(), ((1 << level) + 1usize).pow(3));
        }
    }

    #[test]
    fn blocks_of_different_levels_share_points() {
        for level in 2..6 {
            check(&words_of(|o| o.level < 2 || o.level < level && o.corner[0] == 0));
        }
    }

    proptest! {
        #[test]
        fn vertices_are_the_corners_of_leaves(words in random_words(5)) {
            check(&words);
        }
    }
}
