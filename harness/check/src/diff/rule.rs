//! The rule of reference/DEFINITION.md that decides which of two meshes is right at their first difference, as [`crate::why`] finds it.
//!
//! A split needs a cause: a facet or a box (section 3), or a chain of finer leaves to one (section 6), in which a needless split justifies no
//! other. Sides, and leaves that only one mesh has, are those of T0 of the case (sections 4, 5 and 7).

use crate::why::Mesh;
use crate::why::answer::{Answer, Cause, LOST};
use contract::octant::Octant;
use contract::tree::Kind;
use contract::word::{self, Side};

/// A mesh with its name.
type Named<'a> = (&'static str, &'a Mesh<'a>);

/// The rule at the first difference of two meshes of the same inputs.
pub(super) fn at(a: &Mesh, b: &Mesh, x: Option<u64>, y: Option<u64>) -> String {
    let (a, b) = (("A", a), ("B", b));
    let of = word::octant;
    match (x, y) {
        (Some(x), Some(y)) if of(x) == of(y) => side(&of(x), [x, y].map(word::side), a.1),
        (Some(x), Some(y)) if of(x).contains(&of(y)) => split(&of(x), a, b),
        (Some(x), Some(y)) if of(y).contains(&of(x)) => split(&of(y), b, a),
        (Some(x), Some(y)) if x > y => absence(y, b.0, a),
        (Some(x), _) => absence(x, a.0, b),
        (None, Some(y)) => absence(y, b.0, a),
        (None, None) => "none: the leaves are the same".to_owned(),
    }
}

/// What a mesh has at the centre of an octant.
fn of_centre(mesh: &Mesh, octant: &Octant) -> Answer {
    let centre = mesh.inputs.root.to_user(octant.centre());
    mesh.at(centre).expect("the centre of an octant is in the root")
}

/// The rule for an octant that has different sides.
fn side(octant: &Octant, [x, y]: [Side; 2], mesh: &Mesh) -> String {
    let Some((side, decision)) = of_centre(mesh, octant).side_decided_by else {
        return "section 4 (side): give the case file (--case) to decide it".to_owned();
    };
    let right = [(x, "A"), (y, "B")].into_iter().find(|(of, _)| *of == side);
    let right = right.map_or("neither", |(_, name)| name);
    format!("section 4 ({decision}): it is {side}, and {right} is right")
}

/// The rule for a leaf that the other mesh does not have in any form.
fn absence(leaf: u64, has: &str, (lacks, mesh): Named) -> String {
    if let Some(rule) = of_centre(mesh, &word::octant(leaf)).deleted_by {
        let right = if rule.ends_with(LOST) { has } else { lacks };
        return format!("{rule}: {right} is right");
    }
    let side = word::side(leaf);
    let is_kept = mesh.inputs.keeps(side as Kind);
    let (what, right) = if is_kept { ("kept", has) } else { ("deleted", lacks) };
    format!(
        "sections 5 and 7: a leaf that is {side} is {what}, so {right} is right, unless its component has another side or is \
         enclosed (give the case file: --case)"
    )
}

/// The rule for a leaf of a mesh that the other one has split.
fn split(octant: &Octant, (coarse, _): Named, (fine, mesh): Named) -> String {
    let what = format!("{coarse} has the leaf {octant}, {fine} has split it");
    let split = mesh.split(octant);
    let clauses = split.clauses(&mesh.inputs.root);
    let why = "a facet does (give the case file: --case)";
    if let Some(Cause { is_crossed, facets, boxes, .. }) = &split.cause {
        let is_label = *is_crossed && facets.is_empty() && boxes.is_empty();
        let caveat = if is_label { format!(", if {why}") } else { String::new() };
        return format!("{what} {}: {fine} is right{caveat}", clauses.join("; "));
    }
    let caveat = if mesh.knows_surface() { String::new() } else { format!(", unless {why}") };
    format!(
        "{what}: no facet, box, layer or balance requires the split, and refinement is minimal (sections 3 and 6): {coarse} \
         is right{caveat}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::truth::Truth;
    use crate::why;
    use contract::case::Case;
    use contract::manifest;
    use contract::tree::Tree;

    const ROOT: &str = "root = { origin = [-4.0, -4.0, -4.0], edge = 8.0 }";
    /// In octant 0.7.0, which has the level of the surface.
    const FACET: [[f32; 3]; 3] = [[-1.5, -1.5, -1.5], [-1.2, -1.5, -1.5], [-1.5, -1.2, -1.5]];

    fn case(keys: &str, facets: &[[[f32; 3]; 3]]) -> Case {
        Case::from_parts(&format!("spacing_min = 1.0\n{keys}\n{ROOT}"), facets.to_vec()).unwrap()
    }

    fn octant(path: &[u8]) -> Octant {
        path.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit))
    }

    /// The word of an outside leaf.
    fn leaf(path: &[u8]) -> u64 {
        word::encode(octant(path), Side::Outside)
    }

    /// The rule at the first difference of two meshes, whose case is given with `--case` or not.
    fn rule(case: &Case, is_given: bool, a: &[u64], b: &[u64]) -> String {
        let manifest = case.manifest(manifest::Tree::Final, "test".to_owned());
        let body = is_given.then(|| why::body(case, &manifest).unwrap());
        let trees = [a, b].map(Tree::of_words);
        let [of_a, of_b] = trees.each_ref().map(|tree| Mesh::of(&manifest, tree, body.as_ref()));
        let first = a.iter().zip(b).take_while(|(x, y)| x == y).count();
        at(&of_a, &of_b, a.get(first).copied(), b.get(first).copied())
    }

    /// T0 with these leaves split.
    fn split(case: &Case, paths: &[&[u8]]) -> Vec<u64> {
        let truth = Truth::of(case, &case.rules).unwrap();
        let mut words = truth.words;
        for path in paths {
            let i = words.iter().position(|&w| word::octant(w) == octant(path)).expect("a leaf");
            let side = word::side(words[i]);
            let child = |digit| word::encode(octant(path).child(digit), side);
            words.splice(i..=i, (0..8).map(child));
        }
        words
    }

    #[test]
    fn a_split_that_facets_layers_or_balance_require_is_right() {
        for given in [true, false] {
            for (n, expected) in [
                (
                    1,
                    "by section 6, step 3 (balance): it touches, 2 levels finer, the leaf octant 0.7.1 (level 3)",
                ),
                (2, "by section 6, step 2 (layer): it touches the leaf octant 0.7.1 (level 3)"),
            ] {
                let case = case(&format!("keep = 'all'\nlayer_cells_min = {n}"), &[FACET]);
                let text = rule(&case, given, &split(&case, &[]), &split(&case, &[&[1]]));
                assert!(
                    text.starts_with("A has the leaf octant 1 (level 1), B has split it"),
                    "{text}"
                );
                assert!(text.contains(expected) && text.contains(": B is right"), "{text}");
                let end = match given {
                    true => "section 3: facets that cross it: 0: B is right",
                    false => {
                        "the surface crosses it: B is right, if a facet does (give the case file: --case)"
                    }
                };
                assert!(text.ends_with(end), "{text}");
            }
        }
        let case = case("keep = 'all'", &[FACET]);
        let text = rule(&case, true, &[leaf(&[0])], &[leaf(&[0, 0])]);
        assert!(
            text.ends_with("split it by section 3: facets that cross it: 0: B is right"),
            "{text}"
        );
    }

    #[test]
    fn a_split_that_nothing_requires_is_wrong_also_where_it_makes_others_necessary() {
        let case = case("keep = 'all'\nlayer_cells_min = 1", &[FACET]);
        let graded: Vec<Vec<u8>> = (1..8).map(|digit| vec![digit]).collect();
        let mut paths: Vec<&[u8]> = graded.iter().map(Vec::as_slice).collect();
        let correct = split(&case, &paths);
        // The children of 1.7.7 require the split of 2 other octants; nothing requires that of 1.7.
        paths.extend([&[1, 7][..], &[1, 7, 7]]);
        let wrong = split(&case, &paths);
        for (a, b, right) in [(&correct, &wrong, "A"), (&wrong, &correct, "B")] {
            let text = rule(&case, true, a, b);
            assert!(
                text.contains("balance requires the split") && text.contains("octant 1.7"),
                "{text}"
            );
            assert!(text.ends_with(&format!("{right} is right")), "{text}");
        }
        // A leaf of the surface's level that a facet crosses need not be split.
        let text = rule(&case, true, &[leaf(&[0, 7, 0])], &[leaf(&[0, 7, 0, 0])]);
        assert!(text.contains("refinement is minimal"), "{text}");
        let hidden = super::tests::case("keep = 'all'\nkeep_crossing = false", &[FACET]);
        let text = rule(&hidden, false, &[leaf(&[1])], &[leaf(&[1, 0])]);
        assert!(
            text.ends_with("A is right, unless a facet does (give the case file: --case)"),
            "{text}"
        );
    }

    #[test]
    fn facets_and_rays_of_the_case_decide_on_sides() {
        let case = case("keep = 'all'", &[FACET]);
        let (at, far) = (leaf(&[0, 7, 0]), leaf(&[7]));
        let of = |a: u64, b: u64| rule(&case, true, &[a], &[b]);
        assert_eq!(
            of(at | 2, at),
            "section 4 (facets that cross it: 0): it is crossing, and A is right"
        );
        assert!(of(at, at | 2).ends_with("crossing, and B is right"));
        assert!(
            of(far | 1, far).ends_with("an even number of facets): it is outside, and B is right")
        );
        assert!(of(far | 1, far | 2).ends_with("it is outside, and neither is right"));
        let text = rule(&case, false, &[far | 1], &[far]);
        assert_eq!(text, "section 4 (side): give the case file (--case) to decide it");
    }

    #[test]
    fn a_leaf_of_one_mesh_only_is_right_if_no_rule_deletes_it() {
        let [a, b, c, d] = [[-3.0f32; 3], [3.5, -3.0, -3.0], [-3.0, 3.5, -3.0], [-3.0, -3.0, 3.5]];
        let body = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
        // Octant 0.7.0 is inside, and 7.7.7 outside.
        let (inside, outside) = (leaf(&[0, 7, 0]) | 1, leaf(&[7, 7, 7]));
        for (keep, right) in [("outside", "B"), ("inside", "A")] {
            let case = case(&format!("keep = '{keep}'"), &body);
            let text = rule(&case, true, &[inside, outside], &[outside]);
            assert!(text.ends_with(&format!("{right} is right")), "{keep}: {text}");
            let text = rule(&case, true, &[inside], &[inside, outside]);
            let right = if right == "A" { "A" } else { "B" };
            assert!(text.ends_with(&format!("{right} is right")), "{keep}: {text}");
        }
        let case = case("keep = 'outside'\nkeep_crossing = false", &body);
        let without = |word: u64| rule(&case, false, &[word], &[]);
        let text = |side, what, right| {
            format!(
                "sections 5 and 7: a leaf that is {side} is {what}, so {right} is right, unless"
            )
        };
        assert!(without(inside + 1).starts_with(&text("crossing", "deleted", "B")));
        assert!(without(inside).starts_with(&text("inside", "deleted", "B")));
        assert!(without(outside).starts_with(&text("outside", "kept", "A")));
    }
}
