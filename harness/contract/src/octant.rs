//! Octants: cells of the oct-tree, given by corner and level.
//!
//! Invariants: `level <= LEVEL_MAX`; every coordinate of `corner` is less than `CELLS_PER_EDGE` and a multiple
//! of the octant's edge. The unit of coordinates is the edge of a level-19 cell, which is `UNITS_PER_CELL`
//! lattice units.

use std::fmt;

/// Deepest level.
pub const LEVEL_MAX: u8 = 19;
/// Level-19 cells along an edge of the root.
pub const CELLS_PER_EDGE: u32 = 1 << LEVEL_MAX;
/// Lattice units along an edge of a level-19 cell.
pub const UNITS_PER_CELL: i64 = 256;

/// Edge length of the octants of a level, in level-19 cells.
pub fn edge_of(level: u8) -> i64 {
    i64::from(CELLS_PER_EDGE >> level)
}

/// One cell of the oct-tree, leaf or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Octant {
    /// Minimum corner, in level-19 cells.
    pub corner: [u32; 3],
    /// Number of bisections of the root.
    pub level: u8,
}

impl Octant {
    /// The root.
    pub const ROOT: Self = Self { corner: [0; 3], level: 0 };

    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.level
    }

    /// The child with this digit: bit 0 is x, bit 1 is y, bit 2 is z. Panics on level 19.
    pub fn child(&self, digit: u8) -> Self {
        assert!(self.level < LEVEL_MAX && digit < 8, "no child {digit} of {self:?}");
        let half = self.edge() / 2;
        let corner = std::array::from_fn(|a| self.corner[a] + half * u32::from(digit >> a & 1));
        Self { corner, level: self.level + 1 }
    }

    /// The ancestor at a level that is at most the octant's own.
    pub fn ancestor(&self, level: u8) -> Self {
        assert!(level <= self.level, "level {level} is deeper than {self:?}");
        let mask = !((CELLS_PER_EDGE >> level) - 1);
        Self { corner: self.corner.map(|c| c & mask), level }
    }

    /// The parent of an octant other than the root.
    pub fn parent(&self) -> Self {
        self.ancestor(self.level - 1)
    }

    /// The digit of the octant among its siblings.
    pub fn digit(&self) -> u8 {
        (0..3).map(|a| u8::from(self.corner[a] & self.edge() != 0) << a).sum()
    }

    /// The octant of the same level at an offset in edges of the octant; `None` outside the root.
    pub fn neighbour(&self, offset: [i32; 3]) -> Option<Self> {
        let edge = i64::from(self.edge());
        let corner = [0, 1, 2].map(|a| i64::from(self.corner[a]) + i64::from(offset[a]) * edge);
        let is_inside = corner.iter().all(|c| (0..i64::from(CELLS_PER_EDGE)).contains(c));
        is_inside.then(|| Self { corner: corner.map(|c| c as u32), level: self.level })
    }

    /// Whether a face lies on the boundary of the root.
    pub fn is_at_boundary(&self) -> bool {
        self.corner.iter().any(|&c| c == 0 || c + self.edge() == CELLS_PER_EDGE)
    }

    /// Whether `other` is this octant or one of its descendants.
    pub fn contains(&self, other: &Self) -> bool {
        other.level >= self.level && other.ancestor(self.level) == *self
    }

    /// Chebyshev distance of two closed octants, in level-19 cells; 0 if they touch.
    pub fn distance(&self, other: &Self) -> i64 {
        let ((low, high), (its_low, its_high)) = (self.bounds(), other.bounds());
        let along = |a: usize| (low[a] - its_high[a]).max(its_low[a] - high[a]);
        (0..3).map(along).fold(0, i64::max) / UNITS_PER_CELL
    }

    /// Minimum and maximum corner in lattice units.
    pub fn bounds(&self) -> ([i64; 3], [i64; 3]) {
        let low = self.corner.map(|c| i64::from(c) * UNITS_PER_CELL);
        let edge = i64::from(self.edge()) * UNITS_PER_CELL;
        (low, low.map(|c| c + edge))
    }

    /// The centre in lattice units. It is exact, because a level-19 cell is 256 units wide.
    pub fn centre(&self) -> [i64; 3] {
        let (low, high) = self.bounds();
        std::array::from_fn(|a| (low[a] + high[a]) / 2)
    }

    /// The digits from the root to the octant, for example `3.1.4`; `root` for the root.
    pub fn path(&self) -> String {
        if self.level == 0 {
            return "root".to_owned();
        }
        (1..=self.level).map(|l| self.ancestor(l).digit().to_string()).collect::<Vec<_>>().join(".")
    }
}

impl fmt::Display for Octant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "octant {} (level {})", self.path(), self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every octant down to `level`, coarse octants first.
    fn all_down_to(level: u8) -> Vec<Octant> {
        let mut all = vec![Octant::ROOT];
        let mut next = 0;
        while next < all.len() {
            let octant = all[next];
            if octant.level < level {
                all.extend((0..8).map(|d| octant.child(d)));
            }
            next += 1;
        }
        all
    }

    #[test]
    fn children_have_their_digit_and_tile_their_parent() {
        for parent in all_down_to(2) {
            let mut volume = 0;
            for digit in 0..8 {
                let child = parent.child(digit);
                assert_eq!(child.digit(), digit);
                assert_eq!(child.ancestor(parent.level), parent);
                assert!(parent.contains(&child) && !child.contains(&parent));
                volume += u64::from(child.edge()).pow(3);
            }
            assert_eq!(volume, u64::from(parent.edge()).pow(3));
        }
    }

    /// Exhaustive to level 3, compared with a search among the bounds of all octants.
    #[test]
    fn neighbours_have_adjacent_bounds() {
        let all = all_down_to(3);
        for octant in &all {
            let (low, high) = octant.bounds();
            for offset in triples(-1..=1) {
                let edge = high[0] - low[0];
                let expected: [i64; 3] =
                    std::array::from_fn(|a| low[a] + i64::from(offset[a]) * edge);
                let found =
                    all.iter().find(|o| o.level == octant.level && o.bounds().0 == expected);
                assert_eq!(octant.neighbour(offset), found.copied());
            }
        }
    }

    #[test]
    fn the_distance_is_the_largest_gap_along_an_axis() {
        let all = all_down_to(2);
        for a in &all {
            for b in &all {
                let ((low, high), (low_b, high_b)) = (a.bounds(), b.bounds());
                let gap = |i: usize| {
                    let apart =
                        [low_b[i] - high[i], low[i] - high_b[i]].into_iter().find(|&gap| gap > 0);
                    apart.unwrap_or(0) / UNITS_PER_CELL
                };
                assert_eq!(a.distance(b), gap(0).max(gap(1)).max(gap(2)), "{a}, {b}");
                let within = (0..3).all(|i| low[i] <= low_b[i] && high_b[i] <= high[i]);
                assert_eq!(a.contains(b), within, "{a}, {b}");
            }
            let (low, high) = a.bounds();
            assert_eq!(a.centre().map(|c| 2 * c), std::array::from_fn(|i| low[i] + high[i]));
            assert_eq!(a.to_string(), format!("octant {} (level {})", a.path(), a.level));
        }
        let finest = Octant { corner: [1, 2, 3], level: LEVEL_MAX };
        assert_eq!(finest.bounds(), ([256, 512, 768], [512, 768, 1024]));
        assert!(std::panic::catch_unwind(|| finest.child(0)).is_err());
        assert!(std::panic::catch_unwind(|| Octant::ROOT.child(8)).is_err());
        assert!(std::panic::catch_unwind(|| Octant::ROOT.ancestor(1)).is_err());
    }

    /// All triples of numbers of a range.
    fn triples(range: std::ops::RangeInclusive<i32>) -> Vec<[i32; 3]> {
        let mut all = Vec::new();
        for x in range.clone() {
            for y in range.clone() {
                all.extend(range.clone().map(|z| [x, y, z]));
            }
        }
        all
    }

    #[test]
    fn a_path_lists_the_digits_from_the_root() {
        let octant = Octant::ROOT.child(3).child(1).child(4);
        assert_eq!(octant.path(), "3.1.4");
        assert_eq!(Octant::ROOT.path(), "root");
        assert_eq!(octant.level, 3);
    }
}
