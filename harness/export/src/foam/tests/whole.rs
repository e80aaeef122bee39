//! What is found from equal surroundings at once: the points, and the regions.

use super::*;

/// A cut that leaves out about a quarter of the leaves.
fn is_cut(word: u64) -> bool {
    contract::digest::mix(word) % 4 < 1
}

/// The points in Morton order, which is the order of their numbers.
fn assert_sorted(points: &[Point]) {
    let key = |p: &Point| {
        (0..20).rev().map(|bit| (0..3).map(|a| (p[a] >> bit & 1) << a).sum()).collect::<Vec<u32>>()
    };
    assert!(points.windows(2).all(|w| key(&w[0]) < key(&w[1])));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn points_are_the_corners_of_cells_and_of_the_squares_at_missing_cells(words in random_words(5), has_cut in any::<bool>()) {
        let options = options(ASCII);
        let model = model_of(&words, |word| has_cut && is_cut(word), &options);
        let mut expected: BTreeSet<Point> = BTreeSet::new();
        model.visit_all(|_, around, squares| {
            let edge = around.octant.edge();
            let corner = |digit: u32| std::array::from_fn(|a| around.octant.corner[a] + edge * (digit >> a & 1));
            expected.extend((0..8).map(corner));
            expected.extend(squares.iter().flat_map(Square::corners));
        });
        let points = model.all_points();
        assert_sorted(&points);
        prop_assert_eq!(points.into_iter().collect::<BTreeSet<_>>(), expected);
    }

    #[test]
    fn regions_are_the_cells_that_faces_connect(words in random_words(4), one_in in 1u64..5) {
        let options = options(ASCII);
        let holes = words.iter().copied().filter(|&w| contract::digest::mix(w) % 5 < u128::from(one_in));
        let words: Vec<u64> = holes.collect();
        let mut model = model_of(&words, is_cut, &options);
        let cells = model.tree.cells() as usize;
        let (mut sets, mut volumes): (Vec<usize>, _) = ((0..cells).collect(), vec![0; cells]);
        model.visit_all(|cell, around, squares| {
            volumes[cell as usize] = word::span(around.octant.level);
            for across in squares.iter().filter_map(|square| square.across.as_cell()) {
                let (a, b) = (sets[cell as usize], sets[across as usize]);
                sets.iter_mut().filter(|set| **set == a).for_each(|set| *set = b);
            }
        });
        let mut expected: BTreeMap<usize, Size> = BTreeMap::new();
        for cell in 0..cells {
            let size = expected.entry(sets[cell]).or_default();
            size.cells += 1;
            size.volume += volumes[cell];
        }
        let mut expected: Vec<Size> = expected.into_values().collect();
        expected.sort_by_key(|&size| std::cmp::Reverse(size));
        model.ranks = Some(Distribution::equal(cells as u32, 3));
        let ranks = model.ranks.clone().unwrap();
        let before = model.points.count();
        prop_assert_eq!(&connect(&mut model, options::Regions::Largest).unwrap(), &expected);
        let Some(&largest) = expected.first() else { return Ok(()) };
        prop_assert_eq!(u64::from(model.tree.cells()), largest.cells);
        prop_assert_eq!(connect(&mut model, options::Regions::All).unwrap(), vec![largest]);
        // Its cells keep their ranks.
        let region = (0..cells as u32).find(|&c| {
            let of_region = sets.iter().enumerate().filter(|(_, set)| **set == sets[c as usize]);
            Size { cells: of_region.clone().count() as u64, volume: of_region.map(|(cell, _)| volumes[cell]).sum() } == largest
        });
        let region = sets[region.unwrap() as usize];
        let kept = (0..cells as u32).filter(|&c| sets[c as usize] == region);
        let expected: Vec<u32> = kept.map(|c| ranks.place(c).0).collect();
        let retained = model.ranks.as_ref().unwrap();
        prop_assert!((0..model.tree.cells()).map(|c| retained.place(c).0).eq(expected));
        prop_assert!(before >= model.points.count());
    }
}
