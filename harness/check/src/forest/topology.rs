//! How the trees of a forest are glued, from its connectivity.
//!
//! A glued face is an isometry from one tree's coordinates to the other's. In three dimensions it is the only rotation that maps
//! the first corner of the face of the lower number onto the corner that the orientation names; in two, a reflection is possible
//! too. Tree edges and tree corners are identified where glued faces map them onto each other, and by the lists of edges and
//! corners; what is identified is a set, whose members all meet there. So neighbours are found without p4est's tables, also those that no list names.

use super::isometry::{EDGES, Isometry, LENGTH, corner_at, edge_between, edge_end, point};
use crate::checks::CheckResult;
use contract::import::forest::{Connectivity, Lists};
use contract::sets::Sets;

/// A tree, and the number of an edge or corner of it.
type Place = (usize, usize);

/// The tree across a face, and the isometry to its coordinates; none at the boundary.
type Across = Option<(usize, Isometry)>;

/// How the trees are glued.
pub struct Topology {
    /// 2 or 3.
    pub dimension: usize,
    /// The tree across each face of each tree.
    faces: Vec<Across>,
    /// Directed edges of all trees that are the same.
    edges: Identified,
    /// Corners of all trees that are the same.
    corners: Identified,
}

/// Disjoint sets of the places of all trees.
#[derive(Debug, Default)]
struct Identified {
    /// Places of one tree.
    places: usize,
    /// The representative of every place, and the members of its set.
    roots: Vec<usize>,
    members: Vec<Vec<Place>>,
}

impl Identified {
    fn by(trees: usize, places: usize, pairs: &[(Place, Place)]) -> Self {
        let index = |(tree, place): Place| (tree * places + place) as u32;
        let mut sets = Sets::new(trees * places);
        pairs.iter().for_each(|&(first, other)| sets.union(index(first), index(other)));
        let mut members = vec![Vec::new(); trees * places];
        let all = 0..(trees * places) as u32;
        let roots: Vec<usize> = all.map(|at| sets.root(at) as usize).collect();
        all_places(trees, places).zip(&roots).for_each(|(at, &root)| members[root].push(at));
        Self { places, roots, members }
    }

    /// Everything that is the same as a place, itself included.
    fn with(&self, (tree, place): Place) -> impl Iterator<Item = Place> + '_ {
        self.members[self.roots[tree * self.places + place]].iter().copied()
    }
}

/// All trees with all of so many places.
fn all_places(trees: usize, places: usize) -> impl Iterator<Item = Place> {
    (0..trees).flat_map(move |tree| (0..places).map(move |place| (tree, place)))
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
        let [edges, corners] = [(); 2].map(|()| Identified::default());
        let mut topology = Self { dimension, faces, edges, corners };
        topology.identify(connectivity);
        result.note = topology.remarks(connectivity);
        Some(topology)
    }

    fn identify(&mut self, connectivity: &Connectivity) {
        let trees = connectivity.trees;
        let (places, corners_each) =
            (if self.dimension == 3 { 2 * EDGES } else { 0 }, 1 << self.dimension);
        let mut corners: Vec<(Place, Place)> = pairs(&connectivity.corners).collect();
        let mut edges = Vec::new();
        for (first, other) in pairs(&connectivity.edges) {
            let reversed = |(tree, edge): Place| (tree, (edge + EDGES) % (2 * EDGES));
            edges.extend([(first, other), (reversed(first), reversed(other))]);
            for end in [false, true] {
                let corner = |(tree, edge)| (tree, edge_end(edge, end));
                corners.push((corner(first), corner(other)));
            }
        }
        for at in all_places(trees, places) {
            edges.extend(self.edges_across(at).map(|its| (at, its)));
        }
        for at in all_places(trees, corners_each) {
            corners.extend(self.corners_across(at).map(|its| (at, its)));
        }
        self.edges = Identified::by(trees, places, &edges);
        self.corners = Identified::by(trees, corners_each, &corners);
    }

    /// The trees across the faces of a tree that have these corners, and what the corners are there.
    fn across<const N: usize>(
        &self,
        tree: usize,
        corners: [usize; N],
    ) -> impl Iterator<Item = (usize, [usize; N])> + '_ {
        let faces = 2 * self.dimension;
        let has = move |face: &usize| corners.iter().all(|c| c >> (face / 2) & 1 == face % 2);
        let glued = (0..faces).filter(has).filter_map(move |face| self.faces[faces * tree + face]);
        glued.map(move |(other, map)| (other, corners.map(|c| corner_at(map.of_cube(point(c), 0)))))
    }

    /// What a directed edge is across faces.
    fn edges_across(&self, (tree, edge): Place) -> impl Iterator<Item = Place> + '_ {
        let ends = self.across(tree, [false, true].map(|end| edge_end(edge, end)));
        ends.map(|(other, [from, to])| (other, edge_between(from, to)))
    }

    /// What a corner is across faces.
    fn corners_across(&self, (tree, corner): Place) -> impl Iterator<Item = Place> + '_ {
        self.across(tree, [corner]).map(|(other, [its])| (other, its))
    }

    /// What is legal in a connectivity, but p4est balances less than the reader may expect, or differently: the number of places of each
    /// kind, and the first.
    ///
    /// p4est asks for lists of the edges and corners at which trees meet that are no neighbours there across a face, or at a corner across
    /// a face or an edge. Where one is missing, p4est neither balances over it nor, sometimes, over the faces beside it. An edge that meets itself
    /// in the opposite direction is a mistake in most connectivities.
    fn remarks(&self, connectivity: &Connectivity) -> String {
        let &Connectivity { trees, ref edges, ref corners, .. } = connectivity;
        let is_unlisted = |lists: &Lists, index: usize, same: &Identified, at, near: &[Place]| {
            let is_listed = lists.of_tree.get(index).is_some_and(|&list| list >= 0);
            !is_listed && same.with(at).any(|other| other != at && !near.contains(&other))
        };
        let is_unlisted_edge = |&(tree, edge): &Place| {
            let near: Vec<Place> = self.edges_across((tree, edge)).collect();
            is_unlisted(edges, EDGES * tree + edge, &self.edges, (tree, edge), &near)
        };
        let is_unlisted_corner = |&(tree, corner): &Place| {
            let mut near: Vec<Place> = self.corners_across((tree, corner)).collect();
            for edge in (0..self.edges.places).filter(|&edge| edge_end(edge, false) == corner) {
                let meeting = self.edges.with((tree, edge));
                near.extend(meeting.map(|(other, its)| (other, edge_end(its, false))));
            }
            let index = (tree << self.dimension) + corner;
            is_unlisted(corners, index, &self.corners, (tree, corner), &near)
        };
        let meets_itself = |&(tree, edge): &Place| {
            self.edges.with((tree, edge)).any(|other| other == (tree, edge + EDGES))
        };
        let all_edges = || all_places(trees, self.edges.places / 2);
        let all_corners = all_places(trees, 1 << self.dimension);
        let unlisted = "whose trees are no neighbours otherwise are in no list";
        let reversed = "tree edges meet themselves in the opposite direction".to_owned();
        let found: [(String, Vec<Place>); 3] = [
            (format!("tree edges {unlisted}"), all_edges().filter(is_unlisted_edge).collect()),
            (format!("tree corners {unlisted}"), all_corners.filter(is_unlisted_corner).collect()),
            (reversed, all_edges().filter(meets_itself).collect()),
        ];
        let remarks = found.iter().filter_map(|(what, found)| {
            let (tree, place) = found.first()?;
            Some(format!("{} {what}, the first {place} of tree {tree}", found.len()))
        });
        remarks.collect::<Vec<_>>().join("; ")
    }

    /// The cubes of a size that lie where a cube beside or in a tree does, whose minimum corner is given: as many as trees meet there, and
    /// none outside of the forest.
    pub fn same_place(&self, tree: usize, corner: [i64; 3], size: i64) -> Vec<(usize, [i64; 3])> {
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
            [] => vec![(tree, corner)],
            [(axis, side)] => {
                let across = &self.faces[2 * (self.dimension * tree + axis) + side];
                across.iter().map(|(other, map)| (*other, map.of_cube(corner, size))).collect()
            }
            all if all.len() == self.dimension => {
                let same = self.corners.with((tree, number(all)));
                same.map(|(other, its)| (other, at_corner(its))).collect()
            }
            two => {
                let axis = (0..3).find(|&axis| side(axis).is_none()).expect("one of three axes");
                let own = edge_between(number(two), number(two) + (1 << axis));
                let low = corner[axis];
                let place = |(other, edge): Place| {
                    let mut at = at_corner(edge_end(edge % EDGES, false));
                    at[edge % EDGES / 4] = if edge >= EDGES { LENGTH - size - low } else { low };
                    (other, at)
                };
                self.edges.with((tree, own)).map(place).collect()
            }
        }
    }
}

/// The neighbours across all faces. Findings are indices out of range, and faces that are not glued in both directions.
fn glued_faces(connectivity: &Connectivity, result: &mut CheckResult) -> Vec<Across> {
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
                // The first corner of the lower face is the corner of the higher one that the orientation names.
                let corners = if face <= its { [0, orientation] } else { [orientation, 0] };
                let isometry = Isometry::gluing(dimension, [face, its], corners);
                *found = isometry.map(|isometry| (other, isometry));
            }
            Some(_) => {}
        }
    }
    found
}

/// Consecutive members of every list.
fn pairs(lists: &Lists) -> impl Iterator<Item = (Place, Place)> + '_ {
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
            let (place, tree) = (at % places, at / places);
            result.report(format!(
                "{what} {place} of tree {tree} states {stated} of {what}s, but {found} has it"
            ));
        }
    }
}
