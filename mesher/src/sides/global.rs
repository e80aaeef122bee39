//! Components across ranks: names that all ranks agree on.
//!
//! Each rank tells its neighbours which octants of theirs its components face, so that the same
//! component gets the same name everywhere; top bricks, of which all hold copies, tie the rest together. Only
//! pairs of names travel.

use super::components::Face;
use super::nodes::Nodes;
use crate::comm::Comm;
use crate::octant::Level;
use crate::share::Place;
use crate::tree::LEVELS;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// A component's name, the same on all ranks.
pub type Name = u64;

/// Names for this rank's classes of joined components. Collective.
pub fn names(
    nodes: &Nodes,
    faces: Vec<Face>,
    class: &[u32],
    classes: usize,
    comm: &dyn Comm,
) -> Vec<Name> {
    let own = |class: u32| (comm.rank() as u64 + 1) << 40 | u64::from(class);
    if comm.size() == 1 {
        return (0..classes as u32).map(own).collect();
    }
    let pairs = across_ranks(nodes, faces, class, &own, comm);
    let tops: Vec<Name> = top_components(nodes).iter().map(|&c| own(class[c as usize])).collect();
    let mut words = vec![pairs.len() as u64];
    words.extend(pairs.into_iter().flat_map(|(a, b)| [a, b]));
    words.extend(runs(&tops));
    let joined = join_all(&comm.all_gather(&words), tops.len());
    (0..classes as u32).map(|c| joined.find(own(c))).collect()
}

/// Where equal names of top components follow each other: first, number and name of each such run. All
/// ranks have the same top components in the same order, so runs say it shorter than pairs, by far.
fn runs(tops: &[Name]) -> Vec<u64> {
    let mut first = 0;
    let of = |run: &[Name]| {
        first += run.len() as u64;
        [first - run.len() as u64, run.len() as u64, run[0]]
    };
    tops.chunk_by(|a, b| a == b).flat_map(of).collect()
}

/// Joins what all ranks tell: a number of pairs, the pairs, and the runs of top components.
fn join_all(told: &[Vec<u64>], tops: usize) -> Joined {
    let parts = || told.iter().map(|w| w[1..].split_at(2 * w[0] as usize));
    // A top component is one with its predecessor if any rank says so; what is one is joined to others once.
    let mut follows = vec![false; tops];
    for run in parts().flat_map(|(_, runs)| runs.chunks_exact(3)) {
        follows[run[0] as usize + 1..(run[0] + run[1]) as usize].fill(true);
    }
    let mut first = 0;
    let firsts: Vec<Name> = (0..)
        .zip(follows)
        .map(|(top, follows)| {
            first = if follows { first } else { top };
            first
        })
        .collect();
    let mut joined = Joined::default();
    for (pairs, runs) in parts() {
        pairs.chunks_exact(2).for_each(|p| joined.join(p[0], p[1]));
        runs.chunks_exact(3).for_each(|run| joined.join(firsts[run[0] as usize], run[2]));
    }
    joined
}

/// Pairs of names that are joined over a face between this rank's bricks and another's. Collective.
fn across_ranks(
    nodes: &Nodes,
    faces: Vec<Face>,
    class: &[u32],
    own: &impl Fn(u32) -> Name,
    comm: &dyn Comm,
) -> BTreeSet<(Name, Name)> {
    let mut merged: BTreeMap<(usize, Level, u64, Name), u64> = BTreeMap::new();
    for f in faces {
        *merged.entry((f.rank, f.level, f.key, own(class[f.component as usize]))).or_default() |=
            f.bits;
    }
    let mut out: Vec<Vec<u64>> = vec![Vec::new(); comm.size()];
    for ((rank, level, key, name), bits) in merged {
        out[rank].extend([u64::from(level), key, name, bits]);
    }
    let mut pairs = BTreeSet::new();
    let mut found = Vec::new();
    for (_, words) in comm.exchange(out.into_iter().enumerate().collect()) {
        for w in words.chunks_exact(4) {
            found.clear();
            nodes.meet(w[0] as Level, w[1], w[3], &mut found);
            pairs.extend(found.iter().map(|&c| (w[2], own(class[c as usize]))));
        }
    }
    pairs
}

/// The components of top bricks, in an order that is the same on all ranks.
fn top_components(nodes: &Nodes) -> Vec<u32> {
    let mut out = Vec::new();
    for l in 0..LEVELS as Level {
        for n in 0..nodes.len(l) {
            if nodes.place(l, n) == Place::Top {
                out.extend(nodes.components(l, n).map(|c| c.0));
            }
        }
    }
    out
}

/// A union-find over names, in which the least name stands for its class.
#[derive(Default)]
struct Joined {
    up: HashMap<Name, Name>,
}

impl Joined {
    fn find(&self, mut n: Name) -> Name {
        while let Some(&up) = self.up.get(&n) {
            n = up;
        }
        n
    }

    fn join(&mut self, a: Name, b: Name) {
        let (ra, rb) = (self.find(a), self.find(b));
        let root = ra.min(rb);
        // Both ways are shortened, so that ways stay short.
        for mut n in [a, b] {
            while n != root {
                match self.up.insert(n, root) {
                    Some(up) => n = up,
                    None => break,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn top_components_join_what_any_rank_joins() {
        // Five top components; one rank has 0 = 1 and 3 = 4, the other 1 = 2 and 0 = 4.
        let words = |pairs: &[u64], tops: &[Name]| {
            let mut words = vec![pairs.len() as u64 / 2];
            words.extend(pairs);
            words.extend(runs(tops));
            words
        };
        let one = words(&[101, 202], &[100, 100, 103, 104, 104]);
        let two = words(&[], &[200, 201, 201, 203, 200]);
        assert_eq!(one.len(), 1 + 2 + 3 * 3);
        let j = join_all(&[one, two], 5);
        assert!([100, 104, 200, 201, 203].iter().all(|&n| j.find(n) == j.find(103)));
        assert_eq!(j.find(101), j.find(202));
        assert_ne!(j.find(101), j.find(100));
    }

    #[test]
    fn names_join_through_chains() {
        let mut j = Joined::default();
        for (a, b) in [(9, 8), (5, 6), (8, 6), (1, 2), (7, 9)] {
            j.join(a, b);
        }
        assert!([5, 6, 7, 8, 9].iter().all(|&n| j.find(n) == 5));
        assert_eq!((j.find(2), j.find(1), j.find(3)), (1, 1, 3));
    }
}
