//! The points, and the regions.

use super::*;

/// A cut that leaves out about a quarter of the leaves.
fn is_cut(word: u64) -> bool {
    contract::digest::mix(word) % 4 < 1
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn points_are_the_corners_of_cells_and_of_the_squares_at_missing_cells(words in random_words(5), has_cut in any::<bool>()) {
        let options = options();
        let mesh = mesh_of(&words, |word| has_cut && is_cut(word), &options);
        let mut expected: BTreeSet<Point> = BTreeSet::new();
        mesh.leaves.visit_all(&options, |_, octant, squares| {
            let edge = octant.edge();
            let corner = |digit: u32| std::array::from_fn(|a| octant.corner[a] + edge * (digit >> a & 1));
            expected.extend((0..8).map(corner));
            expected.extend(squares.iter().flat_map(|square| square.corners(true)));
        });
        let points = mesh.points.all;
        prop_assert_eq!(points.len(), expected.len());
        prop_assert_eq!(points.into_iter().collect::<BTreeSet<_>>(), expected);
    }

    #[test]
    fn regions_are_the_cells_that_faces_connect(words in random_words(4), one_in in 1u64..5) {
        let mut options = options();
        let holes = words.iter().copied().filter(|&w| contract::digest::mix(w) % 5 < u128::from(one_in));
        let words: Vec<u64> = holes.collect();
        let leaves = leaves_of(&words, is_cut);
        let cells = leaves.count() as usize;
        let (mut sets, mut volumes): (Vec<usize>, _) = ((0..cells).collect(), vec![0; cells]);
        leaves.visit_all(&options, |cell, octant, squares| {
            volumes[cell as usize] = word::span(octant.level);
            for across in squares.iter().filter_map(|square| square.across.as_cell()) {
                let (a, b) = (sets[cell as usize], sets[across as usize]);
                sets.iter_mut().filter(|set| **set == a).for_each(|set| *set = b);
            }
        });
        let mut expected: BTreeMap<usize, u64> = BTreeMap::new();
        (0..cells).for_each(|cell| *expected.entry(sets[cell]).or_default() += volumes[cell]);
        let Some(largest) = expected.values().max() else { return Ok(()) };
        // The one that has the first cell, of several that are as large.
        let region = sets[(0..cells).find(|&cell| expected[&sets[cell]] == *largest).unwrap()];
        let kept: Vec<usize> = (0..cells).filter(|&cell| sets[cell] == region).collect();
        options.regions = Regions::Largest;
        let ranks = Some((0..cells as u32).map(|cell| cell % 7).collect());
        let mesh = Mesh::new(leaves, ranks, Patches::new(None, true), &options).unwrap();
        prop_assert_eq!(mesh.regions, expected.len());
        // Its cells keep their ranks.
        let ranks: Vec<u32> = kept.iter().map(|&cell| cell as u32 % 7).collect();
        prop_assert_eq!((mesh.leaves.count() as usize, mesh.ranks.unwrap()), (kept.len(), ranks));
    }
}
