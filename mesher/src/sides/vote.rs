//! The vote: six rays from a component's leaves, until one leaf's agree.

use super::Ambiguous;
use super::global::Name;
use super::nodes::Nodes;
use super::rays::parities;
use crate::brick::Brick;
use crate::brickset::ones;
use crate::comm::Comm;
use crate::facet::Facet;
use crate::octant::{Level, corner, edge};
use crate::share::Ownership;
use crate::tree::{LEVELS, Tree};
use std::collections::{BTreeMap, HashSet};

/// Most leaves of a component that are tried before the majority decides.
pub const CANDIDATES: usize = 32;

/// A leaf as one number that sorts by level, then by Morton code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Candidate(u64);

impl Candidate {
    fn new(l: Level, code: u64) -> Self {
        Self(u64::from(l) << 57 | code)
    }

    /// The leaf's centroid, a lattice point.
    pub fn centroid(self) -> [i64; 3] {
        let l = (self.0 >> 57) as Level;
        corner(l, self.0 & ((1 << 57) - 1)).map(|c| c + edge(l) / 2)
    }
}

/// For each component of the whole tree its first leaves. Collective; the same on all ranks.
pub fn candidates(
    nodes: &Nodes,
    tree: &Tree,
    class: &[u32],
    names: &[Name],
    share: &Ownership,
    comm: &dyn Comm,
) -> BTreeMap<Name, Vec<Candidate>> {
    let mut first: Vec<Vec<Candidate>> = vec![Vec::new(); names.len()];
    let mut here: Vec<(u32, u64)> = Vec::new();
    for l in 0..LEVELS as Level {
        for (n, Brick { key, .. }) in (0..).zip(Tree::exists(&tree.split, l)) {
            if !share.answers_for(l, key) {
                continue;
            }
            // Components that meet elsewhere are one: their leaves come in one order.
            here.clear();
            for (c, bits) in nodes.components(l, n) {
                let class = class[c as usize];
                match here.iter_mut().find(|(other, _)| *other == class) {
                    Some((_, all)) => *all |= bits,
                    None => here.push((class, bits)),
                }
            }
            for &(class, bits) in &here {
                let list = &mut first[class as usize];
                let room = CANDIDATES - list.len();
                list.extend(
                    ones(bits).take(room).map(|bit| Candidate::new(l, key << 6 | u64::from(bit))),
                );
            }
        }
    }
    let flat: Vec<u64> = names
        .iter()
        .zip(&first)
        .flat_map(|(&n, list)| list.iter().flat_map(move |c| [n, c.0]))
        .collect();
    drop(first);
    let mut all: BTreeMap<Name, Vec<Candidate>> = BTreeMap::new();
    for words in comm.all_gather(&flat).iter() {
        words.chunks_exact(2).for_each(|w| all.entry(w[0]).or_default().push(Candidate(w[1])));
    }
    for list in all.values_mut() {
        list.sort_unstable();
        list.truncate(CANDIDATES);
    }
    all
}

/// What the vote came to.
pub struct Verdict {
    /// The components that are inside.
    pub inside: HashSet<Name>,
    /// Those decided by majority.
    pub ambiguous: Option<Ambiguous>,
    /// Rays cast.
    pub rays: u64,
}

/// Casts the rays, each rank against its share of the facets. Collective; the same on all ranks.
pub fn decide(
    candidates: &BTreeMap<Name, Vec<Candidate>>,
    facets: &[Facet],
    comm: &dyn Comm,
) -> Verdict {
    let mut verdict = Verdict { inside: HashSet::new(), ambiguous: None, rays: 0 };
    // Components still open, with the number of their rays so far that say inside.
    let mut open: Vec<(Name, &[Candidate], u32)> =
        candidates.iter().map(|(&n, list)| (n, list.as_slice(), 0)).collect();
    for round in 0..CANDIDATES {
        let points: Vec<[i64; 3]> =
            open.iter().filter_map(|c| c.1.get(round)).map(|c| c.centroid()).collect();
        if points.is_empty() {
            break;
        }
        verdict.rays += 6 * points.len() as u64;
        let mut odd = xor_over_ranks(parities(facets, &points), comm).into_iter();
        open.retain_mut(|(name, list, votes)| {
            let Some(rays) = (round < list.len()).then(|| odd.next()).flatten() else {
                return true;
            };
            if rays == 63 {
                verdict.inside.insert(*name);
            }
            *votes += rays.count_ones();
            rays != 0 && rays != 63
        });
    }
    let first = open.iter().map(|c| c.1[0]).min();
    verdict.ambiguous =
        first.map(|c| Ambiguous { count: open.len() as u64, example: c.centroid() });
    verdict.inside.extend(
        open.iter().filter(|(_, list, votes)| *votes as usize > 3 * list.len()).map(|c| c.0),
    );
    verdict
}

/// Parities over all facets from those over each rank's. Collective.
fn xor_over_ranks(mine: Vec<u8>, comm: &dyn Comm) -> Vec<u8> {
    let pack = |bytes: &[u8]| bytes.iter().rev().fold(0u64, |w, &b| w << 8 | u64::from(b));
    let words: Vec<u64> = mine.chunks(8).map(pack).collect();
    let mut total = vec![0u64; words.len()];
    for theirs in comm.all_gather(&words).iter() {
        total.iter_mut().zip(theirs).for_each(|(t, w)| *t ^= w);
    }
    (0..mine.len()).map(|i| (total[i / 8] >> (8 * (i % 8))) as u8).collect()
}
