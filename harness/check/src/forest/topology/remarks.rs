//! What is legal in a connectivity, but p4est balances less than the reader may expect, or differently.
//!
//! p4est asks for lists of the edges and corners at which trees meet that are no neighbours there across a face, or at a corner across
//! a face or an edge. Where one is missing, p4est neither balances over it nor, sometimes, over the faces beside it. An edge that meets itself
//! in the opposite direction is a mistake in most connectivities.

use super::Topology;
use crate::forest::isometry::{EDGES, corner_at, edge_between, edge_end, point};
use contract::import::forest::{Connectivity, Lists};

/// The number of places of each kind, and the first.
pub fn of(topology: &Topology, connectivity: &Connectivity) -> String {
    let places = |each: usize| {
        (0..connectivity.trees).flat_map(move |tree| (0..each).map(move |place| (tree, place)))
    };
    let edges = || places(topology.edges.places / 2);
    let remark = |what: &str, found: Vec<(usize, usize)>| {
        let (tree, place) = found.first()?;
        Some(format!("{} {what}, the first {place} of tree {tree}", found.len()))
    };
    let unlisted = "whose trees are no neighbours otherwise are in no list";
    let remarks = [
        remark(
            &format!("tree edges {unlisted}"),
            edges().filter(|&at| is_unlisted_edge(topology, &connectivity.edges, at)).collect(),
        ),
        remark(
            &format!("tree corners {unlisted}"),
            places(1 << topology.dimension)
                .filter(|&at| is_unlisted_corner(topology, &connectivity.corners, at))
                .collect(),
        ),
        remark(
            "tree edges meet themselves in the opposite direction",
            edges()
                .filter(|&(t, edge)| topology.edges.with(t, edge).any(|o| o == (t, edge + EDGES)))
                .collect(),
        ),
    ];
    remarks.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

/// The trees across the faces of a tree that have these corners, and what the corners are there.
fn across_faces(topology: &Topology, tree: usize, corners: &[usize]) -> Vec<(usize, Vec<usize>)> {
    let faces = 2 * topology.dimension;
    let has = |face: &usize| corners.iter().all(|c| c >> (face / 2) & 1 == face % 2);
    let glued = (0..faces).filter(has).filter_map(|face| topology.faces[faces * tree + face]);
    let image = |(other, map): (usize, super::Isometry)| {
        (other, corners.iter().map(|&c| corner_at(map.of_cube(point(c), 0))).collect())
    };
    glued.map(image).collect()
}

fn is_in(lists: &Lists, index: usize) -> bool {
    lists.of_tree.get(index).is_some_and(|&list| list >= 0)
}

fn is_unlisted_edge(topology: &Topology, lists: &Lists, (tree, edge): (usize, usize)) -> bool {
    let ends = [edge_end(edge, false), edge_end(edge, true)];
    let mut near: Vec<(usize, usize)> = across_faces(topology, tree, &ends)
        .into_iter()
        .map(|(other, ends)| (other, edge_between(ends[0], ends[1])))
        .collect();
    near.push((tree, edge));
    !is_in(lists, EDGES * tree + edge)
        && !topology.edges.with(tree, edge).all(|at| near.contains(&at))
}

fn is_unlisted_corner(topology: &Topology, lists: &Lists, (tree, corner): (usize, usize)) -> bool {
    let across = across_faces(topology, tree, &[corner]).into_iter();
    let mut near: Vec<(usize, usize)> = across.map(|(other, its)| (other, its[0])).collect();
    near.push((tree, corner));
    for edge in (0..topology.edges.places).filter(|&edge| edge_end(edge, false) == corner) {
        let meeting = topology.edges.with(tree, edge);
        near.extend(meeting.map(|(other, its)| (other, edge_end(its, false))));
    }
    !is_in(lists, (tree << topology.dimension) + corner)
        && !topology.corners.with(tree, corner).all(|at| near.contains(&at))
}
