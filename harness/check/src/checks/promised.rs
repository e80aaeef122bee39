//! The checks of promises that an engine makes instead of the definition. They need the leaves and the geometry only:
//! no base tree, no reference, and no sides.

use super::facets::Facets;
use super::region::{BAND_CELLS, Space, Survey};
use super::surface::Crossed;
use super::{CheckResult, Terms, balance, complete, layer, premise, spacing, with_premise};
use crate::promises::Promises;
use contract::case::Case;
use contract::manifest::{Keep, Sides};
use contract::tree::Tree;

/// Checks what is promised about a mesh, in the order in which findings are most helpful. Without a case, promises that
/// concern the geometry have nothing to check.
pub fn promised(
    tree: &Tree,
    terms: &Terms,
    case: Option<&Case>,
    promises: &Promises,
) -> Vec<CheckResult> {
    let facets = case.map(|case| Facets::new(&case.facets_lattice));
    let deletes = terms.keep != Keep::All || !terms.keep_crossing;
    let needs_space = promises.sides.is_some() || promises.complete && deletes;
    let space = case.zip(facets.as_ref()).filter(|_| needs_space);
    let space = space.map(|(case, facets)| Space::new(terms, facets, &case.facets_lattice));
    let band_cells = promises.sides.map_or(BAND_CELLS, |sides| sides.band_cells);
    let survey = space.as_ref().map(|space| Survey { tree, space, band_cells });
    let crossed = facets.as_ref().map(|facets| Crossed::new(facets, terms, promises.surface));
    let mut results = Vec::new();
    let noted = |result| with_premise(result, tree, None, terms);
    let without = |name| CheckResult::nothing(name, "the geometry is unknown without a case");
    if promises.complete {
        // If nothing is deleted, every hole is an error, and no geometry is needed to see it.
        results.push(match (&survey, deletes) {
            (_, false) => noted(complete::check_holes(tree, terms)),
            (Some(survey), _) => survey.check_complete(),
            (None, _) => without("complete"),
        });
    }
    if promises.surface.is_some() {
        results.push(crossed.as_ref().map_or_else(|| without("surface"), |c| c.check(tree)));
    }
    if promises.boxes {
        results.push(spacing::check_boxes(tree, terms));
    }
    if promises.sides.is_some() {
        let unknown = || CheckResult::nothing("sides", premise::UNKNOWN_SIDES);
        results.push(match &survey {
            _ if terms.sides == Sides::Unknown => unknown(),
            Some(survey) => survey.check_sides(),
            None => without("sides"),
        });
    }
    if let Some(touching) = promises.balance {
        let levels = promises.levels();
        results.push(noted(balance::check_touching(tree, &terms.root, touching, levels)));
    }
    if promises.layers {
        let labelled = crossed.map(|crossed| crossed.labelled(tree));
        results.push(noted(layer::check_tree(labelled.as_ref().unwrap_or(tree), terms)));
    }
    results
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn without_a_case_holes_are_judged_only_if_nothing_is_deleted() {
        let words = words_of(|o| o.level < 2);
        let manifest = leaf_set(vec![]).manifest;
        let promises = Promises { complete: true, ..Promises::default() };
        let result = |keep, keep_crossing, words: &[u64]| {
            let terms = Terms { keep, keep_crossing, ..Terms::of_manifest(&manifest) };
            let mut results = promised(&Tree::of_words(words), &terms, None, &promises);
            assert_eq!(results.len(), 1);
            let result = results.remove(0);
            (result.was_run(), result.findings_total > 0)
        };
        assert_eq!(result(Keep::All, true, &words), (true, false));
        assert_eq!(result(Keep::All, true, &words[1..]), (true, true));
        for (keep, keep_crossing) in [(Keep::All, false), (Keep::Outside, true)] {
            assert_eq!(result(keep, keep_crossing, &words[1..]), (false, false));
        }
    }
}
