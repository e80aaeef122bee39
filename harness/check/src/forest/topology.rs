//! How the trees of a forest are glued, from its connectivity.
//!
//! A glued face is an isometry from one tree's coordinates to the other's. In three dimensions it is the only rotation that maps
//! the first corner of the face of the lower number onto the corner that the orientation names; in two, a reflection is possible
//! too. Tree edges and tree corners are identified where glued faces map them onto each other, and by the lists of edges and
//! corners; what is identified is a set, whose members all meet there. So neighbours are found without p4est's tables, also those that no list names.

mod remarks;

use super::isometry::{EDGES, Isometry, LENGTH, corner_at, edge_between, edge_end, point};
use crate::checks::CheckResult;
use contract::import::forest::{Connectivity, Lists};
use contract::sets::Sets;

/// How the trees are glued.
#[derive(Debug)]
pub struct Topology {
    /// 2 or 3.
    pub dimension: usize,
    /// The tree across each face of each tree.
    faces: Vec<Option<(usize, Isometry)>>,
    /// Directed edges of all trees that are the same.
    edges: Identified,
    /// Corners of all trees that are the same.
    corners: Identified,
}

/// Disjoint sets of the places of all trees.
#[derive(Debug)]
struct Identified {
    /// Places of one tree.
    places: usize,
    sets: Sets,
    /// The representative of every place, and the members of its set.
    roots: Vec<usize>,
    members: Vec<Vec<usize>>,
}

impl Identified {
    fn new(trees: usize, places: usize) -> Self {
        let sets = Sets::new(trees * places);
        Self { places, sets, roots: Vec::new(), members: vec![Vec::new(); trees * places] }
    }

    fn unite(&mut self, (tree, place): (usize, usize), (other, its): (usize, usize)) {
        self.sets.union((tree * self.places + place) as u32, (other * self.places + its) as u32);
    }

    fn collect(&mut self) {
        let count = self.members.len();
        self.roots = (0..count).map(|place| self.sets.root(place as u32) as usize).collect();
        (0..count).for_each(|place| self.members[self.roots[place]].push(place));
    }

    /// Everything that is the same as a place, itself included: trees and their places.
    fn with(&self, tree: usize, place: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let members = &self.members[self.roots[tree * self.places + place]];
        members.iter().map(|member| (member / self.places, member % self.places))
    }
}

impl Topology {
    /// Derives the topology; `None` with findings if the connectivity contradicts itself.
    pub fn of(connectivity: &Connectivity, result: &mut CheckResult) -> Option<Self> {
        let &Connectivity { dimension, trees, .. } = connectivity;
        let faces = glued_faces(connectivity, result);
        check_lists(&connectivity.edges, ("edge", trees, EDGES, 2), result);
        check_lists(&connectivity.corners, ("corner", trees, 1 << dimension, 1), result);
        let listed = connectivity.edges.trees.len() + connectivity.corners.trees.len();
        result.examined = (faces.len() + listed) as u64;
        if !result.holds() {
            return None;
        }
        let edges = if dimension == 3 { 2 * EDGES } else { 0 };
        let edges = Identified::new(trees, edges);
        let corners = Identified::new(trees, 1 << dimension);
        let mut topology = Self { dimension, faces, edges, corners };
        topology.identify_across_faces();
        topology.identify_lists(connectivity);
        topology.edges.collect();
        topology.corners.collect();
        result.note = remarks::of(&topology, connectivity);
        Some(topology)
    }

    fn identify_across_faces(&mut self) {
        let faces = 2 * self.dimension;
        for (index, glued) in self.faces.iter().enumerate() {
            let Some((other, isometry)) = glued else { continue };
            let (tree, face) = (index / faces, index % faces);
            let image = |corner| corner_at(isometry.of_cube(point(corner), 0));
            let own = |corner: &usize| corner >> (face / 2) & 1 == face % 2;
            for corner in (0..1 << self.dimension).filter(own) {
                self.corners.unite((tree, corner), (*other, image(corner)));
            }
            for edge in 0..self.edges.places {
                let ends = [edge_end(edge, false), edge_end(edge, true)];
                if ends.iter().all(own) {
                    let across = edge_between(image(ends[0]), image(ends[1]));
                    self.edges.unite((tree, edge), (*other, across));
                }
            }
        }
    }

    fn identify_lists(&mut self, connectivity: &Connectivity) {
        for (first, other) in pairs(&connectivity.edges) {
            let reversed = |(tree, edge): (usize, usize)| (tree, (edge + EDGES) % (2 * EDGES));
            self.edges.unite(first, other);
            self.edges.unite(reversed(first), reversed(other));
            for end in [false, true] {
                let corner = |(tree, edge)| (tree, edge_end(edge, end));
                self.corners.unite(corner(first), corner(other));
            }
        }
        pairs(&connectivity.corners).for_each(|(first, other)| self.corners.unite(first, other));
    }

    /// The cubes of a size that lie where a cube beside or in a tree does, whose minimum corner is given: as many as trees meet there, and
    /// none outside of the forest.
    pub fn same_place(
        &self,
        tree: usize,
        corner: [i64; 3],
        size: i64,
        visit: &mut dyn FnMut(usize, [i64; 3]),
    ) {
        let side = |axis: usize| match corner[axis] {
            at if at < 0 => Some(0),
            at if at >= LENGTH => Some(1),
            _ => None,
        };
        let outside: Vec<(usize, usize)> =
            (0..self.dimension).filter_map(|axis| side(axis).map(|side| (axis, side))).collect();
        // The cube of this size in a corner of a tree.
        let at_corner = |corner: usize| point(corner).map(|at| (at - size).max(0));
        let number = |outside: &[(usize, usize)]| -> usize {
            outside.iter().map(|(axis, side)| side << axis).sum()
        };
        match outside.as_slice() {
            [] => visit(tree, corner),
            [(axis, side)] => {
                let across = &self.faces[2 * (self.dimension * tree + axis) + side];
                across.iter().for_each(|(other, map)| visit(*other, map.of_cube(corner, size)));
            }
            all if all.len() == self.dimension => {
                let own = number(all);
                self.corners.with(tree, own).for_each(|(other, its)| visit(other, at_corner(its)));
            }
            two => {
                let axis = (0..3).find(|&axis| side(axis).is_none()).expect("one of three axes");
                let own = edge_between(number(two), number(two) + (1 << axis));
                for (other, edge) in self.edges.with(tree, own) {
                    let mut at = at_corner(edge_end(edge % EDGES, false));
                    let along = corner[axis];
                    at[edge % EDGES / 4] =
                        if edge >= EDGES { LENGTH - size - along } else { along };
                    visit(other, at);
                }
            }
        }
    }
}

/// The neighbours across all faces. Findings are indices out of range, and faces that are not glued in both directions.
fn glued_faces(
    connectivity: &Connectivity,
    result: &mut CheckResult,
) -> Vec<Option<(usize, Isometry)>> {
    let &Connectivity { dimension, trees, ref tree_to_tree, ref tree_to_face, .. } = connectivity;
    let faces = 2 * dimension;
    let glued = |index: usize| {
        let other = usize::try_from(tree_to_tree[index]).ok().filter(|&tree| tree < trees)?;
        let code = usize::try_from(tree_to_face[index]).ok()?;
        (code < faces << (dimension - 1)).then_some((other, code % faces, code / faces))
    };
    let mut found = vec![None; tree_to_tree.len()];
    for (index, found) in found.iter_mut().enumerate() {
        let (tree, face) = (index / faces, index % faces);
        match glued(index) {
            None => result.report(format!(
                "face {face} of tree {tree} is glued to face code {} of tree {}, which does not exist",
                tree_to_face[index], tree_to_tree[index]
            )),
            Some((other, its, orientation)) if (other, its, orientation) != (tree, face, 0) => {
                if glued(other * faces + its) != Some((tree, face, orientation)) {
                    result.report(format!(
                        "face {face} of tree {tree} is glued to face {its} of tree {other} with orientation {orientation}, but that \
                         face is not glued to it in the same way"
                    ));
                }
                let isometry = match face <= its {
                    true => Isometry::gluing(dimension, face, its, orientation),
                    false => Isometry::gluing(dimension, its, face, orientation).inverse(),
                };
                *found = Some((other, isometry));
            }
            Some(_) => {}
        }
    }
    found
}

/// Consecutive members of every list.
fn pairs(lists: &Lists) -> impl Iterator<Item = ((usize, usize), (usize, usize))> + '_ {
    let member = |at: usize| (lists.trees[at] as usize, lists.places[at] as usize);
    let of_list = move |ends: &[i32]| {
        (ends[0] as usize + 1..ends[1] as usize).map(move |at| (member(at - 1), member(at)))
    };
    lists.offsets.windows(2).flat_map(of_list)
}

/// Findings are lists and members that do not exist, and places of trees that name another list than the one that has them.
fn check_lists(
    lists: &Lists,
    (what, trees, places, directions): (&str, usize, usize, usize),
    result: &mut CheckResult,
) {
    let Lists { of_tree, offsets, trees: members, places: of_members } = lists;
    let ends = [offsets.first().copied().unwrap_or(0), offsets.last().copied().unwrap_or(0)];
    if !offsets.is_sorted() || ends != [0, members.len() as i32] {
        return result.report(format!("the lists of {what}s do not begin and end in one another"));
    }
    let mut found = vec![-1; of_tree.len()];
    for (list, ends) in (0..).zip(offsets.windows(2)) {
        for at in ends[0] as usize..ends[1] as usize {
            let (tree, place) = (members[at], of_members[at]);
            let exists = (0..trees as i64).contains(&i64::from(tree))
                && (0..(directions * places) as i64).contains(&i64::from(place));
            let place = exists.then(|| tree as usize * places + place as usize % places);
            match place.and_then(|place| found.get_mut(place)) {
                Some(found) => *found = list,
                None => result.report(format!(
                    "list {list} of {what}s has {what} {} of tree {tree}, which does not exist",
                    of_members[at]
                )),
            }
        }
    }
    for (at, (stated, found)) in of_tree.iter().zip(&found).enumerate() {
        if stated != found {
            let [stated, found] = [*stated, *found].map(|list| match list {
                -1 => "no list".to_owned(),
                list => format!("list {list}"),
            });
            result.report(format!(
                "{what} {} of tree {} states {stated} of {what}s, but {found} has it",
                at % places,
                at / places
            ));
        }
    }
}
