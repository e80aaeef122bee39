//! The promise `crossing`: crossing leaves are exactly those that facets cross. Of the definition, `sides` checks it.
//!
//! A leaf that a facet crosses is crossing, and a crossing leaf is crossed or, if it is finer than the surface, lies in a crossed octant
//! of the surface's level. There is no band: one facet in one point decides.
//! The check ignores facets outside the root, and does not detect a missing crossing leaf (`complete` does, if both are promised).

use super::{CheckResult, Subject, contact};
use contract::manifest::Sides;
use contract::tree::Kind;
use contract::word::Side;

const CROSSING: Kind = Side::Crossing as Kind;

pub(super) fn run(subject: &Subject, result: &mut CheckResult) {
    if subject.terms.sides == Sides::Unknown {
        return super::unknown_sides(subject, true, result);
    }
    let Some(truth) = subject.truth() else { return result.lacks(super::NO_GEOMETRY) };
    let surface = subject.terms.level_surface;
    truth.facets.leaves(subject.tree(), &mut |octant, kind, near| {
        let is_crossed = !near.is_empty();
        let inherits = || octant.level > surface && truth.is_crossed(&octant.ancestor(surface));
        if kind == CROSSING && !is_crossed && !inherits() || kind != CROSSING && is_crossed {
            let what = if is_crossed { "a facet crosses" } else { "no facet crosses" };
            let (given, leaf) = (contact::name(1 << kind), subject.terms.root.place(octant));
            result.report(format_args!("{what} the {given} leaf {leaf}"));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::manifest::Tree;
    use contract::octant::Octant;
    use contract::testing::{leaf_set, words_with_sides};

    /// The facet lies in octant 0 of level 1, the surface's level, and there in its child 0. Leaves have level 2.
    #[test]
    fn as_a_promise_of_its_own_a_leaf_finer_than_the_surface_inherits_its_side() {
        let check = |subject: Subject| {
            let crossing = crate::promises::Promises { crossing: true, ..Default::default() };
            let results = super::super::all(&subject.promising(&crossing));
            results.into_iter().find(|result| result.name == "crossing").unwrap()
        };
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let findings = |crossing: fn(&str) -> bool| {
            let side = |path: &str| if crossing(path) { Side::Crossing } else { Side::Outside };
            let words = words_with_sides(|o| o.level < 2, |o| Some(side(&o.path())));
            let mesh = leaf_set(vec![words]);
            let result = check(Subject::new(&case, Tree::Final, &mesh));
            assert_eq!(result.examined, 64);
            result.findings
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
        let result = check(Subject::new(&case, Tree::Final, &mesh));
        let text = &result.findings[0];
        assert!(result.findings_total == 1 && text.contains("octant 1 "), "{result}");
    }
}
