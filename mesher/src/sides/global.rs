//! Components of the whole tree: labels that all ranks agree on.
//!
//! Components in fully replicated bricks are labelled by these bricks, which all ranks merge alike and
//! without messages. Then each rank sends its neighbours the octants of theirs that its components face,
//! with the components' labels. Where labels differ across a face, the pair is an edge of a graph; only
//! a spanning forest of each group of ranks' edges goes to all ranks.

use super::Base;
use super::components::{self, FacedOctants};
use super::masks::Component;
use super::nodes::{Nodes, UnionFind};
use bricks::octant::Level;
use ranks::{Comm, MessageBuffer, gather};
use rustc_hash::FxHashMap;

/// Label of a component of the tree, the same on all ranks.
pub type Label = u64;

/// Pairs of labels of one component.
type Pairs = Vec<[Label; 2]>;

/// Labels of this rank's merged components: equal labels mean one component of the whole tree. Collective.
pub fn labels(base: &Base, nodes: &Nodes, faces: Vec<FacedOctants>, merged: &[u32]) -> Vec<Label> {
    let comm = base.comm;
    let own = |component: u32| (comm.rank() as u64 + 1) << 40 | u64::from(component);
    let count = merged.iter().max().map_or(0, |last| last + 1);
    let mut labels: Vec<Label> = (0..count).map(own).collect();
    if comm.size() == 1 {
        return labels;
    }
    let mut pairs = label_replicated(&mut labels, base, nodes, merged);
    pairs.extend(across_ranks(nodes, faces, merged, &labels, comm));
    let least = least(&gather(comm, &group_forest(pairs, comm)));
    labels.iter().map(|label| *least.get(label).unwrap_or(label)).collect()
}

/// A spanning forest of the pairs of all ranks in a group, on the group's first rank, and none on the others.
/// Both sides of a face yield the same pair, and consecutive ranks are often neighbours; so a group's
/// forest is much smaller than all its pairs. Collective.
fn group_forest(pairs: Pairs, comm: &dyn Comm) -> Pairs {
    let group = comm.size().isqrt();
    let mut messages = MessageBuffer::default();
    messages.write_values(comm.rank() / group * group, &forest(&pairs));
    let received: Vec<_> = comm.sparse_all_to_all(messages).values();
    forest(&received)
}

/// Labels the merged components that have a part in a fully replicated brick by the number of this part's
/// merged component within the fully replicated bricks alone. All ranks hold these bricks and merge them
/// alike, so the labels need no message. Returns the pairs of such labels that belong to one merged
/// component of this rank.
fn label_replicated(labels: &mut [Label], base: &Base, nodes: &Nodes, merged: &[u32]) -> Pairs {
    let non_owning_view = base.ownership.non_owning_view();
    let tree = base.ownership.fully_replicated(base.tree);
    let (replicated, sets) = Nodes::new(&tree, &non_owning_view);
    let of_replicated = components::merge(&replicated, sets, &non_owning_view).merged.numbered();
    let mine: Vec<_> = nodes.replicated(base.tree).collect();
    let all: Vec<_> = replicated.replicated(&tree).collect();
    assert_eq!(mine.len(), all.len(), "all ranks hold the same fully replicated bricks");
    let (mut pairs, mut labelled) = (Vec::new(), vec![false; labels.len()]);
    for (mine, all) in mine.into_iter().zip(all) {
        replicated.masks.brick(all, |replicated, part| {
            // It is part of one component, as this rank holds more bricks.
            let mut whole = None;
            nodes.masks.among(mine, part, |c| whole = Some(c));
            let whole: Component = whole.expect("both have the leaves of the brick");
            let component = merged[whole as usize] as usize;
            let label = &mut labels[component];
            let replicated = Label::from(of_replicated[replicated as usize]);
            if !std::mem::replace(&mut labelled[component], true) {
                *label = replicated;
            } else if *label != replicated {
                pairs.push([*label, replicated]);
            }
        });
    }
    pairs
}

/// Pairs of labels of components that share a face between this rank's bricks and another's. Collective.
fn across_ranks(
    nodes: &Nodes,
    faces: Vec<FacedOctants>,
    merged: &[u32],
    labels: &[Label],
    comm: &dyn Comm,
) -> Pairs {
    let label = |c: Component| labels[merged[c as usize] as usize];
    let labelled = |f: FacedOctants| ((f.rank, f.level, f.key, label(f.component)), f.bits);
    let mut faces: Vec<_> = faces.into_iter().map(labelled).collect();
    faces.sort_unstable();
    let mut out = MessageBuffer::default();
    for run in faces.chunk_by(|a, b| a.0 == b.0) {
        let (rank, level, key, label) = run[0].0;
        out.write(rank, [u64::from(level), key, label, run.iter().fold(0, |all, f| all | f.1)]);
    }
    drop(faces);
    let (mut pairs, mut path) = (Vec::new(), Vec::new());
    for &[level, key, remote, bits] in comm.sparse_all_to_all(out).words().as_chunks().0 {
        nodes.find(&mut path, level as Level, key, bits, |c| {
            let mine = label(c);
            // Most components on both sides have the label of a fully replicated brick already.
            if remote != mine && pairs.last() != Some(&[remote, mine]) {
                pairs.push([remote, mine]);
            }
        });
    }
    pairs
}

/// Pairs that unite the same labels as `pairs`: one for each label but the least of its set, with that one. Ascending.
fn forest(pairs: &[[Label; 2]]) -> Pairs {
    let all = least(pairs).into_iter().filter(|(label, least)| label != least);
    let mut all: Vec<_> = all.map(|(label, least)| [label, least]).collect();
    all.sort_unstable();
    all
}

/// The least label of the set of each label in `pairs`.
fn least(pairs: &[[Label; 2]]) -> FxHashMap<Label, Label> {
    let mut numbers = FxHashMap::default();
    let mut number = |label: &Label| {
        let next = numbers.len() as Label;
        *numbers.entry(*label).or_insert(next) as u32
    };
    let pairs: Vec<_> = pairs.iter().map(|[a, b]| [number(a), number(b)]).collect();
    let mut sets = UnionFind::new(numbers.len() as u32);
    pairs.into_iter().for_each(|[a, b]| sets.unite(a, b));
    let mut least = vec![Label::MAX; numbers.len()];
    for (label, number) in &mut numbers {
        *number = sets.find(*number as u32).into();
        let least = &mut least[*number as usize];
        *least = (*least).min(*label);
    }
    numbers.values_mut().for_each(|number| *number = least[*number as usize]);
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_unite_through_chains() {
        let pairs = forest(&[[9, 8], [5, 6], [8, 6], [1, 2], [7, 9]]);
        assert_eq!(pairs, [[2, 1], [6, 5], [7, 5], [8, 5], [9, 5]]);
        assert_eq!(forest(&pairs), pairs);
    }
}
