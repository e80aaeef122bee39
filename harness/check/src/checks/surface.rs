//! The promise `surface`: every leaf that the geometry crosses has at least the level of the surface.
//!
//! Crossed leaves are found from the facets, never from the mesh's own sides. A leaf that is coarser than the surface
//! level is a finding if a facet reaches deeper into it than a tolerance. The check cannot detect a crossed leaf that is
//! missing from the mesh; `complete` does.

use super::facets::Facets;
use super::{CheckResult, Terms};
use crate::promises::Surface;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::Octant;
use contract::tree::{Builder, Handle, Kind, Tree};
use contract::word::{self, Side};

/// The facets and the depth to which they may reach into a leaf.
pub struct Crossed<'a> {
    facets: &'a Facets,
    terms: &'a Terms,
    /// The depth, in lattice units.
    tolerance: i64,
}

impl<'a> Crossed<'a> {
    /// The crossed leaves of a mesh, by this promise; without one, the tolerance is 0.
    pub fn new(facets: &'a Facets, terms: &'a Terms, surface: Option<Surface>) -> Self {
        let cells = surface.map_or(0.0, |surface| surface.tolerance_cells);
        let tolerance = (cells * (UNITS_PER_EDGE >> terms.level_surface) as f64) as i64;
        Self { facets, terms, tolerance }
    }

    /// Checks the promise.
    pub fn check(&self, tree: &Tree) -> CheckResult {
        let mut result = CheckResult::new("surface");
        let level = self.terms.level_surface;
        self.visit(tree, &mut |octant, _, facet| {
            let Some(facet) = facet else { return };
            result.examined += 1;
            if octant.level < level {
                result.report_with(|| {
                    let leaf = self.terms.root.describe(&octant);
                    format!(
                        "facet {facet} crosses the leaf {leaf}, which is coarser than level {level}"
                    )
                });
            }
        });
        match result.examined {
            0 => CheckResult::nothing(result.name, "the geometry crosses no leaf of the mesh"),
            _ => result,
        }
    }

    /// The tree with the sides of its leaves replaced: crossing if a facet crosses a leaf of the surface level, else
    /// outside.
    pub fn labelled(&self, tree: &Tree) -> Tree {
        let mut builder = Builder::default();
        self.visit(tree, &mut |octant, _, facet| {
            let crossing = facet.is_some() && octant.level == self.terms.level_surface;
            let side = if crossing { Side::Crossing } else { Side::Outside };
            builder
                .push_leaf(word::key_of(octant.corner), octant.level, side as Kind)
                .expect("the leaves of a tree are in order and do not overlap");
        });
        builder.finish()
    }

    /// Visits every leaf in Morton order, with a facet that reaches into it deeper than the tolerance.
    fn visit(&self, tree: &Tree, visit: &mut dyn FnMut(Octant, Kind, Option<u32>)) {
        self.descend(tree, tree.root(), Octant::ROOT, &self.facets.all(), visit);
    }

    fn descend(
        &self,
        tree: &Tree,
        handle: Handle,
        octant: Octant,
        candidates: &[u32],
        visit: &mut dyn FnMut(Octant, Kind, Option<u32>),
    ) {
        let (low, high) = octant.bounds();
        if let Some(kind) = handle.as_leaf() {
            let (low, high) = (low.map(|c| c + self.tolerance), high.map(|c| c - self.tolerance));
            // A leaf far below the surface level may be smaller than the tolerance.
            let is_box = low[0] <= high[0];
            let found = is_box.then(|| self.facets.first_meeting(candidates, low, high)).flatten();
            return visit(octant, kind, found);
        }
        if !handle.is_node() {
            return;
        }
        let near = self.facets.meeting(candidates, low, high);
        for digit in 0..8 {
            let child = tree.child(handle, digit, octant.level);
            self.descend(tree, child, octant.child(digit), &near, visit);
        }
    }
}
