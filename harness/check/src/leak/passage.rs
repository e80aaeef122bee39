//! The widest path through the free leaves of a base tree, described in the user's units.
//!
//! The path through leaves whose least radius is greatest shows where an opening may be. There the leaves are split into
//! cubes until the width is known; that is repeated with the other leaves as they are until no other path can be wider.
//!
//! An end near a facet is not an opening, so both ends are first moved to where the free width is greatest nearby.

use super::clearance::Clearance;
use super::cubes::length;
use super::ends::Ends;
use super::field::Field;
use super::leaves::Leaves;
use super::path::Path;
use super::refine;
use super::report::{Narrowest, Passage, Point, Spacing};
use super::search::Interrupted;
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;

/// Openings that are measured at most.
const OPENINGS_MAX: usize = 16;

/// The widest path between ends that free leaves join.
///
/// # Errors
/// If `stop` returns true.
pub fn widest(
    case: &Case,
    level: u8,
    leaves: &Leaves,
    (from, to): Ends,
    stop: &dyn Fn() -> bool,
) -> Result<Passage, Interrupted> {
    let clearance = Clearance::new(&case.facets_lattice);
    let mut field = Field::new(leaves, level, &clearance);
    let approach = |at: [i64; 3]| field.approach(at.map(|c| c as f64));
    let (start, goal) = (approach(from), to.map(approach));
    let ends = (start.at(), goal.as_ref().map(|goal| goal.at()));
    let mut best: Option<Path> = None;
    let mut radius = f64::INFINITY;
    for _ in 0..OPENINGS_MAX {
        let wanted = best.as_ref().map_or(0.0, |path| refine::PROVEN * path.throat().clearance);
        let Some((route, least)) = field.widest(ends, wanted, stop)? else {
            radius = wanted;
            break;
        };
        radius = least;
        field.adopt(&route, least);
        let refined = refine::widest(&mut field.cubes, &clearance, ends, wanted, stop)?;
        let Some(refined) = refined else { continue };
        // Further attempts at places that are all equally wide would prove little.
        let is_last = best.is_some() && !refined.is_proven();
        let path = Path::through(&field.cubes, &refined.cubes, &clearance, (&start, goal.as_ref()));
        if best.as_ref().is_none_or(|best| path.throat().clearance > best.throat().clearance) {
            best = Some(path);
        }
        if is_last {
            break;
        }
    }
    let path = best.expect("free leaves join the ends");
    Ok(described(case, level, &path, radius, &clearance))
}

fn described(case: &Case, level: u8, path: &Path, radius: f64, clearance: &Clearance) -> Passage {
    /// Facets at the rim, in parts of the ball's radius, and for small balls in lattice units.
    const RIM: (f64, f64) = (0.06, 2.0);
    let scale = case.root.edge / UNITS_PER_EDGE as f64;
    let user = |at: [f64; 3]| std::array::from_fn(|a| case.root.origin[a] + at[a] * scale);
    let throat = path.throat();
    let width = 2.0 * throat.clearance * scale;
    let rim = clearance.facets_within(throat.at, throat.clearance * (1.0 + RIM.0) + RIM.1);
    let points: Vec<Point> = path
        .spots
        .iter()
        .map(|spot| Point { at: user(spot.at), width: 2.0 * spot.clearance * scale })
        .collect();
    Passage {
        spacing: Spacing::of(level, &case.root),
        narrowest: Narrowest {
            at: user(throat.at),
            width,
            width_max: 2.0 * radius.max(throat.clearance) * scale,
            width_cells: width / Spacing::of(case.level_surface, &case.root).spacing,
            direction: path.direction(),
            touches: clearance.nearest(throat.at).map_or(user(throat.at), user),
            facets: rim.into_iter().map(|(facet, _)| facet).collect(),
            index: path.narrowest,
            is_end: path.is_narrowest_at_end,
        },
        length: points.windows(2).map(|pair| length(pair[0].at, pair[1].at)).sum(),
        points,
    }
}
