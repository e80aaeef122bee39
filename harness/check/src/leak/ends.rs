//! The ends of a path: points of the user, and the leaves that contain them.

use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::word;

use super::leaves::{Leaves, is_free};
use super::search::Goal;

/// Where a path ends, in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// The far field: any leaf at the root's boundary.
    Far,
    /// The leaf that contains a point.
    Point([f64; 3]),
}

/// A point on the lattice.
///
/// # Errors
/// One sentence, if the point is outside the root.
pub fn on_lattice(what: &str, at: [f64; 3], root: &Root) -> Result<[i64; 3], String> {
    let inside = |q: &[i64; 3]| q.iter().all(|c| (0..=UNITS_PER_EDGE).contains(c));
    root.quantise(at).filter(inside).ok_or_else(|| {
        let far = root.rounded(root.to_user([UNITS_PER_EDGE; 3]));
        format!(
            "{what} {at:?} is outside the root, which extends from {:?} to {far:?}",
            root.rounded(root.origin)
        )
    })
}

/// The free leaf that contains a lattice point.
///
/// # Errors
/// One sentence with the nearest centre of a free leaf, if facets cross the leaf.
pub fn free_leaf(what: &str, at: [i64; 3], leaves: &Leaves, root: &Root) -> Result<u32, String> {
    let leaf = leaves.locate(at);
    if leaves.is_free(leaf) {
        return Ok(leaf);
    }
    let user = |at| root.rounded(root.to_user(at));
    let (point, level) = (user(at), leaves.octant(leaf).level);
    let place = format!("{what} {point:?} is in a leaf of level {level} that facets cross");
    Err(match nearest_free_centre(at, leaves.words()) {
        Some(near) => {
            format!("{place}; the nearest centre of a free leaf is {:?}", user(near))
        }
        None => format!("{place}, and there are no free leaves: use a smaller spacing_min"),
    })
}

/// The nearest centre of a free leaf, exactly; of equally near ones that of the coarsest leaf, then of the first.
fn nearest_free_centre(at: [i64; 3], words: &[u64]) -> Option<[i64; 3]> {
    let candidate = |&w: &u64| {
        let octant = word::octant(w);
        let centre = octant.centre();
        let squared: i64 = (0..3).map(|a| (centre[a] - at[a]) * (centre[a] - at[a])).sum();
        (squared, octant.level, word::key(w), centre)
    };
    let free = words.iter().filter(|w| is_free(**w)).map(candidate);
    free.min_by_key(|&(squared, level, key, _)| (squared, level, key)).map(|(.., centre)| centre)
}

/// The ends of a path in one base tree; `None` if an end lies in a crossing leaf of this tree, with the reason.
pub fn in_tree(
    from: [i64; 3],
    to: Option<[i64; 3]>,
    leaves: &Leaves,
) -> Result<(u32, Goal), &'static str> {
    let start = leaves.locate(from);
    if !leaves.is_free(start) {
        return Err("facets cross the leaf of the start");
    }
    match to.map(|at| leaves.locate(at)) {
        None => Ok((start, Goal::Far)),
        Some(goal) if leaves.is_free(goal) => Ok((start, Goal::Place(goal))),
        Some(_) => Err("facets cross the leaf of the end"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{random_words, words_with_sides};
    use contract::word::Side;
    use proptest::prelude::*;

    const ROOT: Root = Root { origin: [0.0; 3], edge: 8.0 };

    #[test]
    fn a_point_in_a_crossing_leaf_is_refused_with_the_nearest_free_centre() {
        // Leaves of edge 4, two of them crossing; one of edge 2 per axis is not needed.
        let crossing = |digit: u8| if digit < 2 { Side::Crossing } else { Side::Outside };
        let words = words_with_sides(|o| o.level < 1, |o| Some(crossing(o.digit())));
        let leaves = Leaves::new(&words).unwrap();
        let leaf =
            |at: [f64; 3]| free_leaf("--from", on_lattice("--from", at, &ROOT)?, &leaves, &ROOT);
        assert_eq!(leaf([1.0, 5.0, 1.0]), Ok(2));
        // On an upper face of the root, and in the leaf above a common face.
        assert_eq!(leaf([8.0; 3]), Ok(7));
        assert_eq!(leaf([1.0, 4.0, 1.0]), Ok(2));
        let why = leaf([1.0, 3.0, 1.0]).unwrap_err();
        assert!(why.contains("[1.0, 3.0, 1.0]") && why.contains("[2.0, 6.0, 2.0]"), "{why}");
        // Equally near to leaves 2 and 4.
        let why = leaf([2.0, 2.0, 2.0]).unwrap_err();
        assert!(why.contains("[2.0, 6.0, 2.0]"), "{why}");
        assert!(leaf([9.0, 1.0, 1.0]).unwrap_err().contains("outside the root"));
        assert!(leaf([f64::NAN, 1.0, 1.0]).unwrap_err().contains("outside the root"));
    }

    #[test]
    fn the_ends_of_a_path_are_free_leaves() {
        let crossing = |digit: u8| if digit < 2 { Side::Crossing } else { Side::Outside };
        let words = words_with_sides(|o| o.level < 1, |o| Some(crossing(o.digit())));
        let leaves = Leaves::new(&words).unwrap();
        let (crossed, free) = ([UNITS_PER_EDGE / 4; 3], [3 * UNITS_PER_EDGE / 4; 3]);
        assert_eq!(
            in_tree(crossed, None, &leaves).err(),
            Some("facets cross the leaf of the start")
        );
        assert_eq!(
            in_tree(free, Some(crossed), &leaves).err(),
            Some("facets cross the leaf of the end")
        );
        assert!(matches!(in_tree(free, None, &leaves), Ok((7, Goal::Far))));
        assert!(matches!(in_tree(free, Some(free), &leaves), Ok((7, Goal::Place(7)))));
    }

    proptest! {
        #[test]
        fn no_centre_of_a_free_leaf_is_nearer(words in random_words(3), at in prop::array::uniform3(0..=UNITS_PER_EDGE)) {
            let squared = |centre: [i64; 3]| (0..3).map(|a| i128::from(centre[a].abs_diff(at[a])).pow(2)).sum::<i128>();
            let free = words.iter().filter(|&&w| word::side(w) != Side::Crossing);
            let expected = free.map(|&w| squared(word::octant(w).centre())).min();
            prop_assert_eq!(nearest_free_centre(at, &words).map(squared), expected);
        }
    }
}
