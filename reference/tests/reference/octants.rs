//! Octant algebra, tested on all octants to level 3; and the crossing test, which clips, agrees with a second one, which uses
//! separating axes.

use crate::support;
use proptest::array::uniform3;
use proptest::prelude::*;
use reference::crossing::crosses;
use reference::octant::{Extent, LEVEL_MAX, Octant, Side};
use std::cell::Cell;
use support::{Facet, facet, for_all};
use support::{ROOT_EDGE, crosses_by_axes};

/// All octants down to level 3.
fn octants() -> Vec<Octant> {
    let mut octants = vec![Octant::ROOT];
    let mut parents = 0;
    while octants[parents].level < 3 {
        let parent = octants[parents];
        octants.extend((0..8).map(|i| parent.child(i)));
        parents += 1;
    }
    octants
}

#[test]
fn children_tile_their_parent_in_morton_order() {
    let octants = octants();
    assert_eq!(octants.len(), 1 + 8 + 64 + 512);
    for octant in octants {
        let extent = octant.extent();
        let children: Vec<Octant> = (0..8).map(|i| octant.child(i)).collect();
        assert_eq!(children[0].key(), octant.key());
        assert_eq!(children[7].extent().max, extent.max);
        assert!(children.is_sorted_by_key(Octant::key));
        for (i, child) in children.iter().enumerate() {
            assert_eq!((child.level, child.edge() * 2), (octant.level + 1, octant.edge()));
            assert!((0..3).all(|a| child.extent().min[a] >= extent.min[a]));
            assert!((0..3).all(|a| child.extent().max[a] <= extent.max[a]));
            for other in &children[..i] {
                assert!(!child.extent().interiors_meet(&other.extent()));
            }
        }
    }
}

/// The interiors of two octants meet if and only if one octant contains the other. The octants
/// touch if and only if their closed cubes share a corner of the level-3 grid.
#[test]
fn octants_meet_if_nested_and_touch_if_they_share_a_corner() {
    let octants = octants();
    let cell = ROOT_EDGE / 8;
    let grid = |extent: &Extent, a: usize| extent.min[a] / cell..=extent.max[a] / cell;
    for p in &octants {
        for q in &octants {
            let coarser = p.level.min(q.level);
            let ancestor = |o: &Octant| o.key() >> (3 * (LEVEL_MAX - coarser));
            let nested = ancestor(p) == ancestor(q);
            assert_eq!(p.extent().interiors_meet(&q.extent()), nested, "{p:?} {q:?}");
            let touch =
                (0..3).all(|a| grid(&p.extent(), a).any(|x| grid(&q.extent(), a).contains(&x)));
            assert_eq!(p.extent().enlarged(1).interiors_meet(&q.extent()), touch, "{p:?} {q:?}");
        }
    }
}

#[test]
fn boxes_without_volume_have_no_interior() {
    let flat = Extent { min: [0, 0, ROOT_EDGE / 3], max: [ROOT_EDGE, ROOT_EDGE, ROOT_EDGE / 3] };
    assert!(!flat.interiors_meet(&Octant::ROOT.extent()));
    assert!(!Octant::ROOT.extent().interiors_meet(&flat));
}

#[test]
fn leaf_words_are_distinct_and_encode_key_level_and_side() {
    let mut words = Vec::new();
    for octant in octants() {
        for side in [Side::Outside, Side::Inside, Side::Crossing] {
            let word = octant.word(side);
            assert_eq!((word & 3, word >> 2 & 31), (side as u64, u64::from(octant.level)));
            assert_eq!(word >> 7, octant.key());
            words.push(word);
        }
    }
    words.sort_unstable();
    words.dedup();
    assert_eq!(words.len(), 3 * (1 + 8 + 64 + 512));
}

#[test]
fn the_last_octant_of_level_19_has_the_greatest_key() {
    let mut octant = Octant::ROOT;
    for _ in 0..LEVEL_MAX {
        octant = octant.child(7);
    }
    assert_eq!((octant.edge(), octant.key()), (256, (1 << 57) - 1));
    assert_eq!(octant.centroid(), [ROOT_EDGE - 128; 3]);
}

fn assert_agree(facet: &Facet, extent: &Extent) -> bool {
    let crossing = crosses(facet, extent);
    let by_axes = crosses_by_axes(facet, extent.min, extent.max);
    assert_eq!(crossing, by_axes, "facet {facet:?}, box {extent:?}");
    crossing
}

/// A cube with its minimum corner in a range and an edge of 1 or 2.
fn cube(range: std::ops::RangeInclusive<i64>) -> impl Strategy<Value = Extent> {
    (uniform3(range), 1..=2_i64).prop_map(|(min, edge)| Extent { min, max: min.map(|x| x + edge) })
}

/// With few different coordinates, most facets touch a corner, lie in a plane or have no area.
#[test]
fn both_tests_agree_on_small_coordinates() {
    let (tested, crossing) = (Cell::new(0), Cell::new(0));
    let inputs =
        (3..=8_i64).prop_flat_map(|greatest| (facet(0..=greatest), cube(0..=greatest - 1)));
    for_all(file!(), 300_000, inputs, |(facet, extent)| {
        tested.set(tested.get() + 1);
        crossing.set(crossing.get() + u32::from(assert_agree(&facet, &extent)));
    });
    let (tested, crossing) = (tested.get(), crossing.get());
    assert!((tested / 6..tested * 5 / 6).contains(&crossing), "{crossing} of {tested} cross");
}

/// Facets that are points or segments: all vertices are equal or collinear.
#[test]
fn both_tests_agree_on_degenerate_facets() {
    let inputs = (uniform3(0..=6_i64), uniform3(-3..=3_i64), 0..=2_i64, -1..=2_i64, cube(0..=5));
    for_all(file!(), 100_000, inputs, |(a, step, second, third, extent)| {
        let point = |times: i64| std::array::from_fn(|i| a[i] + times * step[i]);
        assert_agree(&[a, point(second), point(third)], &extent);
        assert_agree(&[a, a, a], &extent);
    });
}

/// The greatest coordinates that the lattice allows, where arithmetic could overflow.
#[test]
fn both_tests_agree_on_the_greatest_coordinates() {
    let (lo, hi) = (-(1_i64 << 27), 1_i64 << 28);
    let coordinate = prop_oneof![1 => Just(lo), 1 => Just(hi), 4 => lo..=hi];
    let octant =
        (0..=19_u32).prop_flat_map(|level| (Just(1 << 27 >> level), uniform3(0..1_i64 << level)));
    let inputs = (uniform3(uniform3(coordinate)), octant);
    for_all(file!(), 100_000, inputs, |(facet, (edge, index))| {
        let min = index.map(|x| x * edge);
        assert_agree(&facet, &Extent { min, max: min.map(|x| x + edge) });
    });
}

#[test]
fn a_facet_that_touches_a_box_crosses_it() {
    let extent = Extent { min: [4; 3], max: [6; 3] };
    let in_the_face_plane = [[6, 0, 0], [6, 9, 0], [6, 0, 20]];
    let corner_only = [[6, 6, 6], [9, 7, 8], [7, 9, 9]];
    let edge_only = [[6, 6, 0], [6, 6, 9], [9, 9, 4]];
    let past_the_corner = [[12, 1, 6], [1, 12, 6], [12, 12, 6]];
    let plane_through_the_corner = [[12, 0, 6], [0, 12, 6], [12, 12, 6]];
    assert!(crosses(&in_the_face_plane, &extent));
    assert!(crosses(&corner_only, &extent));
    assert!(crosses(&edge_only, &extent));
    assert!(!crosses(&past_the_corner, &extent));
    assert!(crosses(&plane_through_the_corner, &extent));
    assert!(crosses(&[[5; 3]; 3], &extent), "a point inside");
    assert!(!crosses(&[[5, 5, 7]; 3], &extent), "a point above");
}
