//! The 48 symmetries of the root cube, of points and of leaf words.

use super::{Facet, Small};
use bricks::octant::{LEVEL_MAX, morton, position};

/// A permutation of the axes, then mirror images.
#[derive(Clone, Copy, Debug)]
pub struct Symmetry {
    /// The image of each axis.
    to: [usize; 3],
    /// Whether the coordinate along each original axis is mirrored.
    mirrored: [bool; 3],
}

impl Symmetry {
    /// All 48 symmetries; the first is the identity.
    pub fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] =
            [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        ORDERS.into_iter().flat_map(|to| {
            (0..8).map(move |m| Self { to, mirrored: [0, 1, 2].map(|a| m >> a & 1 == 1) })
        })
    }

    /// The image of a point in the cube from 0 to `extent`.
    fn apply<T: Copy + std::ops::Sub<Output = T>>(&self, p: [T; 3], extent: T) -> [T; 3] {
        let mut q = p;
        for a in 0..3 {
            q[self.to[a]] = if self.mirrored[a] { extent - p[a] } else { p[a] };
        }
        q
    }

    /// The image of a case whose root extends from 0 to 64.
    pub fn case(&self, case: &Small) -> Small {
        let turn = |f: &Facet| f.map(|v| self.apply(v, 64.0));
        let mut image = case.with(case.facets.iter().map(turn).collect());
        for b in &mut image.boxes {
            let (p, q) = (self.apply(b.min, 64.0), self.apply(b.max, 64.0));
            b.min = std::array::from_fn(|a| p[a].min(q[a]));
            b.max = std::array::from_fn(|a| p[a].max(q[a]));
        }
        image
    }

    /// The images of leaf words, sorted.
    pub fn words(&self, words: &[u64]) -> Vec<u64> {
        let mut images: Vec<u64> = words.iter().map(|&w| self.word(w)).collect();
        images.sort_unstable();
        images
    }

    fn word(&self, w: u64) -> u64 {
        let level = (w >> 2 & 31) as u32;
        let below = 3 * (LEVEL_MAX - level);
        let p = position(w >> 7 >> below);
        morton(self.apply(p, (1 << level) - 1)) << below << 7 | w & 127
    }
}
