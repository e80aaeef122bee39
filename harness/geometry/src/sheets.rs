//! Thin sheets: facets with an opposite one less than [`RESOLVED`] cells away, or cells of a finer box there, by rays along their normals;
//! on a side that is not meshed, less than one.
//!
//! From points of each facet, a ray leads inward and one outward. The first facet that it meets as near as that is opposite if it has no
//! vertex in common with the first one and their normals differ by at least 120 degrees. They are a wall on the inner side and a gap on
//! the outer side, by the winding of the file, which is reversed in shells that are inside out. Facets of two solids that overlap have inner
//! sides that face each other, but no wall.
//!
//! The width is a quantile by area, so a point where two surfaces touch does not stand for a whole wall.

use contract::lattice::UNITS_PER_EDGE;
use parry3d_f64::query::Ray;
use std::cell::Cell;
use std::collections::HashSet;

use super::finding::{Finding, Kind, Place, RESOLVED};
use super::input::Input;
use super::shells::Shells;
use super::tree::{Aabb, FacetTree, Point, TOUCHING};

/// The cosine of 120 degrees.
const OPPOSITE: f64 = -0.5;

/// Rays on each side per area of the surface: so many for all of it, unless they are a cell apart or too many facets are near them.
const STARTS: f64 = 1e4;

/// The quantile of the width that is reported, by area.
const QUANTILE: f64 = 0.05;

/// A ray that met an opposite facet.
struct Hit {
    width: f64,
    area: f64,
    /// The facet where it starts.
    from: u32,
    /// That facet and the one that it met, in order.
    facets: [u32; 2],
    middle: Point,
}

/// Thin walls and thin gaps, each with the place at the quantile of its width.
pub fn sheets(input: &Input, tree: &FacetTree, shells: &Shells, cell: f64) -> [Finding; 2] {
    let unit = input.case.root.edge / UNITS_PER_EDGE as f64;
    let cell_at = |at: Point| {
        let at = Point::from(input.case.root.origin) + unit * at;
        input.cell_in(&Aabb::new(at, at)).unwrap_or(cell) / unit
    };
    [(Kind::ThinWalls, -1.0), (Kind::ThinGaps, 1.0)].map(|(kind, side)| {
        let cells = if kind.changes_region(input) { RESOLVED } else { 1.0 };
        let may_be = |a: u32, b: u32| {
            let facets = [a, b].map(|facet| input.case.facets_lattice[facet as usize]);
            let [p, q] = [a, b].map(|facet| shells.of[facet as usize]);
            !facets[0].iter().any(|v| facets[1].contains(v))
                && (kind == Kind::ThinGaps || !shells.are_different_solids(p, q))
        };
        let sign = |facet| if shells.outward(facet) == Some(false) { -1.0 } else { 1.0 };
        let normal = |facet: u32| Some(tree.triangle(facet).normal()? * sign(facet));
        let (mut hits, is_lower_bound) = hits(tree, (side, cells), cell_at, normal, may_be);
        hits.sort_by(|a, b| a.width.total_cmp(&b.width).then(a.facets.cmp(&b.facets)));
        // Not those that were met: on an edge, which of two facets a ray meets first is a matter of rounding.
        let of_sheets: HashSet<u32> = hits.iter().map(|hit| hit.from).collect();
        let place = |hit: &Hit| {
            let middle = hit.middle.round().to_array().map(|c| c as i64);
            let place = Place::new(hit.facets.into(), input.case.root.to_user(middle));
            Place { width: Some(hit.width * unit), ..place }
        };
        let places = quantile(&hits).map(place).into_iter().collect();
        Finding { count: of_sheets.len() as u64, is_lower_bound, places, ..Finding::new(kind) }
    })
}

/// The rays on one side of all facets with an area that meet an opposite facet within a number of cells, and whether the search ended before
/// the last facet.
fn hits(
    tree: &FacetTree,
    (side, cells): (f64, f64),
    cell_at: impl Fn(Point) -> f64,
    normal: impl Fn(u32) -> Option<Point>,
    may_be: impl Fn(u32, u32) -> bool,
) -> (Vec<Hit>, bool) {
    let (mut hits, visits) = (Vec::new(), Cell::new(0));
    let part = tree.firsts.iter().map(|&facet| tree.triangle(facet).area()).sum::<f64>() / STARTS;
    for &facet in &tree.firsts {
        let Some(outward) = normal(facet) else { continue };
        let triangle = tree.triangle(facet);
        let [a, b, c] = *triangle.vertices();
        let cell = cell_at((a + b + c) / 3.0);
        let is_large = triangle.edges().iter().any(|edge| edge.length() > cell);
        let parts = triangle.area() / part.max(cell * cell);
        // Every facet has a few rays; more are as many as take the same time.
        let more = if visits.get() < tree.visits_max { parts.sqrt().ceil() as u32 } else { 1 };
        let rows = more.max(if is_large { 2 } else { 1 });
        // The centres of equal parts, row by row from the first vertex. Every other part is upside down.
        for (row, at) in (0..rows).flat_map(|row| (0..=2 * row).map(move |at| (row, at))) {
            if visits.get() > 2 * tree.visits_max {
                return (hits, true);
            }
            let turned = f64::from(at % 2);
            let down = f64::from(row) + (2.0 - turned) / 3.0;
            let along = f64::from(at / 2) + (1.0 + turned) / 3.0;
            let start = a + ((down - along) * (b - a) + along * (c - a)) / f64::from(rows);
            let ray = Ray::new(start, side * outward);
            let is_obstacle = |other: u32| {
                visits.set(visits.get() + 1);
                may_be(facet, other)
            };
            let (first, width) = tree.first_hits(&ray, cells * cell_at(start), is_obstacle);
            let faces = |other: &u32| normal(*other).is_some_and(|n| n.dot(outward) <= OPPOSITE);
            if let Some(other) = first.into_iter().find(faces).filter(|_| width > TOUCHING) {
                let area = triangle.area() / f64::from(rows * rows);
                let middle = ray.point_at(width / 2.0);
                let facets = [facet.min(other), facet.max(other)];
                hits.push(Hit { width, area, from: facet, facets, middle });
            }
        }
    }
    (hits, false)
}

/// The hit below whose width lies [`QUANTILE`] of the area of all, which are sorted by width.
fn quantile(hits: &[Hit]) -> Option<&Hit> {
    let mut rest = QUANTILE * hits.iter().map(|hit| hit.area).sum::<f64>();
    let found = hits.iter().find(|hit| {
        rest -= hit.area;
        rest <= 0.0
    });
    found.or(hits.last())
}
