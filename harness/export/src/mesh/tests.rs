use super::*;
use crate::testing::on_disk;
use contract::octant::Octant;
use contract::testing::random_words;
use contract::word::Side;
use proptest::prelude::*;

fn words(mesh: &Mesh, selection: &Selection) -> Result<Vec<u64>, Failure> {
    let mut words = Vec::new();
    mesh.visit(selection, &|| Ok(()), &mut |leaf| {
        words.push(word::encode(&word::Leaf { octant: leaf.octant, side: leaf.side }));
        Ok(())
    })?;
    Ok(words)
}

proptest! {
    #[test]
    fn all_leaves_of_interleaved_parts_are_visited_in_order(
        leaves in random_words(5), parts in 1usize..4, run in 1usize..40
    ) {
        let (_dir, mesh) = on_disk(&leaves, parts, |i| i / run);
        prop_assert_eq!(&words(&mesh, &Selection::default()).unwrap(), &leaves);
    }

    #[test]
    fn a_selection_has_the_leaves_that_satisfy_it(
        leaves in random_words(5), axis in 0usize..3, at in 0.0f64..=1.0, level in 0u8..6
    ) {
        let (_dir, mesh) = on_disk(&leaves, 2, |i| i / 9);
        let slice = crate::selection::Slice::new(&mesh.manifest.root, axis, at);
        let selection = Selection { slice, level_max: Some(level), rank: Some(1), ..Selection::default() };
        let mut expected = Vec::new();
        let mut index = 0;
        mesh.visit(&Selection::default(), &|| Ok(()), &mut |leaf| {
            assert_eq!(leaf.index, index);
            index += 1;
            expected.extend(selection.has(&leaf).then(|| {
                word::encode(&word::Leaf { octant: leaf.octant, side: leaf.side })
            }));
            Ok(())
        }).unwrap();
        prop_assert_eq!(words(&mesh, &selection).unwrap(), expected);
    }
}

#[test]
fn leaves_out_of_order_and_invalid_words_are_errors_that_name_the_leaf() {
    let leaves: Vec<u64> = contract::testing::words_of(|o| o.level < 1);
    let mut swapped = leaves.clone();
    swapped.swap(2, 3);
    let mut overlapping = leaves.clone();
    overlapping.insert(0, word::encode(&word::Leaf { octant: Octant::ROOT, side: Side::Inside }));
    let invalid: Vec<u64> = leaves.iter().map(|w| w | 3).collect();
    for (leaves, expected) in [
        (swapped, "precedes the leaf before"),
        (overlapping, "overlaps or precedes"),
        (invalid, "is not a leaf"),
    ] {
        let (_dir, mesh) = on_disk(&leaves, 1, |_| 0);
        let error = words(&mesh, &Selection::default()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
