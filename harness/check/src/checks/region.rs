//! The promises `complete` and `sides`: exactly the region to be kept is meshed, and leaves have their sides.
//!
//! The region is found from the geometry, never from the mesh's own sides: [`Truth`] is the base tree of the surface,
//! and seeds or exact rays give the side of each of its components. Places within a band around the geometry are not
//! judged, because programs differ on the side of a cell that the geometry crosses; neither are places whose six rays
//! contradict each other or their component, which exist around a body that is not watertight. A leaf coarser than the surface level that
//! no facet crosses is judged by its parts beyond the band. A leaf that is labelled
//! crossing is wrong anywhere beyond the band. If the band has no width, every crossed leaf must be labelled so. If it has
//! none, or `crossing` is promised, crossed leaves are kept or deleted as the case says, without a band.

#[cfg(test)]
mod tests;

use super::components::Component;
use super::truth::Truth;
use super::{CheckResult, NO_GEOMETRY, Subject, contact};
use contract::lattice::UNITS_PER_EDGE;
use contract::manifest::Manifest;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::tree::{Handle, Kind, Tree};
use contract::word::Side;

/// Where a place lies relative to the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    /// Within the band; and whether a facet crosses it.
    Near { crossed: bool },
    /// Farther away, on this side, in a component that is kept or not.
    On(Side, bool),
    /// Farther away, but the rays disagree.
    Undecided,
}

const CROSSING: Kind = Side::Crossing as Kind;

/// The leaves and holes of a mesh, with their positions.
pub struct Survey<'a> {
    terms: &'a Manifest,
    tree: &'a Tree,
    truth: &'a Truth,
    parity: Parity,
    /// Half the width of the band, in cells of the surface level.
    band_cells: f64,
    /// Whether it is certain which leaves are crossing, in the band too.
    knows_crossing: bool,
}

/// The band of `complete` for an engine that promises no sides, in cells of the surface level.
const BAND_CELLS: f64 = 1.0;

impl<'a> Survey<'a> {
    /// Runs a check of a subject, if its geometry is known.
    pub fn of(subject: &'a Subject, result: &mut CheckResult, check: fn(&Self, &mut CheckResult)) {
        let Some((case, truth)) = subject.case.zip(subject.truth()) else {
            return result.lacks(NO_GEOMETRY);
        };
        let band_cells = subject.promises.sides.map_or(BAND_CELLS, |sides| sides.band_cells);
        let survey = Self {
            terms: &subject.terms,
            tree: subject.tree(),
            truth,
            parity: Parity::new(&case.facets_lattice),
            band_cells,
            knows_crossing: subject.promises.crossing || band_cells == 0.0,
        };
        check(&survey, result);
        let band = survey.band_cells;
        let why = "nothing with a certain side lies beyond";
        result.needs_objects(&format!("{why} {band} cells from the geometry"));
    }

    /// The position of an octant that no facet crosses.
    fn position(&self, octant: Octant) -> Position {
        let Some(component) = self.truth.component_at(&octant) else {
            return Position::Near { crossed: self.band_cells == 0.0 };
        };
        let &Component { side, enclosed, .. } = component;
        let inside = side == Side::Inside;
        let agree = || self.parity.inside(octant.centre()) == [inside; 6];
        match component.is_ambiguous() || self.terms.seeds.is_empty() && !agree() {
            true => Position::Undecided,
            false => Position::On(side, self.terms.keeps(side as Kind) && !enclosed),
        }
    }

    /// Checks that every leaf beyond the band has its side.
    pub fn check_sides(&self, result: &mut CheckResult) {
        let (mut undecided, has_band) = (0u64, self.band_cells > 0.0);
        self.visit(&mut |octant, kind, position| {
            let Some(kind) = kind else { return };
            let why = match position {
                Position::Near { .. } if has_band => return,
                Position::Undecided if kind != CROSSING => return undecided += 1,
                Position::Near { .. } if kind != CROSSING => "is crossed by a facet".to_owned(),
                Position::Undecided => "is crossed by no facet".to_owned(),
                Position::On(side, _) if kind != side as Kind => {
                    format!("is in a component that is {side}")
                }
                _ => return result.examined += 1,
            };
            result.examined += 1;
            let (given, leaf) = (contact::name(1 << kind), self.terms.root.place(octant));
            result.report(format_args!("the {given} leaf {leaf} {why}"));
        });
        result.note = format!(
            "leaves beyond {} cells from the geometry; {undecided} are not judged, because their rays disagree",
            self.band_cells
        );
    }

    /// Checks that the leaves fill the region to be kept, and nothing else.
    pub fn check_complete(&self, result: &mut CheckResult) {
        let mut undecided = 0u64;
        self.visit(&mut |octant, kind, position| {
            let wanted = match position {
                Position::On(_, kept) => kept,
                Position::Near { crossed: true } if self.knows_crossing => self.terms.keep_crossing,
                Position::Near { .. } => return,
                Position::Undecided => return undecided += 1,
            };
            result.examined += 1;
            if wanted != kind.is_some() {
                let what = if wanted { "the mesh has a hole" } else { "a leaf must be deleted" };
                result.report(format_args!("{what}: {}", self.terms.root.place(octant)));
            }
        });
        if undecided > 0 {
            let why = "leaves and holes are not judged, because their rays disagree";
            result.note = format!("{undecided} {why}");
        }
    }

    /// Visits every leaf, and every hole in the largest octants that have one position. Holes near the geometry are
    /// divided down to the level of the surface.
    fn visit(&self, visit: &mut dyn FnMut(Octant, Option<Kind>, Position)) {
        let surface = self.terms.level_surface;
        self.truth.facets.walk(self.band(), &mut |octant, near| {
            let handle = self.tree.at(&octant);
            let kind = handle.as_leaf();
            if near.is_empty() {
                let position = self.position(octant);
                self.tree.walk_below(octant, handle, &mut |part, content| {
                    if !content.is_node() {
                        visit(part, content.as_leaf(), position);
                    }
                    true
                });
                return false;
            }
            let is_whole = kind.is_some() || handle == Handle::HOLE && octant.level >= surface;
            if is_whole {
                let crossed = self.truth.facets.meeting(near, &octant, 0).next().is_some();
                let may_be_coarse = !crossed && octant.level < surface;
                let beyond = may_be_coarse.then(|| self.beyond_band(octant, near)).flatten();
                visit(octant, kind, beyond.unwrap_or(Position::Near { crossed }));
            }
            !is_whole
        });
    }

    /// Half the width of the band, in lattice units.
    fn band(&self) -> i64 {
        (self.band_cells * (UNITS_PER_EDGE >> self.terms.level_surface) as f64) as i64
    }

    /// The position of a part beyond the band of an octant that no facet crosses. All of it lies on one side.
    fn beyond_band(&self, octant: Octant, candidates: &[u32]) -> Option<Position> {
        let near: Vec<u32> = self.truth.facets.meeting(candidates, &octant, self.band()).collect();
        if near.is_empty() {
            return Some(self.position(octant));
        }
        let children = if octant.level < self.terms.level_surface { 0..8 } else { 0..0 };
        children.map(|digit| octant.child(digit)).find_map(|part| self.beyond_band(part, &near))
    }
}
