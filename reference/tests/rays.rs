//! Rays: by hand, and against a second way of counting.
mod support;

use reference::ray::parities;
use support::{Seeded, block, crosses_by_axes, parities_by_areas};

/// Few coordinates, so that rays through edges and vertices are the rule.
#[test]
fn any_facets() {
    let mut seeded = Seeded::new(4);
    let mut odd = 0;
    for round in 0..30_000 {
        let reach = if round % 10 == 0 { 1 << 27 } else { 4 };
        let facets: Vec<[[i64; 3]; 3]> = (0..4)
            .map(|_| std::array::from_fn(|_| std::array::from_fn(|_| seeded.of(0..=reach))))
            .collect();
        let point: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=reach));
        // Rays start on no facet.
        if facets.iter().any(|facet| crosses_by_axes(facet, point, point)) {
            continue;
        }
        for axis in 0..3 {
            let found = parities(&facets, point, axis);
            assert_eq!(
                found,
                parities_by_areas(&facets, point, axis),
                "{facets:?} {point:?} {axis}"
            );
            odd += u32::from(found[0]) + u32::from(found[1]);
        }
    }
    assert!(odd > 5_000, "rays meet facets: {odd}");
}

/// A block on even coordinates, whose edges and diagonals the rays from whole points run into: every
/// point within must see an odd number of facets along all six rays, and every point without an even.
#[test]
fn block_from_everywhere() {
    let facets = block([2, 2, 2], [6, 8, 10]);
    let mut inside = 0;
    for x in 0..=8 {
        for y in 0..=10 {
            for z in 0..=12 {
                let within = (3..=5).contains(&x) && (3..=7).contains(&y) && (3..=9).contains(&z);
                let without =
                    !((2..=6).contains(&x) && (2..=8).contains(&y) && (2..=10).contains(&z));
                if !within && !without {
                    continue;
                }
                for axis in 0..3 {
                    assert_eq!(
                        parities(&facets, [x, y, z], axis),
                        [within; 2],
                        "{x} {y} {z} {axis}"
                    );
                }
                inside += u32::from(within);
            }
        }
    }
    assert_eq!(inside, 3 * 5 * 7);
}

/// Along z the ray is moved a little along x and very little along y: the facet to the right of an
/// edge through the point is met, the one to its left is not.
#[test]
fn displacement() {
    let right = [[0, 0, 5], [4, -1, 5], [4, 1, 5]];
    let left = [[0, 0, 5], [-4, -1, 5], [-4, 1, 5]];
    assert_eq!(parities(&[right], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[left], [0, 0, 0], 2), [false, false]);
    // The x axis itself is the edge: the second displacement, along y, decides.
    let above_it = [[0, 0, 5], [4, 0, 5], [4, 4, 5]];
    let below_it = [[0, 0, 5], [4, 0, 5], [4, -4, 5]];
    assert_eq!(parities(&[above_it], [0, 0, 0], 2), [false, true]);
    assert_eq!(parities(&[below_it], [0, 0, 0], 2), [false, false]);
    // Edge-on facets and facets without area are never met.
    let edge_on = [[0, 0, 5], [4, 0, 5], [4, 0, 9]];
    let segment = [[-4, 0, 5], [4, 0, 5], [8, 0, 5]];
    assert_eq!(parities(&[edge_on, segment], [0, 0, 0], 2), [false, false]);
}
