//! Octants: cells of the oct-tree, by corner and level.
//!
//! Invariants: `level <= LEVEL_MAX`; every coordinate of `corner` is below `CELLS_PER_EDGE` and a
//! multiple of the octant's own edge. Coordinates are level-19 cells; one is `UNITS_PER_CELL` lattice
//! units wide.

use std::fmt;

/// Deepest level there is.
pub const LEVEL_MAX: u8 = 19;
/// Level-19 cells along an edge of the root.
pub const CELLS_PER_EDGE: u32 = 1 << LEVEL_MAX;
/// Lattice units along an edge of a level-19 cell.
pub const UNITS_PER_CELL: i64 = 256;

/// One cell of the oct-tree, leaf or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Octant {
    /// Minimum corner, in level-19 cells.
    pub corner: [u32; 3],
    /// How many times the root was halved to get here.
    pub level: u8,
}

impl Octant {
    /// The whole tree.
    pub const ROOT: Self = Self { corner: [0; 3], level: 0 };

    /// Edge length in level-19 cells.
    pub fn edge(&self) -> u32 {
        CELLS_PER_EDGE >> self.level
    }

    /// The child with this digit: bit 0 is x, bit 1 is y, bit 2 is z. Panics below level 19.
    pub fn child(&self, digit: u8) -> Self {
        assert!(self.level < LEVEL_MAX && digit < 8, "no child {digit} of {self:?}");
        let half = self.edge() / 2;
        let corner = std::array::from_fn(|a| self.corner[a] + half * u32::from(digit >> a & 1));
        Self { corner, level: self.level + 1 }
    }

    /// The ancestor at a level not deeper than this one's own.
    pub fn ancestor(&self, level: u8) -> Self {
        assert!(level <= self.level, "level {level} is below {self:?}");
        let mask = !((CELLS_PER_EDGE >> level) - 1);
        Self { corner: self.corner.map(|c| c & mask), level }
    }

    /// Which child of its parent an octant below the root is.
    pub fn digit(&self) -> u8 {
        (0..3).map(|a| u8::from(self.corner[a] & self.edge() != 0) << a).sum()
    }

    /// The octant of the same level `by` cells away, if it lies in the root.
    pub fn neighbour(&self, by: [i32; 3]) -> Option<Self> {
        let mut corner = [0; 3];
        for a in 0..3 {
            let at = i64::from(self.corner[a]) + i64::from(by[a]) * i64::from(self.edge());
            if !(0..i64::from(CELLS_PER_EDGE)).contains(&at) {
                return None;
            }
            corner[a] = at as u32;
        }
        Some(Self { corner, level: self.level })
    }

    /// Whether `other` is this octant or one of its descendants.
    pub fn contains(&self, other: &Self) -> bool {
        other.level >= self.level && other.ancestor(self.level) == *self
    }

    /// Minimum and maximum corner in lattice units.
    pub fn bounds(&self) -> ([i64; 3], [i64; 3]) {
        let low = self.corner.map(|c| i64::from(c) * UNITS_PER_CELL);
        let edge = i64::from(self.edge()) * UNITS_PER_CELL;
        (low, low.map(|c| c + edge))
    }

    /// The centre in lattice units: exact, a level-19 cell being 256 of them wide.
    pub fn centre(&self) -> [i64; 3] {
        let (low, high) = self.bounds();
        std::array::from_fn(|a| (low[a] + high[a]) / 2)
    }

    /// Child digits from the root, as in `3.1.4`; the root itself is `root`.
    pub fn path(&self) -> String {
        if self.level == 0 {
            return "root".to_owned();
        }
        let digits = (1..=self.level).map(|l| self.ancestor(l).digit().to_string());
        digits.collect::<Vec<_>>().join(".")
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

    /// Every octant down to `level`, coarse ones first.
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
    fn children_know_their_digit_and_tile_their_parent() {
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

    /// Exhaustive to level 3: a neighbour is what one finds by comparing bounds of all octants.
    #[test]
    fn neighbours_are_where_bounds_say() {
        let all = all_down_to(3);
        for octant in &all {
            let (low, high) = octant.bounds();
            for by in itertools(-1..=1) {
                let edge = high[0] - low[0];
                let want: [i64; 3] = std::array::from_fn(|a| low[a] + i64::from(by[a]) * edge);
                let found = all.iter().find(|o| o.level == octant.level && o.bounds().0 == want);
                assert_eq!(octant.neighbour(by), found.copied());
            }
        }
    }

    /// All triples over a range.
    fn itertools(range: std::ops::RangeInclusive<i32>) -> Vec<[i32; 3]> {
        let mut all = Vec::new();
        for x in range.clone() {
            for y in range.clone() {
                all.extend(range.clone().map(|z| [x, y, z]));
            }
        }
        all
    }

    #[test]
    fn a_path_spells_the_digits() {
        let octant = Octant::ROOT.child(3).child(1).child(4);
        assert_eq!(octant.path(), "3.1.4");
        assert_eq!(Octant::ROOT.path(), "root");
        assert_eq!(octant.level, 3);
    }
}
