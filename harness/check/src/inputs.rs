//! The inputs of two manifests that differ.

use contract::manifest::{ExtentBox, Manifest};
use serde_json::{Value, json};

/// The inputs, by their keys.
pub(crate) const INPUTS: [&str; 8] = [
    "root",
    "level_surface",
    "layer_cells_min",
    "keep",
    "keep_crossing",
    "boxes",
    "seeds",
    "enclosed",
];

/// A manifest with its owner's name.
type Owned<'a> = (&'a str, &'a Manifest);

/// The differences of inputs, one line each, with names for the owners of both manifests.
pub(crate) fn differing(a: Owned, b: Owned) -> Vec<String> {
    let geometry = a.1.geometry.is_some() && b.1.geometry.is_some();
    let keys = ["tree"].into_iter().chain(INPUTS).chain(geometry.then_some("geometry"));
    compare(&keys.collect::<Vec<_>>(), a, b)
}

/// The differences of these keys, one line each.
pub(crate) fn compare(keys: &[&str], (owner_a, a): Owned, (owner_b, b): Owned) -> Vec<String> {
    let (a, b) = (stated(a), stated(b));
    let text = |value: &Value| match value {
        Value::Null => "not stated".to_owned(),
        value => value.to_string(),
    };
    let line = |key: &&str| {
        let (x, y) = (&a[*key], &b[*key]);
        (x != y).then(|| format!("{key}: {} in {owner_a}; {} in {owner_b}", text(x), text(y)))
    };
    keys.iter().filter_map(line).collect()
}

/// The manifest as JSON, with boxes and seeds in the user's units.
fn stated(manifest: &Manifest) -> Value {
    let root = &manifest.root;
    let user = |at: [i64; 3]| root.rounded(root.to_user(at));
    let mut stated = serde_json::to_value(manifest).expect("a manifest is representable in JSON");
    let extent = |b: &ExtentBox| json!({"min": user(b.min), "max": user(b.max), "level": b.level});
    stated["boxes"] = manifest.boxes.iter().map(extent).collect();
    stated["seeds"] = manifest.seeds.iter().map(|&seed| json!(user(seed))).collect();
    stated
}
