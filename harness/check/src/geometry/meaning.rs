//! The effect of each finding on the mesh at the given spacing.

use contract::manifest::Keep;
use contract::octant::CELLS_PER_EDGE;

use super::finding::{Finding, Kind};
use super::input::Input;

/// Whether every occurrence of a kind can change the mesh's region. Openings and intersections are judged one
/// by one.
pub fn changes_region(kind: Kind, keep: Keep) -> bool {
    match kind {
        Kind::NonManifoldOdd | Kind::Duplicates | Kind::OutsideRoot => true,
        Kind::ThinWalls => keep != Keep::Outside,
        Kind::ThinGaps => keep != Keep::Inside,
        Kind::Openings
        | Kind::Junctions
        | Kind::NonManifoldEven
        | Kind::Winding
        | Kind::InsideOut
        | Kind::Cavities
        | Kind::Degenerate
        | Kind::Slivers
        | Kind::Intersections
        | Kind::Contacts
        | Kind::TouchingRoot => false,
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

/// The spacing at which cells fit between the narrowest facets. A gap of two cells holds one of them wherever it
/// lies in the lattice, if it is parallel to a face of the lattice.
fn resolved(finding: &Finding, input: &Input) -> String {
    let narrowest = finding.places.first().and_then(|place| place.width).unwrap_or(0.0);
    if narrowest / 2.0 < input.root.edge / f64::from(CELLS_PER_EDGE) {
        return "The narrowest place is too narrow for the finest cell of the root.".into();
    }
    format!("A spacing below {} would resolve the narrowest place.", number(narrowest / 2.0))
}

/// A length with three significant digits.
pub fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let digits = 2 - x.abs().log10().floor() as i32;
    if (-3..=6).contains(&digits) {
        format!("{x:.*}", digits.max(0) as usize)
    } else {
        format!("{x:.2e}")
    }
}
