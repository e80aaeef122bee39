//! Thin sheets: [opposite](super::opposite) facets less than one cell apart.
//!
//! Every facet with an opposite one counts once as a wall and once as a gap. The places are pairs of a facet and its nearest
//! opposite one.
//!
//! Pairs of facets are searched through pairs of nodes of a tree of [`patches`](super::patches), twice: [`settled`](super::settled)
//! counts the facets that have an opposite one, since the nearest does not matter to the count, and bounds the distances of the
//! narrowest places; [`narrowest`](super::narrowest) finds the nearest opposite facets within this bound.

use contract::lattice::UNITS_PER_EDGE;

use super::distance::nearest;
use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::narrowest::{Narrowest, Sheet};
use super::pairs::Pairs;
use super::patches::Patches;
use super::settled::Settled;
use super::shells::Shells;

/// Thin walls and thin gaps, narrowest first.
pub fn sheets(
    input: &Input,
    (edges, shells): (&Edges, &Shells),
    cell: f64,
    first: usize,
) -> [Finding; 2] {
    let unit = input.root.edge / UNITS_PER_EDGE as f64;
    let patches = Patches::new(&input.lattice, shells);
    let pairs = Pairs { input, edges, shells, patches: &patches, limit: (cell / unit).powi(2) };
    let settled = Settled::new(&pairs, first);
    let sheets = Narrowest::new(&pairs, &settled, first).sheets();
    [Kind::ThinWalls, Kind::ThinGaps].map(|kind| {
        let side = usize::from(kind == Kind::ThinGaps);
        let places = sheets[side].iter().take(first).map(|sheet| place(input, sheet, unit));
        Finding { count: settled.count(side), places: places.collect(), ..Finding::new(kind) }
    })
}

fn place(input: &Input, sheet: &Sheet, unit: f64) -> Place {
    let [a, b] = sheet.facets.map(|f| input.lattice[f as usize].map(|v| v.map(|c| c as f64)));
    let (_, p, q) = nearest(&a, &b);
    let at = std::array::from_fn(|x| ((p[x] + q[x]) / 2.0).round() as i64);
    let width = sheet.squared.sqrt() * unit;
    Place {
        width: Some(width),
        width_cells: input.in_cells(width),
        ..Place::new(sheet.facets.into(), input.root.to_user(at))
    }
}
