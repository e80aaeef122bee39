//! Facets in a tree of boxes: distances and rays, in lattice units.

use contract::case::Facet;
use contract::lattice::FacetLattice;
pub use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Pose;
pub use parry3d_f64::math::Vector as Point;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use parry3d_f64::query::details::distance_segment_segment;
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape::{Segment, Triangle};
use std::cell::RefCell;
use std::collections::HashSet;

/// What touches a facet is no farther from it than this, in lattice units: it is apart by rounding.
pub const TOUCHING: f64 = 2.0;

/// The facets. Those without area count too: they cross leaves like all others.
pub struct FacetTree {
    triangles: Vec<Triangle>,
    boxes: Bvh,
    /// The numbers of all facets but copies, in ascending order.
    pub firsts: Vec<u32>,
    /// A search from all facets ends when it has visited this number of others, or twice as many where it could do with less: seconds, unless
    /// most facets are close to most others.
    pub visits_max: u64,
}

impl FacetTree {
    /// The facets of a case. Of those that are equal with the same winding, searches visit only the first.
    pub fn new(facets: &[FacetLattice]) -> Self {
        let triangles: Vec<Triangle> = facets.iter().map(triangle).collect();
        let mut seen = HashSet::new();
        let firsts = (0..).zip(facets).filter(|(_, facet)| seen.insert(from_least(**facet)));
        let firsts: Vec<u32> = firsts.map(|(number, _)| number).collect();
        let bounds = firsts.iter().map(|&n| triangles[n as usize].local_aabb()).enumerate();
        let boxes = Bvh::from_iter(BvhBuildStrategy::Binned, bounds);
        Self { visits_max: (1024 * firsts.len() as u64).max(1 << 25), triangles, boxes, firsts }
    }

    /// A facet.
    pub fn triangle(&self, facet: u32) -> &Triangle {
        &self.triangles[facet as usize]
    }

    /// Distance from a point to the nearest facet; infinite without facets.
    pub fn distance(&self, at: Point) -> f64 {
        let from_box =
            |node: &BvhNode, _| (node.mins() - at).max(at - node.maxs()).max(Point::ZERO).length();
        let of_facet = |i: u32, _| Some(from_point(at, self.triangle(self.firsts[i as usize])));
        let nearest = self.boxes.find_best(f64::INFINITY, from_box, of_facet);
        nearest.map_or(f64::INFINITY, |(_, distance)| distance)
    }

    /// The facets no farther than `radius`, nearest first.
    pub fn within(&self, at: Point, radius: f64) -> Vec<u32> {
        let around = Aabb::from_half_extents(at, Point::splat(radius));
        let distance = |facet: &u32| from_point(at, self.triangle(*facet));
        let mut found: Vec<u32> = self.in_box(&around).filter(|f| distance(f) <= radius).collect();
        found.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        found
    }

    /// The facets whose bounding boxes meet a box.
    pub fn in_box<'a>(&'a self, around: &'a Aabb) -> impl Iterator<Item = u32> + 'a {
        self.boxes.intersect_aabb(around).map(|index| self.firsts[index as usize])
    }

    /// The first facets that a ray meets within `reach`, among those that `is_obstacle` accepts, and their distance: several if they
    /// coincide there. Neither depends on the order of facets.
    pub fn first_hits(
        &self,
        ray: &Ray,
        reach: f64,
        is_obstacle: impl Fn(u32) -> bool,
    ) -> (Vec<u32>, f64) {
        let hits = RefCell::new(Vec::new());
        self.boxes.cast_ray(ray, reach, |index, farthest| {
            let facet = self.firsts[index as usize];
            let distance =
                is_obstacle(facet).then(|| met(self.triangle(facet), ray, farthest))??;
            hits.borrow_mut().push((facet, distance));
            // Others at the same distance are visited, too.
            Some(distance + 1.0)
        });
        let hits = hits.into_inner();
        let least = hits.iter().map(|hit| hit.1).fold(f64::INFINITY, f64::min);
        let mut first: Vec<u32> =
            hits.iter().filter(|hit| hit.1 == least).map(|hit| hit.0).collect();
        first.sort_unstable();
        (first, least)
    }
}

/// The bounding box of facets, in the user's units.
pub fn bounds(facets: &[Facet]) -> Aabb {
    Aabb::from_points(facets.as_flattened().iter().map(|v| Point::from(v.map(f64::from))))
}

/// A facet in f64. It begins with its least vertex, so that rounding does not depend on where a file begins it.
pub fn triangle(facet: &FacetLattice) -> Triangle {
    let [a, b, c] = from_least(*facet).map(|v| Point::from_array(v.map(|c| c as f64)));
    Triangle::new(a, b, c)
}

/// The corners of a facet in the same direction around it, from the least one.
pub fn from_least(mut corners: FacetLattice) -> FacetLattice {
    let least = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
    corners.rotate_left(least);
    corners
}

/// Where a ray meets a facet, within `reach` times its direction.
pub fn met(facet: &Triangle, ray: &Ray, reach: f64) -> Option<f64> {
    let at = facet.cast_local_ray(ray, reach, false)?;
    // parry3d mirrors a facet in whose plane a ray begins that leads along its normal.
    (at > 0.0 || from_point(ray.origin, facet) < 1e-3).then_some(at)
}

/// Distance of a point from a triangle, which may have no area.
pub fn from_point(at: Point, facet: &Triangle) -> f64 {
    facet.project_local_point(at, true).point.distance(at)
}

/// Distance of a segment from a triangle's edges.
pub fn from_edges(segment: &Segment, facet: &Triangle) -> f64 {
    let distance = |edge: &Segment| distance_segment_segment(&Pose::IDENTITY, segment, edge);
    facet.edges().iter().map(distance).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Some are segments or points.
    fn facets() -> impl Strategy<Value = Vec<FacetLattice>> {
        let corner = prop::array::uniform3(0i64..4000);
        let facet =
            (prop::array::uniform3(corner), 0..4).prop_map(|([a, b, c], kind)| match kind {
                0 => [a, a, a],
                1 => [a, b, a],
                _ => [a, b, c],
            });
        prop::collection::vec(facet, 0..60)
    }

    /// Points of a triangle, close to each other; their distances do not share code with the tree's.
    fn samples(facet: &FacetLattice) -> impl Iterator<Item = Point> {
        const PARTS: i32 = 40;
        let [a, b, c] = facet.map(|v| Point::from_array(v.map(|c| c as f64)));
        let part = |i: i32| f64::from(i) / f64::from(PARTS);
        (0..=PARTS).flat_map(move |i| {
            (0..=PARTS - i).map(move |j| a + (b - a) * part(i) + (c - a) * part(j))
        })
    }

    proptest! {
        #[test]
        fn the_nearest_facet_is_found_among_all(facets in facets(), at in prop::array::uniform3(-99.0f64..4099.0)) {
            let (tree, at) = (FacetTree::new(&facets), Point::from_array(at));
            let of = |f: &FacetLattice| samples(f).map(|p| p.distance(at)).fold(f64::INFINITY, f64::min);
            let expected = facets.iter().map(of).fold(f64::INFINITY, f64::min);
            let found = tree.distance(at);
            // Samples of a facet are at most 250 apart.
            prop_assert!(facets.is_empty() || (found <= expected && expected <= found + 130.0), "{found} for {expected}");
            prop_assert_eq!(facets.is_empty(), found.is_infinite());
            let within = tree.within(at, found * 1.5);
            let by_hand = facets.iter().filter(|f| from_point(at, &triangle(f)) <= found * 1.5).count();
            prop_assert!(facets.is_empty() || (within.len() == by_hand && from_point(at, tree.triangle(within[0])) == found));
        }

        #[test]
        fn a_ray_meets_the_first_facet_on_its_way(
            facets in facets(), at in prop::array::uniform3(0.0f64..4000.0), axis in 0usize..3, in_planes in any::<bool>(),
        ) {
            // It begins in the planes of the facets.
            let (mut facets, mut at) = (facets, at);
            if in_planes {
                at[axis] = at[axis].round();
                facets.iter_mut().flatten().for_each(|v| v[axis] = at[axis] as i64);
            }
            let tree = FacetTree::new(&facets);
            let ray = Ray::new(Point::from_array(at), [Point::X, Point::Y, Point::Z][axis]);
            let (first, distance) = tree.first_hits(&ray, 5000.0, |_| true);
            let [facet, ..] = first[..] else { return Ok(()) };
            prop_assert!(from_point(ray.point_at(distance), tree.triangle(facet)) < 1e-3);
            let (_, farther) = tree.first_hits(&ray, 5000.0, |other| !first.contains(&other));
            prop_assert!(farther > distance);
        }
    }
}
