//! The differences of two meshes: of their inputs and counts, and of the leaves in the first octant that differs. If the sides of
//! one are unknown, only the cells are compared.
//!
//! All leaves are read once, to count and digest them, with memory for one buffer, from the parts or the tree; then the first octant of level 3 that
//! differs. Words that are not a linear oct-tree are refused.

#[cfg(test)]
mod tests;

mod rule;

use std::fmt;
use std::path::Path;

use crate::checks::identical::Named;
use crate::checks::manifest::{differing, differing_inputs};

use crate::why;
use contract::case::Case;
use contract::failure::Failure;
use contract::manifest::{Manifest, Sides};
use contract::mesh::Mesh;
use contract::octant::Octant;
use contract::word;

/// The differences of two leaf sets.
#[derive(Clone, Debug, Default)]
pub struct DiffReport {
    /// The mesh whose sides are unknown, so that only the cells were compared.
    pub without_sides: Option<&'static str>,
    /// Number of leaves of the first mesh.
    pub leaves: u64,
    /// Manifest fields that differ, with both values.
    pub fields: Vec<String>,
    /// Level-3 octants whose digests differ.
    pub octants: Vec<Octant>,
    /// The first difference of the leaves, with the leaves of both meshes.
    pub leaf: Option<String>,
    /// The rule of the definition that decides which mesh is right, or why none does.
    pub rule: Option<String>,
}

impl DiffReport {
    /// Whether the leaf words are the same.
    pub fn same_leaves(&self) -> bool {
        self.octants.is_empty()
    }

    /// Whether the meshes are the same: their leaves and, to the last bit, their roots.
    pub fn same_mesh(&self) -> bool {
        self.same_leaves() && !self.fields.iter().any(|field| field.starts_with("root: "))
    }
}

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(mesh) = self.without_sides {
            writeln!(f, "the sides of {mesh} are unknown: only the cells are compared")?;
        }
        self.fields.iter().try_for_each(|line| writeln!(f, "{line}"))?;
        match (self.same_leaves(), self.same_mesh()) {
            (true, true) => write!(f, "the leaves are the same ({} compared)", self.leaves)?,
            (true, false) => {
                write!(f, "the leaves are the same, but in other roots, so the cells differ")?
            }
            _ => write!(f, "the leaves differ in {} of 512 level-3 octants", self.octants.len())?,
        }
        self.leaf.iter().try_for_each(|leaf| write!(f, "\n{leaf}"))?;
        self.rule.iter().try_for_each(|rule| write!(f, "\n  rule: {rule}"))
    }
}

/// Compares two leaf-set directories, each with leaf words or the tree. If their common case is given, facets and rays help to decide which is right.
///
/// # Errors
/// If a directory cannot be read.
pub fn diff(a: &Path, b: &Path, case: Option<&Case>) -> Result<DiffReport, Failure> {
    let [mut a, mut b] = [Mesh::open(a)?, Mesh::open(b)?];
    let unknown = |(_, mesh): &(&str, &Mesh)| mesh.manifest.sides == Sides::Unknown;
    let without_sides = [("A", &a), ("B", &b)].into_iter().find(unknown).map(|(name, _)| name);
    let mask = if without_sides.is_some() { !word::SIDE_BITS } else { u64::MAX };
    for mesh in [&mut a, &mut b] {
        let mut manifest = mesh.manifest.clone();
        manifest.clear_leaves();
        mesh.visit(&mut |words| words.iter().for_each(|&word| manifest.add(word & mask)))?;
        manifest.finish();
        mesh.manifest = manifest;
    }
    let digests = a.manifest.octant_digests.iter().zip(&b.manifest.octant_digests);
    let differing = (0..).zip(digests).filter(|(_, (x, y))| x != y);
    let mut report = DiffReport {
        without_sides,
        leaves: a.manifest.leaves,
        fields: fields(("A", &a.manifest), ("B", &b.manifest)),
        octants: differing.map(|(index, _)| level_3(index)).collect(),
        ..DiffReport::default()
    };
    if let Some(octant) = report.octants.first() {
        let (of_a, of_b) = (a.octant(octant)?, b.octant(octant)?);
        let masked = |of: &Vec<u64>, at: usize| of.get(at).map(|word| word & mask);
        let mut pairs = (0..).map(|at| [masked(&of_a, at), masked(&of_b, at)]);
        let [x, y] = pairs.find(|[x, y]| x != y).expect("the digests of the octant differ");
        let root = a.manifest.root;
        let text = |word: Option<u64>| match word {
            None => "no more leaves".to_owned(),
            Some(word) if without_sides.is_none() => Named(word, root).to_string(),
            Some(word) => root.place(word::octant(word)).to_string(),
        };
        report.leaf = Some(format!("first difference:\n  A has {}\n  B has {}", text(x), text(y)));
        report.rule = without_sides.is_none().then(|| rule(&a, &b, case, [x, y]));
    }
    Ok(report)
}

/// The level-3 octant with this index.
fn level_3(index: u64) -> Octant {
    Octant { corner: word::corner_of(index << 48), level: 3 }
}

/// The rule that decides which mesh is right, or why none does, from the first words that differ; `None` for a mesh that has no more leaves.
fn rule(a: &Mesh, b: &Mesh, case: Option<&Case>, [x, y]: [Option<u64>; 2]) -> String {
    if !differing_inputs(("A", &a.manifest), ("B", &b.manifest)).is_empty() {
        return "none: the inputs differ as listed above, so both meshes may be right".to_owned();
    }
    let (body, caveat) = match case.map(|case| why::body(case, &a.manifest)).transpose() {
        Ok(body) => (body, String::new()),
        Err(why) => (None, format!("without the case, because {why}: ")),
    };
    let (of_a, of_b) = match (a.tree(), b.tree()) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(why), _) | (_, Err(why)) => return format!("unknown: {why}"),
    };
    let [a, b] = [(a, &of_a), (b, &of_b)]
        .map(|(mesh, tree)| why::Mesh::of(&mesh.manifest, tree, body.as_ref()));
    caveat + &rule::at(&a, &b, x, y)
}

/// The differences of inputs and counts, one line each. What follows from the sides is left out if a mesh has none.
fn fields(a: (&str, &Manifest), b: (&str, &Manifest)) -> Vec<String> {
    let mut counts = vec!["leaves", "leaves_by_level"];
    if [a, b].iter().all(|(_, manifest)| manifest.sides == Sides::Known) {
        counts.extend(["components", "components_ambiguous", "leaves_by_side"]);
    }
    let mut fields = differing_inputs(a, b);
    fields.extend(differing(&counts, a, b));
    fields
}
