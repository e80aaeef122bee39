//! Ray parities, verified by hand and by a second method.
use crate::support;

use proptest::array::{uniform3, uniform4};
use proptest::prelude::*;
use reference::ray::parities;
use std::cell::Cell;
use support::random::{facet, for_all};
use support::{block, crosses_by_axes, parities_by_areas};

/// With few different coordinates, most rays pass through edges and vertices.
#[test]
fn both_methods_agree_on_random_facets() {
    let (tested, odd) = (Cell::new(0), Cell::new(0));
    let inputs = prop_oneof![9 => Just(4_i64), 1 => Just(1 << 27)]
        .prop_flat_map(|greatest| (uniform4(facet(0..=greatest)), uniform3(0..=greatest)));
    for_all(file!(), 30_000, inputs, |(facets, point)| {
        // Rays never start on a facet.
        if facets.iter().any(|facet| crosses_by_axes(facet, point, point)) {
            return;
        }
        for axis in 0..3 {
            let found = parities(&facets, point, axis);
            assert_eq!(found, parities_by_areas(&facets, point, axis), "axis {axis}");
            tested.set(tested.get() + 2);
            odd.set(odd.get() + u32::from(found[0]) + u32::from(found[1]));
        }
    });
    let (tested, odd) = (tested.get(), odd.get());
    assert!(odd > tested / 20, "{odd} of {tested} rays are odd");
}

/// The block has even coordinates, so rays from integer points pass through its edges and
/// diagonals. All six rays from a point inside intersect an odd number of facets, those from a
/// point outside an even number.
#[test]
fn all_rays_agree_on_a_block() {
    let facets = block([2, 2, 2], [6, 8, 10]);
    let mut inside = 0;
    for x in 0..=8 {
        for y in 0..=10 {
            for z in 0..=12 {
                let inside_block =
                    (3..=5).contains(&x) && (3..=7).contains(&y) && (3..=9).contains(&z);
                let outside =
                    !((2..=6).contains(&x) && (2..=8).contains(&y) && (2..=10).contains(&z));
                if !inside_block && !outside {
                    continue;
                }
                for axis in 0..3 {
                    assert_eq!(
                        parities(&facets, [x, y, z], axis),
                        [inside_block; 2],
                        "{x} {y} {z} {axis}"
                    );
                }
                inside += u32::from(inside_block);
            }
        }
    }
    assert_eq!(inside, 3 * 5 * 7);
}

/// A ray along z is displaced by eps along x and by eps^2 along y. Of two facets that share an edge
/// through the point, it intersects the one on the positive side.
#[test]
fn the_displacement_decides_which_facet_at_an_edge_counts() {
    let right = [[0, 0, 5], [4, -1, 5], [4, 1, 5]];
    let left = [[0, 0, 5], [-4, -1, 5], [-4, 1, 5]];
    assert_eq!(parities(&[right], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[left], [0, 0, 0], 2), [false, false]);
    // The edge lies along x, so the second displacement, along y, decides.
    let positive = [[0, 0, 5], [4, 0, 5], [4, 4, 5]];
    let negative = [[0, 0, 5], [4, 0, 5], [4, -4, 5]];
    assert_eq!(parities(&[positive], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[negative], [0, 0, 0], 2), [false, false]);
    // No ray intersects a facet that is parallel to it or has no area.
    let edge_on = [[0, 0, 5], [4, 0, 5], [4, 0, 9]];
    let segment = [[-4, 0, 5], [4, 0, 5], [8, 0, 5]];
    assert_eq!(parities(&[edge_on, segment], [0, 0, 0], 2), [false, false]);
}
