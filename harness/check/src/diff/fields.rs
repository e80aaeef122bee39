//! The fields of two manifests that differ, in words.

use contract::manifest::{BySide, Components, Manifest, Sides};
use std::fmt::Debug;

/// The differences of inputs and counts, one line each. What follows from the sides is left out if a mesh has none.
pub fn differing(a: &Manifest, b: &Manifest) -> Vec<String> {
    let mut fields = Vec::new();
    let mut same = |name: &str, x: String, y: String| {
        if x != y {
            fields.push(format!("{name}: {x} and {y}"));
        }
    };
    same("tree", debug(&a.tree), debug(&b.tree));
    same("root", debug(&a.root), debug(&b.root));
    same("level_surface", debug(&a.level_surface), debug(&b.level_surface));
    same("layer_cells_min", debug(&a.layer_cells_min), debug(&b.layer_cells_min));
    same("keep", debug(&a.keep), debug(&b.keep));
    same("keep_crossing", debug(&a.keep_crossing), debug(&b.keep_crossing));
    same("boxes", debug(&a.boxes), debug(&b.boxes));
    same("seeds", debug(&a.seeds), debug(&b.seeds));
    same("enclosed", debug(&a.enclosed), debug(&b.enclosed));
    same("leaves", debug(&a.leaves), debug(&b.leaves));
    if a.sides == Sides::Known && b.sides == Sides::Known {
        same("components", components(a.components.as_ref()), components(b.components.as_ref()));
        let ambiguous = |mesh: &Manifest| {
            format!(
                "{}{}",
                mesh.components_ambiguous.count,
                place(mesh.components_ambiguous.example)
            )
        };
        same("components decided by a majority of rays", ambiguous(a), ambiguous(b));
        same("leaves by side", by_side(&a.leaves_by_side), by_side(&b.leaves_by_side));
    }
    for (level, (x, y)) in a.leaves_by_level.iter().zip(&b.leaves_by_level).enumerate() {
        same(&format!("leaves of level {level}"), debug(x), debug(y));
    }
    fields
}

fn debug(value: &dyn Debug) -> String {
    format!("{value:?}")
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
    example.map_or(String::new(), |[x, y, z]| format!(", one at ({x}, {y}, {z})"))
}
