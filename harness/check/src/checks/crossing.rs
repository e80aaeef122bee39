//! Crossing leaves are exactly those that facets cross.
//!
//! Sections 2 and 7 of reference/DEFINITION.md. With T0: its crossing leaves are exactly the
//! crossed ones, and each leaf of the mesh is crossing iff the T0 leaf that it lies in is. Without
//! T0: no crossed leaf has another side, and each crossing leaf is crossed or, if finer than the
//! surface level, lies in an octant of that level that is. Misses: facets beyond the root, which
//! cross nothing; a crossed leaf missing altogether, which is for `complete`.

use super::facets::{Facets, Visit};
use super::{CheckResult, Subject, identical};
use contract::word::{self, Side};

const NAME: &str = "crossing";

/// Checks T0 and the mesh, or the mesh alone.
pub fn check(subject: &Subject) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    let facets = subject.facets();
    match subject.base {
        Some(base) => {
            let words = subject.sound(&base.words);
            exact(facets, &words, &mut result, &subject.terms.root);
            inherited(subject, &words, &mut result);
        }
        None => alone(subject, facets, &mut result),
    }
    result.examined = subject.mesh.words.len() as u64;
    result
}

/// Whether a word says that its leaf is crossing.
fn says_crossing(word: u64) -> bool {
    word & 3 == Side::Crossing as u64
}

/// Every leaf of T0 is crossing iff a facet crosses it.
fn exact(facets: &Facets, words: &[u64], result: &mut CheckResult, root: &contract::lattice::Root) {
    facets.walk(words, &mut |visit, _, crossed| {
        if let Visit::Leaf(i) = visit
            && crossed != says_crossing(words[i])
        {
            let what = if crossed { "a facet crosses" } else { "no facet crosses" };
            result.find_with(|| format!("{what} the T0 {}", identical::tell(words[i], root)));
        }
    });
}

/// Every leaf is crossing iff its T0 leaf is.
fn inherited(subject: &Subject, base: &[u64], result: &mut CheckResult) {
    for &w in &subject.sound(&subject.mesh.words) {
        let Some(from) = enclosing(base, w) else {
            continue;
        };
        if says_crossing(w) != says_crossing(from) {
            let side = word::side(from);
            let root = &subject.terms.root;
            result.find_with(|| {
                format!("in a T0 leaf that is {side} lies a {}", identical::tell(w, root))
            });
        }
    }
}

/// The leaf among sorted ones that is or encloses this one.
pub(super) fn enclosing(words: &[u64], leaf: u64) -> Option<u64> {
    let after = words.partition_point(|&w| word::key(w) <= word::key(leaf));
    let &w = words.get(after.checked_sub(1)?)?;
    let encloses = word::level(w) <= word::level(leaf)
        && word::key(leaf) < word::key(w) + word::span(word::level(w));
    encloses.then_some(w)
}

/// What can be said without T0.
fn alone(subject: &Subject, facets: &Facets, result: &mut CheckResult) {
    let words = subject.sound(&subject.mesh.words);
    let (surface, root) = (subject.terms.level_surface, &subject.terms.root);
    let mut crossed_at_surface = false;
    facets.walk(&words, &mut |visit, octant, crossed| {
        let Visit::Leaf(i) = visit else {
            if octant.level <= surface {
                crossed_at_surface = crossed && octant.level == surface;
            }
            return;
        };
        let descends = octant.level > surface && crossed_at_surface;
        if crossed && !says_crossing(words[i]) {
            result.find_with(|| format!("a facet crosses the {}", identical::tell(words[i], root)));
        } else if says_crossing(words[i]) && !crossed && !descends {
            result
                .find_with(|| format!("no facet crosses the {}", identical::tell(words[i], root)));
        }
    });
}
