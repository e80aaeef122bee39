//! The vote: six rays from a component's leaves, until one leaf's agree.

use super::Ambiguous;
use super::global::Name;
use super::nodes::Nodes;
use super::rays::parities;
use crate::brick::Brick;
use crate::brickset::ones;
use crate::comm::{Comm, all_gather_reduced};
use crate::facet::Facet;
use crate::octant::{Level, corner, edge};
use crate::partition::ownership::Ownership;
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

/// The first leaves of the components that this rank has part of, as far as it answers for them.
pub fn candidates(
    nodes: &Nodes,
    tree: &Tree,
    class: &[u32],
    names: &[Name],
    ownership: &Ownership,
) -> Firsts {
    let mut first: Vec<Vec<Candidate>> = vec![Vec::new(); names.len()];
    let mut here: Vec<(u32, u64)> = Vec::new();
    for l in 0..LEVELS as Level {
        for (n, Brick { key, .. }) in (0..).zip(Tree::exists(&tree.split, l)) {
            if !ownership.owns(l, key) {
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
    merged(names.iter().copied().zip(first).filter(|(_, list)| !list.is_empty()))
}

/// Components' first leaves, in order.
pub type Firsts = BTreeMap<Name, Vec<Candidate>>;

/// The first of several lists for each name.
fn merged(lists: impl Iterator<Item = (Name, Vec<Candidate>)>) -> Firsts {
    let mut all = Firsts::new();
    lists.for_each(|(name, list)| all.entry(name).or_default().extend(list));
    for list in all.values_mut() {
        list.sort_unstable();
        list.truncate(CANDIDATES);
    }
    all
}

/// What the vote came to.
#[derive(Default)]
pub struct Verdict {
    /// The components that are inside.
    pub inside: HashSet<Name>,
    /// Those decided by majority.
    pub ambiguous: Option<Ambiguous>,
    /// All components of the tree.
    pub components: u64,
    /// Rays cast.
    pub rays: u64,
}

/// A component that is not decided yet.
struct Open {
    name: Name,
    /// Its rays so far that say inside.
    votes: u32,
}

/// Casts the rays, each rank against its share of the facets; `mine` are this rank's [`candidates`]. Collective;
/// the same on all ranks.
pub fn decide(mine: &Firsts, facets: &[Facet], comm: &dyn Comm) -> Verdict {
    let mut verdict = Verdict::default();
    // Nearly always the very first leaf's rays agree: only that is told of every component.
    let firsts = mine.iter().map(|(&name, list)| [name, list[0].0]).collect();
    let firsts = all_gather_reduced(firsts, u64::min, comm);
    verdict.components = firsts.len() as u64;
    let ask = |asked: Vec<(Open, Candidate)>, verdict: &mut Verdict| -> Vec<Open> {
        let points: Vec<[i64; 3]> = asked.iter().map(|(_, c)| c.centroid()).collect();
        verdict.rays += 6 * points.len() as u64;
        let odd = xor_over_ranks(parities(facets, &points), comm);
        let told = asked.into_iter().zip(odd).filter_map(|((open, _), rays)| {
            if rays == 63 {
                verdict.inside.insert(open.name);
            }
            let votes = open.votes + rays.count_ones();
            (rays != 0 && rays != 63).then_some(Open { votes, ..open })
        });
        told.collect()
    };
    let asked = firsts.iter().map(|e| (Open { name: e[0], votes: 0 }, Candidate(e[1])));
    let mut open = ask(asked.collect(), &mut verdict);
    if open.is_empty() {
        return verdict;
    }
    let lists = all_of(mine, &open, comm);
    // Those that have no more leaves to be asked.
    let mut exhausted = Vec::new();
    for round in 1..CANDIDATES {
        let (next, done) = open.into_iter().partition(|c: &Open| lists[&c.name].len() > round);
        open = next;
        exhausted.extend::<Vec<Open>>(done);
        if open.is_empty() {
            break;
        }
        let asked = open.into_iter().map(|c| {
            let candidate = lists[&c.name][round];
            (c, candidate)
        });
        open = ask(asked.collect(), &mut verdict);
    }
    exhausted.extend(open);
    let list = |c: &Open| &lists[&c.name];
    let first = exhausted.iter().map(|c| list(c)[0]).min();
    verdict.ambiguous =
        first.map(|c| Ambiguous { count: exhausted.len() as u64, example: c.centroid() });
    verdict
        .inside
        .extend(exhausted.iter().filter(|c| c.votes as usize > 3 * list(c).len()).map(|c| c.name));
    verdict
}

/// The candidates of some components, from all ranks. Collective; the same on all ranks.
fn all_of(mine: &Firsts, open: &[Open], comm: &dyn Comm) -> Firsts {
    let told = open.iter().filter_map(|c| Some((c.name, mine.get(&c.name)?)));
    let flat: Vec<u64> =
        told.flat_map(|(name, list)| list.iter().flat_map(move |c| [name, c.0])).collect();
    let all = comm.all_gather(&flat);
    let pairs = all.words().as_chunks().0.iter();
    merged(pairs.map(|&[name, candidate]| (name, vec![Candidate(candidate)])))
}

/// Parities over all facets from those over each rank's. Collective.
fn xor_over_ranks(mine: Vec<u8>, comm: &dyn Comm) -> Vec<u8> {
    let pack = |bytes: &[u8]| bytes.iter().rev().fold(0u64, |w, &b| w << 8 | u64::from(b));
    let words: Vec<u64> = mine.chunks(8).map(pack).collect();
    let mut total = vec![0u64; words.len()];
    for (_, theirs) in comm.all_gather(&words).messages() {
        total.iter_mut().zip(theirs).for_each(|(t, w)| *t ^= w);
    }
    (0..mine.len()).map(|i| (total[i / 8] >> (8 * (i % 8))) as u8).collect()
}
