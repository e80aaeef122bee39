//! The fields of two manifests that differ, in words.

use contract::lattice::Root;
use contract::manifest::{BySide, Components, ExtentBox, Geometry, Manifest, Sides};
use serde::Serialize;
use std::fmt::Display;

/// The differences of inputs, one line each, with names for the owners of both manifests.
pub fn differing_inputs(a: (&str, &Manifest), b: (&str, &Manifest)) -> Vec<String> {
    let mut fields = Vec::new();
    let mut same =
        |name: &str, of: &dyn Fn(&Manifest) -> String| fields.extend(difference(name, a, b, of));
    same("tree", &|m| key(&m.tree));
    same("root", &|m| root(&m.root));
    same("level of the surface (from spacing_min)", &|m| m.level_surface.to_string());
    same("layer_cells_min", &|m| m.layer_cells_min.to_string());
    same("keep", &|m| key(&m.keep));
    same("keep_crossing", &|m| m.keep_crossing.to_string());
    same("boxes", &|m| list(m.boxes.iter().map(|extent| extent_box(extent, &m.root))));
    same("seeds", &|m| {
        list(m.seeds.iter().map(|&seed| point(m.root.rounded(m.root.to_user(seed)))))
    });
    same("enclosed", &|m| key(&m.enclosed));
    if a.1.geometry.is_some() && b.1.geometry.is_some() {
        same("geometry", &|m| geometry(m.geometry.as_ref()));
    }
    fields
}

/// The differences of inputs and counts, one line each. What follows from the sides is left out if a mesh has none.
pub fn differing(a: &Manifest, b: &Manifest) -> Vec<String> {
    let mut fields = differing_inputs(("A", a), ("B", b));
    let mut same = |name: &str, of: &dyn Fn(&Manifest) -> String| {
        fields.extend(difference(name, ("A", a), ("B", b), of));
    };
    same("leaves", &|m| m.leaves.to_string());
    if a.sides == Sides::Known && b.sides == Sides::Known {
        same("components", &|m| components(m.components.as_ref()));
        same("components decided by a majority of rays", &|m| {
            format!("{}{}", m.components_ambiguous.count, place(m.components_ambiguous.example))
        });
        same("leaves by side", &|m| by_side(&m.leaves_by_side));
    }
    for level in 0..a.leaves_by_level.len().max(b.leaves_by_level.len()) {
        same(&format!("leaves of level {level}"), &|m| m.leaves_by_level[level].to_string());
    }
    fields
}

fn difference(
    name: &str,
    (owner_a, a): (&str, &Manifest),
    (owner_b, b): (&str, &Manifest),
    of: &dyn Fn(&Manifest) -> String,
) -> Option<String> {
    let (x, y) = (of(a), of(b));
    (x != y).then(|| format!("{name}: {x} in {owner_a}; {y} in {owner_b}"))
}

/// The word of the case file for a value.
fn key(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        other => format!("{other:?}"),
    }
}

fn root(root: &Root) -> String {
    format!("{} with edge {}", point(root.origin), root.edge)
}

fn geometry(of: Option<&Geometry>) -> String {
    of.map_or(String::new(), |of| format!("{} facets with the digest {}", of.facets, of.digest))
}

fn extent_box(extent: &ExtentBox, root: &Root) -> String {
    let [min, max] = [extent.min, extent.max].map(|at| point(root.rounded(root.to_user(at))));
    format!("{min} to {max} at level {}", extent.level)
}

fn point([x, y, z]: [f64; 3]) -> String {
    format!("({x}, {y}, {z})")
}

/// Items with their number from 0, or the word for an empty list.
fn list(items: impl Iterator<Item: Display>) -> String {
    let items: Vec<String> = items.enumerate().map(|(i, item)| format!("{i}: {item}")).collect();
    if items.is_empty() { "none".to_owned() } else { items.join(", ") }
}

fn by_side(leaves: &BySide) -> String {
    let BySide { outside, inside, crossing } = leaves;
    format!("{outside} outside, {inside} inside, {crossing} crossing")
}

fn components(of: Option<&Components>) -> String {
    of.map_or("not stated".to_owned(), |of| {
        let (enclosed, leaves) = (of.enclosed.count, of.enclosed.leaves);
        let place = place(of.enclosed.example);
        format!(
            "{} outside ({enclosed} enclosed, of {leaves} leaves{place}), {} inside",
            of.outside, of.inside
        )
    })
}

/// A point of a component, after the text that precedes it.
fn place(example: Option<[f64; 3]>) -> String {
    example.map_or(String::new(), |at| format!(", one at {}", point(at)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::manifest::{Enclosed, EnclosedComponents, Keep, Tree};
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn every_field_that_differs_is_described_in_the_words_of_the_case_file() {
        let a = leaf_set(vec![words_of(|o| o.level < 1)]).manifest;
        assert_eq!(differing(&a, &a), [""; 0]);
        let enclosed = EnclosedComponents { count: 1, leaves: 9, example: Some([0.5, 1.0, 2.0]) };
        type Change = fn(&mut Manifest);
        let cases: [(Change, &str); 14] = [
            (|m| m.tree = Tree::Base, "tree: final in A; base in B"),
            (|m| m.root.edge = 3.0, "root: (0, 0, 0) with edge 8 in A; (0, 0, 0) with edge 3 in B"),
            (|m| m.level_surface = 4, "level of the surface (from spacing_min): 0 in A; 4 in B"),
            (|m| m.layer_cells_min = 2, "layer_cells_min: 1 in A; 2 in B"),
            (|m| m.keep = Keep::Inside, "keep: all in A; inside in B"),
            (|m| m.keep_crossing = false, "keep_crossing: true in A; false in B"),
            (
                |m| m.boxes = vec![ExtentBox { min: [0; 3], max: [1 << 26; 3], level: 4 }; 2],
                "boxes: none in A; 0: (0, 0, 0) to (4, 4, 4) at level 4, 1: (0, 0, 0) to (4, 4, 4) at level 4 in B",
            ),
            (|m| m.seeds = vec![[0, 1 << 24, 1 << 26]], "seeds: none in A; 0: (0, 1, 4) in B"),
            (|m| m.enclosed = Enclosed::Keep, "enclosed: delete in A; keep in B"),
            (|m| m.leaves = 7, "leaves: 8 in A; 7 in B"),
            (
                |m| {
                    m.components =
                        Some(Components { outside: 3, inside: 2, ..Components::default() })
                },
                "components: not stated in A; 3 outside (0 enclosed, of 0 leaves), 2 inside in B",
            ),
            (
                |m| m.components_ambiguous.count = 5,
                "components decided by a majority of rays: 0 in A; 5 in B",
            ),
            (
                |m| m.leaves_by_side.inside = 2,
                "leaves by side: 8 outside, 0 inside, 0 crossing in A; 8 outside, 2 inside, 0 crossing in B",
            ),
            (|m| m.leaves_by_level[19] = 1, "leaves of level 19: 0 in A; 1 in B"),
        ];
        for (change, line) in cases {
            let mut b = a.clone();
            change(&mut b);
            assert_eq!(differing(&a, &b), [line]);
        }
        let mut b = a.clone();
        b.components = Some(Components { outside: 3, inside: 2, enclosed });
        let line = "components: not stated in A; 3 outside (1 enclosed, of 9 leaves, one at (0.5, 1, 2)), 2 inside in B";
        assert_eq!(differing(&a, &b), [line]);
    }

    #[test]
    fn what_follows_from_sides_is_compared_only_if_both_meshes_have_them() {
        let a = leaf_set(vec![words_of(|o| o.level < 1)]).manifest;
        let mut b = a.clone();
        b.leaves_by_side.inside = 2;
        b.components_ambiguous.count = 1;
        assert_eq!(differing(&a, &b).len(), 2);
        b.sides = Sides::Unknown;
        assert_eq!((differing(&a, &b), differing(&b, &a)), (vec![], vec![]));
    }
}
