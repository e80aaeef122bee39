//! The distance from a point or a square to the nearest facet, in lattice units.

use contract::lattice::FacetLattice;

use crate::geometry::boxes::{Bounds, Boxes};
use crate::geometry::distance::{self, Prepared};

/// Exceeds the rounding of a distance, in lattice units.
pub const ROUNDING: f64 = 1.0;

/// A point, in lattice units.
pub type Point = [f64; 3];

/// A point and its distance to the nearest facet, in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The point.
    pub at: Point,
    /// The distance: half the free width.
    pub clearance: f64,
    /// Step of the grid that the point is from; infinite for a point of a leaf, and near the edge of a first grid.
    pub step: f64,
    /// Greatest distance of the next points if they are of the same grid; 0 otherwise.
    pub apart: f64,
}

impl Spot {
    /// Radius of a ball that passes from this point to the next ones: a facet that leaves this clearance at two points of a grid can
    /// be nearer between them.
    pub fn passing(&self) -> f64 {
        (self.clearance.powi(2) - self.apart.powi(2) / 4.0).max(0.0).sqrt()
    }
}

/// Step of a grid that is fine enough, in parts of the clearance.
pub const PRECISION: f64 = 1e-3;

/// The facets, arranged for nearest-facet queries. Facets without area count too: they cross leaves like all others.
#[derive(Debug)]
pub struct Clearance<'a> {
    facets: &'a [FacetLattice],
    boxes: Option<Boxes>,
}

impl<'a> Clearance<'a> {
    /// The facets of a case.
    pub fn new(facets: &'a [FacetLattice]) -> Self {
        Self { facets, boxes: (!facets.is_empty()).then(|| Boxes::of_all(facets)) }
    }

    /// Distance from a point to the nearest facet, but no more than `bound` and a lattice unit; infinite if there is neither.
    pub fn at(&self, point: Point, bound: f64) -> f64 {
        // Rounding must not exclude the facet that the bound comes from.
        let mut best = (bound + ROUNDING) * (bound + ROUNDING);
        self.within(point, &mut best, &mut |squared, _, best| *best = squared.min(*best));
        best.sqrt()
    }

    /// Distance from a square that no facet enters to the nearest facet; infinite without facets. The square has its corners in
    /// order around it, and lies in a plane normal to an axis. `bound` is an upper bound that the caller knows.
    pub fn at_square(&self, corners: &[Point; 4], bound: f64) -> f64 {
        let mut best = (bound + ROUNDING) * (bound + ROUNDING);
        let fold = |f: fn(f64, f64) -> f64| -> Point {
            std::array::from_fn(|a| corners.iter().map(|c| c[a]).fold(corners[0][a], f))
        };
        let (low, high) = (fold(f64::min), fold(f64::max));
        self.search(
            |bounds| bounds.distance_squared_to_box(low, high),
            |triangle| distance::from_square(corners, triangle),
            &mut best,
            &mut |squared, _, best| *best = squared.min(*best),
        );
        best.sqrt()
    }

    /// The facets nearer than `radius`, each with its distance, nearest first.
    pub fn facets_within(&self, point: Point, radius: f64) -> Vec<(u32, f64)> {
        let mut found = Vec::new();
        let mut limit = radius * radius;
        self.within(point, &mut limit, &mut |squared, facet, _| {
            found.push((facet, squared.sqrt()))
        });
        found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        found
    }

    /// The facets that can be the nearest one, and nearer than `open`, of a point at most `radius` from `centre`, with their distances
    /// from the centre, nearest first; `None` if they are more than `most`.
    pub fn near(
        &self,
        centre: Point,
        radius: f64,
        open: f64,
        most: usize,
    ) -> Option<Vec<(Prepared, f64)>> {
        // The nearest facet of such a point is farther from the centre than the nearest of all by at most twice the radius.
        let reach = (self.at(centre, open + radius) + radius).min(open) + radius + ROUNDING;
        let (mut found, mut limit) = (Vec::new(), reach * reach);
        self.within(centre, &mut limit, &mut |squared, facet, limit| {
            found.push((facet, squared.sqrt()));
            if found.len() > most {
                // Nothing is nearer, so the search ends.
                *limit = 0.0;
            }
        });
        if found.len() > most {
            return None;
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        let prepared = |(facet, from)| (Prepared::new(&self.triangle(facet)), from);
        Some(found.into_iter().map(prepared).collect())
    }

    /// A nearest point of the nearest facet.
    pub fn nearest(&self, point: Point) -> Option<Point> {
        let mut nearest = None;
        let mut best = f64::INFINITY;
        self.within(point, &mut best, &mut |squared, facet, best| {
            *best = squared;
            nearest = Some(distance::from_point(point, &self.triangle(facet)).1);
        });
        nearest
    }

    fn triangle(&self, facet: u32) -> [Point; 3] {
        self.facets[facet as usize].map(|v| v.map(|c| c as f64))
    }

    /// Calls `visit` with the squared distance and the number of every facet that is nearer than the square root of
    /// `limit`, which `visit` may lower.
    fn within(&self, point: Point, limit: &mut f64, visit: &mut impl FnMut(f64, u32, &mut f64)) {
        self.search(
            |bounds| bounds.distance_squared_to_box(point, point),
            |triangle| Prepared::new(triangle).squared(point),
            limit,
            visit,
        );
    }

    /// The same for anything with a squared distance from boxes and from triangles.
    fn search(
        &self,
        from_box: impl Fn(&Bounds) -> f64,
        from_triangle: impl Fn(&[Point; 3]) -> f64,
        limit: &mut f64,
        visit: &mut impl FnMut(f64, u32, &mut f64),
    ) {
        let Some(boxes) = &self.boxes else { return };
        boxes.search(
            |_, from, members| {
                if from >= *limit {
                    return false;
                }
                for i in members.into_iter().flatten() {
                    if from_box(&boxes.bounds[i]) >= *limit {
                        continue;
                    }
                    let facet = boxes.facets[i];
                    let squared = from_triangle(&self.triangle(facet));
                    if squared < *limit {
                        visit(squared, facet, limit);
                    }
                }
                true
            },
            &from_box,
        );
    }
}

/// Distance from a point to the nearest of some triangles, given with their distances from a centre, nearest first; the point is
/// `offset` from this centre. The index of a triangle as an error if the distance is not greater than `least`.
pub fn nearest<'a>(
    triangles: impl Iterator<Item = (&'a Prepared, f64)>,
    point: Point,
    offset: f64,
    least: f64,
) -> Result<f64, usize> {
    let mut best = f64::INFINITY;
    for (i, (triangle, from_centre)) in triangles.enumerate() {
        let possible = from_centre - offset - ROUNDING;
        if possible > 0.0 && possible * possible > best {
            break;
        }
        best = triangle.squared(point).min(best);
        if best <= least * least {
            return Err(i);
        }
    }
    Ok(best.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn facets() -> impl Strategy<Value = Vec<FacetLattice>> {
        let corner = prop::array::uniform3(0i64..4000);
        // Some facets are segments or points.
        let facet =
            (prop::array::uniform3(corner), 0..4).prop_map(|([a, b, c], kind)| match kind {
                0 => [a, a, a],
                1 => [a, b, a],
                _ => [a, b, c],
            });
        prop::collection::vec(facet, 1..60)
    }

    #[test]
    fn a_facet_between_two_points_of_a_grid_can_be_nearer_than_to_both() {
        let passing =
            |clearance, apart| Spot { at: [0.0; 3], clearance, step: 1.0, apart }.passing();
        assert_eq!([passing(5.0, 0.0), passing(5.0, 8.0), passing(5.0, 11.0)], [5.0, 3.0, 0.0]);
    }

    proptest! {
        #[test]
        fn the_nearest_facet_is_found_among_all(facets in facets(), point in prop::array::uniform3(-99.0f64..4099.0)) {
            let clearance = Clearance::new(&facets);
            let triangle = |f: &FacetLattice| f.map(|v| v.map(|c| c as f64));
            let distances: Vec<f64> = facets.iter().map(|f| distance::from_point(point, &triangle(f)).0.sqrt()).collect();
            let expected = distances.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert_eq!(clearance.at(point, f64::INFINITY), expected);
            prop_assert_eq!(clearance.at(point, expected), expected);
            let below = expected / 2.0;
            prop_assert!((below..=expected).contains(&clearance.at(point, below)));
            let nearest = clearance.nearest(point).map(|at| distance::length(distance::sub(at, point)));
            prop_assert!(nearest.is_some_and(|found| (found - expected).abs() <= 1e-9 * (1.0 + expected)));
            let within = clearance.facets_within(point, expected * 1.5 + 1.0);
            prop_assert_eq!(within.len(), distances.iter().filter(|&&d| d < expected * 1.5 + 1.0).count());
            prop_assert_eq!(within[0].1, expected);
        }

        #[test]
        fn the_nearest_facet_of_every_point_of_a_ball_is_near_it(
            facets in facets(), centre in prop::array::uniform3(0.0f64..4000.0), radius in 0.0f64..900.0,
            open in 0.0f64..2000.0,
            points in prop::collection::vec((prop::array::uniform3(-1.0f64..1.0), 0.0f64..1.0), 20),
        ) {
            let clearance = Clearance::new(&facets);
            let near = clearance.near(centre, radius, f64::INFINITY, usize::MAX).unwrap();
            let below = clearance.near(centre, radius, open, usize::MAX).unwrap();
            prop_assert!(below.len() <= near.len());
            for (direction, part) in points {
                let length = direction.map(|c| c * c).iter().sum::<f64>().sqrt().max(1e-9);
                let at = [0, 1, 2].map(|a| centre[a] + direction[a] * part * radius / length);
                let found = near.iter().map(|t| t.0.squared(at)).fold(f64::INFINITY, f64::min).sqrt();
                let expected = clearance.at(at, f64::INFINITY);
                prop_assert_eq!(found, expected);
                let found = below.iter().map(|t| t.0.squared(at)).fold(f64::INFINITY, f64::min).sqrt();
                prop_assert!(found == expected || found.min(expected) >= open, "{} for {}", found, expected);
            }
            let is_found = |most| clearance.near(centre, radius, f64::INFINITY, most).is_some();
            prop_assert!(is_found(near.len()) && !is_found(near.len() - 1));
        }

        #[test]
        fn the_facet_nearest_to_a_square_is_found_among_all(
            facets in facets(), at in prop::array::uniform3(-99.0f64..4099.0), edge in 1.0f64..500.0
        ) {
            let clearance = Clearance::new(&facets);
            let square = [(0.0, 0.0), (edge, 0.0), (edge, edge), (0.0, edge)]
                .map(|(y, z)| [at[0], at[1] + y, at[2] + z]);
            let triangle = |f: &FacetLattice| f.map(|v| v.map(|c| c as f64));
            let distances = facets.iter().map(|f| distance::from_square(&square, &triangle(f)).sqrt());
            let expected = distances.fold(f64::INFINITY, f64::min);
            prop_assert_eq!(clearance.at_square(&square, f64::INFINITY), expected);
            prop_assert_eq!(clearance.at_square(&square, expected), expected);
            prop_assert!(expected <= clearance.at(square[0], f64::INFINITY));
        }
    }
}
