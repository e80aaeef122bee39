//! Every layer is at least n cells thick, at every level.
//!
//! Section 7 of reference/DEFINITION.md: a leaf of level l + 1 or more and one of level l - 1 or less are at
//! least n cells of level l apart by Chebyshev distance, for every l below the surface's level and, where
//! all is kept, for every l; and leaves nearer than n - 1 surface cells to a crossing leaf of
//! the surface's level have that level at least. Where crossing leaves are deleted, whatever touched one has
//! the surface's level. Misses: layers thicker than they need be; without T0, what deleted crossing
//! leaves asked for.

use super::gap::{Gap, Trail};
use super::{CheckResult, Subject, Terms, contact};
use crate::manifest::Keep;
use crate::octant::{CELLS_PER_EDGE, Octant};
use crate::tree::{GHOST, Kind, Kinds, Region, Tree};
use crate::word::Side;

const NAME: &str = "layer";

/// Checks the mesh, with deleted crossing leaves put back where T0 tells them.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = check_tree(subject.tree_with_ghosts(), &subject.terms);
    result.examined = subject.mesh.words.len() as u64;
    result
}

/// What can be said of the leaves alone.
pub fn check_tree(tree: &Tree, terms: &Terms) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let n = i64::from(terms.layer_cells_min);
    let margin = |level: u8| {
        let promised = terms.keep == Keep::All || level < terms.level_surface;
        promised.then(|| n * cell(level))
    };
    let what = &format!("a layer is thinner than {n} cells");
    Gap { tree, root: &terms.root, margin: &margin, what }.check(&mut result);
    around_surface(tree, &mut Trail::new(tree), terms, &mut result);
    result
}

/// Edge of a cell in level-19 cells.
fn cell(level: u8) -> i64 {
    i64::from(CELLS_PER_EDGE >> level)
}

impl Terms {
    /// How far around a leaf none may be coarser than the surface, in level-19 cells.
    fn insulation(&self, kind: Kind, level: u8) -> i64 {
        let layer = i64::from(self.layer_cells_min) - 1;
        // The extra layer is asked for only where crossing leaves are deleted.
        let extra = i64::from(!self.keep_crossing);
        let cells = match kind {
            GHOST => extra,
            _ if level == self.level_surface => layer.max(extra),
            _ => extra,
        };
        cells * cell(level)
    }
}

const SURFACE: Kinds = 1 << Side::Crossing as u8 | 1 << GHOST;

/// Every crossing leaf is insulated from leaves coarser than the surface. What is insulated as a whole
/// is not looked into.
fn around_surface(tree: &Tree, trail: &mut Trail, terms: &Terms, result: &mut CheckResult) {
    let (at, octant) = (trail.here().centre(), trail.here().octant);
    let (level, surface) = (octant.level, terms.level_surface);
    if tree.kinds(at) & SURFACE == 0 {
        return;
    }
    let margin = match at.as_leaf() {
        Some(kind) => terms.insulation(kind, level),
        None => terms.insulation(Side::Crossing as Kind, surface),
    };
    // Crossing leaves coarser than the surface are for `spacing` to report.
    if margin == 0 || trail.coarsest_nearby(tree, margin, surface) >= surface {
        return;
    }
    if at.is_node() {
        for digit in 0..8 {
            trail.descend(tree, digit);
            around_surface(tree, trail, terms, result);
            trail.ascend();
        }
    } else if level >= surface {
        report(tree, trail, margin, octant, terms, result);
    }
}

fn report(tree: &Tree, trail: &Trail, margin: i64, octant: Octant, terms: &Terms, result: &mut CheckResult) {
    result.find_with(|| {
        let found = trail.search(tree, margin, &Region::around(&octant, margin)).leaf(tree);
        let coarse = found.map_or_else(String::new, |c| c.describe(&terms.root));
        let (what, cells) = (contact::name(SURFACE), margin / cell(octant.level));
        format!("around a {what} leaf, {}, within {cells} cells is coarser than the surface {coarse}",
                octant.describe(&terms.root))
    });
}
