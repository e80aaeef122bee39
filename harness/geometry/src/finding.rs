//! The findings of a diagnosis: kinds, counts and places, and what each kind means for the mesh.

use contract::lattice::UNITS_PER_EDGE;
use contract::number::number;
use contract::octant::LEVEL_MAX;
use serde::Serialize;

use super::input::Input;
use super::tree::bounds;

/// Cells within which a gap holds one of them wherever it lies in the lattice: 2 if it is parallel to a face of the lattice, and this across
/// its diagonal.
pub const RESOLVED: f64 = 4.0 / 1.732;

/// Kinds of findings, in the order of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Connected sets of edges with one facet, apart from T-junctions.
    Openings,
    /// Edges with three, five, ... facets.
    NonManifoldOdd,
    /// Pairs of facets that traverse their common edge, which has no other facet, in the same direction.
    Winding,
    /// Closed shells of consistent winding that enclose a negative volume, apart from [`Self::Nested`] ones.
    InsideOut,
    /// Closed shells, also up to T-junctions, that lie in an odd number of others.
    Nested,
    /// Facets without area with a corner, or the middle of an edge, on no facet with area.
    Stray,
    /// Facets with the three vertices of an earlier facet, in any order. The kinds below count copies of the same winding once.
    Duplicates,
    /// Pairs of facets whose interiors share a point on the lattice; duplicates are not among them.
    Intersections,
    /// Facets with two solids, four, ... on their inner side.
    Overlaps,
    /// Facets with an opposite facet on the inner side, but not of another solid, less than [`RESOLVED`] cells away, or one if that side is
    /// not meshed; by rays.
    ThinWalls,
    /// The same on the outer side.
    ThinGaps,
    /// Facets with a coordinate near which f32 numbers are more than half a cell apart.
    Rounded,
    /// Facets with a point beyond the root.
    OutsideRoot,
    /// Facets within the root with a point on its boundary.
    TouchingRoot,
}

/// The place of a finding.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// Facets by number, counting from 0, at most [`Place::FACETS_MAX`].
    pub facets: Vec<u32>,
    /// Number of further facets.
    pub facets_more: usize,
    /// A point nearby, in the user's units.
    pub at: [f64; 3],
    /// Openings: free width; thin walls and gaps: distance of the facets, which a twentieth of their area undercuts. In the user's units.
    pub width: Option<f64>,
    /// Openings: whether the width is an upper bound, because the rim is not flat.
    pub is_bound: bool,
}

impl Place {
    /// Maximum number of facets listed for one place.
    pub const FACETS_MAX: usize = 8;

    /// A place without sizes.
    pub fn new(mut facets: Vec<u32>, at: [f64; 3]) -> Self {
        let facets_more = facets.len().saturating_sub(Self::FACETS_MAX);
        facets.truncate(Self::FACETS_MAX);
        Self { facets, facets_more, at, ..Self::default() }
    }
}

/// All findings of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The kind.
    pub kind: Kind,
    /// Number of occurrences.
    pub count: u64,
    /// Number of occurrences that can change the mesh's region.
    pub count_changing: u64,
    /// Whether the search ended before all were counted, so that `count` is a lower bound.
    pub is_lower_bound: bool,
    /// The effect on the mesh; empty where nothing was found.
    pub meaning: String,
    /// The first places: widest openings, one of a sheet, deep before shallow intersections, lowest facet numbers.
    pub places: Vec<Place>,
}

impl Finding {
    /// A finding that has not occurred yet.
    pub fn new(kind: Kind) -> Self {
        let (meaning, places) = (String::new(), Vec::new());
        Self { kind, count: 0, count_changing: 0, is_lower_bound: false, meaning, places }
    }

    /// A finding at each facet of which this holds.
    pub fn at(kind: Kind, input: &Input, first: usize, holds: impl Fn(u32) -> bool) -> Self {
        let mut finding = Self::new(kind);
        for facet in (0..input.case.facets.len() as u32).filter(|&facet| holds(facet)) {
            finding.add(first, || Place::new(vec![facet], input.centroid(facet)));
        }
        finding
    }

    /// Counts one occurrence and lists its place if it is among the first.
    pub fn add(&mut self, first: usize, place: impl FnOnce() -> Place) {
        self.count += 1;
        if self.places.len() < first {
            self.places.push(place());
        }
    }
}

impl Kind {
    /// Whether every occurrence can change the mesh's region. Openings, nested shells, duplicates and intersections are judged one by one.
    pub fn changes_region(self, input: &Input) -> bool {
        match self {
            Self::NonManifoldOdd => {
                input.are_seeds_beyond != Some(true) || input.case.keep_crossing
            }
            Self::Overlaps => input.are_overlaps_meshed(),
            Self::Stray | Self::Rounded | Self::OutsideRoot => true,
            Self::ThinWalls => input.is_meshed(true),
            Self::ThinGaps => input.is_meshed(false),
            _ => false,
        }
    }

    /// Heading and effect on the mesh.
    #[rustfmt::skip]
    pub(super) fn row(self) -> (&'static str, &'static str) {
        match self {
            Self::Openings => ("openings",
                "Inside and outside become one component where a cell fits through."),
            Self::NonManifoldOdd => ("edges with 3, 5, ... facets",
                "Rays on either side of such an edge disagree about the inside, so a component's side may be wrong or ambiguous. Crossing leaves on a wall within the body stay unless keep_crossing is false."),
            Self::Winding => ("neighbours, opposite winding",
                "No effect: no decision uses a facet's orientation. Thin walls and thin gaps may be confused or missed at these facets."),
            Self::InsideOut => ("closed shells inside out",
                "No effect, but normals point inward: other programs may exchange inside and outside."),
            Self::Nested => ("closed shells in other shells",
                "Rays count both surfaces, so the interior of the inner one is outside: right for a cavity. It is deleted if the outside is kept, unless enclosed = keep, a seed lies in it or the root cuts it, and its crossing leaves stay unless keep_crossing is false. Remove the inner shell if it was meant as a solid."),
            Self::Stray => ("facets without area, apart",
                "They cross every leaf that they touch like the others, and leave holes in the flow where crossing leaves are deleted. Remove them."),
            Self::Duplicates => ("duplicate facets",
                "A ray counts every copy: an even number is passed as if the surface were open, so a component's side may be wrong. Keep one of the copies where the body ends, and none within it: two are a wall in the inside."),
            Self::Intersections => ("intersecting pairs of facets",
                "Where two closed shells overlap by more than a cell, the overlap is outside, and deleted like a cavity that the root does not cut. Where they touch, there is a wall in the inside. Crossing leaves stay in both unless keep_crossing is false. Unite the shells if that is not meant."),
            Self::Overlaps => ("facets within another solid",
                "A ray counts the surfaces of both, so where two solids overlap is outside, and deleted like a cavity that the root does not cut, but crossing leaves stay unless keep_crossing is false. Unite them if that is not meant."),
            Self::ThinWalls => ("facets of thin walls",
                "Into a wall narrower than a cell no cell fits, and into a wider one only in some positions and directions: it may consist of crossing leaves, without an inside."),
            Self::ThinGaps => ("facets at thin gaps",
                "Into a gap narrower than a cell no cell fits, and into a wider one only in some positions and directions, so that no flow may pass. The wedge along the line where two shells intersect is a gap, too."),
            Self::Rounded => ("facets with rounded vertices",
                "Coordinates are f32 numbers, which are more than half a cell apart so far from the origin: the body has steps. Move it to the origin before its vertices are rounded."),
            Self::OutsideRoot => ("facets beyond the root",
                "The root cuts the body, whose facets beyond it rays still count. Enlarge the root if the body is to be meshed whole."),
            Self::TouchingRoot => ("facets on the root's boundary",
                "No leaf exists on the far side of these facets, and no flow passes between the body and the root's boundary there. With keep = outside, a cavity that is open there alone is flow, unless seeds leave it out: harness leak lists it."),
        }
    }
}

/// Facets with a coordinate near which f32 numbers are more than half a cell apart.
pub fn rounded(input: &Input, first: usize) -> Finding {
    Finding::at(Kind::Rounded, input, first, |facet| {
        let corners = input.case.facets[facet as usize];
        let far = corners.as_flattened().iter().fold(0f32, |far, c| far.max(c.abs()));
        let cell = input.cell_in(&bounds(&[corners])).unwrap_or(f64::INFINITY);
        f64::from(far.next_up() - far) > cell / 2.0
    })
}

/// Facets with a point beyond the root, and facets that touch the root's boundary from within; on the lattice.
pub fn at_root(input: &Input, first: usize) -> [Finding; 2] {
    let mut findings = [Kind::OutsideRoot, Kind::TouchingRoot].map(Finding::new);
    for (facet, corners) in (0..).zip(&input.case.facets_lattice) {
        let margins = corners.as_flattened().iter().map(|&c| c.min(UNITS_PER_EDGE - c));
        let at = match margins.fold(i64::MAX, i64::min) {
            ..0 => 0,
            0 => 1,
            1.. => continue,
        };
        findings[at].add(first, || Place::new(vec![facet], input.centroid(facet)));
    }
    findings
}

/// The effect of a finding that occurs at least once.
pub fn meaning(finding: &Finding, input: &Input) -> String {
    let (_, meaning) = finding.kind.row();
    let width = finding.places.first().and_then(|place| place.width).unwrap_or(0.0);
    let finest = input.case.root.edge_of(LEVEL_MAX);
    match finding.kind {
        Kind::NonManifoldOdd | Kind::Duplicates | Kind::Intersections | Kind::Overlaps
            if input.are_seeds_beyond == Some(true) && finding.count_changing == 0 =>
        {
            "No effect: seeds and not rays say what is flow, and all of them lie beyond the body.".into()
        }
        Kind::Openings if width < finest => {
            "All are narrower than the finest cell of the root, so crossing leaves close them at every spacing.".into()
        }
        Kind::Openings if input.cell.is_none() || finding.count_changing == 0 => format!(
            "Crossing leaves close an opening that is narrower than a cell; at a spacing of {} or less the widest may leak. Where the rim is not flat, less may pass than its width: harness leak measures it. {meaning}",
            number(width)
        ),
        // A straight chain of cells, each connected to the next by a face, fits into a round opening wider than 2 sqrt(3) cells.
        Kind::Openings => format!(
            "At least one cell wide, by an upper bound where the rim is not flat, and where a box is finer one of its cells: {} of {}, the widest {}. {meaning} Below 3.5 cells that \
             depends on the position in the lattice. Close it or mesh with a greater spacing, in the box if one is finer. Where the rim is not flat, less may pass than its width: harness leak measures it. The rim of a sheet counts, too; a sheet has no inside.",
            finding.count_changing, finding.count, number(width)
        ),
        Kind::Duplicates if finding.count_changing == 0 => {
            "No effect: rays pass an odd number of copies like one, and two back to back, where solids touch, are a wall only where the inside is meshed or crossing leaves stay.".into()
        }
        Kind::Intersections | Kind::Overlaps if !input.are_overlaps_meshed() => {
            "No effect: where solids overlap is outside, but enclosed, so that it is deleted like a cavity, and crossing leaves are deleted, too.".into()
        }
        Kind::Intersections if finding.count_changing == 0 => {
            "No effect: the facets overlap back to back in one plane or by the rounding of their vertices, so no volumes overlap.".into()
        }
        Kind::ThinWalls | Kind::ThinGaps if width / RESOLVED < finest => {
            format!("{meaning} A twentieth is too narrow for the finest cell of the root.")
        }
        Kind::ThinWalls | Kind::ThinGaps => format!(
            "{meaning} A spacing below {} would resolve all but the narrowest twentieth.",
            number(width / RESOLVED)
        ),
        _ => meaning.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Requested;
    use contract::case::Facet;
    use contract::lattice::Root;
    use contract::manifest::Keep;
    use contract::octant::CELLS_PER_EDGE;

    const FACET: Facet = [[8.0; 3], [16.0, 8.0, 8.0], [8.0, 16.0, 8.0]];

    /// The root's finest cell is 1 wide, and with a spacing the cells at the surface are 4.
    fn input(with_cell: bool) -> Input {
        let edge = f64::from(CELLS_PER_EDGE);
        let root = Some(Root { origin: [0.0; 3], edge });
        let requested =
            Requested { spacing_min: with_cell.then_some(4.0), root, ..Requested::default() };
        Input::of(Default::default(), vec![FACET], requested).unwrap()
    }

    /// The meaning of places of which the first is this wide.
    fn of_width(kind: Kind, width: f64, changing: u64, with_cell: bool) -> String {
        let place = Place { width: Some(width), ..Place::new(vec![0], [0.0; 3]) };
        let finding = Finding {
            count: 3,
            count_changing: changing,
            places: vec![place],
            ..Finding::new(kind)
        };
        meaning(&finding, &input(with_cell))
    }

    #[test]
    fn an_opening_is_judged_by_its_width_in_cells() {
        for (width, changing, with_cell, beginning) in [
            (0.0, 0, true, "All are narrower than the finest cell"),
            (0.99, 0, true, "All are narrower than the finest cell"),
            (
                1.0,
                0,
                true,
                "Crossing leaves close an opening that is narrower than a cell; at a spacing of 1.00 or less",
            ),
            (
                1.0,
                3,
                false,
                "Crossing leaves close an opening that is narrower than a cell; at a spacing of 1.00 or less",
            ),
            (
                14.0,
                2,
                true,
                "At least one cell wide, by an upper bound where the rim is not flat, and where a box is finer one of its cells: 2 of 3, the widest 14.0",
            ),
        ] {
            let text = of_width(Kind::Openings, width, changing, with_cell);
            assert!(text.starts_with(beginning), "{width}, {changing}, {with_cell}: {text}");
        }
    }

    #[test]
    fn a_sheet_is_resolved_however_it_is_turned_unless_that_takes_less_than_the_finest_cell() {
        for kind in [Kind::ThinWalls, Kind::ThinGaps] {
            let narrow = of_width(kind, 2.30, 3, true);
            assert!(narrow.ends_with("too narrow for the finest cell of the root."), "{narrow}");
            let wide = of_width(kind, 2.4, 3, true);
            assert!(
                wide.ends_with(
                    " A spacing below 1.04 would resolve all but the narrowest twentieth."
                ),
                "{wide}"
            );
        }
    }

    #[test]
    fn every_kind_has_a_meaning_of_its_own() {
        let kinds = [
            Kind::Openings,
            Kind::NonManifoldOdd,
            Kind::Winding,
            Kind::InsideOut,
            Kind::Nested,
            Kind::Stray,
            Kind::Duplicates,
            Kind::Intersections,
            Kind::Overlaps,
            Kind::ThinWalls,
            Kind::ThinGaps,
            Kind::OutsideRoot,
            Kind::TouchingRoot,
        ];
        let text = |kind, changing| of_width(kind, 3.0, changing, true);
        let mut meanings: Vec<String> = kinds.iter().map(|&kind| text(kind, 3)).collect();
        meanings.extend([Kind::Intersections, Kind::Duplicates].map(|kind| text(kind, 0)));
        assert!(
            meanings[13].starts_with("No effect: the facets overlap back to back in one plane")
        );
        assert!(meanings[7].starts_with("Where two closed shells overlap"));
        meanings.sort();
        meanings.dedup();
        assert_eq!(meanings.len(), kinds.len() + 2);
        let titles: std::collections::HashSet<_> = kinds.iter().map(|kind| kind.row().0).collect();
        assert_eq!(titles.len(), kinds.len());
        let changing = |keep| {
            let keep = toml::Value::try_from(keep).unwrap();
            let table = toml::Table::from_iter([("keep".to_owned(), keep)]);
            let input = Input::of(table, vec![FACET], Requested::default()).unwrap();
            kinds.into_iter().filter(|kind| kind.changes_region(&input)).collect::<Vec<_>>()
        };
        let always = [Kind::NonManifoldOdd, Kind::Stray, Kind::Overlaps];
        let all = [&always[..], &[Kind::ThinWalls, Kind::ThinGaps, Kind::OutsideRoot]].concat();
        assert_eq!(changing(Keep::All), all);
        assert_eq!(
            changing(Keep::Outside),
            [&always[..], &[Kind::ThinGaps, Kind::OutsideRoot]].concat()
        );
        assert_eq!(
            changing(Keep::Inside),
            [&always[..], &[Kind::ThinWalls, Kind::OutsideRoot]].concat()
        );
    }
}
