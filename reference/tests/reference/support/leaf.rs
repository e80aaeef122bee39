//! Leaves decoded from their words, with a second implementation of their geometry.
use super::random::RandomCase;
use super::{ROOT_EDGE, crosses_by_axes, spacing};
use reference::Case;

#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    /// Minimum corner and edge, in lattice units.
    pub min: [i64; 3],
    pub edge: i64,
    pub level: u32,
    pub side: u64,
    /// The Morton keys of the level-19 cells in the leaf.
    pub keys: (u64, u64),
}

impl Leaf {
    pub fn of(word: u64) -> Self {
        let (key, level) = (word >> 7, (word >> 2 & 31) as u32);
        let mut min = [0; 3];
        for bit in 0..57 {
            min[bit % 3] |= ((key >> bit & 1) << (bit / 3)) as i64 * 256;
        }
        let keys = (key, key + (1 << (3 * (19 - level))));
        Self { min, edge: ROOT_EDGE >> level, level, side: word & 3, keys }
    }

    pub fn parent(&self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        let edge = 2 * self.edge;
        Some(Self { min: self.min.map(|x| x / edge * edge), edge, level, ..*self })
    }

    pub fn max(&self) -> [i64; 3] {
        self.min.map(|x| x + self.edge)
    }

    /// Whether the half-open cube contains a lattice point.
    pub fn has(&self, point: [i64; 3]) -> bool {
        (0..3).all(|a| (self.min[a]..self.max()[a]).contains(&point[a]))
    }

    pub fn contains(&self, other: &Leaf) -> bool {
        self.keys.0 <= other.keys.0 && other.keys.1 <= self.keys.1
    }

    /// Chebyshev distance of the closed cubes, in lattice units; 0 if they touch.
    pub fn distance(&self, other: &Leaf) -> i64 {
        let gap = |a: usize| (self.min[a] - other.max()[a]).max(other.min[a] - self.max()[a]);
        (0..3).map(gap).fold(0, i64::max)
    }

    pub fn is_crossed(&self, random: &RandomCase) -> bool {
        random.facets.iter().any(|facet| crosses_by_axes(facet, self.min, self.max()))
    }

    /// The greatest level of a box that the octant meets.
    pub fn level_of_boxes(&self, case: &Case) -> u32 {
        let meets = |min: [f64; 3], max: [f64; 3]| {
            (0..3).all(|a| (self.min[a] as f64) < max[a] && min[a] < self.max()[a] as f64)
        };
        let met = case.boxes.iter().filter(|b| meets(b.min, b.max));
        let level = |b: &reference::BoxSpec| (0..=19).find(|&l| spacing(l) <= b.spacing).unwrap();
        met.map(level).max().unwrap_or(0)
    }
}

/// The leaves with these words.
pub fn leaves(words: &[u64]) -> Vec<Leaf> {
    words.iter().copied().map(Leaf::of).collect()
}
