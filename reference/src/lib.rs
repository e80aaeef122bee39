//! The serial algorithm of O'Connell and Karman, literally: the oracle of this workspace.
//!
//! A voxel tree is cut from the root wherever a facet crosses or an extent box asks for it
//! ([`tree`], [`crossing`]); a flood fill and six rays say which leaves are inside ([`sides`],
//! [`ray`]); the unwanted ones are deleted; from the finest level up, one enlarged extent box per
//! cell asks for its layer and one for its balance ([`gradation`]); what is left is written as leaf
//! words ([`leaves`]). Nothing here is fast: every step is the shortest statement of what
//! `DEFINITION.md` says.
#![deny(missing_docs)]

pub mod case;
pub mod case_file;
pub mod crossing;
pub mod error;
pub mod gradation;
pub mod lattice;
pub mod leaves;
pub mod octant;
pub mod ray;
pub mod sides;
pub mod stl;
pub mod tree;
pub mod write;

pub use case::{BoxSpec, Case, Keep, Root};
pub use error::Error;
pub use leaves::{digest, mix};
pub use octant::Side;
pub use sides::Ambiguous;

use lattice::{Input, LatticeBox};
use tree::Tree;

/// The leaves of a mesh, and what a reader of its manifest wants to know besides.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// One word per leaf, ascending.
    pub words: Vec<u64>,
    /// The level D that `spacing_min` asks for.
    pub level_surface: u32,
    /// The extent boxes, on the lattice.
    pub boxes: Vec<LatticeBox>,
    /// The components that no candidate decided, if there are any.
    pub ambiguous: Option<Ambiguous>,
}

/// The final mesh of a case.
///
/// # Errors
/// Whatever [`Input::new`] finds wrong with the case.
pub fn mesh(case: &Case) -> Result<Mesh, Error> {
    let input = Input::new(case)?;
    let (mut tree, ambiguous) = base(&input);
    tree.delete(|side| !case.keep.keeps(side));
    gradation::grade(&mut tree, &input);
    check(&tree);
    let words = tree.words(|side| case.keep_crossing || side != Side::Crossing);
    Ok(finished(words, input, ambiguous))
}

/// The base tree T0 of a case: all leaves with their sides, before deletion and gradation.
///
/// # Errors
/// Whatever [`Input::new`] finds wrong with the case.
pub fn base_tree(case: &Case) -> Result<Mesh, Error> {
    let input = Input::new(case)?;
    let (tree, ambiguous) = base(&input);
    Ok(finished(tree.words(|_| true), input, ambiguous))
}

fn base(input: &Input) -> (Tree, Option<Ambiguous>) {
    let mut tree = Tree::root();
    for extent_box in &input.boxes {
        tree.refine(&extent_box.extent, extent_box.level);
    }
    for facet in &input.facets {
        tree.insert(facet, input.level_surface);
    }
    let ambiguous = sides::assign(&mut tree, input);
    check(&tree);
    (tree, ambiguous)
}

fn check(tree: &Tree) {
    if cfg!(debug_assertions) {
        tree.check_invariants();
    }
}

fn finished(words: Vec<u64>, input: Input, ambiguous: Option<Ambiguous>) -> Mesh {
    assert!(words.is_sorted_by(|a, b| a < b), "a tree is walked in Morton order");
    Mesh { words, level_surface: input.level_surface, boxes: input.boxes, ambiguous }
}
