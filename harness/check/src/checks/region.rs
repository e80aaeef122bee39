//! The promises `complete` and `sides`: exactly the region to be kept is meshed, and leaves have their sides.
//!
//! The region is found from the geometry, never from the mesh's own sides: the harness's exact rays give the side of
//! every largest octant that no facet comes near. Places within a band around the geometry are not judged, because
//! programs differ on the side of a cell that the geometry crosses; neither are places whose six rays disagree, which
//! exist around a body that is not watertight.

use super::facets::Facets;
use super::{CheckResult, Terms, contact};
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::tree::{Handle, Kind, Tree};
use contract::word::Side;

/// Where a place lies relative to the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    /// Within the band, or crossed.
    Near,
    /// Farther away, on this side.
    On(Side),
    /// Farther away, but the rays disagree.
    Undecided,
}

/// The leaves and holes of a mesh, with their positions.
pub struct Survey<'a> {
    /// The mesh.
    pub tree: &'a Tree,
    /// What the mesh must be.
    pub terms: &'a Terms,
    /// The geometry.
    pub facets: &'a Facets,
    /// Its rays.
    pub parity: &'a Parity,
    /// Half the width of the band, in cells of the surface level.
    pub band_cells: f64,
}

/// The band of `complete` for an engine that promises no sides, in cells of the surface level.
pub const BAND_CELLS: f64 = 1.0;

type Visit<'v> = &'v mut dyn FnMut(Octant, Option<Kind>, Position);

impl Survey<'_> {
    /// Checks that every leaf beyond the band has the side that the rays give.
    pub fn check_sides(&self) -> CheckResult {
        let mut result = CheckResult::new("sides");
        let mut undecided = 0u64;
        self.visit(&mut |octant, kind, position| match (kind, position) {
            (Some(kind), Position::On(side)) => {
                result.examined += 1;
                if kind != side as Kind {
                    result.report_with(|| {
                        let (given, leaf) = (contact::name(1 << kind), self.describe(&octant));
                        format!("rays show that the {given} leaf {leaf} is {side}")
                    });
                }
            }
            (Some(_), Position::Undecided) => undecided += 1,
            _ => {}
        });
        result.note = format!(
            "leaves beyond {} cells from the geometry; rays disagree on {undecided}",
            self.band_cells
        );
        self.unless_examined(result)
    }

    /// Checks that the leaves fill the region to be kept, and nothing else. A hole that the geometry crosses is a finding
    /// only if the band has no width.
    pub fn check_complete(&self) -> CheckResult {
        let mut result = CheckResult::new("complete");
        let exact = self.band_cells == 0.0 && self.terms.keep_crossing;
        self.visit(&mut |octant, kind, position| {
            let wanted = match position {
                Position::On(side) => Some(self.terms.keeps(side as Kind)),
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
        self.terms.root.describe(octant)
    }

    /// Visits every leaf, and every hole in the largest octants that have one position. Holes near the geometry are
    /// divided down to the level of the surface.
    fn visit(&self, visit: Visit) {
        self.descend(self.tree.root(), Octant::ROOT, &self.facets.all(), visit);
    }

    fn descend(&self, handle: Handle, octant: Octant, candidates: &[u32], visit: Visit) {
        let (low, high) = octant.bounds();
        let cell = (UNITS_PER_EDGE >> self.terms.level_surface) as f64;
        let band = (self.band_cells * cell) as i64;
        let near = self.facets.meeting(candidates, low.map(|c| c - band), high.map(|c| c + band));
        if near.is_empty() {
            return self.uniform(handle, octant, self.position(&octant), visit);
        }
        let kind = handle.as_leaf();
        if kind.is_some() || handle == Handle::HOLE && octant.level >= self.terms.level_surface {
            return visit(octant, kind, Position::Near);
        }
        for digit in 0..8 {
            let child = self.tree.child(handle, digit, octant.level);
            self.descend(child, octant.child(digit), &near, visit);
        }
    }

    /// Visits the leaves and holes of an octant that lies on one side.
    fn uniform(&self, handle: Handle, octant: Octant, position: Position, visit: Visit) {
        if !handle.is_node() {
            return visit(octant, handle.as_leaf(), position);
        }
        for digit in 0..8 {
            let child = self.tree.child(handle, digit, octant.level);
            self.uniform(child, octant.child(digit), position, visit);
        }
    }

    fn position(&self, octant: &Octant) -> Position {
        match self.parity.inside(octant.centre()) {
            [true, true, true, true, true, true] => Position::On(Side::Inside),
            [false, false, false, false, false, false] => Position::On(Side::Outside),
            _ => Position::Undecided,
        }
    }
}
