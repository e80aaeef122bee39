//! The rule of reference/DEFINITION.md that decides which of two meshes is right at their first difference.
//!
//! If one mesh has a leaf that the other has split, something must require the split: a facet or a box (section
//! 3), or a finer leaf nearby (section 6), which is the witness. If both meshes have the witness, it decides.
//! If only the mesh with the split has it, the witness itself is disputed, and the search continues there.
//! Gradation goes from fine to coarse, so the search ends at the first difference in the order of the
//! definition.
//!
//! Crossing leaves that were deleted after gradation are in neither mesh and cannot be witnesses. The text
//! mentions this where it is possible.

#[cfg(test)]
mod tests;

use crate::checks::Terms;
use crate::checks::identical::describe;
use contract::case::Case;
use contract::manifest::Keep;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::tree::Kind;
use contract::triangle::Triangle;
use contract::word::{self, Leaf, Side};

/// Maximum number of disputed witnesses: refinement needs at most one step per level.
const STEPS_MAX: usize = 20;

/// Two meshes with their inputs.
pub struct Dispute<'a> {
    /// Words of mesh A, sorted.
    pub a: &'a [u64],
    /// Words of mesh B, sorted.
    pub b: &'a [u64],
    /// Their common requirements.
    pub terms: &'a Terms,
    /// Their common case, if it is known.
    pub case: Option<&'a Case>,
}

/// One of the two meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mesh {
    A,
    B,
}

impl Mesh {
    pub(super) fn name(self) -> char {
        if self == Self::A { 'A' } else { 'B' }
    }

    pub(super) fn other(self) -> Self {
        if self == Self::A { Self::B } else { Self::A }
    }
}

/// The reason why an octant must be split, as text.
enum Reason {
    /// The inputs or a leaf of both meshes require the split.
    Decided(String),
    /// This leaf requires the split, but only the mesh with the split has it.
    Disputed(String, Octant),
    /// Nothing requires the split.
    None,
}

impl Dispute<'_> {
    /// The rules that decide at the first difference, given by the words of both meshes.
    pub fn rule(&self, a: Option<u64>, b: Option<u64>) -> Vec<String> {
        let leaf = |word: u64| word::decode(word).expect("the words that are compared are leaves");
        match (a.map(leaf), b.map(leaf)) {
            (Some(a), Some(b)) if a.octant == b.octant => vec![self.side(&a, &b)],
            (Some(a), Some(b)) if a.octant.contains(&b.octant) => self.split(Mesh::A, a),
            (Some(a), Some(b)) if b.octant.contains(&a.octant) => self.split(Mesh::B, b),
            (Some(a), Some(b)) if word::encode(&a) > word::encode(&b) => {
                vec![self.absence(Mesh::B, &b)]
            }
            (Some(a), _) => vec![self.absence(Mesh::A, &a)],
            (None, Some(b)) => vec![self.absence(Mesh::B, &b)],
            (None, None) => Vec::new(),
        }
    }

    /// The rule for an octant that has different sides.
    fn side(&self, a: &Leaf, b: &Leaf) -> String {
        let crossing = a.side == Side::Crossing || b.side == Side::Crossing;
        if !crossing && let Some((side, why)) = self.side_by_seeds(Mesh::A, a) {
            return format!("{why}: {} is right", if a.side == side { "A" } else { "B" });
        }
        let Some(case) = self.case else {
            return "section 4 (side): give the case file (--case) to decide it".into();
        };
        if let Some(facet) = crossed_by(&a.octant, case) {
            let right = if a.side == Side::Crossing { "A" } else { "B" };
            return format!(
                "section 4: facet {facet} crosses it, so it is crossing: {right} is right"
            );
        }
        if !self.terms.seeds.is_empty() {
            return "section 4: no facet crosses it, so the seeds decide".into();
        }
        let rays = Parity::new(&case.facets_lattice).inside(a.octant.centre());
        let inside = rays.iter().filter(|&&inside| inside).count();
        let text = format!("section 4: no facet crosses it, and {inside} of its 6 rays are inside");
        let side = match inside {
            0 => Side::Outside,
            6 => Side::Inside,
            _ => return format!("{text}: another candidate of its component decides"),
        };
        // The first candidate whose rays agree determines the side of the component. The rays of other leaves
        // can differ only if the body is not watertight.
        let right = [(a, "A"), (b, "B")].into_iter().find(|(leaf, _)| leaf.side == side);
        match right {
            Some((_, name)) => format!("{text}: {name} is right, if the body is watertight"),
            None => format!("{text}: neither is right, if the body is watertight"),
        }
    }

    /// The rule for a leaf that the other mesh does not have in any form.
    fn absence(&self, mesh: Mesh, leaf: &Leaf) -> String {
        let (has, lacks, side) = (mesh.name(), mesh.other().name(), leaf.side);
        let kept = self.terms.keeps(side as Kind);
        let keep = format!("{:?}", self.terms.keep).to_lowercase();
        if side != Side::Crossing
            && let Some(rule) = self.kept_or_deleted(mesh, leaf)
        {
            return rule;
        }
        match (side, kept) {
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

    /// The rules for a leaf that the other mesh has split, one for each disputed witness.
    fn split(&self, mut mesh: Mesh, mut leaf: Leaf) -> Vec<String> {
        let mut rules = Vec::new();
        let mut visited = vec![leaf.octant];
        for _ in 0..STEPS_MAX {
            let (coarse, fine) = (mesh.name(), mesh.other().name());
            let what = format!("{coarse} has the leaf {}, {fine} has split it", leaf.octant);
            let (why, witness) = match self.reason(mesh, &leaf) {
                Reason::Disputed(why, witness) => (why, witness),
                Reason::Decided(why) => {
                    rules.push(format!("{what}: {why}: {fine} is right"));
                    return rules;
                }
                Reason::None => {
                    rules.push(format!(
                        "{what}: nothing in either mesh requires the split, and refinement is minimal (sections 3 and 6): \
                         {coarse} is right{}",
                        self.caveat()
                    ));
                    return rules;
                }
            };
            rules.push(format!("{what}: {why}, which {coarse} does not have"));
            let Some((next_mesh, next)) = self.disputed_leaf(mesh, &witness) else {
                rules.push(format!(
                    "{coarse} has no leaf at {witness}: section 5 decides, or a leaf was lost"
                ));
                return rules;
            };
            if visited.contains(&next.octant) {
                return rules;
            }
            visited.push(next.octant);
            (mesh, leaf) = (next_mesh, next);
        }
        rules
    }

    /// The leaf that one mesh has split and the other has not, at a witness that mesh `mesh` does not have: a
    /// coarser leaf of `mesh`, or a coarser leaf of the other mesh where `mesh` has finer ones.
    fn disputed_leaf(&self, mesh: Mesh, witness: &Octant) -> Option<(Mesh, Leaf)> {
        if let Some(leaf) = self.ancestor_leaf(mesh, witness) {
            return Some((mesh, leaf));
        }
        let leaf = self.ancestor_leaf(mesh.other(), witness)?;
        self.has_within(mesh, witness).then_some((mesh.other(), leaf))
    }

    /// A restriction of the statement that nothing requires a split.
    fn caveat(&self) -> &'static str {
        match (self.terms.keep_crossing, self.case) {
            (false, _) => ", unless a crossing leaf that was deleted afterwards does",
            (_, None) if self.terms.keep != Keep::All => {
                ", unless a facet does (give the case file: --case)"
            }
            _ => "",
        }
    }

    /// The reason why this leaf of one mesh must be split.
    fn reason(&self, mesh: Mesh, leaf: &Leaf) -> Reason {
        let octant = &leaf.octant;
        if octant.level < self.terms.level_surface {
            let d = self.terms.level_surface;
            if let Some(facet) = self.case.and_then(|case| crossed_by(octant, case)) {
                return Reason::Decided(format!(
                    "section 3: facet {facet} crosses it, so it has level >= D = {d}"
                ));
            }
            if self.case.is_none() && leaf.side == Side::Crossing {
                return Reason::Decided(format!(
                    "section 3: it is crossing, so it has level >= D = {d}"
                ));
            }
        }
        if let Some(b) = self.terms.box_that_splits(octant) {
            return Reason::Decided(format!(
                "section 3: it meets the box {:?} to {:?}, so it has level >= {}",
                b.min, b.max, b.level
            ));
        }
        let Some((word, undisputed)) = self.witness(mesh, octant) else { return Reason::None };
        let source = word::octant(word);
        let why =
            format!("{}, by the leaf {source}", self.requires(&source, octant).unwrap_or_default());
        match undisputed {
            true => Reason::Decided(format!("{why}, which both have")),
            false => Reason::Disputed(why, source),
        }
    }
}

/// Index of the first facet that crosses an octant.
fn crossed_by(octant: &Octant, case: &Case) -> Option<usize> {
    case.facets_lattice.iter().position(|facet| {
        let (low, high) = octant.bounds();
        Triangle::new(facet).meets(low, high)
    })
}

/// The leaves of both meshes at the first difference, as text.
pub fn leaves(
    a: Option<u64>,
    b: Option<u64>,
    sides_known: bool,
    root: &contract::lattice::Root,
) -> String {
    let text = |word: Option<u64>| match word {
        None => "no more leaves".to_owned(),
        Some(word) if sides_known => describe(word, root),
        Some(word) => root.describe(&word::octant(word)),
    };
    format!("first difference:\n  A has {}\n  B has {}", text(a), text(b))
}
