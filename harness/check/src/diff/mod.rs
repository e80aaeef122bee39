//! Where two meshes differ: by their manifests first, then leaf by leaf in the first octant that
//! differs. Neither mesh is read as a whole, so a mesh of any size is compared in no time.
//!
//! Trusts the manifests' digests: that they are true to the leaves is for the check `manifest`.

pub mod rule;
mod witness;

use std::fmt::{self, Debug};
use std::path::Path;

use crate::checks::Terms;
use contract::case::Case;
use contract::leafset::{self, LeafDir, ReadError};
use contract::manifest::{Manifest, octant_index};
use contract::octant::Octant;
use contract::word;

/// How two leaf-set directories differ.
#[derive(Clone, Debug, Default)]
pub struct DiffReport {
    /// Manifest fields that differ, with both values.
    pub fields: Vec<String>,
    /// Level-3 octants whose digests differ.
    pub octants: Vec<Octant>,
    /// The first leaf that differs, both sides told.
    pub leaf: Option<String>,
    /// Which rule of the definition decides, and for whom.
    pub rules: Vec<String>,
}

/// Rules are looked for in meshes of up to so many leaves: that holds both in memory.
const LEAVES_RULED: u64 = 200_000_000;

impl DiffReport {
    /// Whether the leaves are the same.
    pub fn same_leaves(&self) -> bool {
        self.octants.is_empty()
    }
}

/// Octants told by path; the rest are counted.
const OCTANTS_LISTED: usize = 8;

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for field in &self.fields {
            writeln!(f, "{field}")?;
        }
        if self.same_leaves() {
            return write!(f, "the leaves are the same");
        }
        let paths: Vec<_> = self.octants.iter().take(OCTANTS_LISTED).map(Octant::path).collect();
        let more = if self.octants.len() > OCTANTS_LISTED { ", ..." } else { "" };
        let (count, paths) = (self.octants.len(), paths.join(", "));
        write!(f, "the leaves differ in {count} of 512 level-3 octants: {paths}{more}")?;
        match &self.leaf {
            Some(leaf) => {
                write!(f, "\n{leaf}")?;
                self.rules.iter().try_for_each(|rule| write!(f, "\n  rule: {rule}"))
            }
            None => {
                write!(f, "\nthe leaves there are the same: a manifest is not true to its files")
            }
        }
    }
}

/// Compares two leaf-set directories. With the case that both are meshes of, facets and rays help to decide.
pub fn diff(a: &Path, b: &Path, case: Option<&Case>) -> Result<DiffReport, ReadError> {
    let (a, b) = (leafset::open(a)?, leafset::open(b)?);
    let mut report = manifests(&a.manifest, &b.manifest);
    for i in octants_differing(&a.manifest, &b.manifest) {
        if let Some((x, y)) = first_difference(&a, &b, i)? {
            report.leaf = Some(rule::sides(x, y, &a.manifest.root));
            report.rules = rules(&a, &b, case, x, y)?;
            break;
        }
    }
    Ok(report)
}

/// Compares what two manifests say, digests included, and reads no leaf.
pub fn manifests(a: &Manifest, b: &Manifest) -> DiffReport {
    let octants = octants_differing(a, b).into_iter().map(level_3).collect();
    DiffReport { fields: fields(a, b), octants, ..DiffReport::default() }
}

/// Level-3 octants whose digests differ.
fn octants_differing(a: &Manifest, b: &Manifest) -> Vec<usize> {
    let digests = a.octant_digests.iter().zip(&b.octant_digests).enumerate();
    digests.filter(|(_, (x, y))| x != y).map(|(i, _)| i).collect()
}

/// The level-3 octant with this index.
fn level_3(index: usize) -> Octant {
    Octant { corner: word::corner_of((index as u64) << 48), level: 3 }
}

/// What was asked for, and what there is of it.
fn fields(a: &Manifest, b: &Manifest) -> Vec<String> {
    let mut fields = Vec::new();
    let mut same = |name: &str, x: &dyn Debug, y: &dyn Debug| {
        let (x, y) = (format!("{x:?}"), format!("{y:?}"));
        if x != y {
            fields.push(format!("{name}: {x} and {y}"));
        }
    };
    same("tree", &a.tree, &b.tree);
    same("root", &a.root, &b.root);
    same("level_surface", &a.level_surface, &b.level_surface);
    same("layer_cells_min", &a.layer_cells_min, &b.layer_cells_min);
    same("keep", &a.keep, &b.keep);
    same("keep_crossing", &a.keep_crossing, &b.keep_crossing);
    same("boxes", &a.boxes, &b.boxes);
    same("components_ambiguous", &a.components_ambiguous, &b.components_ambiguous);
    same("leaves", &a.leaves, &b.leaves);
    same("leaves_by_side", &a.leaves_by_side, &b.leaves_by_side);
    for (level, (x, y)) in a.leaves_by_level.iter().zip(&b.leaves_by_level).enumerate() {
        same(&format!("leaves of level {level}"), x, y);
    }
    fields
}

/// What two meshes hold where they differ first; nothing where one has no more leaves.
type Differing = (Option<u64>, Option<u64>);

/// The words that differ first in a level-3 octant, if any do.
fn first_difference(
    a: &LeafDir,
    b: &LeafDir,
    index: usize,
) -> Result<Option<Differing>, ReadError> {
    let (words_a, words_b) = (octant_words(a, index)?, octant_words(b, index)?);
    if words_a == words_b {
        return Ok(None);
    }
    let first = words_a.iter().zip(&words_b).take_while(|(x, y)| x == y).count();
    Ok(Some((words_a.get(first).copied(), words_b.get(first).copied())))
}

/// The rules that decide, for what was asked of mesh A.
fn rules(
    a: &LeafDir,
    b: &LeafDir,
    case: Option<&Case>,
    x: Option<u64>,
    y: Option<u64>,
) -> Result<Vec<String>, ReadError> {
    let wrong = |what: &str| Ok(vec![what.to_owned()]);
    if a.manifest.tree != b.manifest.tree {
        return wrong("nothing: one is a base tree, the other a final mesh");
    }
    if Terms::of_manifest(&a.manifest) != Terms::of_manifest(&b.manifest) {
        return wrong("section 1: the inputs were not the same");
    }
    if a.manifest.leaves + b.manifest.leaves > LEAVES_RULED {
        return wrong(
            "a rule that is not looked for: the meshes are too large to be held in memory",
        );
    }
    let (words_a, words_b) = (all_words(a)?, all_words(b)?);
    let terms = Terms::of_manifest(&a.manifest);
    Ok(rule::Dispute { a: &words_a, b: &words_b, terms: &terms, case }.rule(x, y))
}

/// All words of a mesh, sorted.
fn all_words(set: &LeafDir) -> Result<Vec<u64>, ReadError> {
    let mut words = Vec::new();
    for part in &set.parts {
        let read = part.read_all();
        words.extend(
            read.map_err(|e| ReadError::Part { path: part.path().to_owned(), source: e.into() })?,
        );
    }
    words.sort_unstable();
    Ok(words)
}

/// All words of a level-3 octant, from all parts, sorted.
fn octant_words(set: &LeafDir, index: usize) -> Result<Vec<u64>, ReadError> {
    let mut words = Vec::new();
    for part in &set.parts {
        let read = || -> std::io::Result<Vec<u64>> {
            let from = part.lower_bound((index as u64) << 55)?;
            // One past the last octant does not fit a word.
            let end = (index as u64 + 1).checked_mul(1 << 55);
            let until = end.map_or(Ok(part.len()), |end| part.lower_bound(end))?;
            let count = usize::try_from(until - from).expect("an octant fits the address space");
            let mut words = vec![0; count];
            part.read_at(from, &mut words)?;
            Ok(words)
        };
        let path = || part.path().to_owned();
        words.extend(read().map_err(|e| ReadError::Part { path: path(), source: e.into() })?);
    }
    debug_assert!(words.iter().all(|&w| octant_index(w) == index));
    words.sort_unstable();
    Ok(words)
}
