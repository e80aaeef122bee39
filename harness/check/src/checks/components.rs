//! The components of T0's leaves, their sides, and which of them are enclosed (reference/DEFINITION.md,
//! sections 4 and 5).

use contract::lattice::FacetLattice;
use contract::manifest::Manifest;
use contract::neighbourhood::across;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::sets::Sets;
use contract::word::{self, Side, leaf_at};
use rustc_hash::FxHashMap;

/// Number of candidates whose rays are computed before the majority decides.
const CANDIDATES_MAX: usize = 32;

/// Leaves that are connected through faces without a crossing leaf in between.
#[derive(Clone, Debug)]
pub struct Component {
    /// Indices of its leaves, by level and then by key.
    pub leaves: Vec<u32>,
    /// The side that seeds or, without seeds, rays determine.
    pub side: Side,
    /// What decides its side.
    pub decision: Decision,
    /// The first candidate.
    pub first: Octant,
    /// Whether it is outside and yet deleted, because the far field does not reach it.
    pub enclosed: bool,
}

/// What decides the side of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// The words of its leaves state it.
    Stated,
    /// The seed with this index lies in it.
    Seed(usize),
    /// No seed lies in it.
    NoSeed,
    /// The six rays of this candidate agree, and those of no candidate before it.
    Rays(Octant),
    /// The rays of no candidate agree. The majority of the rays of this many candidates, and how many of them are odd.
    Majority(usize, usize),
}

impl Component {
    /// Whether the rays of no candidate agreed.
    pub fn is_ambiguous(&self) -> bool {
        matches!(self.decision, Decision::Majority(..))
    }
}

/// The components of sorted leaves that tile the root.
pub fn find(words: &[u64], inputs: &Manifest, facets: &[FacetLattice]) -> Vec<Component> {
    if inputs.seeds.is_empty() {
        let parity = Parity::new(facets);
        return decided(words, inputs, |leaves| by_rays(leaves, words, &parity));
    }
    let (seeded, flow) = (seeded_leaves(words, inputs), inputs.side_of_flow());
    let other = if flow == Side::Inside { Side::Outside } else { Side::Inside };
    // A component with a seed is flow; any other has the other side.
    decided(words, inputs, |leaves| match seed_in(leaves, &seeded) {
        Some(seed) => (flow, Decision::Seed(seed)),
        None => (other, Decision::NoSeed),
    })
}

/// The components of sorted leaves that do not overlap, with the sides that their words state.
pub fn stated(words: &[u64], inputs: &Manifest) -> Vec<Component> {
    let side = |leaves: &[u32]| word::side(words[leaves[0] as usize]);
    decided(words, inputs, |leaves| (side(leaves), Decision::Stated))
}

fn decided(
    words: &[u64],
    inputs: &Manifest,
    decide: impl Fn(&[u32]) -> (Side, Decision),
) -> Vec<Component> {
    let component = |leaves: Vec<u32>| {
        let (side, decision) = decide(&leaves);
        let first = word::octant(words[leaves[0] as usize]);
        let enclosed = side == Side::Outside && !touches_boundary(words, &leaves);
        Component { leaves, side, decision, first, enclosed }
    };
    let mut components: Vec<Component> = groups(words).into_iter().map(component).collect();
    let has_far_field = components.iter().any(|c| c.side == Side::Outside && !c.enclosed);
    if !(inputs.deletes_enclosed() && has_far_field) {
        components.iter_mut().for_each(|component| component.enclosed = false);
    }
    components
}

/// Leaves that are not crossing, grouped by connection through faces. A group has the indices of its leaves, by
/// level and then by key. The words are sorted leaves that do not overlap.
pub fn groups(words: &[u64]) -> Vec<Vec<u32>> {
    let mut sets = Sets::new(words.len());
    let free = || (0..).zip(words).filter(|(_, w)| !word::is_crossing(**w));
    for (i, &w) in free() {
        let octant = word::octant(w);
        let free = coarse_neighbours(words, &octant).filter(|&j| !word::is_crossing(words[j]));
        free.for_each(|j| sets.union(i, j as u32));
    }
    let mut members = Vec::from_iter(free().map(|(i, &w)| (sets.root(i), word::level(w), i)));
    members.sort_unstable();
    let groups = members.chunk_by(|a, b| a.0 == b.0);
    groups.map(|group| group.iter().map(|&(_, _, i)| i).collect()).collect()
}

/// Whether any of these leaves has a face on the root's boundary.
pub fn touches_boundary(words: &[u64], leaves: &[u32]) -> bool {
    leaves.iter().any(|&i| word::octant(words[i as usize]).is_at_boundary())
}

/// The first seed in each leaf that contains seeds, by the index of the leaf.
pub fn seeded_leaves(words: &[u64], terms: &Manifest) -> FxHashMap<u32, usize> {
    // In reverse, so that the first seed in a leaf replaces the others.
    let seeds = terms.seeds.iter().enumerate().rev();
    seeds.filter_map(|(seed, &at)| Some((leaf_at(words, at)? as u32, seed))).collect()
}

/// The first seed in some leaves, given the leaves with seeds.
pub fn seed_in(leaves: &[u32], seeded: &FxHashMap<u32, usize>) -> Option<usize> {
    leaves.iter().filter_map(|leaf| seeded.get(leaf)).min().copied()
}

/// The leaves across a face that are at least as coarse. Finer neighbours find this leaf themselves, and so do siblings that
/// precede it: the search among all leaves dominates the time of an audit without a case.
fn coarse_neighbours(words: &[u64], octant: &Octant) -> impl Iterator<Item = usize> {
    let precedes = |face: usize| face.is_multiple_of(2) && octant.digit() >> (face / 2) & 1 == 1;
    let faces = (0..6).filter(move |&face| !precedes(face));
    faces.filter_map(|face| octant.neighbour(across(face))).filter_map(|neighbour| {
        let i = leaf_at(words, neighbour.bounds().0)?;
        (word::level(words[i]) <= neighbour.level).then_some(i)
    })
}

/// The first candidate whose rays agree decides. Without one, the majority of all rays decides.
fn by_rays(leaves: &[u32], words: &[u64], parity: &Parity) -> (Side, Decision) {
    let (mut candidates, mut inside) = (0, 0);
    for &i in leaves.iter().take(CANDIDATES_MAX) {
        let candidate = word::octant(words[i as usize]);
        let odd = parity.inside(candidate.centre()).iter().filter(|&&v| v).count();
        if odd == 0 || odd == 6 {
            let side = if odd == 6 { Side::Inside } else { Side::Outside };
            return (side, Decision::Rays(candidate));
        }
        candidates += 1;
        inside += odd;
    }
    let side = if inside > 3 * candidates { Side::Inside } else { Side::Outside };
    (side, Decision::Majority(candidates, inside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::UNITS_PER_EDGE;
    use contract::testing::random_words;
    use proptest::prelude::*;

    /// Whether two octants share part of a face.
    fn share_face(a: &Octant, b: &Octant) -> bool {
        let ((al, ah), (bl, bh)) = (a.bounds(), b.bounds());
        let overlap = [0, 1, 2].map(|i| ah[i].min(bh[i]) - al[i].max(bl[i]));
        overlap.iter().all(|&o| o >= 0) && overlap.iter().filter(|&&o| o == 0).count() == 1
    }

    proptest! {
        #[test]
        fn groups_are_those_of_a_search_among_all_pairs(words in random_words(3)) {
            let octants: Vec<Octant> = words.iter().map(|&w| word::octant(w)).collect();
            let mut label: Vec<usize> = (0..words.len()).collect();
            let free = |i: usize| word::side(words[i]) != Side::Crossing;
            loop {
                let before = label.clone();
                for i in (0..words.len()).filter(|&i| free(i)) {
                    for j in (0..words.len()).filter(|&j| free(j) && share_face(&octants[i], &octants[j])) {
                        label[i] = label[i].min(label[j]);
                    }
                }
                if label == before {
                    break;
                }
            }
            let mut expected: Vec<Vec<u32>> = (0..words.len())
                .map(|of| (0..words.len()).filter(|&i| free(i) && label[i] == of).map(|i| i as u32).collect())
                .filter(|group: &Vec<u32>| !group.is_empty())
                .collect();
            let order = |&i: &u32| (octants[i as usize].level, i);
            expected.iter_mut().for_each(|group| group.sort_by_key(order));
            let mut found = groups(&words);
            found.sort_by_key(|group| group.iter().min().copied());
            prop_assert_eq!(&found, &expected);
            for group in found {
                let at_boundary = group.iter().any(|&i| {
                    let (low, high) = octants[i as usize].bounds();
                    low.contains(&0) || high.contains(&UNITS_PER_EDGE)
                });
                prop_assert_eq!(touches_boundary(&words, &group), at_boundary);
            }
        }
    }

    /// Edge of a cell of level 4.
    const CELL: i64 = UNITS_PER_EDGE / 16;

    /// The faces of a box with these ends along each axis, in tenths of a cell: two facets each.
    fn cuboid(ends: [[i64; 2]; 3]) -> Vec<FacetLattice> {
        let corner = |i: usize| [0, 1, 2].map(|a: usize| ends[a][i >> a & 1] * CELL / 10);
        let faces =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]].map(|f| f.map(corner));
        faces.into_iter().flat_map(halves).collect()
    }

    /// A box within a box that is within the root or around it.
    #[test]
    fn an_outside_component_is_enclosed_if_another_one_has_a_face_on_the_boundary() {
        let inner = cuboid([[51, 102], [53, 101], [52, 111]]);
        for (outer, enclosed) in [([14, 146], true), ([-14, 174], false)] {
            let body = [&inner[..], &cuboid([outer; 3])].concat();
            let words = contract::testing::base_tree(&body, |_| 4);
            let mut terms = contract::testing::leaf_set(vec![]).manifest;
            let of_cavity = |terms: &Manifest| {
                let cavity = leaf_at(&words, [8 * CELL; 3]).unwrap() as u32;
                let found = find(&words, terms, &body);
                assert_eq!(
                    found.iter().filter(|c| c.enclosed).count(),
                    usize::from(enclosed && terms.deletes_enclosed())
                );
                let component = found.into_iter().find(|c| c.leaves.contains(&cavity)).unwrap();
                (component.side, component.enclosed)
            };
            assert_eq!(of_cavity(&terms), (Side::Outside, false));
            terms.keep = contract::manifest::Keep::Outside;
            assert_eq!(of_cavity(&terms), (Side::Outside, enclosed));
        }
    }

    /// A box around some leaves. A face that is given twice stops no ray, so the rays of all leaves within disagree.
    #[test]
    fn the_majority_of_all_rays_decides_where_the_rays_of_every_candidate_disagree() {
        let terms = contract::testing::leaf_set(vec![]).manifest;
        for twice in 0..=6 {
            let faces = cuboid([[33, 97], [35, 111], [31, 96]]);
            let body = [&faces[..], &faces[..2 * twice]].concat();
            let words = contract::testing::base_tree(&body, |_| 4);
            let found = find(&words, &terms, &body);
            let within = leaf_at(&words, [6 * CELL; 3]).unwrap() as u32;
            let component = found.iter().find(|c| c.leaves.contains(&within)).unwrap();
            assert!(found.len() == 2 && component.leaves.len() > CANDIDATES_MAX);
            let side = if twice < 3 { Side::Inside } else { Side::Outside };
            let ambiguous = (1..6).contains(&twice);
            assert_eq!((component.side, component.is_ambiguous()), (side, ambiguous), "{twice}");
            let other = found.iter().find(|c| c.first != component.first).unwrap();
            assert_eq!((other.side, other.is_ambiguous()), (Side::Outside, false), "{twice}");
        }
    }
}
