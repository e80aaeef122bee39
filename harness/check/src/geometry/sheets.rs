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

/// No position.
const NONE: usize = usize::MAX;

/// The nearest opposite facet on one side, as far as known.
#[derive(Clone, Copy)]
struct Opposite {
    squared: f64,
    /// Position in the tree of boxes.
    position: usize,
    at: [f64; 3],
}

/// A facet with its nearest opposite facet.
struct Sheet {
    squared: f64,
    facets: [u32; 2],
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
    let none = Opposite { squared: (cell / unit).powi(2), position: NONE, at: [0.0; 3] };
    let mut found: [Vec<Sheet>; 2] = Default::default();
    let mut best: Vec<[Opposite; 2]> = Vec::new();
    let mut candidates: Vec<usize> = Vec::new();
    for (bounds, group) in boxes.groups() {
        // The opposite facets of the previous group are near this one's, and few others are nearer.
        candidates.clear();
        candidates.extend(best.iter().flatten().map(|b| b.position).filter(|&j| j != NONE));
        candidates.sort_unstable();
        candidates.dedup();
        best.clear();
        best.resize(group.len(), [none; 2]);
        for (i, best) in group.clone().zip(&mut best) {
            candidates.iter().for_each(|&j| improve(input, edges, boxes, i, j, best));
        }
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
                let Opposite { squared, position, at } = best[side];
                if position != NONE {
                    found[side].push(Sheet {
                        squared,
                        facets: [i, position].map(|i| boxes.facets[i]),
                        at,
                    });
                }
            }
        }
    }
    let kinds = [Kind::ThinWalls, Kind::ThinGaps];
    std::array::from_fn(|side| finding(input, kinds[side], &mut found[side], unit, first))
}

/// Whether the facets of two nodes may be opposite within the given squared distances, as wall or as gap.
fn may_oppose(group: &Bounds, node: &Bounds, limits: [f64; 2]) -> bool {
    // Sums of f32 are rounded.
    if f64::from(group.cosine_min(node)) > 1e-5 - COSINE {
        return false;
    }
    let squared = group.distance_squared(node);
    if squared >= limits[0].max(limits[1]) {
        return false;
    }
    // The shortest line is no shorter than this, and is within 60 degrees of the normals of both: each facet is as far below
    // the other one, or above it.
    let height = (COSINE - 1e-9) * squared.sqrt();
    let ranges = [group.height_range(node), node.height_range(group)];
    let is_below = || ranges.iter().all(|&(least, _)| least <= -height);
    let is_above = || ranges.iter().all(|&(_, greatest)| greatest >= height);
    (squared < limits[0] && is_below()) || (squared < limits[1] && is_above())
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
        best[side] = Opposite { squared, position: j, at };
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

fn finding(input: &Input, kind: Kind, found: &mut Vec<Sheet>, unit: f64, first: usize) -> Finding {
    let count = found.len() as u64;
    let pair = |sheet: &Sheet| {
        let [f, g] = sheet.facets;
        (f.min(g), f.max(g))
    };
    found.sort_by(|a, b| a.squared.total_cmp(&b.squared).then(pair(a).cmp(&pair(b))));
    found.dedup_by_key(|sheet| pair(sheet));
    let place = |sheet: &Sheet| {
        let (f, g) = pair(sheet);
        let width = sheet.squared.sqrt() * unit;
        let at = sheet.at.map(|c| c.round() as i64);
        Place {
            width: Some(width),
            width_cells: input.in_cells(width),
            ..Place::new(vec![f, g], input.root.to_user(at))
        }
    };
    let places = found.iter().take(first).map(place).collect();
    Finding { count, places, ..Finding::new(kind) }
}
