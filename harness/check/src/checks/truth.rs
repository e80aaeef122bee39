//! T0 as the harness makes it from the case: the least tree that facets and boxes require (section 3 of
//! reference/DEFINITION.md), with the sides of its leaves (section 4) and the components that are enclosed (section 5).
//!
//! Invariants: the words are sorted and tile the root; a leaf is crossing iff a facet crosses it; every other leaf belongs to
//! one component and has its side.
//!
//! [`Facets`] finds the facets that meet octants, by descent with shrinking lists.

use super::components::{self, Component};
use contract::case::Case;
use contract::lattice::FacetLattice;
use contract::manifest::Manifest;
use contract::octant::Octant;
use contract::tree::{Builder, Handle, Kind, Kinds, Tree};
use contract::triangle::Triangle;
use contract::word::{self, Side};

/// The kind, in T0's tree, of an outside leaf that is deleted because its component is enclosed.
const ENCLOSED: Kind = 3;

/// T0 of a case.
#[derive(Debug)]
pub struct Truth {
    /// The facets of the case.
    pub facets: Facets,
    /// Its leaf words.
    pub words: Vec<u64>,
    /// The components of the leaves that no facet crosses.
    pub components: Vec<Component>,
    /// The component of each leaf.
    component_of: Vec<Option<u32>>,
    /// The leaves as a tree, in which a deleted leaf of an enclosed component has a kind of its own.
    pub tree: Tree,
}

/// A part of a mesh: a leaf, a hole, or an octant that has leaves of one kind only, whole or within one leaf of T0.
pub struct Found {
    /// The octant.
    pub octant: Octant,
    /// What the mesh has there, as one bit.
    pub kinds: Kinds,
    /// The kind of the leaf of T0 that contains it; `None` if T0 splits it.
    pub base: Option<Kind>,
}

impl Truth {
    /// Maximum number of leaves. One needs about 40 bytes.
    pub const LEAVES_MAX: usize = 1 << 26;

    /// T0 of a case with these inputs; `None` if it has more than [`Truth::LEAVES_MAX`] leaves.
    pub fn of(case: &Case, terms: &Manifest) -> Option<Self> {
        let (facets, mut words) = (Facets::new(&case.facets_lattice), Vec::new());
        facets.walk(0, &mut |octant, near| {
            let by_surface = !near.is_empty() && octant.level < terms.level_surface;
            let splits = by_surface || terms.box_that_splits(&octant).is_some();
            if !splits {
                let side = if near.is_empty() { Side::Outside } else { Side::Crossing };
                words.push(word::encode(octant, side));
            }
            splits && words.len() <= Self::LEAVES_MAX
        });
        if words.len() > Self::LEAVES_MAX {
            return None;
        }
        let components = components::find(&words, terms, &case.facets_lattice);
        let mut component_of = vec![None; words.len()];
        let mut kinds: Vec<Kind> = words.iter().map(|&w| (w & word::SIDE_BITS) as Kind).collect();
        for (index, Component { leaves, side, enclosed, .. }) in (0..).zip(&components) {
            for leaf in leaves.iter().map(|&leaf| leaf as usize) {
                component_of[leaf] = Some(index);
                words[leaf] = words[leaf] & !word::SIDE_BITS | *side as u64;
                kinds[leaf] = if *enclosed { ENCLOSED } else { *side as Kind };
            }
        }
        let mut builder = Builder::default();
        for (&w, &kind) in words.iter().zip(&kinds) {
            builder.push_leaf(word::key(w), word::level(w), kind);
        }
        Some(Self { facets, words, components, component_of, tree: builder.finish() })
    }

    /// The side of a leaf of T0 of this kind.
    pub fn side(kind: Kind) -> Side {
        if kind == ENCLOSED { Side::Outside } else { Side::ALL[usize::from(kind)] }
    }

    /// Whether a leaf of T0 of this kind is kept.
    pub fn keeps(kind: Kind, terms: &Manifest) -> bool {
        (kind != ENCLOSED || !terms.deletes_enclosed()) && terms.keeps(Self::side(kind) as Kind)
    }

    /// The component of the leaf of T0 that contains an octant; `None` if a facet crosses that leaf.
    pub fn component_at(&self, octant: &Octant) -> Option<&Component> {
        let leaf = word::leaf_at(&self.words, octant.bounds().0)?;
        self.component_of[leaf].map(|index| &self.components[index as usize])
    }

    /// Whether a facet crosses an octant that is a leaf of T0 or contains some.
    pub fn is_crossed(&self, octant: &Octant) -> bool {
        self.tree.kinds(self.tree.at(octant)) & 1 << Side::Crossing as u8 != 0
    }

    /// Visits the parts of a mesh, in Morton order.
    pub fn compare(&self, mesh: &Tree, visit: &mut dyn FnMut(Found)) {
        self.descend(mesh, [mesh.root, self.tree.root], Octant::ROOT, false, visit);
    }

    /// Visits every leaf and every hole of a mesh, in Morton order.
    pub fn leaves(&self, mesh: &Tree, visit: &mut dyn FnMut(Found)) {
        self.descend(mesh, [mesh.root, self.tree.root], Octant::ROOT, true, visit);
    }

    fn descend(
        &self,
        mesh: &Tree,
        [handle, base]: [Handle; 2],
        octant: Octant,
        every_leaf: bool,
        visit: &mut dyn FnMut(Found),
    ) {
        let kinds = mesh.kinds(handle);
        let kind = base.as_leaf().or(base.as_coarser_leaf().map(|(kind, _)| kind));
        let is_whole = match kind {
            Some(_) => !handle.is_node() || kinds.is_power_of_two() && !every_leaf,
            None => handle.as_leaf().is_some(),
        };
        if is_whole {
            return visit(Found { octant, kinds, base: kind });
        }
        for digit in 0..8 {
            let below = [(mesh, handle), (&self.tree, base)];
            let below = below.map(|(tree, of)| tree.child(of, digit, octant.level));
            self.descend(mesh, below, octant.child(digit), every_leaf, visit);
        }
    }
}

/// Is called with an octant and the facets that meet it; returns whether to visit its children.
type Enter<'e> = &'e mut dyn FnMut(Octant, &[u32]) -> bool;

/// Facets, prepared for any number of walks.
#[derive(Debug)]
pub struct Facets(Vec<Triangle>);

impl Facets {
    /// Prepares facets.
    pub fn new(facets: &[FacetLattice]) -> Self {
        Self(facets.iter().map(Triangle::new).collect())
    }

    /// The indices of all facets.
    pub fn all(&self) -> Vec<u32> {
        (0..u32::try_from(self.0.len()).expect("fewer than 2^32 facets")).collect()
    }

    /// Those of some facets that share a point with a closed octant that is enlarged by `margin` lattice units on all sides.
    pub fn meeting(&self, of: &[u32], octant: &Octant, margin: i64) -> impl Iterator<Item = u32> {
        let (low, high) = octant.bounds();
        let (low, high) = (low.map(|c| c - margin), high.map(|c| c + margin));
        of.iter().copied().filter(move |&i| self.0[i as usize].meets(low, high))
    }

    /// Visits octants in Morton order, parents first, each with the facets that meet it if it is enlarged by `margin` lattice units on all
    /// sides: the root, and the children of octants for which `enter` returns true.
    pub fn walk(&self, margin: i64, enter: Enter) {
        self.walk_below(Octant::ROOT, &self.all(), margin, enter);
    }

    /// Visits every leaf in Morton order, with the facets that meet it.
    pub fn leaves(&self, tree: &Tree, visit: &mut dyn FnMut(Octant, Kind, &[u32])) {
        self.walk(0, &mut |octant, near| {
            let handle = tree.at(&octant);
            if let Some(kind) = handle.as_leaf() {
                visit(octant, kind, near);
            }
            handle.is_node()
        });
    }

    fn walk_below(&self, octant: Octant, candidates: &[u32], margin: i64, enter: Enter) {
        let near: Vec<u32> = self.meeting(candidates, &octant, margin).collect();
        if enter(octant, &near) {
            (0..8).for_each(|digit| self.walk_below(octant.child(digit), &near, margin, enter));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::words_of;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_walk_visits_octants_with_the_facets_that_meet_them_or_their_margin(
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0i64..1 << 27)), 0..3),
            margin in 0i64..1 << 24,
        ) {
            let mut visited = Vec::new();
            Facets::new(&facets).walk(margin, &mut |octant, near| {
                let (low, high) = octant.bounds();
                let (low, high) = (low.map(|c| c - margin), high.map(|c| c + margin));
                let meeting = (0..).zip(&facets).filter(|(_, facet)| Triangle::new(facet).meets(low, high));
                assert_eq!(near, meeting.map(|(i, _)| i).collect::<Vec<u32>>(), "{octant}");
                if octant.level == 2 {
                    visited.push(octant);
                }
                octant.level < 2
            });
            let all: Vec<Octant> = words_of(|o| o.level < 2).into_iter().map(word::octant).collect();
            prop_assert_eq!(visited, all);
        }
    }
}
