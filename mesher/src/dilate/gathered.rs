//! What overlapping tiles give, gathered and sorted.

use crate::brick;
use crate::brickset::BrickSet;
use crate::octant::{Level, morton};
use std::collections::HashMap;

/// Bricks that results are gathered in together, as a power of two: 2 x 2 x 2, of which a layer fills most.
const BLOCK_LOG2: u32 = 3;
/// The same as a number.
const BLOCK: usize = 1 << BLOCK_LOG2;

/// Bricks gathered from overlapping tiles, block by block.
pub struct Gathered {
    /// Bricks along the root's edge.
    extent: i64,
    /// Bits that exist at this level.
    valid: u64,
    blocks: HashMap<u64, u32, Spread>,
    words: Vec<[u64; BLOCK]>,
    last: Option<(u64, u32)>,
}

impl Gathered {
    /// Nothing yet, of level `l`.
    pub fn new(l: Level) -> Self {
        Self {
            extent: if l < 2 { 1 } else { 1 << (l - 2) },
            valid: brick::valid(l),
            blocks: HashMap::default(),
            words: Vec::new(),
            last: None,
        }
    }

    /// Ors bits into the brick at a position; outside the root they are dropped.
    pub fn add(&mut self, p: [i64; 3], bits: u64) {
        if p.iter().any(|c| !(0..self.extent).contains(c)) {
            return;
        }
        let key = morton(p.map(|c| c as u32));
        let block = match self.last {
            Some((k, i)) if k == key >> BLOCK_LOG2 => i,
            _ => *self.blocks.entry(key >> BLOCK_LOG2).or_insert_with(|| {
                self.words.push([0; BLOCK]);
                (self.words.len() - 1) as u32
            }),
        };
        self.last = Some((key >> BLOCK_LOG2, block));
        self.words[block as usize][(key & (BLOCK as u64 - 1)) as usize] |= bits & self.valid;
    }

    /// All that was gathered.
    pub fn into_set(self) -> BrickSet {
        let mut order: Vec<(u64, u32)> = self.blocks.into_iter().collect();
        order.sort_unstable();
        let mut set = BrickSet::default();
        for (block, i) in order {
            for (k, &bits) in (0..).zip(&self.words[i as usize]) {
                set.push(block << BLOCK_LOG2 | k, bits);
            }
        }
        set
    }
}

/// Hashing of Morton codes: a multiplication spreads them well enough.
#[derive(Clone, Copy, Default)]
struct Spread(u64);

impl std::hash::BuildHasher for Spread {
    type Hasher = Self;
    fn build_hasher(&self) -> Self {
        Self(0)
    }
}

impl std::hash::Hasher for Spread {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b));
        }
    }
    fn write_u64(&mut self, v: u64) {
        self.0 = (self.0 ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(26);
    }
}
