//! The checks, one to a file: each says which promise of reference/DEFINITION.md it holds a mesh to,
//! and what it would miss.
//!
//! A check never trusts the program under test: what it needs it derives from the case, from the
//! leaves, and where one is given from the base tree T0 (whose own truth `spacing`, `crossing` and
//! `sides` establish).

use std::cell::OnceCell;
use std::fmt;

use self::facets::Facets;
use contract::case::Case;
use contract::lattice::Root;
use contract::leafset::{LeafSet, ReadError};
use contract::manifest::Keep;
use contract::tree::{Builder, GHOST, Tree};
use contract::word::{self, Side};

pub mod balance;
pub mod complete;
pub mod components;
pub mod contact;
pub mod crossing;
pub mod facets;
pub mod gap;
pub mod hanging;
pub mod identical;
pub mod layer;
pub mod linear;
pub mod manifest;
pub mod sides;
pub mod spacing;

/// Findings told in full; the rest are counted.
pub const FINDINGS_TOLD: usize = 20;

/// One violation, placed by path and coordinates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Which check found it.
    pub check: &'static str,
    /// What is wrong and where.
    pub detail: String,
}

/// What a check has to say about a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckResult {
    /// The check's name.
    pub name: &'static str,
    /// Things looked at: leaves, unless the note says otherwise.
    pub examined: u64,
    /// The first [`FINDINGS_TOLD`] findings.
    pub findings: Vec<Finding>,
    /// How many findings there were in all.
    pub findings_total: u64,
    /// Figures and limits worth telling even where all holds.
    pub note: String,
}

impl CheckResult {
    /// A check that has looked at nothing yet.
    pub fn new(name: &'static str) -> Self {
        Self { name, examined: 0, findings: Vec::new(), findings_total: 0, note: String::new() }
    }

    /// What `files` says of a directory that could not be read as a leaf set.
    pub fn unreadable(error: &ReadError) -> Self {
        let mut result = Self::new(FILES);
        result.find(error.to_string());
        result
    }

    /// Whether nothing was found.
    pub fn holds(&self) -> bool {
        self.findings_total == 0
    }

    /// Reports a violation.
    pub fn find(&mut self, detail: String) {
        self.find_with(|| detail);
    }

    /// Reports a violation whose text is costly: it is made only if it will be told.
    pub fn find_with(&mut self, detail: impl FnOnce() -> String) {
        self.findings_total += 1;
        if self.findings.len() < FINDINGS_TOLD {
            self.findings.push(Finding { check: self.name, detail: detail() });
        }
    }
}

impl fmt::Display for CheckResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match self.findings_total {
            0 => "holds".to_owned(),
            1 => "1 finding".to_owned(),
            n => format!("{n} findings"),
        };
        write!(f, "{:<10} {verdict}, {} examined", self.name, self.examined)?;
        if !self.note.is_empty() {
            write!(f, "; {}", self.note)?;
        }
        for finding in &self.findings {
            write!(f, "\n    {}", finding.detail)?;
        }
        let untold = self.findings_total - self.findings.len() as u64;
        if untold > 0 {
            write!(f, "\n    and {untold} more")?;
        }
        Ok(())
    }
}

/// Name of the check that a directory can be read as a leaf set at all.
pub const FILES: &str = "files";

/// The promises a mesh makes, as numbers: from its case, or in an audit from its manifest.
#[derive(Clone, Debug, PartialEq)]
pub struct Terms {
    /// The root cube, for coordinates in findings.
    pub root: Root,
    /// D.
    pub level_surface: u8,
    /// n.
    pub layer_cells_min: u32,
    /// Which side stays.
    pub keep: Keep,
    /// Whether crossing leaves stay.
    pub keep_crossing: bool,
    /// Extent boxes.
    pub boxes: Vec<contract::manifest::ExtentBox>,
}

impl Terms {
    /// What a case asks for.
    pub fn of_case(case: &Case) -> Self {
        Self {
            root: case.root,
            level_surface: case.level_surface,
            layer_cells_min: case.layer_cells_min,
            keep: case.keep,
            keep_crossing: case.keep_crossing,
            boxes: case.boxes.clone(),
        }
    }

    /// What a manifest claims was asked for.
    pub fn of_manifest(manifest: &contract::manifest::Manifest) -> Self {
        Self {
            root: manifest.root,
            level_surface: manifest.level_surface,
            layer_cells_min: manifest.layer_cells_min,
            keep: manifest.keep,
            keep_crossing: manifest.keep_crossing,
            boxes: manifest.boxes.clone(),
        }
    }

    /// Whether a box asks for leaves finer than the surface's. Gradation may then refine crossing
    /// leaves.
    pub fn boxes_beyond_surface(&self) -> bool {
        self.boxes.iter().any(|b| b.level > self.level_surface)
    }
}

/// A mesh, and all that its checks may look at.
pub struct Subject<'a> {
    /// What was asked for.
    pub case: &'a Case,
    /// The case's promises.
    pub terms: Terms,
    /// The final mesh.
    pub mesh: &'a LeafSet,
    /// T0, all leaves with sides.
    pub base: Option<&'a LeafSet>,
    /// What the mesh must equal.
    pub reference: Option<&'a LeafSet>,
    tree: OnceCell<Tree>,
    tree_base: OnceCell<Tree>,
    tree_with_ghosts: OnceCell<Tree>,
    facets: OnceCell<Facets>,
}

impl<'a> Subject<'a> {
    /// A mesh made from a case.
    pub fn new(case: &'a Case, mesh: &'a LeafSet) -> Self {
        Self {
            case,
            terms: Terms::of_case(case),
            mesh,
            base: None,
            reference: None,
            tree: OnceCell::new(),
            tree_base: OnceCell::new(),
            tree_with_ghosts: OnceCell::new(),
            facets: OnceCell::new(),
        }
    }

    /// The same with its base tree.
    pub fn with_base(self, base: &'a LeafSet) -> Self {
        Self {
            base: Some(base),
            tree_base: OnceCell::new(),
            tree_with_ghosts: OnceCell::new(),
            ..self
        }
    }

    /// The same with the mesh that it must equal.
    pub fn with_reference(self, reference: &'a LeafSet) -> Self {
        Self { reference: Some(reference), ..self }
    }

    /// The final mesh as a tree.
    pub fn tree(&self) -> &Tree {
        self.tree.get_or_init(|| Tree::of_words(&self.mesh.words))
    }

    /// T0 as a tree, where it is given.
    pub fn tree_base(&self) -> Option<&Tree> {
        self.base.map(|b| self.tree_base.get_or_init(|| Tree::of_words(&b.words)))
    }
}

impl Subject<'_> {
    /// The case's facets, prepared for crossing tests.
    pub(crate) fn facets(&self) -> &Facets {
        self.facets.get_or_init(|| Facets::new(&self.case.facets_lattice))
    }

    /// Of sorted words, those that are leaves and overlap none before them. A check that needs a
    /// linear mesh goes on with what there is; the rest is for `linear` to report.
    pub(crate) fn sound(&self, words: &[u64]) -> Vec<u64> {
        let mut builder = Builder::default();
        words.iter().copied().filter(|&w| builder.push(w).is_ok()).collect()
    }

    /// The final mesh with the deleted crossing leaves put back, where T0 tells them. They are as T0
    /// has them unless gradation from a box finer than D may have refined them: then they are ghosts.
    pub fn tree_with_ghosts(&self) -> &Tree {
        let Some(base) = self.base.filter(|_| !self.terms.keep_crossing) else {
            return self.tree();
        };
        self.tree_with_ghosts.get_or_init(|| {
            let crossing = Side::Crossing as u8;
            let kind = if self.terms.boxes_beyond_surface() { GHOST } else { crossing };
            let deleted = base.words.iter().filter(|&&w| (w & 3) as u8 == crossing);
            let ghosts = deleted.map(|&w| (w, kind));
            let mut all: Vec<_> = self.mesh.words.iter().map(|&w| (w, (w & 3) as u8)).collect();
            all.extend(ghosts);
            all.sort_unstable();
            let mut builder = Builder::default();
            for (w, kind) in all.into_iter().filter(|&(w, _)| word::fault(w).is_none()) {
                // What overlaps is for `linear` and `complete` to report.
                let _ = builder.push_leaf(word::key(w), word::level(w), kind);
            }
            builder.finish()
        })
    }
}

/// Every check there is, in the order in which their findings help most. `identical` is left out
/// where there is nothing to compare with.
pub fn all(subject: &Subject) -> Vec<CheckResult> {
    let mut results = vec![
        manifest::check(subject),
        linear::check(subject),
        complete::check(subject),
        spacing::check(subject),
        crossing::check(subject),
        sides::check(subject),
        balance::check(subject),
        layer::check(subject),
    ];
    results.extend(identical::check(subject));
    results
}
