//! Seeds: the sides that they determine, and the errors of seeds that mark no flow.
use crate::support;

use proptest::array::uniform3;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use reference::octant::Side;
use reference::{Case, Enclosed, Error, Keep, Leak, base_tree, mesh};
use std::cell::Cell;
use support::dense::{self, CROSSING, Dense, INSIDE};
use support::leaves;
use support::{ROOT_EDGE, UNIT, block, block_of_units, case, sides};
use support::{RandomCase, cases, for_all};

const FINEST: u32 = 4;

/// A shell from 1 to 7 units around a cavity from 3 to 5 units, at level 4, whose cells are half
/// units. All leaves have level 4: 1,952 cross, 784 lie in the shell, 8 in the cavity, and 1,352
/// around the shell.
fn shell() -> Case {
    let facets = [block_of_units([1; 3], [7; 3]), block_of_units([3; 3], [5; 3])].concat();
    Case { keep: Keep::Outside, ..case(&facets, 4) }
}

const IN_SHELL: f64 = 2.0;
const IN_CAVITY: f64 = 4.0;
const AROUND: f64 = 0.2;

fn with_seeds(keep: Keep, seeds: &[f64]) -> Case {
    let seed = |&units: &f64| [units * UNIT as f64; 3];
    Case { keep, seeds: seeds.iter().map(seed).collect(), ..shell() }
}

#[test]
fn what_a_seed_reaches_is_flow_and_everything_else_is_not() {
    let meshed = |keep, seeds: &[f64]| sides(&mesh(&with_seeds(keep, seeds)).unwrap().words);
    assert_eq!(meshed(Keep::All, &[]), [1360, 784, 1952], "rays");
    assert_eq!(meshed(Keep::Outside, &[IN_SHELL]), [784, 0, 1952]);
    assert_eq!(meshed(Keep::Inside, &[IN_SHELL]), [0, 784, 1952]);
    assert_eq!(meshed(Keep::All, &[IN_SHELL]), [784, 1360, 1952]);
    assert_eq!(meshed(Keep::Inside, &[IN_CAVITY]), [0, 8, 1952]);
    assert_eq!(meshed(Keep::Inside, &[IN_CAVITY, AROUND]), [0, 1360, 1952]);
    assert_eq!(meshed(Keep::Outside, &[AROUND, AROUND]), [1352, 0, 1952]);
    // A seed in the cavity states that it is flow, although it does not reach the boundary.
    assert_eq!(meshed(Keep::Outside, &[IN_CAVITY]), [8, 0, 1952]);
}

/// A sheet through the whole root, both of whose sides are ambiguous by rays.
#[test]
fn no_component_is_ambiguous_where_seeds_decide() {
    let corner = |x, y| [x * UNIT, y * UNIT, 3 * UNIT + UNIT / 2];
    let corners = [corner(-8, -8), corner(16, -8), corner(16, 16), corner(-8, 16)];
    let sheet = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
    let sheet = case(&sheet, 3);
    assert_eq!(base_tree(&sheet).unwrap().ambiguous.unwrap().components, 2);
    let base = base_tree(&Case { seeds: vec![[1.0; 3]], ..sheet }).unwrap();
    assert_eq!((base.components.outside, base.components.inside, base.ambiguous), (1, 1, None));
}

/// Cells are half units. Cell 3 is the first within the shell and cell 12 the last along each axis.
#[test]
fn a_leaf_contains_its_minimum_corner_and_not_its_maximum_corner() {
    let cell = (UNIT / 2) as f64;
    let at =
        |x: f64| base_tree(&Case { seeds: vec![[x, 2.0 * UNIT as f64, 5.0 * cell]], ..shell() });
    assert!(at(3.0 * cell).is_ok());
    assert!(matches!(at(3.0 * cell - 1.0), Err(Error::SeedCrossing { index: 0, .. })));
    assert!(at(13.0 * cell - 1.0).is_ok());
    assert!(matches!(at(13.0 * cell), Err(Error::SeedCrossing { index: 0, .. })));
    // The boundary of the root, where coordinates are rounded to lattice points first.
    assert!(at(-0.5).is_ok());
    assert!(matches!(at(-0.6), Err(Error::SeedOutside { .. })));
    assert!(at(ROOT_EDGE as f64 - 0.6).is_ok());
    assert!(matches!(at(ROOT_EDGE as f64 - 0.4), Err(Error::SeedOutside { .. })));
    for far in [-1e300, 1e300] {
        assert!(matches!(at(far), Err(Error::SeedOutside { .. })));
    }
    for x in [f64::NAN, f64::INFINITY] {
        assert!(matches!(at(x), Err(Error::Invalid(why)) if why.starts_with("seed 0 is [")));
    }
}

#[test]
fn an_error_names_the_seed_and_the_nearest_free_centroid() {
    let error = |seeds| base_tree(&with_seeds(Keep::Outside, seeds)).unwrap_err().to_string();
    // Cell (1, 1, 1) crosses; the nearest free cells are those with a coordinate of 0, and (1, 1, 0)
    // is the first of these by key.
    let [unit, quarter] = [UNIT as f64, (UNIT / 4) as f64];
    let expected = format!(
        "seed 1 at {:?} lies in a cell that a facet crosses: move it into the flow; \
         the nearest centroid of a free cell is {:?}",
        [0.75 * unit; 3],
        [3.0 * quarter, 3.0 * quarter, quarter]
    );
    assert_eq!(error(&[AROUND, 0.75]), expected);
    let expected = format!(
        "seed 0 at {:?} lies outside the root: move it into the flow; \
         the nearest centroid of a free cell is {:?}",
        [9.0 * unit; 3],
        [31.0 * quarter; 3]
    );
    assert_eq!(error(&[9.0, 0.75]), expected);
    let one_cell = Case { spacing_min: ROOT_EDGE as f64, ..with_seeds(Keep::All, &[1.0]) };
    let message = base_tree(&one_cell).unwrap_err().to_string();
    assert!(message.ends_with("facets cross every cell, so choose a smaller spacing_min"));
}

/// Cases with seeds, and the dense grid of T0 with its crossing cells marked.
fn seeded_cases() -> impl Strategy<Value = RandomCase> {
    cases(FINEST).prop_filter("has seeds", |random| !random.case.seeds.is_empty())
}

fn grid(RandomCase { case, facets, level_surface }: &RandomCase) -> Dense {
    dense::base(case, facets, FINEST, *level_surface)
}

#[test]
fn flow_is_exactly_the_components_with_a_seed() {
    let mixed = Cell::new(0);
    for_all(file!(), 60, seeded_cases(), |random| {
        let case = &random.case;
        let flow = if case.keep == Keep::Inside { Side::Inside } else { Side::Outside } as u64;
        let base = leaves(&base_tree(case).unwrap().words);
        let mut grid = grid(&random);
        let components = dense::components(&mut grid);
        let mut flows = 0;
        for component in &components {
            let has_seed = case.seeds.iter().any(|&seed| grid.contain(component, seed));
            flows += usize::from(has_seed);
            for cell in component {
                let point = cell.index.map(|x| x * (ROOT_EDGE >> FINEST));
                let leaf = base.iter().find(|leaf| leaf.has(point)).unwrap();
                assert_ne!(leaf.side, CROSSING);
                assert_eq!(leaf.side == flow, has_seed, "{leaf:?}");
            }
        }
        mixed.set(mixed.get() + u32::from(flows < components.len()));
    });
    assert!(mixed.get() > 0, "some components must have no seed");
}

/// Moves each seed to another cell of its component, and repeats and reverses the seeds.
#[test]
fn seeds_in_the_same_components_give_the_same_mesh() {
    let inputs = (seeded_cases(), any::<Index>());
    for_all(file!(), 60, inputs, |(random, index)| {
        let mut grid = grid(&random);
        let components = dense::components(&mut grid);
        let moved = random.case.seeds.iter().rev().map(|&seed| {
            let component = components.iter().find(|c| grid.contain(c, seed)).unwrap();
            let cell = component[index.index(component.len())];
            cell.index
                .map(|x| (x * (ROOT_EDGE >> FINEST) + i64::from(index.index(256) as u8)) as f64)
        });
        let seeds = moved.chain(random.case.seeds.iter().copied()).collect();
        let other = Case { seeds, ..random.case.clone() };
        let [one, other] = [&random.case, &other].map(|case| mesh(case).unwrap());
        assert_eq!(one.words, other.words);
        assert_eq!(one.components, other.components);
    });
}

/// With seeds, `enclosed` has no effect.
#[test]
fn enclosed_has_no_effect_where_seeds_decide() {
    for_all(file!(), 40, seeded_cases(), |random| {
        let [delete, keep] = [Enclosed::Delete, Enclosed::Keep]
            .map(|enclosed| mesh(&Case { enclosed, ..random.case.clone() }).unwrap());
        assert_eq!(delete, keep);
        assert_eq!(delete.components.enclosed.count, 0);
    });
}

/// The root is moved by multiples of its lattice unit along with everything in it.
#[test]
fn a_translated_case_has_the_same_mesh() {
    let inputs = (cases(FINEST), uniform3(-1_000_000..1_000_000_i64));
    for_all(file!(), 60, inputs, |(random, by)| {
        let moved = |point: [f64; 3]| std::array::from_fn(|a| point[a] + by[a] as f64);
        let mut other = random.case.clone();
        other.root.origin = moved(other.root.origin);
        for facet in &mut other.facets {
            *facet = facet.map(moved);
        }
        for extent_box in &mut other.boxes {
            (extent_box.min, extent_box.max) = (moved(extent_box.min), moved(extent_box.max));
        }
        for seed in &mut other.seeds {
            *seed = moved(*seed);
        }
        let [one, other] = [&random.case, &other].map(|case| mesh(case).unwrap());
        assert_eq!(one.words, other.words);
        let example = one.components.enclosed.example;
        assert_eq!(example.map(moved), other.components.enclosed.example);
    });
}

/// Every leaf of T0 that no facet crosses is tried. Half of the seeds lie in the root, and the others
/// around it; many are in the middle between centroids.
#[test]
fn the_nearest_free_centroid_is_that_of_an_exhaustive_search() {
    let near = -ROOT_EDGE / 8..ROOT_EDGE * 9 / 8;
    let unit = ROOT_EDGE >> 5;
    let even = uniform3(-4..36_i64).prop_map(move |point| point.map(|x| x * unit));
    let seed = prop_oneof![uniform3(near), even];
    let keep = select(vec![Keep::Outside, Keep::Inside, Keep::All]);
    let [valid, outside, crossing] = [const { Cell::new(0) }; 3];
    for_all(file!(), 400, (cases(FINEST), seed, keep), |(random, seed, keep)| {
        let case = Case { seeds: Vec::new(), keep, ..random.case };
        let base = leaves(&base_tree(&case).unwrap().words);
        let found = base_tree(&Case { seeds: vec![seed.map(|x| x as f64)], ..case });
        let clamped = seed.map(|x| x.clamp(0, ROOT_EDGE));
        let free = base.iter().filter(|leaf| leaf.side != CROSSING);
        let expected = free.min_by_key(|leaf| {
            let centroid = leaf.min.map(|x| x + leaf.edge / 2);
            let square: i64 = (0..3).map(|a| (centroid[a] - clamped[a]).pow(2)).sum();
            (square, leaf.level, leaf.keys.0)
        });
        let expected = expected.map(|leaf| leaf.min.map(|x| (x + leaf.edge / 2) as f64));
        let count = |counter: &Cell<u32>| counter.set(counter.get() + 1);
        match (base.iter().find(|leaf| leaf.has(seed)), found) {
            (None, Err(Error::SeedOutside { index: 0, nearest, .. })) => {
                count(&outside);
                assert_eq!(nearest, expected);
            }
            (Some(leaf), Err(Error::SeedCrossing { index: 0, nearest, .. })) => {
                count(&crossing);
                assert_eq!(leaf.side, CROSSING);
                assert_eq!(nearest, expected);
            }
            (Some(leaf), Ok(_)) => {
                count(&valid);
                assert_ne!(leaf.side, CROSSING);
            }
            (leaf, found) => panic!("seed {seed:?} in {leaf:?}: {found:?}"),
        }
    });
    let counts = [valid, outside, crossing].map(Cell::into_inner);
    assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
}

/// A block without one of its faces.
#[test]
fn a_leak_makes_both_sides_flow() {
    let mut open = block_of_units([2; 3], [6; 3]);
    open.truncate(10);
    let seeds = vec![[4.0 * UNIT as f64; 3]];
    let open = Case { seeds, keep: Keep::Inside, ..case(&open, 4) };
    let base = base_tree(&open).unwrap();
    assert_eq!((base.components.outside, base.components.inside, base.ambiguous), (0, 1, None));
    assert!(leaves(&base.words).iter().all(|leaf| leaf.side == CROSSING || leaf.side == INSIDE));
}

/// A block from 2.5 to 5.5 units with a hole from 3.25 to 4.75 in its upper face. Cells of one unit do not pass, and 8 of them are inside;
/// cells of half a unit pass.
#[test]
fn a_region_that_is_closed_at_twice_the_spacing_has_leaked() {
    let [low, high, from, to] = [10, 22, 13, 19].map(|quarters| quarters * UNIT / 4);
    let closed = block([low; 3], [high; 3]);
    let mut open = closed.clone();
    open.retain(|facet| facet.iter().any(|vertex| vertex[2] != high));
    for [x, y] in [
        [[low, high], [low, from]],
        [[low, high], [to, high]],
        [[low, from], [from, to]],
        [[to, high], [from, to]],
    ] {
        let at = |i: usize, j: usize| [x[i], y[j], high];
        open.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
    }
    let unit = UNIT as f64;
    let leak = Leak {
        spacing_coarse: unit,
        spacing_fine: unit / 2.0,
        volume: 8.0 * unit.powi(3),
        point: [3.5 * unit; 3],
    };
    let outside = || vec![[unit / 5.0; 3]];
    let leaks = |facets: &[[[i64; 3]; 3]], level, keep, seeds| {
        mesh(&Case { keep, seeds, ..case(facets, level) }).unwrap().leaks
    };
    for seeds in [vec![], outside()] {
        assert_eq!(leaks(&open, 4, Keep::Outside, seeds), std::slice::from_ref(&leak));
    }
    // The flow of a seed in the hole's region was meant to be there.
    let seeds = [outside(), vec![[3.6 * unit; 3]]].concat();
    assert_eq!(leaks(&open, 4, Keep::Outside, seeds), []);
    assert_eq!(leaks(&open, 3, Keep::Outside, outside()), []);
    assert_eq!(leaks(&closed, 4, Keep::Outside, outside()), []);
    // Of a surface without open edges, seeds reach what they should, as through a duct; where every facet appears twice, each counts once.
    let doubled =
        [open.clone(), open.clone(), vec![[[low; 3], [low; 3], [high, low, low]]]].concat();
    assert_eq!(leaks(&doubled, 4, Keep::Outside, outside()), std::slice::from_ref(&leak));
    let with_another = [&doubled[..], &block_of_units([7; 3], [8; 3])].concat();
    assert_eq!(leaks(&with_another, 4, Keep::Outside, outside()), []);
    // The flow inside leaks into all that surrounds the 4^3 units of the block and its surface, at four times the spacing, too.
    let around = [1.0, 2.0].map(|units| Leak {
        spacing_coarse: units * unit,
        volume: 448.0 * unit.powi(3),
        point: [unit; 3],
        ..leak.clone()
    });
    assert_eq!(leaks(&open, 4, Keep::Inside, vec![[3.6 * unit; 3]]), around);
    let [two] = &leaks(&open, 5, Keep::Outside, vec![])[..] else { panic!("one is closed") };
    assert_eq!(*two, Leak { spacing_fine: unit / 4.0, ..leak });
}
