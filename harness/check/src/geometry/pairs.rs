//! Pairs of facets that may be a thin sheet, decided by their [`patches`](super::patches) where these suffice.

use super::edges::Edges;
use super::input::Input;
use super::intersections::{Relation, relation};
use super::opposite::opposite;
use super::patches::Patches;
use super::shells::Shells;

/// The facets of a geometry.
pub struct Pairs<'a> {
    /// The geometry.
    pub input: &'a Input,
    /// Its vertices.
    pub edges: &'a Edges,
    /// Its shells.
    pub shells: &'a Shells,
    /// Its facets that have an area. All positions are those in their tree.
    pub patches: &'a Patches,
    /// The squared edge length of a cell, in lattice units.
    pub limit: f64,
}

impl Pairs<'_> {
    /// Whether the facets of two nodes may be walls by their shells: two solids that overlap have inner sides that face each other, but
    /// no wall.
    pub fn may_be_walls(&self, a: usize, b: usize) -> bool {
        let [p, q] = [a, b].map(|node| self.patches.node(node).shell());
        p == q || !p.zip(q).is_some_and(|(p, q)| self.shells.are_different_solids(p, q))
    }

    /// Whether the facets of two nodes that may be walls are all of known shells.
    pub fn have_shells(&self, a: usize, b: usize) -> bool {
        [a, b].iter().all(|&node| self.patches.node(node).shell().is_some())
    }

    /// Whether the facets at two positions may be a wall by their shells.
    pub fn may_be_wall(&self, i: usize, j: usize) -> bool {
        let [p, q] = [i, j].map(|i| self.shells.of(self.patches.number(i) as usize));
        !self.shells.are_different_solids(p, q)
    }

    /// The side and the squared distance of the facets at positions `i` and `j` if they are opposite and nearer than the
    /// squared limit of that side. `squared_min` is a lower bound on their squared distance.
    pub fn opposite(
        &self,
        [i, j]: [usize; 2],
        squared_min: f64,
        limits: [f64; 2],
    ) -> Option<(usize, f64)> {
        let [f, g] = [i, j].map(|i| self.patches.number(i) as usize);
        let [a, b] = [f, g].map(|f| &self.input.lattice[f]);
        let found = opposite(a, b, squared_min, limits)?;
        let shares_vertex =
            self.edges.corners[f].iter().any(|vertex| self.edges.corners[g].contains(vertex));
        (!shares_vertex && relation(a, b, true) == Relation::Disjoint).then_some(found)
    }
}
