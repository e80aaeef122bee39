//! The fields of two manifests that differ, by their keys, with boxes and seeds in the user's units.

use contract::manifest::{ExtentBox, Manifest, Sides};
use serde_json::{Value, json};

/// The inputs.
const INPUTS: [&str; 9] = [
    "tree",
    "root",
    "level_surface",
    "layer_cells_min",
    "keep",
    "keep_crossing",
    "boxes",
    "seeds",
    "enclosed",
];
/// What follows from the sides.
const OF_SIDES: [&str; 3] = ["components", "components_ambiguous", "leaves_by_side"];

/// A manifest with its owner's name.
type Owned<'a> = (&'a str, &'a Manifest);

/// The differences of inputs, one line each, with names for the owners of both manifests.
pub fn differing_inputs(a: Owned, b: Owned) -> Vec<String> {
    let mut fields = compare(&INPUTS, a, b);
    if a.1.geometry.is_some() && b.1.geometry.is_some() {
        fields.extend(compare(&["geometry"], a, b));
    }
    fields
}

/// The differences of inputs and counts, one line each. What follows from the sides is left out if a mesh has none.
pub fn differing(a: &Manifest, b: &Manifest) -> Vec<String> {
    let (a, b) = (("A", a), ("B", b));
    let mut fields = differing_inputs(a, b);
    fields.extend(compare(&["leaves"], a, b));
    if a.1.sides == Sides::Known && b.1.sides == Sides::Known {
        fields.extend(compare(&OF_SIDES, a, b));
    }
    fields.extend(compare(&["leaves_by_level"], a, b));
    fields
}

fn compare(keys: &[&str], (owner_a, a): Owned, (owner_b, b): Owned) -> Vec<String> {
    let (a, b) = (stated(a), stated(b));
    let line = |key: &&str| {
        let (x, y) = (&a[*key], &b[*key]);
        (x != y).then(|| format!("{key}: {} in {owner_a}; {} in {owner_b}", text(x), text(y)))
    };
    keys.iter().filter_map(line).collect()
}

/// The manifest as JSON.
fn stated(manifest: &Manifest) -> Value {
    let root = &manifest.root;
    let user = |at: [i64; 3]| root.rounded(root.to_user(at));
    let mut stated = serde_json::to_value(manifest).expect("a manifest is representable in JSON");
    let extent = |b: &ExtentBox| json!({"min": user(b.min), "max": user(b.max), "level": b.level});
    stated["boxes"] = manifest.boxes.iter().map(extent).collect();
    stated["seeds"] = manifest.seeds.iter().map(|&seed| json!(user(seed))).collect();
    stated
}

/// A value without the quotes of a word.
fn text(value: &Value) -> String {
    match value {
        Value::Null => "not stated".to_owned(),
        Value::String(word) => word.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::manifest::{Components, Enclosed, Keep, Tree};
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn every_field_that_differs_is_listed_with_both_values() {
        let a = leaf_set(vec![words_of(|o| o.level < 1)]).manifest;
        assert_eq!(differing(&a, &a), [""; 0]);
        type Change = fn(&mut Manifest);
        let cases: [(Change, &str); 14] = [
            (|m| m.tree = Tree::Base, "tree: final in A; base in B"),
            (
                |m| m.root.edge = 3.0,
                r#"root: {"edge":8.0,"origin":[0.0,0.0,0.0]} in A; {"edge":3.0,"origin":[0.0,0.0,0.0]} in B"#,
            ),
            (|m| m.level_surface = 4, "level_surface: 0 in A; 4 in B"),
            (|m| m.layer_cells_min = 2, "layer_cells_min: 1 in A; 2 in B"),
            (|m| m.keep = Keep::Inside, "keep: all in A; inside in B"),
            (|m| m.keep_crossing = false, "keep_crossing: true in A; false in B"),
            (
                |m| m.boxes = vec![ExtentBox { min: [0; 3], max: [1 << 26; 3], level: 4 }],
                r#"boxes: [] in A; [{"level":4,"max":[4.0,4.0,4.0],"min":[0.0,0.0,0.0]}] in B"#,
            ),
            (|m| m.seeds = vec![[0, 1 << 24, 1 << 26]], "seeds: [] in A; [[0.0,1.0,4.0]] in B"),
            (|m| m.enclosed = Enclosed::Keep, "enclosed: delete in A; keep in B"),
            (|m| m.leaves = 7, "leaves: 8 in A; 7 in B"),
            (
                |m| m.components = Some(Components { outside: 3, ..Components::default() }),
                r#"components: not stated in A; {"enclosed":{"count":0,"example":null,"leaves":0},"inside":0,"outside":3} in B"#,
            ),
            (
                |m| m.components_ambiguous.count = 5,
                r#"components_ambiguous: {"count":0,"example":null} in A; {"count":5,"example":null} in B"#,
            ),
            (
                |m| m.leaves_by_side.inside = 2,
                r#"leaves_by_side: {"crossing":0,"inside":0,"outside":8} in A; {"crossing":0,"inside":2,"outside":8} in B"#,
            ),
            (
                |m| m.leaves_by_level[19] = 1,
                "leaves_by_level: [0,8,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0] in A; \
                 [0,8,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1] in B",
            ),
        ];
        for (change, line) in cases {
            let mut b = a.clone();
            change(&mut b);
            assert_eq!(differing(&a, &b), [line]);
        }
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
