//! Every layer is at least n cells thick, at every level.
//!
//! Section 7 of reference/DEFINITION.md: a leaf of level l + 1 or more and one of level l - 1 or
//! less are at least n cells of level l apart by Chebyshev distance, for every l below the
//! surface's level and, where all is kept, for every l; and leaves nearer than n - 1 surface cells
//! to a crossing leaf of the surface's level have that level at least. Where crossing leaves are
//! deleted, whatever touched one has the surface's level. Misses: layers thicker than they need be;
//! without T0, what deleted crossing leaves asked for.

use super::gap::{Gap, Trail};
use super::{CheckResult, Subject, Terms, contact};
use contract::manifest::Keep;
use contract::octant::CELLS_PER_EDGE;
use contract::tree::{GHOST, Kind, Kinds, Region, Tree};
use contract::word::Side;

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
    Insulation { tree, terms }.children(&mut Trail::new(tree), &mut result);
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

/// Every crossing leaf is insulated from leaves coarser than the surface.
struct Insulation<'a> {
    tree: &'a Tree,
    terms: &'a Terms,
}

impl Insulation<'_> {
    /// Looks at the children of where the walk is, first all at once: what is insulated as a whole is
    /// not looked into.
    fn children(&self, trail: &mut Trail, result: &mut CheckResult) {
        let (tree, surface) = (self.tree, self.terms.level_surface);
        let (at, octant) = (trail.here().centre(), trail.here().octant);
        let most = self.terms.insulation(Side::Crossing as Kind, surface);
        let near = trail.children(tree, |child| tree.kinds(child) & SURFACE != 0);
        if near == 0 || most == 0 {
            return;
        }
        let region = Region::around_children(&octant, near, most);
        if trail.coarsest_nearby(tree, most, &region, surface) >= surface {
            return;
        }
        for digit in (0..8).filter(|d| near >> d & 1 == 1) {
            let child = tree.child(at, digit, octant.level);
            trail.descend(tree, digit);
            match child.as_leaf() {
                // Crossing leaves coarser than the surface are for `spacing` to report.
                Some(kind) if octant.level + 1 >= surface => self.leaf(trail, kind, result),
                Some(_) => {}
                None => self.children(trail, result),
            }
            trail.ascend();
        }
    }

    fn leaf(&self, trail: &Trail, kind: Kind, result: &mut CheckResult) {
        let (octant, surface) = (trail.here().octant, self.terms.level_surface);
        let margin = self.terms.insulation(kind, octant.level);
        let found = trail.search(self.tree, margin, &Region::around(&octant, margin), surface);
        if let Some(coarse) = found.leaf(self.tree) {
            result.find_with(|| {
                let (what, cells) = (contact::name(1 << kind), margin / cell(octant.level));
                let (leaf, coarse) =
                    (self.terms.root.describe(&octant), self.terms.root.describe(&coarse));
                format!("within {cells} cells of the {what} leaf {leaf}, coarser than the surface: {coarse}")
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::Root;
    use contract::testing::{distance, graded_words};
    use contract::word;
    use proptest::prelude::*;

    fn terms(n: u32, level_surface: u8, keep: Keep, keep_crossing: bool) -> Terms {
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        Terms { root, level_surface, layer_cells_min: n, keep, keep_crossing, boxes: Vec::new() }
    }

    /// The definition word by word, over all pairs of leaves.
    fn thin(words: &[u64], terms: &Terms) -> bool {
        let n = i64::from(terms.layer_cells_min);
        let leaves: Vec<_> = words.iter().map(|&w| (word::octant(w), word::side(w))).collect();
        let all = terms.keep == Keep::All;
        leaves.iter().any(|(fine, side)| {
            leaves.iter().any(|(coarse, _)| {
                let apart = distance(fine, coarse);
                let levels = coarse.level + 1..fine.level;
                let promised = |l: &u8| all || *l < terms.level_surface;
                let layer = levels.filter(promised).any(|l| apart < n * cell(l));
                let surface = terms.level_surface;
                let surrounded = *side == Side::Crossing && fine.level == surface;
                let insulation = apart < (n - 1) * cell(surface)
                    || !terms.keep_crossing && apart < cell(surface);
                layer || surrounded && coarse.level < surface && insulation
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn agrees_with_all_pairs(words in graded_words(4), n in 1u32..=6, surface in 0u8..=4,
                                 all in any::<bool>(), keep_crossing in any::<bool>()) {
            let keep = if all { Keep::All } else { Keep::Outside };
            let terms = terms(n, surface, keep, keep_crossing);
            // Crossing leaves deeper than the surface ask for nothing but the extra layer.
            let fit = |w: &&u64| word::side(**w) != Side::Crossing || word::level(**w) == surface;
            let words: Vec<u64> = words.iter().filter(fit).copied().collect();
            let found = check_tree(&Tree::of_words(&words), &terms);
            prop_assert_eq!(found.holds(), !thin(&words, &terms), "{}", found);
        }
    }
}
