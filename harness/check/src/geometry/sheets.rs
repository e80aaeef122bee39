//! Thin sheets: opposite facets less than one cell apart.
//!
//! Facet g is opposite to facet f if they have no common vertex and do not meet, their normals differ by at least
//! 120 degrees, and the shortest line between them is within 60 degrees of both normals. It is a wall if g is on
//! the inner side of f, and a gap if g is on the outer side, by the winding of the file. Every facet counts once
//! as a wall and once as a gap, with its nearest opposite facet.

use contract::lattice::UNITS_PER_EDGE;

use super::boxes::{Bounds, Boxes, unit_normal};
use super::distance::{dot, nearest, sub};
use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::intersections::{Relation, relation};

/// The cosine of 60 degrees.
const COSINE: f64 = 0.5;

/// The nearest opposite facet on one side, as far as known.
#[derive(Clone, Copy)]
struct Opposite {
    squared: f64,
    facet: u32,
    at: [f64; 3],
}

/// Thin walls and thin gaps, narrowest first.
pub fn sheets(
    input: &Input,
    edges: &Edges,
    boxes: &Boxes,
    cell: f64,
    first: usize,
) -> [Finding; 2] {
    let unit = input.root.edge / UNITS_PER_EDGE as f64;
    let none = Opposite { squared: (cell / unit).powi(2), facet: u32::MAX, at: [0.0; 3] };
    let mut found: [Vec<(u32, Opposite)>; 2] = Default::default();
    let mut best: Vec<[Opposite; 2]> = Vec::new();
    for (bounds, group) in boxes.groups() {
        best.clear();
        best.resize(group.len(), [none; 2]);
        boxes.search(
            |node, members| {
                let limits = [0, 1].map(|s| best.iter().map(|b| b[s].squared).fold(0.0, f64::max));
                let is_near = may_oppose(bounds, node, limits);
                if let Some(members) = members.filter(|_| is_near) {
                    for (i, best) in group.clone().zip(&mut best) {
                        let limits = [best[0].squared, best[1].squared];
                        if may_oppose(&boxes.bounds[i], node, limits) {
                            members.clone().for_each(|j| improve(input, edges, boxes, i, j, best));
                        }
                    }
                }
                is_near
            },
            |node| bounds.distance_squared(node),
        );
        for (i, best) in group.zip(&best) {
            for side in 0..2 {
                if best[side].facet != u32::MAX {
                    found[side].push((boxes.facets[i], best[side]));
                }
            }
        }
    }
    let kinds = [Kind::ThinWalls, Kind::ThinGaps];
    std::array::from_fn(|side| finding(input, kinds[side], &mut found[side], unit, first))
}

/// Whether the facets of two nodes may be opposite within the given squared distances, as wall or as gap.
fn may_oppose(group: &Bounds, node: &Bounds, limits: [f64; 2]) -> bool {
    // The bounds on normals are rounded.
    if f64::from(group.cosine_min(node)) > 1e-5 - COSINE {
        return false;
    }
    let squared = group.distance_squared(node);
    if squared >= limits[0].max(limits[1]) {
        return false;
    }
    let (least, greatest) = group.height_range(node);
    (least <= 0.0 && squared < limits[0]) || (greatest >= 0.0 && squared < limits[1])
}

/// Updates the nearest wall and gap of the facet at position `i` with the one at position `j`.
fn improve(
    input: &Input,
    edges: &Edges,
    boxes: &Boxes,
    i: usize,
    j: usize,
    best: &mut [Opposite; 2],
) {
    let limits = [best[0].squared, best[1].squared];
    if i == j || !may_oppose(&boxes.bounds[i], &boxes.bounds[j], limits) {
        return;
    }
    let (f, g) = (boxes.facets[i], boxes.facets[j]);
    let (corners_f, corners_g) = (edges.corners[f as usize], edges.corners[g as usize]);
    if corners_f.iter().any(|v| corners_g.contains(v)) {
        return;
    }
    let (a, b) = (&input.lattice[f as usize], &input.lattice[g as usize]);
    let (n, m) = (unit_normal(a), unit_normal(b));
    if dot(n, m) > -COSINE {
        return;
    }
    let [a_float, b_float] = [a, b].map(|t| t.map(|v| v.map(|c| c as f64)));
    if is_beyond(&a_float, n, &b_float, limits) || is_beyond(&b_float, m, &a_float, limits) {
        return;
    }
    let (squared, p, q) = nearest(&a_float, &b_float);
    let d = sub(q, p);
    let (along_n, along_m) = (dot(d, n), dot(d, m));
    let limit = COSINE * squared.sqrt();
    let side = usize::from(along_n > 0.0);
    let is_opposite = along_n.abs() >= limit && along_m.abs() >= limit && along_n * along_m < 0.0;
    if squared < best[side].squared && is_opposite && relation(a, b, true) == Relation::Disjoint {
        let at = std::array::from_fn(|x| (p[x] + q[x]) / 2.0);
        best[side] = Opposite { squared, facet: g, at };
    }
}

/// Whether a facet is on one side of the plane of another, with unit normal `n`, and as far from it as the limit.
fn is_beyond(a: &[[f64; 3]; 3], n: [f64; 3], b: &[[f64; 3]; 3], limits: [f64; 2]) -> bool {
    let heights = b.map(|v| dot(sub(v, a[0]), n));
    let least = heights.into_iter().fold(f64::INFINITY, f64::min);
    let greatest = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (least > 0.0 && least * least >= limits[1])
        || (greatest < 0.0 && greatest * greatest >= limits[0])
}

fn finding(
    input: &Input,
    kind: Kind,
    found: &mut Vec<(u32, Opposite)>,
    unit: f64,
    first: usize,
) -> Finding {
    let count = found.len() as u64;
    let pair = |(f, o): &(u32, Opposite)| (*f.min(&o.facet), *f.max(&o.facet));
    found.sort_by(|a, b| a.1.squared.total_cmp(&b.1.squared).then(pair(a).cmp(&pair(b))));
    found.dedup_by_key(|entry| pair(entry));
    let place = |entry: &(u32, Opposite)| {
        let (f, g) = pair(entry);
        let width = entry.1.squared.sqrt() * unit;
        let at = entry.1.at.map(|c| c.round() as i64);
        Place {
            width: Some(width),
            width_cells: input.in_cells(width),
            ..Place::new(vec![f, g], input.root.to_user(at))
        }
    };
    let places = found.iter().take(first).map(place).collect();
    Finding { count, places, ..Finding::new(kind) }
}
