//! Sides by their definition: over faces, by rays and by seeds. The rays, the search for a seed's leaf and the messages share no code
//! with the phase.

use super::{beside, is_in_leaf, require, to_owners};
use crate::input::lattice::Keep;
use crate::sides::nodes::open_bricks;
use crate::sides::{Base, Decided, Sides};
use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::facet::Facet;
use bricks::octant::{Level, corner, edge, path};
use bricks::tree::{LEVELS, PerLevel};

/// Components whose rays are cast: enough to find a fault, on any geometry.
const COMPONENTS_MAX: usize = 64;

/// Leaves that share part of a face are on one side, whichever ranks own them. Collective.
pub fn agree_over_faces(sides: &Sides, base: &Base) {
    let &Base { tree, ownership, comm, .. } = base;
    let stored = &sides.stored;
    let others: PerLevel = std::array::from_fn(|l| {
        let mut on_side = stored[l].cursor();
        let open = open_bricks(tree, ownership, l as Level);
        open.map(|b| Brick { key: b.key, bits: b.open & !on_side.get(b.key) }).collect()
    });
    for (here, there) in [(stored, &others), (&others, stored)] {
        for l in 0..LEVELS as Level {
            let owned = ownership.owned(l, &here[l as usize]);
            let steps = |b: Brick| (0..3).flat_map(move |axis| beside(l, b, axis));
            let near = BrickSet::from_unsorted(owned.flat_map(steps).collect());
            let near = to_owners(near, l, ownership, comm);
            for code in near.without(&here[l as usize]).without(&tree.split[l as usize]).codes() {
                let is_apart = !is_in_leaf(there, l, code);
                require(is_apart, l, code, "is on another side than a leaf across a face");
            }
        }
    }
}

/// The first leaf of each component is stored as its verdict asks; without seeds, the verdict is that of its rays if all six agree.
/// Collective.
pub fn components(decided: &Decided, base: &Base) {
    let Decided { sides, components, verdict, .. } = decided;
    let &Base { ownership, facets, rules, comm, .. } = base;
    for &(label, first) in components {
        let (l, code) = first.leaf();
        let is_inside = verdict.inside.contains(&label);
        let is_stored = match sides.keep {
            Keep::Outside => is_inside || verdict.enclosed.contains(&label),
            Keep::Inside => !is_inside,
            Keep::All => is_inside,
        };
        let is_here = ownership.owns(l, code >> 6) && sides.stored[l as usize].contains(code);
        let holders = comm.sum(u64::from(is_here));
        let place = path(l, code);
        assert_eq!(holders, u64::from(is_stored), "octant {place} of level {l}: its side");
    }
    if !rules.seeds.is_empty() {
        let flow = match rules.keep {
            Keep::Inside => sides.summary.inside,
            Keep::Outside | Keep::All => sides.summary.outside,
        };
        assert!((1..=rules.seeds.len() as u64).contains(&flow), "{flow} components have seeds");
        return;
    }
    let some = &components[..components.len().min(COMPONENTS_MAX)];
    let odd: Vec<u64> = some.iter().map(|part| odd_rays(facets, part.1.centroid())).collect();
    let all = comm.all_gather(&odd);
    for (i, &(label, first)) in some.iter().enumerate() {
        let odd = all.messages().fold(0, |odd, (_, theirs)| odd ^ theirs[i]);
        if odd == 0 || odd == 63 {
            let (l, code) = first.leaf();
            let is_inside = verdict.inside.contains(&label);
            let place = path(l, code);
            assert_eq!(is_inside, odd == 63, "octant {place} of level {l}: its side by rays");
        }
    }
}

/// The leaves that contain seeds are flow.
pub fn seeds(sides: &Sides, base: &Base) {
    let &Base { tree, ownership, rules, .. } = base;
    for seed in &rules.seeds {
        let (mut l, mut code) = (0, 0);
        while tree.split[l as usize].contains(code) {
            let (min, half) = (corner(l, code), edge(l + 1));
            let is_upper = |a: usize| u64::from(seed.lattice[a] >= min[a] + half);
            code = code << 3 | is_upper(0) | is_upper(1) << 1 | is_upper(2) << 2;
            l += 1;
        }
        if ownership.owns(l, code >> 6) {
            let is_stored = sides.stored[l as usize].contains(code);
            let is_crossing = tree.crossing[l as usize].contains(code);
            let wanted = sides.keep == Keep::All && rules.keep == Keep::Inside;
            let is_flow = is_stored == wanted && !is_crossing;
            require(is_flow, l, code, "has a seed, but is no flow");
        }
    }
}

/// For each of the rays from a point, up and down each axis, whether it meets an odd number of facets: a bit each.
fn odd_rays(facets: &[Facet], p: [i64; 3]) -> u64 {
    let rays = facets.iter().flat_map(|f| (0..3).filter_map(move |a| ray_that_meets(f, p, a)));
    rays.fold(0, |odd, ray| odd ^ 1 << ray)
}

/// The ray along an axis that meets a facet, from a point that is on no facet. In units of 2^-62 the point is displaced by 2^31 and
/// by 1 along the other axes: little enough to pass no other edge, as coordinates differ by less than 2^29. All terms are
/// below 2^122.
fn ray_that_meets(f: &Facet, p: [i64; 3], axis: usize) -> Option<usize> {
    const ONE: i128 = 1 << 62;
    let (u, w) = ((axis + 1) % 3, (axis + 2) % 3);
    let to = f.v.map(|v| -> [i128; 3] { [0, 1, 2].map(|a| i128::from(v[a]) - i128::from(p[a])) });
    let (mut left, mut right, mut volume) = (true, true, 0);
    for i in 0..3 {
        let (a, b, c) = (to[i], to[(i + 1) % 3], to[(i + 2) % 3]);
        let turn = (b[u] - a[u]) * (1 - a[w] * ONE) - (b[w] - a[w]) * ((1 << 31) - a[u] * ONE);
        (left, right) = (left && turn > 0, right && turn < 0);
        volume += a[axis] * (b[u] * c[w] - b[w] * c[u]);
    }
    // The facet is above if it is seen counter-clockwise from above and the tetrahedron that it forms with the point is positive.
    (left || right).then_some(2 * axis + usize::from((volume > 0) == left))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sides::rays::parities;
    use proptest::prelude::*;

    proptest! {
        /// Two countings of rays: on a coarse grid, where most rays meet edges and vertices.
        #[test]
        fn both_countings_of_rays_agree(
            facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1i32..=4)), 1..8),
            p in prop::array::uniform3(0i64..4),
        ) {
            let on_grid = |v: [[i32; 3]; 3]| Facet { v: v.map(|p| p.map(|c| 2 * c * (1 << 24))) };
            let facets: Vec<Facet> = facets.into_iter().map(on_grid).collect();
            let p = p.map(|c| (2 * c + 1) * (1 << 24));
            // Rays are defined for points that are on no facet.
            let in_plane = |f: &Facet| {
                let n = f.normal();
                let at = |a: usize| i128::from(n[a]) * i128::from(p[a] - i64::from(f.v[0][a]));
                at(0) + at(1) + at(2) == 0
            };
            let facets: Vec<Facet> = facets.into_iter().filter(|f| !in_plane(f)).collect();
            prop_assert_eq!(odd_rays(&facets, p), u64::from(parities(&facets, &[p])[0]));
        }
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let met = |a: &[i128]| {
            let v = [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32));
            let point = [9, 10, 11].map(|i| a[i] as i64);
            let ray = ray_that_meets(&Facet { v }, point, a[12] as usize);
            ray.map(|ray| ray as i128).into_iter().collect()
        };
        crate::values::compare("src/check/sides.rs", &[("ray_that_meets", &met)]);
    }
}
