//! The promises `complete` and `sides`: exactly the region to be kept is meshed, and leaves have their sides.
//!
//! The region is found from the geometry, never from the mesh's own sides: the harness builds the base tree of the surface,
//! and seeds or exact rays give the side of each of its components. Places within a band around the geometry are not
//! judged, because programs differ on the side of a cell that the geometry crosses; neither are places whose six rays
//! contradict each other or their component, which exist around a body that is not watertight.

#[cfg(test)]
mod tests;

use super::components::{self, Component};
use super::facets::Facets;
use super::{CheckResult, Terms, contact};
use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use contract::octant::Octant;
use contract::parity::Parity;
use contract::tree::{Handle, Kind, Tree};
use contract::word::{self, Leaf, Side};

/// Where a place lies relative to the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    /// Within the band, or crossed.
    Near,
    /// Farther away, on this side, in a component that is kept or not.
    On(Side, bool),
    /// Farther away, but the rays disagree.
    Undecided,
}

/// The components of the space that the geometry leaves free.
pub struct Space<'a> {
    terms: &'a Terms,
    facets: &'a Facets,
    parity: Parity,
    /// The leaves of the base tree.
    words: Vec<u64>,
    components: Vec<Component>,
    /// For every leaf, the index of its component; `None` if a facet crosses it.
    component_of: Vec<Option<u32>>,
}

impl<'a> Space<'a> {
    /// Finds the components.
    pub fn new(terms: &'a Terms, facets: &'a Facets, lattice: &[FacetLattice]) -> Self {
        let mut words = Vec::new();
        base_tree(facets, terms, Octant::ROOT, &facets.all(), &mut words);
        let components = components::find(&words, terms, lattice);
        let mut component_of = vec![None; words.len()];
        for (index, component) in (0..).zip(&components) {
            component.leaves.iter().for_each(|&leaf| component_of[leaf as usize] = Some(index));
        }
        Self { terms, facets, parity: Parity::new(lattice), words, components, component_of }
    }

    /// The position of an octant that no facet crosses.
    fn position(&self, octant: Octant) -> Position {
        let leaf = components::leaf_at(&self.words, octant.bounds().0);
        let Some(component) = leaf.and_then(|leaf| self.component_of[leaf]) else {
            return Position::Near;
        };
        let Component { side, ambiguous, enclosed, .. } = self.components[component as usize];
        let inside = side == Side::Inside;
        let agree = || self.parity.inside(octant.centre()) == [inside; 6];
        match ambiguous || self.terms.seeds.is_empty() && !agree() {
            true => Position::Undecided,
            false => Position::On(side, self.terms.keeps(side as Kind) && !enclosed),
        }
    }
}

/// Appends the leaves of the least tree that is fine enough for the surface and the boxes.
fn base_tree(
    facets: &Facets,
    terms: &Terms,
    octant: Octant,
    candidates: &[u32],
    words: &mut Vec<u64>,
) {
    let (low, high) = octant.bounds();
    let near = facets.meeting(candidates, low, high);
    let surface_splits = !near.is_empty() && octant.level < terms.level_surface;
    if !surface_splits && terms.box_that_splits(&octant).is_none() {
        let side = if near.is_empty() { Side::Outside } else { Side::Crossing };
        return words.push(word::encode(&Leaf { octant, side }));
    }
    (0..8).for_each(|digit| base_tree(facets, terms, octant.child(digit), &near, words));
}

/// The leaves and holes of a mesh, with their positions.
pub struct Survey<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// The space that it fills.
    pub space: &'a Space<'a>,
    /// Half the width of the band, in cells of the surface level.
    pub band_cells: f64,
}

/// The band of `complete` for an engine that promises no sides, in cells of the surface level.
pub const BAND_CELLS: f64 = 1.0;

type Visit<'v> = &'v mut dyn FnMut(Octant, Option<Kind>, Position);

impl Survey<'_> {
    /// Checks that every leaf beyond the band has its side.
    pub fn check_sides(&self) -> CheckResult {
        let mut result = CheckResult::new("sides");
        let mut undecided = 0u64;
        self.visit(&mut |octant, kind, position| match (kind, position) {
            (Some(kind), Position::On(side, _)) => {
                result.examined += 1;
                if kind != side as Kind {
                    result.report_with(|| {
                        let (given, leaf) = (contact::name(1 << kind), self.describe(&octant));
                        format!("the {given} leaf {leaf} is in a component that is {side}")
                    });
                }
            }
            (Some(_), Position::Undecided) => undecided += 1,
            _ => {}
        });
        result.note = format!(
            "leaves beyond {} cells from the geometry; {undecided} are not judged, because their rays disagree",
            self.band_cells
        );
        self.unless_examined(result)
    }

    /// Checks that the leaves fill the region to be kept, and nothing else. A hole that the geometry crosses is a finding
    /// only if the band has no width.
    pub fn check_complete(&self) -> CheckResult {
        let mut result = CheckResult::new("complete");
        let exact = self.band_cells == 0.0 && self.space.terms.keep_crossing;
        self.visit(&mut |octant, kind, position| {
            let wanted = match position {
                Position::On(_, kept) => Some(kept),
                Position::Near => (exact && kind.is_none()).then_some(true),
                Position::Undecided => None,
            };
            let Some(wanted) = wanted else { return };
            result.examined += 1;
            if wanted != kind.is_some() {
                let what = if wanted { "the mesh has a hole" } else { "a leaf must be deleted" };
                result.report_with(|| format!("{what}: {}", self.describe(&octant)));
            }
        });
        self.unless_examined(result)
    }

    fn unless_examined(&self, result: CheckResult) -> CheckResult {
        match result.examined {
            0 => CheckResult::nothing(
                result.name,
                format!("nothing lies beyond {} cells from the geometry", self.band_cells),
            ),
            _ => result,
        }
    }

    fn describe(&self, octant: &Octant) -> String {
        self.space.terms.root.describe(octant)
    }

    /// Visits every leaf, and every hole in the largest octants that have one position. Holes near the geometry are
    /// divided down to the level of the surface.
    fn visit(&self, visit: Visit) {
        self.descend(self.tree.root(), Octant::ROOT, &self.space.facets.all(), visit);
    }

    fn descend(&self, handle: Handle, octant: Octant, candidates: &[u32], visit: Visit) {
        let (low, high) = octant.bounds();
        let surface = self.space.terms.level_surface;
        let band = (self.band_cells * (UNITS_PER_EDGE >> surface) as f64) as i64;
        let (low, high) = (low.map(|c| c - band), high.map(|c| c + band));
        let near = self.space.facets.meeting(candidates, low, high);
        if near.is_empty() {
            return self.uniform(handle, octant, self.space.position(octant), visit);
        }
        let kind = handle.as_leaf();
        if kind.is_some() || handle == Handle::HOLE && octant.level >= surface {
            return visit(octant, kind, Position::Near);
        }
        for digit in 0..8 {
            let child = self.tree.child(handle, digit, octant.level);
            self.descend(child, octant.child(digit), &near, visit);
        }
    }

    /// Visits the leaves and holes of an octant that lies in one component.
    fn uniform(&self, handle: Handle, octant: Octant, position: Position, visit: Visit) {
        if !handle.is_node() {
            return visit(octant, handle.as_leaf(), position);
        }
        for digit in 0..8 {
            let child = self.tree.child(handle, digit, octant.level);
            self.uniform(child, octant.child(digit), position, visit);
        }
    }
}
