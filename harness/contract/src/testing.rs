//! Small meshes for tests, explicit or random.

use proptest::prelude::*;
use std::fs;
use std::path::Path;

use crate::import::cells::Cells;
use crate::lattice::{FacetLattice, Root};
use crate::leafset::LeafSet;
use crate::manifest::Manifest;
use crate::octant::{CELLS_PER_EDGE, Octant};
use crate::triangle::Triangle;
use crate::word::{self, Side};

/// The leaves of the tree in which an octant is split iff `split` returns true, all with side outside.
pub fn words_of(split: impl Fn(&Octant) -> bool) -> Vec<u64> {
    words_with_sides(split, |_| Some(Side::Outside))
}

/// The leaves of such a tree with the sides that `side` returns; a leaf for which it returns `None` is left out.
pub fn words_with_sides(
    split: impl Fn(&Octant) -> bool,
    side: impl Fn(&Octant) -> Option<Side>,
) -> Vec<u64> {
    let mut words = Vec::new();
    let mut stack = vec![Octant::ROOT];
    while let Some(octant) = stack.pop() {
        if split(&octant) {
            stack.extend((0..8).map(|d| octant.child(d)));
        } else if let Some(side) = side(&octant) {
            words.push(word::encode(octant, side));
        }
    }
    words.sort_unstable();
    words
}

/// The base tree of facets at the surface level of each octant, which boxes may raise. All leaves that no facet crosses are outside.
pub fn base_tree(facets: &[FacetLattice], level: impl Fn(&Octant) -> u8) -> Vec<u64> {
    type Level<'a> = &'a dyn Fn(&Octant) -> u8;
    fn refine(octant: Octant, facets: &[Triangle], level: Level, words: &mut Vec<u64>) {
        let (low, high) = octant.bounds();
        let crossing: Vec<Triangle> =
            facets.iter().filter(|f| f.meets(low, high)).cloned().collect();
        if !crossing.is_empty() && octant.level < level(&octant) {
            return (0..8).for_each(|d| refine(octant.child(d), &crossing, level, words));
        }
        let side = if crossing.is_empty() { Side::Outside } else { Side::Crossing };
        words.push(word::encode(octant, side));
    }
    let facets: Vec<Triangle> = facets.iter().map(Triangle::new).collect();
    let mut words = Vec::new();
    refine(Octant::ROOT, &facets, &level, &mut words);
    words
}

/// Random trees up to this level, with random sides and holes.
pub fn random_words(level: u8) -> impl Strategy<Value = Vec<u64>> {
    any::<u64>().prop_map(move |seed| {
        words_with_sides(
            |o| o.level < level && pick(seed, o, 0) % 5 < 3,
            |o| Side::ALL.get(pick(seed, o, 1) as usize % 4).copied(),
        )
    })
}

/// Trees that are refined towards a point, steeply or gently, so that about half of them have layers that are
/// thick enough. A few leaves are missing, and a few are crossing.
pub fn graded_words(level: u8) -> impl Strategy<Value = Vec<u64>> {
    let point = prop::array::uniform3(0..CELLS_PER_EDGE);
    (point, 0.1f64..3.5, any::<u64>(), 0u64..40).prop_map(move |(point, reach, seed, odd)| {
        let near = |o: &Octant| {
            let distances = (0..3).map(|a| {
                let (low, coordinate) = (i64::from(o.corner[a]), i64::from(point[a]));
                (low - coordinate).max(coordinate - low - i64::from(o.edge())).max(0)
            });
            distances.fold(0, i64::max) as f64 <= reach * f64::from(o.edge())
        };
        words_with_sides(
            |o| o.level < level && near(o),
            |o| match pick(seed, o, 2) % 100 {
                p if p < odd / 2 => None,
                p if p < odd => Some(Side::Crossing),
                _ => Some(Side::Outside),
            },
        )
    })
}

/// A pseudorandom number that depends on its arguments only.
fn pick(seed: u64, octant: &Octant, salt: u32) -> u64 {
    let word = word::key_of(octant.corner) << 5 | u64::from(octant.level);
    (crate::digest::mix(word ^ seed.rotate_left(salt * 8)) >> 100) as u64
}

/// Compares a text with that of a file, given relative to the package. If it differs as intended, copy the file that the message
/// names.
pub fn assert_text(text: &str, expected: &str) {
    let name = Path::new(expected).file_name().expect("the path of a file");
    if text != fs::read_to_string(expected).unwrap_or_default() {
        let found = std::env::temp_dir().join(name);
        fs::write(&found, text).expect("the directory of temporary files is writable");
        panic!("{} differs from {expected}", found.display());
    }
}

/// A mesh of these parts with a correct manifest. Its inputs delete nothing and require no refinement.
pub fn leaf_set(parts: Vec<Vec<u64>>) -> LeafSet {
    let root = Root { origin: [0.0; 3], edge: 8.0 };
    let empty = Manifest::without_leaves(root, "test".to_owned());
    LeafSet::new(empty, Vec::new()).with_parts(parts)
}

/// The cells of leaf words.
pub fn cells_of(words: &[u64], root: &Root) -> Cells {
    let mut cells = Cells::default();
    for octant in words.iter().map(|&w| word::octant(w)) {
        cells.push(root.to_user(octant.bounds().0), root.edge_of(octant.level));
    }
    cells.sides = Some(words.iter().map(|&w| word::side(w)).collect());
    cells
}

/// The octants of the leaves and all their ancestors, without duplicates.
pub fn octants_of(words: &[u64]) -> Vec<Octant> {
    let mut all: Vec<Octant> = Vec::new();
    for octant in words.iter().map(|&w| word::octant(w)) {
        all.extend((0..=octant.level).map(|l| octant.ancestor(l)));
    }
    all.sort_unstable_by_key(|o| (o.level, o.corner));
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_must_be_that_of_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("expected.txt").to_string_lossy().into_owned();
        fs::write(&path, "text").unwrap();
        assert_text("text", &path);
        assert!(std::panic::catch_unwind(|| assert_text("other", &path)).is_err());
    }

    #[test]
    fn a_base_tree_is_split_where_a_facet_crosses_it() {
        const UNIT: i64 = crate::lattice::UNITS_PER_EDGE / 8;
        let facet = [[1, 1, 1], [2, 1, 1], [1, 2, 1]].map(|v: [i64; 3]| v.map(|c| c * UNIT + 5));
        let crosses = |octant: &Octant| {
            let (low, high) = octant.bounds();
            Triangle::new(&facet).meets(low, high)
        };
        let side = |o: &Octant| if crosses(o) { Side::Crossing } else { Side::Outside };
        for level in 0..4 {
            let expected = words_with_sides(|o| o.level < level && crosses(o), |o| Some(side(o)));
            assert_eq!(base_tree(&[facet], |_| level), expected);
            assert!(expected.len() > 7 * usize::from(level), "level {level}");
        }
    }

    #[test]
    fn pseudorandom_numbers_differ_by_octant_seed_and_salt() {
        let octants = octants_of(&words_of(|o| o.level < 2));
        let numbers = |seed, salt| octants.iter().map(move |o| pick(seed, o, salt));
        let seeds = [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03];
        let mut all: Vec<u64> = (0..4).flat_map(|i| numbers(seeds[i / 2], i as u32 % 2)).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 4 * (1 + 8 + 64));
        assert!(all.iter().all(|&number| number < 1 << 28));
    }
}
