//! The serial algorithm of O'Connell and Karman, implemented literally: the oracle of this
//! workspace.
//!
//! The root is refined wherever a facet crosses it or an extent box requires it ([`tree`],
//! [`crossing`]). A flood fill and either rays or seeds determine which leaves are inside, and so which of them are kept
//! ([`sides`], [`ray`]). Coarser base trees show what leaks ([`leaks`]). Leaves outside the kept region are deleted. For each level from the finest to the coarsest,
//! every cell refines two enlarged extent boxes, one for its layer and one for balance
//! ([`gradation`]). The remaining leaves are written as leaf words ([`leaves`], [`mod@write`]). Nothing
//! here is fast: each step is the shortest implementation of the corresponding section of
//! `DEFINITION.md`.
#![deny(missing_docs)]

pub mod case_file;
pub mod crossing;
pub mod error;
pub mod gradation;
pub mod lattice;
pub mod leaks;
pub mod leaves;
pub mod octant;
pub mod ray;
pub mod sides;
pub mod stl;
pub mod tree;
pub mod write;

pub use case_file::{BoxSpec, Case, Enclosed, Keep, Root};
pub use error::Error;
pub use leaks::Leak;
pub use leaves::{Geometry, digest, mix};
pub use octant::Side;
pub use sides::{Ambiguous, Components};

use lattice::{Input, LatticeBox, Seed};
use sides::Component;
use tree::Tree;

/// The leaves of a mesh, and the results that its manifest reports about them.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// One word per leaf, ascending.
    pub words: Vec<u64>,
    /// The level D of `spacing_min`.
    pub level_surface: u32,
    /// The extent boxes, on the lattice.
    pub boxes: Vec<LatticeBox>,
    /// The seeds, on the lattice.
    pub seeds: Vec<Seed>,
    /// The facets as read.
    pub geometry: Geometry,
    /// What is closed at a coarser spacing, and open at that of the mesh.
    pub leaks: Vec<Leak>,
    /// The numbers of components of T0.
    pub components: Components,
    /// The components that no candidate decided; `None` if every component was decided.
    pub ambiguous: Option<Ambiguous>,
}

/// The final mesh of a case.
///
/// # Errors
/// Those of [`Input::new`] and [`sides::assign`].
pub fn mesh(case: &Case) -> Result<Mesh, Error> {
    let input = Input::new(case)?;
    let (mut tree, components) = base(&input)?;
    let leaks = leaks::find(&tree, &input);
    sides::delete_the_rest(&mut tree, &input, &components);
    gradation::grade(&mut tree, &input);
    debug_check(&tree);
    let words = tree.words(|side| case.keep_crossing || side != Side::Crossing);
    Ok(Mesh::new(words, &tree, &components, leaks, input))
}

/// The base tree T0 of a case: all leaves with their sides, before deletion and gradation.
///
/// # Errors
/// Those of [`Input::new`] and [`sides::assign`].
pub fn base_tree(case: &Case) -> Result<Mesh, Error> {
    let input = Input::new(case)?;
    let (tree, components) = base(&input)?;
    let leaks = leaks::find(&tree, &input);
    Ok(Mesh::new(tree.words(|_| true), &tree, &components, leaks, input))
}

fn base(input: &Input) -> Result<(Tree, Vec<Component>), Error> {
    let mut tree = Tree::root();
    for extent_box in &input.boxes {
        tree.refine(&extent_box.extent, extent_box.level);
    }
    for facet in &input.facets {
        tree.insert(facet, input.level_surface);
    }
    let components = sides::assign(&mut tree, input, &input.seeds)?;
    debug_check(&tree);
    Ok((tree, components))
}

fn debug_check(tree: &Tree) {
    if cfg!(debug_assertions) {
        tree.check_invariants();
    }
}

impl Mesh {
    /// `components` are those of T0, from which `tree` may have been refined: an octant keeps its
    /// index.
    fn new(
        words: Vec<u64>,
        tree: &Tree,
        components: &[Component],
        leaks: Vec<Leak>,
        input: Input,
    ) -> Self {
        assert!(words.is_sorted_by(|a, b| a < b), "leaves are traversed in Morton order");
        Self {
            words,
            level_surface: input.level_surface,
            components: Components::of(tree, &input, components),
            ambiguous: Ambiguous::of(tree, &input, components),
            geometry: Geometry::of(&input.facets),
            leaks,
            boxes: input.boxes,
            seeds: input.seeds,
        }
    }
}
