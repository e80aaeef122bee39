//! The rule of reference/DEFINITION.md that decides which of two meshes is right at their first difference, as [`crate::why`] finds it.
//!
//! A split needs a cause: a facet or a box (section 3), or a chain of finer leaves to one (section 6), in which a needless split justifies no
//! other. Sides, and leaves that only one mesh has, are those of T0 of the case (sections 4, 5 and 7).

use crate::checks::Terms;
use crate::checks::identical::describe;
use crate::why::Mesh;
use crate::why::answer::LOST;
use contract::lattice::Root;
use contract::octant::Octant;
use contract::tree::Kind;
use contract::word::{self, Leaf, Side};

/// Two meshes with their common inputs.
pub(super) struct Dispute<'a> {
    /// The meshes, in which needless splits justify nothing.
    pub a: Mesh<'a>,
    pub b: Mesh<'a>,
    pub terms: &'a Terms,
}

/// A mesh with its name.
type Named<'a> = (&'static str, &'a Mesh<'a>);

impl Dispute<'_> {
    /// The rule at the first difference, given by the words of both meshes.
    pub(super) fn rule(&self, x: Option<u64>, y: Option<u64>) -> String {
        let leaf = |word: u64| word::decode(word).expect("the words that are compared are leaves");
        let (a, b) = (("A", &self.a), ("B", &self.b));
        match (x.map(leaf), y.map(leaf)) {
            (Some(x), Some(y)) if x.octant == y.octant => self.side(&x, &y),
            (Some(x), Some(y)) if x.octant.contains(&y.octant) => split(&x.octant, a, b),
            (Some(x), Some(y)) if y.octant.contains(&x.octant) => split(&y.octant, b, a),
            (Some(x), Some(y)) if word::encode(&x) > word::encode(&y) => self.absence(&y, b, a),
            (Some(x), _) => self.absence(&x, a, b),
            (None, Some(y)) => self.absence(&y, b, a),
            (None, None) => "none: the leaves are the same".to_owned(),
        }
    }

    /// The rule for an octant that has different sides.
    fn side(&self, x: &Leaf, y: &Leaf) -> String {
        let centre = self.terms.root.to_user(x.octant.centre());
        let answer = self.a.at(centre).expect("the centre of an octant is in the root");
        let Some(reason) = answer.side_decided_by else {
            return "section 4 (side): give the case file (--case) to decide it".to_owned();
        };
        let right = [(x, "A"), (y, "B")].into_iter().find(|(leaf, _)| leaf.side == reason.side);
        let right = right.map_or("neither", |(_, name)| name);
        format!("section 4: {}, so it is {}: {right} is right", reason.decision, reason.side)
    }

    /// The rule for a leaf that the other mesh does not have in any form.
    fn absence(&self, leaf: &Leaf, (has, _): Named, (lacks, mesh): Named) -> String {
        let centre = self.terms.root.to_user(leaf.octant.centre());
        let answer = mesh.at(centre).expect("the centre of an octant is in the root");
        if let Some(rule) = answer.deleted_by {
            let right = if rule.ends_with(LOST) { has } else { lacks };
            return format!("{rule}: {right} is right");
        }
        let (keep, side) = (format!("{:?}", self.terms.keep).to_lowercase(), leaf.side);
        match (side, self.terms.keeps(side as Kind)) {
            (Side::Crossing, false) => {
                format!("section 7: keep_crossing is false, so {has} must not have a crossing leaf")
            }
            (_, false) => {
                format!("section 5: keep is {keep}, so {has} must not have a leaf that is {side}")
            }
            _ => format!(
                "section 5: keep is {keep}, so a leaf that is {side} is kept; {lacks} lost the leaf, or gave its \
                 component another side (section 4)"
            ),
        }
    }
}

/// The rule for a leaf of a mesh that the other one has split.
fn split(octant: &Octant, (coarse, _): Named, (fine, mesh): Named) -> String {
    let what = format!("{coarse} has the leaf {octant}, {fine} has split it");
    let clauses = mesh.split(octant).clauses();
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

/// The leaves of both meshes at the first difference, as text.
pub(super) fn leaves(a: Option<u64>, b: Option<u64>, sides_known: bool, root: &Root) -> String {
    let text = |word: Option<u64>| match word {
        None => "no more leaves".to_owned(),
        Some(word) if sides_known => describe(word, root),
        Some(word) => root.describe(&word::octant(word)),
    };
    format!("first difference:\n  A has {}\n  B has {}", text(a), text(b))
}

#[cfg(test)]
mod tests;
