//! Components of T0's leaves over faces, and the side that rays give each
//! (reference/DEFINITION.md, section 4).

use contract::octant::Octant;
use contract::parity::Parity;
use contract::word::{self, Side};

/// Candidates put to the rays before the majority decides.
const CANDIDATES_MAX: usize = 32;

/// Leaves that are joined over faces without passing a crossing one.
#[derive(Clone, Debug)]
pub struct Component {
    /// Indices of its leaves, coarsest first, then by key.
    pub leaves: Vec<u32>,
    /// What rays find it to be.
    pub side: Side,
    /// Whether no candidate's rays agreed.
    pub ambiguous: bool,
    /// The first candidate.
    pub first: Octant,
}

/// Finds and decides all components of sorted leaves that tile the root.
pub fn find(words: &[u64], parity: &Parity) -> Vec<Component> {
    let mut sets = Sets::new(words.len());
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| !crossing(**w)) {
        for j in coarse_neighbours(words, &word::octant(w)).filter(|&j| !crossing(words[j])) {
            sets.join(i as u32, j as u32);
        }
    }
    let mut members: Vec<(u32, u8, u32)> = Vec::new();
    for (i, &w) in words.iter().enumerate().filter(|(_, w)| !crossing(**w)) {
        members.push((sets.root(i as u32), word::level(w), i as u32));
    }
    members.sort_unstable();
    let of_one = members.chunk_by(|a, b| a.0 == b.0);
    of_one.map(|m| decide(m.iter().map(|&(_, _, i)| i).collect(), words, parity)).collect()
}

fn crossing(word: u64) -> bool {
    word & 3 == Side::Crossing as u64
}

/// Leaves across a face that are at least as coarse; the finer ones find this leaf themselves.
fn coarse_neighbours(words: &[u64], octant: &Octant) -> impl Iterator<Item = usize> {
    let across = (0..6).filter_map(|face| {
        let mut by = [0; 3];
        by[face / 2] = if face % 2 == 0 { -1 } else { 1 };
        octant.neighbour(by)
    });
    across.filter_map(|neighbour| {
        let key = word::key_of(neighbour.corner);
        let i = words.partition_point(|&w| word::key(w) <= key).checked_sub(1)?;
        let level = word::level(words[i]);
        (level <= neighbour.level && key < word::key(words[i]) + word::span(level)).then_some(i)
    })
}

/// The first candidate whose rays agree decides; failing that the majority of all their rays.
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

/// Disjoint sets, the smallest index of each being its root.
struct Sets(Vec<u32>);

impl Sets {
    fn new(len: usize) -> Self {
        Self((0..u32::try_from(len).expect("fewer than 2^32 leaves")).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let above = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = above;
            i = above;
        }
        i
    }

    fn join(&mut self, i: u32, j: u32) {
        let (a, b) = (self.root(i), self.root(j));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
