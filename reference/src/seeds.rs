//! Seeds: points in the flow, given by the user.
use crate::error::Error;
use crate::lattice::{Input, Seed, location};
use crate::octant::{Extent, ROOT_EDGE, Side};
use crate::tree::{Index, Tree};

/// The leaf that contains each seed, in the order of the seeds.
///
/// # Errors
/// A seed lies outside the root or in a crossing leaf.
pub fn leaves(tree: &Tree, input: &Input) -> Result<Vec<Index>, Error> {
    let mut leaves = Vec::new();
    for (index, seed) in input.seeds.iter().enumerate() {
        let nearest = || nearest_centroid(tree, input, seed);
        match leaf_at(tree, seed.point) {
            Some(leaf) if tree.side(leaf) != Side::Crossing => leaves.push(leaf),
            Some(_) => {
                let nearest = nearest();
                return Err(Error::SeedCrossing { index, seed: seed.given, nearest });
            }
            None => {
                let nearest = nearest();
                return Err(Error::SeedOutside { index, seed: seed.given, nearest });
            }
        }
    }
    Ok(leaves)
}

/// The leaf whose half-open cube contains a lattice point; `None` outside the root. Corners are
/// integers, so the unit cube at the point lies in one leaf.
pub(crate) fn leaf_at(tree: &Tree, point: [i64; 3]) -> Option<Index> {
    let cube = Extent { min: point, max: point.map(|x| x + 1) };
    tree.leaves_meeting(&cube).first().copied()
}

/// The centroid, in the user's unit, of the leaf that no facet crosses and whose centroid is
/// nearest to the seed, clamped to the root. Of several, the coarsest leaf, then the first by key.
/// `None` if facets cross every leaf.
fn nearest_centroid(tree: &Tree, input: &Input, seed: &Seed) -> Option<[f64; 3]> {
    let point = seed.point.map(|x| x.clamp(0, ROOT_EDGE));
    let free = tree.leaves().into_iter().filter(|&leaf| tree.side(leaf) != Side::Crossing);
    let nearest = free.map(|leaf| tree.octant(leaf)).min_by_key(|octant| {
        let centroid = octant.centroid();
        let square: i64 = (0..3).map(|a| (centroid[a] - point[a]).pow(2)).sum();
        (square, octant.coarsest_first())
    })?;
    Some(location(&input.root, nearest.centroid()))
}
