//! The effect of each finding on the mesh at the given spacing.

use contract::manifest::Keep;
use contract::octant::CELLS_PER_EDGE;

use super::finding::{Finding, Kind};
use super::input::Input;
use contract::number::number;

/// Whether every occurrence of a kind can change the mesh's region. Openings and intersections are judged one
/// by one.
pub fn changes_region(kind: Kind, keep: Keep) -> bool {
    match kind {
        Kind::NonManifoldOdd | Kind::Duplicates | Kind::OutsideRoot => true,
        Kind::ThinWalls => keep != Keep::Outside,
        Kind::ThinGaps => keep != Keep::Inside,
        _ => false,
    }
}

/// The effect of a finding that occurs at least once.
pub fn meaning(finding: &Finding, input: &Input) -> String {
    match finding.kind {
        Kind::Openings => openings(finding, input),
        Kind::Junctions => "No effect: a vertex lies on the edge of another facet, so the edges do not match, but the \
                            crack is far narrower than the finest cell."
            .into(),
        Kind::NonManifoldOdd => "Rays that pass on either side of such an edge disagree about the inside, so a \
                                 component's side may be wrong or ambiguous."
            .into(),
        Kind::NonManifoldEven => {
            "No effect: neither crossing leaves nor rays depend on how facets are connected.".into()
        }
        Kind::Winding => "No effect on the mesh: no decision uses a facet's orientation. Thin walls and thin gaps \
                          may be confused with each other or missed at these facets."
            .into(),
        Kind::InsideOut => "No effect on the mesh: no decision uses a facet's orientation. The facets of such a closed shell \
                            are wound so that their normals point inward: thin walls and thin gaps are confused with each \
                            other there, and other programs may exchange inside and outside. Reverse all its facets. The \
                            first facet of each is listed."
            .into(),
        Kind::Cavities => "A closed shell whose normals point inward, within the bounding box of another \
                           closed shell, is a cavity if it lies in that solid. Rays count both surfaces, so its interior is \
                           outside. If the outside is kept, it is deleted, unless enclosed = keep. If seeds are given, it is \
                           flow only if a seed lies in it. The first facet of each is listed."
            .into(),
        Kind::Duplicates => "A ray counts every copy: an even number of copies is passed as if the surface were \
                             open there, so a component's side may be wrong. Remove the copies."
            .into(),
        Kind::Degenerate => "No effect: a facet without area crosses the octants that it touches, and no ray \
                             counts it."
            .into(),
        Kind::Slivers => "No effect: every decision about a facet is exact, however thin it is.".into(),
        Kind::Intersections if finding.count_changing == 0 => "No effect: the facets overlap within one plane, or a \
                                                               shift of 2 lattice units separates them, less than a \
                                                               hundredth of the finest cell. No volumes overlap."
            .into(),
        Kind::Intersections => "Where two closed shells overlap by more than a cell, rays count both surfaces, and \
                                the overlap is outside rather than inside. If the outside is kept, an overlap that \
                                the far field does not reach is deleted, unless enclosed = keep. If seeds are given, \
                                the overlap is flow only if a seed lies in it. Unite the shells if that is not meant."
            .into(),
        Kind::Contacts => {
            "No effect: facets that touch without a common vertex cross the same leaves.".into()
        }
        Kind::ThinWalls => format!(
            "No cell fits into the wall: it consists of crossing leaves, without an inside. {}",
            resolved(finding, input)
        ),
        Kind::ThinGaps => format!(
            "No cell fits into the gap: crossing leaves fill it, and no flow passes. The wedge along the line where two \
             shells intersect is a gap, too. {}",
            resolved(finding, input)
        ),
        Kind::OutsideRoot => "The root cuts the body: no leaf exists beyond its boundary. Rays still count these \
                              facets. Enlarge the root if the body is to be meshed whole."
            .into(),
        Kind::TouchingRoot => "No leaf exists on the far side of these facets, and no flow passes between the \
                               body and the root's boundary there."
            .into(),
    }
}

fn openings(finding: &Finding, input: &Input) -> String {
    let widest = finding.places.first().and_then(|place| place.width).unwrap_or(0.0);
    let leak = "inside and outside become one component";
    match input.cell {
        _ if widest == 0.0 => {
            "All have no width (facets meet without common vertices), so crossing leaves close them \
             at every spacing."
                .into()
        }
        _ if widest < input.root.edge / f64::from(CELLS_PER_EDGE) => {
            "All are narrower than the finest cell of the root, so crossing leaves close them at every spacing.".into()
        }
        None => format!(
            "Crossing leaves close an opening that is narrower than a cell; at a spacing of {} or less the widest \
             may leak: {leak}.",
            number(widest)
        ),
        Some(_) if finding.count_changing == 0 => format!(
            "All are narrower than a cell, so crossing leaves close them; at a spacing of {} or less the widest may \
             leak.",
            number(widest)
        ),
        Some(cell) if widest < LEAK_CELLS * cell => format!(
            "{} at least one cell wide and may leak, depending on the position in the lattice: {leak}. Crossing \
             leaves close an opening only if it is narrower than a cell; close it or mesh with a spacing above {}.",
            of(finding),
            number(widest)
        ),
        Some(_) => format!(
            "{} at least one cell wide, and the widest leaks unless other facets cover it: {leak}. The rim of a \
             sheet counts too; a sheet has no inside.",
            of(finding)
        ),
    }
}

/// A straight chain of cells, each connected to the next by a face, fits into a round opening wider than
/// 2 sqrt(3) = 3.46 cells, wherever it lies in the lattice.
const LEAK_CELLS: f64 = 3.5;

fn of(finding: &Finding) -> String {
    match (finding.count, finding.count_changing) {
        (1, _) => "It is".into(),
        (_, 1) => "One is".into(),
        (all, changing) if all == changing => "All are".into(),
        (_, changing) => format!("{changing} of them are"),
    }
}

/// The spacing at which cells fit in all but the narrowest twentieth. A gap of two cells holds one of them wherever it
/// lies in the lattice, if it is parallel to a face of the lattice.
fn resolved(finding: &Finding, input: &Input) -> String {
    let narrowest = finding.places.first().and_then(|place| place.width).unwrap_or(0.0);
    if narrowest / 2.0 < input.root.edge / f64::from(CELLS_PER_EDGE) {
        return "A twentieth is too narrow for the finest cell of the root.".into();
    }
    format!(
        "A spacing below {} would resolve all but the narrowest twentieth.",
        number(narrowest / 2.0)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finding::Place;
    use crate::input::Requested;
    use contract::lattice::Root;

    /// The root's finest cell is 1 wide, and with a spacing the cells at the surface are 4.
    fn input(with_cell: bool) -> Input {
        let edge = f64::from(CELLS_PER_EDGE);
        let root = Some(Root { origin: [0.0; 3], edge });
        let requested = Requested { spacing_min: with_cell.then_some(4.0), root, root_scale: None };
        Input::new(vec![[[8.0; 3], [16.0, 8.0, 8.0], [8.0, 16.0, 8.0]]], &requested).unwrap()
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
        let of = |width, changing, with_cell| of_width(Kind::Openings, width, changing, with_cell);
        for (width, changing, with_cell, beginning) in [
            (0.0, 0, true, "All have no width"),
            (0.99, 0, true, "All are narrower than the finest cell"),
            (
                1.0,
                0,
                true,
                "All are narrower than a cell, so crossing leaves close them; at a spacing of 1.00 or less",
            ),
            (
                1.0,
                3,
                false,
                "Crossing leaves close an opening that is narrower than a cell; at a spacing of 1.00 or less",
            ),
            (13.9, 3, true, "All are at least one cell wide and may leak"),
            (14.0, 3, true, "All are at least one cell wide, and the widest leaks unless"),
            (14.0, 1, true, "One is at least one cell wide, and"),
            (14.0, 2, true, "2 of them are at least one cell wide, and"),
        ] {
            let text = of(width, changing, with_cell);
            assert!(text.starts_with(beginning), "{width}, {changing}, {with_cell}: {text}");
        }
        let one = Finding { count: 1, count_changing: 1, ..Finding::new(Kind::Openings) };
        assert_eq!(super::of(&one), "It is");
    }

    #[test]
    fn a_sheet_is_resolved_by_half_its_width_unless_that_is_below_the_finest_cell() {
        for kind in [Kind::ThinWalls, Kind::ThinGaps] {
            let narrow = of_width(kind, 1.99, 3, true);
            assert!(narrow.ends_with("too narrow for the finest cell of the root."), "{narrow}");
            let wide = of_width(kind, 2.0, 3, true);
            assert!(
                wide.ends_with(
                    " A spacing below 1.00 would resolve all but the narrowest twentieth."
                ),
                "{wide}"
            );
        }
    }

    #[test]
    fn every_kind_has_a_meaning_of_its_own() {
        let kinds = [
            Kind::Openings,
            Kind::Junctions,
            Kind::NonManifoldOdd,
            Kind::NonManifoldEven,
            Kind::Winding,
            Kind::InsideOut,
            Kind::Cavities,
            Kind::Duplicates,
            Kind::Degenerate,
            Kind::Slivers,
            Kind::Intersections,
            Kind::Contacts,
            Kind::ThinWalls,
            Kind::ThinGaps,
            Kind::OutsideRoot,
            Kind::TouchingRoot,
        ];
        let text = |kind, changing| of_width(kind, 3.0, changing, true);
        let mut meanings: Vec<String> = kinds.iter().map(|&kind| text(kind, 3)).collect();
        meanings.push(text(Kind::Intersections, 0));
        assert!(meanings[16].starts_with("No effect: the facets overlap within one plane"));
        assert!(meanings[10].starts_with("Where two closed shells overlap"));
        meanings.sort();
        meanings.dedup();
        assert_eq!(meanings.len(), kinds.len() + 1);
        let titles: std::collections::HashSet<_> = kinds.iter().map(|kind| kind.title()).collect();
        assert_eq!(titles.len(), kinds.len());
        let changing = |keep| {
            kinds.into_iter().filter(move |&kind| changes_region(kind, keep)).collect::<Vec<_>>()
        };
        let always = [Kind::NonManifoldOdd, Kind::Duplicates];
        let all = [always[0], always[1], Kind::ThinWalls, Kind::ThinGaps, Kind::OutsideRoot];
        assert_eq!(changing(Keep::All), all);
        assert_eq!(
            changing(Keep::Outside),
            [always[0], always[1], Kind::ThinGaps, Kind::OutsideRoot]
        );
        assert_eq!(
            changing(Keep::Inside),
            [always[0], always[1], Kind::ThinWalls, Kind::OutsideRoot]
        );
    }
}
