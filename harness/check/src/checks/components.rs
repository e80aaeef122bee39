//! The components of T0's leaves, and their sides (reference/DEFINITION.md, section 4).

use contract::octant::Octant;
use contract::parity::Parity;
use contract::word::{self, Side};

/// Number of candidates whose rays are computed before the majority decides.
const CANDIDATES_MAX: usize = 32;

/// Leaves that are connected through faces without a crossing leaf in between.
#[derive(Clone, Debug)]
pub struct Component {
    /// Indices of its leaves, by level and then by key.
    pub leaves: Vec<u32>,
    /// The side that rays determine.
    pub side: Side,
    /// Whether the rays of no candidate agreed.
    pub ambiguous: bool,
    /// The first candidate.
    pub first: Octant,
}

/// The components of sorted leaves that tile the root, with their sides.
pub fn find(words: &[u64], parity: &Parity) -> Vec<Component> {
    let mut sets = Sets::new(words.len());
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| !crossing(**w)) {
        for j in coarse_neighbours(words, &word::octant(w)).filter(|&j| !crossing(words[j])) {
            sets.union(i as u32, j as u32);
        }
    }
    let mut members: Vec<(u32, u8, u32)> = Vec::new();
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| !crossing(**w)) {
        members.push((sets.root(i as u32), word::level(w), i as u32));
    }
    members.sort_unstable();
    let components = members.chunk_by(|a, b| a.0 == b.0);
    components.map(|m| decide(m.iter().map(|&(_, _, i)| i).collect(), words, parity)).collect()
}

fn crossing(word: u64) -> bool {
    word & 3 == Side::Crossing as u64
}

/// The leaves across a face that are at least as coarse. Finer neighbours find this leaf themselves.
fn coarse_neighbours(words: &[u64], octant: &Octant) -> impl Iterator<Item = usize> {
    let across = (0..6).filter_map(|face| {
        let mut offset = [0; 3];
        offset[face / 2] = if face % 2 == 0 { -1 } else { 1 };
        octant.neighbour(offset)
    });
    across.filter_map(|neighbour| {
        let key = word::key_of(neighbour.corner);
        let i = words.partition_point(|&w| word::key(w) <= key).checked_sub(1)?;
        let level = word::level(words[i]);
        (level <= neighbour.level && key < word::key(words[i]) + word::span(level)).then_some(i)
    })
}

/// The first candidate whose rays agree decides. Without one, the majority of all rays decides.
fn decide(leaves: Vec<u32>, words: &[u64], parity: &Parity) -> Component {
    let first = word::octant(words[leaves[0] as usize]);
    let (mut rays, mut inside) = (0, 0);
    for &i in leaves.iter().take(CANDIDATES_MAX) {
        let votes = parity.inside(word::octant(words[i as usize]).centre());
        let odd = votes.iter().filter(|&&v| v).count();
        if odd == 0 || odd == 6 {
            let side = if odd == 6 { Side::Inside } else { Side::Outside };
            return Component { leaves, side, ambiguous: false, first };
        }
        rays += 6;
        inside += odd;
    }
    let side = if 2 * inside > rays { Side::Inside } else { Side::Outside };
    Component { leaves, side, ambiguous: true, first }
}

/// Disjoint sets. The root of each is its smallest index.
struct Sets(Vec<u32>);

impl Sets {
    fn new(len: usize) -> Self {
        Self((0..u32::try_from(len).expect("fewer than 2^32 leaves")).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let grandparent = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = grandparent;
            i = grandparent;
        }
        i
    }

    fn union(&mut self, i: u32, j: u32) {
        let (a, b) = (self.root(i), self.root(j));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
