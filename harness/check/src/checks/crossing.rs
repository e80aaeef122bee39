//! Crossing leaves are exactly those that facets cross.
//!
//! Sections 2 and 7 of reference/DEFINITION.md. With T0: a leaf of T0 is crossing iff a facet crosses it, and a
//! leaf of the mesh is crossing iff the T0 leaf that contains it is. Without T0: a leaf that a facet crosses is
//! crossing, and a crossing leaf is crossed or, if it is finer than the surface, lies in a crossed octant of
//! the surface's level. The check ignores facets outside the root, and does not detect a missing crossing leaf
//! (`complete` does).

use super::facets::{Facets, Visit};
use super::{CheckResult, Subject, components, identical, valid_leaves};
use contract::word::{self, Side};

const NAME: &str = "crossing";

/// Checks T0 and the mesh or, without T0, the mesh alone.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let facets = subject.facets();
    match subject.base {
        Some(base) => {
            let words = valid_leaves(&base.words);
            exact(facets, &words, &mut result, &subject.terms.root);
            let differs = |w, base| is_crossing(w) != is_crossing(base);
            inherited(subject, &words, &differs, &mut result);
        }
        None => without_base(subject, facets, &mut result),
    }
    result.examined = subject.mesh.words.len() as u64;
    result
}

/// Whether the side of a leaf is crossing.
fn is_crossing(word: u64) -> bool {
    word & 3 == Side::Crossing as u64
}

/// Every leaf of T0 is crossing iff a facet crosses it.
fn exact(facets: &Facets, words: &[u64], result: &mut CheckResult, root: &contract::lattice::Root) {
    facets.walk(words, &mut |visit, _, crossed| {
        if let Visit::Leaf(i) = visit
            && crossed != is_crossing(words[i])
        {
            let what = if crossed { "a facet crosses" } else { "no facet crosses" };
            result.report_with(|| format!("{what} the T0 {}", identical::describe(words[i], root)));
        }
    });
}

/// Reports every leaf of the mesh whose side differs from that of the T0 leaf that contains it.
pub(super) fn inherited(
    subject: &Subject,
    base: &[u64],
    differs: &dyn Fn(u64, u64) -> bool,
    result: &mut CheckResult,
) {
    let root = &subject.terms.root;
    for &w in &valid_leaves(&subject.mesh.words) {
        if let Some(from) = enclosing(base, w).map(|i| base[i])
            && differs(w, from)
        {
            result.report_with(|| {
                let (side, leaf) = (word::side(from), identical::describe(w, root));
                format!("a T0 leaf is {side}, but contains the {leaf}")
            });
        }
    }
}

/// The index of the one of some sorted leaves that equals or contains this leaf.
pub(super) fn enclosing(words: &[u64], leaf: u64) -> Option<usize> {
    let i = components::leaf_at(words, word::octant(leaf).bounds().0)?;
    (word::level(words[i]) <= word::level(leaf)).then_some(i)
}

/// Checks the mesh alone.
fn without_base(subject: &Subject, facets: &Facets, result: &mut CheckResult) {
    let words = valid_leaves(&subject.mesh.words);
    let (surface, root) = (subject.terms.level_surface, &subject.terms.root);
    let mut crossed_at_surface = false;
    facets.walk(&words, &mut |visit, octant, crossed| {
        let Visit::Leaf(i) = visit else {
            if octant.level <= surface {
                crossed_at_surface = crossed && octant.level == surface;
            }
            return;
        };
        let in_crossed = octant.level > surface && crossed_at_surface;
        if crossed && !is_crossing(words[i]) {
            result.report_with(|| {
                format!("a facet crosses the {}", identical::describe(words[i], root))
            });
        } else if is_crossing(words[i]) && !crossed && !in_crossed {
            result.report_with(|| {
                format!("no facet crosses the {}", identical::describe(words[i], root))
            });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::octant::Octant;
    use contract::testing::{leaf_set, words_with_sides};

    /// The facet lies in octant 0 of level 1, the surface's level, and there in its child 0. Leaves have level 2.
    #[test]
    fn without_a_base_tree_a_leaf_finer_than_the_surface_inherits_its_side() {
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let findings = |crossing: fn(&str) -> bool| {
            let side = |path: &str| if crossing(path) { Side::Crossing } else { Side::Outside };
            let words = words_with_sides(|o| o.level < 2, |o| Some(side(&o.path())));
            let mesh = leaf_set(vec![words]);
            let result = check(&Subject::new(&case, &mesh));
            assert_eq!(result.examined, 64);
            result.findings.into_iter().map(|finding| finding.detail).collect::<Vec<_>>()
        };
        assert_eq!(findings(|path| path.starts_with('0')), Vec::<String>::new());
        let [missing] = &findings(|path| path != "0.0" && path.starts_with('0'))[..] else {
            panic!("one finding")
        };
        assert!(missing.starts_with("a facet crosses the") && missing.contains("0.0"), "{missing}");
        let [spurious] = &findings(|path| path == "3.1" || path.starts_with('0'))[..] else {
            panic!("one finding")
        };
        assert!(
            spurious.starts_with("no facet crosses the") && spurious.contains("3.1"),
            "{spurious}"
        );
        // A leaf of the surface's level inherits nothing from the octant that precedes it.
        let is_crossing = |path: String| path.starts_with(['0', '1']);
        let side =
            |o: &Octant| Some(if is_crossing(o.path()) { Side::Crossing } else { Side::Outside });
        let mesh = leaf_set(vec![words_with_sides(|o| ["root", "0"].contains(&&*o.path()), side)]);
        let result = check(&Subject::new(&case, &mesh));
        let text = &result.findings[0].detail;
        assert!(result.findings_total == 1 && text.contains("octant 1 "), "{result}");
    }
}
