//! What each check needs in a mesh to have anything to check. A check without its premise cannot fail, so it must not
//! count as one that holds.

use super::{CheckResult, Terms, kept};
use contract::manifest::{Keep, Sides};
use contract::tree::{DELETED, HOLES, Handle, Tree};
use contract::word::Side;

/// Why a check of sides has nothing to check in a mesh without them.
pub const UNKNOWN_SIDES: &str = "the sides of the leaves are unknown";

const CROSSING: u8 = 1 << Side::Crossing as u8;

/// The result of a check, marked if it has no findings because its premise is missing, and withdrawn if it was taken from
/// sides without a meaning. `tree` is the mesh, with the deleted crossing leaves where they are known; `base` is T0.
pub fn with_premise(
    result: CheckResult,
    tree: &Tree,
    base: Option<&Tree>,
    terms: &Terms,
) -> CheckResult {
    match result.holds() && result.was_run() {
        _ if lacks_sides(result.name, terms) => CheckResult::nothing(result.name, UNKNOWN_SIDES),
        true => CheckResult { nothing_to_check: missing(result.name, tree, base, terms), ..result },
        false => result,
    }
}

/// Whether a check needs the sides of the leaves, which are unknown.
fn lacks_sides(name: &str, terms: &Terms) -> bool {
    let deletes = terms.keep != Keep::All || !terms.keep_crossing;
    let needs = name == "sides" || name == kept::NAME || name == "complete" && deletes;
    terms.sides == Sides::Unknown && needs
}

/// Why a check had nothing to check; `None` if it had something, or if it has no premise.
fn missing(name: &str, tree: &Tree, base: Option<&Tree>, terms: &Terms) -> Option<String> {
    let kinds = tree.kinds(tree.root()) & !HOLES;
    let known = base.is_some();
    match name {
        "manifest" | "identical" => None,
        "complete" | "spacing" | "crossing" | "kept" if known => None,
        "sides" if known => {
            let all = base.map_or(0, |base| base.kinds(base.root()) & !HOLES);
            (all == CROSSING).then(|| "all leaves of T0 are crossing".to_owned())
        }
        _ if tree.root() == Handle::HOLE => Some("the mesh has no leaves".to_owned()),
        "spacing" if kinds & CROSSING == 0 && terms.boxes.is_empty() => {
            Some("no leaf is crossing, and there are no boxes".to_owned())
        }
        "sides" if kinds.count_ones() == 1 => Some("all leaves have the same side".to_owned()),
        "balance" => one_level(tree),
        "layer" if terms.layer_cells_min == 1 && !has_extra_layer(kinds, terms) => {
            Some("with n = 1 the layers are the 2:1 balance, which `balance` checks".to_owned())
        }
        "layer" => one_level(tree),
        _ => None,
    }
}

/// Whether the mesh shows deleted crossing leaves, which have a layer of their own for n = 1.
fn has_extra_layer(kinds: u8, terms: &Terms) -> bool {
    !terms.keep_crossing && kinds & (CROSSING | 1 << DELETED) != 0
}

fn one_level(tree: &Tree) -> Option<String> {
    let level = tree.finest_level(tree.root(), 0);
    let uniform = tree.coarsest_level(tree.root(), 0) >= level;
    uniform.then(|| format!("all leaves have level {level}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::Root;
    use contract::manifest::Enclosed;
    use contract::testing::words_of;

    fn terms(layer_cells_min: u32) -> Terms {
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        Terms {
            root,
            level_surface: 8,
            layer_cells_min,
            keep: Keep::All,
            keep_crossing: true,
            boxes: Vec::new(),
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
            sides: Sides::Known,
        }
    }

    #[test]
    fn a_mesh_of_one_cell_that_claims_level_8_gives_hardly_any_check_something_to_check() {
        let tree = Tree::of_words(&[0]);
        let names = ["spacing", "sides", "balance", "layer"];
        for result in names.into_iter().map(CheckResult::new) {
            let result = with_premise(result, &tree, None, &terms(4));
            assert!(!result.was_run(), "{result}");
        }
    }

    #[test]
    fn a_check_states_what_the_mesh_lacks() {
        let names = [
            "manifest",
            "identical",
            "complete",
            "spacing",
            "crossing",
            "kept",
            "sides",
            "balance",
            "layer",
        ];
        let of = |tree: &Tree, base: Option<&Tree>, terms: &Terms| {
            names.map(|name| missing(name, tree, base, terms).unwrap_or_default())
        };
        let (empty, uniform) = (Tree::default(), Tree::of_words(&words_of(|o| o.level < 1)));
        let crossing: Vec<u64> = words_of(|o| o.level < 1).iter().map(|w| w | 2).collect();
        let crossing = Tree::of_words(&crossing);
        let none = "the mesh has no leaves";
        assert_eq!(of(&empty, None, &terms(2)), ["", "", none, none, none, none, none, none, none]);
        assert_eq!(of(&empty, Some(&uniform), &terms(2)), ["", "", "", "", "", "", "", none, none]);
        let level = "all leaves have level 1";
        let (surface, side) =
            ("no leaf is crossing, and there are no boxes", "all leaves have the same side");
        assert_eq!(
            of(&uniform, None, &terms(2)),
            ["", "", "", surface, "", "", side, level, level]
        );
        let sides: Vec<u64> = words_of(|o| o.level < 1).iter().map(|w| w | w >> 61 & 1).collect();
        assert_eq!(of(&Tree::of_words(&sides), None, &terms(2))[6], "");
        let thin = "with n = 1 the layers are the 2:1 balance, which `balance` checks";
        assert_eq!(of(&crossing, None, &terms(1)), ["", "", "", "", "", "", side, level, thin]);
        let deletes = Terms { keep_crossing: false, ..terms(1) };
        assert_eq!(of(&crossing, None, &deletes), ["", "", "", "", "", "", side, level, level]);
        assert_eq!(of(&uniform, None, &deletes)[8], thin);
        let mut deleted = contract::tree::Builder::default();
        deleted.push_leaf(0, 0, DELETED).unwrap();
        let deleted = deleted.finish();
        assert_eq!(of(&deleted, None, &deletes)[8], "all leaves have level 0");
        assert_eq!(of(&deleted, None, &terms(1))[8], thin);
        let all = "all leaves of T0 are crossing";
        assert_eq!(
            of(&uniform, Some(&crossing), &terms(2)),
            ["", "", "", "", "", "", all, level, level]
        );
        let boxes = vec![contract::manifest::ExtentBox { min: [0; 3], max: [9; 3], level: 1 }];
        assert_eq!(of(&uniform, None, &Terms { boxes, ..terms(2) })[3], "");
    }

    #[test]
    fn a_finding_is_never_hidden() {
        let mut result = CheckResult::new("sides");
        result.report("wrong".to_owned());
        let result = with_premise(result, &Tree::of_words(&[0]), None, &terms(4));
        assert!(result.was_run() && !result.holds());
    }

    #[test]
    fn a_finding_from_unknown_sides_is_withdrawn() {
        let of = |name: &'static str, keep: Keep| {
            let mut result = CheckResult::new(name);
            result.report("wrong".to_owned());
            let terms = Terms { sides: Sides::Unknown, keep, ..terms(1) };
            with_premise(result, &Tree::of_words(&[0]), None, &terms).was_run()
        };
        assert!(!of("sides", Keep::All) && !of("kept", Keep::All) && of("balance", Keep::All));
        assert!(of("complete", Keep::All) && !of("complete", Keep::Outside));
    }

    #[test]
    fn layers_of_one_cell_are_left_to_the_balance() {
        let tree = Tree::of_words(&words_of(|o| o.level < 3 && o.corner == [0; 3]));
        let run = |n| missing("layer", &tree, None, &terms(n)).is_none();
        assert!(run(2) && !run(1) && missing("balance", &tree, None, &terms(1)).is_none());
    }
}
