//! Octant algebra, tested on all octants to level 3.
use crate::support;

use reference::octant::{Extent, LEVEL_MAX, Octant, Side};
use support::ROOT_EDGE;

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
            assert!((0..3).all(|a| child.min[a] >= extent.min[a]));
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
