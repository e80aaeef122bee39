//! The limit on gaps (`DEFINITION.md`, section 4): which slits connect the two sides of a sheet. The
//! table there is the result of these tests.
use crate::support;

use reference::{Case, Keep, base_tree};
use std::cell::Cell;
use std::collections::HashSet;
use support::dense::{CROSSING, INSIDE};
use support::leaves;
use support::{Facet, cases, for_all};
use support::{ROOT_EDGE, case, crosses_by_axes};

const LEVEL: u32 = 5;
/// Edge of the cells at the surface, in lattice units.
const CELL: f64 = (ROOT_EDGE >> LEVEL) as f64;
const WIDTHS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Unit vectors across the slit, along it, and normal to the sheet.
pub type Frame = [[f64; 3]; 3];

/// The orientations of the table, with the names of its columns.
fn orientations() -> [(&'static str, Frame); 4] {
    let [half, third, sixth] = [2.0_f64, 3.0, 6.0].map(|x| 1.0 / x.sqrt());
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let [up, down] = [[half, half, 0.0], [half, -half, 0.0]];
    let space = [third; 3];
    [
        ("an axis", axes),
        ("an axis, in a sheet at 45 degrees", [axes[2], down, up]),
        ("the diagonal of a face", [down, axes[2], up]),
        ("the diagonal of a cube", [space, down, [sixth, sixth, -2.0 * sixth]]),
    ]
}

/// A box of ten cells, one of whose faces has a slit of a width given in cells. Its centre is that of
/// the root, moved by `offset` cells across the slit and along the normal of the sheet.
pub fn slotted_box(
    [across, along, normal]: Frame,
    width: f64,
    offset: [f64; 2],
) -> Vec<[[i64; 3]; 3]> {
    let point = |[u, v, n]: [f64; 3]| {
        let [u, n] = [u + offset[0], n + offset[1]];
        let at = |a: usize| 16.0 + u * across[a] + v * along[a] + n * normal[a];
        std::array::from_fn(|a| (at(a) * CELL).round() as i64)
    };
    // A rectangle in the plane where coordinate `axis` is `plane`, with the ranges of the other two.
    let rectangle = |axis: usize, plane: f64, u: [f64; 2], v: [f64; 2]| {
        let corner = |x: f64, y: f64| {
            let mut corner = [plane; 3];
            (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (x, y);
            point(corner)
        };
        let [a, b] = [corner(u[0], v[0]), corner(u[1], v[1])];
        [[a, corner(u[1], v[0]), b], [a, corner(u[0], v[1]), b]]
    };
    let all = [-5.0, 5.0];
    let closed = [(0, -5.0), (0, 5.0), (1, -5.0), (1, 5.0), (2, -5.0)];
    let mut facets: Vec<_> =
        closed.into_iter().flat_map(|(axis, plane)| rectangle(axis, plane, all, all)).collect();
    facets.extend(rectangle(2, 5.0, [-5.0, -2.0], all));
    facets.extend(rectangle(2, 5.0, [width - 2.0, 5.0], all));
    facets
}

/// Whether the slit connects the space in the box with the corner of the root.
fn is_open(frame: Frame, width: f64, offset: [f64; 2]) -> bool {
    let facets = slotted_box(frame, width, offset);
    let seeds = vec![[16.0 * CELL; 3]];
    let base = base_tree(&Case { seeds, keep: Keep::Inside, ..case(&facets, LEVEL) }).unwrap();
    // The first leaf is the one in the corner. It is inside, which is flow, if the seed reaches it.
    base.words[0] & 3 == 1
}

/// The numbers of places at which a slit is open and at which it was tried: offsets by quarters of a
/// cell in both directions, and the three cyclic permutations of the axes.
fn open_places(frame: Frame, width: f64) -> [usize; 2] {
    let mut places = [0, 0];
    for place in 0..48 {
        let offset = [place % 4, place / 4 % 4].map(|quarters| f64::from(quarters) / 4.0);
        let turned = frame.map(|v| std::array::from_fn(|a| v[(a + place as usize / 16) % 3]));
        places[0] += usize::from(is_open(turned, width, offset));
        places[1] += 1;
    }
    places
}

fn entry([open, tried]: [usize; 2]) -> String {
    match open {
        0 => "closed".to_owned(),
        _ if open == tried => "open".to_owned(),
        _ => format!("open at {open} of {tried}"),
    }
}

/// The table of `DEFINITION.md`.
fn table() -> String {
    let orientations = orientations();
    let mut table = String::from("| width across ->");
    for (name, _) in &orientations {
        table += &format!(" | {name}");
    }
    table += &format!(" |\n|{}\n", "---|".repeat(1 + orientations.len()));
    for width in WIDTHS {
        table += &format!("| {width} h");
        for (_, frame) in orientations {
            table += &format!(" | {}", entry(open_places(frame, width)));
        }
        table += " |\n";
    }
    table
}

#[test]
fn the_table_of_the_definition_is_the_one_computed() {
    let table = table();
    let definition = include_str!("../../DEFINITION.md");
    assert!(definition.contains(&table), "DEFINITION.md, section 4, must contain\n{table}");
}

/// A slit no wider than a cell is closed everywhere; one wider than two cells, times the sum of the
/// absolute components of the direction across it, is open everywhere.
#[test]
fn slits_are_closed_and_open_where_the_definition_guarantees_it() {
    for (name, frame) in orientations() {
        let sum: f64 = frame[0].iter().map(|x| x.abs()).sum();
        let [closed, open] = [1.0, 2.0 * sum + 1e-3].map(|width| entry(open_places(frame, width)));
        assert_eq!([closed.as_str(), open.as_str()], ["closed", "open"], "{name}");
    }
}

/// The positions that a cube of two cells' edge, starting at `start`, reaches by steps of half a cell
/// within the root without touching a facet. A position is the minimum corner of the cube.
fn reached(facets: &[Facet], cell: i64, start: [i64; 3]) -> HashSet<[i64; 3]> {
    let is_free = |min: [i64; 3], max: [i64; 3]| {
        let is_in_root = min.iter().all(|&x| x >= 0) && max.iter().all(|&x| x <= ROOT_EDGE);
        is_in_root && !facets.iter().any(|facet| crosses_by_axes(facet, min, max))
    };
    let max_of = |min: [i64; 3]| min.map(|x| x + 2 * cell);
    let mut reached = HashSet::new();
    let mut waiting = vec![start];
    waiting.retain(|&start| is_free(start, max_of(start)));
    while let Some(from) = waiting.pop() {
        if !reached.insert(from) {
            continue;
        }
        for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
            let mut to = from;
            to[axis] += step * cell / 2;
            // The cube sweeps the smallest box around both positions.
            let min = std::array::from_fn(|a| from[a].min(to[a]));
            let max = std::array::from_fn(|a| max_of(from)[a].max(max_of(to)[a]));
            if !reached.contains(&to) && is_free(min, max) {
                waiting.push(to);
            }
        }
    }
    reached
}

/// All places that a cube of two cells' edge reaches are one component, whatever the facets are.
#[test]
fn gaps_through_which_a_cube_of_two_cells_passes_always_connect() {
    const LEVEL: u32 = 3;
    let cell = ROOT_EDGE >> LEVEL;
    let start = proptest::array::uniform3(0..7 * cell);
    let far = Cell::new(0);
    for_all(file!(), 60, (cases(LEVEL), start), |(random, start)| {
        let reached = reached(&random.facets, cell, start);
        // The first whole cell in the cube along each axis.
        let cell_in = |position: [i64; 3]| position.map(|x| (x + cell - 1) / cell * cell);
        if reached.is_empty() {
            return;
        }
        let seeds = vec![cell_in(start).map(|x| x as f64)];
        let seeded = Case { seeds, keep: Keep::Inside, ..case(&random.facets, LEVEL) };
        let base = leaves(&base_tree(&seeded).unwrap().words);
        for &position in &reached {
            let leaf = base.iter().find(|leaf| leaf.has(cell_in(position))).unwrap();
            assert_eq!(leaf.side, INSIDE, "{position:?}");
        }
        let is_divided = base.iter().any(|leaf| leaf.side == CROSSING);
        far.set(far.get() + u32::from(is_divided && reached.len() > 100));
    });
    assert!(far.get() > 5, "cubes must move far in the presence of facets: {}", far.get());
}

/// Along an axis neither limit can be improved.
#[test]
fn both_limits_are_sharp_along_an_axis() {
    let [(_, frame), ..] = orientations();
    // The edge of the slit lies just before a cell, or in the plane of a cell face.
    let just_before = [-1e-3, 0.0];
    assert!(is_open(frame, 1.0 + 2e-3, just_before));
    assert!(!is_open(frame, 2.0, [0.0; 2]));
}
