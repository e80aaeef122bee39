//! Components across ranks: names that all ranks agree on.
//!
//! What reaches into top bricks, of which all hold copies, is named by them. Each rank tells its
//! neighbours which octants of theirs its components face, and by what name; where names differ, they
//! are joined. Only such pairs travel to everybody.

use super::components::{self, Classes, Face};
use super::nodes::{Component, Nodes};
use crate::comm::{Comm, MessageBuffer};
use crate::octant::Level;
use crate::partition::ownership::{Ownership, Placement};
use crate::tree::{LEVELS, Tree};
use std::collections::HashMap;

/// A component's name, the same on all ranks.
pub type Name = u64;

/// Names for this rank's classes of joined components. Collective.
pub fn names(
    nodes: &Nodes,
    tree: &Tree,
    ownership: &Ownership,
    faces: Vec<Face>,
    classes: &Classes,
    comm: &dyn Comm,
) -> Vec<Name> {
    let own = |class: u32| (comm.rank() as u64 + 1) << 40 | u64::from(class);
    let mut names: Vec<Name> = (0..classes.count).map(own).collect();
    if comm.size() == 1 {
        return names;
    }
    let mut pairs = name_by_top(&mut names, nodes, tree, ownership, classes);
    pairs.extend(across_ranks(nodes, faces, classes, &names, comm));
    let mut joined = Joined::default();
    for &[a, b] in comm.all_gather(&summed_up(pairs, comm)).words().as_chunks().0 {
        joined.join(a, b);
    }
    names.iter().map(|&n| joined.find(n)).collect()
}

/// Pairs of names, few, that join what all ranks' pairs join. Neighbours see the same from both sides, and ranks that
/// follow each other are neighbours: so one for each group of ranks does their joining first. Collective.
fn summed_up(pairs: Vec<[Name; 2]>, comm: &dyn Comm) -> Vec<u64> {
    let mine: Vec<u64> = Joined::of(&pairs).pairs();
    let group = comm.size().isqrt();
    let first = comm.rank() / group * group;
    let heard = comm.sparse_all_to_all([(first, mine)].into_iter().collect());
    Joined::of(heard.words().as_chunks().0).pairs()
}

/// Gives the classes that a top brick has part of the name that they have for all ranks: the number of
/// a class of what is joined within the top. Returns the pairs of such names that are one class here.
///
/// Everyone holds the top, and joins it in the same way; so no word of it need travel.
fn name_by_top(
    names: &mut [Name],
    nodes: &Nodes,
    tree: &Tree,
    ownership: &Ownership,
    classes: &Classes,
) -> Vec<[Name; 2]> {
    let non_owning_view = ownership.non_owning_view();
    let top = Nodes::new(&ownership.top_of(tree), &non_owning_view);
    let of_top = components::join(&top, &non_owning_view).classes().of;
    let here = top_components(nodes);
    assert_eq!(here.len(), of_top.len(), "all ranks hold the same top bricks");
    let mut pairs = Vec::new();
    let mut named = vec![false; names.len()];
    for (c, top) in here.into_iter().zip(of_top) {
        let class = classes.of[c as usize] as usize;
        let (name, top) = (&mut names[class], Name::from(top));
        if !std::mem::replace(&mut named[class], true) {
            *name = top;
        } else if *name != top {
            pairs.push([*name, top]);
        }
    }
    pairs
}

/// Pairs of names that are joined over a face between this rank's bricks and another's. Collective.
fn across_ranks(
    nodes: &Nodes,
    mut faces: Vec<Face>,
    classes: &Classes,
    names: &[Name],
    comm: &dyn Comm,
) -> Vec<[Name; 2]> {
    let name = |c: Component| names[classes.of[c as usize] as usize];
    let place = |f: &Face| (f.rank, f.level, f.key, name(f.component));
    faces.sort_unstable_by_key(place);
    let mut out = MessageBuffer::default();
    for run in faces.chunk_by(|a, b| place(a) == place(b)) {
        let bits = run.iter().fold(0, |all, f| all | f.bits);
        let (rank, level, key, name) = place(&run[0]);
        out.write(rank, [u64::from(level), key, name, bits]);
    }
    drop(faces);
    let (mut pairs, mut finder) = (Vec::new(), nodes.finder());
    for &[level, key, theirs, bits] in comm.sparse_all_to_all(out).words().as_chunks().0 {
        finder.meet(level as Level, key, bits, |c| {
            let mine = name(c);
            // Most of what faces another rank is named by the top already.
            if theirs != mine && pairs.last() != Some(&[theirs, mine]) {
                pairs.push([theirs, mine]);
            }
        });
    }
    pairs
}

/// The components of top bricks, in an order that is the same on all ranks.
fn top_components(nodes: &Nodes) -> Vec<Component> {
    let mut out = Vec::new();
    for l in 0..LEVELS as Level {
        for n in nodes.shared(l).filter(|&n| nodes.place(l, n) == Placement::FullyReplicated) {
            out.extend(nodes.components(l, n).map(|c| c.0));
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
    fn of<'a>(pairs: impl IntoIterator<Item = &'a [Name; 2]>) -> Self {
        let mut joined = Self::default();
        pairs.into_iter().for_each(|&[a, b]| joined.join(a, b));
        joined
    }

    /// Each name that is joined to a lesser one, and the least.
    fn pairs(&self) -> Vec<u64> {
        let mut pairs: Vec<[Name; 2]> = self.up.keys().map(|&n| [n, self.find(n)]).collect();
        pairs.sort_unstable();
        pairs.into_flattened()
    }

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
    fn names_join_through_chains() {
        let mut j = Joined::default();
        for (a, b) in [(9, 8), (5, 6), (8, 6), (1, 2), (7, 9)] {
            j.join(a, b);
        }
        assert!([5, 6, 7, 8, 9].iter().all(|&n| j.find(n) == 5));
        assert_eq!((j.find(2), j.find(1), j.find(3)), (1, 1, 3));
    }
}
