//! The crossing test by cutting against the crossing test by separating axes.
mod support;

use reference::crossing::crosses;
use reference::octant::Extent;
use support::{Seeded, crosses_by_axes};

fn agree(facet: &[[i64; 3]; 3], extent: &Extent) -> bool {
    let crossing = crosses(facet, extent);
    let by_axes = crosses_by_axes(facet, extent.min, extent.max);
    assert_eq!(crossing, by_axes, "facet {facet:?}, box {extent:?}");
    crossing
}

/// Coordinates so few that touching, lying in a plane and having no area are the rule.
#[test]
fn small_coordinates() {
    let mut seeded = Seeded::new(1);
    let mut crossing = 0;
    for round in 0..300_000 {
        let reach = 3 + round % 6;
        let facet: [[i64; 3]; 3] =
            std::array::from_fn(|_| std::array::from_fn(|_| seeded.of(0..=reach)));
        let min: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=reach - 1));
        let edge = seeded.of(1..=2);
        crossing += u32::from(agree(&facet, &Extent { min, max: min.map(|x| x + edge) }));
    }
    assert!((50_000..250_000).contains(&crossing), "both answers occur: {crossing}");
}

/// Points and segments: facets that repeat a vertex or have all three in a line.
#[test]
fn degenerate_facets() {
    let mut seeded = Seeded::new(2);
    for _ in 0..100_000 {
        let a: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=6));
        let step: [i64; 3] = std::array::from_fn(|_| seeded.of(-3..=3));
        let (second, third) = (seeded.of(0..=2), seeded.of(-1..=2));
        let along = |times: i64| std::array::from_fn(|i| a[i] + times * step[i]);
        let min: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=5));
        let extent = Extent { min, max: min.map(|x| x + 1) };
        agree(&[a, along(second), along(third)], &extent);
        agree(&[a, a, a], &extent);
    }
}

/// The greatest coordinates there are, where an overflow would show.
#[test]
fn great_coordinates() {
    let mut seeded = Seeded::new(3);
    let (lo, hi) = (-(1 << 27), 1 << 28);
    for _ in 0..100_000 {
        let facet: [[i64; 3]; 3] = std::array::from_fn(|_| {
            std::array::from_fn(|_| {
                if seeded.chance(1, 3) { seeded.pick(&[lo, hi]) } else { seeded.of(lo..=hi) }
            })
        });
        let level = seeded.of(0..=19);
        let edge = (1 << 27) >> level;
        let min: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=(1 << level) - 1) * edge);
        agree(&facet, &Extent { min, max: min.map(|x| x + edge) });
    }
}

#[test]
fn what_touches_crosses() {
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
