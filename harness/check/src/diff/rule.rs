//! The rule of reference/DEFINITION.md that decides which of two meshes is right at their first difference, as [`crate::why`] finds it.
//!
//! A split needs a cause: a facet or a box (section 3), or a chain of finer leaves to one (section 6), in which a needless split justifies no
//! other. Sides, and leaves that only one mesh has, are those of T0 of the case (sections 4, 5 and 7).

use crate::why::Mesh;
use crate::why::answer::{Answer, LOST};
use contract::octant::Octant;
use contract::tree::Kind;
use contract::word::{self, Leaf};

/// A mesh with its name.
type Named<'a> = (&'static str, &'a Mesh<'a>);

/// The rule at the first difference of two meshes of the same inputs, in which needless splits justify nothing.
pub(super) fn at(a: &Mesh, b: &Mesh, x: Option<u64>, y: Option<u64>) -> String {
    let leaf = |word: u64| word::decode(word).expect("the words that are compared are leaves");
    let (a, b) = (("A", a), ("B", b));
    match (x.map(leaf), y.map(leaf)) {
        (Some(x), Some(y)) if x.octant == y.octant => side(&x, &y, a.1),
        (Some(x), Some(y)) if x.octant.contains(&y.octant) => split(&x.octant, a, b),
        (Some(x), Some(y)) if y.octant.contains(&x.octant) => split(&y.octant, b, a),
        (Some(x), Some(y)) if word::encode(&x) > word::encode(&y) => absence(&y, b.0, a),
        (Some(x), _) => absence(&x, a.0, b),
        (None, Some(y)) => absence(&y, b.0, a),
        (None, None) => "none: the leaves are the same".to_owned(),
    }
}

/// What a mesh has at the centre of an octant.
fn of_centre(mesh: &Mesh, octant: &Octant) -> Answer {
    let centre = mesh.inputs.root.to_user(octant.centre());
    mesh.at(centre).expect("the centre of an octant is in the root")
}

/// The rule for an octant that has different sides.
fn side(x: &Leaf, y: &Leaf, mesh: &Mesh) -> String {
    let answer = of_centre(mesh, &x.octant);
    let Some(reason) = answer.side_decided_by else {
        return "section 4 (side): give the case file (--case) to decide it".to_owned();
    };
    let right = [(x, "A"), (y, "B")].into_iter().find(|(leaf, _)| leaf.side == reason.side);
    let right = right.map_or("neither", |(_, name)| name);
    format!("section 4 ({}): it is {}, and {right} is right", reason.decision, reason.side)
}

/// The rule for a leaf that the other mesh does not have in any form.
fn absence(leaf: &Leaf, has: &str, (lacks, mesh): Named) -> String {
    if let Some(rule) = of_centre(mesh, &leaf.octant).deleted_by {
        let right = if rule.ends_with(LOST) { has } else { lacks };
        return format!("{rule}: {right} is right");
    }
    let (what, right) = match mesh.inputs.keeps(leaf.side as Kind) {
        true => ("kept", has),
        false => ("deleted", lacks),
    };
    format!(
        "sections 5 and 7: a leaf that is {} is {what}, so {right} is right, unless its component has another side or is \
         enclosed (give the case file: --case)",
        leaf.side
    )
}

/// The rule for a leaf of a mesh that the other one has split.
fn split(octant: &Octant, (coarse, _): Named, (fine, mesh): Named) -> String {
    let what = format!("{coarse} has the leaf {octant}, {fine} has split it");
    let clauses = mesh.split(octant).clauses(&mesh.inputs.root);
    if !clauses.is_empty() {
        return format!("{what} {}: {fine} is right", clauses.join("; "));
    }
    let caveat = match mesh.knows_surface() {
        true => "",
        false => ", unless a facet does (give the case file: --case)",
    };
    format!(
        "{what}: no facet, box, layer or balance requires the split, and refinement is minimal (sections 3 and 6): {coarse} \
         is right{caveat}"
    )
}

#[cfg(test)]
mod tests;
